"""Which part of the errors of a scan is drawn anew in every scan, and which stays for the whole campaign.

A mean over ten minutes averages the first and keeps the second. Noise and jitter are new in every ray; what
the rays of one lidar share (heading, levelling, position, calibration, the correlated part of everything
else) stays.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from geometry.arrays import FloatArray
from reconstruct.rays import Rays
from reconstruct.uncertainty import ErrorSources, ray_errors
from reconstruct.wind import WindState


class SplitCovariance(NamedTuple):
    """Covariance of the errors of the radial speeds [m²/s²], in two parts."""

    random_m2s2: FloatArray  # (ray,) variance: new in every ray of every scan
    persistent_m2s2: FloatArray  # (ray, ray) the same in every scan

    @property
    def total_m2s2(self) -> FloatArray:
        """(ray, ray) of one scan among many campaigns."""
        return np.diag(self.random_m2s2) + self.persistent_m2s2


def split_covariance(
    rays: Rays, wind: WindState, sources: ErrorSources | Sequence[ErrorSources]
) -> SplitCovariance:
    """Covariance of the errors of the radial speeds, split by how long they last.

    Parameters
    ----------
    rays
        Rays of one scan.
    wind
        Mean wind, to which the errors of pointing and calibration are proportional.
    sources
        Standard deviations, one for all lidars or one for each.

    Returns
    -------
    SplitCovariance
        Its sum is `uncertainty.ray_covariance`.

    Notes
    -----
    With response s and correlation ρ of a source: (1 - ρ) diag(s²) is random, ρ s sᵀ between rays of one
    lidar persists.

    Examples
    --------
    >>> from geometry.gates import Probe
    >>> rays = Rays(azimuth_deg=np.array([0.0, 90.0]), elevation_deg=np.zeros(2), range_m=np.full(2, 500.0),
    ...     head_m=np.tile([0.0, -500.0, 0.0], (2, 1)), lidar=np.zeros(2, int), time_s=np.zeros(2),
    ...     duration_s=np.ones(2),
    ...     swept_azimuth_deg=np.zeros(2), probes=(Probe(pulse_ns=200, window_ns=256),), period_s=1.0)
    >>> sources = ErrorSources(radial_speed_mps=0.1, heading_deg=0.1)
    >>> parts = split_covariance(rays, WindState(10.0, 270.0), sources)
    >>> parts.random_m2s2.round(4), parts.persistent_m2s2.round(4) + 0.0
    (array([0.01, 0.01]), array([[0.0003, 0.    ],
           [0.    , 0.    ]]))
    """
    together = rays.lidar[:, None] == rays.lidar
    persistent = np.zeros((rays.count, rays.count))
    for error in ray_errors(rays, wind, sources):
        shared = error.response_mps * np.sqrt(error.correlation)
        persistent += together * np.outer(shared, shared)
    return SplitCovariance(random_variance(rays, wind, sources), persistent)


def random_variance(
    rays: Rays, wind: WindState, sources: ErrorSources | Sequence[ErrorSources]
) -> FloatArray:
    """Variance (ray,) of the errors that are new in every ray [m²/s²]; see `split_covariance`."""
    out = np.zeros(rays.count)
    for error in ray_errors(rays, wind, sources):
        out += error.response_mps**2 * (1 - error.correlation)
    return out
