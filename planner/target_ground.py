"""Which rays of a CNR map meet the ground."""

from typing import NamedTuple

import numpy as np

from geometry.arrays import FloatArray
from geometry.terrain_sight import terrain_sight
from planner.ground import heights_of
from planner.obstruction import ground_met_m
from planner.over_terrain import beam_ends_m, standing_head_m
from planner.places import Places
from planner.site import Lidar

SOME_RAYS = 400  # of a map are followed over the ground, evenly spread


class GroundMet(NamedTuple):
    """Rays of a map that meet the ground before the end of its gates."""

    share: float  # of all rays
    up_to_deg: float  # highest head elevation of a ray that does
    unknown: bool  # part of the way has no height: outside the raster, or in a hole of it


def ground_met(
    places: Places,
    lidar: Lidar,
    azimuth_head_deg: FloatArray,
    elevation_head_deg: FloatArray,
    reach_m: float,
) -> GroundMet | None:
    """Which rays of a map meet the ground, be it level or terrain; None where none does.

    Parameters
    ----------
    places, lidar
        Where the lidar stands, and how its head.
    azimuth_head_deg, elevation_head_deg
        (ray,) head angles [deg]; at most 400 of them are followed.
    reach_m
        Range that the beam has to come to [m].
    """
    some = np.unique(np.linspace(0, azimuth_head_deg.size - 1, SOME_RAYS).round().astype(np.intp))
    head_elevation = elevation_head_deg[some]
    azimuth, elevation = places.mounting(lidar).to_true(azimuth_head_deg[some], head_elevation)
    heights = heights_of(places.site)
    unknown = False
    if heights is None:
        above_m = max(lidar.position[2] - places.site.ground_m, 0.0)
        met = ground_met_m(above_m, elevation) < reach_m
    else:
        ends = beam_ends_m(places, lidar, azimuth, elevation, reach_m)
        sight = terrain_sight(heights.top, standing_head_m(heights, lidar), ends)
        met, unknown = sight.blocked[..., -1], bool(sight.unknown[..., -1].any())
    if not met.any() and not unknown:
        return None
    highest = float(head_elevation[met].max()) if met.any() else float("nan")
    return GroundMet(float(met.mean()), highest, unknown)
