"""The linear tier for sets of lidars out of very many candidates: what each candidate's beam contributes, once.

With the gain G of the fit the error of the wind along a unit vector a is Σ over the beams of (a · G_i)² σ_i²,
averaged over the climate. Of each candidate and target the table keeps the beam r and the tensor
T = Σ_s w_s σ²(s) a_s a_sᵀ over the states s; any set of candidates then costs a few multiplications.

This is a second way through the algebra of `reconstruct.retrieval`, for the search alone: numbers that are shown come
from the core.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Literal, NamedTuple

import numpy as np

from geometry.arrays import ArrayLike, BoolArray, FloatArray, IntArray
from geometry.errors import InputError
from reconstruct.climate import Climate
from reconstruct.lidar_map import Air, scaled_variance, sight
from reconstruct.uncertainty import ErrorSources
from reconstruct.wind import WindState, uv_mps

Criterion = Literal["vector", "speed", "direction"]
"""What is to be small: the error of the wind vector [m/s], of its speed [m/s], or of its direction [deg]."""


CHUNK = 2**14
"""Beams that are worked on at once: their columns stay in the processor's cache."""


class BeamTable(NamedTuple):
    """What beams contribute, each (target, candidate)."""

    east: FloatArray  # horizontal unit vector of the beam
    north: FloatArray
    cosine: FloatArray  # of its elevation
    tensor: FloatArray  # (3, target, candidate): ee, en, nn of T over cosine² [m²/s² or deg²]
    seen: BoolArray  # whether this candidate can measure this target

    @property
    def targets(self) -> int:
        """Number of targets."""
        return int(self.east.shape[0])

    @property
    def candidates(self) -> int:
        """Number of candidates."""
        return int(self.east.shape[1])

    def take(self, index: slice | IntArray | list[int]) -> "BeamTable":
        """The table of some candidates."""
        return BeamTable(
            self.east[:, index],
            self.north[:, index],
            self.cosine[:, index],
            self.tensor[:, :, index],
            self.seen[:, index],
        )


def condensed(climate: Climate, like: WindState, criterion: Criterion) -> Climate:
    """A climate with one speed for each direction that gives the same linear-tier mean.

    Without a vertical wind and a lateral gradient the variance of a radial speed is a + c V², so its mean over the
    speeds from one direction is that at the root mean square; for the direction, over V², at the harmonic one.
    Otherwise the climate itself comes back.

    Examples
    --------
    >>> climate = Climate(np.array([6.0, 8.0]), np.array([90.0, 90.0]), np.array([1.0, 1.0]))
    >>> condensed(climate, WindState(speed_mps=1.0, from_deg=0.0), "speed").speed_mps.round(3)
    array([7.071])
    """
    if like.vertical_mps != 0 or like.lateral_gradient_per_s != 0:
        return climate
    angles, which = np.unique(climate.from_deg, return_inverse=True)
    weight = np.bincount(which, climate.weight)
    power = -2.0 if criterion == "direction" else 2.0
    with np.errstate(divide="ignore"):
        moment = np.bincount(which, climate.weight * climate.speed_mps**power) / weight
    return Climate(moment ** (1.0 / power), angles, np.asarray(weight, dtype=np.float64))


