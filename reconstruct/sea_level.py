"""Level a lidar over water: low scans meet the sea, and the range at which they do tells pitch and roll."""

from typing import NamedTuple

import numpy as np

from geometry.arrays import ArrayLike, FloatArray
from geometry.beams import unit_vector
from geometry.earth import EARTH_RADIUS_M, REFRACTION_COEFFICIENT
from geometry.errors import InputError
from geometry.head import Mounting

#: Radius of the Earth as a beam sees it that the air bends down [m].
SEEN_RADIUS_M = EARTH_RADIUS_M / (1.0 - REFRACTION_COEFFICIENT)


class Level(NamedTuple):
    """How a lidar is tilted, and how high it stands; standard deviations (k = 1)."""

    pitch_deg: float  # nose up
    roll_deg: float  # right side down
    elevation_offset_deg: float
    height_m: float  # of the head above the sea
    pitch_std_deg: float
    roll_std_deg: float
    elevation_offset_std_deg: float  # 0 where it was given
    height_std_m: float
    residual_std_m: float  # of the ranges
    rays: int


def sea_range_m(
    azimuth_head_deg: ArrayLike,
    elevation_head_deg: ArrayLike,
    *,
    height_m: float,
    mounting: Mounting,
    radius_m: float = np.inf,
) -> FloatArray:
    r"""Range at which beams of a tilted lidar meet the sea.

    Parameters
    ----------
    azimuth_head_deg, elevation_head_deg : array_like, broadcast together
        Head angles [deg].
    height_m : float
        Height of the head above the sea [m].
    mounting : Mounting
        Pitch (nose up), roll (right side down) and offsets.
    radius_m : float
        Of the Earth [m]; infinite for a flat sea, as published.

    Returns
    -------
    FloatArray
        Range [m]; NaN where a beam passes over the horizon.

    Notes
    -----
    Rott et al. (2022), Wind Energ. Sci. 7, 283, doi:10.5194/wes-7-283-2022, have with pitch p and roll ρ of
    the other sign :math:`r = h / [\cos\epsilon(\cos\gamma\sin p - \cos p\sin\rho\sin\gamma) - \cos p
    \cos\rho\sin\epsilon]`: the height over the downward part :math:`s` of the turned beam. On a sphere
    :math:`h + r^2(1 - s^2)/2R = r s`, whose nearer root is taken.

    Examples
    --------
    >>> sea_range_m([0.0, 90.0, 180.0], -3.0, height_m=25.0, mounting=Mounting(pitch_deg=-0.1)).round(2)
    array([462.29, 477.68, 494.14])
    """
    azimuth = np.asarray(azimuth_head_deg, dtype=np.float64) + mounting.azimuth_offset_deg
    elevation = np.asarray(elevation_head_deg, dtype=np.float64) + mounting.elevation_offset_deg
    down = -(unit_vector(azimuth, elevation) @ mounting.rotation.T)[..., 2]
    bent = (1.0 - down**2) / (2.0 * radius_m)
    under_root = down**2 - 4.0 * bent * height_m
    with np.errstate(invalid="ignore", divide="ignore"):
        met = 2.0 * height_m / (down + np.sqrt(under_root))
    return np.asarray(np.where((down > 0.0) & (under_root >= 0.0), met, np.nan))


