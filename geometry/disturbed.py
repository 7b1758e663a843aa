"""From which wind directions rotors disturb a measurement: its point, or its whole volume.

All positions lie in one local frame: east, true north, up [m]. Wind directions are where the wind comes from,
clockwise from true north; the wake goes downwind. Two models of what is disturbed: the wake cone of Jensen,
in plan and in height, and the sectors of IEC 61400-12-1, in plan alone.
"""

from collections.abc import Iterable
from functools import partial

import numpy as np

from geometry.angles import SectorSet
from geometry.arrays import ArrayLike, FloatArray
from geometry.volumes import EDGE_TOLERANCE_DEG, Touch, directions_touching
from geometry.wakes import DECAY_ONSHORE, IEC_FARTHEST_DIAMETERS, Rotors, iec_sector_width_deg


def distance_over_diameter(rotors: Rotors, volume_m: ArrayLike) -> FloatArray:
    """Smallest horizontal distance from each rotor to a volume's sample points, over its diameter.

    Parameters
    ----------
    rotors
        The rotors.
    volume_m
        Sample points: east, north, up [m], shape (..., 3).

    Returns
    -------
    FloatArray
        L/D without unit, shape (rotor,).

    Examples
    --------
    >>> distance_over_diameter(Rotors([[0.0, 185.0, 99.5]], 113.0, 0.8), [0.0, 0.0, 120.0]).round(2).tolist()
    [1.64]
    """
    points = np.asarray(volume_m, dtype=np.float64).reshape(-1, 3)
    offset = points[np.newaxis] - rotors.hub_m[:, np.newaxis]
    return np.asarray(np.hypot(offset[..., 0], offset[..., 1]).min(axis=1) / rotors.diameter_m)


def jensen_excluded(
    rotors: Rotors,
    volume_m: ArrayLike,
    *,
    decay: float = DECAY_ONSHORE,
    max_diameters: float = IEC_FARTHEST_DIAMETERS,
    tolerance_deg: float = EDGE_TOLERANCE_DEG,
) -> list[SectorSet]:
    """Wind directions in which the wake cone of each rotor touches a volume, in plan and in height.

    Parameters
    ----------
    rotors
        The rotors.
    volume_m
        Loose points (p, 3) or a sheet (ray, along, 3): east, north, up [m]. The sheet is filled in between
        its samples; one point has the shape (1, 3).
    decay
        Growth of the wake's radius per distance, k.
    max_diameters
        Where the wake ends, downwind distance over diameter; infinity for never.
    tolerance_deg
        How much too narrow an edge may stay for a sheet [deg]; loose points are exact.

    Returns
    -------
    list[SectorSet]
        Directions the wind comes from, one set a rotor, empty where the wake never arrives. `any_of` unites
        them.

    Notes
    -----
    The wake is the cone of radius D/2 + kX around the horizontal line through the hub, 0 <= X <=
    max_diameters D. A point at the horizontal distance ρ and the height difference h from the hub, seen at
    the angle α from the wake's axis, is in it if ρ² sin²α + h² <= (D/2 + kρ cos α)². That is quadratic in X =
    ρ cos α and holds from X = q / (Rk + sqrt(R²k² + (1 + k²) q)) on, with R = D/2, q = ρ² + h² - R². For a
    ball of radius g around the point the cone is widened to R + (1 + k) g, which covers every cone that
    touches the ball.

    Examples
    --------
    >>> stand = Rotors([[0.0, 185.0, 99.5]], 113.0, 0.8)
    >>> [(round(a), round(b)) for a, b in jensen_excluded(stand, [[0.0, 0.0, 116.5]])[0].pairs()]
    [(339, 21)]
    """
    return [
        directions_touching(
            volume_m,
            partial(touch_jensen, hub, float(size), decay, max_diameters * float(size)),
            tolerance_deg=tolerance_deg,
        )
        for hub, size in zip(rotors.hub_m, rotors.diameter_m, strict=True)
    ]


