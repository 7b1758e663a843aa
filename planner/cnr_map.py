"""A CNR map planned: where to scan for a hard target, in which steps and gates, how long, and what else is there."""

from typing import Literal, NamedTuple

import numpy as np

from geometry.angles import difference_deg, wrap_360_deg
from geometry.arrays import FloatArray
from geometry.errors import InputError
from geometry.gates import Gates, Probe, window_ns
from geometry.scans import points
from planner.hard_targets import Expected, Neighbour, candidates, expected, hiding, neighbours, sought
from planner.places import Places
from planner.scan_making import head_limits
from planner.site import HardTarget, Lidar
from reconstruct.hard_target import BEAM_WIDTH_M
from reconstruct.target_choice import Choice, best_targets

Order = Literal["rows", "columns"]

WINDOW_STDS = 3.0  # the target is inside in 99 % of cases with two independent angles
PER_TARGET = 4.0  # steps across the target
PER_BEAM = 2.0  # and no more of them than this across the beam
MARGIN_STEPS = 3.0  # beyond the target's edge, so that it is seen to end
LEAST_WIDTHS = 4.0  # of the target: most rays must miss, for they tell the background
FEW = 9  # rows of a mast, columns of a boom: along it there is nothing to find

UNKNOWN_HEADING_DEG = 1.0  # from this uncertainty on one coarse row comes first
FULL_CIRCLE_STD_DEG = 60.0
MAX_RAYS = 100_000
DEFAULT_ACCUMULATION_S = 0.1
GATE_M = 1.0


