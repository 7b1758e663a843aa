"""What a turbulence model says about two rays at two times, and about a ray and the wind at the target.

Frozen turbulence moves with the mean wind U, so that air measured at place x and time t is the air of the
place x - U t. In that frame a ray covers a small patch: its probe along the beam, and across it the arc that
the head sweeps during the accumulation less the way the air went. The covariance of two rays is the
correlation of the model averaged over both patches. Frame of the work inside: x downwind, y left, z up,
origin at the target.
"""

import numpy as np

from geometry.arrays import ArrayLike, FloatArray
from geometry.beams import unit_vector
from reconstruct.correlation import correlation
from reconstruct.patches import DISTANT_LENGTHS, Air, Patches, pair_correlations, self_correlations
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
    air = Air(correlation(turbulence), rays.probes, DISTANT_LENGTHS[turbulence.model] * turbulence.length_m)
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
            values = pair_correlations(air, patches[odd].take(first), later, moved)
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
    air = Air(correlation(turbulence), rays.probes, DISTANT_LENGTHS[turbulence.model] * turbulence.length_m)
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
        out[odd, :, :, component] = pair_correlations(air, patches, point, moved, to_point=True)
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


def _within(air: Air, passes: list[Patches]) -> FloatArray:
    """Correlations (pass, ray, ray) inside one scan: half of the pairs, mirrored, and the rays alone."""
    count = passes[0].centre_m.shape[1]
    every = Patches(*(np.concatenate(parts, axis=-1) for parts in zip(*passes, strict=True)))
    out = np.empty((len(passes), count, count))
    first, second = np.triu_indices(count, 1)
    if len(first):
        start = count * np.arange(len(passes))[:, None]
        pairs = every.take((first + start).ravel()), every.take((second + start).ravel())
        values = pair_correlations(air, *pairs, np.zeros((3, 1, 1))).reshape(len(passes), -1)
        out[:, first, second] = values
        out[:, second, first] = values
    diagonal = np.arange(count)
    out[:, diagonal, diagonal] = self_correlations(air, every).reshape(len(passes), count)
    return out
