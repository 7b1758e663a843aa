"""Simulated CNR maps of a site's hard targets: a rehearsal of the field test, with a head that stands as is planted."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from geometry.arrays import FloatArray
from geometry.errors import InputError
from geometry.head import Mounting
from planner.cnr_map import MapPlan, plan_map
from planner.hard_targets import sought
from planner.places import Places
from planner.site import Lidar
from reconstruct.cnr_map import CnrMap
from reconstruct.cnr_simulation import Signal, simulate_cnr_map
from reconstruct.hard_target import BEAM_WIDTH_M
from reconstruct.records import Records

# What can be planted, by the names of the mounting's fields.
PLANTABLE = (
    "heading_deg",
    "pitch_deg",
    "roll_deg",
    "azimuth_offset_deg",
    "elevation_offset_deg",
    "range_offset_m",
)
START = np.datetime64("2000-01-01T00:00:00", "ns")  # of the first ray: a rehearsal has no date


class Rehearsal(NamedTuple):
    """Maps as the head of a lidar would measure them, and how it and the targets stand in them."""

    lidar: Lidar
    planted: dict[str, float]  # how the head stands, less what the site file says
    mounting: Mounting  # how it stands
    head_off_m: FloatArray  # (3,) east, north, up: where the head is, less where the site file has it
    plans: tuple[MapPlan, ...]
    maps: tuple[tuple[str, CnrMap], ...]  # target and its map, in the order of time


def rehearse(
    places: Places,
    lidar: str,
    targets: Sequence[str],
    *,
    rng: np.random.Generator,
    planted: Mapping[str, float] | None = None,
    pulse_ns: float | None = None,
    fft_points: int | None = None,
    beam_width_m: float = BEAM_WIDTH_M,
    signal: Signal | None = None,
) -> Rehearsal:
    """Plan the map of each target and simulate what it gives.

    Parameters
    ----------
    places, lidar, targets
        The site, the lidar, and the hard targets in the order in which they are mapped.
    rng : numpy.random.Generator
        Source of noise and of errors of the survey.
    planted : mapping of field of the mounting to number, optional
        How the head stands, less what the site file says; what is not named is as the site file says. Without
        it all is drawn from the lidar's stated uncertainties.
    pulse_ns, fft_points, beam_width_m
        As in `plan_map`.
    signal : Signal, optional
        How strong and noisy the maps are.

    Raises
    ------
    InputError
        If a name is unknown, or a target out of reach.

    Notes
    -----
    Head and targets stand off their surveyed positions by what the site file says of both, in all maps by the same.
    """
    chosen = places.site.lidar(lidar)
    off = dict(planted) if planted is not None else _drawn(chosen, rng)
    unknown = [name for name in off if name not in PLANTABLE]
    if unknown:
        raise InputError(f"{', '.join(unknown)} came; what can be planted: {', '.join(PLANTABLE)}")
    before = places.mounting(chosen)
    mounting = replace(before, **{name: getattr(before, name) + value for name, value in off.items()})
    head_off_m = rng.normal(0.0, chosen.uncertainty.position_m, 3)
    surveyed = {name: sought(places.site, name) for name in targets}
    off_m = {
        name: rng.normal(0.0, target.uncertainty_m, 3) - head_off_m for name, (target, _) in surveyed.items()
    }
    plans, maps = [], []
    for name in targets:
        plan = plan_map(
            places, lidar, name, beam_width_m=beam_width_m, pulse_ns=pulse_ns, fft_points=fft_points
        )
        cnr_map = simulate_cnr_map(
            *plan.windows[-1].rays,
            plan.gates.centres_m,
            target_m=places.frame.enu_m(chosen.position, surveyed[name][1]) + off_m[name],
            shape=plan.target.shape,
            size_m=plan.target.size_m,
            probe=plan.probe,
            rng=rng,
            mounting=mounting,
            beam_width_m=beam_width_m,
            signal=signal,
        )
        plans.append(plan)
        maps.append((name, cnr_map))
    return Rehearsal(chosen, off, mounting, head_off_m, tuple(plans), tuple(maps))


def _drawn(lidar: Lidar, rng: np.random.Generator) -> dict[str, float]:
    """How a head that was set up as stated may stand."""
    unsure = lidar.uncertainty
    stds = {
        "azimuth_offset_deg": unsure.heading_deg,
        "elevation_offset_deg": unsure.elevation_deg,
        "pitch_deg": unsure.levelling_deg,
        "roll_deg": unsure.levelling_deg,
        "range_offset_m": unsure.range_m,
    }
    return {name: float(rng.normal(0.0, std)) for name, std in stds.items()}


def map_records(cnr_map: CnrMap, plan: MapPlan) -> Records:
    """A map as the rays of a measurement; a hard target has no radial speed."""
    seconds = plan.windows[-1].accumulation_s
    rays = cnr_map.azimuth_deg.size
    step = plan.windows[-1].time_s / rays
    return Records(
        time_utc=START + (1e9 * (np.arange(rays) * step + 0.5 * seconds)).astype("timedelta64[ns]"),
        duration_s=np.full(rays, seconds),
        azimuth_deg=np.mod(cnr_map.azimuth_deg, 360.0),
        elevation_deg=cnr_map.elevation_deg,
        scan_id=np.zeros(rays, dtype=np.int64),
        sweep_id=np.zeros(rays, dtype=np.int64),
        range_m=cnr_map.range_m,
        radial_speed_mps=np.zeros_like(cnr_map.cnr_db),
        cnr_db=cnr_map.cnr_db,
        instrument=plan.lidar.name,
    )
