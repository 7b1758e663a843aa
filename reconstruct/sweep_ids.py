"""Where one pass of a scan ends and the next begins, from the angles alone."""

import numpy as np

from geometry.angles import wrap_180_deg
from geometry.arrays import ArrayLike, BoolArray, FloatArray, IntArray
from geometry.beams import unit_vector

#: Rays that point to within this angle of each other look at the same point of a repeated list [deg].
SAME_POINT_DEG = 0.25

#: Share of the steps that has to be of one size for a pattern to be a sweep and not a list of points.
REGULAR_SHARE = 0.7

#: A step this many times the usual one is a run back to the start, not the direction of a sweep.
RUN_BACK = 2.0

#: Rays that are looked at to find the length of a list of points, and the longest list that is looked for.
LOOKED_AT, LONGEST_LIST = 5000, 1000


def sweep_ids(azimuth_deg: ArrayLike, elevation_deg: ArrayLike) -> IntArray:
    """Number the passes of a scan.

    A sector or RHI that turns back, or runs back to its start, begins a new pass there; a full circle after
    360 degrees; a list of points where its first point comes again. A stare is one pass.

    Parameters
    ----------
    azimuth_deg, elevation_deg : array_like
        (ray,) angles in the order of measurement [degrees].

    Returns
    -------
    numpy.ndarray
        (ray,) pass of each ray, from 0.

    Examples
    --------
    >>> sweep_ids([10, 12, 14, 14, 12, 10, 10, 12], np.full(8, 5.0))
    array([0, 0, 0, 1, 1, 1, 2, 2])
    >>> sweep_ids([356, 358, 0, 2, 356, 358, 0, 2], np.full(8, 5.0))
    array([0, 0, 0, 0, 1, 1, 1, 1])
    >>> sweep_ids([0, 120, 240, 0, 120, 240], np.full(6, 60.0))
    array([0, 0, 0, 1, 1, 1])
    """
    azimuth, elevation = np.asarray(azimuth_deg, dtype=float), np.asarray(elevation_deg, dtype=float)
    if len(azimuth) < 3:
        return np.zeros(len(azimuth), dtype=np.intp)
    steps = _main_steps(azimuth, elevation)
    sizes = np.abs(steps)
    moving = sizes > SAME_POINT_DEG / 10
    if np.count_nonzero(moving) < 2:
        return np.zeros(len(azimuth), dtype=np.intp)
    size = float(np.median(sizes[moving]))
    if np.mean(np.abs(sizes[moving] - size) < 0.5 * size) < REGULAR_SHARE:
        starts = _list_starts(azimuth, elevation)
    else:
        starts = _pass_starts(steps, size)
    return np.concatenate([[0], np.cumsum(starts)]).astype(np.intp)


def _main_steps(azimuth: FloatArray, elevation: FloatArray) -> FloatArray:
    """(ray - 1,) signed steps of the axis that turns the beam most [deg]."""
    turned = np.asarray(wrap_180_deg(np.diff(azimuth)))
    lifted = np.diff(elevation)
    level = np.cos(np.radians((elevation[1:] + elevation[:-1]) / 2))
    return turned if np.sum(np.abs(turned) * level) >= np.sum(np.abs(lifted)) else lifted


def _pass_starts(steps: FloatArray, size: float) -> BoolArray:
    """(ray - 1,) whether the later ray of a step begins a new pass of a sweep."""
    far = np.abs(steps) > RUN_BACK * size
    way = np.where((np.abs(steps) < 0.25 * size) | far, 0.0, np.sign(steps))
    known = np.flatnonzero(way)
    later = way[known[np.minimum(np.searchsorted(known, np.arange(len(way))), len(known) - 1)]]
    way = np.where(
        far & (np.sign(steps) == later), later, way
    )  # rays are missing: it goes on the same way after it
    known = np.flatnonzero(way)
    before = np.searchsorted(known, np.arange(len(way)), side="right") - 1
    direction = way[known[np.maximum(before, 0)]]
    starts = np.concatenate([[False], direction[1:] != direction[:-1]])
    still = (
        np.concatenate([[False], way[:-1] == 0]) & starts
    )  # the standing step at the turn parts the two passes
    turn = np.flatnonzero(still)
    starts[turn], starts[turn - 1] = False, True
    starts |= far & (np.sign(steps) == -direction)
    travelled = np.concatenate([[0.0], np.cumsum(np.where(starts, 0.0, np.abs(steps)))])
    first = np.maximum.accumulate(np.where(np.concatenate([[True], starts]), np.arange(len(travelled)), 0))
    circles = np.floor((travelled - travelled[first] + size / 4) / 360.0)
    return np.asarray(starts | (np.diff(circles) > 0))


def _list_starts(azimuth: FloatArray, elevation: FloatArray) -> BoolArray:
    """(ray - 1,) whether the later ray is the first point of a repeated list."""
    beams = unit_vector(azimuth, elevation)
    near = np.radians(SAME_POINT_DEG)
    looked = beams[:LOOKED_AT]
    for length in range(2, min(len(looked) // 2, LONGEST_LIST) + 1):
        same = np.linalg.norm(looked[length:] - looked[:-length], axis=-1) < near
        if np.mean(same) >= 0.9:
            break
    else:
        return np.zeros(len(azimuth) - 1, dtype=bool)
    cycle = beams[:length]
    twins = np.linalg.norm(cycle[:, None] - cycle[None, :], axis=-1) < near
    alone = np.flatnonzero(twins.sum(axis=1) == 1)
    if not len(alone):
        return np.asarray(np.arange(1, len(azimuth)) % length == 0)
    anchor = np.linalg.norm(beams - cycle[alone[0]], axis=-1) < near
    counted = np.roll(anchor, -int(alone[0]))[1:]  # the list begins so many rays before its anchor
    return np.asarray(counted)
