"""Lines of sight: how far beams pass from solids, and where they meet them.

A beam runs straight from the head to the far end of the last gate that counts; terrain is not looked at here.
While a scanner turns, one ray sweeps a fan, and what stands anywhere in the fan is in the ray's way.
"""

from typing import NamedTuple

import numpy as np

from geometry.arrays import ArrayLike, BoolArray, FloatArray
from geometry.beams import unit_vector
from geometry.errors import InputError
from geometry.solids import Solids

# Shrinks a beam to GOLDEN^50 = 4e-11 of its length: 0.2 micrometres of 6 km.
GOLDEN = 0.5 * (np.sqrt(5.0) - 1.0)
SEARCH_STEPS = 50

# A fan is looked at along so many beams, then again around the closest between its two neighbours.
FAN_BEAMS = 9

# Looks at a fan: each is 4 times narrower, so that beams are 1/2048 of the sweep apart at the end.
FAN_LOOKS = 5


class Clearance(NamedTuple):
    """How far rays pass from solids."""

    clearance_m: FloatArray  # (ray, solid) smallest distance to the surface; negative is the depth inside
    range_m: FloatArray  # (ray, solid) range from the head where it is smallest
    entry_m: (
        FloatArray  # (ray, solid) range where the ray enters the solid, 0 from inside; NaN if it does not
    )


def clearance(
    head_m: ArrayLike,
    azimuth_deg: ArrayLike,
    elevation_deg: ArrayLike,
    reach_m: ArrayLike,
    solids: Solids,
    *,
    swept_azimuth_deg: ArrayLike = 0.0,
    swept_elevation_deg: ArrayLike = 0.0,
) -> Clearance:
    """Smallest distance of each ray to each solid.

    Parameters
    ----------
    head_m
        Position of the scanner head: east, north, up [m], shape (3,), in the frame of the solids.
    azimuth_deg, elevation_deg
        Middles of the rays [deg], clockwise from true north and above the horizontal; (ray,) or scalars.
    reach_m
        How far along the beam counts [m], slant, not negative: the gate plus half the probe; (ray,) or a
        scalar.
    solids
        `Cylinders`, `Boxes`, `Spheres` or `Discs`.
    swept_azimuth_deg, swept_elevation_deg
        How far the beam turns during one ray [deg], half of it on each side of the middle; 0 for a beam that
        stands still.

    Returns
    -------
    Clearance
        Clearance, its range, and the range of entry [m], each of shape (ray, solid). In a fan these belong to
        the beam of the fan that comes closest.

    Raises
    ------
    InputError
        If the rays are not finite, a reach is negative, or the shapes do not fit.

    Notes
    -----
    The distance to a convex solid is a convex function along a straight beam: golden section finds its least
    value whatever the directions (vertical, of no length, from inside), and bisection the first zero before
    it. Across the fan the least value has one minimum as well, which is closed in on by looking at ever fewer
    degrees. There the clearance can be too large by up to 1/4096 of the arc that the ray sweeps: 1 cm of 40
    m.

    Examples
    --------
    A tower of 4 m, 500 m north of the head: straight at it, past it, and past it while sweeping 2 degrees.

    >>> from geometry.solids import Cylinders
    >>> tower = Cylinders([[0.0, 500.0]], 2.0, 0.0, 90.0)
    >>> still = clearance([0.0, 0.0, 2.0], [0.0, 1.0], 3.0, 1000.0, tower)
    >>> still.clearance_m[:, 0].round(2).tolist(), still.entry_m[:, 0].round(2).tolist()
    ([-2.0, 6.73], [498.68, nan])
    >>> moving = clearance([0.0, 0.0, 2.0], [0.0, 1.0], 3.0, 1000.0, tower, swept_azimuth_deg=2.0)
    >>> moving.clearance_m[:, 0].round(2).tolist()
    [-2.0, -2.0]
    """
    rays = np.broadcast_arrays(
        *(
            np.atleast_1d(np.asarray(each, dtype=np.float64))
            for each in (azimuth_deg, elevation_deg, reach_m, swept_azimuth_deg, swept_elevation_deg)
        )
    )
    head = np.asarray(head_m, dtype=np.float64)
    if rays[0].ndim != 1 or head.shape != (3,) or not np.all(np.isfinite(rays)) or np.any(rays[2] < 0.0):
        raise InputError(
            f"rays of shape {rays[0].shape} from a head of shape {head.shape} came; allowed are one list of "
            "rays with finite angles and a reach of at least 0 m, and one head. Check the scan and its gates."
        )
    azimuth, elevation, reach, swept_azimuth, swept_elevation = (each[:, np.newaxis] for each in rays)
    fraction = _closest_in_fan(head, azimuth, elevation, reach, solids, swept_azimuth, swept_elevation)
    beam = unit_vector(azimuth + fraction * swept_azimuth, elevation + fraction * swept_elevation)
    least, where = _least_along(head, beam, reach, solids)
    return Clearance(least, where, _entry_m(head, beam, where, least, solids))