class Window(NamedTuple):
    """One raster of a map, in head angles."""

    stage: Literal["coarse", "fine"]
    azimuth_deg: FloatArray  # (column,) head
    elevation_deg: FloatArray  # (row,) head
    order: Order
    accumulation_s: float
    time_s: float  # from the first ray to the end of the last

    @property
    def rays(self) -> tuple[FloatArray, FloatArray]:
        """(ray,) head azimuth and elevation [deg], one line back, the next forth (serpentine)."""
        return serpentine(self.azimuth_deg, self.elevation_deg, self.order)


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
    windows = _windows(chosen, sought_target, seen, beam_deg, size_deg, order, seconds)
    probe = map_probe(chosen, pulse_ns, fft_points)
    gates, notes = _gates(chosen, seen, probe)
    around = neighbours(places, chosen)
    carrier = sought_target.on or sought_target.name
    in_window = [item for item in around if item.name != carrier and _meets(item, seen, windows[-1])]
    hidden = tuple(dict.fromkeys(hiding(around, seen.true, carrier=carrier)))
    if places.site.terrain is not None:
        notes.append("the terrain is not looked at")
    return MapPlan(
        lidar=chosen,
        target=sought_target,
        expected=seen,
        beam_deg=beam_deg,
        size_deg=size_deg,
        windows=windows,
        gates=gates,
        probe=probe,
        others=tuple((item, _within(item, gates, probe)) for item in in_window),
        hidden_by=hidden,
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


def serpentine(
    azimuth_deg: FloatArray, elevation_deg: FloatArray, order: Order
) -> tuple[FloatArray, FloatArray]:
    """Rays (ray,) of a raster, every second line in reverse.

    Examples
    --------
    >>> azimuth, elevation = serpentine(np.array([1.0, 2.0]), np.array([5.0, 6.0]), "rows")
    >>> azimuth.tolist(), elevation.tolist()
    ([1.0, 2.0, 2.0, 1.0], [5.0, 5.0, 6.0, 6.0])
    """
    along, lines = (azimuth_deg, elevation_deg) if order == "rows" else (elevation_deg, azimuth_deg)
    forth = (np.arange(lines.size) % 2 == 0)[:, None]
    moving = np.where(forth, along, along[::-1]).ravel()
    fixed = np.repeat(lines, along.size)
    return (moving, fixed) if order == "rows" else (fixed, moving)


def _windows(
    lidar: Lidar,
    target: HardTarget,
    seen: Expected,
    beam_deg: float,
    size_deg: float,
    order: Order,
    seconds: float,
) -> tuple[Window, ...]:
    """The fine window, and a coarse row before it where the heading is not known."""
    resolution = (lidar.device.head.resolution_deg if lidar.device.head else None) or 0.001
    step = max(size_deg / PER_TARGET, beam_deg / PER_BEAM, resolution)
    step = float(np.floor(step / resolution + 1e-9)) * resolution
    wider = 1.0 / float(np.cos(np.deg2rad(seen.elevation_head_deg)))
    unsure, windows = seen.azimuth_std_deg, []
    if unsure > UNKNOWN_HEADING_DEG:
        row = _coarse(lidar, target, seen, size_deg, wider, seconds)
        windows.append(row)
        unsure = float(np.diff(row.azimuth_deg[:2])[0])  # the mast is found to a step of the row
    across = _line(seen.azimuth_head_deg, unsure, size_deg * wider, step * wider, target.shape == "boom")
    upward = _line(seen.elevation_head_deg, seen.elevation_std_deg, size_deg, step, target.shape == "mast")
    if across.size * upward.size > MAX_RAYS:
        raise InputError(
            f"a map of {across.size} x {upward.size} rays; allowed: {MAX_RAYS} in all. Level the lidar and find its "
            "heading better first, or take a larger target"
        )
    windows.append(_window(lidar, "fine", across, upward, order, seconds))
    return tuple(windows)


def _line(middle: float, std: float, size: float, step: float, along: bool) -> FloatArray:
    """Angles of columns or rows [deg]; only a few where the target runs along them."""
    if along:
        return np.asarray(middle + step * (np.arange(FEW) - FEW // 2), dtype=np.float64)
    half = max(WINDOW_STDS * std + 0.5 * size + MARGIN_STEPS * step, 0.5 * LEAST_WIDTHS * size)
    count = int(np.ceil(half / step))
    return np.asarray(middle + step * np.arange(-count, count + 1), dtype=np.float64)


def _coarse(
    lidar: Lidar, target: HardTarget, seen: Expected, size_deg: float, wider: float, seconds: float
) -> Window:
    """One row that crosses what carries the target, low enough for it to be there whatever the levelling."""
    step = size_deg * wider
    below = 0.0 if target.shape == "mast" else WINDOW_STDS * seen.elevation_std_deg + size_deg
    half = 180.0 if seen.azimuth_std_deg >= FULL_CIRCLE_STD_DEG else WINDOW_STDS * seen.azimuth_std_deg
    half = min(half, 180.0)
    count = int(np.ceil(half / step))
    azimuth = np.asarray(seen.azimuth_head_deg + step * np.arange(-count, count + 1), dtype=np.float64)
    row = np.array([seen.elevation_head_deg - below])
    return _window(lidar, "coarse", azimuth, row, "rows", seconds)


def _window(
    lidar: Lidar,
    stage: Literal["coarse", "fine"],
    across: FloatArray,
    upward: FloatArray,
    order: Order,
    seconds: float,
) -> Window:
    """A raster with its time by the head's kinematics, from rest to rest between rays."""
    azimuth, elevation = serpentine(across, upward, order)
    scan = points(azimuth, elevation, accumulation_s=seconds, head=head_limits(lidar), sweep="back_and_forth")
    return Window(stage, across, upward, order, seconds, scan.sweep_s)


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


def window_record(window: Window) -> dict[str, object]:
    """A window in numbers, for tables and JSON."""
    steps = [float(np.diff(each[:2])[0]) if each.size > 1 else None for each in window[1:3]]
    return {
        "stage": window.stage,
        "azimuth_head_from_deg": float(wrap_360_deg(window.azimuth_deg[0])),
        "azimuth_head_to_deg": float(wrap_360_deg(window.azimuth_deg[-1])),
        "azimuth_step_deg": steps[0],
        "columns": int(window.azimuth_deg.size),
        "elevation_head_from_deg": float(window.elevation_deg[0]),
        "elevation_head_to_deg": float(window.elevation_deg[-1]),
        "elevation_step_deg": steps[1],
        "rows": int(window.elevation_deg.size),
        "order": window.order,
        "accumulation_s": window.accumulation_s,
        "time_s": window.time_s,
    }
