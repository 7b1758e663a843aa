"""What a stay on a site yields: how many ten-minute values each scan or pair can keep, and where the rest goes."""

from typing import NamedTuple

import numpy as np

from geometry.angles import SectorSet
from geometry.disturbed import any_of
from geometry.errors import InputError
from planner.placement.yield_days import PERIODS_PER_DAY, Yield, expected_yield
from planner.plan import Plan
from planner.signal_noise import ray_noise
from planner.site import Site

ALL_SPEEDS_MPS = 1e3  # faster than any wind


class Stage(NamedTuple):
    """One thing that takes ten-minute values away."""

    name: str
    kept: float  # periods that are left after it
    share: float  # of those before it


class Stay(NamedTuple):
    """What a stay yields for one scan or pair."""

    scan: str  # of the pair, or of the sector scan
    target: str
    days: float
    stages: tuple[Stage, ...]
    found: Yield

    @property
    def values(self) -> float:
        """Valid ten-minute values to expect."""
        return float(self.found.expected.sum())

    @property
    def a_day(self) -> float:
        """The same for one day."""
        return self.values / self.days

    def days_for(self, values: float) -> float:
        """How long it takes to have so many values; inf where there never are any."""
        return values / self.a_day if self.a_day > 0 else float("inf")


def stays(plan: Plan, days: float, *, availability: float = 1.0) -> tuple[Stay, ...]:
    """Work out what a stay yields for every pair, then for every sector scan at each of its targets.

    Parameters
    ----------
    plan
        With its wind as a Weibull distribution, or as a rose with one for each sector.
    days
        Length of the stay.
    availability
        Share of the periods in the wanted wind, free of wakes and with a strong enough echo, that are kept: power, campaign
        breaks, filters.

    Raises
    ------
    InputError
        If no pair and no sector scan has a target, or the wind's distribution is not declared.

    Notes
    -----
    A wake counts where it touches what any of the scans measures. The echo is that of the lidar whose is weakest, and only
    where the site declares `signal`; its share of valid rays is taken for the share of valid periods.
    """
    asked = [
        *((pair.name, pair.target, pair.scans) for pair in plan.site.pairs),
        *(
            (layout.name, target, (layout.name,))
            for layout in plan.layouts
            for target in (layout.targets if layout.spec.type == "sector" else ())
        ),
    ]
    if not asked:
        raise InputError(
            "no pair and no sector scan has a target: nothing on this site measures the wind; declare a scan"
        )
    return tuple(_stay(plan, *item, days, availability) for item in asked)


def _stay(
    plan: Plan, name: str, target: str, scans: tuple[str, ...], days: float, availability: float
) -> Stay:
    site = plan.site
    excluded = any_of(
        item.excluded for item in plan.exclusions if item.scan in scans and item.target == target
    )
    shares = [ray_noise(site, plan.layout[scan], target).valid_share for scan in scans]
    strong = min((share for share in shares if share is not None), default=None)
    kept = availability * (1.0 if strong is None else strong)
    found = expected_yield(site, days, availability=kept, excluded=excluded)
    stages = _stages(site, days, excluded, strong, availability)
    return Stay(name, target, days, stages, found)


def _stages(
    site: Site, days: float, excluded: SectorSet, strong: float | None, availability: float
) -> tuple[Stage, ...]:
    """Where the periods of a stay go, one thing after the other."""
    low, high = site.assumed_wind.speed_range_mps
    anywhere = _within(site, days, everywhere=True)
    wanted = _within(site, days)
    free = _within(site, days, excluded)
    left = [
        (f"wind from {low:g} to {high:g} m/s", anywhere),
        ("from the wanted directions", wanted),
        ("free of wakes", free),
        *([("echo strong enough (signal)", free * strong)] if strong is not None else []),
    ]
    left.append(("kept (--availability)", left[-1][1] * availability))
    stages, before = [], days * PERIODS_PER_DAY
    for name, kept in left:
        stages.append(Stage(name, kept, kept / before if before > 0 else 0.0))
        before = kept
    return tuple(stages)


def _within(site: Site, days: float, excluded: SectorSet | None = None, *, everywhere: bool = False) -> float:
    """Periods with a wind of the speed range from the directions that count, or from anywhere, less the excluded ones."""
    if everywhere and site.wind is not None:
        site = site.model_copy(update={"wind": site.wind.model_copy(update={"directions_deg": None})})
    found = expected_yield(site, days, excluded=excluded, speed_edges_mps=np.array([0.0, ALL_SPEEDS_MPS]))
    return float(found.expected.sum())
