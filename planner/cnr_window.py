"""Where a CNR map is scanned: the window around the target, its rays, and the time that they take."""

from typing import Literal, NamedTuple

import numpy as np

from geometry.angles import wrap_360_deg
from geometry.arrays import FloatArray
from geometry.errors import InputError
from geometry.scans import points
from planner.hard_targets import Expected
from planner.scan_making import head_limits
from planner.site import HardTarget, Lidar

Order = Literal["rows", "columns"]

WINDOW_STDS = 3.0  # the target is inside in 99 % of cases with two independent angles
PER_TARGET = 4.0  # steps across the target
PER_BEAM = 2.0  # and no more of them than this across the beam
MARGIN_STEPS = 3.0  # beyond the target's edge, so that it is seen to end
LEAST_WIDTHS = 4.0  # of the target: most rays must miss, for they tell the background
FEW = 9  # rows of a mast, columns of a boom: along it there is nothing to find

# Rays of a plain raster meet an edge at the same distance row after row: the centre is then unsure by a third of
# a step, and by the same in every repetition. Row by row and column by column a golden section of a step farther,
# they meet it everywhere: at 1 km the error falls from .0017 to .0004 degrees, for the same rays and time.
GOLDEN = 0.5 * (5.0**0.5 - 1.0)

UNKNOWN_HEADING_DEG = 1.0  # from this uncertainty on one coarse row comes first
FULL_CIRCLE_STD_DEG = 60.0
MAX_RAYS = 100_000


class Window(NamedTuple):
    """One raster of a map, in head angles."""

    stage: Literal["coarse", "fine"]
    azimuth_deg: FloatArray  # (column,) head; the middle of what its rays stagger over
    elevation_deg: FloatArray  # (row,) head
    order: Order
    accumulation_s: float
    time_s: float  # from the first ray to the end of the last

    @property
    def rays(self) -> tuple[FloatArray, FloatArray]:
        """(ray,) head azimuth and elevation [deg] in the order of measurement."""
        return staggered(self.azimuth_deg, self.elevation_deg, self.order)


def staggered(
    azimuth_deg: FloatArray, elevation_deg: FloatArray, order: Order
) -> tuple[FloatArray, FloatArray]:
    """Rays (ray,) of a raster in serpentine order, each row and column a golden section of a step beside the last.

    Parameters
    ----------
    azimuth_deg, elevation_deg : FloatArray
        Columns (column,) and rows (row,) [deg], evenly spaced.
    order : {"rows", "columns"}
        Row by row (PPI) or column by column (RHI), every second one in reverse.

    Returns
    -------
    tuple of FloatArray
        Azimuth and elevation [deg], at most half a step from column and row.

    Examples
    --------
    >>> azimuth, elevation = staggered(np.array([1.0, 2.0]), np.array([5.0, 6.0]), "rows")
    >>> azimuth.round(3).tolist(), elevation.round(3).tolist()
    ([1.0, 2.0, 1.618, 0.618], [5.0, 4.618, 5.618, 6.0])
    """
    across = azimuth_deg[None, :] + _aside(elevation_deg.size)[:, None] * _step(azimuth_deg)
    upward = elevation_deg[:, None] + _aside(azimuth_deg.size)[None, :] * _step(elevation_deg)
    grids = [across, upward] if order == "rows" else [across.T, upward.T]
    for grid in grids:
        grid[1::2] = grid[1::2, ::-1]
    return grids[0].ravel(), grids[1].ravel()


def _aside(count: int) -> FloatArray:
    """Shares of a step, -1/2 to 1/2, which any few neighbours fill evenly; the first is 0."""
    return np.asarray((np.arange(count) * GOLDEN + 0.5) % 1.0 - 0.5)


def _step(line_deg: FloatArray) -> float:
    return float(line_deg[1] - line_deg[0]) if line_deg.size > 1 else 0.0


def windows(
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
    azimuth, elevation = staggered(across, upward, order)
    scan = points(azimuth, elevation, accumulation_s=seconds, head=head_limits(lidar), sweep="back_and_forth")
    return Window(stage, across, upward, order, seconds, scan.sweep_s)


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
