"""Wakes: how wide they are, how slow, and how wide a sector IEC 61400-12-1 calls disturbed.

All positions lie in one local frame: east, true north, up [m]. Wind directions are where the wind comes from,
clockwise from true north; the wake goes downwind. Hills, the ground, stability, and what the wakes of other
turbines do to a turbine's own wake, are not modelled.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from geometry.arrays import ArrayLike, BoolArray, FloatArray
from geometry.errors import InputError

# Decay of a wake on land (offshore 0.04 to 0.05): Katic, Højstrup & Jensen (1986), and the practice of Park.
DECAY_ONSHORE = 0.075

# Distances over diameters between which IEC 61400-12-1, Annex A, means its formula (since 2022 in IEC 61400-12-5).
IEC_NEAREST_DIAMETERS = 2.0
IEC_FARTHEST_DIAMETERS = 20.0


@dataclass(frozen=True, eq=False)  # arrays have no single truth to compare by
class Rotors:
    """Rotors that make wakes; an obstacle counts with its equivalent diameter.

    Parameters
    ----------
    hub_m
        Hub positions: east, north, up [m], shape (rotor, 3).
    diameter_m
        Rotor diameters [m], shape (rotor,) or one for all; positive.
    thrust_coefficient
        Thrust coefficients, without unit, shape (rotor,) or one for all; 0 to 1. The deficit alone uses them.

    Raises
    ------
    InputError
        If a number is not finite or out of its range, or the shapes do not fit.

    Examples
    --------
    >>> row = Rotors([[0.0, 185.0, 99.5], [0.0, 1131.0, 84.0]], [113.0, 90.0], 0.8)
    >>> len(row), row.thrust_coefficient.tolist()
    (2, [0.8, 0.8])
    """

    hub_m: FloatArray  # (rotor, 3)
    diameter_m: FloatArray  # (rotor,)
    thrust_coefficient: FloatArray  # (rotor,)

    def __init__(self, hub_m: ArrayLike, diameter_m: ArrayLike, thrust_coefficient: ArrayLike) -> None:
        hub = np.array(hub_m, dtype=np.float64)
        if hub.ndim != 2 or hub.shape[1] != 3:
            raise InputError(
                f"hubs of shape {hub.shape} came; allowed is (rotor, 3): east, north, up in metres. "
                "Put the rotors on the first axis."
            )
        try:
            diameter = np.array(np.broadcast_to(np.asarray(diameter_m, dtype=np.float64), hub.shape[:1]))
            thrust = np.array(
                np.broadcast_to(np.asarray(thrust_coefficient, dtype=np.float64), hub.shape[:1])
            )
        except ValueError as error:
            raise InputError(
                f"{hub.shape[0]} hubs came with diameters of shape {np.shape(diameter_m)} and thrust "
                f"coefficients of shape {np.shape(thrust_coefficient)}; allowed is one each or one for all."
            ) from error
        allowed = np.all(diameter > 0.0) and np.all((thrust >= 0.0) & (thrust <= 1.0))
        if not (allowed and np.all(np.isfinite(hub)) and np.all(np.isfinite(diameter))):
            raise InputError(
                f"rotor diameters {diameter} m and thrust coefficients {thrust} came; allowed are finite "
                "hubs, positive diameters and coefficients from 0 to 1. Check the turbines."
            )
        for name, value in (("hub_m", hub), ("diameter_m", diameter), ("thrust_coefficient", thrust)):
            value.flags.writeable = False
            object.__setattr__(self, name, value)

    def __len__(self) -> int:
        """Count the rotors."""
        return int(self.diameter_m.size)


class WakeOutline(NamedTuple):
    """One wake cone as a closed ring in plan, and as circles around points of its axis."""

    polygon_m: FloatArray  # (n, 2) east, north; the first point again at the end
    axis_m: FloatArray  # (station, 3) centres of the circles, first at the hub
    radius_m: FloatArray  # (station,)


def jensen_diameter_m(diameter_m: ArrayLike, downwind_m: ArrayLike, *, decay: float) -> FloatArray:
    """Diameter of a wake.

    Parameters
    ----------
    diameter_m
        Rotor diameter [m].
    downwind_m
        Distance downwind from the rotor [m]; the shapes broadcast.
    decay
        Growth of the radius per distance, k; 0.075 on land, 0.04 to 0.05 offshore.

    Returns
    -------
    FloatArray
        Diameter [m].

    Notes
    -----
    D_w = D + 2 k X: Jensen (1983), A note on wind generator interaction, Risø-M-2411.

    Examples
    --------
    >>> jensen_diameter_m([110.0, 113.0], [1131.0, 185.0], decay=0.075).tolist()
    [279.65, 140.75]
    """
    return np.asarray(diameter_m, dtype=np.float64) + 2.0 * decay * np.asarray(downwind_m, dtype=np.float64)


def jensen_speed_ratio(
    diameter_m: ArrayLike, downwind_m: ArrayLike, thrust_coefficient: ArrayLike, *, decay: float
) -> FloatArray:
    """Wind speed in a wake over the speed of the free wind.

    Parameters
    ----------
    diameter_m
        Rotor diameter [m]; the r0 of the formula is half of it, the radius of the rotor.
    downwind_m
        Distance X downwind, measured from the rotor [m]; the shapes broadcast.
    thrust_coefficient
        Thrust coefficient of the rotor, without unit, 0 to 1. Jensen's own case, in which the wind just
        behind the rotor is a third of the free wind, is 8/9.
    decay
        Growth of the radius per distance, k.

    Returns
    -------
    FloatArray
        U / U0, without unit, the same over the whole width of the wake.

    Notes
    -----
    U/U0 = 1 - (1 - sqrt(1 - Ct)) / (1 + k X / r0)²: Jensen (1983), Risø-M-2411, with 2/3 for 1 - sqrt(1 -
    Ct); with Ct: Katic, Højstrup & Jensen (1986), A simple model for cluster efficiency.

    Examples
    --------
    Jensen's turbine: D = 40 m, 8.1 m/s.

    >>> (8.1 * jensen_speed_ratio(40.0, [40.0, 100.0], 8 / 9, decay=0.1)).round(2).tolist()
    [4.35, 5.7]
    """
    loss = 1.0 - np.sqrt(1.0 - np.asarray(thrust_coefficient, dtype=np.float64))
    growth = 2.0 * decay * np.asarray(downwind_m, dtype=np.float64) / np.asarray(diameter_m, dtype=np.float64)
    return np.asarray(1.0 - loss / (1.0 + growth) ** 2)


def iec_sector_width_deg(distance_over_diameter: ArrayLike) -> FloatArray:
    """Full width of the disturbed sector of IEC 61400-12-1.

    Parameters
    ----------
    distance_over_diameter
        Distance to the neighbour over its rotor diameter or equivalent diameter, L/D, without unit; positive.

    Returns
    -------
    FloatArray
        Full width [deg], centred on the bearing to the neighbour. Computed at any distance: `iec_in_range`
        tells where the standard means it.

    Notes
    -----
    α = 1.3 arctan(2.5 D/L + 0.15) + 10°, arctan in degrees: IEC 61400-12-1, Annex A, of 2005 and 2017.

    Examples
    --------
    >>> iec_sector_width_deg([185 / 113, 2.0, 20.0]).round(2).tolist()
    [86.95, 80.8, 29.99]
    """
    with np.errstate(divide="ignore"):  # at the neighbour itself the arctangent is 90 degrees
        inverse = 2.5 / np.asarray(distance_over_diameter, dtype=np.float64)
    return np.asarray(1.3 * np.rad2deg(np.arctan(inverse + 0.15)) + 10.0)


def iec_in_range(distance_over_diameter: ArrayLike) -> BoolArray:
    """Tell where 2 <= L/D <= 20, the range of the IEC formula.

    Examples
    --------
    >>> iec_in_range([1.64, 2.0, 20.1]).tolist()
    [False, True, False]
    """
    ratio = np.asarray(distance_over_diameter, dtype=np.float64)
    return np.asarray((ratio >= IEC_NEAREST_DIAMETERS) & (ratio <= IEC_FARTHEST_DIAMETERS))


def equivalent_diameter_m(height_m: ArrayLike, width_m: ArrayLike) -> FloatArray:
    """Give the diameter [m] with which an obstacle of a height and a width [m] enters the IEC formula.

    2 l_h l_w / (l_h + l_w): IEC 61400-12-1:2017, Annex A.

    Examples
    --------
    >>> float(equivalent_diameter_m(10.0, 40.0))
    16.0
    """
    height, width = np.asarray(height_m, dtype=np.float64), np.asarray(width_m, dtype=np.float64)
    return np.asarray(2.0 * height * width / (height + width))


def deficits(
    rotors: Rotors,
    point_m: ArrayLike,
    wind_from_deg: ArrayLike,
    *,
    decay: float = DECAY_ONSHORE,
    max_diameters: float = np.inf,
) -> FloatArray:
    """Loss of wind speed at points, by rotor and wind direction.

    Parameters
    ----------
    rotors
        The rotors.
    point_m
        Points: east, north, up [m], shape (..., 3).
    wind_from_deg
        Wind directions [deg], shape (direction,).
    decay
        Growth of the wake's radius per distance, k.
    max_diameters
        Where a wake ends, downwind distance over diameter.

    Returns
    -------
    FloatArray
        1 - U/U0, without unit, shape (..., rotor, direction); 0 outside the wake.

    Notes
    -----
    `jensen_speed_ratio` inside the cone of `jensen_excluded`; the hat has a flat top and a sharp rim.

    Examples
    --------
    >>> stand = Rotors([[0.0, 185.0, 99.5]], 113.0, 0.8)
    >>> deficits(stand, [0.0, 0.0, 116.5], [0.0, 20.0, 40.0, 180.0]).round(3).tolist()
    [[0.356, 0.365, 0.0, 0.0]]
    """
    offset = (
        np.asarray(point_m, dtype=np.float64)[..., np.newaxis, np.newaxis, :] - rotors.hub_m[:, np.newaxis]
    )
    toward = np.deg2rad(np.asarray(wind_from_deg, dtype=np.float64)) + np.pi
    east, north, up = np.moveaxis(offset, -1, 0)  # (..., rotor, 1)
    downwind = east * np.sin(toward) + north * np.cos(toward)
    across = east * np.cos(toward) - north * np.sin(toward)
    diameter, thrust = rotors.diameter_m[:, np.newaxis], rotors.thrust_coefficient[:, np.newaxis]
    behind = (downwind > 0.0) & (downwind <= max_diameters * diameter)
    reached = np.where(behind, downwind, 0.0)
    radius = 0.5 * jensen_diameter_m(diameter, reached, decay=decay)
    inside = behind & (np.hypot(across, up) <= radius)
    return np.where(inside, 1.0 - jensen_speed_ratio(diameter, reached, thrust, decay=decay), 0.0)


def deficit(
    rotors: Rotors,
    point_m: ArrayLike,
    wind_from_deg: ArrayLike,
    *,
    decay: float = DECAY_ONSHORE,
    max_diameters: float = np.inf,
) -> FloatArray:
    """Loss of wind speed at points from all wakes together, by wind direction.

    Parameters
    ----------
    rotors, point_m, wind_from_deg, decay, max_diameters
        As in `deficits`.

    Returns
    -------
    FloatArray
        1 - U/U0, without unit, shape (..., direction).

    Notes
    -----
    Root of the sum of the squares of `deficits`: Katic, Højstrup & Jensen (1986).

    Examples
    --------
    >>> row = Rotors([[0.0, 185.0, 99.5], [0.0, 1131.0, 84.0]], [113.0, 90.0], 0.8)
    >>> deficit(row, [0.0, 0.0, 116.5], [0.0, 90.0]).round(3).tolist()
    [0.362, 0.0]
    """
    each = deficits(rotors, point_m, wind_from_deg, decay=decay, max_diameters=max_diameters)
    return np.asarray(np.sqrt(np.sum(each**2, axis=-2)))


def wake_outline_m(
    hub_m: ArrayLike,
    diameter_m: float,
    wind_from_deg: float,
    *,
    decay: float,
    length_m: float,
    stations: int = 2,
) -> WakeOutline:
    """Outline one wake for maps and scenes.

    Parameters
    ----------
    hub_m
        Position of the hub: east, north, up [m], shape (3,).
    diameter_m
        Rotor diameter [m].
    wind_from_deg
        Where the wind comes from [deg].
    decay
        Growth of the wake's radius per distance, k.
    length_m
        How far downwind the outline goes [m]; positive.
    stations
        Circles along the axis, ends included; at least 2.

    Returns
    -------
    WakeOutline
        Ring in plan (2 stations + 1, 2), centres (stations, 3) and radii (stations,) of the circles [m].

    Raises
    ------
    InputError
        If the length is not positive or the stations are fewer than 2.

    Examples
    --------
    >>> outline = wake_outline_m([0.0, 0.0, 80.0], 100.0, 270.0, decay=0.1, length_m=1000.0)
    >>> (outline.polygon_m.round(6) + 0.0).tolist(), outline.radius_m.tolist()
    ([[0.0, 50.0], [1000.0, 150.0], [1000.0, -150.0], [0.0, -50.0], [0.0, 50.0]], [50.0, 150.0])
    """
    if not (np.isfinite(length_m) and length_m > 0.0 and stations >= 2):
        raise InputError(
            f"a wake of {length_m} m with {stations} stations came; allowed are a finite positive length and "
            "at least 2 stations. Use max_diameters times the rotor diameter for the length."
        )
    hub = np.asarray(hub_m, dtype=np.float64)
    toward = np.deg2rad(wind_from_deg) + np.pi
    downwind = np.linspace(0.0, length_m, stations)
    radius = 0.5 * jensen_diameter_m(diameter_m, downwind, decay=decay)
    along = np.array([np.sin(toward), np.cos(toward), 0.0])
    left = np.array([-np.cos(toward), np.sin(toward)])
    axis = hub + downwind[:, np.newaxis] * along
    rim = radius[:, np.newaxis] * left
    ring = np.concatenate([axis[:, :2] + rim, (axis[:, :2] - rim)[::-1], axis[:1, :2] + rim[:1]])
    return WakeOutline(ring, axis, radius)
