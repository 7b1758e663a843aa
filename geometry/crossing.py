"""How two beams cross: where they come closest, how far apart they pass and at what angle."""

from typing import NamedTuple

import numpy as np

from geometry.arrays import ArrayLike, FloatArray
from geometry.errors import InputError

#: Separation up to which two probes count as measuring the same air, as a share of the shorter probe. A
#: probe blurs what is smaller than itself; at a quarter of its length two probes that cross without a gap
#: share their whole length up to an angle of 30 degrees and half of it at 90.
SHARED_SEPARATION = 0.25

#: Sine of the angle up to which two beams count as parallel, and a beam as vertical: two directions made from
#: opposite azimuths in degrees are 1.1e-15 off by rounding alone. At 1e-9 degrees the sine is 1.7e-11.
PARALLEL_SINE = 2e-15

#: Dekker's constant 2^27 + 1, which splits a float64 into two halves whose products are exact.
_SPLITTER = 134_217_729.0


class Crossing(NamedTuple):
    """Closest approach of two beams, all arrays of the shape (...) that the inputs broadcast to.

    For parallel beams (`PARALLEL_SINE`) the points are infinitely far away, or anywhere: points, ranges and
    height difference are NaN.
    """

    point1_m: FloatArray  # (..., 3) on the first beam, nearest to the second
    point2_m: FloatArray  # (..., 3) on the second beam, nearest to the first
    range1_m: FloatArray  # from origin 1 to point 1, negative behind the lidar
    range2_m: FloatArray  # the same for the second beam
    gap_m: FloatArray  # shortest distance between the two beams' lines; of parallel beams their distance
    height_difference_m: (
        FloatArray  # point 2 minus point 1, upwards; all of the gap where both beams are level
    )
    angle_deg: FloatArray  # between the two directions in three dimensions, 0 to 180
    opening_angle_deg: FloatArray  # the same in plan, 0 to 180; NaN where a beam is vertical
    folded_angle_deg: FloatArray  # in plan, between the two lines, 0 to 90: the conditioning of the pair


def cross(
    origin1_m: ArrayLike, direction1: ArrayLike, origin2_m: ArrayLike, direction2: ArrayLike
) -> Crossing:
    """Find where two beams come closest.

    Parameters
    ----------
    origin1_m, origin2_m : array_like (..., 3)
        Scanner heads in one common frame: east, north, up [m].
    direction1, direction2 : array_like (..., 3)
        Directions away from the heads in the same frame, of any length.

    Returns
    -------
    Crossing
        Points, ranges, gap, height difference and angles. Beams are whole lines: a negative range means that
        they come closest behind the lidar. NaN in gives NaN out.

    Raises
    ------
    InputError
        If an array has not 3 components, the shapes do not fit, or a direction has length 0.

    Notes
    -----
    The end points of the common perpendicular of two skew lines, with n = b1 x b2 and w = o2 - o1, solve
    w = r1 b1 - r2 b2 + s n; multiplied by b2 x n, b1 x n and n this gives

        r1 = w·(b2 x n)/|n|²,   r2 = w·(b1 x n)/|n|²,   s = w·n/|n|²,   gap = |s n|,

    and the angle is atan2(|n|, b1·b2). Every product of n is made without rounding (Dekker 1971, Numer.
    Math. 18, 224-242, doi:10.1007/BF01397083), so that n keeps its digits for beams that are parallel to
    1e-9 degrees.

    Examples
    --------
    >>> crossing = cross([0, 0, 0], [1, 0, 0], [1000, -1000, 5], [0, 1, 0])
    >>> crossing.point1_m, crossing.point2_m
    (array([1000.,    0.,    0.]), array([1000.,    0.,    5.]))
    >>> float(crossing.gap_m), float(crossing.height_difference_m), float(crossing.opening_angle_deg)
    (5.0, 5.0, 90.0)
    """
    origin1, beam1, origin2, beam2 = _checked(origin1_m, direction1, origin2_m, direction2)
    between = origin2 - origin1
    normal = _cross_product(beam1, beam2)
    square = _dot(normal, normal)
    parallel = square <= PARALLEL_SINE**2 * _dot(beam1, beam1) * _dot(beam2, beam2)
    safe = np.where(parallel, np.nan, square)
    along1 = _dot(between, np.cross(beam2, normal)) / safe
    along2 = _dot(between, np.cross(beam1, normal)) / safe
    shift = _dot(between, normal) / safe
    apart = np.linalg.norm(np.cross(between, beam1), axis=-1) / np.linalg.norm(beam1, axis=-1)
    sine, cosine = _plan_products(beam1, beam2)
    return Crossing(
        point1_m=origin1 + along1[..., None] * beam1,
        point2_m=origin2 + along2[..., None] * beam2,
        range1_m=along1 * np.linalg.norm(beam1, axis=-1),
        range2_m=along2 * np.linalg.norm(beam2, axis=-1),
        gap_m=np.where(parallel, apart, np.abs(shift) * np.sqrt(square)),
        height_difference_m=shift * normal[..., 2],
        angle_deg=np.rad2deg(np.arctan2(np.sqrt(square), _dot(beam1, beam2))),
        opening_angle_deg=np.rad2deg(np.arctan2(sine, cosine)),
        folded_angle_deg=np.rad2deg(np.arctan2(sine, np.abs(cosine))),
    )


