"""Where a beam points: azimuth, elevation and range to a point in the head's east-north-up frame, and back.

Every function takes any leading shape. Azimuth is clockwise from the frame's north, elevation above its
horizontal, range along the straight line. At a point exactly above or below the head (or at the head itself)
the azimuth is 0 by convention, since every azimuth points there.
"""

from typing import NamedTuple

import numpy as np

from geometry.arrays import ArrayLike, FloatArray, positions
from geometry.blocks import blocks

DEG_PER_RAD = 180.0 / np.pi


class Beam(NamedTuple):
    """Azimuth [deg] in [0, 360), elevation [deg] in [-90, 90] and slant range [m] of one or many beams."""

    azimuth_deg: FloatArray  # (...)
    elevation_deg: FloatArray  # (...)
    range_m: FloatArray  # (...)


def beam_to(enu_m: ArrayLike) -> Beam:
    r"""Point a beam at positions in the head's own frame.

    Parameters
    ----------
    enu_m
        Positions relative to the head: east, north, up [m], shape (..., 3).

    Returns
    -------
    Beam
        Azimuth in [0, 360) [deg], clockwise from north; elevation in [-90, 90] [deg], positive upward; slant
        range [m]; each of shape (...). Straight up and straight down the azimuth is 0; at the head itself all
        three are 0. NaN positions give NaN.

    Raises
    ------
    InputError
        If the last axis does not have length 3.

    Notes
    -----
    :math:`\theta = \mathrm{atan2}(e, n)`, :math:`\phi = \mathrm{atan2}(u, \sqrt{e^2+n^2})`,
    :math:`r = \sqrt{e^2+n^2+u^2}`: the inverse of `unit_vector`. Both angles by the two-argument arctangent,
    which keeps full precision near the vertical and near the horizontal, where arcsine and arccosine lose
    half the digits.

    Examples
    --------
    >>> beam = beam_to([[0.0, 1000.0, 0.0], [-300.0, 0.0, 400.0], [0.0, 0.0, 50.0]])
    >>> beam.azimuth_deg.tolist(), beam.elevation_deg.round(3).tolist(), beam.range_m.tolist()
    ([0.0, 270.0, 0.0], [0.0, 53.13, 90.0], [1000.0, 500.0, 50.0])
    """
    enu = positions(enu_m, "east, north, up")
    points = enu.reshape(-1, 3)
    solved = np.empty((3, points.shape[0]))
    for block in blocks(points.shape[0]):
        _solve_block(points[block], solved[:, block])
    azimuth, elevation, slant = solved.reshape(3, *enu.shape[:-1])
    return Beam(azimuth, elevation, slant)


def _solve_block(points: FloatArray, solved: FloatArray) -> None:
    """Fill azimuth, elevation and range (3, n) of points (n, 3), column by column in contiguous memory."""
    # adding +0.0 turns -0.0 into 0.0: atan2(0, -0.0) would be 180 degrees straight up
    east, north, up = np.add(points.T, 0.0, order="C")
    horizontal_squared = east * east + north * north
    azimuth, elevation, slant = solved
    np.arctan2(east, north, out=azimuth)
    azimuth *= DEG_PER_RAD
    azimuth += 360.0 * (azimuth < 0.0)
    azimuth[azimuth >= 360.0] = 0.0  # -1e-17 + 360 rounds to 360
    np.arctan2(up, np.sqrt(horizontal_squared), out=elevation)
    elevation *= DEG_PER_RAD
    np.sqrt(horizontal_squared + up * up, out=slant)


def unit_vector(azimuth_deg: ArrayLike, elevation_deg: ArrayLike) -> FloatArray:
    r"""Direction of a beam as a vector of length 1.

    Parameters
    ----------
    azimuth_deg
        Azimuth [deg], clockwise from north; any number of turns.
    elevation_deg
        Elevation [deg], positive upward; over 90 means over the top, as some heads report.
        The two shapes broadcast.

    Returns
    -------
    FloatArray
        East, north, up components, shape (..., 3); away from the lidar.

    Notes
    -----
    :math:`b = (\sin\theta\cos\phi, \cos\theta\cos\phi, \sin\phi)`.

    Examples
    --------
    >>> unit_vector([90.0, 0.0], [0.0, 30.0]).round(6) + 0.0
    array([[1.      , 0.      , 0.      ],
           [0.      , 0.866025, 0.5     ]])
    """
    azimuth, elevation = np.broadcast_arrays(
        np.deg2rad(np.asarray(azimuth_deg, dtype=np.float64)),
        np.deg2rad(np.asarray(elevation_deg, dtype=np.float64)),
    )
    vector = np.empty((*azimuth.shape, 3))
    level = np.cos(elevation)
    vector[..., 0] = np.sin(azimuth) * level
    vector[..., 1] = np.cos(azimuth) * level
    vector[..., 2] = np.sin(elevation)
    return vector


def point_at(azimuth_deg: ArrayLike, elevation_deg: ArrayLike, range_m: ArrayLike) -> FloatArray:
    """Position that a beam reaches at a range, in the head's own frame: the inverse of `beam_to`.

    Parameters
    ----------
    azimuth_deg, elevation_deg
        Direction of the beam [deg]; see `unit_vector`.
    range_m
        Slant range from the head [m]. The three shapes broadcast.

    Returns
    -------
    FloatArray
        East, north, up [m] relative to the head, shape (..., 3).

    Examples
    --------
    >>> point_at(90.0, 30.0, 1000.0).round(3) + 0.0
    array([866.025,   0.   , 500.   ])
    """
    slant = np.asarray(range_m, dtype=np.float64)
    return unit_vector(azimuth_deg, elevation_deg) * slant[..., np.newaxis]
