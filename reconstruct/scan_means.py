"""Statistics of a mean over many scans, and of the mean wind at the target: sums over lags instead of over
pairs.

Everything here is in the frame x downwind, y left. Passes are the two directions of a back-and-forth scan.
"""

from typing import NamedTuple

import numpy as np

from geometry.arrays import FloatArray, IntArray
from reconstruct.covariance import lag_covariance, point_covariance, target_covariance
from reconstruct.joint import Speed, expand, speed_covariance
from reconstruct.rays import Rays
from reconstruct.spectra import Turbulence
from reconstruct.wind import WindState

# Correlations beyond that many integral lengths are left out: 1e-3 of the variance, 1e-2 for the long tails
# of Mann.
REACH_LENGTHS = {"von-karman": 8.0, "kaimal": 25.0, "mann": 30.0}
TARGET_TIMES = 81  # between scan and target: crowded around the middle of the scan
POINT_TIMES = 48  # between the target and itself: crowded towards 0


class Period(NamedTuple):
    """What is averaged, and for how long."""

    rays: Rays
    wind: WindState
    turbulence: Turbulence
    averaging_s: float
    scan_share: float
    sweep: bool

    @property
    def scans(self) -> int:
        """Scans that fit into the averaging time."""
        return int(self.averaging_s / self.rays.period_s + 1e-9)

    @property
    def valid_scans(self) -> float:
        """Scans that take part, at least one."""
        return max(1.0, self.scan_share * self.scans)

    @property
    def passes(self) -> int:
        """Different scans: two when the sector is scanned back and forth."""
        return 2 if self.rays.back_and_forth else 1

    @property
    def pass_share(self) -> FloatArray:
        """(pass,) share of the scans that run each way."""
        return _pair_counts(np.arange(1), self.scans, self.passes)[:, 0] / self.scans

    @property
    def reach_s(self) -> float:
        """Time after which nothing is left of the turbulence that was there [s]."""
        length = REACH_LENGTHS[self.turbulence.model] * self.turbulence.length_m
        return length / max(self.wind.speed_mps, 1e-9)

    @property
    def lags(self) -> IntArray:
        """Lags between scans [number of scans] that are correlated."""
        if self.turbulence.std_mps(self.wind.speed_mps) == 0:
            return np.arange(1)
        last = (self.reach_s + float(np.ptp(self.rays.time_s))) / self.rays.period_s
        return np.arange(min(self.scans, int(last) + 2))


class ScanMean(NamedTuple):
    """Mean of the scans of a period; (...) are the sector sizes."""

    lidar: Speed  # (..., pass) of one scan
    mean_mps: FloatArray  # (...) of the scans' speeds
    variance_m2s2: FloatArray  # (...) of that mean
    vector_covariance_m2s2: FloatArray  # (..., 2, 2) of the mean vector


class PointMean(NamedTuple):
    """Mean of the wind at the target over a period."""

    speed: Speed  # at one moment
    mean_mps: FloatArray  # () of the speeds
    variance_m2s2: FloatArray  # () of that mean
    vector_variance_m2s2: FloatArray  # (2,) of the mean vector


def scan_mean(
    period: Period, matrix: FloatArray, vector_mps: FloatArray, random: FloatArray, persistent: FloatArray
) -> ScanMean:
    """Mean of the scans' speeds and vectors.

    Parameters
    ----------
    period
        What is averaged.
    matrix
        (..., 1, 2, ray) fits.
    vector_mps
        (..., 2) expected vector.
    random, persistent
        (..., 1, 2, 2) covariance of the vector from errors drawn anew in each scan, and from those that stay
        [m²/s²].
    """
    lags = period.lags
    within = lag_covariance(period.rays, period.wind, period.turbulence, lags, sweep=period.sweep)
    between = through(matrix[..., None, :, :], within)  # (..., pass, lag, 2, 2)
    lasting = np.broadcast_to(persistent, between[..., 0, :, :].shape)
    between += lasting[..., None, :, :]
    between[..., 0, :, :] += random
    lidar = expand(vector_mps[..., None, :], between[..., 0, :, :])
    values = _speeds_between(lidar, between, lags)
    beyond = speed_covariance(lidar, lidar, lasting)
    vectors = 0.5 * (between + np.swapaxes(between, -1, -2))
    covariance = _mean_of_pairs(
        np.moveaxis(vectors, (-2, -1), (0, 1)), np.moveaxis(lasting, (-2, -1), (0, 1)), lags, period
    )
    return ScanMean(
        lidar=lidar,
        mean_mps=np.einsum("p,...p->...", period.pass_share, lidar.mean_mps),
        variance_m2s2=_mean_of_pairs(values, beyond, lags, period),
        vector_covariance_m2s2=np.moveaxis(covariance, (0, 1), (-2, -1)),
    )


