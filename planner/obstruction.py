"""Which rays of each scan meet a rotor, a tower, a mast or an obstacle on their way to the gate."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from geometry.arrays import ArrayLike, BoolArray, FloatArray
from geometry.sightlines import clearance
from geometry.solids import Boxes, Cylinders, Solids, Spheres
from planner.places import Places
from planner.scan_layout import ScanLayout
from planner.scan_plans import PointsScan, RasterScan
from planner.site import Lidar, Site

# A beam is called near where it passes within this many standard deviations of its own position.
MARGIN_STDS = 2.0

Seen = Callable[[ArrayLike], FloatArray]  # positions of the site in the lidar's own frame


@dataclass(frozen=True, eq=False)
class Obstruction:
    """One scan and one solid thing that its rays come near to."""

    scan: str
    thing: str
    part: str  # rotor, tower, mast or obstacle
    rays: int
    lost: BoolArray  # (ray,) True where the ray touches
    lost_azimuth_deg: FloatArray  # (lost ray,) true
    clearance_m: float  # smallest over the rays; negative is the depth inside
    range_m: float  # where it is smallest
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
        found
        for layout in layouts
        for things in _around(places, layout)
        for found in _of_kind(layout, things)
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
