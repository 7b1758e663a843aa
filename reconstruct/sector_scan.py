"""The core with the rows of a sector scan (VAD, iVAP): one lidar, many azimuths."""

from typing import Literal

from geometry.arrays import ArrayLike
from reconstruct.retrieval import Retrieval, rows, solve


def sector_wind(
    azimuth_deg: ArrayLike,
    elevation_deg: ArrayLike,
    radial_speed_mps: ArrayLike,
    *,
    columns: Literal[2, 3] = 2,
    weights: ArrayLike | None = None,
) -> Retrieval:
    """Wind of one or many sector scans.

    At zero elevation two columns are iVAP (Liang 2007, J. Atmos. Oceanic Technol. 24, 658-665,
    doi:10.1175/JTECH2047.1).

    Parameters
    ----------
    azimuth_deg, elevation_deg : array_like
        (ray,) of the scan that all share, or (..., ray) of each scan [degrees].
    radial_speed_mps : array_like
        (..., ray) positive away [m/s]; NaN where a ray is missing. For many gates put the ray axis last.
    columns : {2, 3}
        2: u and v; a vertical wind w goes into the component along the sector axis as about w tan φ. 3: u, v,
        w, for wide scans at a good elevation.
    weights : array_like, optional
        (..., ray) 1 over the variance of each ray.

    Returns
    -------
    Retrieval

    Examples
    --------
    >>> fit = sector_wind([75.0, 90.0, 105.0], 0.0, [8.6603, 7.0711, 5.0])
    >>> fit.wind_mps.round(3)
    array([7.071, 7.071])
    """
    return solve(rows(azimuth_deg, elevation_deg, columns=columns), radial_speed_mps, weights=weights)
