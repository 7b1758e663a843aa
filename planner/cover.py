"""Fewer measurement points: cover wanted points by the fewest discs of a given radius, seen from above."""

from typing import NamedTuple

import numpy as np

from geometry.arrays import ArrayLike, BoolArray, FloatArray, IntArray
from geometry.errors import InputError

MAX_POINTS = 400  # with ever so many neighbours a cover of 300 took 13 s, and it grows with the fourth power
EXACT_POINTS = 60  # up to here the integer program takes well under a second

# A point on a rim counts as covered although rounding puts it outside by this share of the radius.
RIM_SHARE = 1e-9

CHUNK_CELLS = 300_000  # centres x points looked at together: 2.4 MB of distances

ROUNDS = 5  # greedy covers that are tried before the best is kept

ARRANGEMENTS = 20  # turns of giving points to discs and centring these; usually 2 or 3 change anything

# Branches of the integer program that improves a greedy cover: 150 points need 1 to 50 as a rule. Counted and
# not timed, so that a slow machine gives the same answer.
BRANCHES = 100


class Cover(NamedTuple):
    """Discs that together cover all points."""

    centre_m: FloatArray  # (disc, 2) easting, northing, the middle of the points that the disc serves
    disc: IntArray  # (point,) the disc that serves each point
    reach_m: FloatArray  # (disc,) distance from the centre to the farthest of its points
    at_least: int  # proven: no cover has fewer discs

    @property
    def gap(self) -> int:
        """Discs that might be saved; 0 where the number is proven to be the least."""
        return len(self.centre_m) - self.at_least


def fewest_discs(points_m: ArrayLike, radius_m: float, *, exact_points: int = EXACT_POINTS) -> Cover:
    """Cover points by the fewest discs of a radius.

    Parameters
    ----------
    points_m : array_like (point, 2 or 3)
        Easting, northing [m]; a height is not looked at.
    radius_m : float
        Radius of the discs [m].
    exact_points : int
        Up to so many points the least number is found and proven by an integer program; beyond, a greedy
        cover is improved by exchanges and by an integer program that is broken off after 100 branches, and
        `Cover.gap` tells how many discs its bound leaves open.

    Returns
    -------
    Cover
        Centres, who serves whom, and the proven lower bound.

    Raises
    ------
    InputError
        If there is no point or more than 400, a coordinate is not finite or the radius not positive.

    Notes
    -----
    Some smallest cover has only discs with two points on the rim, or one in the middle: these are the
    candidates (Hochbaum and Maass 1985, doi:10.1145/2455.214106). Fewest of them such that each point is in
    one: min Σx, Ax >= 1, x in {0, 1}.

    Examples
    --------
    >>> cover = fewest_discs([[0, 0], [80, 0], [500, 0]], 50)
    >>> cover.centre_m.tolist(), cover.disc.tolist(), cover.gap
    ([[40.0, 0.0], [500.0, 0.0]], [0, 0, 1], 0)
    """
    points = _checked(points_m, radius_m)
    covered = _useful(_candidates(points, radius_m))
    greedy = _greedy(covered, np.random.default_rng(0)) if len(points) > exact_points else None
    chosen, at_least = _integer_program(covered, BRANCHES if greedy is not None else None)
    if greedy is not None and (chosen is None or len(greedy) <= len(chosen)):
        chosen = greedy
    if chosen is None:
        raise RuntimeError("the integer program of the cover ended without a solution")
    return _arranged(points, covered[chosen], at_least)


def _checked(points_m: ArrayLike, radius_m: float) -> FloatArray:
    points = np.asarray(points_m, dtype=np.float64)
    if points.ndim != 2 or points.shape[1] not in (2, 3) or not 1 <= len(points) <= MAX_POINTS:
        raise InputError(
            f"points of shape {points.shape} came; allowed: 1 to {MAX_POINTS} points of easting and northing"
        )
    if not np.all(np.isfinite(points)):
        raise InputError("a point to cover has a coordinate that is no finite number: mend or leave it out")
    if not (np.isfinite(radius_m) and radius_m > 0):
        raise InputError(f"a radius of {radius_m} m came; allowed: a positive number of metres")
    return np.asarray(points[:, :2])