def beam_table(
    heads_m: ArrayLike,
    targets_m: ArrayLike,
    climates: Sequence[Climate],
    like: Sequence[WindState],
    sources: ErrorSources,
    *,
    criterion: Criterion = "vector",
    seen: BoolArray | None = None,
    noise_mps: ArrayLike | None = None,
) -> BeamTable:
    """Work out what the beam of every candidate to every target contributes to the error.

    Parameters
    ----------
    heads_m : array_like
        (candidate, 3) scanner heads, east, north, up [m].
    targets_m : array_like
        (target, 3) in the same frame.
    climates : sequence of Climate
        One for each target: the wind there; `condensed` makes it smaller for the same result.
    like : sequence of WindState
        One for each target: everything of the wind but speed and direction; `height_m` is the target's above ground.
    sources : ErrorSources
        What can be wrong with the lidar.
    criterion : {"vector", "speed", "direction"}
        Whose error.
    seen : numpy.ndarray, optional
        (target, candidate) False where the candidate cannot measure the target; default: everywhere True.
    noise_mps : array_like, optional
        Standard deviation of the radial speed, where it depends on the range: broadcast to (target, candidate); default
        that of the sources.

    Returns
    -------
    BeamTable

    Raises
    ------
    InputError
        If the numbers of targets, climates and states differ.

    Examples
    --------
    Two beams that cross at right angles and noise alone: the variance of the vector is the sum of both.

    >>> climate = Climate(np.array([10.0]), np.array([0.0]), np.array([1.0]))
    >>> state = WindState(speed_mps=1.0, from_deg=0.0, height_m=100.0)
    >>> table = beam_table([[0.0, -500.0, 100.0], [-500.0, 0.0, 100.0]], [[0.0, 0.0, 100.0]], [climate], [state],
    ...                    ErrorSources(radial_speed_mps=0.1))
    >>> set_variance([table.take([0]), table.take([1])]).round(6)
    array([[0.02]])
    """
    heads, targets = (
        np.asarray(heads_m, dtype=float).reshape(-1, 3),
        np.asarray(targets_m, dtype=float).reshape(-1, 3),
    )
    if not len(targets) == len(climates) == len(like):
        raise InputError(
            f"{len(targets)} targets came with {len(climates)} climates and {len(like)} states: give one each"
        )
    shape = (len(targets), len(heads))
    noise = np.broadcast_to(
        np.asarray(sources.radial_speed_mps if noise_mps is None else noise_mps, float), shape
    )
    states = _states(climates, like)
    out = np.empty((6, *shape))
    step = max(CHUNK // len(targets), 1)
    for start in range(0, len(heads), step):
        part = slice(start, start + step)
        out[:, :, part] = _beams(
            heads[part], targets, states, replace(sources, radial_speed_mps=0.0), noise[:, part], criterion
        )
    clear = np.ones(shape, dtype=bool) if seen is None else np.asarray(seen, dtype=bool)
    return BeamTable(out[0], out[1], out[2], out[3:], clear)


class _States(NamedTuple):
    """States of the wind at every target, each (state, target); where a target has fewer, the rest weigh nothing."""

    weight: FloatArray
    speed_mps: FloatArray
    from_deg: FloatArray
    shear_exponent: FloatArray  # (target,), as all below
    height_m: FloatArray
    vertical_mps: FloatArray
    lateral_per_s: float


def _states(climates: Sequence[Climate], like: Sequence[WindState]) -> _States:
    most = max(climate.count for climate in climates)
    weight, speed, angle = (
        np.zeros((most, len(climates))),
        np.ones((most, len(climates))),
        np.zeros((most, len(climates))),
    )
    for number, climate in enumerate(climates):
        weight[: climate.count, number] = climate.weight
        speed[: climate.count, number] = climate.speed_mps
        angle[: climate.count, number] = climate.from_deg
    lateral = {state.lateral_gradient_per_s for state in like}
    if len(lateral) > 1:
        raise InputError(f"lateral gradients {sorted(lateral)} came; all targets share one")
    shear, height, vertical = (
        np.array([getattr(state, name) for state in like], dtype=np.float64)
        for name in ("shear_exponent", "height_m", "vertical_mps")
    )
    return _States(weight, speed, angle, shear, height, vertical, lateral.pop())


def _beams(
    heads: FloatArray,
    targets: FloatArray,
    states: _States,
    quiet: ErrorSources,
    noise_mps: FloatArray,
    criterion: Criterion,
) -> FloatArray:
    """East and north of the level beam, cosine of its elevation, and the three of the tensor: (6, target, candidate)."""
    away = targets[:, :, None] - heads.T  # (target, 3, candidate)
    level = np.hypot(away[:, 0], away[:, 1])
    distance = np.hypot(level, away[:, 2])
    out = np.zeros((6, *level.shape))
    with np.errstate(invalid="ignore", divide="ignore"):
        out[0], out[1], out[2] = away[:, 0] / level, away[:, 1] / level, level / distance
        gradient = (states.shear_exponent / states.height_m)[:, None]
        for weight, speed, angle in zip(states.weight, states.speed_mps, states.from_deg, strict=True):
            along = np.stack(uv_mps(1.0, angle))[..., None]  # (2, target, 1)
            seen = sight(list(np.moveaxis(away, 1, 0)), along)
            air = Air(
                speed[:, None],
                speed[:, None] * gradient,
                states.vertical_mps[:, None],
                states.lateral_per_s,
            )
            variance = weight[:, None] * (noise_mps**2 + scaled_variance(seen, air, quiet) / seen.range2)
            for number, part in enumerate(_wanted_part(along, speed[:, None], criterion), start=3):
                out[number] += part * variance
        out[3:] /= out[2] ** 2
    return out


def _wanted_part(along: FloatArray, speed: FloatArray, criterion: Criterion) -> tuple[FloatArray, ...]:
    """ee, en, nn of a aᵀ: along the wind for its speed, across it (over the speed) for its direction, both for all."""
    east, north = along
    if criterion == "speed":
        return east * east, east * north, north * north
    if criterion == "direction":
        scale = np.degrees(1.0 / speed) ** 2
        return scale * north * north, -scale * east * north, scale * east * east
    return np.ones_like(east), np.zeros_like(east), np.ones_like(east)


def pair_variance(first: BeamTable, second: BeamTable, target: int) -> tuple[FloatArray, FloatArray]:
    """Variance of every candidate of one table with every one of another, at one target.

    Returns
    -------
    tuple of numpy.ndarray
        (first, second) variance in the criterion's unit, inf where the beams are parallel; and sin² of their opening
        angle in plan.

    Notes
    -----
    With horizontal unit vectors h and D = h_i x h_j: [(a x h_j)² s_i² + (a x h_i)² s_j²] / D², s = σ / cos φ. Both sums
    are inner products of what is known of i and what is known of j, so all pairs are two matrix products.
    """
    ours, across_ours = _factors(first, target)
    theirs, across_theirs = _factors(second, target)
    wanted = np.concatenate([ours, across_ours]).T @ np.concatenate([across_theirs, theirs])
    sine = np.stack([first.east[target], -first.north[target]]).T @ np.stack(
        [second.north[target], second.east[target]]
    )
    sine *= sine
    with np.errstate(divide="ignore", invalid="ignore"):
        np.divide(wanted, sine, out=wanted)
    return wanted, sine


def _factors(table: BeamTable, target: int) -> tuple[FloatArray, FloatArray]:
    """(3, candidate) each: the tensor, and the square of the perpendicular of the beam."""
    east, north = table.east[target], table.north[target]
    return table.tensor[:, target], np.stack([north * north, -2.0 * north * east, east * east])


def set_variance(members: Sequence[BeamTable]) -> FloatArray:
    """Variance that sets of lidars reach together, by unweighted least squares over those that see the target.

    Parameters
    ----------
    members : sequence of BeamTable
        One table for each lidar of the set, with as many candidates each (or one, which goes with all).

    Returns
    -------
    numpy.ndarray
        (target, candidate) in the criterion's unit; inf where fewer than two see it or the beams are parallel.

    Notes
    -----
    With r = h cos φ, A = Σ r rᵀ and y_i = A⁻¹ r_i: Σ y_iᵀ T_i y_i.
    """
    shape = np.broadcast_shapes(*(member.east.shape for member in members))
    ee, en, nn, total = (np.zeros(shape) for _ in range(4))
    for member in members:
        weight = member.seen * member.cosine**2
        ee += weight * member.east**2
        en += weight * member.east * member.north
        nn += weight * member.north**2
    with np.errstate(divide="ignore", invalid="ignore"):
        per = 1.0 / (ee * nn - en * en)
        for member in members:
            east = per * (nn * member.east - en * member.north)
            north = per * (ee * member.north - en * member.east)
            t_ee, t_en, t_nn = member.tensor
            part = t_ee * east * east + 2.0 * t_en * east * north + t_nn * north * north
            total += np.where(member.seen, member.cosine**4 * part, 0.0)
    enough = sum(member.seen.astype(int) for member in members) >= 2
    return np.where(np.isfinite(total) & enough, total, np.inf)


def widest_sine2(members: Sequence[BeamTable]) -> FloatArray:
    """(target, candidate) sin² of the opening angle in plan of those two of a set that cross best."""
    best: FloatArray = np.zeros(np.broadcast_shapes(*(member.east.shape for member in members)))
    for number, first in enumerate(members):
        for second in members[number + 1 :]:
            sine = first.east * second.north - first.north * second.east
            best = np.maximum(best, np.where(first.seen & second.seen, sine * sine, 0.0))
    return best
