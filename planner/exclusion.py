"""Which wind directions are free of wakes, for what each scan measures, and how much of the wind is lost."""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from geometry.angles import Sector, SectorSet
from geometry.arrays import FloatArray
from geometry.disturbed import any_of, distance_over_diameter, iec_excluded, jensen_excluded
from geometry.errors import InputError
from geometry.wakes import Rotors, deficit, equivalent_diameter_m
from planner.places import Places
from planner.scan_layout import ScanLayout, volume_m
from planner.site import Site
from planner.wind_rose import share_within

DEFICIT_STEP_DEG = 1.0


class Near(NamedTuple):
    """How far something with a wake stands from what a scan measures, in its own (equivalent) diameters."""

    name: str
    is_rotor: bool
    volume_diameters: float  # from the nearest of the measured volume, horizontally
    target_diameters: float  # from the target


@dataclass(frozen=True, eq=False)
class Exclusion:
    """What wakes take from one scan at one target; directions are where the wind comes from, true."""

    lidar: str
    scan: str
    target: str
    model: str  # jensen, iec or union
    range_m: float
    by_source: tuple[tuple[str, str, SectorSet], ...]  # (turbine or obstacle, jensen or iec, its directions)
    wanted: SectorSet  # the wind that counts, before wakes
    point: SectorSet  # excluded at the target alone, by the same model
    lost_share: float  # of the wanted wind, by frequency
    deficit: FloatArray  # (direction,) share of the speed that all Jensen wakes take at the target, from 0°

    @cached_property
    def excluded(self) -> SectorSet:
        """Directions in which some wake touches the measured volume."""
        return any_of(sectors for _, _, sectors in self.by_source)

    @property
    def free(self) -> SectorSet:
        """Directions in which none does."""
        return self.excluded.complement()

    @property
    def lost(self) -> SectorSet:
        """Wanted directions in which some wake touches the measured volume."""
        return self.wanted.intersection(self.excluded)

    @property
    def lost_at_target(self) -> SectorSet:
        """Wanted directions in which some wake touches the target itself."""
        return self.wanted.intersection(self.point)

    def of_model(self, model: str) -> SectorSet:
        """Directions excluded by one of the two models alone."""
        return any_of(sectors for _, name, sectors in self.by_source if name == model)


def exclusions(places: Places, layouts: tuple[ScanLayout, ...]) -> tuple[Exclusion, ...]:
    """The exclusion of every scan that measures wind, at each of its targets."""
    return tuple(
        exclude(places, layout, target)
        for layout in layouts
        if layout.measures_wind
        for target in layout.targets
    )


def exclude(places: Places, layout: ScanLayout, target: str) -> Exclusion:
    """Find the wind directions in which a wake touches what one scan measures at one target.

    Parameters
    ----------
    places
        Where the site's things stand.
    layout
        The scan.
    target
        One of its targets.

    Returns
    -------
    Exclusion
        By the site's wake model.

    Raises
    ------
    InputError
        If the wind rose has no wind in the wanted directions.
    """
    site = places.site
    target_m = places.local_m(site.target_position_m(target))
    by_source = _disturbing(places, volume_m(places, layout, target))
    wanted = wanted_directions(site)
    return Exclusion(
        lidar=layout.lidar.name,
        scan=layout.name,
        target=target,
        model=site.wakes.model,
        range_m=layout.measured_range_m(layout.range_to_m(target)),
        by_source=by_source,
        wanted=wanted,
        point=any_of(sectors for _, _, sectors in _disturbing(places, target_m.reshape(1, 3))),
        lost_share=_lost_share(site, wanted, any_of(sectors for _, _, sectors in by_source)),
        deficit=deficit(
            places.rotors,
            target_m,
            np.arange(0.0, 360.0, DEFICIT_STEP_DEG),
            decay=site.wakes.decay,
            max_diameters=site.wakes.max_diameters,
        ),
    )


def wanted_directions(site: Site) -> SectorSet:
    """The wind directions that count: those declared, else all.

    Examples
    --------
    >>> wanted_directions(Site(name="Moor", crs="EPSG:32632")).pairs()
    [(0.0, 360.0)]
    """
    declared = None if site.wind is None else site.wind.directions_deg
    if declared is None:
        return SectorSet.full()
    return SectorSet.of(Sector.between(start, stop) for start, stop in declared)


def near_wakes(places: Places, layout: ScanLayout, target: str) -> tuple[Near, ...]:
    """Horizontal distance of each turbine and obstacle from what a scan measures at a target, and from it."""
    site = places.site
    names = [(turbine.name, True) for turbine in site.turbines]
    names += [(obstacle.name, False) for obstacle in site.obstacles]
    rotors = _with_obstacles(places)
    at_volume = distance_over_diameter(rotors, volume_m(places, layout, target))
    at_target = distance_over_diameter(rotors, places.local_m(site.target_position_m(target)))
    return tuple(
        Near(name, is_rotor, float(volume), float(point))
        for (name, is_rotor), volume, point in zip(names, at_volume, at_target, strict=True)
    )


def _lost_share(site: Site, wanted: SectorSet, excluded: SectorSet) -> float:
    """Share of the wanted wind that comes from excluded directions."""
    all_of_it = share_within(site, wanted)
    if all_of_it == 0.0:
        raise InputError(
            f"the wind rose has no wind from the wanted directions {wanted.pairs()}; give "
            "wind.directions_deg from which the wind blows"
        )
    return share_within(site, wanted.intersection(excluded)) / all_of_it


def _disturbing(places: Places, volume: FloatArray) -> tuple[tuple[str, str, SectorSet], ...]:
    """Directions that each turbine (in IEC's model also each obstacle) disturbs: name, model, directions."""
    wakes = places.site.wakes
    turbines = [turbine.name for turbine in places.site.turbines]
    found: list[tuple[str, str, SectorSet]] = []
    if wakes.model in ("jensen", "union"):
        sets = jensen_excluded(places.rotors, volume, decay=wakes.decay, max_diameters=wakes.max_diameters)
        found += [(name, "jensen", sectors) for name, sectors in zip(turbines, sets, strict=True)]
    if wakes.model in ("iec", "union"):
        names = turbines + [obstacle.name for obstacle in places.site.obstacles]
        sets = iec_excluded(_with_obstacles(places), volume, max_diameters=wakes.max_diameters)
        found += [(name, "iec", sectors) for name, sectors in zip(names, sets, strict=True)]
    return tuple(item for item in found if item[2].sectors)


def _with_obstacles(places: Places) -> Rotors:
    """Rotors and, as rotors of their equivalent diameter, the obstacles (IEC 61400-12-1:2017, Annex A)."""
    obstacles, rotors = places.site.obstacles, places.rotors
    if not obstacles:
        return rotors
    height_m = [item.height_m for item in obstacles]
    broadside_m = [max(item.width_m, item.length_m) for item in obstacles]
    return Rotors(
        np.vstack([rotors.hub_m, places.local_m([item.position for item in obstacles])]),
        np.append(rotors.diameter_m, equivalent_diameter_m(height_m, broadside_m)),
        np.append(rotors.thrust_coefficient, np.zeros(len(obstacles))),
    )