def lost_rays(sight: Clearance, *, margin_m: float = 0.0) -> BoolArray:
    """Tell which rays come nearer to some solid than a margin.

    Parameters
    ----------
    sight
        What `clearance` gave.
    margin_m
        Distance to keep [m]; at 0 a ray is lost that touches.

    Returns
    -------
    BoolArray
        True for a lost ray, shape (ray,).

    Examples
    --------
    >>> from geometry.solids import Spheres
    >>> rotor = Spheres([[0.0, 500.0, 90.0]], 50.0)
    >>> lost_rays(clearance([0.0, 0.0, 0.0], [0.0, 3.0, 6.0], 8.0, 900.0, rotor)).tolist()
    [True, True, False]
    """
    return np.asarray((sight.clearance_m <= margin_m).any(axis=1))


def _closest_in_fan(
    head_m: FloatArray,
    azimuth_deg: FloatArray,
    elevation_deg: FloatArray,
    reach_m: FloatArray,
    solids: Solids,
    swept_azimuth_deg: FloatArray,
    swept_elevation_deg: FloatArray,
) -> FloatArray:
    """Place in the sweep, -0.5 to 0.5, of the beam that comes closest: (ray, solid)."""
    middle = np.zeros((azimuth_deg.shape[0], len(solids)))
    if not np.any(swept_azimuth_deg) and not np.any(swept_elevation_deg):
        return middle
    width = 1.0
    for _ in range(FAN_LOOKS):
        spread = np.linspace(-0.5 * width, 0.5 * width, FAN_BEAMS)[:, np.newaxis, np.newaxis]
        places = np.clip(middle, -0.5 * (1.0 - width), 0.5 * (1.0 - width)) + spread  # (beam, ray, solid)
        beams = unit_vector(
            azimuth_deg + places * swept_azimuth_deg, elevation_deg + places * swept_elevation_deg
        )
        least, _ = _least_along(head_m, beams, reach_m, solids)
        closest = np.argmin(least, axis=0)[np.newaxis]
        middle = np.take_along_axis(places, closest, axis=0)[0]
        width *= 2.0 / (FAN_BEAMS - 1)
    return middle


def _least_along(
    head_m: FloatArray, beam: FloatArray, reach_m: FloatArray, solids: Solids
) -> tuple[FloatArray, FloatArray]:
    """Least signed distance [m] along beams (..., ray, solid, 3), and its range [m]: golden section."""

    def distance(range_m: FloatArray) -> FloatArray:
        return solids.distance_m(head_m + beam * range_m[..., np.newaxis])

    near = np.zeros(beam.shape[:-1])
    far = np.broadcast_to(reach_m, beam.shape[:-1])
    ends = [(distance(near), near), (distance(far), far)]
    low, high = far * (1.0 - GOLDEN), far * GOLDEN
    at_low, at_high = distance(low), distance(high)
    for _ in range(SEARCH_STEPS):
        left = at_low < at_high
        near, far = np.where(left, near, low), np.where(left, high, far)
        new = np.where(left, far - GOLDEN * (far - near), near + GOLDEN * (far - near))
        at_new = distance(new)
        low, high = np.where(left, new, high), np.where(left, low, new)
        at_low, at_high = np.where(left, at_new, at_high), np.where(left, at_low, at_new)
    least, where = at_low, low
    for at_end, end in ends:
        where = np.where(at_end <= least, end, where)
        least = np.minimum(at_end, least)
    return least, where


def _entry_m(
    head_m: FloatArray, beam: FloatArray, where_m: FloatArray, least_m: FloatArray, solids: Solids
) -> FloatArray:
    """Range [m] at which beams (ray, solid, 3) first touch, by bisection; NaN where they do not."""
    outside, inside = np.zeros_like(where_m), where_m
    for _ in range(SEARCH_STEPS):
        middle = 0.5 * (outside + inside)
        touched = solids.distance_m(head_m + beam * middle[..., np.newaxis]) <= 0.0
        outside, inside = np.where(touched, outside, middle), np.where(touched, middle, inside)
    from_inside = solids.distance_m(head_m + 0.0 * beam) <= 0.0
    return np.where(least_m <= 0.0, np.where(from_inside, 0.0, inside), np.nan)
