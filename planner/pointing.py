"""Where each lidar points for each target: azimuth from true north, grid north and as the head counts it."""

from typing import NamedTuple

import numpy as np

from geometry.angles import wrap_360_deg
from geometry.beams import beam_to
from geometry.earth import refraction_lift_m
from geometry.errors import InputError
from planner.over_terrain import State, target_sight
from planner.places import Places
from planner.scan_layout import ScanLayout
from planner.site import Lidar


class Pointing(NamedTuple):
    """One lidar and one target; angles of the straight line, on the exact ellipsoid."""

    lidar: str
    target: str
    azimuth_true_deg: float
    azimuth_grid_deg: float
    azimuth_head_deg: float
    elevation_deg: float  # above the horizontal at the head, of the straight line
    elevation_head_deg: float
    range_m: float
    gate_index: int | None  # of the lidar's scan at this target; None where no gate reaches it
    gate_centre_m: float | None
    convergence_deg: float
    refraction_deg: float  # to add to the elevation: the beam bends down by so much; not in elevation_deg
    scan: str | None
    terrain: State | None  # whether ground, canopy and buildings leave the way clear; None without terrain
    terrain_clearance_m: float | None  # above them where the beam passes them nearest as seen from the head
    terrain_distance_m: float | None  # level, from the head to there


def pointings(places: Places, layouts: tuple[ScanLayout, ...]) -> tuple[Pointing, ...]:
    """Point every lidar at every target, in the order of the site file.

    Raises
    ------
    InputError
        If the site has no lidar or no target.
    """
    site = places.site
    if not site.lidars or not site.targets:
        raise InputError(
            f"the site has {len(site.lidars)} lidars and {len(site.targets)} targets; pointing needs at "
            "least one of each: add them to the site file"
        )
    return tuple(
        point(places, lidar, target.name, _scan_at(layouts, lidar.name, target.name))
        for lidar in site.lidars
        for target in site.targets
    )


def point(places: Places, lidar: Lidar, target: str, layout: ScanLayout | None) -> Pointing:
    """Point one lidar at one target (or hard target), always by the exact model.

    Parameters
    ----------
    places
        Where the site's things stand.
    lidar
        Which one points.
    target
        Name of a target or hard target.
    layout
        The lidar's scan at it, for the gate; None without one.

    Returns
    -------
    Pointing
        Angles from true north, grid north and as the head shows them.
    """
    position = places.site.target_position_m(target)
    beam = beam_to(places.frame.enu_m(lidar.position, position))
    azimuth_deg, elevation_deg, range_m = (float(value) for value in beam)
    head_azimuth, head_elevation = places.mounting(lidar).to_head(azimuth_deg, elevation_deg)
    convergence_deg = places.convergence_deg(lidar)
    gate = None if layout is None else _gate_around(layout, range_m)
    sight = target_sight(places, lidar, position)
    return Pointing(
        lidar=lidar.name,
        target=target,
        azimuth_true_deg=azimuth_deg,
        azimuth_grid_deg=float(wrap_360_deg(azimuth_deg - convergence_deg)),
        azimuth_head_deg=float(wrap_360_deg(head_azimuth)),
        elevation_deg=elevation_deg,
        elevation_head_deg=float(head_elevation),
        range_m=range_m,
        gate_index=None if gate is None else gate[0],
        gate_centre_m=None if gate is None else gate[1],
        convergence_deg=convergence_deg,
        refraction_deg=float(np.rad2deg(refraction_lift_m(range_m) / range_m)) if range_m else 0.0,
        scan=None if layout is None else layout.name,
        terrain=None if sight is None else sight.state,
        terrain_clearance_m=None if sight is None else sight.clearance_m,
        terrain_distance_m=None if sight is None else sight.distance_m,
    )


def _gate_around(layout: ScanLayout, range_m: float) -> tuple[int, float] | None:
    """Index and true centre [m] of the gate that a range lies in: half a spacing to each side of its centre."""
    gate = layout.gate_at(range_m)
    if gate is None or layout.gates is None:
        return None
    index, centre_m, offset_m = gate
    return None if abs(offset_m) > layout.gates.spacing_m / 2 * (1 + 1e-9) else (index, centre_m)


def _scan_at(layouts: tuple[ScanLayout, ...], lidar: str, target: str) -> ScanLayout | None:
    """The lidar's first scan that looks at the target."""
    return next((item for item in layouts if item.lidar.name == lidar and target in item.targets), None)
