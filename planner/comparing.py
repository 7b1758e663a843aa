"""A campaign's means against its mast, per scan and sector size, beside what was predicted."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from geometry.angles import Sector, SectorSet
from geometry.arrays import BoolArray, FloatArray
from geometry.errors import InputError
from planner.campaign import Campaign, MastInput
from planner.error_nouns import SizeError
from planner.files.yaml_campaign import Loaded
from planner.mast_file import lost_of, read_mast
from planner.plan import Plan
from planner.ray_sets import subset_of
from planner.result_mark import require_own_results
from planner.scan_jobs import job_name
from reconstruct.agreement import Difference, set_beside
from reconstruct.averaging import PeriodMeans, TimeArray, period_means
from reconstruct.comparison import (
    DirectionFit,
    SpeedFit,
    WeibullFit,
    fit_direction,
    fit_direction_plainly,
    fit_speed,
    fit_weibull,
)
from reconstruct.filters import Step, limit_availability, limit_directions, limit_speed
from reconstruct.prediction import Tier

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, eq=False)
class Matched:
    """Periods that a scan of one size and the mast share and that count."""

    scan: str
    sector_deg: float | None  # None for a pair
    rays: int  # of one wind: those of the sector, or one of each scan of a pair
    height_m: float | None  # of what the lidar measures, above the ground
    mast_height_m: float | None  # of the mast's level; None where the campaign does not say
    time_utc: TimeArray  # (period,) ends
    lidar_mps: FloatArray  # (period,) scalar means
    lidar_deg: FloatArray
    mast_mps: FloatArray
    mast_deg: FloatArray
    steps: tuple[Step, ...]


class Row(NamedTuple):
    """One line of the comparison."""

    matched: Matched
    speed: SpeedFit
    direction: DirectionFit  # on the circle
    plainly: DirectionFit  # as the study
    weibull: WeibullFit  # of the lidar's speeds
    predicted: SizeError | None

    @property
    def slope_beside(self) -> Difference | None:
        """Measured and predicted slope, by the measurement's scatter and the errors that stay for a whole campaign."""
        errors = (self.speed.slope_standard_error, self.foreseen("slope_std"))
        return set_beside(self.speed.slope, self.foreseen("slope"), errors=errors)

    @property
    def scatter_beside(self) -> Difference | None:
        """Measured and predicted standard deviation of mast - slope · lidar."""
        measured = self.speed.residual_std_mps
        errors = (self.speed.residual_std_standard_error_mps,)
        return set_beside(measured, self.foreseen("residual_std_mps"), errors=errors)

    @property
    def direction_beside(self) -> Difference | None:
        """Measured and predicted standard deviation of the directions about their line."""
        measured = self.direction.residual_std_deg
        errors = (self.direction.residual_std_standard_error_deg,)
        return set_beside(measured, self.foreseen("direction_residual_std_deg"), errors=errors)

    def foreseen(self, name: str) -> float | None:
        """One predicted number; None where there is none."""
        return None if self.predicted is None else self.predicted.values.get(name)  # noqa: PD011


class Comparison(NamedTuple):
    """A campaign against its mast."""

    rows: tuple[Row, ...]
    mast_weibull: WeibullFit
    period_s: float
    levels: Mapping[float | None, PeriodMeans]  # of the mast, by height
    lost: str  # what of the mast's file cannot be used, in words; empty where all can


