"""The site's wind at a target as states with weights, and each lidar's errors, for the reconstruction."""

from collections.abc import Sequence

import numpy as np

from geometry.angles import SectorSet
from geometry.arrays import FloatArray
from geometry.errors import InputError
from planner.exclusion import wanted_directions
from planner.ground import ground_under_m
from planner.nouns import made_of
from planner.site import Lidar, Site
from planner.wind_rose import load_rose
from reconstruct.climate import DIRECTIONS, SPEEDS, Climate, listed_climate, rose_climate, weibull_climate
from reconstruct.spectra import Turbulence
from reconstruct.uncertainty import ErrorSources
from reconstruct.wind import WindState

RANGE_SPEEDS = 5  # speeds that stand for a range of which nothing more is known
ROSE_STEP_DEG = 10.0  # a rose's sectors are cut so fine for the climate
ROSE_SPEEDS = 5

GUST_STDS = 3.0  # standard deviations of a gust above the mean


def climate_at(
    site: Site,
    target: str,
    excluded: SectorSet,
    *,
    speeds: int = SPEEDS,
    directions: int = DIRECTIONS,
) -> Climate:
    """States of the wind at a target: declared directions, else all less the excluded ones.

    Speeds are carried from the reference height to the target's by the site's power law.

    Parameters
    ----------
    site, target
        The site and the name of the target.
    excluded
        Directions that wakes disturb [deg].
    speeds, directions
        Number of speeds and directions; a rose and listed speeds keep their own.

    Raises
    ------
    InputError
        If no direction or speed is left.
    """
    wind = site.assumed_wind
    declared = wind.directions_deg is not None
    wanted = wanted_directions(site) if declared else excluded.complement()
    if not wanted.sectors:
        raise InputError(
            "no wind direction is free of wakes: give wind.directions_deg, the directions that count all "
            "the same"
        )
    low_mps, high_mps = wind.speed_range_mps
    growth = _growth(site, target)
    sectors = [(start, stop) if start != stop else (0.0, 360.0) for start, stop in wanted.pairs()]
    if wind.rose is not None:
        at_reference = _from_rose(site, wanted)
    elif wind.weibull is not None:
        at_reference = weibull_climate(
            wind.weibull.scale_mps,
            wind.weibull.shape,
            speed_range_mps=(low_mps, high_mps),
            directions_deg=sectors,
            speeds=speeds,
            directions=directions,
        )
    elif wind.speeds_mps is not None:
        at_reference = listed_climate(wind.speeds_mps, directions_deg=sectors, directions=directions)
    else:
        at_reference = listed_climate(
            np.linspace(low_mps, high_mps, speeds), directions_deg=sectors, directions=directions
        )
    return Climate(at_reference.speed_mps * growth, at_reference.from_deg, at_reference.weight)


def state_like(site: Site, target: str) -> WindState:
    """A state of the wind at a target with everything but speed and direction."""
    wind = site.assumed_wind
    return WindState(
        speed_mps=1.0,
        from_deg=0.0,
        shear_exponent=wind.shear_exponent,
        height_m=height_above_ground_m(site, target),
        vertical_mps=wind.vertical_mps,
        lateral_gradient_per_s=wind.lateral_gradient_per_s,
    )


def height_above_ground_m(site: Site, target: str) -> float:
    """Height of a target above the ground [m].

    Raises
    ------
    InputError
        If it is not above the ground.
    """
    position = site.target_position_m(target)
    ground_m = float(ground_under_m(site, position))
    height_m = position[2] - ground_m
    if height_m <= 0:
        raise InputError(
            f"target {target} is {height_m:.1f} m above the ground at {ground_m:g} m; wind needs a "
            "target above it: check its height and ground_height_m"
        )
    return height_m


def largest_gust_mps(site: Site, targets: Sequence[str] = ()) -> float:
    """The fastest wanted wind and three standard deviations of its turbulence.

    Three standard deviations are passed by about one in a thousand samples of a Gaussian.

    Parameters
    ----------
    site
        With its wind.
    targets
        Where the wind is measured; the fastest counts. Without any above the ground, the wind at its
        reference height.

    Returns
    -------
    float
        Speed [m/s].
    """
    wind = site.assumed_wind
    fastest_mps = max(wind.speeds_mps) if wind.speeds_mps else wind.speed_range_mps[1]
    intensity = 0.0 if wind.turbulence is None else wind.turbulence.intensity
    positions = {target: site.target_position_m(target) for target in targets}
    above = [name for name, place in positions.items() if place[2] > float(ground_under_m(site, place))]
    growth = max((_growth(site, target) for target in above), default=1.0)
    return fastest_mps * growth * (1 + GUST_STDS * intensity)


def turbulence(site: Site) -> Turbulence | None:
    """The site's turbulence; None where it is not declared."""
    declared = site.assumed_wind.turbulence
    if declared is None:
        return None
    return Turbulence(declared.intensity, declared.length_m, declared.model, declared.gamma)


def error_sources(lidar: Lidar, noise_mps: float) -> ErrorSources:
    """What can be wrong with a lidar, as standard deviations; the noise depends on the scan."""
    return made_of(lidar.uncertainty, ErrorSources, radial_speed_mps=noise_mps)


def _growth(site: Site, target: str) -> float:
    """Speed at the target over speed at the reference height."""
    wind = site.assumed_wind
    if wind.reference_height_m is None:
        return 1.0
    return float((height_above_ground_m(site, target) / wind.reference_height_m) ** wind.shear_exponent)


def _from_rose(site: Site, wanted: SectorSet) -> Climate:
    """States of a measured rose: its sectors cut into pieces, each with its own distribution of speeds."""
    wind = site.assumed_wind
    if wind.rose is None:
        raise InputError("the site has no wind rose")
    rose = load_rose(wind.rose)
    speeds, angles, shares = [], [], []
    for number, sector in enumerate(rose.sectors):
        speed, weight = _sector_speeds(site, number)
        pieces = max(int(np.ceil(sector.width_deg / ROSE_STEP_DEG)), 1)
        middles = sector.from_deg + (np.arange(pieces) + 0.5) * sector.width_deg / pieces
        kept = wanted.contains(middles % 360.0)
        for middle in middles[kept]:
            speeds.append(speed)
            angles.append(np.full(len(speed), middle % 360.0))
            shares.append(weight * rose.share[number] / pieces)
    if not speeds:
        raise InputError("no direction of the wind rose is within the wanted directions")
    return rose_climate(np.concatenate(speeds), np.concatenate(angles), np.concatenate(shares))


def _sector_speeds(site: Site, number: int) -> tuple[FloatArray, FloatArray]:
    """Speeds and weights of one sector of the rose: by its Weibull, else the site's speed range alike."""
    wind = site.assumed_wind
    rose = load_rose(wind.rose) if wind.rose is not None else None
    if rose is None or rose.weibull_scale_mps is None or rose.weibull_shape is None:
        speeds = np.linspace(*wind.speed_range_mps, RANGE_SPEEDS)
        return speeds, np.full(len(speeds), 1.0 / len(speeds))
    scale_mps, shape = float(rose.weibull_scale_mps[number]), float(rose.weibull_shape[number])
    found = weibull_climate(
        scale_mps, shape, speed_range_mps=wind.speed_range_mps, directions=1, speeds=ROSE_SPEEDS
    )
    low, high = (np.exp(-((limit_mps / scale_mps) ** shape)) for limit_mps in wind.speed_range_mps)
    return found.speed_mps, found.weight * (low - high)  # a sector of weak winds has fewer that count
