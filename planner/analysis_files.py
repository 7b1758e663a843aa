"""The files of a run of the analysis: winds of single scans, period means, and the log."""

import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np

from geometry.arrays import FloatArray
from geometry.errors import InputError
from planner.attitude_files import Logged, told_drifts
from planner.campaign import CNR_DB, Campaign
from planner.clocks import ClockLag, SonicTrim, told_clock, told_trims
from planner.mast_file import WindSeries
from planner.scan_retrieval import periods_of
from planner.sum_files import SumFiles
from reconstruct.automatic_filter import Agreement
from reconstruct.averaging import TimeArray, means_of, period_means
from reconstruct.duck import bounded_duck, quoted
from reconstruct.filters import Step
from reconstruct.pairing import GapResult
from reconstruct.retrieval import REASONS

SPECIAL_TYPES = {"time_utc": "TIMESTAMP", "reason": "VARCHAR", "scan": "VARCHAR"}
ALONE = (
    "one lidar's beam alone: its radial speed, and the part of the wind along it; u, v, speed and direction need the "
    "beam of another lidar (`pairs`)"
)


NOTHING_LEFT = {
    "in the scan": "the rays lie elsewhere than the site's scan; check the scan, `angles` and `offsets`",
    "near a point": "the rays look elsewhere than the site's points; check the scan, `angles` and `offsets`",
    "CNR": "check filters.cnr_db",
    "radial speed": "check filters.radial_speed_mps",
    "partial scans": "every scan lacks a ray; allow partial ones, such as filters.ray_share: 0.8",
}


class Result(NamedTuple):
    """What the tables say of a scan or pair beside its winds."""

    height_m: float | None  # of what is measured, above the ground
    interval_s: float  # usual time between its winds


class Retrieved(NamedTuple):
    """What a run wrote and counted."""

    folder: Path
    steps: dict[str, tuple[Step, ...]]  # by scan, or by its points or gates
    lost: dict[str, dict[str, int]]  # scans without a wind, by reason
    agreements: dict[str, Agreement]
    notes: dict[str, tuple[str, ...]]
    offsets_deg: dict[str, float]  # of the measured azimuths from the planned ones, the largest of the parts
    alone: tuple[str, ...]  # beams that meet no other lidar's: radial speeds alone
    means: dict[float, int]  # rows by period [s]; empty where there are radial speeds alone
    gaps: dict[str, tuple[GapResult, ...]]  # by pair
    drifts: dict[str, Logged]  # of attitude logs, by scan
    clocks: dict[str, ClockLag]  # lags against the mast, by scan; empty where they are not asked for
    sonics: dict[str, SonicTrim]  # by sonic
    resumed: int  # parts that an earlier run had done


def file_name(scan: str) -> str:
    """A scan's name as part of a file's name.

    Examples
    --------
    >>> file_name("stare K/1")
    'stare_K_1'
    """
    return "".join(letter if letter.isalnum() or letter in "-." else "_" for letter in scan)


def require_own_files(names: Iterable[str]) -> None:
    """Refuse names of results that files cannot keep apart, small and capital letters taken for the same.

    Raises
    ------
    InputError
        If two of them would share a file.

    Examples
    --------
    >>> require_own_files(["s t", "s_t"])
    Traceback (most recent call last):
    geometry.errors.InputError: 's t' and 's_t' would share the file s_t: rename one of them in the site file
    """
    known: dict[str, str] = {}
    for name in names:
        file = file_name(name)
        first = known.get(file.casefold())
        if first is not None:
            raise InputError(
                f"'{first}' and '{name}' would share the file {file}: rename one of them in the site file"
            )
        known[file.casefold()] = name


def append_fast(folder: Path, scan: str, fast: Mapping[str, FloatArray | TimeArray]) -> None:
    """Add the winds of a part to the scan's table."""
    import pandas as pd

    if not fast:
        return
    path = folder / f"fast_{file_name(scan)}.csv"
    frame = pd.DataFrame(fast).sort_values(["time_utc", "sector_deg"], ascending=[True, False], kind="stable")
    status = frame.pop("status").to_numpy(dtype=int)
    frame["reason"] = np.array(("", *REASONS[1:]))[status]  # why a wind is not known
    frame.to_csv(path, mode="a", header=not path.exists(), index=False, float_format="%.5f", encoding="utf-8")


def write_fast_parquet(folder: Path) -> None:
    """Write every table of single scans as Parquet too, row group by row group."""
    for path in sorted(folder.glob("fast_*.csv")):
        _copy_to_parquet(path)


def _copy_to_parquet(path: Path) -> None:
    """Write a CSV of ours as Parquet beside it."""
    with path.open(encoding="utf-8") as file:
        names = file.readline().strip().split(",")
    kinds = {name: SPECIAL_TYPES.get(name, "DOUBLE") for name in names}  # a column may be empty
    table = f"read_csv({quoted(path)}, header=true, columns={kinds!r})"
    with bounded_duck(spill=path.parent) as connection:
        target = quoted(path.with_suffix(".parquet"))
        connection.execute(f"COPY (SELECT * FROM {table}) TO {target} (FORMAT parquet)")


