"""The horizontal wind as components (east, north) and as speed with the direction it comes from."""

from dataclasses import dataclass

import numpy as np

from geometry.arrays import ArrayLike, FloatArray
from geometry.errors import InputError


@dataclass(frozen=True)
class WindState:
    """One state of the mean wind around a target, constant in time.

    Raises
    ------
    InputError
        If a value is not finite, the speed is negative or the height is not above ground.

    Examples
    --------
    >>> WindState(speed_mps=10.0, from_deg=270.0).vector_mps.round(6) + 0.0
    array([10.,  0.,  0.])
    """

    speed_mps: float  # horizontal, at the target
    from_deg: float  # clockwise from true north
    shear_exponent: float = 0.0  # power law on height above ground
    height_m: float = 100.0  # of the target above ground, where speed_mps holds
    vertical_mps: float = 0.0  # upward
    lateral_gradient_per_s: float = 0.0  # growth of the speed per metre to the right, looking downwind

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not np.isfinite(value):
                raise InputError(f"WindState needs finite numbers, but {name} is {value}")
        if self.speed_mps < 0:
            raise InputError(
                f"the wind speed is {self.speed_mps} m/s: it cannot be negative, turn the direction"
            )
        if self.height_m <= 0:
            raise InputError(f"the target is {self.height_m} m above ground: it has to be above 0 m")

    @property
    def uv_mps(self) -> FloatArray:
        """(2,) eastward and northward wind at the target [m/s]."""
        return np.stack(uv_mps(self.speed_mps, self.from_deg))

    @property
    def vector_mps(self) -> FloatArray:
        """(3,) eastward, northward and upward wind at the target [m/s]."""
        return np.append(self.uv_mps, self.vertical_mps)


def uv_mps(speed_mps: ArrayLike, from_deg: ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Eastward and northward wind of a speed and the direction it comes from.

    Parameters
    ----------
    speed_mps : array_like
        Horizontal speed [m/s], any shape.
    from_deg : array_like
        Where the wind comes from [degrees clockwise from true north], broadcast with the speed.

    Returns
    -------
    u_mps, v_mps : numpy.ndarray
        Eastward and northward components [m/s]: u = -V sin(dir), v = -V cos(dir).

    Examples
    --------
    >>> u, v = uv_mps(10.0, 225.0)
    >>> round(float(u), 4), round(float(v), 4)
    (7.0711, 7.0711)
    """
    speed, angle = np.asarray(speed_mps, dtype=float), np.radians(np.asarray(from_deg, dtype=float))
    return np.asarray(-speed * np.sin(angle)), np.asarray(-speed * np.cos(angle))


def speed_mps(u_mps: ArrayLike, v_mps: ArrayLike) -> FloatArray:
    """Horizontal wind speed [m/s] of eastward and northward components [m/s].

    Examples
    --------
    >>> round(float(speed_mps(3.0, -4.0)), 3)
    5.0
    """
    return np.asarray(np.hypot(u_mps, v_mps))


def from_deg(u_mps: ArrayLike, v_mps: ArrayLike) -> FloatArray:
    """Where the wind blows from, clockwise from true north.

    Parameters
    ----------
    u_mps, v_mps : array_like
        Eastward and northward wind [m/s], any shape, broadcast together.

    Returns
    -------
    numpy.ndarray
        Direction [degrees] in [0, 360); NaN in a calm, which comes from nowhere.

    Examples
    --------
    >>> from_deg([0.0, 5.0, 0.0, 0.0], [-5.0, 0.0, 5.0, 0.0])
    array([  0., 270., 180.,  nan])
    """
    u, v = np.broadcast_arrays(np.asarray(u_mps, dtype=float), np.asarray(v_mps, dtype=float))
    turned = np.mod(np.degrees(np.arctan2(-u, -v)), 360.0)
    turned = np.where(turned == 360.0, 0.0, turned)  # np.mod(-1e-17, 360) is 360
    return np.where((u == 0) & (v == 0), np.nan, turned)


def scalar_mean(u_mps: ArrayLike, v_mps: ArrayLike, *, axis: int = -1) -> FloatArray:
    """Mean of the speeds along an axis [m/s], as a cup anemometer gives it; NaN values are left out.

    It exceeds the vector mean by about the lateral variance over twice the speed.

    Examples
    --------
    >>> round(float(scalar_mean([3.0, -3.0], [4.0, 4.0])), 3)
    5.0
    """
    return _mean(speed_mps(u_mps, v_mps), axis)


def vector_mean(u_mps: ArrayLike, v_mps: ArrayLike, *, axis: int = -1) -> tuple[FloatArray, FloatArray]:
    """Mean of each component along an axis [m/s]; samples with either component missing are left out of both.

    Examples
    --------
    >>> u, v = vector_mean([3.0, -3.0, np.nan], [4.0, 4.0, 9.0])
    >>> round(float(u), 3), round(float(v), 3)
    (0.0, 4.0)
    """
    u, v = np.broadcast_arrays(np.asarray(u_mps, dtype=float), np.asarray(v_mps, dtype=float))
    missing = np.isnan(u) | np.isnan(v)
    return _mean(np.where(missing, np.nan, u), axis), _mean(np.where(missing, np.nan, v), axis)


def _mean(values: FloatArray, axis: int) -> FloatArray:
    """Mean without NaN values; NaN where none is left (numpy's nanmean warns there)."""
    count = np.sum(~np.isnan(values), axis=axis)
    return np.asarray(np.nansum(values, axis=axis) / np.where(count > 0, count, np.nan))
