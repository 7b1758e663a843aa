"""Stand-ins for the many rays of a fine scan: neighbours that one eddy covers are averaged before they are
correlated.

The covariance of turbulence between rays grows with the square of their number, and tells nothing new where
rays lie much closer than an eddy is large. A run of neighbours becomes one ray that sweeps the arc of all of
them.
"""

from dataclasses import replace
from itertools import pairwise

import numpy as np

from geometry.arrays import FloatArray
from reconstruct.rays import Rays

MOST_RAYS = 200  # of one scan whose covariance is worked out ray by ray: a matrix of 40,000


def thinned(rays: Rays, matrix: FloatArray, *, most: int = MOST_RAYS) -> tuple[Rays, FloatArray]:
    """Stand-ins for the rays of a scan, and the fit that goes with them.

    Parameters
    ----------
    rays
        Rays of one scan.
    matrix
        (..., col, ray) fit.
    most
        About as many stand-ins are left, at least one for each lidar.

    Returns
    -------
    rays, matrix
        The same where there are no more than `most` rays. Otherwise each stand-in has the mean place and time
        of a run of rays of one lidar, their total turn and duration, and the sum of their columns of the fit.

    Examples
    --------
    >>> from geometry.gates import Probe
    >>> fine = Rays(azimuth_deg=np.arange(6.0), elevation_deg=np.zeros(6), range_m=np.full(6, 1000.0),
    ...     head_m=np.zeros((6, 3)), lidar=np.zeros(6, dtype=int), time_s=np.arange(6.0),
    ...     duration_s=np.ones(6),
    ...     swept_azimuth_deg=np.ones(6), probes=(Probe(pulse_ns=200, window_ns=256),), period_s=6.0)
    >>> few, fit = thinned(fine, np.ones((2, 6)), most=2)
    >>> few.azimuth_deg, few.swept_azimuth_deg, fit[0]
    (array([1., 4.]), array([3., 3.]), array([3., 3.]))
    """
    if rays.count <= most:
        return rays, matrix
    run = -(-rays.count // most)
    change = np.flatnonzero(np.diff(rays.lidar)) + 1
    bounds = np.concatenate([[0], change, [rays.count]])
    starts = np.concatenate([np.arange(a, b, run) for a, b in pairwise(bounds)])
    sizes = np.diff(np.append(starts, rays.count))

    def mean(values: FloatArray) -> FloatArray:
        return np.asarray(np.add.reduceat(values, starts) / sizes)

    few = replace(
        rays,
        azimuth_deg=mean(rays.azimuth_deg),
        elevation_deg=mean(rays.elevation_deg),
        range_m=mean(rays.range_m),
        head_m=rays.head_m[starts],
        lidar=rays.lidar[starts],
        time_s=mean(rays.time_s),
        duration_s=np.add.reduceat(rays.duration_s, starts),
        swept_azimuth_deg=np.add.reduceat(rays.swept_azimuth_deg, starts),
    )
    return few, np.add.reduceat(matrix, starts, axis=-1)
