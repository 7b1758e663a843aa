"""A virtual campaign at a site: what its lidars and its mast would have recorded, with the truth beside it."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from geometry.angles import SectorSet
from geometry.arrays import FloatArray
from geometry.errors import InputError
from planner.exclusion import wanted_directions
from planner.ground import ground_under_m
from planner.plan import Plan
from planner.ray_sets import sector_rays
from planner.scan_layout import ScanLayout
from planner.signal_noise import ray_noise
from planner.site import Site
from planner.wind_climate import ROSE_STEP_DEG, climate_at, error_sources, state_like, turbulence
from reconstruct.averaging import TimeArray
from reconstruct.radial_speed import power_law_mps
from reconstruct.rays import Rays
from reconstruct.records import Records
from reconstruct.sweep_ids import sweep_ids
from reconstruct.virtual import Flown, VirtualScan, VirtualSettings, fly
from reconstruct.wind import WindState, from_deg, scalar_mean, vector_mean

PERIODS_PER_DAY = 144
START_UTC = "2024-01-01T00:00:00"

# What a lidar's rays look like where nothing is said about its echo.
CNR_DB, CNR_STD_DB = -12.0, 1.0
# Noise that the instrument takes for an echo: faint, and any speed that it can tell.
NOISE_CNR_DB, NOISE_SPEED_MPS = -29.0, 30.0
# The study lost 0.3 to 2 % of its rays to limits of CNR and radial speed.
LOST_SHARE = 0.003

Progress = Callable[[float], None]


class Options(NamedTuple):
    """How a virtual campaign is made."""

    days: float = 1.0
    seed: int = 1
    start_utc: str = START_UTC
    lost_share: float = LOST_SHARE
    settings: VirtualSettings = VirtualSettings()


class MastSamples(NamedTuple):
    """What a cup and a vane at the reference target would have shown in one period, two samples a second."""

    time_utc: TimeArray  # (sample,)
    uv_mps: FloatArray  # (sample, 2)


class Part(NamedTuple):
    """One averaging period of a virtual campaign."""

    records: dict[str, Records]  # by scan
    mast: MastSamples
    state: WindState


@dataclass(frozen=True)
class Virtual:
    """The scans of a site that can be flown, and the states of the wind that they will meet."""

    layouts: tuple[ScanLayout, ...]
    target: str  # of the mast: the reference
    states: tuple[WindState, ...]
    scans: tuple[VirtualScan, ...]
    periods_s: float = 600.0


def virtual(plan: Plan, options: Options) -> Virtual:
    """Prepare a virtual campaign of all scans that measure wind at a target.

    Raises
    ------
    InputError
        If no scan does, or the number of days is not positive.
    """
    layouts = tuple(layout for layout in plan.layouts if layout.measures_wind and layout.targets)
    if not layouts:
        raise InputError("no scan of the site measures wind at a target: there is nothing to simulate")
    periods = round(options.days * PERIODS_PER_DAY)
    if periods < 1:
        raise InputError(f"{options.days:g} days came: give at least one ten-minute period, 0.007 days")
    target = layouts[0].targets[0]
    rng = np.random.default_rng([options.seed, 2])
    states = draw_states(plan.site, target, _excluded(plan, target), periods, rng)
    return Virtual(layouts, target, states, tuple(_virtual_scan(plan, layout, target) for layout in layouts))


def told_scans(plan: Plan) -> tuple[str, ...]:
    """What a virtual campaign leaves out of the site's scans, or flies in part, a sentence each, with the reason."""
    told = []
    for layout in plan.layouts:
        name, spec = layout.name, layout.spec
        if not layout.measures_wind:
            told.append(f"{name}: left out, as it looks for a hard target, not for wind")
        elif not layout.targets:
            told.append(f"{name}: left out, as it has no target: give it one, whose gate is then flown")
        elif spec.type in ("points", "rhi", "raster"):
            told.append(f"{name}: every ray is flown at the gate of {layout.targets[0]} alone, no other gate")
    return tuple(told)


