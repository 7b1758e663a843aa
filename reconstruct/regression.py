"""The regression that a campaign would show: expected slope, coefficient of determination and scatter over a
climate.

A campaign plots ten-minute means of the mast against those of the lidar. What the fit will be follows from
the first two moments of both in every state of the wind; nothing is drawn.
"""

from typing import NamedTuple

import numpy as np

from geometry.arrays import ArrayLike, FloatArray
from geometry.errors import InputError
from reconstruct.climate import Climate
from reconstruct.ten_minute import TenMinute


class SpeedRegression(NamedTuple):
    """Regression mast = slope · lidar through the origin, of ten-minute means; (...) are the sizes."""

    slope: FloatArray
    r_squared: FloatArray  # 1 - residual variance over the variance of the mast
    r_squared_uncentred: (
        FloatArray  # 1 - mean squared residual over the mean square of the mast, as the study has it
    )
    residual_mean_mps: FloatArray  # of mast - slope · lidar
    residual_std_mps: FloatArray  # about its mean
    bias_mps: FloatArray  # lidar - mast, mean over the climate
    std_mps: FloatArray  # scatter of lidar - mast within a state, root mean square over the climate


class DirectionRegression(NamedTuple):
    """Regression mast = slope · lidar + intercept of ten-minute mean directions; (...) is the size axis."""

    slope: FloatArray
    intercept_deg: FloatArray
    bias_deg: FloatArray  # lidar - mast, mean over the climate
    residual_std_deg: FloatArray


def regress_speed(
    climate: Climate, means: list[TenMinute], *, lasting_m2s2: ArrayLike = 0.0
) -> SpeedRegression:
    """Fit mast = slope · lidar over a climate.

    Parameters
    ----------
    climate
        States and weights.
    means
        Ten-minute moments of each state, in the order of the climate.
    lasting_m2s2
        (...) What errors that stay for the campaign add to the variance of the residual [m²/s²]: see
        `reconstruct.campaign`.

    Returns
    -------
    SpeedRegression
        NaN where a state has none.

    Raises
    ------
    InputError
        If the number of moments is not that of the states.

    Notes
    -----
    a = E[mast · lidar] / E[lidar²] minimises E(mast - a · lidar)²; the expectations run over the states and,
    within each, over what turbulence and noise do: E[mast · lidar] = mean · mean + covariance.
    """
    _same_length(climate, means)
    lidar, mast = _stack(means, "lidar_mean_mps"), _stack(means, "reference_mean_mps")
    weight = climate.weight
    lidar_square = _mean(weight, lidar**2 + _stack(means, "lidar_variance_m2s2"))
    mast_square = _mean(weight, mast**2 + _stack(means, "reference_variance_m2s2"))
    product = _mean(weight, lidar * mast + _stack(means, "covariance_m2s2"))
    slope = product / lidar_square
    residual_square = mast_square - slope * product + np.asarray(lasting_m2s2)
    residual_mean = _mean(weight, mast) - slope * _mean(weight, lidar)
    mast_variance = mast_square - _mean(weight, mast) ** 2
    return SpeedRegression(
        slope=slope,
        r_squared=1 - residual_square / mast_variance,
        r_squared_uncentred=1 - residual_square / mast_square,
        residual_mean_mps=residual_mean,
        residual_std_mps=np.sqrt(np.clip(residual_square - residual_mean**2, 0.0, None)),
        bias_mps=_mean(weight, lidar - mast),
        std_mps=np.sqrt(_mean(weight, np.stack([mean.speed_std_mps for mean in means]) ** 2)),
    )


def regress_direction(
    climate: Climate, means: list[TenMinute], *, lasting_deg2: ArrayLike = 0.0
) -> DirectionRegression:
    """Fit mast = slope · lidar + intercept to directions over a climate.

    Parameters
    ----------
    climate
        States and weights; directions are unwrapped to within 180 degrees of their weighted circular mean.
    means
        Ten-minute moments of each state, in the order of the climate.
    lasting_deg2
        (...) What errors that stay add to the variance of the residual [deg²].

    Returns
    -------
    DirectionRegression
        Slope NaN where all states come from one direction without scatter.

    Raises
    ------
    InputError
        If the number of moments is not that of the states.
    """
    _same_length(climate, means)
    weight = climate.weight
    truth = unwrapped_deg(climate.from_deg, weight)
    truth = truth.reshape(-1, *(1,) * means[0].direction_bias_deg.ndim)
    bias = np.stack([mean.direction_bias_deg for mean in means])
    spread = np.stack([mean.direction_std_deg for mean in means]) ** 2  # of lidar - mast
    both = _stack(means, "direction_covariance_deg2")
    mast = np.array([mean.reference_direction_std_deg**2 for mean in means]).reshape(truth.shape)
    lidar_variance = spread - mast + 2 * both  # of the lidar's direction within a state
    lidar = truth + bias
    centre_lidar, centre_mast = _mean(weight, lidar), _mean(weight, truth)
    covariance = _mean(weight, (lidar - centre_lidar) * (truth - centre_mast) + both)
    variance = _mean(weight, (lidar - centre_lidar) ** 2 + lidar_variance)
    with np.errstate(invalid="ignore", divide="ignore"):
        slope = covariance / variance
    mast_variance = _mean(weight, (truth - centre_mast) ** 2 + mast)
    residual = mast_variance - slope * covariance + np.asarray(lasting_deg2)
    return DirectionRegression(
        slope=slope,
        intercept_deg=centre_mast - slope * centre_lidar,
        bias_deg=_mean(weight, bias),
        residual_std_deg=np.sqrt(np.clip(residual, 0.0, None)),
    )


def _same_length(climate: Climate, means: list[TenMinute]) -> None:
    if len(means) != climate.count:
        raise InputError(
            f"a climate of {climate.count} states needs as many ten-minute moments, but {len(means)} came"
        )


def _stack(means: list[TenMinute], name: str) -> FloatArray:
    return np.stack([np.asarray(getattr(mean, name)) for mean in means])


def _mean(weight: FloatArray, values: ArrayLike) -> FloatArray:
    """Mean over the first axis."""
    return np.asarray(np.tensordot(weight, np.asarray(values), axes=1))


def unwrapped_deg(from_deg: FloatArray, weight: FloatArray) -> FloatArray:
    """Directions without the jump at north, within 180 degrees of their circular mean [deg].

    Examples
    --------
    >>> unwrapped_deg(np.array([350.0, 10.0, 20.0]), np.ones(3)).round(6).tolist()
    [-10.0, 10.0, 20.0]
    """
    angle = np.radians(from_deg)
    centre = np.degrees(np.arctan2(np.sum(weight * np.sin(angle)), np.sum(weight * np.cos(angle))))
    return np.asarray(centre % 360 + (from_deg - centre + 180) % 360 - 180)
