"""What a turbulence model says about two rays at two times, and about a ray and the wind at the target.

Frozen turbulence moves with the mean wind U, so that air measured at place x and time t is the air of the
place x - U t. In that frame a ray covers a small patch: its probe along the beam, and across it the arc that
the head sweeps during the accumulation less the way the air went. The covariance of two rays is the
correlation of the model averaged over both patches. Frame of the work inside: x downwind, y left, z up,
origin at the target.
"""

from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from geometry.arrays import ArrayLike, FloatArray, IntArray
from geometry.beams import unit_vector
from geometry.gates import Probe
from reconstruct.correlation import Correlation, correlation
from reconstruct.rays import Rays
from reconstruct.spectra import Turbulence
from reconstruct.wind import WindState

# Beyond that many integral lengths one place a patch is enough: the difference is under 1e-4 of the variance.
DISTANT_LENGTHS = {"von-karman": 4.0, "kaimal": 8.0, "mann": 8.0}
# Patches closer than this many standard deviations of their offset get the fine quadrature: with it the
# covariance of the retrieved wind is right to 4e-4 (sectors of 60, 16 and 6 degrees, 30 rays of 43 m and 2
# degrees).
NEAR_SPREADS = 3.0
# Its nodes over probe and sweep, of either side: unequal, so that no two places coincide.
FIRST_NODES, SECOND_NODES = (2, 2), (3, 2)
SELF_NODES = (8, 5)  # probe and sweep of a ray with itself, graded towards no offset
CHUNK_PLACES = 2**13  # correlations evaluated at once: their arrays stay in the processor's cache
_FINE_PLACES = FIRST_NODES[0] * FIRST_NODES[1] * SECOND_NODES[0] * SECOND_NODES[1]
_UNIT_STD = np.sqrt(1.0 / 12.0)  # of a uniform variable of width 1
# Two places for each of four offsets (two probes, two sweeps): eight of the sixteen corners, exact to third
# degree.
_CORNERS = np.array([[a, b, c, a * b * c] for a in (-1.0, 1.0) for b in (-1.0, 1.0) for c in (-1.0, 1.0)])


class Patches(NamedTuple):
    """Where rays measure in the air that moves with the wind; components first."""

    centre_m: FloatArray  # (3, ray)
    beam: FloatArray  # (3, ray) unit vector of the beam
    sweep_m: FloatArray  # (3, ray) from the start of the ray to its end
    lidar: IntArray  # (ray,)

    def take(self, index: IntArray) -> "Patches":
        """Patches of some rays, in that order."""
        return Patches(
            self.centre_m[:, index], self.beam[:, index], self.sweep_m[:, index], self.lidar[index]
        )


def lag_covariance(
    rays: Rays, wind: WindState, turbulence: Turbulence, lags: ArrayLike = (0,), *, sweep: bool = True
) -> FloatArray:
    """Covariance of the radial speeds of two scans that are some scans apart.

    Parameters
    ----------
    rays
        Rays of one scan.
    wind
        Mean wind, which carries the turbulence.
    turbulence
        Model, intensity and length.
    lags
        (lag,) how many scans the second one comes later, whole numbers, 0 or above.
    sweep
        Average over the turn of the head and the way of the air during each ray. False: the ray stands still
        at its middle.

    Returns
    -------
    numpy.ndarray
        (pass, lag, ray, ray) covariance [m²/s²] of each ray of the first scan with each of the second. Where
        scans go back and forth the first scan runs in the declared order in pass 0 and in reverse in pass 1;
        otherwise there is one pass.

    Notes
    -----
    b_mᵀ R(x_m - x_n - U (t_m - t_n)) b_n averaged over both patches, R the covariance tensor of the model.

    Examples
    --------
    >>> from geometry.gates import Probe
    >>> stare = Rays(azimuth_deg=np.array([0.0]), elevation_deg=np.zeros(1), range_m=np.array([1000.0]),
    ...     head_m=np.array([[0.0, -1000.0, 0.0]]), lidar=np.zeros(1, dtype=int), time_s=np.zeros(1),
    ...     duration_s=np.full(1, 0.5), swept_azimuth_deg=np.zeros(1), probes=(Probe(pulse_ns=200,
    ...     window_ns=256),),
    ...     period_s=10.0)
    >>> wind, air = WindState(10.0, 0.0), Turbulence(intensity=0.1, length_m=170.0)
    >>> lag_covariance(stare, wind, air, [0, 1])[0, :, 0, 0].round(3)
    array([0.832, 0.507])
    """
    air = _Air(correlation(turbulence), rays.probes, DISTANT_LENGTHS[turbulence.model] * turbulence.length_m)
    steps = np.atleast_1d(np.asarray(lags, dtype=np.intp))
    passes = 2 if rays.back_and_forth else 1
    patches = [patches_of(rays, wind, reverse=bool(odd), sweep=sweep) for odd in range(passes)]
    out = np.empty((passes, len(steps), rays.count, rays.count))
    if np.any(steps == 0):
        out[:, steps == 0] = _within(air, patches)[:, None]
    shift = velocity_mps(wind) * rays.period_s
    first, second = np.indices((rays.count, rays.count)).reshape(2, -1)
    for odd, parity in np.ndindex(passes, passes):
        where = np.flatnonzero((steps > 0) & (steps % passes == parity))
        if len(where):
            moved = shift[:, None, None] * steps[where][None, :, None]
            later = patches[(odd + parity) % passes].take(second)
            values = _pairs(air, patches[odd].take(first), later, moved)
            out[odd, where] = values.reshape(len(where), rays.count, rays.count)
    return turbulence.std_mps(wind.speed_mps) ** 2 * out


