"""The fit that a set of rays will be put through: the core with these rays' own rows and columns."""

from geometry.arrays import ArrayLike, FloatArray
from reconstruct.rays import Rays
from reconstruct.retrieval import Fit, fit, rows


def ray_rows(rays: Rays) -> FloatArray:
    """Rows (ray, col) of the fit."""
    return rows(rays.azimuth_deg, rays.elevation_deg, columns=rays.columns)


def ray_fit(rays: Rays, weights: ArrayLike | None = None) -> Fit:
    """Gain of the horizontal wind (2, ray), and the condition of all rows.

    Where w is fitted too its row is left out: the errors of u and v are those of the whole fit.

    Examples
    --------
    >>> import numpy as np
    >>> from geometry.gates import Probe
    >>> beams = Rays(azimuth_deg=np.array([0.0, 90.0, 0.0]), elevation_deg=np.array([0.0, 0.0, 90.0]),
    ...     range_m=np.full(3, 1000.0), head_m=np.zeros((3, 3)), lidar=np.arange(3), time_s=np.zeros(3),
    ...     duration_s=np.ones(3), swept_azimuth_deg=np.zeros(3), probes=(Probe(200, 256),) * 3, period_s=1.0, columns=3)
    >>> ray_fit(beams).gain.round(3) + 0.0
    array([[0., 1., 0.],
           [1., 0., 0.]])
    """
    whole = fit(ray_rows(rays), weights)
    return Fit(whole.gain[..., :2, :], whole.condition)
