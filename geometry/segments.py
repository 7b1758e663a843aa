"""Very many straight beams at once against solids and areas: what stands in the way of each.

`geometry.sightlines` looks at the rays of one scanner with all care; this module asks only how far each of a million
beams passes, and looks closely at the few that come near.
"""

from typing import NamedTuple

import numpy as np

from geometry.arrays import ArrayLike, FloatArray, IntArray
from geometry.errors import InputError
from geometry.sightlines import GOLDEN
from geometry.solids import Boxes, Cylinders, Discs, Solids, Spheres

# Beams that pass a solid's surroundings by more than this are not looked at closely: their clearance is a lower bound.
CARE_M = 50.0

# Shrinks a beam to GOLDEN^40 = 4e-9 of its length: 0.03 mm of 6 km.
SEARCH_STEPS = 40


class Passing(NamedTuple):
    """How beams pass the nearest of some solids."""

    clearance_m: FloatArray  # (...,) to the surface, negative inside; beyond `CARE_M` a lower bound; inf without solids
    nearest: IntArray  # (...,) index of that solid; -1 without solids


def passing(start_m: ArrayLike, end_m: ArrayLike, solids: Solids) -> Passing:
    """Clearance of straight beams to the nearest of some solids.

    Parameters
    ----------
    start_m, end_m
        Ends of the beams, east, north, up [m], shapes (..., 3) that broadcast, in the frame of the solids.
    solids
        `Spheres`, `Cylinders`, `Boxes` or `Discs`.

    Returns
    -------
    Passing
        Of shape (...,).

    Raises
    ------
    InputError
        If the ends are not points.

    Notes
    -----
    Each solid lies within an upright cylinder; the distance in plan of the beam to its axis, less its radius, is never
    more than the clearance. Where that is less than `CARE_M`, the least distance along the beam, a convex function, is
    found by golden section.

    Examples
    --------
    >>> tower = Cylinders([[0.0, 500.0]], 2.0, 0.0, 80.0)
    >>> found = passing([0.0, 0.0, 2.0], [[0.0, 900.0, 100.0], [20.0, 900.0, 100.0], [0.0, 900.0, 200.0]], tower)
    >>> found.clearance_m.round(2).tolist()
    [-2.0, 9.11, 30.82]
    """
    start, end = np.broadcast_arrays(np.asarray(start_m, dtype=float), np.asarray(end_m, dtype=float))
    if start.ndim == 0 or start.shape[-1] != 3:
        raise InputError(
            f"beams with ends of shape {start.shape} came; allowed is (..., 3): east, north, up in metres"
        )
    shape = start.shape[:-1]
    start, end = start.reshape(-1, 3), end.reshape(-1, 3)
    best, which = np.full(len(start), np.inf), np.full(len(start), -1, dtype=np.intp)
    centres, radii = _surrounding(solids)
    for number, (centre, radius) in enumerate(zip(centres, radii, strict=True)):
        gap = _plan_distance_m(start, end, centre) - radius
        close = np.flatnonzero(gap < np.minimum(CARE_M, best))
        if close.size:
            gap[close] = _least_m(start[close], end[close], solids, number)
        nearer = gap < best
        best[nearer], which[nearer] = gap[nearer], number
    return Passing(best.reshape(shape), which.reshape(shape))


def _surrounding(solids: Solids) -> tuple[FloatArray, FloatArray]:
    """Axes (solid, 2) and radii (solid,) of upright cylinders that hold the solids."""
    if isinstance(solids, Cylinders):
        return solids.axis_m, solids.radius_m
    if isinstance(solids, Spheres | Discs):
        thick = 0.5 * solids.thickness_m if isinstance(solids, Discs) else 0.0
        return solids.centre_m[:, :2], np.hypot(solids.radius_m, thick)
    if isinstance(solids, Boxes):
        return solids.centre_m, 0.5 * np.hypot(solids.width_m, solids.length_m)
    raise InputError(f"{type(solids).__name__} came; allowed are Spheres, Cylinders, Boxes and Discs")


def _plan_distance_m(start: FloatArray, end: FloatArray, point: FloatArray) -> FloatArray:
    """Distance in plan [m] of beams (n, 3) to a point (2,)."""
    along = end[:, :2] - start[:, :2]
    away = point - start[:, :2]
    length2 = np.einsum("ni,ni->n", along, along)
    share = np.einsum("ni,ni->n", along, away) / np.where(length2 > 0.0, length2, 1.0)
    nearest = away - np.clip(share, 0.0, 1.0)[:, None] * along
    return np.asarray(np.hypot(nearest[:, 0], nearest[:, 1]))


def _least_m(start: FloatArray, end: FloatArray, solids: Solids, number: int) -> FloatArray:
    """Least signed distance [m] of beams (n, 3) to one solid."""
    along = end - start

    def distance(share: FloatArray) -> FloatArray:
        points = start + share[:, None] * along
        return solids.distance_m(points[:, None])[:, number]

    near, far = np.zeros(len(start)), np.ones(len(start))
    low, high = far * (1.0 - GOLDEN), far * GOLDEN
    at_low, at_high = distance(low), distance(high)
    ends = np.minimum(distance(near), distance(far))
    for _ in range(SEARCH_STEPS):
        left = at_low < at_high
        near, far = np.where(left, near, low), np.where(left, high, far)
        new = np.where(left, far - GOLDEN * (far - near), near + GOLDEN * (far - near))
        at_new = distance(new)
        low, high = np.where(left, new, high), np.where(left, low, new)
        at_low, at_high = np.where(left, at_new, at_high), np.where(left, at_low, at_new)
    return np.asarray(np.minimum(np.minimum(at_low, at_high), ends))
