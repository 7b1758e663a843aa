"""Angles of a head that counts its turns and leans over its top, as the direction of the beam."""

import numpy as np

from geometry.arrays import ArrayLike, FloatArray


def folded(azimuth_deg: ArrayLike, elevation_deg: ArrayLike) -> tuple[FloatArray, FloatArray, list[str]]:
    """The same beams with azimuths in [0, 360) and elevations in [-90, 90].

    Parameters
    ----------
    azimuth_deg, elevation_deg : array_like
        (ray,) of the head: azimuth of any number of turns, elevation of any size [degrees].

    Returns
    -------
    azimuth_deg, elevation_deg : numpy.ndarray
        (ray,) a beam over the top looks the other way: azimuth + 180, 180 - elevation.
    notes : list of str
        What was turned.

    Examples
    --------
    >>> folded([730.0, 320.0], [5.0, 150.0])[:2]
    (array([ 10., 140.]), array([ 5., 30.]))
    """
    azimuth, elevation = np.asarray(azimuth_deg, dtype=float), np.asarray(elevation_deg, dtype=float)
    turned = np.mod(elevation + 90.0, 360.0) - 90.0  # [-90, 270)
    over = turned > 90.0
    wrapped = np.mod(azimuth + np.where(over, 180.0, 0.0), 360.0)
    wrapped = np.where(wrapped == 360.0, 0.0, wrapped)  # np.mod(-1e-17, 360) is 360
    notes = []
    if np.any((azimuth < 0) | (azimuth >= 360)):
        notes.append(
            f"{int(np.sum((azimuth < 0) | (azimuth >= 360)))} azimuths outside 0 to 360 taken modulo 360"
        )
    if np.any(over):
        notes.append(
            f"{int(np.sum(over))} rays over the top (elevation over 90) turned to azimuth + 180, 180 - "
            "elevation"
        )
    return wrapped, np.where(over, 180.0 - turned, turned), notes
