"""Where everything stands: the site's nouns as arrays in one local frame."""

from dataclasses import dataclass
from functools import cached_property
from itertools import combinations
from typing import NamedTuple

import numpy as np

from geometry.angles import FULL_CIRCLE_DEG, difference_deg
from geometry.arrays import ArrayLike, FloatArray
from geometry.beams import unit_vector
from geometry.errors import InputError
from geometry.frames import EarthModel, SiteFrame
from geometry.head import Mounting
from geometry.wakes import Rotors
from planner.ground import ground_under_m
from planner.nouns import Position, made_of
from planner.site import Lidar, Site


class Apart(NamedTuple):
    """Two things of one kind and how far apart they are."""

    kind: str  # lidars or targets
    first: str
    second: str
    apart_m: float


@dataclass(frozen=True)
class Places:
    """The site's frame and the positions of its things, east, north, up from one origin.

    The origin lies in the middle of lidars and targets, at ground level. A local frame that is flat is tilted
    against the horizontal of a lidar d metres away by d/R: 0.009° at 1 km. Angles that an instrument is
    pointed with are therefore never taken from here but from the lidar's own frame (`planner.pointing`).

    Examples
    --------
    >>> from planner.site import Target
    >>> target = Target(name="T", position=(500000.0, 6250000.0, 100.0))
    >>> site = Site(name="Moor", crs="EPSG:32632", ground_height_m=10.0, targets=(target,))
    >>> (Places(site).local_m([500000.0, 6250000.0, 100.0]).round(3) + 0.0).tolist()
    [0.0, 0.0, 90.0]
    """

    site: Site
    earth_model: EarthModel = "exact"

    @cached_property
    def frame(self) -> SiteFrame:
        """The site's projected CRS with its height datum."""
        return SiteFrame(
            crs=self.site.crs,
            height_datum=self.site.height_datum,
            geoid_undulation_m=self.site.geoid_undulation_m,
        )

    @cached_property
    def origin_m(self) -> FloatArray:
        """(3,) easting, northing and height of the local frame's origin [m].

        Raises
        ------
        InputError
            If nothing stands on the site.
        """
        standing = [mast.position for mast in self.site.masts]
        standing += [turbine.position for turbine in self.site.turbines]
        marks = self.aimed_m or standing
        if not marks:
            raise InputError("the site has nothing in it: give at least one lidar, mast, turbine or target")
        easting_northing = np.asarray(marks, dtype=np.float64)[:, :2]
        middle = (easting_northing.min(axis=0) + easting_northing.max(axis=0)) / 2
        return np.array([*middle, self.site.ground_m])

    @property
    def aimed_m(self) -> tuple[Position, ...]:
        """Positions of all lidars and targets, in the site's coordinates [m]."""
        lidars = (lidar.position for lidar in self.site.lidars)
        return (*lidars, *(self.site.target_position_m(target) for target in self.site.targets))

    def local_m(self, positions_m: ArrayLike) -> FloatArray:
        """Positions (..., 3) in the site's coordinates as east, north, up from the origin [m]."""
        return self.frame.enu_m(self.origin_m, positions_m, model=self.earth_model)

    def from_lidar_m(self, lidar: Lidar, enu_m: ArrayLike) -> FloatArray:
        """Points (..., 3) in the lidar's own east-north-up frame as east, north, up from the origin [m]."""
        positions = self.frame.projected_m(lidar.position, enu_m, model=self.earth_model)
        return self.local_m(positions)

    def beam_local_m(
        self, lidar: Lidar, azimuth_deg: ArrayLike, elevation_deg: ArrayLike, range_m: ArrayLike
    ) -> FloatArray:
        """Points (..., 3) on beams of a lidar, east, north, up from the origin [m].

        Parameters
        ----------
        lidar
            Where the beams begin.
        azimuth_deg, elevation_deg, range_m
            True azimuth, elevation and slant range; the shapes (...) broadcast.
        """
        reach = np.asarray(range_m, dtype=np.float64)[..., None]
        return self.from_lidar_m(lidar, reach * unit_vector(azimuth_deg, elevation_deg))

    def height_above_ground_m(self, target: str) -> float:
        """Height of a target above the ground under it [m]; negative below it."""
        position = self.site.target_position_m(target)
        return position[2] - float(ground_under_m(self.site, position))

    @cached_property
    def outside_area_deg(self) -> float | None:
        """How far lidars and targets lie outside the CRS' area of use, at the worst [deg]; 0 inside.

        None where the CRS states no area.
        """
        if (area := self.frame.area_of_use) is None:
            return None
        west, south, east, north = area
        longitude, latitude, _ = self.frame.geographic(np.array(self.aimed_m).reshape(-1, 3))
        half = ((east - west) % FULL_CIRCLE_DEG or FULL_CIRCLE_DEG) / 2  # the area may cross the antimeridian
        aside = np.abs(difference_deg(longitude, west + half)) - half
        return float(np.max([np.zeros_like(aside), aside, south - latitude, latitude - north], initial=0.0))

    @cached_property
    def distances(self) -> tuple[Apart, ...]:
        """Distance of every two lidars and every two targets from each other."""
        lidars = [(lidar.name, lidar.position) for lidar in self.site.lidars]
        targets = [(item.name, self.site.target_position_m(item)) for item in self.site.targets]
        return tuple(
            Apart(kind, first, second, float(np.linalg.norm(np.subtract(here, there))))
            for kind, items in (("lidars", lidars), ("targets", targets))
            for (first, here), (second, there) in combinations(items, 2)
        )

    def convergence_deg(self, lidar: Lidar) -> float:
        """Meridian convergence at the lidar [deg]: true azimuth less grid azimuth."""
        return float(self.frame.convergence_deg(lidar.position))

    def mounting(self, lidar: Lidar) -> Mounting:
        """How the lidar's head stands against true north: the convergence turns a zero at grid north."""
        zero_deg = self.convergence_deg(lidar) if lidar.north == "grid" else 0.0
        return made_of(
            lidar.mounting,
            Mounting,
            heading_deg=lidar.mounting.heading_deg + zero_deg,
            azimuth_offset_deg=lidar.azimuth_offset_deg,
            elevation_offset_deg=lidar.elevation_offset_deg,
        )

    @cached_property
    def hubs_m(self) -> FloatArray:
        """(turbine, 3) rotor hubs, east, north, up from the origin [m]."""
        hubs = [
            (*turbine.position[:2], turbine.position[2] + turbine.hub_height_m)
            for turbine in self.site.turbines
        ]
        return self.local_m(np.asarray(hubs, dtype=np.float64).reshape(-1, 3))

    @cached_property
    def rotors(self) -> Rotors:
        """The turbines' rotors in the local frame."""
        turbines = self.site.turbines
        return Rotors(
            hub_m=self.hubs_m,
            diameter_m=np.array([turbine.rotor_diameter_m for turbine in turbines], dtype=np.float64),
            thrust_coefficient=np.array(
                [turbine.thrust_coefficient for turbine in turbines], dtype=np.float64
            ),
        )
