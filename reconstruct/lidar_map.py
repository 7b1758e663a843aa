"""The linear tier for two lidars and very many targets at once, for maps of where to put them or what they
can see.

With h the level vector from a head to the target and d the slant range, a beam sees the wind by h/d, and a wind
vector is two such sights solved by Cramer's rule. The ranges multiply out: what is left is products of coordinates
along and across the wind, with no angle, and no root but those of the answers.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from geometry.arrays import ArrayLike, FloatArray
from geometry.errors import InputError
from reconstruct.factor import RANK_TOLERANCE
from reconstruct.radial_speed import power_law_mps
from reconstruct.retrieval import blocks
from reconstruct.uncertainty import ErrorSources
from reconstruct.wind import WindState, uv_mps

CHUNK = 2**14
"""Targets that are worked on at once: the columns of all of it stay in the processor's cache."""


class PairMap(NamedTuple):
    """Error of the wind that two lidars measure together at many targets, each of the targets' shape; NaN:
    unknown.
    """

    speed_std_mps: FloatArray
    direction_std_deg: FloatArray
    condition: FloatArray  # of the two rows; inf where the beams cannot tell the components apart


def pair_map(
    heads_m: ArrayLike,
    east_m: ArrayLike,
    north_m: ArrayLike,
    up_m: ArrayLike,
    wind: WindState,
    sources: ErrorSources | Sequence[ErrorSources],
    *,
    ground_m: float = 0.0,
) -> PairMap:
    """Linear-tier error of dual Doppler at every target, first order in the error.

    The numbers of `predict_linear` (tested to 1e-9), laid out for speed. Unlike the closed form of Vasiljević &
    Courtney (the tool YADDUM) it keeps cos φ: that one is 8 to 13 % low at 25 degrees.

    Parameters
    ----------
    heads_m : array_like
        (2, 3) scanner heads, east, north, up [m].
    east_m, north_m, up_m : array_like
        Targets [m] in the same frame, broadcast together.
    wind : WindState
        Its speed holds at `wind.height_m` above ground; at other heights the power law.
    sources : ErrorSources or sequence of ErrorSources
        One for both lidars, or one for each.
    ground_m : float
        Height of the ground in the frame [m].

    Returns
    -------
    PairMap

    Raises
    ------
    InputError
        If there are not two heads, or not one source or two.

    Notes
    -----
    With c and x the coordinates of h along and across the wind, D = h1 x h2 = (head 2 - head 1) x h1 and W = d² σ² of
    `scaled_variance`, the variances along and across the wind are (x2² W1 + x1² W2)/D² and (c2² W1 + c1² W2)/D². The
    condition is that of the rows h/d: with S the sum of their squares over d1² d2², (S + sqrt(S² - 4 D² d1² d2²))/(2 |D|
    d1 d2), the root being of (ρ1² z2² - ρ2² z1²)² + 4 (h1 · h2)² d1² d2²: nothing cancels.

    Examples
    --------
    >>> state = WindState(speed_mps=10.0, from_deg=0.0, shear_exponent=0.2, height_m=100.0)
    >>> errors = ErrorSources(radial_speed_mps=0.1, azimuth_deg=0.1, elevation_deg=0.1, range_m=1.0)
    >>> low = pair_map([[0, 0, 0], [1000, 1000, 0]], 500.0, -500.0, 100.0, state, errors)
    >>> round(float(low.speed_std_mps), 4), round(float(low.direction_std_deg), 4)
    (0.0963, 0.8076)
    """
    heads = np.asarray(heads_m, dtype=float)
    each = [sources] * 2 if isinstance(sources, ErrorSources) else list(sources)
    if heads.shape != (2, 3) or len(each) != 2:
        raise InputError(
            f"a pair map needs heads of shape (2, 3) and one source or two, not {heads.shape} and {len(each)}"
        )
    height = np.asarray(up_m, dtype=float) - ground_m
    speed = power_law_mps(
        height, speed_mps=wind.speed_mps, reference_height_m=wind.height_m, exponent=wind.shear_exponent
    )
    with np.errstate(invalid="ignore", divide="ignore"):
        shear = wind.shear_exponent * speed / height
    targets = np.broadcast_arrays(
        *(np.asarray(a, dtype=float) for a in (east_m, north_m, up_m)), speed, shear
    )
    out = PairMap(*(np.empty(targets[0].shape) for _ in PairMap._fields))

    with np.errstate(invalid="ignore", divide="ignore"):  # at a head, above it and on the baseline
        for index in blocks(out.condition.shape, CHUNK):
            part = _pair_chunk(heads, [_once(values[index]) for values in targets], wind, each)
            for whole, values in zip(out, part, strict=True):
                whole[index] = values
    return out


