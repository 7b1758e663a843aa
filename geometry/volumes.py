"""Measurement volumes: the points that a scan samples, and the directions from which something touches them.

A volume is a sheet of sample points (ray, along, 3): neighbours on the first axis are successive rays,
neighbours on the second lie along the beam, and the sheet between them belongs to the volume. Loose points
have the shape (p, 3) and nothing between them. What touches the volume is asked of its cells, which are
halved until the answer is right.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from geometry.angles import Sector, SectorSet, wrap_360_deg
from geometry.arrays import ArrayLike, BoolArray, FloatArray
from geometry.beams import point_at
from geometry.errors import InputError

# Sample points of an arc: at 10 m and 1 km the chord leaves the arc by 1 cm.
ARC_SPACING_M = 10.0

# How wide a turn one chord may span: at 1 degree it leaves the arc by 4e-5 of the range.
ARC_STEP_DEG = 1.0

# How much an edge of a sector may be too narrow; half of the 0.1 degrees that a wind vane resolves.
EDGE_TOLERANCE_DEG = 0.05

# A cell this small counts as touched when its surroundings are: the volume is taken up to 1 cm thicker.
SMALLEST_CELL_M = 0.01

FULL_TURN_DEG = 360.0


class Touch(NamedTuple):
    """Directions from which a thing touches points: inner to outer, on both sides of the middle."""

    middle_deg: FloatArray  # (n,)
    inner_deg: FloatArray  # (n,) half-angle where the touch begins, 0 if the middle itself touches
    outer_deg: FloatArray  # (n,) half-angle where the touch ends, up to 180; NaN if it never touches


TouchRule = Callable[[FloatArray, FloatArray], Touch]
"""A rule gets points (n, 3) and margins (n,) [m]; it answers for the ball of that radius, or for more."""


def arc_volume_m(
    head_m: ArrayLike,
    azimuth_deg: ArrayLike,
    elevation_deg: ArrayLike,
    range_m: float,
    *,
    probe_m: float = 0.0,
    spacing_m: float = ARC_SPACING_M,
) -> FloatArray:
    """Sample the sheet that one range gate of a scan sweeps: the path of its rays times the probe.

    Parameters
    ----------
    head_m
        Position of the scanner head: east, north, up [m], shape (3,).
    azimuth_deg, elevation_deg
        Rays in the order of the scan [deg], clockwise from true north and above the horizontal; shapes (ray,)
        or scalars that broadcast. Successive rays are joined the shorter way round, so that 358 and 2 are 4
        apart: a turn of 180 or more needs a ray in between. The two ends of a sector are enough.
    range_m
        Centre of the gate [m], slant.
    probe_m
        Length of the probe along the beam [m], half of it on each side of the centre.
    spacing_m
        Largest distance of neighbouring samples [m], along the arc and along the beam.

    Returns
    -------
    FloatArray
        Sample points: east, north, up [m], shape (ray, along, 3). ``reshape(-1, 3)`` gives loose points.

    Raises
    ------
    InputError
        If the range is not positive, the probe is negative or reaches behind the head, the spacing is not
        positive, or an angle is not finite.

    Examples
    --------
    >>> sheet = arc_volume_m([0.0, 0.0, 0.0], [-29.0, 29.0], 0.0, 1155.0, probe_m=43.0)
    >>> sheet.shape
    (121, 6, 3)
    >>> sheet[[0, 60], -1].round(1).tolist()
    [[-570.4, 1029.0, 0.0], [0.0, 1176.5, 0.0]]
    """
    if not (range_m > 0.0 and 0.0 <= probe_m <= 2.0 * range_m and spacing_m > 0.0):
        raise InputError(
            f"range {range_m} m, probe {probe_m} m, spacing {spacing_m} m came; allowed are a positive range "
            "and spacing and a probe from 0 to twice the range. Check the gates and the pulse of the scan."
        )
    azimuth, elevation = _ray_path(
        azimuth_deg, elevation_deg, step_deg=_step_deg(range_m, probe_m, spacing_m)
    )
    along = (
        np.linspace(-0.5, 0.5, int(np.ceil(probe_m / spacing_m)) + 1) * probe_m
        if probe_m > 0.0
        else np.zeros(1)
    )
    local = point_at(azimuth[:, np.newaxis], elevation[:, np.newaxis], range_m + along)
    return np.asarray(head_m, dtype=np.float64) + local


def stare_volume_m(
    head_m: ArrayLike,
    azimuth_deg: float,
    elevation_deg: float,
    range_m: float,
    *,
    probe_m: float,
    spacing_m: float = ARC_SPACING_M,
) -> FloatArray:
    """Sample the probe of one gate of a staring beam.

    Parameters
    ----------
    head_m
        Position of the scanner head: east, north, up [m], shape (3,).
    azimuth_deg, elevation_deg
        Direction of the beam [deg], clockwise from true north and above the horizontal.
    range_m
        Centre of the gate [m], slant.
    probe_m
        Length of the probe along the beam [m].
    spacing_m
        Largest distance of neighbouring samples [m].

    Returns
    -------
    FloatArray
        Sample points: east, north, up [m], shape (1, along, 3): a sheet without width.

    Raises
    ------
    InputError
        As in `arc_volume_m`.

    Examples
    --------
    >>> stare_volume_m([0.0, 0.0, 5.0], 90.0, 0.0, 100.0, probe_m=40.0, spacing_m=20.0).round(6)[0].tolist()
    [[80.0, 0.0, 5.0], [100.0, 0.0, 5.0], [120.0, 0.0, 5.0]]
    """
    return arc_volume_m(head_m, azimuth_deg, elevation_deg, range_m, probe_m=probe_m, spacing_m=spacing_m)


def directions_touching(
    volume_m: ArrayLike, rule: TouchRule, *, tolerance_deg: float = EDGE_TOLERANCE_DEG
) -> SectorSet:
    """Find all directions from which a rule touches a volume, sheet between the samples included.

    Parameters
    ----------
    volume_m
        Sheet (ray, along, 3) or loose points (p, 3) [m].
    rule
        What touches a point: gets points (n, 3) and margins (n,) [m], and gives the `Touch` of the ball of
        that radius around each point, or of more than the ball, never of less.
    tolerance_deg
        How much too narrow an edge may stay [deg].

    Returns
    -------
    SectorSet
        The directions. Edges are exact for loose points. For a sheet each is at most `tolerance_deg` too
        narrow, and never wider than that of the sheet thickened by `SMALLEST_CELL_M`. Gaps up to
        `tolerance_deg` are closed.

    Raises
    ------
    InputError
        If the volume is empty, not finite or not of one of the two shapes.

    Notes
    -----
    Branch and bound: the corners of a cell are points of the volume, so what touches them counts. A cell is
    done when whatever touches the ball around it is already known to the tolerance, else it is halved across
    its longer side. A cell of one point is done at once.
    """
    cells = _cells(volume_m)
    known = np.empty((0, 2))
    while cells.shape[0]:
        corners = cells.reshape(-1, 3)
        known = _merged(np.vstack([known, _intervals(rule(corners, np.zeros(corners.shape[0])))]))
        middle = cells.mean(axis=(1, 2))
        margin = np.linalg.norm(cells - middle[:, np.newaxis, np.newaxis], axis=-1).max(axis=(1, 2))
        wide = rule(middle, margin)
        small = margin <= SMALLEST_CELL_M
        open_cells = ~_is_known(wide, known, tolerance_deg)
        grown = Touch(*(each[open_cells & small & (margin > 0.0)] for each in wide))
        known = _merged(np.vstack([known, _intervals(grown)]))
        cells = _halved(cells[open_cells & ~small])
    found = SectorSet.of(Sector(float(begin), float(end - begin)) for begin, end in known if end > begin)
    gaps = SectorSet.of(gap for gap in found.complement().sectors if gap.width_deg <= tolerance_deg)
    return found.union(gaps)


def _step_deg(range_m: float, probe_m: float, spacing_m: float) -> float:
    """Turn [deg] that keeps the far end of the probe within the spacing."""
    return min(ARC_STEP_DEG, float(np.rad2deg(spacing_m / (range_m + 0.5 * probe_m))))


def _ray_path(
    azimuth_deg: ArrayLike, elevation_deg: ArrayLike, *, step_deg: float
) -> tuple[FloatArray, FloatArray]:
    """Azimuths and elevations (n,) along the path of the rays, no two further apart than the step."""
    azimuth, elevation = np.broadcast_arrays(
        np.atleast_1d(np.asarray(azimuth_deg, dtype=np.float64)),
        np.atleast_1d(np.asarray(elevation_deg, dtype=np.float64)),
    )
    if azimuth.ndim != 1 or azimuth.size == 0 or not np.all(np.isfinite(azimuth + elevation)):
        raise InputError(
            f"rays of shape {azimuth.shape} came; allowed is one list of finite azimuths and "
            "elevations in degrees. Give the rays of one scan in order."
        )
    azimuth = np.unwrap(azimuth, period=FULL_TURN_DEG)
    turn = np.maximum(np.abs(np.diff(azimuth)), np.abs(np.diff(elevation)))
    pieces = np.maximum(np.ceil(turn / step_deg - 1e-9), 1.0)  # a turn of exactly one step is one piece
    ends = np.concatenate([[0.0], np.cumsum(pieces)])
    places = np.arange(int(ends[-1]) + 1)
    return np.interp(places, ends, azimuth), np.interp(places, ends, elevation)


def _cells(volume_m: ArrayLike) -> FloatArray:
    """Cells (cell, 2, 2, 3) of a sheet; a point, or a line of samples, is a cell without width."""
    volume = np.asarray(volume_m, dtype=np.float64)
    if (
        volume.ndim not in (2, 3)
        or volume.shape[-1] != 3
        or not volume.size
        or not np.all(np.isfinite(volume))
    ):
        raise InputError(
            f"a volume of shape {volume.shape} came; allowed are finite sample points (p, 3) or a sheet "
            "(ray, along, 3) in metres. Use arc_volume_m or stare_volume_m."
        )
    if volume.ndim == 2:
        return np.broadcast_to(volume[:, np.newaxis, np.newaxis], (volume.shape[0], 2, 2, 3))
    rays, along = (np.arange(max(size - 1, 1)) for size in volume.shape[:2])
    next_ray = np.minimum(rays + 1, volume.shape[0] - 1)
    next_along = np.minimum(along + 1, volume.shape[1] - 1)
    corners = [volume[np.ix_(i, j)] for i in (rays, next_ray) for j in (along, next_along)]
    return np.stack(corners, axis=2).reshape(-1, 2, 2, 3)


def _halved(cells: FloatArray) -> FloatArray:
    """Cut each cell (n, 2, 2, 3) across its longer side: (2n, 2, 2, 3)."""
    first_m = np.linalg.norm(cells[:, 1] - cells[:, 0], axis=-1).max(axis=1)
    second_m = np.linalg.norm(cells[:, :, 1] - cells[:, :, 0], axis=-1).max(axis=1)
    turned = np.where(
        (second_m > first_m)[:, np.newaxis, np.newaxis, np.newaxis], cells.swapaxes(1, 2), cells
    )
    waist = 0.5 * (turned[:, 0] + turned[:, 1])
    return np.concatenate([np.stack([turned[:, 0], waist], axis=1), np.stack([waist, turned[:, 1]], axis=1)])


def _intervals(touch: Touch) -> FloatArray:
    """Both sides of each touch as intervals (m, 2) from..to [deg]; from in [0, 360), to at most 180 on."""
    hit = np.isfinite(touch.outer_deg)
    middle, inner, outer = touch.middle_deg[hit], touch.inner_deg[hit], touch.outer_deg[hit]
    begin = wrap_360_deg(np.concatenate([middle - outer, middle + inner]))
    return np.stack([begin, begin + np.tile(outer - inner, 2)], axis=1)


def _merged(intervals: FloatArray) -> FloatArray:
    """Join intervals (m, 2) of the circle that overlap: sorted, disjoint, each within [0, 360]."""
    over = intervals[:, 1] > FULL_TURN_DEG
    rest = np.stack([np.zeros(int(over.sum())), intervals[over, 1] - FULL_TURN_DEG], axis=1)
    return _joined(np.vstack([np.minimum(intervals, FULL_TURN_DEG), np.minimum(rest, FULL_TURN_DEG)]))


def _joined(intervals: FloatArray) -> FloatArray:
    """Join intervals (m, 2) of the line that overlap or meet within rounding."""
    if not intervals.shape[0]:
        return intervals
    ordered = intervals[np.argsort(intervals[:, 0])]
    reach = np.maximum.accumulate(ordered[:, 1])
    first = np.concatenate([[True], ordered[1:, 0] > reach[:-1] + 1e-9])
    last = np.concatenate([first[1:], [True]])
    return np.stack([ordered[first, 0], reach[last]], axis=1)


def _is_known(touch: Touch, known: FloatArray, tolerance_deg: float) -> BoolArray:
    """Tell for which touches both sides lie in the known intervals, but for the tolerance at each end."""
    missed = np.zeros(touch.middle_deg.size, dtype=np.bool_)
    hit = np.isfinite(touch.outer_deg)
    intervals = _intervals(touch)
    half = 0.5 * (intervals[:, 1] - intervals[:, 0])
    begin = intervals[:, 0] + np.minimum(tolerance_deg, half)
    end = intervals[:, 1] - np.minimum(tolerance_deg, half)
    twice = _joined(np.vstack([known, known + FULL_TURN_DEG]))
    place = np.searchsorted(twice[:, 0], begin, side="right") - 1
    covered = np.zeros(begin.size, dtype=np.bool_)
    inside = place >= 0
    covered[inside] = end[inside] <= twice[place[inside], 1]
    missed[hit] = ~covered.reshape(2, -1).all(axis=0)
    return np.asarray(~missed)
