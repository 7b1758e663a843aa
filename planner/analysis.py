"""A campaign end to end: measured rays -> winds of every scan and size -> period means; resumable, never half-written.

Each part of the data (a file, or a chunk of a store) is worked on once and its result is kept beside the
output until the run is whole: a run that broke off goes on where it was. Nothing that grows with the campaign
is held in memory but the sums of its periods.
"""

import hashlib
import json
import shutil
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from geometry.arrays import FloatArray
from geometry.errors import InputError
from planner.campaign import Campaign, PairInput, RayInput
from planner.files.yaml_campaign import Loaded
from planner.kept_parts import Kept, read_kept, read_series, write_kept
from planner.output import output_folder
from planner.plan import Plan
from planner.ray_files import Part, at_gate, parts_of
from planner.scan_retrieval import ScanJob, empty_part, job_of, periods_of, retrieve_part, wind_table
from reconstruct.automatic_filter import Agreement
from reconstruct.averaging import PeriodSums, TimeArray, add_sums, means_of, period_sums
from reconstruct.filters import Step
from reconstruct.pairing import GapResult, RaySeries, compare_gaps, dual_wind
from reconstruct.records import Records, join

if TYPE_CHECKING:
    import pandas as pd

VERSION = 1  # of what is kept of a part; another one is worked on anew
WORK = ".parts"
UNSYNCHRONISED_GAP_S = 5.0  # the study's best
NO_SIZE = 0.0  # stands for the sector size of a pair among keys: NaN equals nothing, not even itself

Progress = Callable[[float], None]


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


def retrieve(loaded: Loaded, *, restart: bool = False, progress: Progress | None = None) -> Retrieved:
    """Retrieve the wind of a campaign and write its tables.

    Parameters
    ----------
    loaded
        The campaign and its site.
    restart
        Work on every part anew, whatever an earlier run has done.
    progress
        Gets the share of the work that is done, 0 to 1.

    Returns
    -------
    Retrieved

    Raises
    ------
    InputError
        If data cannot be read, or no scan gives any wind.
    """
    campaign, plan = loaded.campaign, Plan(loaded.site)
    work = campaign.output / WORK / key_of(loaded)
    if restart:
        shutil.rmtree(campaign.output / WORK, ignore_errors=True)
    steps, agreements, notes, offsets = {}, {}, {}, {}
    sums: dict[tuple[str, float, float], list[PeriodSums]] = {}
    resumed = 0
    with output_folder(campaign.output) as folder:
        for number, item in enumerate(campaign.inputs):
            job = job_of(plan.layout[item.scan], plan.places, campaign.sizes_deg)
            merged = _Merged()
            own = campaign if item.filters is None else campaign.model_copy(update={"filters": item.filters})
            for kept, was_there, share in _worked(item, job, own, plan, work):
                merged.add(kept)
                resumed += was_there
                _append_fast(folder, item.scan, kept.part.fast)
                for (sector_deg, period_s), part in kept.part.sums.items():
                    sums.setdefault((item.scan, sector_deg, period_s), []).append(part)
                _tell(progress, (number + share) / (len(campaign.inputs) + bool(campaign.pairs)))
            steps[item.scan], agreements[item.scan] = merged.steps, merged.agreement
            notes[item.scan], offsets[item.scan] = merged.notes, merged.offset_deg
        gaps = {}
        for pair in campaign.pairs:
            gaps[pair.pair] = _retrieve_pair(pair, campaign, plan, work, folder, sums)
        means = _write_means(folder, campaign, plan, sums)
        found = Retrieved(campaign.output, steps, agreements, notes, offsets, means, gaps, resumed)
        _write_fast_parquet(folder)
        _write_log(folder, loaded, found)
    shutil.rmtree(campaign.output / WORK, ignore_errors=True)
    _tell(progress, 1.0)
    return found


def key_of(loaded: Loaded) -> str:
    """A name for a campaign and its site: the same for the same settings, another for any other."""
    told = (VERSION, loaded.campaign.model_dump_json(), loaded.site.model_dump_json())
    return hashlib.sha256(repr(told).encode()).hexdigest()[:16]


def file_name(scan: str) -> str:
    """A scan's name as part of a file's name.

    Examples
    --------
    >>> file_name("stare K/1")
    'stare_K_1'
    """
    return "".join(letter if letter.isalnum() or letter in "-." else "_" for letter in scan)


class _Merged:
    """Counts and notes of the parts of one scan, added up."""

    def __init__(self) -> None:
        self._steps: dict[str, Step] = {}
        self.agreement = Agreement(0, 0, 0, 0)
        self.notes: tuple[str, ...] = ()
        self.offset_deg = 0.0

    @property
    def steps(self) -> tuple[Step, ...]:
        """One of each name, in their order."""
        return tuple(self._steps.values())

    def add(self, kept: Kept) -> None:
        """Count another part."""
        for step in kept.part.steps:
            self._steps[step.name] = self._steps[step.name] + step if step.name in self._steps else step
        both = zip(self.agreement, kept.part.agreement, strict=True)
        self.agreement = Agreement(*(one + other for one, other in both))
        self.notes = tuple(dict.fromkeys((*self.notes, *kept.notes)))
        self.offset_deg = max(self.offset_deg, kept.part.offset_deg, key=abs)


