"""The core with the rows of dual and triple Doppler: several lidars, one place."""

import numpy as np

from geometry.arrays import ArrayLike
from geometry.errors import InputError
from reconstruct.retrieval import Retrieval, rows, solve


def dual_doppler_wind(
    azimuth_deg: ArrayLike,
    elevation_deg: ArrayLike,
    radial_speed_mps: ArrayLike,
    *,
    vertical_mps: ArrayLike = 0.0,
    weights: ArrayLike | None = None,
) -> Retrieval:
    """Horizontal wind where the beams of two or more lidars meet.

    With two lidars this is the closed form of Newsom et al. (2015, Wind Energy 18, 219-235), with cos φ
    counted once. With more it is their least-squares mean.

    Parameters
    ----------
    azimuth_deg, elevation_deg : array_like
        (lidar,) or (..., lidar) beams [degrees].
    radial_speed_mps : array_like
        (..., lidar) of rays at one time, positive away [m/s].
    vertical_mps : array_like
        (...,) assumed upward wind [m/s]; what is really there beyond it goes into u and v as w tan φ.
    weights : array_like, optional
        (..., lidar) 1 over the variance of each ray.

    Returns
    -------
    Retrieval

    Examples
    --------
    >>> dual_doppler_wind([0.0, 90.0], 0.0, [3.0, 4.0]).wind_mps.round(6) + 0.0
    array([4., 3.])
    """
    _, elevation = np.broadcast_arrays(
        np.asarray(azimuth_deg), np.radians(np.asarray(elevation_deg, dtype=float))
    )
    lifted = np.asarray(vertical_mps, dtype=float)[..., None] * np.sin(elevation)
    speed = np.asarray(radial_speed_mps, dtype=float) - lifted
    return solve(rows(azimuth_deg, elevation_deg), speed, weights=weights)


def triple_doppler_wind(
    azimuth_deg: ArrayLike,
    elevation_deg: ArrayLike,
    radial_speed_mps: ArrayLike,
    *,
    weights: ArrayLike | None = None,
) -> Retrieval:
    """Wind vector (u, v, w) where the beams of three or more lidars meet.

    Parameters
    ----------
    azimuth_deg, elevation_deg : array_like
        (lidar,) or (..., lidar) beams [degrees].
    radial_speed_mps : array_like
        (..., lidar) positive away [m/s].
    weights : array_like, optional
        (..., lidar) 1 over the variance of each ray.

    Returns
    -------
    Retrieval
        With three columns.

    Raises
    ------
    InputError
        If there are fewer than three beams.

    Examples
    --------
    >>> triple_doppler_wind([0.0, 90.0, 0.0], [0.0, 0.0, 90.0], [3.0, 4.0, 0.5]).wind_mps.round(6) + 0.0
    array([4. , 3. , 0.5])
    """
    matrix = rows(azimuth_deg, elevation_deg, columns=3)
    if matrix.shape[-2] < 3:
        raise InputError(
            f"three components need at least three beams, but {matrix.shape[-2]} came: use dual Doppler"
        )
    return solve(matrix, radial_speed_mps, weights=weights)
