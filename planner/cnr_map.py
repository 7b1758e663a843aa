"""A CNR map planned: where to scan for a hard target, in which steps and gates, how long, and what else is there."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from geometry.angles import difference_deg
from geometry.errors import InputError
from geometry.gates import Gates, Probe, window_ns
from planner.cnr_window import WINDOW_STDS, Order, Window, windows
from planner.hard_targets import Expected, Neighbour, candidates, expected, hiding, neighbours, sought
from planner.over_terrain import target_sight
from planner.places import Places
from planner.site import HardTarget, Lidar
from planner.target_ground import GroundMet, ground_met
from reconstruct.hard_target import BEAM_WIDTH_M
from reconstruct.sightings import Angle, solvable
from reconstruct.target_choice import Choice, best_targets

DEFAULT_ACCUMULATION_S = 0.1
LONG_MAP_S = (
    1800.0  # from here on it is said what makes a map long: light and head change in an hour, ASSUMED
)
GATE_M = 1.0


class MapPlan(NamedTuple):
    """A planned map."""

    lidar: Lidar
    target: HardTarget
    expected: Expected
    beam_deg: float  # diameter of the beam at the target
    size_deg: float  # of the target
    windows: tuple[Window, ...]
    gates: Gates
    probe: Probe
    others: tuple[tuple[Neighbour, bool], ...]  # in the window, and whether within the gates too
    hidden_by: tuple[str, ...]
    ground: GroundMet | None  # where rays of the fine window meet it
    notes: tuple[str, ...]

    @property
    def time_s(self) -> float:
        """All windows together [s]."""
        return sum(window.time_s for window in self.windows)


def plan_map(
    places: Places,
    lidar: str,
    target: str,
    *,
    order: Order = "rows",
    accumulation_s: float | None = None,
    heading_std_deg: float | None = None,
    beam_width_m: float = BEAM_WIDTH_M,
    pulse_ns: float | None = None,
    fft_points: int | None = None,
) -> MapPlan:
    """Plan the map of one hard target.

    Parameters
    ----------
    places : Places
        The site in its frame.
    lidar, target : str
        Names; the target is a hard target, or a mast or turbine, whose top is taken.
    order : {"rows", "columns"}
        PPI rows or RHI columns.
    accumulation_s : float, optional
        Of one ray [s]; the instrument's least by default.
    heading_std_deg : float, optional
        How well the heading is known, in place of the site file's; 60° or more is not at all.
    beam_width_m : float
        Diameter at 1/e² of the beam at the target [m].
    pulse_ns, fft_points
        Of the pulse to map with; the instrument's own by default.

    Raises
    ------
    InputError
        If a name is unknown, the target is out of reach, or the window takes too many rays.

    Notes
    -----
    The window is three standard deviations to each side, and the target with a margin. The step is a quarter of
    the target, but no finer than half the beam: an edge is then seen by a ray that is partly hit. With a heading
    known to no better than 1° one coarse row, a target's width apart, finds the mast first.
    """
    chosen = places.site.lidar(lidar)
    sought_target, position = sought(places.site, target)
    seen = expected(places, chosen, position, sought_target.uncertainty_m, heading_std_deg=heading_std_deg)
    reach = float(seen.true.range_m)
    device = chosen.device
    if not (device.min_range_m or 0.0) <= reach <= (device.max_range_m or np.inf):
        raise InputError(
            f"{target} is {reach:.0f} m from {lidar}; allowed: {device.min_range_m or 0:g} to "
            f"{device.max_range_m or np.inf:g} m. Choose another target"
        )
    per_m = float(np.rad2deg(1.0 / reach))
    beam_deg, size_deg = beam_width_m * per_m, sought_target.size_m * per_m
    seconds = accumulation_s or device.min_accumulation_s or DEFAULT_ACCUMULATION_S
    stages = windows(chosen, sought_target, seen, beam_deg, size_deg, order, seconds)
    probe = map_probe(chosen, pulse_ns, fft_points)
    gates, notes = _gates(chosen, seen, probe)
    around = neighbours(places, chosen)
    carrier = sought_target.on or sought_target.name
    in_window = [item for item in around if item.name != carrier and _meets(item, seen, stages[-1])]
    hidden = tuple(dict.fromkeys(hiding(around, seen.true, carrier=carrier)))
    sight = target_sight(places, chosen, position)
    if sight is not None and sight.state == "blocked":
        hidden = (*hidden, "the terrain")
    elif sight is not None and sight.state == "unknown":
        notes.append(
            "part of the way to it lies outside the height raster: whether the terrain hides it is not known"
        )
    if stages[-1].time_s > LONG_MAP_S:
        notes.append(_why_long(stages[-1]))
    ground = ground_met(places, chosen, *stages[-1].rays, gates.last_m + 0.5 * probe.length_m)
    return MapPlan(
        lidar=chosen,
        target=sought_target,
        expected=seen,
        beam_deg=beam_deg,
        size_deg=size_deg,
        windows=stages,
        gates=gates,
        probe=probe,
        others=tuple((item, _within(item, gates, probe)) for item in in_window),
        hidden_by=hidden,
        ground=ground,
        notes=tuple(notes),
    )


def choose_targets(places: Places, lidar: str, *, count: int = 3) -> Choice | None:
    """The hard targets that fix a lidar's angles best, of all in sight; None where there is none."""
    chosen = places.site.lidar(lidar)
    found = candidates(places, chosen)
    if not found:
        return None
    return best_targets(
        found, count=count, start=places.mounting(chosen), head_std_m=chosen.uncertainty.position_m
    )