def _candidates(points: FloatArray, radius_m: float) -> BoolArray:
    """Which points (candidate, point) each disc covers that stands on a point or has two on its rim."""
    apart = np.linalg.norm(points[:, None] - points[None, :], axis=2)
    first, second = np.nonzero(np.triu((apart > 0.0) & (apart <= 2.0 * radius_m * (1.0 + RIM_SHARE)), 1))
    chord = points[second] - points[first]
    half = 0.5 * apart[first, second]
    rise = np.sqrt(np.maximum(radius_m**2 - half**2, 0.0)) / (2.0 * half)
    aside = rise[:, None] * chord[:, ::-1] * [-1.0, 1.0]
    middle = points[first] + 0.5 * chord
    centres = np.concatenate([points, middle + aside, middle - aside])
    step = max(1, CHUNK_CELLS // len(points))
    parts = [
        np.packbits(_within(centres[low : low + step], points, radius_m), axis=1)
        for low in range(0, len(centres), step)
    ]
    packed = np.unique(np.concatenate(parts), axis=0)
    return np.unpackbits(packed, axis=1, count=len(points)).astype(bool)


def _within(centres: FloatArray, points: FloatArray, radius_m: float) -> BoolArray:
    east, north = (centres[:, None, axis] - points[None, :, axis] for axis in (0, 1))
    return np.asarray(east * east + north * north <= (radius_m * (1.0 + RIM_SHARE)) ** 2)


def _useful(covered: BoolArray) -> BoolArray:
    """Leave out what another candidate covers as well and more."""
    size = covered.sum(axis=1)
    numbers = covered.astype(np.float32)
    keep = np.ones(len(covered), dtype=bool)
    step = max(1, 4 * CHUNK_CELLS // len(covered))
    for low in range(0, len(covered), step):
        shared = numbers[low : low + step] @ numbers.T  # (candidate, other)
        within = (shared == size[low : low + step, None]) & (size[None, :] > size[low : low + step, None])
        keep[low : low + step] = ~within.any(axis=1)
    return np.asarray(covered[keep])


def _integer_program(covered: BoolArray, branches: int | None) -> tuple[IntArray | None, int]:
    """The fewest candidates that cover everything, and how few there must be at least.

    None and the bound so far where a limited number of branches ends before any solution.
    """
    from scipy.optimize import Bounds, LinearConstraint, milp
    from scipy.sparse import csr_array

    count = len(covered)
    found = milp(
        np.ones(count),
        constraints=LinearConstraint(csr_array(covered.T.astype(np.float64)), lb=1.0, ub=np.inf),
        integrality=np.ones(count, dtype=np.int8),
        bounds=Bounds(0.0, 1.0),
        options={} if branches is None else {"node_limit": branches},
    )
    bound = found.mip_dual_bound if found.mip_dual_bound is not None else 1.0
    at_least = int(np.ceil(bound - 1e-6))  # the solver's own tolerance is 1e-7
    return None if found.x is None else np.flatnonzero(found.x > 0.5), at_least


def _greedy(covered: BoolArray, rng: np.random.Generator) -> IntArray:
    """A small cover: the best of several greedy ones, ties broken by chance, each improved."""
    best = np.arange(len(covered))
    for _ in range(ROUNDS):
        chosen = _improved(_one_greedy(covered, rng), covered)
        if len(chosen) < len(best):
            best = chosen
    return best


def _one_greedy(covered: BoolArray, rng: np.random.Generator) -> IntArray:
    """Take what covers most of the points that are left, again and again."""
    left = np.ones(covered.shape[1], dtype=bool)
    chosen: list[int] = []
    numbers = covered.astype(np.float32)
    while left.any():
        gain = numbers @ left.astype(np.float32) + rng.uniform(0.0, 0.9, len(covered))
        chosen.append(int(gain.argmax()))
        left &= ~covered[chosen[-1]]
    return np.array(chosen, dtype=np.intp)


def _improved(chosen: IntArray, covered: BoolArray) -> IntArray:
    """Leave out a disc that is not needed, or put one in the place of two, until neither is possible."""
    while True:
        fewer = _one_fewer(chosen, covered)
        if fewer is None:
            return chosen
        chosen = fewer


def _one_fewer(chosen: IntArray, covered: BoolArray) -> IntArray | None:
    times = covered[chosen].sum(axis=0)
    for first in range(len(chosen)):
        alone = covered[chosen[first]] & (times == 1)
        if not alone.any():
            return np.delete(chosen, first)
        for second in range(first):
            both = covered[chosen[first]].astype(np.intp) + covered[chosen[second]]
            needed = (both > 0) & (times == both)
            instead = np.flatnonzero(covered[:, needed].all(axis=1))
            if instead.size:
                return np.append(np.delete(chosen, [first, second]), instead[0])
    return None


def _arranged(points: FloatArray, covered: BoolArray, at_least: int) -> Cover:
    """Each point to one disc and each disc to the middle of its points, in turns; discs from west to east.

    A point only ever goes to a nearer middle, so that no disc grows beyond the radius.
    """
    disc, centre_m, reach_m = _circled(points, _served(covered))
    for _ in range(ARRANGEMENTS):
        apart = np.linalg.norm(points[:, None] - centre_m[None, :], axis=2)
        nearest = apart.argmin(axis=1)
        if np.array_equal(nearest, disc):
            break
        disc, centre_m, reach_m = _circled(points, nearest)
    order = np.lexsort(centre_m.T[::-1])
    return Cover(centre_m[order], np.argsort(order)[disc], reach_m[order], at_least)


def _circled(points: FloatArray, disc: IntArray) -> tuple[IntArray, FloatArray, FloatArray]:
    """Discs without gaps in their numbers, and the smallest circles: centres (disc, 2) and radii."""
    used, numbered = np.unique(disc, return_inverse=True)
    circles = [_smallest_circle(points[numbered == number]) for number in range(len(used))]
    return numbered, np.array([centre for centre, _ in circles]), np.array([reach for _, reach in circles])


def _served(covered: BoolArray) -> IntArray:
    """The disc of each point: the fullest of those that cover it, so that the others may stand closer."""
    size = covered.sum(axis=1)
    return np.asarray(np.where(covered, size[:, None], 0).argmax(axis=0))


def _smallest_circle(points: FloatArray) -> tuple[FloatArray, float]:
    """Centre and radius of the smallest circle around points (point, 2): through two or three of them."""
    middle = points.mean(axis=0)  # near the origin nothing is lost in the squares
    near = np.unique(points - middle, axis=0)
    if len(near) == 1:
        return points[0], 0.0
    centres = [_between_two(near)]
    if len(near) > 2:
        centres.append(_through_three(_hull(near)))
    centre = np.concatenate(centres)
    reach = np.sqrt(((centre[:, None] - near[None, :]) ** 2).sum(axis=2)).max(axis=1)
    best = int(reach.argmin())
    return middle + centre[best], float(reach[best])


def _between_two(near: FloatArray) -> FloatArray:
    first, second = np.triu_indices(len(near), 1)
    return np.asarray(0.5 * (near[first] + near[second]))


def _hull(near: FloatArray) -> FloatArray:
    """Corners of the convex hull: no other point touches the smallest circle."""
    import shapely

    return np.asarray(shapely.get_coordinates(shapely.convex_hull(shapely.MultiPoint(near)))[:-1])


def _through_three(corners: FloatArray) -> FloatArray:
    """Centres (triple, 2) of the circles through every three corners; those in a line are left out."""
    from itertools import combinations

    triples = np.array(list(combinations(range(len(corners)), 3)), dtype=np.intp).reshape(-1, 3)
    start = corners[triples[:, 0]]
    one, two = corners[triples[:, 1]] - start, corners[triples[:, 2]] - start
    double_area = one[:, 0] * two[:, 1] - one[:, 1] * two[:, 0]
    sound = double_area != 0.0
    squares = np.stack([(one**2).sum(axis=1), (two**2).sum(axis=1)], axis=1)[sound]
    one, two, start = one[sound], two[sound], start[sound]
    east = (squares[:, 0] * two[:, 1] - squares[:, 1] * one[:, 1]) / (2.0 * double_area[sound])
    north = (squares[:, 1] * one[:, 0] - squares[:, 0] * two[:, 0]) / (2.0 * double_area[sound])
    return np.asarray(start + np.stack([east, north], axis=1))
