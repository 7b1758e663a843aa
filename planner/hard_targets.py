"""The hard targets of a site as a lidar sees them: where to expect them, how surely, and what else is there."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from geometry.angles import difference_deg
from geometry.arrays import FloatArray
from geometry.beams import Beam, beam_to
from geometry.errors import InputError
from planner.nouns import Position
from planner.over_terrain import target_sight
from planner.places import Places
from planner.site import HardTarget, Lidar, Site
from reconstruct.sightings import Sighting

# How well the place of a thing is taken to be known that is no declared hard target [m], ASSUMED: the top of
# a mast, and of a turbine (its nacelle, whose height and yaw are not in the site file).
MAST_STD_M = 0.2
TURBINE_STD_M = 1.0

# What a map gives of a target (k = 1), for planning: that of the simulated maps in the tests.
MAP_STD_DEG = 0.001
MAP_RANGE_STD_M = 0.1


class Expected(NamedTuple):
    """Where a lidar's head has to point for a target, and how far off that may be (k = 1)."""

    true: Beam
    azimuth_head_deg: float
    elevation_head_deg: float
    range_head_m: float
    azimuth_std_deg: float
    elevation_std_deg: float
    range_std_m: float


class Neighbour(NamedTuple):
    """Something solid, as an upright rectangle in the sky."""

    name: str
    part: str  # mast, tower, rotor or obstacle
    azimuth_deg: float  # true, of its middle
    half_width_deg: float
    bottom_deg: float
    top_deg: float
    range_m: float  # to its nearest point in plan


def sought(site: Site, name: str) -> tuple[HardTarget, Position]:
    """Find a hard target by its name; the top of a mast or turbine of that name will do as well.

    Raises
    ------
    InputError
        If nothing has that name.
    """
    for target in site.hard_targets:
        if target.name == name:
            return target, site.target_position_m(target)
    for target, position in _undeclared(site):
        if target.name == name:
            return target, position
    known = ", ".join(names_of(site)) or "none is declared"
    raise InputError(f"no hard target, mast or turbine is called '{name}'; allowed: {known}")


def names_of(site: Site) -> list[str]:
    """Names of everything that `sought` finds."""
    return [item.name for item in site.hard_targets] + [item.name for item, _ in _undeclared(site)]


def _undeclared(site: Site) -> Iterator[tuple[HardTarget, Position]]:
    """Tops of masts and turbines as if they were declared."""
    for mast in site.masts:
        east, north, base = mast.position
        tip = HardTarget(
            name=mast.name, on=mast.name, shape="tip", size_m=mast.width_m, uncertainty_m=MAST_STD_M
        )
        yield tip, (east, north, base + mast.height_m)
    for turbine in site.turbines:
        east, north, base = turbine.position
        top = (east, north, base + turbine.hub_height_m)
        yield (
            HardTarget(
                name=turbine.name,
                position=top,
                shape="tip",
                size_m=turbine.tower_diameter_m,
                uncertainty_m=TURBINE_STD_M,
            ),
            top,
        )


def expected(
    places: Places,
    lidar: Lidar,
    position: Position,
    uncertainty_m: float,
    *,
    heading_std_deg: float | None = None,
) -> Expected:
    """Where to look for a target, and how far off it may be.

    Parameters
    ----------
    places, lidar
        The site and the lidar, with its uncertainties.
    position, uncertainty_m
        Of the target, and how well it is known [m].
    heading_std_deg : float, optional
        In place of the site file's.

    Notes
    -----
    Azimuth: heading, encoder, the tilt times tan(elevation), and the positions of both across the beam;
    elevation: levelling, encoder, positions; all independent.
    """
    beam = beam_to(places.frame.enu_m(lidar.position, position))
    azimuth, elevation, reach = (float(value) for value in beam)
    mounting = places.mounting(lidar)
    head_azimuth, head_elevation = mounting.to_head(azimuth, elevation)
    unsure = lidar.uncertainty
    heading = unsure.heading_deg if heading_std_deg is None else heading_std_deg
    place_m = float(np.hypot(unsure.position_m, uncertainty_m))
    place_deg = float(np.rad2deg(place_m / reach))
    tilt = np.deg2rad(elevation)
    across = (heading, unsure.azimuth_deg, unsure.levelling_deg * np.tan(tilt), place_deg / np.cos(tilt))
    return Expected(
        beam,
        float(head_azimuth),
        float(head_elevation),
        float(mounting.head_range_m(reach)),
        float(np.linalg.norm(across)),
        float(np.linalg.norm((unsure.levelling_deg, unsure.elevation_deg, place_deg))),
        float(np.hypot(unsure.range_m, place_m)),
    )