def solvable_angles(places: Places, lidar: str, names: Sequence[str]) -> tuple[Angle, ...]:
    """The angles that these of the hard targets in sight determine together; `--solve` of a fit."""
    chosen = places.site.lidar(lidar)
    seen = [item for item in candidates(places, chosen) if item.name in names]
    return solvable(seen, start=places.mounting(chosen), head_std_m=chosen.uncertainty.position_m)


def _why_long(window: Window) -> str:
    """What makes a map long, and what shortens it."""
    across, upward = (0.5 * float(np.ptp(line)) for line in (window.azimuth_deg, window.elevation_deg))
    rays, step = (
        window.azimuth_deg.size * window.elevation_deg.size,
        float(np.diff(window.elevation_deg[:2])[0]),
    )
    return (
        f"{window.time_s / 60:.0f} min for {rays:,} rays, since a window of ±{across:.2f}° by ±{upward:.2f}°, where it may be, "
        f"is scanned in steps of {step:.4f}°, as the target is thin and the beam narrow there. Coarser steps need a target "
        "that is thicker or nearer; a narrower window needs a heading that is known better (--heading-std) and smaller "
        "uncertainties of levelling, elevation and position in the site file"
    )


def map_probe(lidar: Lidar, pulse_ns: float | None, fft_points: int | None) -> Probe:
    """Pulse and window to map with.

    Raises
    ------
    InputError
        If neither the options nor the instrument give them.
    """
    mode = lidar.device.pulse(pulse_ns)
    pulse = pulse_ns if pulse_ns is not None else mode.pulse_ns if mode else None
    samples = fft_points if fft_points is not None else mode.fft_points if mode else None
    if pulse is None or samples is None:
        raise InputError(
            f"{lidar.name}: pulse length and window of {lidar.device.name} are not known. Give --pulse-ns and "
            "--fft-points, or `pulses` inline"
        )
    return Probe(pulse_ns=pulse, window_ns=window_ns(samples, lidar.device.sample_ns))


def _gates(lidar: Lidar, seen: Expected, probe: Probe) -> tuple[Gates, list[str]]:
    """Gates 1 m apart, three standard deviations and one probe to each side; fewer where the instrument ends."""
    half = WINDOW_STDS * seen.range_std_m + probe.length_m
    count = 2 * int(np.ceil(half / GATE_M)) + 1
    most, notes = lidar.device.max_gates, []
    if most is not None and count > most:
        notes.append(
            f"{count} gates of 1 m are wanted and the instrument has {most}: the range may be cut off"
        )
        count = most - (1 - most % 2)
    first = max(float(np.round(seen.range_head_m)) - GATE_M * (count // 2), 0.0)
    return Gates(first_m=first, spacing_m=GATE_M, count=count), notes


def _meets(item: Neighbour, seen: Expected, window: Window) -> bool:
    """Whether something stands in the window; angles from the target, so that the head's turn does not matter."""
    half_width = 0.5 * float(np.ptp(window.azimuth_deg)) + item.half_width_deg
    half_height = 0.5 * float(np.ptp(window.elevation_deg))
    beside = abs(float(difference_deg(item.azimuth_deg, seen.true.azimuth_deg))) <= half_width
    elevation = float(seen.true.elevation_deg)
    return beside and item.bottom_deg <= elevation + half_height and item.top_deg >= elevation - half_height


def _within(item: Neighbour, gates: Gates, probe: Probe) -> bool:
    """Whether something stands where the gates are, or a probe from there."""
    return gates.first_m - probe.length_m <= item.range_m <= gates.last_m + probe.length_m