def _worked(
    item: RayInput, job: ScanJob, campaign: Campaign, plan: Plan, work: Path
) -> Iterator[tuple[Kept, bool, float]]:
    """The parts of one input, each worked on or taken from an earlier run, with the share that is done."""
    pending: Records | None = None
    parts = parts_of(item, job.layout, plan.places, rays=campaign.chunk_rays)
    for number, (part, last) in enumerate(_with_last(parts)):
        place = work / f"{file_name(item.scan)}-{number:06d}.npz"
        mark = f"{part.fingerprint} {_ends_of(pending)} {last}"
        kept = read_kept(place, mark)
        was_there = kept is not None
        if kept is None:
            kept = _work(part, pending, item, job, campaign, plan, last=last)
            write_kept(place, mark, kept)
        pending = kept.pending
        yield kept, was_there, part.share


def _with_last(parts: Iterator[Part]) -> Iterator[tuple[Part, bool]]:
    """Each part, and whether it is the last."""
    part = next(parts, None)
    while part is not None:
        following = next(parts, None)
        yield part, following is None
        part = following


def _ends_of(pending: Records | None) -> str:
    return "" if pending is None else f"{pending.time_utc[0]} {pending.rays}"


def _work(
    part: Part,
    pending: Records | None,
    item: RayInput,
    job: ScanJob,
    campaign: Campaign,
    plan: Plan,
    *,
    last: bool,
) -> Kept:
    records, notes = _loaded(part, item, job, plan)
    if pending is not None:
        records = pending if records is None else join([pending, records])
    if records is None or not records.rays:
        return Kept(empty_part(), None, notes)
    later: Records | None = None
    if not last and job.layout.scan.count > 1:
        final = records.sweep_id == records.sweep_id[-1]
        records, later = records.at_rays(~final), records.at_rays(final)
        later = replace(later, notes=(), losses=())
    worked = retrieve_part(records, job, campaign) if records.rays else empty_part()
    return Kept(worked, later, notes)


def _loaded(part: Part, item: RayInput, job: ScanJob, plan: Plan) -> tuple[Records | None, tuple[str, ...]]:
    """The rays of a part at the gate, and what there is to say of them; a bad file among others is a note."""
    try:
        records = at_gate(part.load(), item, job.layout, plan.places)
    except InputError as error:
        if part.alone:
            raise
        return None, (f"lost: {error}",)
    return records, (*records.notes, *(f"lost: {loss}" for loss in records.losses))


def _append_fast(folder: Path, scan: str, fast: Mapping[str, FloatArray | TimeArray]) -> None:
    """Add the winds of a part to the scan's table."""
    import pandas as pd

    if not fast:
        return
    path = folder / f"fast_{file_name(scan)}.csv"
    frame = pd.DataFrame(fast).sort_values(["time_utc", "sector_deg"], ascending=[True, False], kind="stable")
    frame.to_csv(path, mode="a", header=not path.exists(), index=False, float_format="%.5f", encoding="utf-8")


def _write_fast_parquet(folder: Path) -> None:
    """Write every table of single scans as Parquet too, row group by row group."""
    import duckdb

    with duckdb.connect() as connection:
        for path in sorted(folder.glob("fast_*.csv")):
            source, target = (str(name).replace("'", "''") for name in (path, path.with_suffix(".parquet")))
            connection.execute(f"COPY (SELECT * FROM read_csv('{source}')) TO '{target}' (FORMAT parquet)")


def _write_means(
    folder: Path, campaign: Campaign, plan: Plan, sums: dict[tuple[str, float, float], list[PeriodSums]]
) -> dict[float, "pd.DataFrame"]:
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


# Pairs


def _retrieve_pair(
    pair: PairInput,
    campaign: Campaign,
    plan: Plan,
    work: Path,
    folder: Path,
    sums: dict[tuple[str, float, float], list[PeriodSums]],
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
        _append_fast(folder, pair.pair, table)
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


# The log


def _write_log(folder: Path, loaded: Loaded, found: Retrieved) -> None:
    """Write what was turned, taken away and found, as text, and the same counts for machines."""
    lines = [f"campaign {loaded.campaign.name}, site {loaded.site.name}"]
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
        lines += [f"  gap up to {gap.gap_s:g} s: {gap.pairs} pairs, {gap.share:.1%} of the rays" for gap in gaps]
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


def _tell(progress: Progress | None, share: float) -> None:
    if progress is not None:
        progress(min(share, 1.0))