def shared_probe_length_m(
    angle_deg: ArrayLike,
    gap_m: ArrayLike,
    length1_m: ArrayLike,
    length2_m: ArrayLike,
    *,
    separation_m: ArrayLike | None = None,
) -> FloatArray:
    """Length of the shorter probe that lies close to the longer one: how much air two beams have in common.

    Parameters
    ----------
    angle_deg : array_like
        Angle of the beams in three dimensions [deg], 0 to 180.
    gap_m : array_like
        Shortest distance between the beams [m], where both probes have their middles.
    length1_m, length2_m : array_like
        Probe lengths [m].
    separation_m : array_like, optional
        What counts as close [m]; a quarter of the shorter probe if not given.

    Returns
    -------
    array
        Length [m], from 0 (the gap is larger than the separation) to the shorter probe (parallel and close).

    Raises
    ------
    InputError
        If an angle is outside 0 to 180, or a length or the gap is negative.

    Notes
    -----
    Probes are straight segments with their middles at the ends of the common perpendicular. A point s from
    the middle of the shorter probe is sqrt(gap² + s² sin²χ) from the other beam, and the foot of that
    distance, s·|cosχ| from the middle, always lies on the longer probe. So the length within the
    separation D is

        min(shorter, 2·sqrt(D² - gap²)/sinχ).

    Examples
    --------
    >>> shared_probe_length_m([0.0, 63.0, 90.0], 0.0, 42.6, 42.6).round(1)
    array([42.6, 23.9, 21.3])
    >>> float(shared_probe_length_m(63.0, 11.0, 42.6, 42.6))
    0.0
    """
    angle, gap, length1, length2 = np.broadcast_arrays(
        *(np.asarray(value, dtype=np.float64) for value in (angle_deg, gap_m, length1_m, length2_m))
    )
    if np.any(angle < 0) or np.any(angle > 180):
        raise InputError("an angle of two beams is outside 0 to 180 degrees: give that of their directions")
    shorter = np.minimum(length1, length2)
    close = (
        SHARED_SEPARATION * shorter if separation_m is None else np.asarray(separation_m, dtype=np.float64)
    )
    if np.any(gap < 0) or np.any(shorter < 0) or np.any(close < 0):
        raise InputError("a gap, a probe length or a separation is negative: give metres, 0 or more")
    # sin of the folded angle, so that 180 degrees is as exactly parallel as 0
    sine = np.sin(np.deg2rad(np.minimum(angle, 180.0 - angle)))
    room = 2.0 * np.sqrt(np.maximum((close - gap) * (close + gap), 0.0))
    fits = room >= shorter * sine
    length = np.where(fits, shorter, np.divide(room, sine, out=np.zeros_like(room + sine), where=sine > 0))
    return np.asarray(np.where(gap > close, 0.0, length))


def _checked(*vectors: ArrayLike) -> list[FloatArray]:
    """Broadcast origins and directions to one shape (..., 3) and refuse what is no vector."""
    arrays = [np.asarray(vector, dtype=np.float64) for vector in vectors]
    shapes = [array.shape for array in arrays]
    try:
        arrays = list(np.broadcast_arrays(*arrays))
    except ValueError as error:
        raise InputError(
            f"origins and directions of shapes {shapes} do not fit together: give (..., 3)"
        ) from error
    if any(shape[-1:] != (3,) for shape in shapes):
        raise InputError(f"origins and directions of shapes {shapes}: give east, north, up last (..., 3)")
    for direction in arrays[1::2]:
        if np.any(np.all(direction == 0.0, axis=-1)):
            raise InputError("a direction has length 0: give the vector along the beam, away from the lidar")
    return arrays


def _plan_products(beam1: FloatArray, beam2: FloatArray) -> tuple[FloatArray, FloatArray]:
    """|Cross| and dot product of the two beams in plan; NaN where a beam is vertical."""
    east1, north1, east2, north2 = beam1[..., 0], beam1[..., 1], beam2[..., 0], beam2[..., 1]
    # cos 90° is 6e-17 in floating point: what is left in plan of a beam straight up points nowhere
    vertical = (np.hypot(east1, north1) <= PARALLEL_SINE * np.abs(beam1[..., 2])) | (
        np.hypot(east2, north2) <= PARALLEL_SINE * np.abs(beam2[..., 2])
    )
    sine = np.abs(_difference_of_products(east1, north2, north1, east2))
    return np.where(vertical, np.nan, sine), east1 * east2 + north1 * north2


def _dot(first: FloatArray, second: FloatArray) -> FloatArray:
    return np.asarray(np.einsum("...i,...i->...", first, second))


def _cross_product(first: FloatArray, second: FloatArray) -> FloatArray:
    """Cross product, each component to rounding even where the vectors are nearly parallel."""
    x1, y1, z1 = np.moveaxis(first, -1, 0)
    x2, y2, z2 = np.moveaxis(second, -1, 0)
    components = (
        _difference_of_products(y1, z2, z1, y2),
        _difference_of_products(z1, x2, x1, z2),
        _difference_of_products(x1, y2, y1, x2),
    )
    return np.stack(components, axis=-1)


def _difference_of_products(a: FloatArray, b: FloatArray, c: FloatArray, d: FloatArray) -> FloatArray:
    """a·b - c·d with the rounding errors of both products put back (Dekker 1971, Kahan)."""
    left, left_error = _two_product(a, b)
    right, right_error = _two_product(c, d)
    return np.asarray((left - right) + (left_error - right_error))


def _two_product(a: FloatArray, b: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Product and its rounding error, exactly: a·b = product + error."""
    product = a * b
    a_high, a_low = _halves(a)
    b_high, b_low = _halves(b)
    error = a_low * b_low - (((product - a_high * b_high) - a_low * b_high) - a_high * b_low)
    return product, error


def _halves(a: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Split into an upper and a lower half of 26 bits each."""
    scaled = _SPLITTER * a
    high = scaled - (scaled - a)
    return high, a - high