def iec_excluded(
    rotors: Rotors,
    volume_m: ArrayLike,
    *,
    max_diameters: float = IEC_FARTHEST_DIAMETERS,
    tolerance_deg: float = EDGE_TOLERANCE_DEG,
) -> list[SectorSet]:
    """Wind directions in which each rotor disturbs some point of a volume, after IEC 61400-12-1.

    Parameters
    ----------
    rotors
        The rotors; an obstacle counts with its equivalent diameter.
    volume_m
        Loose points (p, 3) or a sheet (ray, along, 3): east, north, up [m]; heights play no part.
    max_diameters
        Distance over diameter up to which a neighbour disturbs. There is no lower limit: under 2 diameters
        the formula is still used, and `distance_over_diameter` with `iec_in_range` tells of it.
    tolerance_deg
        How much too narrow an edge may stay for a sheet [deg]; loose points are exact.

    Returns
    -------
    list[SectorSet]
        Directions the wind comes from, one set a rotor. A point at the rotor itself is disturbed from
        everywhere.

    Examples
    --------
    >>> stand = Rotors([[0.0, 185.0, 99.5]], 113.0, 0.8)
    >>> [(round(a, 1), round(b, 1)) for a, b in iec_excluded(stand, [[0.0, 0.0, 116.5]])[0].pairs()]
    [(316.5, 43.5)]
    """
    return [
        directions_touching(
            volume_m, partial(touch_iec, hub, float(size), max_diameters), tolerance_deg=tolerance_deg
        )
        for hub, size in zip(rotors.hub_m, rotors.diameter_m, strict=True)
    ]


def any_of(sets: Iterable[SectorSet]) -> SectorSet:
    """Unite sets of directions, such as those of all rotors or of two models.

    Examples
    --------
    >>> from geometry.angles import Sector
    >>> any_of([SectorSet.of([Sector(350.0, 20.0)]), SectorSet.of([Sector(5.0, 10.0)])]).pairs()
    [(350.0, 15.0)]
    """
    return SectorSet.of(sector for each in sets for sector in each.sectors)


def touch_jensen(
    hub_m: FloatArray,
    diameter_m: float,
    decay: float,
    length_m: float,
    points_m: FloatArray,
    margin_m: FloatArray,
) -> Touch:
    """Directions from which a wake cone touches balls around points (n, 3): see `jensen_excluded`."""
    east, north, up = (points_m - hub_m).T
    radius = 0.5 * diameter_m + (1.0 + decay) * margin_m
    distance = np.hypot(east, north)
    outside = distance**2 + up**2 - radius**2
    root = np.sqrt((radius * decay) ** 2 + (1.0 + decay**2) * np.maximum(outside, 0.0))
    nearest = np.where(outside > 0.0, outside / (radius * decay + root), -margin_m)
    farthest = np.minimum(length_m + margin_m, distance)
    touched = nearest <= farthest
    outer = np.where(distance > 0.0, _half_angle_deg(nearest, distance), 180.0)
    return Touch(
        np.rad2deg(np.arctan2(-east, -north)),
        np.where(touched, _half_angle_deg(farthest, distance), np.nan),
        np.where(touched, outer, np.nan),
    )


def _half_angle_deg(downwind_m: FloatArray, distance_m: FloatArray) -> FloatArray:
    """Angle [deg] between the axis and a point at a distance whose downwind part is given; 0 to 180."""
    downwind = np.clip(downwind_m, -distance_m, distance_m)
    across = np.sqrt((distance_m - downwind) * (distance_m + downwind))
    return np.asarray(np.rad2deg(np.arctan2(across, downwind)))


def touch_iec(
    hub_m: FloatArray, diameter_m: float, max_diameters: float, points_m: FloatArray, margin_m: FloatArray
) -> Touch:
    """Disturbed sectors of balls around points (n, 3): width at the nearest point plus the ball's angle."""
    east, north, _ = (points_m - hub_m).T
    distance = np.hypot(east, north)
    nearest = np.maximum(distance - margin_m, 0.0)
    seen = np.rad2deg(np.arctan2(margin_m, np.sqrt(nearest * (distance + margin_m))))
    half = np.minimum(0.5 * iec_sector_width_deg(nearest / diameter_m) + seen, 180.0)
    outer = np.where(distance > margin_m, half, 180.0)
    touched = nearest <= max_diameters * diameter_m
    return Touch(
        np.rad2deg(np.arctan2(-east, -north)),
        np.where(touched, 0.0, np.nan),
        np.where(touched, outer, np.nan),
    )
