"""Two scans or more as one dual or triple Doppler lidar: their kept rays, a stretch of time after the other."""

from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np

from geometry.errors import InputError
from planner.analysis_files import append_fast, file_name
from planner.campaign import Campaign, PairInput
from planner.kept_parts import read_series
from planner.plan import Plan
from planner.scan_jobs import ScanJob, result_name
from planner.scan_retrieval import periods_of, wind_table
from planner.sum_files import Key, SumFiles
from reconstruct.averaging import period_sums
from reconstruct.pairing import STUDY_GAPS_S, GapResult, RaySeries, compare_gaps, joint_wind

UNSYNCHRONISED_GAP_S = 5.0  # the study's best


def retrieve_pair(
    pair: PairInput,
    campaign: Campaign,
    plan: Plan,
    work: Path,
    folder: Path,
    sums: SumFiles,
) -> tuple[GapResult, ...]:
    """Retrieve a pair from the kept parts of its scans, a stretch of time after the other."""
    declared = plan.site.pair(pair.pair)
    gap_s = pair.gap_s
    if gap_s is None:
        shortest = min(plan.layout[name].spec.accumulation_s for name in declared.scans)
        gap_s = shortest / 2 if declared.synchronised else UNSYNCHRONISED_GAP_S
    names = (result_name(plan.layout[name], declared.target) for name in declared.scans)
    streams = [kept_series(work, name) for name in names]
    asked = (
        STUDY_GAPS_S
        if pair.compare_gaps_s is None and not declared.synchronised
        else pair.compare_gaps_s or ()
    )
    compared: tuple[GapResult, ...] = ()
    for series in stretches(*streams, gap_s=max([gap_s, *asked])):
        wind = joint_wind(series, gap_s=gap_s, columns=declared.fit_columns)
        table = wind_table(wind.time_utc, wind.fit, float("nan"), wind.fit.rays > 0)
        append_fast(folder, pair.pair, table | {"gap_s": wind.gap_s})
        for period_s in periods_of(campaign):
            part = period_sums(
                wind.time_utc,
                wind.fit.wind_mps[:, 0],
                wind.fit.wind_mps[:, 1],
                w_mps=wind.fit.wind_mps[:, 2] if declared.fit_columns == 3 else None,
                period_s=period_s,
                shift_s=campaign.averaging.time_shift_s,
            )
            sums.add(Key(pair.pair, float("nan"), period_s), part)
        found = compare_gaps(*series, gaps_s=asked, columns=declared.fit_columns)
        compared = tuple(one + more for one, more in zip(compared, found, strict=True)) if compared else found
    return compared


def partners_of(pair: PairInput, plan: Plan, jobs: Mapping[str, ScanJob]) -> tuple[str, ...]:
    """Names of the results of the scans whose rays a pair is made of.

    Raises
    ------
    InputError
        If one of them is not retrieved at the pair's target.
    """
    declared = plan.site.pair(pair.pair)
    names = tuple(result_name(plan.layout[name], declared.target) for name in declared.scans)
    if absent := [name for name in names if name not in jobs or jobs[name].target_column is None]:
        raise InputError(
            f"pair '{pair.pair}' needs the rays of '{absent[0]}' at {declared.target}: leave gates_m out of its scan's "
            "input, and give the scan that target"
        )
    return names


def kept_series(work: Path, scan: str) -> Iterator[RaySeries]:
    """The rays at the target that the kept parts of a scan hold, part by part."""
    for place in sorted(work.glob(f"{file_name(scan)}-{'[0-9]' * 6}.npz")):
        yield read_series(place)


def stretches(*series: Iterator[RaySeries], gap_s: float) -> Iterator[tuple[RaySeries, ...]]:
    """Cut two or more series, each of which comes in parts, into stretches of the same time.

    Parameters
    ----------
    *series
        Parts in the order of time.
    gap_s
        Stretches end in a silence of the first series that is longer than this, if there is one near [s].

    Yields
    ------
    tuple of RaySeries
        One of each. Memory does not grow with the campaign: a part of each is held at a time.
    """
    held = [_next(parts) for parts in series]
    while all(part is not None for part in held):
        there = [part for part in held if part is not None]
        last = min(part.time_utc[-1] for part in there) + np.timedelta64(round(gap_s * 1e9), "ns")
        yield tuple(part.at(part.time_utc <= last) for part in there)
        held = [_rest(part, last, more) for part, more in zip(there, series, strict=True)]


def _rest(series: RaySeries, last: np.datetime64, more: Iterator[RaySeries]) -> RaySeries | None:
    left = series.at(series.time_utc > last)
    return left if len(left.time_utc) else _next(more)


def _next(parts: Iterator[RaySeries]) -> RaySeries | None:
    return next((part for part in parts if len(part.time_utc)), None)
