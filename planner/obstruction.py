"""Which rays of each scan meet a rotor, a tower, a mast, an obstacle or the ground on their way to the gate."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from geometry.arrays import ArrayLike, BoolArray, FloatArray
from geometry.head import Mounting
from geometry.sightlines import clearance
from geometry.solids import Boxes, Cylinders, Solids, Spheres
from planner.places import Places
from planner.scan_layout import ScanLayout
from planner.scan_plans import PointsScan, RasterScan
from planner.site import Lidar, Site
from reconstruct.sea_level import SEEN_RADIUS_M, sea_range_m

# A beam is called near where it passes within this many standard deviations of its own position.
MARGIN_STDS = 2.0

Seen = Callable[[ArrayLike], FloatArray]  # positions of the site in the lidar's own frame


@dataclass(frozen=True, eq=False)
class Obstruction:
    """One scan and one solid thing that its rays come near to."""

    scan: str
    thing: str
    part: str  # rotor, tower, mast, obstacle or ground
    rays: int
    lost: BoolArray  # (ray,) True where the ray touches
    lost_azimuth_deg: FloatArray  # (lost ray,) true
    lost_elevation_deg: FloatArray  # (lost ray,) above the horizontal at the head
    clearance_m: float  # smallest over the rays; negative is the depth inside
    range_m: float  # where it is smallest; of the ground, where the first of the lost rays meets it
    margin_m: float  # how far the beam may be off there: twice its pointing and position uncertainty

    @property
    def lost_rays(self) -> int:
        """Number of lost rays."""
        return int(self.lost.sum())


class _Things(NamedTuple):
    """Solids of one kind around a scan, in its lidar's own east-north-up frame."""

    part: str
    names: list[str]
    solids: Solids


def obstructions(places: Places, layouts: tuple[ScanLayout, ...]) -> tuple[Obstruction, ...]:
    """Everything that a ray of some scan touches or passes within its margin."""
    return tuple(
        found for layout in layouts for found in (*_of_solids(places, layout), *_of_ground(places, layout))
    )


def reach_m(layout: ScanLayout) -> FloatArray:
    """How far along each ray a scan wants to see: its target's gate and half a probe, else its last gate.

    Returns
    -------
    FloatArray
        (ray,) [m]; in a list of points each ray has its own.
    """
    ranges = np.array([layout.measured_range_m(float(value)) for value in layout.aim.range_m])
    half_m = layout.probe.length_m / 2
    if isinstance(layout.spec, PointsScan):
        return ranges + half_m
    last_m = layout.gates.last_m if layout.gates else 0.0
    return np.full(layout.scan.count, (ranges.max() if ranges.size else last_m) + half_m)


def lost_ranges_m(met: Sequence[Obstruction], layout: ScanLayout) -> FloatArray:
    """Where each ray of a scan first meets something solid.

    Returns
    -------
    FloatArray
        (ray,) slant range [m]; infinite for a free ray.
    """
    lost_m = np.full(layout.scan.count, np.inf)
    for item in met:
        if item.scan == layout.name:
            lost_m = np.where(item.lost, np.minimum(lost_m, item.range_m), lost_m)
    return lost_m


def margin_m(lidar: Lidar, range_m: float) -> float:
    """How far a lidar's beam may be off at a range [m]: two standard deviations of pointing and position.

    The worse of both directions counts: azimuth and heading to the side, elevation and levelling in height.

    Examples
    --------
    >>> lidar = Lidar(name="A", position=(0.0, 0.0, 0.0), instrument="windscanner-200s")
    >>> round(margin_m(lidar, 1000.0), 2)
    2.48
    """
    unsure = lidar.uncertainty
    sideways_deg = np.hypot(unsure.azimuth_deg, unsure.heading_deg)
    upright_deg = np.hypot(unsure.elevation_deg, unsure.levelling_deg)
    off_m = np.deg2rad(max(sideways_deg, upright_deg)) * range_m
    return MARGIN_STDS * float(np.hypot(unsure.position_m, off_m))


def ground_met_m(height_m: float, elevation_deg: ArrayLike) -> FloatArray:
    """Where beams first meet level ground that curves with the Earth: the same as over the sea, refraction included.

    Parameters
    ----------
    height_m
        Height of the head above the ground [m], at least 0.
    elevation_deg
        (...,) elevations [deg], upwards positive.

    Returns
    -------
    FloatArray
        (...,) slant range [m], the smaller root r of h + r sin φ + (1 - k)(r cos φ)²/2R = 0; infinite where the beam
        stays above the ground.

    Examples
    --------
    >>> ground_met_m(10.0, [-1.0, -0.05, 0.0, 3.0]).round(1).tolist()
    [574.3, inf, inf, inf]
    """
    met = sea_range_m(0.0, elevation_deg, height_m=height_m, mounting=Mounting(), radius_m=SEEN_RADIUS_M)
    return np.where(np.isnan(met), np.inf, met)


