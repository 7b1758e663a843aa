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

from geometry.arrays import ArrayLike, BoolArray, FloatArray
from geometry.errors import InputError
from reconstruct.climate import Climate
from reconstruct.lidar_map import beam_view, radial_variance_m2s2
from reconstruct.uncertainty import ErrorSources
from reconstruct.wind import WindState, uv_mps

Criterion = Literal["vector", "speed", "direction"]
"""What is to be small: the error of the wind vector [m/s], of its speed [m/s], or of its direction [deg]."""


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

    def take(self, index: ArrayLike | slice) -> "BeamTable":
        """The table of some candidates."""
        return BeamTable(*(part[..., index] for part in self))


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
    return Climate(moment ** (1.0 / power), angles, weight)


def beam_table(
    heads_m: ArrayLike,
    targets_m: ArrayLike,
    climates: Sequence[Climate],
    like: Sequence[WindState],
    sources: ErrorSources,
    *,
    criterion: Criterion = "vector",
    ground_m: float = 0.0,
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
        One for each target: the wind there.
    like : sequence of WindState
        One for each target: everything of the wind but speed and direction; `height_m` is the target's above ground.
    sources : ErrorSources
        What can be wrong with the lidar.
    criterion : {"vector", "speed", "direction"}
        Whose error.
    ground_m : float
        Height of the ground in the frame [m].
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
    heads, targets = np.asarray(heads_m, dtype=float).reshape(-1, 3), np.asarray(targets_m, dtype=float).reshape(-1, 3)
    if not len(targets) == len(climates) == len(like):
        raise InputError(
            f"{len(targets)} targets came with {len(climates)} climates and {len(like)} states: give one each"
        )
    shape = (len(targets), len(heads))
    east, north, cosine, tensor = np.empty(shape), np.empty(shape), np.empty(shape), np.empty((3, *shape))
    noise = np.broadcast_to(np.asarray(sources.radial_speed_mps if noise_mps is None else noise_mps, float), shape)
    quiet = replace(sources, radial_speed_mps=0.0)
    for number, (target, climate, state) in enumerate(zip(targets, climates, like, strict=True)):
        states = condensed(climate, state, criterion)
        parts = _beams(heads, target, states, state, quiet, noise[number], criterion, ground_m)
        east[number], north[number], cosine[number], tensor[:, number] = parts
    clear = np.ones(shape, dtype=bool) if seen is None else np.asarray(seen, dtype=bool)
    return BeamTable(east, north, cosine, tensor, clear)


def _beams(
    heads: FloatArray,
    target: FloatArray,
    climate: Climate,
    like: WindState,
    quiet: ErrorSources,
    noise_mps: FloatArray,
    criterion: Criterion,
    ground_m: float,
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """East and north of the level beam and its cosine (candidate,), and the tensor (3, candidate), of one target."""
    tensor = np.zeros((3, len(heads)))
    height = target[2] - ground_m
    view = None
    for weight, state in zip(climate.weight, climate.states(like), strict=True):
        speed = state.speed_mps * (height / state.height_m) ** state.shear_exponent
        point = [np.full(len(heads), value) for value in (*target, speed, state.shear_exponent * speed / height)]
        with np.errstate(invalid="ignore", divide="ignore"):
            view = beam_view(heads.T, point, state)
            variance = weight * (noise_mps**2 + radial_variance_m2s2(view, quiet)) / view.cos_elevation**2
        for number, part in enumerate(_wanted_part(state, speed, criterion)):
            tensor[number] += part * variance
    if view is None:
        raise InputError("the climate has no state")
    return view.sin_azimuth, view.cos_azimuth, view.cos_elevation, tensor


def _wanted_part(state: WindState, speed: float, criterion: Criterion) -> tuple[float, float, float]:
    """ee, en, nn of a aᵀ: along the wind for its speed, across it (over the speed) for its direction, both for all."""
    along_east, along_north = (float(part) for part in uv_mps(1.0, state.from_deg))
    if criterion == "speed":
        return along_east**2, along_east * along_north, along_north**2
    if criterion == "direction":
        scale = np.degrees(1.0 / speed) ** 2
        return scale * along_north**2, -scale * along_east * along_north, scale * along_east**2
    return 1.0, 0.0, 1.0


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
    sine = np.stack([first.east[target], -first.north[target]]).T @ np.stack([second.north[target], second.east[target]])
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
