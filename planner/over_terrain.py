"""The rays of each scan over the terrain: clear, blocked or not known, for each ray and gate."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np

from geometry.arrays import ArrayLike, BoolArray, FloatArray
from geometry.beams import unit_vector
from geometry.earth import refraction_lift_m
from geometry.terrain_sight import nearest_pass, terrain_sight
from planner.ground import Heights, ground_doubt_m, heights_of
from planner.obstruction import Obstruction, margin_m, reach_m
from planner.places import Places
from planner.scan_layout import ScanLayout
from planner.scan_plans import PointsScan
from planner.site import Lidar

State = Literal["clear", "blocked", "unknown"]

MOST_IN_FAN = (
    41  # beams that stand for what one ray sweeps; between them it sweeps no more than a cell, up to these
)


class TargetSight(NamedTuple):
    """One lidar's straight line to one target over the terrain."""

    state: State
    clearance_m: float | None  # where it passes the ground nearest as seen from the head; None: not known
    distance_m: float | None  # level, from the head to there


@dataclass(frozen=True, eq=False)
class OverTerrain:
    """How the rays of one scan clear the ground, canopy and buildings of the terrain."""

    scan: str
    range_m: FloatArray  # (ray, gate) slant ranges: the gates, and how far the ray is wanted
    clearance_m: (
        FloatArray  # (ray, gate) least height above the ground from the head to there, the head's own counted
    )
    pass_m: FloatArray  # (ray, gate) height above the ground where, up to there, it is nearest as seen from the head
    blocked: BoolArray  # (ray, gate)
    unknown: BoolArray  # (ray, gate) part of the way has no height, and what is known of it is clear
    wanted: int  # index of the gate that stands for how far the rays are wanted
    entry_m: FloatArray  # (ray,) where the ray first meets the ground [m]; NaN where it does not
    near: BoolArray  # (ray,) clear by less than the beam's own uncertainty, up to where it is wanted
    near_m: FloatArray  # (ray,) clearance where it is nearest by that measure
    near_range_m: FloatArray  # (ray,) distance from the head to there

    @property
    def lost(self) -> BoolArray:
        """(ray,) whether the ground is in the way before the ray has reached what it is for."""
        return self.blocked[:, self.wanted]

    @property
    def not_known(self) -> BoolArray:
        """(ray,) whether the ray leaves the raster on its way there."""
        return self.unknown[:, self.wanted]


def over_terrain(places: Places, layouts: tuple[ScanLayout, ...]) -> tuple[OverTerrain, ...]:
    """Judge every scan; nothing without a terrain."""
    heights = heights_of(places.site)
    return () if heights is None else tuple(_of_scan(places, layout, heights) for layout in layouts)


def target_sight(places: Places, lidar: Lidar, position_m: ArrayLike) -> TargetSight | None:
    """Judge a lidar's line of sight to a point (3,); None without a terrain.

    The line is that of a beam aimed to hit the point: it bends with refraction and ends there.
    """
    heights = heights_of(places.site)
    if heights is None:
        return None
    head = standing_head_m(heights, lidar)
    sight = terrain_sight(heights.top, head, position_m)
    near = nearest_pass(heights.top, head, position_m)
    state: State = "blocked" if sight.blocked[0] else "unknown" if sight.unknown[0] else "clear"
    known = bool(np.isfinite(near.clearance_m))
    return TargetSight(
        state,
        float(near.clearance_m) if known else None,
        float(near.distance_m) if known else None,
    )


def terrain_obstructions(
    layout: Mapping[str, ScanLayout], sights: tuple[OverTerrain, ...]
) -> tuple[Obstruction, ...]:
    """The terrain as an obstruction of each scan that it blocks, or that passes it within its margin."""
    return tuple(
        _obstruction(layout[sight.scan], sight) for sight in sights if (sight.lost | sight.near).any()
    )


def _obstruction(layout: ScanLayout, sight: OverTerrain) -> Obstruction:
    lost = sight.lost
    if lost.any():
        clearance_m = float(np.nanmin(sight.clearance_m[lost, sight.wanted]))
        range_m = float(np.nanmin(sight.entry_m[lost]))
    else:
        ray = int(np.argmin(np.where(sight.near, sight.near_m, np.inf)))
        clearance_m, range_m = float(sight.near_m[ray]), float(sight.near_range_m[ray])
    return Obstruction(
        scan=sight.scan,
        thing="the terrain",
        part="ground",
        rays=layout.scan.count,
        lost=lost,
        lost_azimuth_deg=layout.scan.azimuth_deg[lost],
        lost_elevation_deg=layout.scan.elevation_deg[lost],
        clearance_m=clearance_m,
        range_m=range_m,
        margin_m=margin_m(layout.lidar, range_m),
    )


