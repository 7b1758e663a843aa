"""The linear tier for one sector scan and very many places of its lidar."""

from collections.abc import Callable, Sequence

import numpy as np

from geometry.arrays import ArrayLike, FloatArray
from reconstruct import responses
from reconstruct.beam_table import Criterion, condensed
from reconstruct.climate import Climate
from reconstruct.retrieval import gain, rows
from reconstruct.uncertainty import COMMON, ErrorSources
from reconstruct.wind import WindState, uv_mps

CHUNK = 2**15
"""Rays that are worked on at once."""

Answer = Callable[[responses.View], tuple[FloatArray, ...]]


def sector_variance(
    heads_m: ArrayLike,
    target_m: ArrayLike,
    offsets_deg: ArrayLike,
    climate: Climate,
    like: WindState,
    sources: ErrorSources,
    *,
    criterion: Criterion = "vector",
    noise_mps: ArrayLike | None = None,
) -> FloatArray:
    """Linear-tier variance of one sector scan centred on a target, from every one of many heads.

    The same responses and the same gain as `predict_linear`, for all heads at once. The head is taken as level and
    all rays as rising alike.

    Parameters
    ----------
    heads_m : array_like
        (candidate, 3) scanner heads, east, north, up [m].
    target_m : array_like
        (3,) in the same frame; the arc goes through it.
    offsets_deg : array_like
        (ray,) azimuths of the rays less that of the target [deg].
    climate, like, sources
        The wind at the target and what can be wrong with the lidar, as for `beam_table`.
    criterion : {"vector", "speed", "direction"}
        Whose error.
    noise_mps : array_like, optional
        Standard deviation of the radial speed, where it depends on the range: broadcast to (candidate,).

    Returns
    -------
    numpy.ndarray
        (candidate,) variance, climate mean, in the criterion's unit [m²/s² or deg²]; NaN for a head at the target.

    Examples
    --------
    >>> climate = Climate(np.array([10.0]), np.array([0.0]), np.array([1.0]))
    >>> state = WindState(speed_mps=1.0, from_deg=0.0, shear_exponent=0.2, height_m=100.0)
    >>> errors = ErrorSources(radial_speed_mps=0.1, azimuth_deg=0.1, elevation_deg=0.1, range_m=5.0)
    >>> offsets = np.arange(60.0) - 30.0
    >>> variance = sector_variance([[-994.987, 0.0, 0.0]], [0.0, 0.0, 100.0], offsets, climate, state, errors,
    ...                            criterion="speed")
    >>> (variance**0.5).round(4)
    array([0.0451])
    """
    heads = np.asarray(heads_m, dtype=float).reshape(-1, 3)
    target, offsets = np.asarray(target_m, dtype=float), np.asarray(offsets_deg, dtype=float)
    states = condensed(climate, like, criterion)
    noise = np.broadcast_to(
        np.asarray(sources.radial_speed_mps if noise_mps is None else noise_mps, float), len(heads)
    )
    out = np.empty(len(heads))
    step = max(CHUNK // len(offsets), 1)
    for start in range(0, len(heads), step):
        part = slice(start, start + step)
        out[part] = _variance(heads[part], target, offsets, states, like, sources, noise[part], criterion)
    return out


def _variance(
    heads: FloatArray,
    target: FloatArray,
    offsets: FloatArray,
    climate: Climate,
    like: WindState,
    sources: ErrorSources,
    noise_mps: FloatArray,
    criterion: Criterion,
) -> FloatArray:
    away = target - heads
    level = np.hypot(away[:, 0], away[:, 1])
    azimuth = np.degrees(np.arctan2(away[:, 0], away[:, 1]))[:, None] + offsets
    elevation = np.broadcast_to(np.degrees(np.arctan2(away[:, 2], level))[:, None], azimuth.shape)
    with np.errstate(invalid="ignore", divide="ignore"):
        fit = np.moveaxis(gain(rows(azimuth, elevation)), 0, -1)  # (col, ray, candidate)
    angle = np.radians(azimuth.T)
    ends = heads.T[:2, None] + level * np.stack([np.sin(angle), np.cos(angle)])
    total = np.zeros(len(heads))
    for weight, state in zip(climate.weight, climate.states(like), strict=True):
        speed = state.speed_mps
        shear = state.shear_exponent * speed / state.height_m
        filled = [np.full(angle.shape, value) for value in (target[2], speed, shear)]
        with np.errstate(invalid="ignore", divide="ignore"):
            view = _beam_view(heads.T[:, None], [*ends, *filled], state)
        along = np.stack([float(part) for part in uv_mps(1.0, state.from_deg)])
        across = np.array([-along[1], along[0]])
        if criterion != "direction":
            total += weight * _projected(np.tensordot(along, fit, 1), view, sources, noise_mps)
        if criterion != "speed":
            scale = 1.0 if criterion == "vector" else np.degrees(1.0 / speed) ** 2
            total += weight * scale * _projected(np.tensordot(across, fit, 1), view, sources, noise_mps)
    return np.asarray(total)


def _projected(
    gain_row: FloatArray, view: responses.View, sources: ErrorSources, noise_mps: FloatArray
) -> FloatArray:
    """Variance (candidate,) of one component of the wind: Σ over sources of ρ (g · s)² + (1 - ρ) Σ (g s)²."""
    rad = np.radians(1.0)
    parts: list[tuple[float, Answer, float]] = [
        (rad * sources.azimuth_deg, responses.azimuth, sources.azimuth_correlation),
        (rad * sources.elevation_deg, responses.elevation, sources.elevation_correlation),
        (sources.range_m, responses.ranging, sources.range_correlation),
        (sources.radial_speed_relative, responses.relative, COMMON),
        (rad * sources.heading_deg, responses.azimuth, COMMON),
        (rad * sources.levelling_deg, responses.tilt, COMMON),
        (sources.position_m, responses.position, COMMON),
    ]
    own, together = np.einsum("rc,rc->c", gain_row, gain_row), np.square(gain_row.sum(axis=0))
    shared = sources.radial_speed_correlation
    total = noise_mps**2 * ((1.0 - shared) * own + shared * together)
    for std, answer, correlation in parts:
        for response in answer(view) if std > 0 else ():
            carried = gain_row * response
            total += std**2 * (1.0 - correlation) * np.einsum("rc,rc->c", carried, carried)
            total += std**2 * correlation * np.square(carried.sum(axis=0))
    return np.asarray(total)


def _beam_view(head: FloatArray, points: Sequence[FloatArray], wind: WindState) -> responses.View:
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