def _once(values: FloatArray) -> FloatArray:
    """Cut axes along which an array only repeats itself down to one element: they broadcast again for free."""
    return values[tuple(slice(1) if step == 0 else slice(None) for step in values.strides)]


class Sight(NamedTuple):
    """Targets as seen from a head, and squares that are needed more than once; all broadcast."""

    downwind_m: FloatArray
    left_m: FloatArray  # of the wind
    up_m: FloatArray
    downwind2: FloatArray  # [m²]
    left2: FloatArray
    level2: FloatArray  # of the distance over ground
    range2: FloatArray


class Air(NamedTuple):
    """Wind at the targets; all broadcast with the sights."""

    speed_mps: FloatArray
    shear_per_s: FloatArray  # growth of the speed with height
    vertical_mps: FloatArray | float
    lateral_per_s: float  # growth of the speed to the right, looking downwind


def sight(away_m: Sequence[FloatArray], downwind: ArrayLike) -> Sight:
    """See targets along and across the wind.

    Parameters
    ----------
    away_m : sequence of numpy.ndarray
        East, north, up from the head to the target [m].
    downwind : array_like
        (2, ...) east and north of the unit vector along the wind.

    Examples
    --------
    >>> seen = sight([np.array(300.0), np.array(400.0), np.array(0.0)], (0.0, 1.0))
    >>> float(seen.downwind_m), float(seen.left_m), float(seen.range2)
    (400.0, -300.0, 250000.0)
    """
    (east, north, up), (along_east, along_north) = away_m, np.asarray(downwind, dtype=float)
    downwind_m = along_east * east + along_north * north
    left_m = along_east * north - along_north * east
    downwind2, left2 = downwind_m * downwind_m, left_m * left_m
    level2 = downwind2 + left2
    return Sight(downwind_m, left_m, up, downwind2, left2, level2, level2 + up * up)


def scaled_variance(seen: Sight, air: Air, sources: ErrorSources) -> FloatArray:
    """Variance of the radial speed at each target times the squared range [m⁴/s²].

    With one ray a lidar, correlation between rays has nothing to do.

    Notes
    -----
    The squares of `reconstruct.responses` times d², with c downwind, x left, z up, ρ level, V the wind, s its shear, a
    its lateral gradient, w the vertical wind: noise d²; azimuth and heading g = V x + a c²; elevation t/ρ with t =
    (w + s c) ρ² - z c (V - a x); both axes of the level together (t² + z² g²)/ρ²; ranging c (s z - a x)/d; calibration
    V c + w z; position (s² + a²) c².

    Examples
    --------
    A beam along the wind, 0.1 m/s of noise and a calibration wrong by 1 % of 10 m/s: twice 0.01 m²/s² at 1 km.

    >>> ahead = sight([np.array(0.0), np.array(1000.0), np.array(0.0)], (0.0, 1.0))
    >>> still = Air(np.array(10.0), np.array(0.0), 0.0, 0.0)
    >>> float(scaled_variance(ahead, still, ErrorSources(radial_speed_mps=0.1, radial_speed_relative=0.01)).round(6))
    20000.0
    """
    rad2 = np.radians(1.0) ** 2
    turned = rad2 * (sources.azimuth_deg**2 + sources.heading_deg**2)
    lifted = rad2 * (sources.elevation_deg**2 + sources.levelling_deg**2)
    total = sources.radial_speed_mps**2 * seen.range2
    if turned or sources.levelling_deg:
        turning2 = np.square(_lateral(air, air.speed_mps * seen.left_m, seen.downwind2))
        total = total + turned * turning2
    if lifted:
        lifting2 = lifted * np.square(_lifting(seen, air))
        if sources.levelling_deg:
            lifting2 = lifting2 + rad2 * sources.levelling_deg**2 * np.square(seen.up_m) * turning2
        total = total + lifting2 / seen.level2
    if sources.range_m:
        sheared = _lateral(air, air.shear_per_s * seen.up_m, -seen.left_m)
        total = total + np.square(sources.range_m * sheared) / seen.range2 * seen.downwind2
    if sources.radial_speed_relative:
        along = air.speed_mps * seen.downwind_m + air.vertical_mps * seen.up_m
        total = total + np.square(sources.radial_speed_relative * along)
    if sources.position_m:
        moved2 = sources.position_m**2 * (np.square(air.shear_per_s) + air.lateral_per_s**2)
        total = total + moved2 * seen.downwind2
    return np.asarray(total)


