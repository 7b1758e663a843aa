"""What a turbulence model says about two rays at two times, and about a ray and the wind at the target.

Frozen turbulence moves with the mean wind U, so that air measured at place x and time t is the air of the
place x - U t. In that frame a ray covers a small patch: its probe along the beam, and across it the arc that
the head sweeps during the accumulation less the way the air went. The covariance of two rays is the
correlation of the model averaged over both patches. Frame of the work inside: x downwind, y left, z up,
origin at the target.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from geometry.arrays import ArrayLike, FloatArray, IntArray
from geometry.beams import unit_vector
from reconstruct.correlation import correlation
from reconstruct.footprints import Air, Patches
from reconstruct.own_patch import self_correlations
from reconstruct.patches import pair_correlations
from reconstruct.rays import Rays
from reconstruct.spectra import Turbulence
from reconstruct.wind import WindState


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
    return np.asarray(lag_covariances(rays, [wind], turbulence, lags, sweep=sweep)[0])


def lag_covariances(
    rays: Rays,
    winds: Sequence[WindState],
    turbulence: Turbulence,
    lags: ArrayLike = (0,),
    *,
    sweep: bool = True,
) -> FloatArray:
    """Work out `lag_covariance` for several winds at once: (wind, pass, lag, ray, ray) [m²/s²]."""
    air = Air.of(turbulence, rays.probes)
    steps = np.atleast_1d(np.asarray(lags, dtype=np.intp))
    each = _Passes.of(rays, winds, sweep=sweep)
    out = np.empty((len(winds), each.passes, len(steps), rays.count, rays.count))
    if np.any(steps == 0):
        out[:, :, steps == 0] = _within(air, each)[:, :, None]
    for parity in range(each.passes):
        where = np.flatnonzero((steps > 0) & (steps % each.passes == parity))
        if len(where):
            out[:, :, where] = _between(air, each, steps[where], rays.period_s)
    return np.asarray(_variances(winds, turbulence)[:, None, None, None, None] * out)


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
    return np.asarray(target_covariances(rays, [wind], turbulence, times_s, sweep=sweep)[0])


def target_covariances(
    rays: Rays,
    winds: Sequence[WindState],
    turbulence: Turbulence,
    times_s: ArrayLike,
    *,
    sweep: bool = True,
) -> FloatArray:
    """Work out `target_covariance` for several winds at once: (wind, pass, time, ray, 2) [m²/s²]."""
    air = Air.of(turbulence, rays.probes)
    moments = np.atleast_1d(np.asarray(times_s, dtype=float))
    each = _Passes.of(rays, winds, sweep=sweep)
    shape = (len(winds), each.passes, rays.count, 2)
    ray = np.repeat(np.arange(len(each.patches.lidar)), 2)
    along = np.tile(np.eye(3)[:, :2], len(ray) // 2)
    still = np.zeros_like(along)
    seen = each.patches.take(ray)
    moved = each.moved_m(moments, 2 * each.passes * rays.count)
    values = pair_correlations(air, seen, Patches(still, along, still, seen.lidar), moved, to_point=True)
    out = np.moveaxis(values.reshape(len(moments), *shape), 0, 2)
    return np.asarray(_variances(winds, turbulence)[:, None, None, None, None] * out)


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
    if reverse:
        rays = replace(
            rays, time_s=rays.reversed_time_s, swept_azimuth_deg=-rays.swept_azimuth_deg, back_and_forth=False
        )
    return _Passes.of(replace(rays, back_and_forth=False), [wind], sweep=sweep).patches


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


class _Passes(NamedTuple):
    """The patches of every ray in every different pass and wind."""

    patches: Patches  # all of (wind, pass, ray)
    velocity_mps: FloatArray  # (3, wind)
    passes: int

    @classmethod
    def of(cls, rays: Rays, winds: Sequence[WindState], *, sweep: bool) -> "_Passes":
        velocity = np.stack([velocity_mps(wind) for wind in winds], axis=-1)
        angle = np.radians(rays.azimuth_deg)
        arc = np.radians(rays.swept_azimuth_deg) * rays.range_m * np.cos(np.radians(rays.elevation_deg))
        beam = unit_vector(rays.azimuth_deg, rays.elevation_deg)
        across = np.stack([arc * np.cos(angle), -arc * np.sin(angle), np.zeros_like(arc)])
        seen = np.stack([(rays.head_m + rays.range_m[:, None] * beam).T, beam.T, across], axis=1)
        frames = np.stack([wind_frame(wind.from_deg) for wind in winds])
        turned = np.einsum("wij,jkr->ikwr", frames, seen)[:, :, :, None]  # (3, kind, wind, 1, ray)
        times, way = rays.time_s[None], np.ones((1, 1))
        if rays.back_and_forth:
            times, way = np.stack([rays.time_s, rays.reversed_time_s]), np.array([[1.0], [-1.0]])
        carried = velocity[:, :, None, None]
        shape = (3, len(winds), len(times), rays.count)
        moved = way * turned[:, 2] - carried * rays.duration_s if sweep else np.zeros(shape)
        centre, beams = turned[:, 0] - carried * times, np.broadcast_to(turned[:, 1], shape)
        lidar = np.tile(np.asarray(rays.lidar, dtype=np.intp), len(winds) * len(times))
        patches = Patches(centre.reshape(3, -1), beams.reshape(3, -1), moved.reshape(3, -1), lidar)
        return cls(patches, velocity, len(times))

    @property
    def scans(self) -> int:
        """Number of winds times passes."""
        return self.passes * int(self.velocity_mps.shape[1])

    def moved_m(self, times_s: FloatArray, pairs: int) -> FloatArray:
        """How far the air goes: (3, time, wind times pairs), or (3, time, 1) where all winds are alike."""
        velocity = self.velocity_mps
        if np.all(velocity == velocity[:, :1]):
            velocity, pairs = velocity[:, :1], 1
        return np.repeat(velocity, pairs, axis=1)[:, None] * times_s[:, None]


def _variances(winds: Sequence[WindState], turbulence: Turbulence) -> FloatArray:
    """(wind,) of the downwind component [m²/s²]."""
    return np.array([turbulence.std_mps(wind.speed_mps) for wind in winds]) ** 2


def _within(air: Air, each: _Passes) -> FloatArray:
    """Correlations (wind, pass, ray, ray) inside one scan: half of the pairs, mirrored, and the rays alone."""
    count = len(each.patches.lidar) // each.scans
    out = np.empty((each.scans, count, count))
    first, second = np.triu_indices(count, 1)
    if len(first):
        start = count * np.arange(each.scans)[:, None]
        one, other = (each.patches.take((part + start).ravel()) for part in (first, second))
        values = pair_correlations(air, one, other, np.zeros((3, 1, 1))).reshape(each.scans, -1)
        out[:, first, second] = values
        out[:, second, first] = values
    diagonal = np.arange(count)
    out[:, diagonal, diagonal] = self_correlations(air, each.patches).reshape(each.scans, count)
    return out.reshape(-1, each.passes, count, count)


def _between(air: Air, each: _Passes, steps: IntArray, period_s: float) -> FloatArray:
    """Correlations (wind, pass, lag, ray, ray) of scans and later ones, all an even or all an odd number later."""
    count = len(each.patches.lidar) // each.scans
    place = np.arange(each.scans * count).reshape(-1, each.passes, count)
    later = place[:, (np.arange(each.passes) + steps[0]) % each.passes]
    shape = (*place.shape, count)
    first, second = np.broadcast_arrays(place[..., None], later[:, :, None])
    moved = each.moved_m(period_s * steps.astype(float), each.passes * count**2)
    patches = each.patches
    values = pair_correlations(air, patches.take(first.ravel()), patches.take(second.ravel()), moved)
    return np.moveaxis(values.reshape(len(steps), *shape), 0, 2)