def target_covariance(
    rays: Rays, wind: WindState, turbulence: Turbulence, times_s: ArrayLike, *, sweep: bool = True
) -> FloatArray:
    """Covariance of the radial speeds of a scan with the wind at the target.

    Parameters
    ----------
    rays, wind, turbulence, sweep
        See `lag_covariance`.
    times_s
        (time,) when the wind at the target is taken, since the start of the scan [s].

    Returns
    -------
    numpy.ndarray
        (pass, time, ray, 2) covariance [m²/s²] with the downwind component at the target, and with the one to
        its left.
    """
    air = _Air(correlation(turbulence), rays.probes, DISTANT_LENGTHS[turbulence.model] * turbulence.length_m)
    moments = np.atleast_1d(np.asarray(times_s, dtype=float))
    moved = velocity_mps(wind)[:, None, None] * moments[None, :, None]
    passes = 2 if rays.back_and_forth else 1
    out = np.empty((passes, len(moments), rays.count, 2))
    still = np.zeros((3, rays.count))
    for odd, component in np.ndindex(passes, 2):
        patches = patches_of(rays, wind, reverse=bool(odd), sweep=sweep)
        along = still.copy()
        along[component] = 1.0
        point = Patches(still, along, still, patches.lidar)
        out[odd, :, :, component] = _pairs(air, patches, point, moved, to_point=True)
    return turbulence.std_mps(wind.speed_mps) ** 2 * out


def point_covariance(wind: WindState, turbulence: Turbulence, times_s: ArrayLike) -> FloatArray:
    """Covariance of the wind at a point with itself some time later.

    Parameters
    ----------
    wind, turbulence
        See `lag_covariance`.
    times_s
        (time,) lags [s].

    Returns
    -------
    numpy.ndarray
        (time, 2) of the downwind component and of the one to its left [m²/s²]; the two do not correlate.

    Examples
    --------
    >>> point_covariance(WindState(10.0, 0.0), Turbulence(0.1, 170.0), [0.0, 10.0]).round(3)
    array([[1.   , 1.   ],
           [0.501, 0.365]])
    """
    moments = np.atleast_1d(np.asarray(times_s, dtype=float))
    separation = np.outer(velocity_mps(wind), moments)
    axes = np.eye(3)[:2, :, None]
    tensor = correlation(turbulence)
    parts = [tensor(separation, axis, axis) for axis in axes]
    return np.asarray(turbulence.std_mps(wind.speed_mps) ** 2 * np.stack(parts, axis=-1))


def patches_of(rays: Rays, wind: WindState, *, reverse: bool = False, sweep: bool = True) -> Patches:
    """Patches of the rays of one scan; `reverse` gives the scan that runs back through the same azimuths."""
    turn = wind_frame(wind.from_deg)
    velocity = velocity_mps(wind)
    time_s, way = rays.time_s, 1.0
    if reverse:
        time_s, way = rays.reversed_time_s, -1.0
    centre = turn @ rays.centre_m.T - np.outer(velocity, time_s)
    beam = turn @ unit_vector(rays.azimuth_deg, rays.elevation_deg).T
    angle = np.radians(rays.azimuth_deg)
    arc = way * np.radians(rays.swept_azimuth_deg) * rays.range_m * np.cos(np.radians(rays.elevation_deg))
    across = np.stack([np.cos(angle), -np.sin(angle), np.zeros_like(angle)])
    moved = turn @ (across * arc) - np.outer(velocity, rays.duration_s)
    return Patches(
        centre, beam, moved if sweep else np.zeros_like(moved), np.asarray(rays.lidar, dtype=np.intp)
    )


