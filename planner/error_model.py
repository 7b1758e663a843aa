"""With which wind, errors and air a scan's error is predicted; the effects that are left out are already gone."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from geometry.angles import SectorSet
from geometry.errors import InputError
from geometry.scan import Scan
from planner.exclusion import Exclusion
from planner.fidelity_wind import Air
from planner.places import Places
from planner.ray_sets import pair_rays, sector_rays
from planner.scan_layout import ScanLayout
from planner.signal_noise import ray_noise
from planner.site import Pair, Site
from planner.wind_climate import climate_at, error_sources, state_like, turbulence
from reconstruct.climate import Climate
from reconstruct.prediction import Tier
from reconstruct.rays import Rays
from reconstruct.spectra import Turbulence
from reconstruct.ten_minute import Reference
from reconstruct.uncertainty import ErrorSources
from reconstruct.wind import WindState

REFERENCE: Reference = "scalar"  # a cup

# States of the climate that the Monte Carlo tier goes through: each costs seconds.
SIMULATED_SPEEDS, SIMULATED_DIRECTIONS = 3, 4


@dataclass(frozen=True)
class Model:
    """How the error is predicted: wind, errors and air, with the effects that are left out already gone."""

    tier: Tier
    climate: Climate
    states: tuple[WindState, ...]
    sources: tuple[ErrorSources, ...]
    eddies: Turbulence | None
    sweep: bool
    point_probe: bool

    @classmethod
    def of(
        cls,
        site: Site,
        target: str,
        excluded: SectorSet,
        layouts: Sequence[ScanLayout],
        tier: Tier,
        left_out: frozenset[str],
    ) -> "Model":
        climate = climate_at(site, target, excluded)
        if tier == "monte-carlo":
            climate = climate_at(
                site, target, excluded, speeds=SIMULATED_SPEEDS, directions=SIMULATED_DIRECTIONS
            )
        like = state_like(site, target)
        if "shear" in left_out:
            like = replace(like, shear_exponent=0.0)
        if "vertical-wind" in left_out:
            like = replace(like, vertical_mps=0.0)
        sources = [
            error_sources(layout.lidar, ray_noise(site, layout, target).noise_mps) for layout in layouts
        ]
        if "pointing-noise" in left_out:
            sources = [ErrorSources(radial_speed_mps=each.radial_speed_mps) for each in sources]
        return cls(
            tier=tier,
            climate=climate,
            states=tuple(climate.states(like)),
            sources=tuple(sources),
            eddies=required_turbulence(site, tier),
            sweep="scan-motion" not in left_out,
            point_probe="probe-averaging" in left_out,
        )


def required_turbulence(site: Site, tier: Tier) -> Turbulence | None:
    if tier in ("noise", "linear"):
        return None
    eddies = turbulence(site)
    if eddies is None:
        raise InputError(
            f"the {tier} tier needs the turbulence of the air, and the site does not give it: add "
            "wind.turbulence {intensity, length_m}, or take --tier linear"
        )
    return eddies


def air_of_scan(places: Places, layout: ScanLayout, scan: Scan, exclusion: Exclusion) -> Air:
    """What the size of an effect on a sector scan is judged with; `scan` is the declared one or another size of it."""
    rays = sector_rays(places, layout, scan, exclusion.target)
    name = f"{layout.name}, {scan.count} rays"
    return _air(name, places.site, exclusion.target, exclusion.excluded, rays, [layout])


def air_of_pair(places: Places, pair: Pair, layouts: tuple[ScanLayout, ...], excluded: SectorSet) -> Air:
    """What the size of an effect on a pair is judged with."""
    rays = pair_rays(places, layouts, pair.target, columns=pair.fit_columns)
    return _air(pair.name, places.site, pair.target, excluded, rays, layouts)


def _air(
    name: str, site: Site, target: str, excluded: SectorSet, rays: Rays, layouts: Sequence[ScanLayout]
) -> Air:
    """The climate's mean speed from each of its directions."""
    climate = climate_at(site, target, excluded)
    like = replace(state_like(site, target), speed_mps=climate.mean(climate.speed_mps))
    states = [replace(like, from_deg=float(angle)) for angle in np.unique(climate.from_deg)]
    sources = [error_sources(layout.lidar, ray_noise(site, layout, target).noise_mps) for layout in layouts]
    return Air(name, rays, states, sources, turbulence(site))