def level_from_sea(
    azimuth_head_deg: ArrayLike,
    elevation_head_deg: ArrayLike,
    range_m: ArrayLike,
    *,
    range_std_m: ArrayLike = 1.0,
    height_m: float,
    height_std_m: float = 0.0,
    solve_offset: bool = False,
    radius_m: float = SEEN_RADIUS_M,
) -> Level:
    """Solve for pitch and roll, and the elevation offset if asked, from where low beams meet the sea.

    Parameters
    ----------
    azimuth_head_deg, elevation_head_deg : array_like (ray,)
        Head angles [deg]; bearings of more than half a circle determine the tilt well.
    range_m, range_std_m : array_like (ray,)
        Measured range of the edge and its standard deviation [m] (`range_fit.edge_range`); NaN is left out.
    height_m, height_std_m : float
        Height of the head above the sea of the moment (tide) and its standard deviation [m]; with 0 it is
        taken as it is, else it is solved for with that weight.
    solve_offset : bool
        Solve for an elevation offset as well: it needs two elevations or a well-known height.
    radius_m : float
        Of the Earth as the beam sees it [m].

    Returns
    -------
    Level

    Raises
    ------
    InputError
        If there are too few ranges, or bearings or elevations that do not determine what is solved for.

    Examples
    --------
    >>> azimuth_deg = np.arange(0.0, 360.0, 10.0)
    >>> met_m = sea_range_m(azimuth_deg, -3.0, height_m=25.0, mounting=Mounting(pitch_deg=0.1, roll_deg=-0.05))
    >>> level = level_from_sea(azimuth_deg, np.full(36, -3.0), met_m, height_m=25.0, radius_m=np.inf)
    >>> round(level.pitch_deg, 4), round(level.roll_deg, 4)
    (0.1, -0.05)
    """
    from scipy.optimize import least_squares

    columns = np.broadcast_arrays(azimuth_head_deg, elevation_head_deg, range_m, range_std_m)
    azimuth, elevation, met, std = (np.asarray(each, dtype=np.float64) for each in columns)
    known = np.isfinite(met) & np.isfinite(std) & (std > 0)
    azimuth, elevation, met, std = (each[known] for each in (azimuth, elevation, met, std))
    count = 2 + int(solve_offset) + int(height_std_m > 0)
    if met.size < count + 1:
        raise InputError(
            f"{met.size} ranges to the sea came; needed: {count + 1} or more at different bearings"
        )

    def left(values: FloatArray) -> FloatArray:
        pitch, roll, offset, height = _unpacked(values, solve_offset, height_m, height_std_m > 0)
        mounting = Mounting(pitch_deg=pitch, roll_deg=roll, elevation_offset_deg=offset)
        expected = sea_range_m(azimuth, elevation, height_m=height, mounting=mounting, radius_m=radius_m)
        residual = np.where(np.isfinite(expected), (met - expected) / std, met / std)
        return np.append(residual, (height - height_m) / height_std_m) if height_std_m > 0 else residual

    start = np.array([0.0, 0.0, *([0.0] if solve_offset else []), *([height_m] if height_std_m > 0 else [])])
    robust = least_squares(left, start, loss="soft_l1", x_scale="jac")
    slopes = np.asarray(robust.jac, dtype=np.float64)
    norms = np.linalg.norm(slopes, axis=0)
    told = bool(np.all(np.isfinite(norms) & (norms > 0)))  # not by rays that pass over the horizon
    size = np.linalg.svd(slopes / norms, compute_uv=False) if told else np.zeros(1)
    if not size[-1] > 1e-3 * size[0]:
        raise InputError(
            "the ranges to the sea do not determine the tilt: measure at bearings around the lidar, and at two "
            "elevations where the elevation offset is asked for"
        )
    covariance = np.linalg.inv(slopes.T @ slopes)
    scale = max(1.0, float(np.median(np.abs(robust.fun)) / 0.6745) ** 2)  # ranges scatter more than they say
    std_of = iter(np.sqrt(np.diag(covariance) * scale).tolist())
    pitch, roll, offset, height = _unpacked(robust.x, solve_offset, height_m, height_std_m > 0)
    return Level(
        pitch_deg=pitch,
        roll_deg=roll,
        elevation_offset_deg=offset,
        height_m=height,
        pitch_std_deg=next(std_of),
        roll_std_deg=next(std_of),
        elevation_offset_std_deg=next(std_of) if solve_offset else 0.0,
        height_std_m=next(std_of) if height_std_m > 0 else 0.0,
        residual_std_m=float(np.std(robust.fun[: met.size] * std)),
        rays=int(met.size),
    )


def _unpacked(
    values: FloatArray, with_offset: bool, height_m: float, with_height: bool
) -> tuple[float, float, float, float]:
    """Pitch, roll, offset [deg] and height [m] of what is solved for."""
    rest = [float(value) for value in values]
    offset = rest[2] if with_offset else 0.0
    return rest[0], rest[1], offset, rest[-1] if with_height else height_m