def velocity_mps(wind: WindState) -> FloatArray:
    """(3,) velocity that carries the turbulence [m/s]: downwind, left, up."""
    return np.array([wind.speed_mps, 0.0, wind.vertical_mps])


def wind_frame(from_deg: float) -> FloatArray:
    """(3, 3) matrix that takes east, north, up to downwind, left of the wind, up.

    Examples
    --------
    >>> wind_frame(270.0).round(3) + 0.0
    array([[1., 0., 0.],
           [0., 1., 0.],
           [0., 0., 1.]])
    """
    angle = np.radians(from_deg)
    east, north = -np.sin(angle), -np.cos(angle)
    return np.array([[east, north, 0.0], [-north, east, 0.0], [0.0, 0.0, 1.0]])


class _Air(NamedTuple):
    """What every average over patches needs."""

    tensor: Correlation
    probes: tuple[Probe, ...]
    distant_m: float


def _within(air: _Air, passes: list[Patches]) -> FloatArray:
    """Correlations (pass, ray, ray) inside one scan: half of the pairs, mirrored, and the rays alone."""
    count = passes[0].centre_m.shape[1]
    every = Patches(*(np.concatenate(parts, axis=-1) for parts in zip(*passes, strict=True)))
    out = np.empty((len(passes), count, count))
    first, second = np.triu_indices(count, 1)
    if len(first):
        start = count * np.arange(len(passes))[:, None]
        pairs = every.take((first + start).ravel()), every.take((second + start).ravel())
        values = _pairs(air, *pairs, np.zeros((3, 1, 1))).reshape(len(passes), -1)
        out[:, first, second] = values
        out[:, second, first] = values
    diagonal = np.arange(count)
    out[:, diagonal, diagonal] = _selves(air, every).reshape(len(passes), count)
    return out


