"""Measured CNR maps of a lidar's hard targets -> how its head stands, and the drift between repeated maps."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from geometry.angles import difference_deg
from geometry.beams import beam_to
from geometry.errors import InputError
from geometry.gates import Probe
from geometry.head import Mounting
from planner.handover.names import file_stem
from planner.hard_targets import names_of, sought
from planner.places import Places
from planner.site import HardTarget, Lidar, Site
from reconstruct.cnr_map import CnrMap, map_of
from reconstruct.hard_target import BEAM_WIDTH_M, FoundTarget, find_target
from reconstruct.mounting_fit import SIGNIFICANT_CHANCE, MountingFit, fit_mounting
from reconstruct.sightings import ANGLES, Angle, Sighting


class Mapped(NamedTuple):
    """One map of one target, and what was found in it."""

    name: str  # of the target; "tip (2)" for its second map
    target: HardTarget
    cnr_map: CnrMap
    found: FoundTarget
    sighting: Sighting


class Drift(NamedTuple):
    """What changed from the first to the last map of one target; NaN where its shape does not tell."""

    target: str
    maps: int
    azimuth_deg: float
    elevation_deg: float
    range_m: float
    azimuth_std_deg: float
    elevation_std_deg: float
    range_std_m: float

    @property
    def chance(self) -> float:
        """How often a head that has not moved seems to move as much: chi square of what is known of the three."""
        from scipy.special import chdtrc

        moved, std = np.array(self[2:5]), np.array(self[5:8])
        known = np.isfinite(moved) & np.isfinite(std) & (std > 0)
        return float(chdtrc(known.sum(), ((moved[known] / std[known]) ** 2).sum())) if known.any() else 1.0

    @property
    def is_significant(self) -> bool:
        """Whether that is under 5 %: three numbers at two standard deviations each would cry wolf in 13 %."""
        return self.chance < SIGNIFICANT_CHANCE


class HeadFit(NamedTuple):
    """The evaluation of a lidar's maps."""

    lidar: Lidar
    before: Mounting
    maps: tuple[Mapped, ...]
    fit: MountingFit
    drifts: tuple[Drift, ...]


def read_maps(named: Sequence[str], site: Site) -> list[tuple[str, CnrMap]]:
    """Read maps given as FILE or TARGET=FILE; a target that is not said is the one after which its file is called.

    Raises
    ------
    InputError
        If a file cannot be read as rays, or has no CNR.
    """
    from reconstruct.formats.reading import read

    called = {file_stem(name): name for name in names_of(site)}
    maps = []
    for text in named:
        target, equals, file = text.partition("=")
        path = file if equals and not Path(text).exists() else text
        stem = Path(text).name.split(".")[0]
        name = target if path == file and equals else called.get(stem, stem)
        maps.append((name, map_of(read(path))))
    return maps


def fit_head(
    places: Places,
    lidar: str,
    maps: Sequence[tuple[str, CnrMap]],
    *,
    probe: Probe,
    solve: tuple[Angle, ...] = ANGLES,
    beam_width_m: float = BEAM_WIDTH_M,
) -> HeadFit:
    """Find the targets in their maps and solve for how the head stands.

    Parameters
    ----------
    places, lidar
        The site, and the name of the lidar that measured.
    maps : sequence of (target, CnrMap)
        In the order of time; a target may come several times.
    probe : Probe
        Pulse and window of the maps.
    solve, beam_width_m
        As in `mounting_fit.fit_mounting` and `hard_target.find_target`.

    Raises
    ------
    InputError
        If a map shows no target, several, or one that is cut off (each such map is named), or the targets do
        not determine what is solved for.
    """
    chosen = places.site.lidar(lidar)
    mapped, faults = [], []
    for number, (name, cnr_map) in enumerate(maps):
        earlier = sum(other == name for other, _ in maps[:number])
        try:
            target, _ = sought(places.site, name)
            found = find_target(
                cnr_map, shape=target.shape, size_m=target.size_m, probe=probe, beam_width_m=beam_width_m
            )
        except InputError as error:
            faults.append(f"map {number + 1} ({name}): {error}")
            continue
        label = name if not earlier else f"{name} ({earlier + 1})"
        mapped.append(Mapped(label, target, cnr_map, found, _sighting(places, chosen, label, name, found)))
    if faults:
        raise InputError("no offsets from these maps:\n  " + "\n  ".join(faults))
    before = places.mounting(chosen)
    moved = drifts(mapped)
    try:
        fit = fit_mounting(
            [item.sighting for item in mapped],
            start=before,
            solve=solve,
            head_std_m=chosen.uncertainty.position_m,
        )
    except InputError as error:
        turned = [item.target for item in moved if item.is_significant]
        if not turned:
            raise
        raise InputError(
            f"{error}. Between its first and last map {', '.join(turned)} has moved as the head shows it: fit the maps "
            "of each test by themselves"
        ) from error
    return HeadFit(chosen, before, tuple(mapped), fit, moved)


def drifts(mapped: Sequence[Mapped]) -> tuple[Drift, ...]:
    """Last less first map of each target that was mapped more than once; the survey's errors cancel."""
    names = dict.fromkeys(item.target.name for item in mapped)
    found = []
    for name in names:
        times = [item.found for item in mapped if item.target.name == name]
        if len(times) > 1:
            first, last = times[0], times[-1]
            stds = [
                float(np.hypot(one, two)) for one, two in zip(first[3:6], last[3:6], strict=True)
            ]  # azimuth, elevation, range
            moved = (
                float(difference_deg(last.azimuth_deg, first.azimuth_deg)),
                last.elevation_deg - first.elevation_deg,
                last.range_m - first.range_m,
            )
            told = [
                value if np.isfinite(std) else float("nan") for value, std in zip(moved, stds, strict=True)
            ]
            found.append(Drift(name, len(times), *told, *stds))
    return tuple(found)


def site_keys(result: HeadFit) -> dict[str, float]:
    """The site file's keys of the lidar that the fit changes, and their new values, rounded to what they mean.

    A zero at grid north is part of the heading that was solved with; the site file has it in `north`.
    """
    new = result.fit.mounting
    turned = new.heading_deg - result.before.heading_deg
    mounting = replace(new, heading_deg=result.lidar.mounting.heading_deg + turned)
    keys: dict[str, float] = {}
    for angle in result.fit.solved:
        key = angle if angle.endswith("offset_deg") else f"mounting.{angle}"
        keys[key] = round(getattr(mounting, angle), 4)
    if np.isfinite(result.fit.range_std_m):
        keys["mounting.range_offset_m"] = round(mounting.range_offset_m, 2)
    return keys


def _sighting(places: Places, lidar: Lidar, label: str, name: str, found: FoundTarget) -> Sighting:
    target, position = sought(places.site, name)
    there = np.asarray(places.frame.enu_m(lidar.position, position))
    range_m = found.range_m
    if target.shape == "mast":  # met below its top: as far in plan, not along the beam
        _, hit_deg = places.mounting(lidar).to_true(found.azimuth_deg, found.elevation_deg)
        top_deg = beam_to(there).elevation_deg
        range_m *= float(np.cos(np.deg2rad(hit_deg)) / np.cos(np.deg2rad(top_deg)))
    return Sighting(
        label,
        there,
        found.azimuth_deg,
        found.elevation_deg,
        range_m,
        found.azimuth_std_deg,
        found.elevation_std_deg,
        found.range_std_m,
        target.uncertainty_m,
    )
