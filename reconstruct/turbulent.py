"""The error of one scan in turbulent air: each ray samples another eddy at another moment.

The turbulent tier is the linear one with the covariance of the rays' turbulence added, through the same
matrix of the same fit: P = G (C_sources + C_turbulence) Gᵀ. At intensity 0 the two tiers are one.
"""

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache

import numpy as np

from geometry.arrays import ArrayLike, FloatArray
from reconstruct.clocks import clock_std_s, early_and_late
from reconstruct.covariance import lag_covariance, point_covariance
from reconstruct.joint import expand
from reconstruct.prediction import TEN_MINUTE_FIELDS, ScanPrediction, scan_prediction
from reconstruct.ray_fit import ray_fit
from reconstruct.rays import Rays
from reconstruct.spectra import Turbulence
from reconstruct.ten_minute import Reference, TenMinute
from reconstruct.thinning import thinned
from reconstruct.uncertainty import ErrorSources, mean_errors_mps, wind_covariance_by_source
from reconstruct.wind import WindState

ONE_SCAN = "of one scan: the ten-minute mean is predicted by predict_ten_minute"


def turbulence_covariance(
    rays: Rays,
    wind: WindState,
    turbulence: Turbulence,
    *,
    gains: FloatArray | None = None,
    sweep: bool = True,
) -> FloatArray:
    """Covariance of the wind that one scan retrieves, from turbulence alone.

    Parameters
    ----------
    rays, wind, turbulence, sweep
        See `covariance.lag_covariance`.
    gains
        (..., 2, ray) matrices of fits that use some or all of the rays; without it the fit of all.

    Returns
    -------
    numpy.ndarray
        (..., 2, 2) of (u, v) east and north [m²/s²]: P = G C Gᵀ, the mean of both directions of a
        back-and-forth scan.

    Examples
    --------
    >>> from geometry.gates import Probe
    >>> scan = Rays(azimuth_deg=np.array([-15.0, 0.0, 15.0]), elevation_deg=np.zeros(3), range_m=np.full(3,
    ...     1000.0),
    ...     head_m=np.tile([0.0, -1000.0, 0.0], (3, 1)), lidar=np.zeros(3, dtype=int), time_s=np.array([0.5,
    ...     1.5, 2.5]),
    ...     duration_s=np.ones(3), swept_azimuth_deg=np.zeros(3), probes=(Probe(pulse_ns=200,
    ...     window_ns=256),),
    ...     period_s=4.0)
    >>> turbulence_covariance(scan, WindState(10.0, 0.0), Turbulence(0.1, 170.0)).round(1) + 0.0
    array([[6.3, 0. ],
           [0. , 0.3]])
    """
    matrix = ray_fit(rays).gain if gains is None else gains
    rays, matrix = thinned(rays, matrix)
    within = np.mean(lag_covariance(rays, wind, turbulence, sweep=sweep)[:, 0], axis=0)
    return np.asarray(matrix @ within @ np.swapaxes(matrix, -1, -2))


