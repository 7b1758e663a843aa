"""The linear tier for two lidars and very many targets at once, for maps of where to put them or what they
can see.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from geometry.arrays import ArrayLike, FloatArray
from geometry.errors import InputError
from reconstruct import responses
from reconstruct.factor import dot, factorise, turn
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

    The same responses and the same orthogonal factors as `predict_linear`, laid out for speed. Unlike the
    closed form of Vasiljević & Courtney (the tool YADDUM) it keeps cos φ: that one is 8 to 13 % low at 25
    degrees.

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

    for index in blocks(out.condition.shape, CHUNK):
        part = _pair_chunk(heads, [_once(values[index]) for values in targets], wind, each)
        for whole, values in zip(out, part, strict=True):
            whole[index] = values
    return out


def _once(values: FloatArray) -> FloatArray:
    """Cut axes along which an array only repeats itself down to one element: they broadcast again for free."""
    return values[tuple(slice(1) if step == 0 else slice(None) for step in values.strides)]


def _pair_chunk(
    heads: FloatArray, points: list[FloatArray], wind: WindState, sources: list[ErrorSources]
) -> tuple[FloatArray, FloatArray, FloatArray]:
    speed = points[3]
    with np.errstate(invalid="ignore", divide="ignore"):
        views = [beam_view(head, points, wind) for head in heads]
        noise = np.stack(
            [radial_variance_m2s2(view, source) for view, source in zip(views, sources, strict=True)]
        )
    rows = np.array([[view.east for view in views], [view.north for view in views]])
    root = np.isfinite(rows[0]).astype(float)
    if not np.all(root):  # a target at a lidar, or right above it
        rows[:, root == 0] = 0.0
    columns, axis = turn(list(rows), root)
    factor = factorise(columns, root, axis)
    along = np.stack(uv_mps(1.0, wind.from_deg))
    turned_speed = _carried(factor.basis, factor.spread, along)
    turned_side = _carried(factor.basis, factor.spread, np.array([-along[1], along[0]]))
    speed_std = np.sqrt(dot(turned_speed * turned_speed, noise))
    side_std = np.sqrt(dot(turned_side * turned_side, noise))
    return speed_std, np.degrees(side_std / np.where(speed > 0, speed, np.nan)), factor.condition


def _carried(basis: tuple[FloatArray, ...], spread: FloatArray, direction: FloatArray) -> FloatArray:
    """(ray, target) what each radial speed adds to the wind along a direction: a row of directionᵀ T R⁻¹
    Qᵀ.
    """
    small = direction[0] * spread[0] + direction[1] * spread[1]
    return np.asarray(small[0] * basis[0] + small[1] * basis[1])


def beam_view(head: FloatArray, points: Sequence[FloatArray], wind: WindState) -> responses.View:
    """Beams from a head (3, ...) to points: east, north, up [m], speed [m/s] and shear [1/s] there, which broadcast."""
    east, north, up = (points[i] - head[i] for i in range(3))
    level2 = east * east + north * north
    level, distance = np.sqrt(level2), np.sqrt(level2 + up * up)
    per_level, per_distance = 1 / level, 1 / distance
    east, north, cosine = east * per_level, north * per_level, level * per_distance
    u, v = (float(a) for a in uv_mps(1.0, wind.from_deg))
    return responses.View(
        sin_azimuth=east,
        cos_azimuth=north,
        sin_elevation=up * per_distance,
        cos_elevation=cosine,
        east=east * cosine,
        north=north * cosine,
        range_m=distance,
        u_mps=u * points[3],
        v_mps=v * points[3],
        w_mps=wind.vertical_mps,
        shear_per_s=(u * east + v * north) * cosine * points[4],
        lateral_per_s=wind.lateral_gradient_per_s,
        downwind=(u, v),
    )


def radial_variance_m2s2(view: responses.View, sources: ErrorSources) -> FloatArray:
    """Variance of the radial speed at each target [m²/s²]; with one ray a lidar, correlation has nothing to
    do.
    """
    rad2 = np.radians(1.0) ** 2
    total = np.full(view.range_m.shape, sources.radial_speed_mps**2)
    parts: list[tuple[float, Callable[[responses.View], tuple[FloatArray, ...]]]] = [
        (rad2 * (sources.azimuth_deg**2 + sources.heading_deg**2), responses.azimuth),
        (rad2 * sources.elevation_deg**2, responses.elevation),
        (sources.range_m**2, responses.ranging),
        (sources.radial_speed_relative**2, responses.relative),
        (rad2 * sources.levelling_deg**2, responses.tilt),
        (sources.position_m**2, responses.position),
    ]
    for variance, response in parts:
        for answer in response(view) if variance > 0 else ():
            total += variance * (answer * answer)
    return total