def compare(loaded: Loaded, *, tier: Tier | None = None, predict: bool = True) -> Comparison:
    """Compare the means that `retrieve` wrote with the mast.

    Parameters
    ----------
    loaded
        The campaign and its site.
    tier
        How the prediction beside it is made; default as `Plan.errors`. Every effect is modelled, also those
        within the site's tolerance: a long campaign resolves them.
    predict
        Whether there is a prediction at all: it takes some seconds.

    Raises
    ------
    InputError
        If there is no mast, nothing was retrieved, or no period is shared.
    """
    campaign = loaded.campaign
    if campaign.mast is None:
        raise InputError(
            "the campaign has no mast: give `mast: {path: ...}` with a CSV of its speed and direction"
        )
    plan, table = Plan(loaded.site), _means_table(loaded)
    levels = mast_levels(campaign.mast, campaign.averaging.compare_s)
    matched = matches(table, levels, plan, campaign)
    predicted = (
        _predictions(Plan(loaded.site.model_copy(update={"fidelity": "all"})), campaign, tier)
        if predict
        else {}
    )
    rows = tuple(
        Row(
            each,
            fit_speed(each.mast_mps, each.lidar_mps),
            fit_direction(each.mast_deg, each.lidar_deg),
            fit_direction_plainly(each.mast_deg, each.lidar_deg),
            fit_weibull(each.lidar_mps),
            predicted.get((each.scan, each.sector_deg)),
        )
        for each in matched
    )
    widest = max(matched, key=lambda each: len(each.time_utc))
    return Comparison(
        rows,
        fit_weibull(widest.mast_mps),
        campaign.averaging.compare_s,
        levels,
        _lost(campaign.mast),
    )


def _lost(mast: MastInput) -> str:
    parts = [
        name for level in mast.levels or (mast,) for name in (level.speed, level.direction or mast.direction)
    ]
    return lost_of(mast.path, mast.separator, mast.time, dict.fromkeys(parts))


def mast_levels(mast: MastInput, period_s: float) -> dict[float | None, PeriodMeans]:
    """Period means of every level of a mast by its height; of one that does not say its height under None.

    Raises
    ------
    InputError
        As `mast_means`.
    """
    if not mast.levels:
        return {None: mast_means(mast, period_s)}
    return {level.height_m: mast_means(mast.at_level(level), period_s) for level in mast.levels}


def mast_means(mast: MastInput, period_s: float) -> PeriodMeans:
    """Period means of a mast's cup and vane.

    Raises
    ------
    InputError
        If the file lacks a column, holds no number, or its own periods are longer.
    """
    found = read_mast(mast)
    if found.interval_s > period_s + 1e-6:
        raise InputError(
            f"mast file {mast.path} has means over {found.interval_s:g} s, longer than the {period_s:g} s to be compared"
        )
    return period_means(found.time_utc, found.u_mps, found.v_mps, period_s=period_s)


def matches(
    table: "pd.DataFrame", levels: Mapping[float | None, PeriodMeans], plan: Plan, campaign: Campaign
) -> tuple[Matched, ...]:
    """For every scan and size the periods that count, with counts of what each condition took.

    Each is set beside the level of the mast that is nearest to its height.
    """
    found = []
    for (scan, sector), part in table.groupby(["scan", "sector_deg"], sort=False, dropna=False):
        height_m = float(part["height_m"].iloc[0])
        level_m = nearest_level(levels, height_m)
        mast = levels[level_m]
        time = part["time_utc"].to_numpy().astype("datetime64[ns]")
        shared, here, there = np.intersect1d(time, mast.time_utc, return_indices=True)
        sector_deg = float(str(sector))
        size = None if np.isnan(sector_deg) else sector_deg
        kept, steps = _counting(
            part["availability"].to_numpy(dtype=float)[here],
            mast.at(there),
            _allowed(plan, str(scan), campaign),
            plan,
            campaign,
        )
        steps = (Step("with the mast", len(time), len(shared), "periods"), *steps)
        lidar = part.iloc[here]
        found.append(
            Matched(
                scan=str(scan),
                sector_deg=size,
                rays=_rays(plan, str(scan), size),
                height_m=None if np.isnan(height_m) else height_m,
                mast_height_m=level_m,
                time_utc=shared[kept],
                lidar_mps=lidar["speed_mps"].to_numpy(dtype=float)[kept],
                lidar_deg=lidar["from_deg"].to_numpy(dtype=float)[kept],
                mast_mps=mast.speed_mps[there][kept],
                mast_deg=mast.from_deg[there][kept],
                steps=steps,
            )
        )
    if not any(len(each.time_utc) for each in found):
        told = "; ".join(
            f"{each.scan}: " + ", ".join(f"{s.name} {s.after}" for s in each.steps) for each in found[:3]
        )
        raise InputError(
            f"no period is left to compare ({told}): check the clocks, `selection` and the mast's times"
        )
    return tuple(found)