def _of_ground(places: Places, layout: ScanLayout) -> Iterator[Obstruction]:
    """Rays that meet the level ground; where a terrain says that it is not level, see `planner.over_terrain`.

    A head that is declared a little below the ground stands on it. A target below the ground is a fault of
    its own.
    """
    site, scan = places.site, layout.scan
    targets_m = [site.target_position_m(name)[2] for name in layout.targets]
    if site.terrain is not None or any(height_m <= site.ground_m for height_m in targets_m):
        return
    height_m = max(layout.lidar.position[2] - site.ground_m, 0.0)
    lowest_deg = scan.elevation_deg - np.abs(scan.swept_elevation_deg) / 2
    met_m, wanted_m = ground_met_m(height_m, lowest_deg), reach_m(layout)
    lost = met_m < wanted_m
    if not lost.any():
        return
    elevation = np.deg2rad(lowest_deg)
    end_m = (
        height_m + wanted_m * np.sin(elevation) + (wanted_m * np.cos(elevation)) ** 2 / (2 * SEEN_RADIUS_M)
    )
    range_m = float(met_m[lost].min())
    yield Obstruction(
        scan=layout.name,
        thing="the ground",
        part="ground",
        rays=scan.count,
        lost=lost,
        lost_azimuth_deg=scan.azimuth_deg[lost],
        lost_elevation_deg=scan.elevation_deg[lost],
        clearance_m=min(float(end_m[lost].min()), 0.0),
        range_m=range_m,
        margin_m=margin_m(layout.lidar, range_m),
    )


def _of_solids(places: Places, layout: ScanLayout) -> Iterator[Obstruction]:
    """What a scan touches or nearly touches of everything that stands on the site."""
    for things in _around(places, layout):
        yield from _of_kind(layout, things)


def _of_kind(layout: ScanLayout, things: _Things) -> Iterator[Obstruction]:
    """What a scan touches or nearly touches of one kind of solids."""
    scan = layout.scan
    sight = clearance(
        np.zeros(3),
        scan.azimuth_deg,
        scan.elevation_deg,
        reach_m(layout),
        things.solids,
        swept_azimuth_deg=scan.swept_azimuth_deg,
        swept_elevation_deg=scan.swept_elevation_deg,
    )
    for number, name in enumerate(things.names):
        clear_m = sight.clearance_m[:, number]
        ray = int(np.argmin(clear_m))
        range_m = float(sight.range_m[ray, number])
        margin = margin_m(layout.lidar, range_m)
        if clear_m[ray] < margin:
            yield Obstruction(
                scan=layout.name,
                thing=name,
                part=things.part,
                rays=scan.count,
                lost=clear_m <= 0.0,
                lost_azimuth_deg=scan.azimuth_deg[clear_m <= 0.0],
                lost_elevation_deg=scan.elevation_deg[clear_m <= 0.0],
                clearance_m=float(clear_m[ray]),
                range_m=range_m,
                margin_m=margin,
            )


def _around(places: Places, layout: ScanLayout) -> Iterator[_Things]:
    """Everything solid around a scan, but for the mast that a raster is meant to hit."""
    site = places.site

    def seen(positions_m: ArrayLike) -> FloatArray:
        return places.frame.enu_m(layout.lidar.position, positions_m)

    if site.turbines:
        yield from _turbines(site, seen)
    masts = [mast for mast in site.masts if mast.name != _sought_mast(site, layout)]
    if masts:
        bases = seen([mast.position for mast in masts])
        radius = [mast.width_m / 2 for mast in masts]
        top = bases[:, 2] + [mast.height_m for mast in masts]
        yield _Things(
            "mast", [mast.name for mast in masts], Cylinders(bases[:, :2], radius, bases[:, 2], top)
        )
    if site.obstacles:
        yield _obstacles(site, seen, places.convergence_deg(layout.lidar))


def _sought_mast(site: Site, layout: ScanLayout) -> str | None:
    """The mast with the hard target that a raster looks for."""
    spec = layout.spec
    if not isinstance(spec, RasterScan) or spec.hard_target is None:
        return None
    return site.hard_target(spec.hard_target).on


def _turbines(site: Site, seen: Seen) -> Iterator[_Things]:
    """Rotors, which may face any wind, and towers."""
    names = [turbine.name for turbine in site.turbines]
    bases = seen([turbine.position for turbine in site.turbines])
    hub = np.array([turbine.hub_height_m for turbine in site.turbines])
    rotor = [turbine.rotor_diameter_m / 2 for turbine in site.turbines]
    tower = [turbine.tower_diameter_m / 2 for turbine in site.turbines]
    yield _Things("rotor", names, Spheres(bases + np.outer(hub, [0.0, 0.0, 1.0]), rotor))
    yield _Things("tower", names, Cylinders(bases[:, :2], tower, bases[:, 2], bases[:, 2] + hub))


def _obstacles(site: Site, seen: Seen, convergence_deg: float) -> _Things:
    """Boxes, turned from grid north to true north."""
    bases = seen([item.position for item in site.obstacles])
    boxes = Boxes(
        bases[:, :2],
        [item.width_m for item in site.obstacles],
        [item.length_m for item in site.obstacles],
        [item.azimuth_deg + convergence_deg for item in site.obstacles],
        bases[:, 2],
        bases[:, 2] + [item.height_m for item in site.obstacles],
    )
    return _Things("obstacle", [item.name for item in site.obstacles], boxes)