def point_mean(period: Period) -> PointMean:
    """Mean at the target: 2/T times the integral of (1 - t/T) times the covariance at lag t."""
    node, weight = np.polynomial.legendre.leggauss(POINT_TIMES)
    half = 0.5 * (node + 1)
    end = min(period.averaging_s, period.reach_s)
    times, weights = end * half**3, 1.5 * end * weight * half**2
    weights = 2 / period.averaging_s * weights * (1 - times / period.averaging_s)
    covariance = point_covariance(period.wind, period.turbulence, np.append(times, 0.0))
    speed = expand(np.array([period.wind.speed_mps, 0.0]), np.diag(covariance[-1]))
    values = speed_covariance(speed, speed, covariance[:-1, :, None] * np.eye(2))
    return PointMean(speed, speed.mean_mps, np.asarray(weights @ values), weights @ covariance[:-1])


def scan_with_target(period: Period, matrix: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Covariances (..., pass, time, 2, 2) of a scan with the target, and weights (pass, time)."""
    times, weight = _times(period)
    seen = target_covariance(period.rays, period.wind, period.turbulence, times, sweep=period.sweep)
    return np.asarray(matrix[..., None, :, :] @ seen), weight


def through(matrix: FloatArray, covariance: FloatArray) -> FloatArray:
    """G C Gᵀ over leading axes."""
    return np.asarray(matrix @ covariance @ np.swapaxes(matrix, -1, -2))


def _times(period: Period) -> tuple[FloatArray, FloatArray]:
    """Times (time,) of the target since the start of a scan, and how much each counts (pass, time)."""
    rays, averaging = period.rays, period.averaging_s
    middle = 0.5 * float(np.min(rays.time_s) + np.max(rays.time_s))
    reach = min(averaging, period.reach_s + rays.period_s)
    bend = 3.0  # the middle third of the times falls within 12 % of the reach
    node = np.linspace(-1.0, 1.0, TARGET_TIMES)
    times = middle + reach * np.sinh(bend * node) / np.sinh(bend)
    step = reach * bend * np.cosh(bend * node) / np.sinh(bend) * (node[1] - node[0])
    starts = rays.period_s * np.arange(period.scans)
    inside = np.abs(starts[:, None] + times - 0.5 * averaging) <= 0.5 * averaging
    passes = period.passes
    counts = np.stack([np.count_nonzero(inside[odd::passes], axis=0) for odd in range(passes)])
    return times, counts * step / (period.scans * averaging)


def _speeds_between(lidar: Speed, between: FloatArray, lags: IntArray) -> FloatArray:
    """Covariances (..., pass, lag) of the speeds of two scans."""
    passes = between.shape[-4]
    values = np.empty(between.shape[:-2])
    for parity in range(passes):
        part = lags % passes == parity
        first = lidar.at((..., slice(None), None))
        later = lidar.at((..., (np.arange(passes) + parity) % passes)).at((..., slice(None), None))
        values[..., part] = speed_covariance(first, later, between[..., part, :, :])
    values[..., 0] = lidar.variance_m2s2
    return values


def _pair_counts(lags: IntArray, scans: int, passes: int) -> FloatArray:
    """(pass, lag) how many pairs of scans start in that pass and are that far apart."""
    starts = np.clip(scans - lags, 0, None)
    return np.stack([(starts + passes - 1 - odd) // passes for odd in range(passes)]).astype(float)


def _mean_of_pairs(each: FloatArray, beyond: FloatArray, lags: IntArray, period: Period) -> FloatArray:
    """Variance of a mean of scans from covariances (..., pass, lag) and, beyond the last lag, (..., pass).

    Of N scans n are valid, any as likely as any other: the mean has 1/n of the variance of one scan and 1 -
    1/n of the mean covariance of two different ones.
    """
    scans, valid = period.scans, period.valid_scans
    counts = _pair_counts(lags, scans, each.shape[-2])
    alone = np.einsum("p,...p->...", counts[:, 0], each[..., 0]) / scans
    if scans == 1:
        return np.asarray(alone)
    total = scans * (scans - 1) / 2
    rest = total - np.sum(counts[:, 1:])
    pairs = np.einsum("pk,...pk->...", counts[:, 1:], each[..., 1:]) + rest * np.mean(beyond, axis=-1)
    return np.asarray(alone / valid + (1 - 1 / valid) * pairs / total)