def nearest_level(levels: Mapping[float | None, PeriodMeans], height_m: float) -> float | None:
    """The height of the level nearest to a height; of a height that is not known the highest level."""
    known = [level for level in levels if level is not None]
    if not known:
        return None
    return max(known) if np.isnan(height_m) else min(known, key=lambda level: abs(level - height_m))


def _means_table(loaded: Loaded) -> "pd.DataFrame":
    import pandas as pd

    campaign = loaded.campaign
    path = campaign.output / f"means_{campaign.averaging.compare_s:g}s.csv"
    if not path.is_file():
        raise InputError(f"{path} is not there: run `lidarplan retrieve` first")
    require_own_results(loaded)
    return pd.read_csv(path, parse_dates=["time_utc"], date_format="ISO8601")


def _counting(
    availability: FloatArray, mast: PeriodMeans, allowed: SectorSet, plan: Plan, campaign: Campaign
) -> tuple[BoolArray, tuple[Step, ...]]:
    """Which of the shared periods count: by availability, the mast's direction and the mast's speed."""
    chosen = campaign.selection
    speed = chosen.speed_mps or (None, None)
    if chosen.speed_mps is None and not chosen.every_speed:
        speed = plan.site.assumed_wind.speed_range_mps
    first = limit_availability(mast.speed_mps, availability, expected=1.0, share=chosen.availability)
    second = limit_directions(first.values, mast.from_deg, allowed)
    third = limit_speed(second.values, mast.speed_mps, speed)
    steps = tuple(each.step._replace(unit="periods") for each in (first, second, third))
    return np.isfinite(third.values), steps


def _allowed(plan: Plan, scan: str, campaign: Campaign) -> SectorSet:
    """Directions that count: as asked; the site's own, or else what wakes leave free of what the scan measures."""
    asked = campaign.selection.directions_deg
    if asked == "all":
        return SectorSet.full()
    if not isinstance(asked, str):
        return SectorSet.of(Sector.between(start, stop) for start, stop in asked)
    if plan.site.wind is not None and plan.site.wind.directions_deg is not None:
        return plan.wanted
    scans = _scans_behind(plan, scan)
    allowed = SectorSet.full()
    for item in plan.exclusions:
        if item.scan in scans:
            allowed = allowed.intersection(item.free)
    return allowed


def _scans_behind(plan: Plan, result: str) -> set[str]:
    """Scans of the site that a result was made of; one of several points or gates is named after its scan."""
    own = {name for name in plan.layout if result == name or result.startswith(job_name(name, ""))}
    return own or set(plan.site.pair(result).scans)


def _rays(plan: Plan, result: str, sector_deg: float | None) -> int:
    """How many rays one wind of a result is made of."""
    scans = _scans_behind(plan, result)
    if sector_deg is None:
        return len(scans)
    layout = plan.layout[scans.pop()]
    part = slice(None) if layout.spec.type != "sector" else subset_of(layout, sector_deg)
    return len(layout.scan.azimuth_deg[part])


def _predictions(
    plan: Plan, campaign: Campaign, tier: Tier | None
) -> dict[tuple[str, float | None], SizeError]:
    """The predicted error of each scan's sizes, as the middle rays of the scan, and of each pair.

    It is of fits with two columns, but for the pairs, which say how many theirs has: a scan with three has none.
    """
    curves = plan.errors(tier=tier, sizes_deg=campaign.sizes_deg, sizes_from="subset")
    three = {item.scan for item in campaign.inputs if (item.fit_columns or campaign.columns) == 3}
    return {
        (curve.scan, size.sector_deg): size
        for curve in curves
        for size in curve.sizes
        if curve.lidar is None or curve.scan not in three
    }
