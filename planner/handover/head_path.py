"""The way of a scanner head through a scan, in the angles that the head itself shows."""

from typing import NamedTuple

import numpy as np

from geometry.angles import difference_deg
from geometry.arrays import FloatArray, IntArray
from geometry.scans import Scan
from planner.scan_layout import ScanLayout

# How far a ray may lie beside the straight line between the ends of a sweep: well under a beam's own pointing
# uncertainty (0.05 deg).
STRAIGHT_DEG = 0.005

# Two rays join where the end of one is the start of the next.
JOINED_DEG = 1e-6


class HeadPath(NamedTuple):
    """Head angles of the rays of one pass, each row (azimuth, elevation) [deg].

    The azimuth counts on through north, so that a difference is a turn; it starts in [0, 360). The elevation
    passes 90 where the head goes over the top.
    """

    begin_deg: FloatArray  # (ray, 2)
    middle_deg: FloatArray  # (ray, 2)
    end_deg: FloatArray  # (ray, 2)


class Sweep(NamedTuple):
    """Consecutive rays that the head takes in one straight movement, or one ray at rest."""

    begin_deg: FloatArray  # (2,) azimuth, elevation
    end_deg: FloatArray  # (2,)
    rays: int

    @property
    def turn_deg(self) -> FloatArray:
        """(2,) signed turn of both axes [deg]."""
        return self.end_deg - self.begin_deg

    @property
    def moving(self) -> bool:
        """Whether the head turns while it measures."""
        return bool(np.abs(self.turn_deg).max() > JOINED_DEG)

    def reversed(self) -> "Sweep":
        """The same the other way."""
        return Sweep(self.end_deg, self.begin_deg, self.rays)


def head_path(layout: ScanLayout) -> HeadPath:
    """Turn a scan's true directions into head angles.

    Parameters
    ----------
    layout
        The scan, with the mounting of its lidar.

    Returns
    -------
    HeadPath
        Of one pass, in the order of measurement.
    """
    scan = layout.scan
    azimuth, elevation, turned, risen = _unfolded(layout, scan)
    share = np.array([-0.5, 0.0, 0.5])[:, None]  # begin, middle and end of each ray
    pointed = _to_head(layout, azimuth + share * turned, elevation + share * risen)  # (3, ray, 2)
    order = pointed.transpose(1, 0, 2).reshape(-1, 2).copy()
    order[:, 0] = np.unwrap(order[:, 0], period=360.0)
    order[:, 0] -= 360.0 * np.floor(order[1, 0] / 360.0)
    begin, middle, end = order.reshape(-1, 3, 2).transpose(1, 0, 2)
    return HeadPath(begin, middle, end)


def sweeps(path: HeadPath) -> list[Sweep]:
    """Join the rays of a pass to the fewest straight sweeps.

    Rays at rest stay single; a row of moving rays that bends by more than 0.005 degrees, as an RHI of a
    head that does not stand level, is left in pieces of one ray.
    """
    turn = path.end_deg - path.begin_deg
    gap = np.abs(path.begin_deg[1:] - path.end_deg[:-1]).max(axis=-1) > JOINED_DEG
    rest = np.abs(turn).max(axis=-1) <= JOINED_DEG
    back = (turn[1:] * turn[:-1]).sum(axis=-1) <= 0
    starts = np.flatnonzero(np.concatenate([[True], gap | rest[1:] | back]))
    stops = np.append(starts[1:], len(turn))
    found: list[Sweep] = []
    for start, stop in zip(starts.tolist(), stops.tolist(), strict=True):
        pieces = (
            [(start, stop)]
            if _straight(path, start, stop)
            else [(ray, ray + 1) for ray in range(start, stop)]
        )
        found += [
            Sweep(path.begin_deg[first], path.end_deg[last - 1], int(last - first)) for first, last in pieces
        ]
    return found


def passes(scan: Scan, one_pass: list[Sweep], count: int) -> list[Sweep]:
    """Repeat a pass, every second one in reverse where the scan goes back and forth."""
    back = [sweep.reversed() for sweep in reversed(one_pass)] if scan.back_and_forth else one_pass
    return [sweep for number in range(count) for sweep in (back if number % 2 else one_pass)]


def ray_order(scan: Scan, count: int) -> IntArray:
    """Index of the ray measured at each moment of consecutive passes, (count x ray,).

    Examples
    --------
    >>> from geometry.head import HeadLimits
    >>> from geometry.scans import points
    >>> scan = points([0, 9], [5, 5], accumulation_s=1, head=HeadLimits(50, 50, 100, 100), sweep="back_and_forth")
    >>> ray_order(scan, 3).tolist()
    [0, 1, 1, 0, 0, 1]
    """
    forth = np.arange(scan.count)
    back = forth[::-1] if scan.back_and_forth else forth
    return np.concatenate([back if number % 2 else forth for number in range(count)])


def _unfolded(layout: ScanLayout, scan: Scan) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Directions and turns with the elevation counted on over the top, as a head counts it in an RHI."""
    azimuth, elevation = scan.azimuth_deg, scan.elevation_deg
    if scan.kind != "rhi":
        return azimuth, elevation, scan.swept_azimuth_deg, scan.swept_elevation_deg
    over = np.abs(difference_deg(azimuth, layout.axis_azimuth_deg)) > 90.0
    return (
        np.where(over, azimuth + 180.0, azimuth),
        np.where(over, 180.0 - elevation, elevation),
        scan.swept_azimuth_deg,
        np.where(over, -scan.swept_elevation_deg, scan.swept_elevation_deg),
    )


def _to_head(layout: ScanLayout, azimuth_deg: FloatArray, elevation_deg: FloatArray) -> FloatArray:
    """Head angles (..., 2) of directions whose elevation may pass 90."""
    azimuth, elevation = layout.mounting.to_head(azimuth_deg, elevation_deg)
    lift = layout.mounting.elevation_offset_deg
    over = elevation_deg > 90.0
    return np.stack(
        [
            np.where(over, azimuth + 180.0, azimuth),
            np.where(over, 180.0 - (elevation + lift) - lift, elevation),
        ],
        axis=-1,
    )


def _straight(path: HeadPath, start: int, stop: int) -> bool:
    """Whether the rays' middles lie evenly on the line from the first begin to the last end."""
    begin, end = path.begin_deg[start], path.end_deg[stop - 1]
    share = (np.arange(stop - start)[:, None] + 0.5) / (stop - start)
    beside = path.middle_deg[start:stop] - (begin + share * (end - begin))
    return bool(np.abs(beside).max() <= STRAIGHT_DEG)
