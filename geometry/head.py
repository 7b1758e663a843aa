"""How a scanner stands (heading, pitch, roll, offsets) and how fast its head turns."""

import math
from dataclasses import dataclass, fields
from typing import NamedTuple

import numpy as np

from geometry.arrays import ArrayLike, FloatArray
from geometry.beams import beam_to, unit_vector
from geometry.errors import InputError


@dataclass(frozen=True)
class Mounting:
    """How a scanner head stands: the rotation of its base and the zeros of its encoders.

    A direction in the lidar's own axes (right, front, up) becomes east, north, up by

        R = H(heading)·P(pitch)·Q(roll),

    heading about up (clockwise from above), then pitch about the lidar's right (nose up), then roll about
    its front (right side down). In the lidar's own axes the pointing angle is head angle + offset, for
    azimuth and elevation: the offset belongs to the encoder and so stands on the head's side of the
    rotation.

    Parameters
    ----------
    heading_deg : float
        Azimuth of the lidar's front, clockwise [deg].
    pitch_deg : float
        Rise of the front [deg], nose up positive, -90 to 90.
    roll_deg : float
        Fall of the right side [deg], right down positive, -180 to 180.
    azimuth_offset_deg, elevation_offset_deg : float
        Pointing angle minus head angle [deg].
    range_offset_m : float
        True range minus the range that the instrument states [m].

    Raises
    ------
    InputError
        If a number is not finite or a tilt is outside its limits.

    Notes
    -----
    Azimuths given to and by this class count from the lidar's zero direction (true north or grid north): a
    lidar that is zeroed to grid north takes the meridian convergence into its heading.

    Examples
    --------
    >>> sterenn = Mounting(azimuth_offset_deg=12.31, elevation_offset_deg=0.6)
    >>> azimuth_deg, elevation_deg = sterenn.to_head(192.0, 5.96)
    >>> round(float(azimuth_deg), 2), round(float(elevation_deg), 2)
    (179.69, 5.36)
    >>> azimuth_deg, elevation_deg = Mounting(pitch_deg=1.0).to_true(0.0, 0.0)
    >>> round(float(elevation_deg), 6)
    1.0
    """

    heading_deg: float = 0.0
    pitch_deg: float = 0.0
    roll_deg: float = 0.0
    azimuth_offset_deg: float = 0.0
    elevation_offset_deg: float = 0.0
    range_offset_m: float = 0.0

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if not math.isfinite(value):
                raise InputError(
                    f"{field.name} of the mounting is {value}: give a finite number, 0 where nothing is known"
                )
        for name, limit in (("pitch_deg", 90.0), ("roll_deg", 180.0)):
            if abs(getattr(self, name)) > limit:
                raise InputError(
                    f"{name} of the mounting is {getattr(self, name)}: give {-limit:g} to {limit:g} degrees"
                )

    @property
    def rotation(self) -> FloatArray:
        """(3, 3) matrix that turns (right, front, up) of the lidar into (east, north, up)."""
        heading, pitch, roll = np.deg2rad([self.heading_deg, self.pitch_deg, self.roll_deg])
        about_up = _turn(-heading, 0, 1)  # clockwise from above
        about_right = _turn(pitch, 1, 2)  # front towards up
        about_front = _turn(roll, 2, 0)  # up towards right: the right side goes down
        return np.asarray(about_up @ about_right @ about_front)

    def to_true(
        self, azimuth_head_deg: ArrayLike, elevation_head_deg: ArrayLike
    ) -> tuple[FloatArray, FloatArray]:
        """Turn head angles into pointing angles.

        Parameters
        ----------
        azimuth_head_deg, elevation_head_deg : array_like, broadcast together
            Encoder angles [deg]; the azimuth may hold several turns, the elevation may pass 90 (over the
            top).

        Returns
        -------
        azimuth_deg, elevation_deg : arrays
            Direction of the beam: azimuth clockwise from the lidar's zero direction in [0, 360), elevation
            above the horizontal in [-90, 90] [deg].
        """
        azimuth = np.asarray(azimuth_head_deg, dtype=np.float64) + self.azimuth_offset_deg
        elevation = np.asarray(elevation_head_deg, dtype=np.float64) + self.elevation_offset_deg
        beam = beam_to(unit_vector(azimuth, elevation) @ self.rotation.T)
        return beam.azimuth_deg, beam.elevation_deg

    def to_head(self, azimuth_deg: ArrayLike, elevation_deg: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Turn pointing angles into the head angles to set; the inverse of `to_true`.

        Parameters
        ----------
        azimuth_deg, elevation_deg : array_like, broadcast together
            Direction of the beam from the lidar's zero direction and the horizontal [deg].

        Returns
        -------
        azimuth_head_deg, elevation_head_deg : arrays
            Encoder angles [deg], azimuth in [0, 360), elevation in [-90, 90] less its offset.
        """
        beam = beam_to(unit_vector(azimuth_deg, elevation_deg) @ self.rotation)
        azimuth = np.mod(beam.azimuth_deg - self.azimuth_offset_deg, 360.0)
        return np.asarray(
            np.where(azimuth < 360.0, azimuth, 0.0)
        ), beam.elevation_deg - self.elevation_offset_deg

    def true_range_m(self, range_head_m: ArrayLike) -> FloatArray:
        """Slant range from the head [m] for a range that the instrument states."""
        return np.asarray(np.asarray(range_head_m, dtype=np.float64) + self.range_offset_m)

    def head_range_m(self, range_m: ArrayLike) -> FloatArray:
        """Range that the instrument states for a slant range from the head [m]; inverse of `true_range_m`."""
        return np.asarray(np.asarray(range_m, dtype=np.float64) - self.range_offset_m)


class Axis(NamedTuple):
    """Largest speed [deg/s] and acceleration [deg/s²] of one axis."""

    speed_deg_per_s: float
    acceleration_deg_per_s2: float


@dataclass(frozen=True)
class HeadLimits:
    """Largest speed and acceleration of a scanner head about its two axes.

    Parameters
    ----------
    azimuth_speed_deg_per_s, elevation_speed_deg_per_s : float
        Largest angular speed [deg/s], positive.
    azimuth_acceleration_deg_per_s2, elevation_acceleration_deg_per_s2 : float
        Largest angular acceleration [deg/s²], positive.

    Raises
    ------
    InputError
        If a number is not finite and positive.
    """

    azimuth_speed_deg_per_s: float
    elevation_speed_deg_per_s: float
    azimuth_acceleration_deg_per_s2: float
    elevation_acceleration_deg_per_s2: float

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if not (math.isfinite(value) and value > 0):
                raise InputError(f"{field.name} of the head is {value}: give a finite number greater than 0")

    @property
    def azimuth(self) -> Axis:
        """Limits of the azimuth axis."""
        return Axis(self.azimuth_speed_deg_per_s, self.azimuth_acceleration_deg_per_s2)

    @property
    def elevation(self) -> Axis:
        """Limits of the elevation axis."""
        return Axis(self.elevation_speed_deg_per_s, self.elevation_acceleration_deg_per_s2)


def turn_time_s(
    angle_deg: ArrayLike, *, speed_deg_per_s: float, acceleration_deg_per_s2: float
) -> FloatArray:
    """Shortest time to turn by an angle from rest to rest.

    Parameters
    ----------
    angle_deg : array_like, any shape
        Angle to turn [deg]; its sign does not matter, and more than 360 is more than one turn.
    speed_deg_per_s : float
        Largest speed V [deg/s], positive.
    acceleration_deg_per_s2 : float
        Largest acceleration and deceleration A [deg/s²], positive.

    Returns
    -------
    array, same shape
        2·sqrt(d/A) where d <= V²/A (top speed is never reached), else d/V + V/A [s].

    Raises
    ------
    InputError
        If a limit is not finite and positive.

    Examples
    --------
    >>> turn_time_s([10.0, 18.07, 54.37, 90.0], speed_deg_per_s=50, acceleration_deg_per_s2=100).round(4)
    array([0.6325, 0.8502, 1.5874, 2.3   ])
    """
    for name, value in (("speed", speed_deg_per_s), ("acceleration", acceleration_deg_per_s2)):
        if not (math.isfinite(value) and value > 0):
            raise InputError(f"{name} of the head is {value}: give a finite number greater than 0")
    angle = np.abs(np.asarray(angle_deg, dtype=np.float64))
    short = 2.0 * np.sqrt(angle / acceleration_deg_per_s2)
    long = angle / speed_deg_per_s + speed_deg_per_s / acceleration_deg_per_s2
    return np.asarray(np.where(angle <= speed_deg_per_s**2 / acceleration_deg_per_s2, short, long))


def move_time_s(d_azimuth_deg: ArrayLike, d_elevation_deg: ArrayLike, head: HeadLimits) -> FloatArray:
    """Shortest time to turn both axes from rest to rest: they move together, the longer one counts.

    Parameters
    ----------
    d_azimuth_deg, d_elevation_deg : array_like, broadcast together
        Angles to turn [deg], either sign. The azimuth is taken as it is: the caller chooses the way round.
    head : HeadLimits
        Speed and acceleration of the axes.

    Returns
    -------
    array
        Time [s].

    Examples
    --------
    >>> halo = HeadLimits(36, 72, 36, 72)
    >>> move_time_s([36.0, 0.0], [36.0, 36.0], halo).round(3)
    array([2.   , 1.414])
    """
    azimuth = turn_time_s(
        d_azimuth_deg,
        speed_deg_per_s=head.azimuth_speed_deg_per_s,
        acceleration_deg_per_s2=head.azimuth_acceleration_deg_per_s2,
    )
    elevation = turn_time_s(
        d_elevation_deg,
        speed_deg_per_s=head.elevation_speed_deg_per_s,
        acceleration_deg_per_s2=head.elevation_acceleration_deg_per_s2,
    )
    return np.asarray(np.maximum(azimuth, elevation))


def _turn(angle_rad: float, first: int, second: int) -> FloatArray:
    """Rotation matrix that turns axis `first` towards axis `second`."""
    matrix = np.eye(3)
    matrix[first, first] = matrix[second, second] = np.cos(angle_rad)
    matrix[second, first], matrix[first, second] = np.sin(angle_rad), -np.sin(angle_rad)
    return matrix