def predict_turbulent(
    rays: Rays,
    wind: WindState,
    turbulence: Turbulence,
    sources: ErrorSources | Sequence[ErrorSources] | None = None,
    *,
    weights: ArrayLike | None = None,
    reference: Reference = "scalar",
    sweep: bool = True,
) -> ScanPrediction:
    """Error of one scan from turbulence and from every source of the linear tier.

    Parameters
    ----------
    rays, wind, turbulence
        The scan and the air.
    sources
        Errors of the lidars; none without. A clock difference acts here, as eddies pass two beams at
        different times.
    weights
        (ray,) as the retrieval will use them.
    reference
        "scalar": bias against the mean speed at the target, a cup's; "vector": against the speed of the mean
        vector.
    sweep
        Average over the head's turn and the air's way during each ray.

    Returns
    -------
    ScanPrediction
        Bias and spread of speed and direction, integrated over the Gaussian of the vector; None, with the
        reason, for the ten-minute fields (see `with_ten_minute`) and where the rays cannot tell the
        components apart.

    Examples
    --------
    >>> from geometry.gates import Probe
    >>> azimuth = np.arange(-29.0, 30.0, 2.0)
    >>> scan = Rays(azimuth_deg=azimuth, elevation_deg=np.zeros(30), range_m=np.full(30, 1000.0),
    ...     head_m=np.tile([0.0, -1000.0, 0.0], (30, 1)), lidar=np.zeros(30, dtype=int),
    ...     time_s=0.4 * np.arange(30) + 0.2,
    ...     duration_s=np.full(30, 0.4), swept_azimuth_deg=np.full(30, 2.0), probes=(Probe(pulse_ns=200,
    ...     window_ns=256),),
    ...     period_s=12.0)
    >>> still = predict_turbulent(scan, WindState(8.0, 180.0), Turbulence(0.0, 170.0),
    ...     ErrorSources(radial_speed_mps=0.1))
    >>> windy = predict_turbulent(scan, WindState(8.0, 180.0), Turbulence(0.09, 170.0),
    ...     ErrorSources(radial_speed_mps=0.1))
    >>> round(still.speed_std_mps, 3), round(windy.speed_std_mps, 2)
    (0.019, 0.31)
    """
    gains, condition = ray_fit(rays, weights)
    lidars = wind_covariance_by_source(gains, rays, wind, sources) if sources is not None else {}
    clocks = [rays] if len(rays.probes) == 1 else early_and_late(rays, clock_std_s(rays, sources))
    each = [turbulence_covariance(late, wind, turbulence, gains=gains, sweep=sweep) for late in clocks]
    whole = scan_prediction(
        "turbulent",
        wind,
        covariance_m2s2=sum(lidars.values(), np.mean(each, axis=0)),
        mean_error_mps=np.sum(list(mean_errors_mps(gains, rays, wind).values()), axis=0),
        condition=float(condition),
        reasons=dict.fromkeys(TEN_MINUTE_FIELDS, ONE_SCAN),
    )
    if reference == "vector" or whole.speed_bias_mps is None:
        return whole
    excess_mps = _scalar_excess_mps(wind.speed_mps, turbulence)
    return replace(whole, speed_bias_mps=whole.speed_bias_mps - excess_mps)


def scalar_excess_mps(wind: WindState, turbulence: Turbulence) -> float:
    """What the mean of the speeds at a point exceeds the speed of the mean vector by [m/s], about sigma_v²/(2
    V).

    Examples
    --------
    >>> round(scalar_excess_mps(WindState(8.0, 0.0), Turbulence(0.09, 170.0)), 3)
    0.032
    """
    return _scalar_excess_mps(wind.speed_mps, turbulence)


@lru_cache(maxsize=1024)
def _scalar_excess_mps(speed_mps: float, turbulence: Turbulence) -> float:
    """Kept, since all directions and sector sizes share it."""
    variance = point_covariance(WindState(speed_mps, 0.0), turbulence, 0.0)[0]
    speed = expand(np.array([speed_mps, 0.0]), np.diag(variance))
    return float(speed.mean_mps) - speed_mps


def with_ten_minute(prediction: ScanPrediction, mean: TenMinute) -> ScanPrediction:
    """Fill the ten-minute fields of a prediction from the moments of the same scan (without a size axis)."""
    bias, speed_std, direction_std = (
        float(value) if np.isfinite(value) else None
        for value in (mean.speed_bias_mps, mean.speed_std_mps, mean.direction_std_deg)
    )
    reasons = {name: why for name, why in prediction.reasons.items() if name not in TEN_MINUTE_FIELDS}
    lost = prediction.reasons.get("direction_std_deg", "")
    for name, value in zip(TEN_MINUTE_FIELDS, (bias, speed_std, direction_std), strict=True):
        if value is None:
            reasons[name] = lost
    return replace(
        prediction,
        mean10_speed_bias_mps=bias,
        mean10_speed_std_mps=speed_std,
        mean10_direction_std_deg=direction_std,
        reasons=reasons,
    )