def write_means(
    folder: Path, campaign: Campaign, results: Mapping[str, Result], sums: SumFiles
) -> dict[float, int]:
    """Write the means of each period as CSV and Parquet: one row for each scan, size and period.

    Nothing is written where no scan was meant to give a wind.

    Returns
    -------
    dict
        Rows by period [s].
    """
    rows: dict[float, int] = {}
    for period_s in periods_of(campaign):
        path = folder / f"means_{period_s:g}s.csv"
        for key, total in sums.totals(period_s):
            means, told = means_of(total), results[key.name]
            if not len(means.count):  # no wind at all of this size: told by its count
                continue
            frame = means.frame()
            frame.insert(0, "scan", key.name)
            frame.insert(1, "sector_deg", key.sector_deg)
            frame.insert(2, "height_m", np.nan if told.height_m is None else told.height_m)
            frame["availability"] = means.availability(told.interval_s)
            stamps = np.datetime_as_string(means.time_utc, unit="s" if period_s % 1 == 0 else "ms")
            frame["time_utc"] = np.char.replace(stamps, "T", " ")  # as in the table of single scans
            frame.to_csv(
                path, mode="a", header=not path.exists(), index=False, float_format="%.5f", encoding="utf-8"
            )
            rows[period_s] = rows.get(period_s, 0) + len(frame)
        if path.exists():
            _copy_to_parquet(path)
    return rows


def write_sonics(folder: Path, winds: Mapping[str, WindSeries], campaign: Campaign) -> None:
    """Write means of the sonics, trimmed, stamped at the end of each period: files that `mast` reads."""
    for name, wind in winds.items():
        for period_s in periods_of(campaign):
            if period_s >= wind.interval_s:
                means = period_means(wind.time_utc, wind.u_mps, wind.v_mps, period_s=period_s)
                path = folder / f"sonic_{file_name(name)}_{period_s:g}s.csv"
                means.frame().to_csv(path, index=False, float_format="%.5f", encoding="utf-8")


def write_log(folder: Path, titles: tuple[str, str], found: Retrieved) -> None:
    """Write what was turned, taken away and found, as text, and the same counts for machines."""
    lines = [f"campaign {titles[0]}, site {titles[1]}"]
    for scan in found.steps:
        lines += ["", f"scan {scan}", *(f"  {line}" for line in scan_lines(found, scan))]
    for pair, gaps in found.gaps.items():
        lines += ["", f"pair {pair}"]
        lines += [
            f"  gap up to {gap.gap_s:g} s: {gap.pairs} pairs, {gap.share:.1%} of the rays, {gap.mean_gap_s:.2f} s apart, "
            f"standard deviation within ten minutes {gap.spread_mps:.3f} m/s"
            for gap in gaps
        ]
    lines += ["", *told_trims(found.sonics)] if found.sonics else []
    (folder / "retrieve.log").write_text("\n".join(lines) + "\n", encoding="utf-8")
    counts: dict[str, list[dict[str, object]]] = {
        scan: [
            *(step._asdict() for step in steps),
            *({"no wind": reason, "scans": count} for reason, count in found.lost[scan].items()),
        ]
        for scan, steps in found.steps.items()
    }
    (folder / "filters.json").write_text(json.dumps(counts, ensure_ascii=False, indent=1), encoding="utf-8")


def scan_lines(found: Retrieved, scan: str) -> list[str]:
    """What was turned, taken away and found of one scan, a line each."""
    lines = [*found.notes[scan], f"measured azimuths less the planned ones: {found.offsets_deg[scan]:+.3f}°"]
    lines += [told_clock(found.clocks[scan])] if scan in found.clocks else []
    lines += told_drifts(found.drifts[scan]) if scan in found.drifts else []
    lines += [told(step) for step in found.steps[scan]]
    emptied = next((step for step in found.steps[scan] if step.before and not step.after), None)
    if emptied is not None:
        lines.append(f"nothing is left: {NOTHING_LEFT.get(emptied.name, 'see the counts above')}")
    elif not found.steps[scan]:
        lines.append("nothing is left: no ray could be read, see above")
    agreement = found.agreements[scan]
    if any(agreement):
        both, limits, automatic, neither = agreement
        lines.append(
            f"automatic filter beside the usual CNR limits of {CNR_DB[0]:g} to {CNR_DB[1]:g} dB: both keep {both} rays, "
            f"the limits alone {limits}, the filter alone {automatic}, neither {neither}"
        )
    lines += [f"no wind: {line}" for line in told_losses(found.lost[scan])]
    return [*lines, ALONE] if scan in found.alone else lines


def told_losses(lost: Mapping[str, int]) -> list[str]:
    """Scans without a wind, in words.

    Examples
    --------
    >>> told_losses({"fewer rays than unknowns, 4°": 12})
    ['12 scans: fewer rays than unknowns, 4°']
    """
    return [f"{count} scans: {reason}" for reason, count in lost.items()]


def told(step: Step) -> str:
    """A step in words.

    Examples
    --------
    >>> told(Step("CNR", 2000, 1990))
    'CNR: 1990 of 2000 rays left, 0.5 % lost'
    """
    return f"{step.name}: {step.after} of {step.before} {step.unit} left, {100 * step.lost_share:.1f} % lost"