def draw_states(
    site: Site, target: str, excluded: SectorSet, count: int, rng: np.random.Generator
) -> tuple[WindState, ...]:
    """Draw states of the wind at a target from the site's climate.

    Parameters
    ----------
    site
        With its wind.
    target
        Where the speeds hold.
    excluded
        Directions that do not count where the site declares none.
    count
        Number of states.
    rng
        Source of the numbers.

    Returns
    -------
    tuple of WindState
        In random order.

    Notes
    -----
    A Latin hypercube (McKay, Beckman & Conover 1979, Technometrics 21, 239-245): each of `count` equal shares
    of the speeds' distribution, and of the directions', is drawn from once, so that a short campaign stands
    for the climate as well as it can. A rose is drawn from sector by sector.
    """
    like = state_like(site, target)
    wind = site.assumed_wind
    share = _shares(count, rng)
    if wind.rose is not None or wind.weibull is None:
        speeds, directions = _from_states(site, target, excluded, share, rng)
    else:
        wanted = wanted_directions(site) if wind.directions_deg is not None else excluded.complement()
        scale_mps, shape = wind.weibull.scale_mps, wind.weibull.shape
        low, high = (-np.expm1(-((limit / scale_mps) ** shape)) for limit in wind.speed_range_mps)
        at_reference = scale_mps * (-np.log1p(-(low + (high - low) * share))) ** (1 / shape)
        speeds = at_reference * _growth(site, like.height_m)
        directions = _within(wanted, _shares(count, rng))
    return tuple(
        replace(like, speed_mps=float(speed), from_deg=float(angle))
        for speed, angle in zip(speeds, directions, strict=True)
    )


def campaign_parts(campaign: Virtual, plan: Plan, options: Options) -> Iterator[Part]:
    """Fly a virtual campaign, period by period."""
    start = np.datetime64(options.start_utc, "ns")
    flown = fly(
        campaign.scans,
        campaign.states,
        turbulence=turbulence(plan.site),
        seed=options.seed,
        settings=options.settings,
    )
    rng = np.random.default_rng([options.seed, 3])
    for period in flown:
        begin = start + np.timedelta64(round(period.index * campaign.periods_s * 1e9), "ns")
        records = {
            layout.name: _records(plan, layout, scan.rays, speeds, begin, options, rng)
            for layout, scan, speeds in zip(
                campaign.layouts, campaign.scans, period.radial_speed_mps, strict=True
            )
        }
        yield Part(records, _mast(period, begin, campaign.periods_s), period.state)


def true_means(part: Part) -> dict[str, object]:
    """One row of the table of truths: the state that was drawn, and what the target's own air did in the period."""
    time, (u, v) = part.mast.time_utc, part.mast.uv_mps.T
    mean_u, mean_v = vector_mean(u, v)
    return {
        "time_utc": time[-1] + (time[1] - time[0]) / 2,
        "state_speed_mps": part.state.speed_mps,
        "state_from_deg": part.state.from_deg,
        "speed_mps": float(scalar_mean(u, v)),
        "vector_speed_mps": float(np.hypot(mean_u, mean_v)),
        "from_deg": float(from_deg(mean_u, mean_v)),
    }


def _excluded(plan: Plan, target: str) -> SectorSet:
    """Directions in which a wake touches what any scan measures at the target."""
    sets = [item.excluded for item in plan.exclusions if item.target == target]
    return SectorSet.of(sector for each in sets for sector in each.sectors)


def _virtual_scan(plan: Plan, layout: ScanLayout, reference: str) -> VirtualScan:
    site, places = plan.site, plan.places
    target = layout.targets[0]
    here, there = (np.array(site.target_position_m(name)) for name in (target, reference))
    height_m = here[2] - float(ground_under_m(site, here))
    ratio = _growth(site, height_m) / _growth(site, float(there[2] - ground_under_m(site, there)))
    noise_mps = ray_noise(site, layout, target).noise_mps
    return VirtualScan(
        rays=sector_rays(places, layout, layout.scan, target),
        offset_m=places.frame.enu_m(there, here),
        speed_ratio=ratio,
        height_m=float(height_m),
        sources=error_sources(layout.lidar, noise_mps),
        lidar=layout.lidar_index,
    )


def _growth(site: Site, height_m: float) -> float:
    """Speed at a height above ground over that at the reference height of the site's wind."""
    wind = site.assumed_wind
    reference_m = wind.reference_height_m or height_m
    speed = power_law_mps(
        height_m, speed_mps=1.0, reference_height_m=reference_m, exponent=wind.shear_exponent
    )
    return float(speed)


def _shares(count: int, rng: np.random.Generator) -> FloatArray:
    """One random number in each of `count` equal parts of (0, 1), in random order."""
    return np.asarray((rng.permutation(count) + rng.uniform(size=count)) / count)


