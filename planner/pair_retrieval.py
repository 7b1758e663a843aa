"""Two scans as one dual Doppler lidar: their kept rays, a stretch of time after the other."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from geometry.errors import InputError
from planner.analysis_files import NO_SIZE, Sums, append_fast, file_name
from planner.campaign import Campaign, PairInput
from planner.kept_parts import read_series
from planner.plan import Plan
from planner.scan_retrieval import periods_of, wind_table
from reconstruct.averaging import period_sums
from reconstruct.pairing import GapResult, RaySeries, compare_gaps, dual_wind

UNSYNCHRONISED_GAP_S = 5.0  # the study's best


def retrieve_pair(
    pair: PairInput,
    campaign: Campaign,
    plan: Plan,
    work: Path,
    folder: Path,
    sums: Sums,
) -> tuple[GapResult, ...]:
    """Retrieve a pair from the kept parts of its two scans, a stretch of time after the other."""
    declared = plan.site.pair(pair.pair)
    if len(declared.scans) != 2:
        raise InputError(f"pair '{pair.pair}' has {len(declared.scans)} scans: two can be retrieved together")
    gap_s = pair.gap_s
    if gap_s is None:
        shortest = min(plan.layout[name].spec.accumulation_s for name in declared.scans)
        gap_s = shortest / 2 if declared.synchronised else UNSYNCHRONISED_GAP_S
    streams = [_kept_series(work, name) for name in declared.scans]
    compared: list[tuple[GapResult, ...]] = []
    for first, second in stretches(*streams, gap_s=max([gap_s, *pair.compare_gaps_s])):
        wind = dual_wind(first, second, gap_s=gap_s)
        left = np.isfinite(wind.fit.wind_mps[:, 0])
        table = wind_table(wind.time_utc, wind.fit, float("nan"), left) | {"gap_s": wind.gap_s[left]}
        append_fast(folder, pair.pair, table)
        for period_s in periods_of(campaign):
            part = period_sums(
                wind.time_utc,
                wind.fit.wind_mps[:, 0],
                wind.fit.wind_mps[:, 1],
                period_s=period_s,
                shift_s=campaign.averaging.time_shift_s,
            )
            sums.setdefault((pair.pair, NO_SIZE, period_s), []).append(part)
        if pair.compare_gaps_s:
            compared.append(compare_gaps(first, second, gaps_s=pair.compare_gaps_s))
    return tuple(_added(results) for results in zip(*compared, strict=True))


def _added(results: tuple[GapResult, ...]) -> GapResult:
    """What a gap gave over several stretches; the median of the gaps is that of the stretches' own."""
    pairs = sum(result.pairs for result in results)
    rays = sum(result.pairs / result.share if result.share else 0.0 for result in results)
    middle = float(np.median([result.median_gap_s for result in results]))
    return GapResult(results[0].gap_s, pairs, pairs / rays if rays else 0.0, middle, results[0].wind)


def _kept_series(work: Path, scan: str) -> Iterator[RaySeries]:
    for place in sorted(work.glob(f"{file_name(scan)}-*.npz")):
        yield read_series(place)


def stretches(
    first: Iterator[RaySeries], second: Iterator[RaySeries], *, gap_s: float
) -> Iterator[tuple[RaySeries, RaySeries]]:
    """Cut two series, each of which comes in parts, into stretches of the same time.

    Parameters
    ----------
    first, second
        Parts in the order of time.
    gap_s
        Stretches end in a silence of the first series that is longer than this, if there is one near [s].

    Yields
    ------
    tuple of RaySeries
        Memory does not grow with the campaign: a part of each is held at a time.
    """
    one, other = _next(first), _next(second)
    while one is not None and other is not None:
        end = min(one.time_utc[-1], other.time_utc[-1])
        last = end + np.timedelta64(round(gap_s * 1e9), "ns")
        yield one.at(one.time_utc <= last), other.at(other.time_utc <= last)
        one, other = _rest(one, last, first), _rest(other, last, second)


def _rest(series: RaySeries, last: np.datetime64, more: Iterator[RaySeries]) -> RaySeries | None:
    left = series.at(series.time_utc > last)
    return left if len(left.time_utc) else _next(more)


def _next(parts: Iterator[RaySeries]) -> RaySeries | None:
    return next((part for part in parts if len(part.time_utc)), None)
