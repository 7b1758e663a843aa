"""The error of a scan before it is measured: the noun that all tiers share, and the noise and linear
tiers.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from geometry.arrays import ArrayLike, FloatArray
from geometry.errors import InputError
from reconstruct.moments import WindMoments, wind_moments
from reconstruct.ray_fit import ray_fit
from reconstruct.rays import Rays
from reconstruct.uncertainty import ErrorSources, mean_errors_mps, wind_covariance_by_source
from reconstruct.wind import WindState

Tier = Literal["noise", "linear", "turbulent", "monte-carlo"]

NEEDS_TURBULENCE = "needs the turbulent or the Monte Carlo tier: this one has no eddies"
RANK_SHORT = "the rays cannot tell the components of the wind apart"
CALM = "a calm has no direction"
DROWNED = "the error drowns the wind: no direction is likelier than another"
BELOW_GROUND = "the power law has no wind at or below the ground, and a gate lies there"

TEN_MINUTE_FIELDS = ("mean10_speed_bias_mps", "mean10_speed_std_mps", "mean10_direction_std_deg")


@dataclass(frozen=True)
class ScanPrediction:
    """What one scan will measure, as one tier predicts it. A number that a tier cannot know is None, with its
    reason.
    """

    tier: Tier
    covariance_m2s2: FloatArray  # (2, 2) of the error of (u, v); NaN where the rank is short
    mean_error_mps: FloatArray  # (2,) retrieved - true
    condition: float  # of the rows; inf where the rank is short
    speed_bias_mps: float | None  # retrieved - true
    speed_std_mps: float | None
    direction_bias_deg: float | None
    direction_std_deg: float | None
    mean10_speed_bias_mps: float | None = None  # of ten-minute means
    mean10_speed_std_mps: float | None = None
    mean10_direction_std_deg: float | None = None
    reasons: Mapping[str, str] = field(default_factory=dict)  # name of each None field: why


def scan_prediction(
    tier: Tier,
    wind: WindState,
    *,
    covariance_m2s2: FloatArray,
    mean_error_mps: FloatArray,
    condition: float,
    reasons: Mapping[str, str] | None = None,
) -> ScanPrediction:
    """A prediction with the moments of speed and direction integrated from the error of the vector.

    Parameters
    ----------
    tier : {"noise", "linear", "turbulent", "monte-carlo"}
    wind : WindState
        The truth.
    covariance_m2s2 : numpy.ndarray
        (2, 2) of the error of (u, v) [m²/s²].
    mean_error_mps : numpy.ndarray
        (2,) [m/s].
    condition : float
        Of the rows of the fit.
    reasons : mapping, optional
        Why fields are None; ten-minute fields default to `NEEDS_TURBULENCE`.

    Returns
    -------
    ScanPrediction
        Without ten-minute fields: a tier that knows them uses `dataclasses.replace`.

    Examples
    --------
    >>> across = scan_prediction("noise", WindState(speed_mps=10.0, from_deg=0.0),
    ...     covariance_m2s2=np.diag([1.0, 0.01]),
    ...                          mean_error_mps=np.zeros(2), condition=10.0)
    >>> round(across.speed_bias_mps, 4), round(across.direction_std_deg, 2)
    (0.0496, 5.67)
    """
    moments = wind_moments(wind.uv_mps, covariance_m2s2, mean_error_mps=mean_error_mps)
    values = {name: float(value) for name, value in zip(WindMoments._fields, moments, strict=True)}
    known = bool(np.all(np.isfinite(covariance_m2s2)) and np.all(np.isfinite(mean_error_mps)))
    why = _why(wind, condition, known=known)
    lost = {name: why for name, value in values.items() if not np.isfinite(value)}
    return ScanPrediction(
        tier=tier,
        covariance_m2s2=covariance_m2s2,
        mean_error_mps=mean_error_mps,
        condition=condition,
        **{name: value if np.isfinite(value) else None for name, value in values.items()},
        reasons={**dict.fromkeys(TEN_MINUTE_FIELDS, NEEDS_TURBULENCE), **lost, **(reasons or {})},
    )


def predict_noise(
    rays: Rays, wind: WindState, noise_mps: ArrayLike, *, weights: ArrayLike | None = None
) -> ScanPrediction:
    """Error of one scan from white noise of the radial speeds alone: P = G diag(σ²) Gᵀ.

    For a sector of N rays at steps Δ, S = sin(NΔ)/(N sin Δ), this is σ/cos φ sqrt(2/(N(1 + S))) along the
    axis and σ/cos φ sqrt(2/(N(1 - S))) across; for two beams that cross at χ the sum of both variances is
    (σ1² + σ2²)/sin²χ.

    Parameters
    ----------
    rays : Rays
    wind : WindState
        Its speed and direction; shear, vertical wind and gradients are left to the other tiers.
    noise_mps : array_like
        Standard deviation of one radial speed [m/s], or (ray,) of each.
    weights : array_like, optional
        (ray,) as the retrieval will use them.

    Returns
    -------
    ScanPrediction

    Raises
    ------
    InputError
        If the noise is negative or not finite.

    Examples
    --------
    >>> from geometry.gates import Probe
    >>> rays = Rays(azimuth_deg=np.arange(-5.0, 6.0), elevation_deg=np.zeros(11), range_m=np.full(11, 1000.0),
    ...             head_m=np.tile([0.0, -1000.0, 0.0], (11, 1)), lidar=np.zeros(11, int),
    ...     time_s=np.arange(11.0),
    ...             duration_s=np.ones(11), swept_azimuth_deg=np.zeros(11), probes=(Probe(pulse_ns=200,
    ...     window_ns=256),),
    ...             period_s=12.0)
    >>> noise = predict_noise(rays, WindState(speed_mps=10.0, from_deg=0.0), 0.01)
    >>> np.sqrt(np.diag(noise.covariance_m2s2)).round(5), round(noise.condition, 3)
    (array([0.05468, 0.00302]), 18.107)
    """
    noise = np.broadcast_to(np.asarray(noise_mps, dtype=float), (rays.count,))
    if not np.all(np.isfinite(noise) & (noise >= 0)):
        raise InputError(
            f"the noise of the radial speed is {noise.tolist()} m/s: numbers from 0 up are needed"
        )
    fitted = ray_fit(rays, weights)
    spread = fitted.gain * noise
    return scan_prediction(
        "noise",
        wind,
        covariance_m2s2=spread @ spread.T,
        mean_error_mps=np.zeros(2),
        condition=float(fitted.condition),
    )


def predict_linear(
    rays: Rays,
    wind: WindState,
    sources: ErrorSources | Sequence[ErrorSources],
    *,
    weights: ArrayLike | None = None,
) -> ScanPrediction:
    """Error of one scan from every source, propagated to first order through the matrix of the actual fit.

    The covariance is P = G C Gᵀ with C of `ray_covariance` (JCGM 102:2011, 6.2.1.3); the mean error is
    what vertical wind, lateral gradient and shear put into a fit that knows none of them. A clock difference
    does nothing here: it acts through turbulence.

    Parameters
    ----------
    rays : Rays
    wind : WindState
    sources : ErrorSources or sequence of ErrorSources
        One for all lidars, or one for each.
    weights : array_like, optional
        (ray,) as the retrieval will use them.

    Returns
    -------
    ScanPrediction

    Examples
    --------
    >>> from geometry.gates import Probe
    >>> azimuth, rise = np.arange(60.0, 120.0), np.degrees(np.arcsin(0.1))
    >>> rays = Rays(azimuth_deg=azimuth, elevation_deg=np.full(60, rise), range_m=np.full(60, 1000.0),
    ...             head_m=np.tile([-995.0, 0.0, -100.0], (60, 1)), lidar=np.zeros(60, int),
    ...     time_s=np.arange(60.0),
    ...             duration_s=np.ones(60), swept_azimuth_deg=np.zeros(60), probes=(Probe(pulse_ns=200,
    ...     window_ns=256),),
    ...             period_s=60.0)
    >>> errors = ErrorSources(radial_speed_mps=0.1, azimuth_deg=0.1, elevation_deg=0.1, range_m=5.0)
    >>> linear = predict_linear(rays, WindState(speed_mps=10.0, from_deg=0.0, shear_exponent=0.2), errors)
    >>> round(linear.speed_std_mps, 4), round(linear.direction_std_deg, 4)
    (0.0451, 0.0792)
    """
    fit, conditioned = ray_fit(rays, weights)
    parts = wind_covariance_by_source(fit, rays, wind, sources)
    known = np.all(np.isfinite(fit))
    return scan_prediction(
        "linear",
        wind,
        covariance_m2s2=sum(parts.values(), np.full((2, 2), 0.0 if known else np.nan)),
        mean_error_mps=np.sum(list(mean_errors_mps(fit, rays, wind).values()), axis=0),
        condition=float(conditioned),
    )


def _why(wind: WindState, condition: float, *, known: bool) -> str:
    if not np.isfinite(condition):
        return RANK_SHORT
    if not known:
        return BELOW_GROUND
    return CALM if wind.speed_mps == 0 else DROWNED