def _within(directions: SectorSet, share: FloatArray) -> FloatArray:
    """Directions that stand at given shares of a set's width [deg]."""
    widths = np.array([sector.width_deg for sector in directions.sectors])
    starts = np.array([sector.from_deg for sector in directions.sectors])
    if not len(widths):
        raise InputError("no wind direction is free of wakes: give wind.directions_deg")
    ends = np.cumsum(widths)
    at = share * ends[-1]
    number = np.minimum(np.searchsorted(ends, at, side="right"), len(ends) - 1)
    return np.asarray((starts[number] + at - (ends[number] - widths[number])) % 360.0)


def _from_states(
    site: Site, target: str, excluded: SectorSet, share: FloatArray, rng: np.random.Generator
) -> tuple[FloatArray, FloatArray]:
    """Speeds and directions chosen from the climate's states by their weight; a rose's directions spread over their piece."""
    climate = climate_at(site, target, excluded)
    order = np.argsort(rng.uniform(size=climate.count))
    ends = np.cumsum(climate.weight[order])
    chosen = order[np.minimum(np.searchsorted(ends, share * ends[-1], side="right"), climate.count - 1)]
    directions = climate.from_deg[chosen]
    if site.assumed_wind.rose is not None:
        spread = (directions + rng.uniform(-0.5, 0.5, len(directions)) * ROSE_STEP_DEG) % 360.0
        inside = wanted_directions(site).contains(spread)
        directions = np.where(inside, spread, directions)
    return climate.speed_mps[chosen], directions


def _records(
    plan: Plan,
    layout: ScanLayout,
    rays: Rays,
    speeds: FloatArray,
    begin: np.datetime64,
    options: Options,
    rng: np.random.Generator,
) -> Records:
    """The rays of one period as the instrument would store them: head angles, in the order of time."""
    seconds = rays.times_s(len(speeds)).ravel()
    order = np.argsort(seconds, kind="stable")
    ray = np.tile(np.arange(rays.count), len(speeds))[order]
    azimuth, elevation = layout.mounting.to_head(layout.scan.azimuth_deg, layout.scan.elevation_deg)
    gate_m = float(
        layout.mounting.head_range_m(layout.measured_range_m(layout.range_to_m(layout.targets[0])))
    )
    measured, cnr = _with_noise(plan, layout, speeds.ravel()[order], options.lost_share, rng)
    return Records(
        time_utc=begin + (seconds[order] * 1e9).round().astype("timedelta64[ns]"),
        duration_s=rays.duration_s[ray],
        azimuth_deg=azimuth[ray],
        elevation_deg=elevation[ray],
        scan_id=np.zeros(len(ray), dtype=np.intp),
        sweep_id=np.arange(len(ray)),  # numbered when the periods are joined
        range_m=np.array([gate_m]),
        radial_speed_mps=measured[:, None],
        cnr_db=cnr[:, None],
        instrument=layout.lidar.name,
    )


def _with_noise(
    plan: Plan, layout: ScanLayout, speeds: FloatArray, lost_share: float, rng: np.random.Generator
) -> tuple[FloatArray, FloatArray]:
    """Radial speeds and CNR, with some rays that are noise instead."""
    known_db = ray_noise(plan.site, layout, layout.targets[0]).cnr_db
    cnr = rng.normal(CNR_DB if known_db is None else known_db, CNR_STD_DB, len(speeds))
    lost = rng.uniform(size=len(speeds)) < lost_share
    faint = rng.normal(NOISE_CNR_DB, CNR_STD_DB, len(speeds))
    wild = rng.uniform(-NOISE_SPEED_MPS, NOISE_SPEED_MPS, len(speeds))
    return np.where(lost, wild, speeds), np.where(lost, faint, cnr)


def _mast(period: Flown, begin: np.datetime64, period_s: float) -> MastSamples:
    count = len(period.reference_mps)
    step = period_s / count
    seconds = (np.arange(count) + 0.5) * step
    return MastSamples(begin + (seconds * 1e9).round().astype("timedelta64[ns]"), period.reference_mps)


def joined(parts: Sequence[Records]) -> Records:
    """Consecutive records of one scan as one."""
    first = parts[0]
    arrays: dict[str, Any] = {
        name: np.concatenate([getattr(part, name) for part in parts])
        for name in (*first.ray_fields(), *first.gate_fields())
    }
    azimuth, elevation = arrays["azimuth_deg"], arrays["elevation_deg"]
    still = np.ptp(azimuth) + np.ptp(elevation) == 0  # every ray of a stare is a pass: it can be cut anywhere
    arrays["sweep_id"] = np.arange(len(azimuth)) if still else sweep_ids(azimuth, elevation)
    return replace(first, **arrays)
