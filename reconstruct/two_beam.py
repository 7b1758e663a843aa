"""The core with the rows of a two-beam lidar, as nacelle lidars have: wind relative to the lidar's own
axis.
"""

from typing import NamedTuple

import numpy as np

from geometry.arrays import ArrayLike, FloatArray
from geometry.errors import InputError
from reconstruct.retrieval import rows, solve


class TwoBeamWind(NamedTuple):
    """Wind of a two-beam lidar, of any shape (...,)."""

    along_mps: FloatArray  # toward the lidar, against the way it looks: positive for a wind that meets it
    across_mps: FloatArray  # from the left beam's side to the right one's, looking out from the lidar
    speed_mps: FloatArray
    angle_deg: FloatArray  # of the wind from the axis, positive where it comes from the left beam's side


def two_beam_wind(
    left_mps: ArrayLike, right_mps: ArrayLike, *, half_angle_deg: float, elevation_deg: float = 0.0
) -> TwoBeamWind:
    """Wind along and across the axis of a lidar with two beams, left and right of it.

    The rows of the core for azimuths -a (left) and +a (right) of the axis. In the words of the WindEye test
    (equations 1 to 4, radial speeds positive toward, V1 left, V2 right): U = (V1 - V2)/(2 sin a) is
    `across_mps`, W = (V1 + V2)/(2 cos a) is `along_mps`, V = sqrt(U² + W²) and φ = arctan(U/W), here atan2(U,
    W).

    Parameters
    ----------
    left_mps, right_mps : array_like
        (...,) radial speeds of the two beams, positive **away** from the lidar [m/s], as everywhere in this
        package: a reader turns the sign of a nacelle lidar's file.
    half_angle_deg : float
        Angle of each beam from the axis, in (0, 90) [degrees].
    elevation_deg : float
        Of both beams above the horizontal [degrees].

    Returns
    -------
    TwoBeamWind
        NaN where a beam is missing.

    Raises
    ------
    InputError
        If the half angle is not in (0, 90) degrees.

    Examples
    --------
    >>> wind = two_beam_wind(-10.0, -5.0, half_angle_deg=30.0)
    >>> round(float(wind.along_mps), 3), round(float(wind.across_mps), 3), round(float(wind.angle_deg), 2)
    (8.66, 5.0, 30.0)
    """
    if not 0 < half_angle_deg < 90:
        raise InputError(f"the half angle is {half_angle_deg} degrees: it has to lie between 0 and 90")
    speed = np.stack(np.broadcast_arrays(np.asarray(left_mps, float), np.asarray(right_mps, float)), axis=-1)
    fit = solve(rows([-half_angle_deg, half_angle_deg], elevation_deg), speed)
    across, ahead = (
        fit.wind_mps[..., 0],
        fit.wind_mps[..., 1],
    )  # the core's east is the right, its north the axis
    along = -ahead
    return TwoBeamWind(along, across, np.hypot(across, along), np.degrees(np.arctan2(across, along)))
