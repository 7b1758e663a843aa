"""Statistics of a mean over many scans, and of the mean wind at the target: sums over lags instead of over
pairs.

Everything here is in the frame x downwind, y left. Passes are the two directions of a back-and-forth scan.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from geometry.arrays import FloatArray, IntArray
from reconstruct.covariance import lag_covariances, point_covariance, target_covariances
from reconstruct.joint import Speed, expand, speed_covariance
from reconstruct.lags import Lags, pair_counts, select_lags
from reconstruct.periods import scans_in
from reconstruct.rays import Rays
from reconstruct.spectra import Turbulence
from reconstruct.wind import WindState

# Correlations beyond that many integral lengths are left out: 1e-5 of a variance that is averaged along the wind,
# 1e-2 for the long tails of Mann. The lateral correlation goes negative and comes back slowly: at 8 lengths the rest
# of its integral is still -1.2 %.
REACH_LENGTHS = {"von-karman": 16.0, "kaimal": 25.0, "mann": 30.0}
TARGET_TIMES = 81  # between scan and target: crowded around the middle of the scan
CROWDING = 4.0  # the middle third of them falls within 5 % of the reach
POINT_TIMES = 48  # between the target and itself: crowded towards 0


class Period(NamedTuple):
    """What is averaged, and for how long."""

    rays: Rays
    winds: Sequence[WindState]  # of one speed
    turbulence: Turbulence
    averaging_s: float
    scan_share: float
    sweep: bool

    @property
    def speed_mps(self) -> float:
        """Speed of all winds [m/s]."""
        return self.winds[0].speed_mps

    @property
    def scans(self) -> int:
        """Scans that fit into the averaging time."""
        return scans_in(self.rays.period_s, self.averaging_s)

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
        return pair_counts(np.arange(1), self.scans, self.passes)[:, 0] / self.scans

    @property
    def reach_s(self) -> float:
        """Time after which nothing is left of the turbulence that was there [s]."""
        length = REACH_LENGTHS[self.turbulence.model] * self.turbulence.length_m
        return length / max(self.speed_mps, 1e-9)

    @property
    def lags(self) -> Lags:
        """Lags between scans that are worked out, and for how many pairs of scans each of them stands."""
        rays = self.rays
        if self.turbulence.std_mps(self.speed_mps) == 0:
            return select_lags(1, self.scans, self.passes, near=0.0, finest=1.0)
        duration = float(np.ptp(rays.time_s))
        last = (self.reach_s + duration) / rays.period_s
        per_scan_m = self.speed_mps * rays.period_s
        near = float(np.linalg.norm(np.ptp(rays.centre_m, axis=0))) + self.speed_mps * duration
        finest = min(probe.std_m for probe in rays.probes)
        return select_lags(
            min(self.scans, int(last) + 2),
            self.scans,
            self.passes,
            near=near / per_scan_m,
            finest=finest / per_scan_m,
        )


class ScanMean(NamedTuple):
    """Mean of the scans of a period; (...) are the winds and the sector sizes."""

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
        (wind, size, 1, 2, ray) fits.
    vector_mps
        (wind, size, 2) expected vector.
    random, persistent
        (wind, size, 1, 2, 2) covariance of the vector from errors drawn anew in each scan, and from those that stay
        [m²/s²].
    """
    lags = period.lags
    within = lag_covariances(period.rays, period.winds, period.turbulence, lags.steps, sweep=period.sweep)
    between = through(matrix[..., None, :, :], within[:, None])  # (wind, size, pass, lag, 2, 2)
    lasting = np.broadcast_to(persistent, between[..., 0, :, :].shape)
    between += lasting[..., None, :, :]
    between[..., 0, :, :] += random
    lidar = expand(vector_mps[..., None, :], between[..., 0, :, :])
    values = _speeds_between(lidar, between, lags.steps)
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
    """Mean at the target, the same for all winds: 2/T times the integral of (1 - t/T) times the covariance at lag t."""
    node, weight = np.polynomial.legendre.leggauss(POINT_TIMES)
    half = 0.5 * (node + 1)
    end = min(period.averaging_s, period.reach_s)
    times, weights = end * half**3, 1.5 * end * weight * half**2
    weights = 2 / period.averaging_s * weights * (1 - times / period.averaging_s)
    covariance = point_covariance(period.winds[0], period.turbulence, np.append(times, 0.0))
    speed = expand(np.array([period.speed_mps, 0.0]), np.diag(covariance[-1]))
    values = speed_covariance(speed, speed, covariance[:-1, :, None] * np.eye(2))
    return PointMean(speed, speed.mean_mps, np.asarray(weights @ values), weights @ covariance[:-1])


def scan_with_target(period: Period, matrix: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Covariances (wind, size, pass, time, 2, 2) of a scan with the target, and weights (pass, time)."""
    times, weight = _times(period)
    seen = target_covariances(period.rays, period.winds, period.turbulence, times, sweep=period.sweep)
    return np.asarray(matrix[..., None, :, :] @ seen[:, None]), weight


def through(matrix: FloatArray, covariance: FloatArray) -> FloatArray:
    """G C Gᵀ over leading axes."""
    return np.asarray(matrix @ covariance @ np.swapaxes(matrix, -1, -2))


def _times(period: Period) -> tuple[FloatArray, FloatArray]:
    """Times (time,) of the target since the start of a scan, and how much each counts (pass, time)."""
    rays, averaging = period.rays, period.averaging_s
    middle = 0.5 * float(np.min(rays.time_s) + np.max(rays.time_s))
    reach = min(averaging, period.reach_s + rays.period_s + 0.5 * float(np.ptp(rays.time_s)))
    node = np.linspace(-1.0, 1.0, TARGET_TIMES)
    scale = reach / np.sinh(CROWDING)
    times = middle + scale * np.sinh(CROWDING * node)
    step = scale * CROWDING * np.cosh(CROWDING * node) * (node[1] - node[0])
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


def _mean_of_pairs(each: FloatArray, beyond: FloatArray, lags: Lags, period: Period) -> FloatArray:
    """Variance of a mean of scans from covariances (..., pass, lag) and, beyond the last lag, (..., pass).

    Of N scans n are valid, any as likely as any other: the mean has 1/n of the variance of one scan and 1 -
    1/n of the mean covariance of two different ones.
    """
    scans, valid = period.scans, period.valid_scans
    counts = lags.pairs
    alone = np.einsum("p,...p->...", counts[:, 0], each[..., 0]) / scans
    if scans == 1:
        return np.asarray(alone)
    total = scans * (scans - 1) / 2
    rest = total - np.sum(counts[:, 1:])
    pairs = np.einsum("pk,...pk->...", counts[:, 1:], each[..., 1:]) + rest * np.mean(beyond, axis=-1)
    return np.asarray(alone / valid + (1 - 1 / valid) * pairs / total)