def _lateral(air: Air, answer: FloatArray, gradient: FloatArray) -> FloatArray:
    """An answer, and what the lateral gradient adds to it where there is one."""
    return answer if air.lateral_per_s == 0 else answer + air.lateral_per_s * gradient


def _lifting(seen: Sight, air: Air) -> FloatArray:
    """(w + s c) ρ² - z c (V - a x): the answer to a beam that looks too high, times range and level distance."""
    lifted = air.shear_per_s * seen.level2 - seen.up_m * _lateral(air, air.speed_mps, -seen.left_m)
    lifted = lifted * seen.downwind_m
    risen = np.any(np.asarray(air.vertical_mps) != 0)
    return np.asarray(lifted + air.vertical_mps * seen.level2 if risen else lifted)


def _pair_chunk(
    heads: FloatArray, points: list[FloatArray], wind: WindState, sources: list[ErrorSources]
) -> tuple[FloatArray, FloatArray, FloatArray]:
    speed = points[3]
    air = Air(speed, points[4], wind.vertical_mps, wind.lateral_gradient_per_s)
    away = [[points[i] - head[i] for i in range(3)] for head in heads]
    one, two = (sight(each, uv_mps(1.0, wind.from_deg)) for each in away)
    first, second = (scaled_variance(*each) for each in zip((one, two), (air, air), sources, strict=True))
    apart = heads[1] - heads[0]
    per = 1 / np.abs(apart[0] * away[0][1] - apart[1] * away[0][0])
    condition = _condition(one, two) * per
    known = condition < 1 / RANK_TOLERANCE  # beyond, the angle between the beams is rounding
    if not np.all(known):
        condition, per = np.where(known, condition, np.inf), np.where(known, per, np.nan)
    speed_std = np.sqrt(two.left2 * first + one.left2 * second) * per
    side_std = np.sqrt(two.downwind2 * first + one.downwind2 * second) * per
    return speed_std, side_std * np.degrees(1 / np.where(speed > 0, speed, np.nan)), condition


def _condition(one: Sight, two: Sight) -> FloatArray:
    """Condition of the two rows times the level area |h1 x h2| that the sights span [m²]."""
    ranges2 = one.range2 * two.range2
    rise_one, rise_two = two.level2 * np.square(one.up_m), one.level2 * np.square(two.up_m)
    inner = one.downwind_m * two.downwind_m + one.left_m * two.left_m
    root = np.sqrt(np.square(rise_two - rise_one) + 4 * ranges2 * np.square(inner))
    total = 2 * one.level2 * two.level2 + rise_one + rise_two
    return np.asarray((total + root) / (2 * np.sqrt(ranges2)))