def standing_head_m(heights: Heights, lidar: Lidar) -> FloatArray:
    """Where a lidar's head is (3,), easting, northing, height [m].

    One that is declared below the ground by no more than the raster's own doubt stands on it. One farther below stays
    there, in the ground, which blocks all its beams.
    """
    east, north, height = lidar.position
    ground = float(heights.ground.heights_m(east, north))
    buried = ground - height > ground_doubt_m(heights.ground, lidar.position)
    return np.array([east, north, height if buried or not np.isfinite(ground) else max(height, ground)])


def beam_ends_m(
    places: Places, lidar: Lidar, azimuth_deg: ArrayLike, elevation_deg: ArrayLike, range_m: ArrayLike
) -> FloatArray:
    """Where beams come to at a range, which refraction bends down: by 0.4 m at 6 km.

    Parameters
    ----------
    places, lidar
        Where the lidar stands.
    azimuth_deg, elevation_deg
        (...,) true angles at the head [deg].
    range_m
        (...,) from the head [m]; broadcasts against the angles.

    Returns
    -------
    FloatArray
        (..., 3) easting, northing and height [m].
    """
    range_ = np.asarray(range_m, dtype=np.float64)
    ends = places.frame.projected_m(
        lidar.position, range_[..., None] * unit_vector(azimuth_deg, elevation_deg)
    )
    ends[..., 2] -= refraction_lift_m(range_)
    return np.asarray(ends)


def _of_scan(places: Places, layout: ScanLayout, heights: Heights) -> OverTerrain:
    wanted = reach_m(layout)
    gates = np.empty(0) if layout.gates is None or _alone(layout) else layout.gates.centres_m
    reach = wanted if not gates.size else np.maximum(wanted, gates[-1])
    shares = np.unique(np.append(gates[gates > 0.0] / reach[0], wanted[0] / reach[0]))
    at = int(np.searchsorted(shares, wanted[0] / reach[0]))
    head = standing_head_m(heights, layout.lidar)
    ends = _ends_m(places, layout, reach, min(heights.top.cell_east_m, heights.top.cell_north_m))
    sight = terrain_sight(heights.top, head, ends, shares=shares)
    margin = np.array([margin_m(layout.lidar, float(value)) for value in reach])
    lowered = ends - margin[:, None, None] * np.array([0.0, 0.0, 1.0])
    low = terrain_sight(heights.top, head, lowered, shares=shares[at : at + 1])
    beam = np.argmin(np.where(np.isnan(low.clearance_m), np.inf, low.clearance_m), axis=1)[:, 0]
    rays, blocked = np.arange(len(reach)), np.asarray(sight.blocked.any(axis=1))
    where = low.distance_m[rays, beam, 0]
    return OverTerrain(
        scan=layout.name,
        range_m=reach[:, None] * shares,
        clearance_m=_least(sight.clearance_m),
        pass_m=_least(sight.pass_m),
        blocked=blocked,
        unknown=np.asarray(~blocked & sight.unknown.any(axis=1)),
        wanted=at,
        entry_m=_first(sight.entry_m[..., at]),
        near=np.asarray(low.blocked[..., 0].any(axis=1) & ~blocked[:, at]),
        near_m=low.clearance_m[rays, beam, 0] + margin * where / reach,
        near_range_m=where,
    )


def _alone(layout: ScanLayout) -> bool:
    """Whether each ray has a reach of its own."""
    return isinstance(layout.spec, PointsScan)


def _ends_m(places: Places, layout: ScanLayout, reach: FloatArray, cell_m: float) -> FloatArray:
    """(ray, beam, 3) far ends of the beams that stand for what each ray sweeps, its lowest elevation; with refraction."""
    scan = layout.scan
    swept = np.abs(scan.swept_azimuth_deg).max()
    count = min(int(np.ceil(np.radians(swept) * reach.max() / cell_m)) + 1, MOST_IN_FAN)
    turn = np.linspace(-0.5, 0.5, count) if count > 1 else np.zeros(1)
    lowest = scan.elevation_deg - np.abs(scan.swept_elevation_deg) / 2
    azimuth = scan.azimuth_deg[:, None] + turn * scan.swept_azimuth_deg[:, None]
    return beam_ends_m(places, layout.lidar, azimuth, lowest[:, None] + 0.0 * turn, reach[:, None])


def _least(clearance_m: FloatArray) -> FloatArray:
    """(ray, gate) least of the beams (ray, beam, gate) of a ray; NaN where none is known."""
    least = np.min(np.where(np.isnan(clearance_m), np.inf, clearance_m), axis=1)
    return np.where(np.isinf(least), np.nan, least)


def _first(entry_m: FloatArray) -> FloatArray:
    """(ray,) nearest entry of the beams (ray, beam) of a ray; NaN where none enters."""
    first = np.min(np.where(np.isnan(entry_m), np.inf, entry_m), axis=1)
    return np.where(np.isinf(first), np.nan, first)
