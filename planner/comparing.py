"""A campaign's means against its mast, per scan and sector size, beside what was predicted."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from geometry.angles import Sector, SectorSet
from geometry.arrays import BoolArray, FloatArray
from geometry.errors import InputError
from planner.campaign import Campaign, MastInput
from planner.error_nouns import SizeError
from planner.files.yaml_campaign import Loaded
from planner.plan import Plan
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
from reconstruct.wind import uv_mps

if TYPE_CHECKING:
    import pandas as pd

FORESEEN = (
    "slope",
    "slope_std",
    "residual_std_mps",
    "mean10_speed_bias_mps",
    "mean10_speed_std_mps",
    "direction_residual_std_deg",
)  # numbers of the prediction that stand in the table


@dataclass(frozen=True, eq=False)
class Matched:
    """Periods that a scan of one size and the mast share and that count."""

    scan: str
    sector_deg: float | None  # None for a pair
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

    def foreseen(self, name: str) -> float | None:
        """One predicted number; None where there is none."""
        return None if self.predicted is None else self.predicted.values.get(name)  # noqa: PD011


class Comparison(NamedTuple):
    """A campaign against its mast."""

    rows: tuple[Row, ...]
    mast_weibull: WeibullFit
    period_s: float


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
    plan = Plan(loaded.site)
    mast = mast_means(campaign.mast, campaign.averaging.compare_s)
    matched = matches(_means_table(campaign), mast, plan, campaign)
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
    return Comparison(rows, fit_weibull(widest.mast_mps), campaign.averaging.compare_s)


def mast_means(mast: MastInput, period_s: float) -> PeriodMeans:
    """Period means of a mast's cup and vane.

    Raises
    ------
    InputError
        If the file lacks a column, holds no number, or its own periods are longer.
    """
    import pandas as pd

    try:
        frame = pd.read_csv(mast.path, sep=mast.separator, skipinitialspace=True)
    except (OSError, ValueError) as error:
        raise InputError(f"mast file {mast.path} cannot be read as CSV ({error})") from error
    if missing := [name for name in (mast.time, mast.speed, mast.direction) if name not in frame.columns]:
        have = ", ".join(map(str, frame.columns))
        raise InputError(
            f"mast file {mast.path} has no column {', '.join(missing)}; it has {have}: give the names under `mast`"
        )
    time = pd.to_datetime(frame[mast.time], utc=True, errors="coerce", format="ISO8601")
    stamps = time.dt.tz_localize(None).to_numpy().astype("datetime64[ns]")
    speed, angle = (_numbers(frame[name], mast) for name in (mast.speed, mast.direction))
    known = ~np.isnat(stamps)
    if np.count_nonzero(known) < 2:
        raise InputError(
            f"mast file {mast.path} has fewer than two times in {mast.time}: they have to be ISO 8601, UTC"
        )
    interval_s = mast.interval_s or float(np.median(np.diff(np.sort(stamps[known])) / np.timedelta64(1, "s")))
    if interval_s > period_s + 1e-6:
        raise InputError(
            f"mast file {mast.path} has means over {interval_s:g} s, longer than the {period_s:g} s to be compared"
        )
    middle_s = (0.5 if mast.stamp == "start" else -0.5) * interval_s + mast.clock_s
    u, v = uv_mps(speed, angle + mast.direction_offset_deg)
    return period_means(stamps[known], u[known], v[known], period_s=period_s, shift_s=middle_s)


def matches(table: "pd.DataFrame", mast: PeriodMeans, plan: Plan, campaign: Campaign) -> tuple[Matched, ...]:
    """For every scan and size the periods that count, with counts of what each condition took."""
    found = []
    for (scan, sector), part in table.groupby(["scan", "sector_deg"], sort=False, dropna=False):
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


def table_rows(comparison: Comparison) -> list[dict[str, object]]:
    """The comparison as rows of a table, one for each scan and size."""
    rows: list[dict[str, object]] = []
    for row in comparison.rows:
        told: dict[str, object] = {"scan": row.matched.scan, "sector_deg": row.matched.sector_deg}
        told |= row.speed._asdict()
        told |= {
            f"direction_{name}": value for name, value in row.direction._asdict().items() if name != "pairs"
        }
        told |= {
            f"direction_plain_{name}": getattr(row.plainly, name)
            for name in ("slope", "intercept_deg", "r_squared")
        }
        told |= {"weibull_scale_mps": row.weibull.scale_mps, "weibull_shape": row.weibull.shape}
        told |= {f"predicted_{name}": row.foreseen(name) for name in FORESEEN}
        rows.append(told)
    return rows


def _numbers(column: "pd.Series[float]", mast: MastInput) -> FloatArray:
    import pandas as pd

    values = pd.to_numeric(column, errors="coerce").to_numpy(dtype=float)
    return np.where(np.isin(values, mast.missing), np.nan, values)


def _means_table(campaign: Campaign) -> "pd.DataFrame":
    import pandas as pd

    path = campaign.output / f"means_{campaign.averaging.compare_s:g}s.csv"
    if not path.is_file():
        raise InputError(f"{path} is not there: run `lidarplan retrieve` first")
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
    scans = {scan} if scan in plan.layout else set(plan.site.pair(scan).scans)
    allowed = SectorSet.full()
    for item in plan.exclusions:
        if item.scan in scans:
            allowed = allowed.intersection(item.free)
    return allowed


def _predictions(
    plan: Plan, campaign: Campaign, tier: Tier | None
) -> dict[tuple[str, float | None], SizeError]:
    """The predicted error of each scan's sizes, as the middle rays of the scan, and of each pair."""
    curves = plan.errors(tier=tier, sizes_deg=campaign.sizes_deg, sizes_from="subset")
    return {(curve.scan, size.sector_deg): size for curve in curves for size in curve.sizes}