def candidates(places: Places, lidar: Lidar) -> list[Sighting]:
    """Hard targets that a lidar could measure: declared ones, else tops of masts and turbines; in sight, in reach.

    Each with the head angles and uncertainties to be expected of its map.
    """
    site, device = places.site, lidar.device
    declared = [(item, site.target_position_m(item)) for item in site.hard_targets]
    tops = [item for item in _undeclared(site) if item[0].name not in {target.on for target, _ in declared}]
    fixed = [
        item for item in neighbours(places, lidar) if item.part != "rotor"
    ]  # which hides it at times only
    found = []
    for target, position in (*declared, *tops):
        seen = expected(places, lidar, position, target.uncertainty_m)
        reach = float(seen.true.range_m)
        if not (device.min_range_m or 0.0) <= reach <= (device.max_range_m or np.inf):
            continue
        if hiding(fixed, seen.true, carrier=target.on or target.name):
            continue
        sight = target_sight(places, lidar, position)
        if sight is not None and sight.state == "blocked":
            continue
        found.append(
            Sighting(
                target.name,
                np.asarray(places.frame.enu_m(lidar.position, position)),
                seen.azimuth_head_deg,
                seen.elevation_head_deg,
                seen.range_head_m,
                np.nan if target.shape == "boom" else MAP_STD_DEG,
                np.nan if target.shape == "mast" else MAP_STD_DEG,
                MAP_RANGE_STD_M,
                target.uncertainty_m,
            )
        )
    return sorted(found, key=lambda item: float(np.linalg.norm(item.enu_m)))


def hiding(around: list[Neighbour], beam: Beam, *, carrier: str) -> list[str]:
    """Names of what stands before a target; what carries it does not count."""
    azimuth, elevation, reach = (float(value) for value in beam)
    return [
        item.name
        for item in around
        if item.name != carrier
        and item.range_m < reach
        and abs(float(difference_deg(item.azimuth_deg, azimuth))) < item.half_width_deg
        and item.bottom_deg < elevation < item.top_deg
    ]


def neighbours(places: Places, lidar: Lidar) -> list[Neighbour]:
    """Everything solid around a lidar, as rectangles in its sky."""

    def enu(position: Position, height_m: float = 0.0) -> FloatArray:
        return np.asarray(
            places.frame.enu_m(lidar.position, (position[0], position[1], position[2] + height_m))
        )

    site = places.site
    found = []
    for mast in site.masts:
        base = enu(mast.position)
        found.append(_upright(mast.name, "mast", base, mast.height_m, mast.width_m / 2))
    for turbine in site.turbines:
        radius, hub = turbine.rotor_diameter_m / 2, enu(turbine.position, turbine.hub_height_m)
        tower = turbine.tower_diameter_m / 2
        found.append(_upright(turbine.name, "tower", enu(turbine.position), turbine.hub_height_m, tower))
        under = hub - [0.0, 0.0, radius]
        found.append(_upright(turbine.name, "rotor", under, 2 * radius, radius))
    for obstacle in site.obstacles:
        half = float(np.hypot(obstacle.width_m, obstacle.length_m)) / 2
        found.append(_upright(obstacle.name, "obstacle", enu(obstacle.position), obstacle.height_m, half))
    return found


def _upright(name: str, part: str, base: FloatArray, height_m: float, radius_m: float) -> Neighbour:
    """The rectangle around an upright cylinder: its ends as the nearer or the farther side shows them."""
    plan_m = float(np.hypot(base[0], base[1]))
    near_m = max(plan_m - radius_m, 1e-3)
    half = 180.0 if plan_m <= radius_m else float(np.rad2deg(np.arcsin(radius_m / plan_m)))
    reach = np.array([near_m, plan_m + radius_m])
    top = float(np.rad2deg(np.arctan2(base[2] + height_m, reach)).max())
    bottom = float(np.rad2deg(np.arctan2(base[2], reach)).min())
    return Neighbour(name, part, float(beam_to(base).azimuth_deg), half, bottom, top, near_m)
