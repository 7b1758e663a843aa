"""The files of a run of the analysis: winds of single scans, period means, and the log."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from geometry.arrays import FloatArray
from geometry.errors import InputError
from planner.campaign import Campaign
from planner.plan import Plan
from planner.scan_retrieval import periods_of
from reconstruct.automatic_filter import Agreement
from reconstruct.averaging import PeriodSums, TimeArray, add_sums, means_of
from reconstruct.filters import Step
from reconstruct.pairing import GapResult

if TYPE_CHECKING:
    import pandas as pd

NO_SIZE = 0.0  # stands for the sector size of a pair among keys: NaN equals nothing, not even itself

Sums = dict[tuple[str, float, float], list[PeriodSums]]
"""Sums of a scan or pair by its name, sector size and period."""


class Retrieved(NamedTuple):
    """What a run wrote and counted."""

    folder: Path
    steps: dict[str, tuple[Step, ...]]  # by scan
    agreements: dict[str, Agreement]
    notes: dict[str, tuple[str, ...]]
    offsets_deg: dict[str, float]  # of the measured azimuths from the planned ones, the largest of the parts
    means: dict[float, "pd.DataFrame"]  # by period [s]
    gaps: dict[str, tuple[GapResult, ...]]  # by pair, without winds
    resumed: int  # parts that an earlier run had done


def file_name(scan: str) -> str:
    """A scan's name as part of a file's name.

    Examples
    --------
    >>> file_name("stare K/1")
    'stare_K_1'
    """
    return "".join(letter if letter.isalnum() or letter in "-." else "_" for letter in scan)


def append_fast(folder: Path, scan: str, fast: Mapping[str, FloatArray | TimeArray]) -> None:
    """Add the winds of a part to the scan's table."""
    import pandas as pd

    if not fast:
        return
    path = folder / f"fast_{file_name(scan)}.csv"
    frame = pd.DataFrame(fast).sort_values(["time_utc", "sector_deg"], ascending=[True, False], kind="stable")
    frame.to_csv(path, mode="a", header=not path.exists(), index=False, float_format="%.5f", encoding="utf-8")


def write_fast_parquet(folder: Path) -> None:
    """Write every table of single scans as Parquet too, row group by row group."""
    import duckdb

    with duckdb.connect() as connection:
        for path in sorted(folder.glob("fast_*.csv")):
            source, target = (str(name).replace("'", "''") for name in (path, path.with_suffix(".parquet")))
            connection.execute(f"COPY (SELECT * FROM read_csv('{source}')) TO '{target}' (FORMAT parquet)")


def write_means(folder: Path, campaign: Campaign, plan: Plan, sums: Sums) -> dict[float, "pd.DataFrame"]:
    """Write the means of each period as CSV and Parquet: one row for each scan, size and period."""
    import duckdb
    import pandas as pd

    tables: dict[float, pd.DataFrame] = {}
    for period_s in periods_of(campaign):
        frames = []
        for (scan, sector_deg, length_s), parts in sums.items():
            if length_s != period_s:
                continue
            means = means_of(add_sums(parts))
            frame = means.frame()
            frame.insert(0, "scan", scan)
            frame.insert(1, "sector_deg", np.nan if sector_deg == NO_SIZE else sector_deg)
            frame["availability"] = means.availability(_interval_s(plan, scan))
            frames.append(frame)
        if not frames:
            raise InputError("no scan gave any wind: give a sector, or a pair of stares, among the inputs")
        tables[period_s] = pd.concat(frames, ignore_index=True)
        path = folder / f"means_{period_s:g}s.csv"
        tables[period_s].to_csv(path, index=False, float_format="%.5f", encoding="utf-8")
        target = str(path.with_suffix(".parquet")).replace("'", "''")
        with duckdb.connect() as connection:
            connection.register("means", tables[period_s])
            connection.execute(f"COPY means TO '{target}' (FORMAT parquet)")
    return tables


def _interval_s(plan: Plan, name: str) -> float:
    """Usual time between the winds of a scan, or of a pair: that of its slowest scan [s]."""
    if name in plan.layout:
        return plan.layout[name].scan.period_s
    return max(plan.layout[scan].scan.period_s for scan in plan.site.pair(name).scans)


def write_log(folder: Path, titles: tuple[str, str], found: Retrieved) -> None:
    """Write what was turned, taken away and found, as text, and the same counts for machines."""
    lines = [f"campaign {titles[0]}, site {titles[1]}"]
    for scan, steps in found.steps.items():
        lines += ["", f"scan {scan}", *(f"  {note}" for note in found.notes[scan])]
        lines.append(f"  measured azimuths less the planned ones: {found.offsets_deg[scan]:+.3f}°")
        lines += [f"  {told(step)}" for step in steps]
        agreement = found.agreements[scan]
        if any(agreement):
            names = ("both", "usual CNR limits only", "the automatic filter only", "neither")
            counted = ", ".join(f"{name} {count}" for name, count in zip(names, agreement, strict=True))
            lines.append(f"  rays kept by: {counted}")
    for pair, gaps in found.gaps.items():
        lines += ["", f"pair {pair}"]
        lines += [
            f"  gap up to {gap.gap_s:g} s: {gap.pairs} pairs, {gap.share:.1%} of the rays" for gap in gaps
        ]
    (folder / "retrieve.log").write_text("\n".join(lines) + "\n", encoding="utf-8")
    counts = {scan: [step._asdict() for step in steps] for scan, steps in found.steps.items()}
    (folder / "filters.json").write_text(json.dumps(counts, ensure_ascii=False, indent=1), encoding="utf-8")


def told(step: Step) -> str:
    """A step in words.

    Examples
    --------
    >>> told(Step("CNR", 2000, 1990))
    'CNR: 1990 of 2000 rays left, 0.5 % lost'
    """
    return f"{step.name}: {step.after} of {step.before} {step.unit} left, {100 * step.lost_share:.1f} % lost"