def _pairs(
    air: _Air, first: Patches, second: Patches, moved_m: FloatArray, *, to_point: bool = False
) -> FloatArray:
    """Correlations (lag, pair) of pairs of patches, the second of which has moved upwind by (3, lag, 1)
    metres.

    Near pairs get the fine quadrature, far ones two places for each offset, distant ones one place.
    """
    apart = (first.centre_m - second.centre_m)[:, None, :] + moved_m
    square = np.einsum("clp,clp->lp", apart, apart)
    near = square < (NEAR_SPREADS * _spread(air.probes, first, second, to_point)) ** 2
    distant = ~near & (square > air.distant_m**2)
    out = np.empty(near.shape)
    for mask, rule, places in (
        (near, _fine, _FINE_PLACES),
        (~(near | distant), _coarse, len(_CORNERS)),
        (distant, _single, 1),
    ):
        lag, pair = np.nonzero(mask)
        step = max(1, CHUNK_PLACES // places)
        for start in range(0, len(pair), step):
            part = slice(start, start + step)
            one, two = first.take(pair[part]), second.take(pair[part])
            distance = apart[:, lag[part], pair[part]]
            out[lag[part], pair[part]] = rule(air, one, two, distance, to_point)
    return out


def _single(air: _Air, first: Patches, second: Patches, apart_m: FloatArray, to_point: bool) -> FloatArray:
    """Correlation of the middles of two patches."""
    del to_point  # a point has no other middle
    return air.tensor(apart_m, first.beam, second.beam)


def _spread(probes: Sequence[Probe], first: Patches, second: Patches, to_point: bool) -> FloatArray:
    """(pair,) standard deviation of the offset between two places, one in each patch [m]."""
    std = np.array([probe.std_m for probe in probes])
    square = std[first.lidar] ** 2 + np.sum(first.sweep_m**2, axis=0) / 12
    if not to_point:
        square = square + std[second.lidar] ** 2 + np.sum(second.sweep_m**2, axis=0) / 12
    return np.asarray(np.sqrt(square))


def _coarse(air: _Air, first: Patches, second: Patches, apart_m: FloatArray, to_point: bool) -> FloatArray:
    """Average over two patches that are far from each other: right to the third degree in the offsets."""
    std = np.array([probe.std_m for probe in air.probes])
    corners = _CORNERS.T[:, :, None]
    shift = (
        corners[0] * (first.beam * std[first.lidar])[:, None]
        + corners[1] * (first.sweep_m * _UNIT_STD)[:, None]
    )
    if to_point:
        shift, corners = shift[:, ::2], corners[:, ::2]
    else:
        shift = shift - corners[2] * (second.beam * std[second.lidar])[:, None]
        shift -= corners[3] * (second.sweep_m * _UNIT_STD)[:, None]
    values = air.tensor(apart_m[:, None] + shift, first.beam[:, None], second.beam[:, None])
    return np.asarray(np.mean(values, axis=0))


def _fine(air: _Air, first: Patches, second: Patches, apart_m: FloatArray, to_point: bool) -> FloatArray:
    """Average over two patches that are near each other or overlap, by unequal Gauss rules."""
    one, weight_one = _places(air.probes, first, FIRST_NODES)
    if to_point:
        values = air.tensor(apart_m[:, None] + one, first.beam[:, None], second.beam[:, None])
        return np.asarray(np.einsum("ap,ap->p", weight_one, values))
    two, weight_two = _places(air.probes, second, SECOND_NODES)
    places = apart_m[:, None, None] + one[:, :, None] - two[:, None]
    values = air.tensor(places, first.beam[:, None, None], second.beam[:, None, None])
    return np.asarray(np.einsum("ap,bp,abp->p", weight_one, weight_two, values))


def _places(
    probes: Sequence[Probe], patches: Patches, counts: tuple[int, int]
) -> tuple[FloatArray, FloatArray]:
    """Offsets (3, node, ray) and weights (node, ray) of a Gauss rule over each patch."""
    rules = [probe.nodes(counts[0]) for probe in probes]
    offset = np.stack([rule[0] for rule in rules])[patches.lidar].T
    weight = np.stack([rule[1] for rule in rules])[patches.lidar].T
    turn, share = _legendre(counts[1])
    along = np.repeat(offset, counts[1], axis=0)
    across = np.tile(0.5 * turn, counts[0])[:, None]
    places = along * patches.beam[:, None] + across * patches.sweep_m[:, None]
    return places, np.repeat(weight, counts[1], axis=0) * np.tile(0.5 * share, counts[0])[:, None]


def _selves(air: _Air, patches: Patches) -> FloatArray:
    """Share (ray,) that probe and sweep leave of the variance of a point."""
    rules = [_self_rule(probe) for probe in air.probes]
    offset = np.stack([rule[0] for rule in rules])[patches.lidar].T
    weight = np.stack([rule[1] for rule in rules])[patches.lidar].T
    turn, share = rules[0][2], rules[0][3]
    places = offset[:, None] * patches.beam[:, None, None] + turn[:, None] * patches.sweep_m[:, None, None]
    values = air.tensor(places, patches.beam[:, None, None], patches.beam[:, None, None])
    return np.asarray(np.einsum("ap,b,abp->p", weight, share, values))


@lru_cache(maxsize=64)
def _self_rule(probe: Probe) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Offsets along the beam and shares of the sweep between two places of one patch, with their weights.

    The offset of two independent places has the autocorrelation of the weighting; of two times in the sweep,
    a triangle. The correlation falls like r^(2/3) at first, so the nodes crowd near 0 (cubed Gauss nodes).
    Positive offsets stand for both signs, since turning both signs changes nothing.
    """
    reach = probe.window_m + 6 * np.sqrt(2) * probe.pulse_std_m
    fine = np.linspace(-reach, reach, 4001)
    weight = probe.weight(fine)
    overlap = np.convolve(weight, weight, mode="same") * (fine[1] - fine[0])
    along, along_weight = _graded(SELF_NODES[0])
    density = np.interp(reach * along, fine, overlap)
    along_weight = along_weight * density / np.sum(along_weight * density)
    across, across_weight = _graded(SELF_NODES[1])
    triangle = across_weight * (1 - across)
    return (
        reach * along,
        along_weight,
        np.concatenate([-across[::-1], across]),
        np.concatenate([triangle[::-1], triangle]),
    )


@lru_cache(maxsize=16)
def _legendre(count: int) -> tuple[FloatArray, FloatArray]:
    return np.polynomial.legendre.leggauss(count)


def _graded(count: int) -> tuple[FloatArray, FloatArray]:
    """Nodes and weights on 0 to 1 that crowd near 0: the cubes of Gauss-Legendre nodes."""
    node, weight = np.polynomial.legendre.leggauss(count)
    half = 0.5 * (node + 1)
    return half**3, 1.5 * weight * half**2
