"""A campaign end to end: measured rays -> winds of every scan and size -> period means; resumable, never half-written.

Each part of the data (a file, or a chunk of a store) is worked on once and its result is kept beside the
output until the run is whole: a run that broke off goes on where it was. Nothing that grows with the campaign
is held in memory.
"""

import hashlib
import shutil
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from geometry.errors import InputError
from planner.analysis_files import (
    Result,
    Retrieved,
    append_fast,
    file_name,
    require_own_files,
    write_fast_parquet,
    write_log,
    write_means,
    write_sonics,
)
from planner.attitude_files import Logged, logged, write_drifts
from planner.beam_files import BeamParts, write_beams
from planner.campaign import Campaign, RayInput
from planner.clocks import ClockLag, clock_lag, trim_sonic
from planner.files.yaml_campaign import Loaded
from planner.kept_parts import Kept, read_kept, write_kept
from planner.mast_file import read_mast
from planner.output import output_folder, require_folder
from planner.pair_retrieval import kept_series, partners_of, retrieve_pair
from planner.plan import Plan
from planner.pointing_log import NOTHING_KNOWN, Known, Pointed, pointed, require_log
from planner.ray_files import Part, gate_of, parts_of
from planner.result_mark import write_mark
from planner.scan_jobs import ScanJob, jobs_of
from planner.scan_retrieval import add_steps, empty_part, retrieve_part
from planner.sum_files import Key, SumFiles
from reconstruct.attitude import LogMeans
from reconstruct.automatic_filter import Agreement
from reconstruct.filters import Step
from reconstruct.losses import Loss, merged_losses
from reconstruct.records import Records, join

VERSION = 4  # of what is kept of a part; another one is worked on anew
WORK = ".parts"
STAGING = "results"

Progress = Callable[[float], None]


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
    plan = Plan(loaded.site)
    require_folder(loaded.campaign.output)
    if restart:
        shutil.rmtree(loaded.campaign.output / WORK, ignore_errors=True)
    loaded, clocks = _clocks_set(loaded, plan)
    campaign, work = loaded.campaign, loaded.campaign.output / WORK / key_of(loaded)
    run = _Run.of(campaign, plan, work)
    sums = SumFiles(work / "sums")
    for item in campaign.inputs:
        require_log(item.attitude)
    shutil.rmtree(work / STAGING, ignore_errors=True)  # of a run that was killed
    with output_folder(campaign.output, within=work / STAGING) as folder:
        merged, beams = _work_through(run, folder, sums, progress)
        gaps = {pair.pair: retrieve_pair(pair, campaign, plan, work, folder, sums) for pair in campaign.pairs}
        two_beam = write_beams(folder, plan.places, run.jobs, beams)
        means = write_means(folder, campaign, _results(run.todo, campaign, plan), sums)
        logs = {name: log for name, each in merged.items() if (log := each.logged) is not None}
        write_drifts(folder, logs)
        trimmed = {
            sonic.name: trim_sonic(sonic, partial(kept_series, work, sonic.scan)) for sonic in campaign.sonics
        }
        write_sonics(folder, {name: wind for name, (_, wind) in trimmed.items()}, campaign)
        found = Retrieved(
            folder=campaign.output,
            steps={name: (*each.steps, *two_beam.get(name, ())) for name, each in merged.items()},
            lost={name: {} if name in run.partners else each.lost for name, each in merged.items()},
            agreements={name: each.agreement for name, each in merged.items()},
            notes={name: each.notes for name, each in merged.items()},
            offsets_deg={name: each.offset_deg for name, each in merged.items()},
            alone=run.alone,
            means=means,
            gaps=gaps,
            drifts=logs,
            clocks=clocks,
            sonics={name: trim for name, (trim, _) in trimmed.items()},
            resumed=sum(each.resumed for each in merged.values()),
        )
        write_fast_parquet(folder)
        write_mark(folder, loaded)
        write_log(folder, (campaign.name, loaded.site.name), found)
    shutil.rmtree(campaign.output / WORK, ignore_errors=True)
    _tell(progress, 1.0)
    return found


@dataclass(frozen=True)
class _Run:
    """What is to be done, and where it is kept until all is done."""

    campaign: Campaign
    plan: Plan
    work: Path
    todo: list[tuple[RayInput, ScanJob]]
    partners: frozenset[str]  # single beams whose rays are in the winds of a pair

    @classmethod
    def of(cls, campaign: Campaign, plan: Plan, work: Path) -> "_Run":
        todo = _jobs(campaign, plan)
        jobs = {job.name: job for _, job in todo}
        require_own_files([*jobs, *(pair.pair for pair in campaign.pairs)])
        require_own_files(sonic.name for sonic in campaign.sonics)
        names = {name for pair in campaign.pairs for name in partners_of(pair, plan, jobs)}
        return cls(campaign, plan, work, todo, frozenset(name for name in names if jobs[name].kind != "fan"))

    @property
    def jobs(self) -> dict[str, ScanJob]:
        """The jobs by the names of their results."""
        return {job.name: job for _, job in self.todo}

    @property
    def alone(self) -> tuple[str, ...]:
        """Beams that meet no other lidar's."""
        return tuple(job.name for _, job in self.todo if job.kind != "fan" and job.name not in self.partners)


def _work_through(
    run: _Run, folder: Path, sums: SumFiles, progress: Progress | None
) -> tuple[dict[str, "_Merged"], BeamParts]:
    """Every part of every job: its single scans written, its sums kept, its counts added up."""
    merged: dict[str, _Merged] = {name: _Merged() for name in run.jobs}
    beams: BeamParts = {}
    for number, (item, job) in enumerate(run.todo):
        filters = item.filters or run.campaign.filters
        own = run.campaign.model_copy(update={"filters": filters})
        for kept, was_there, share in _worked(item, job, own, run.plan, run.work):
            part = kept.part
            merged[job.name].add(kept, was_there=was_there)
            if job.name not in run.partners:
                append_fast(folder, job.name, part.fast)
            for (sector_deg, period_s), each in part.sums.items():
                sums.add(Key(job.name, sector_deg, period_s), each)
            for period_s, radial in part.beams.items():
                beams.setdefault((job.name, period_s), []).append((radial, part.gates_m))
            _tell(progress, (number + share) / (len(run.todo) + bool(run.campaign.pairs)))
    return merged, beams


def key_of(loaded: Loaded) -> str:
    """A name for a campaign and its site: the same for the same settings, another for any other."""
    told = (VERSION, loaded.campaign.model_dump_json(), loaded.site.model_dump_json())
    return hashlib.sha256(repr(told).encode()).hexdigest()[:16]


def _clocks_set(loaded: Loaded, plan: Plan) -> tuple[Loaded, dict[str, ClockLag]]:
    """The campaign with each lidar's clock moved by its lag against the mast, if that is asked for."""
    campaign = loaded.campaign
    if campaign.time_lag.against == "none" or campaign.mast is None:
        return loaded, {}
    mast, longest_s = read_mast(campaign.mast), campaign.time_lag.longest_s
    work = campaign.output / WORK / f"{key_of(loaded)}-clocks"
    found: dict[str, ClockLag] = {}
    inputs = []
    for item in campaign.inputs:
        job = _jobs(campaign.model_copy(update={"inputs": (item,)}), plan)[0][1]
        job = job._replace(sizes=job.sizes[:1])  # the rays at the target are wanted, no wind
        series = (kept.part.series for kept, _, _ in _worked(item, job, campaign, plan, work))
        lag = found[job.name] = clock_lag(series, mast, longest_s=longest_s)
        late_s = lag.lag_s if np.isfinite(lag.lag_s) else 0.0
        offsets = item.offsets.model_copy(update={"clock_s": item.offsets.clock_s - late_s})
        inputs.append(item.model_copy(update={"offsets": offsets}))
    return loaded._replace(campaign=campaign.model_copy(update={"inputs": tuple(inputs)})), found


def _jobs(campaign: Campaign, plan: Plan) -> list[tuple[RayInput, ScanJob]]:
    """What is to be done, in the order of the inputs."""
    return [
        (item, job)
        for item in campaign.inputs
        for job in jobs_of(
            plan.layout[item.scan],
            plan.places,
            item,
            sizes_deg=campaign.sizes_deg,
            columns=campaign.columns,
        )
    ]


def _results(todo: list[tuple[RayInput, ScanJob]], campaign: Campaign, plan: Plan) -> dict[str, Result]:
    """Height and usual interval of the winds of each scan; those of a pair come as often as its slowest scan."""
    found = {job.name: Result(job.height_m, job.layout.scan.period_s) for _, job in todo}
    for each in campaign.pairs:
        pair = plan.site.pair(each.pair)
        slowest_s = max(plan.layout[scan].scan.period_s for scan in pair.scans)
        found[each.pair] = Result(plan.places.height_above_ground_m(pair.target), slowest_s)
    return found


class _Merged:
    """Counts and notes of the parts of one scan, added up."""

    def __init__(self) -> None:
        self.steps: tuple[Step, ...] = ()
        self.lost: dict[str, int] = {}
        self.resumed = 0  # parts that an earlier run had done
        self.agreement = Agreement(0, 0, 0, 0)
        self._notes: tuple[str, ...] = ()
        self._losses: tuple[Loss, ...] = ()
        self.offset_deg = 0.0
        self._logs: list[LogMeans] = []
        self._unlogged = 0

    @property
    def notes(self) -> tuple[str, ...]:
        """What there is to say of the parts, each once, and what was lost of all of them together."""
        return (*self._notes, *(f"lost: {loss}" for loss in self._losses))

    @property
    def logged(self) -> Logged | None:
        """What the log of the attitude showed."""
        return logged(self._logs, self._unlogged)

    def add(self, kept: Kept, *, was_there: bool) -> None:
        """Count another part."""
        self.resumed += was_there
        self.steps = add_steps(self.steps, kept.part.steps)
        for reason, count in kept.part.lost.items():
            self.lost[reason] = self.lost.get(reason, 0) + count
        both = zip(self.agreement, kept.part.agreement, strict=True)
        self.agreement = Agreement(*(one + other for one, other in both))
        self._notes = tuple(dict.fromkeys((*self._notes, *kept.notes)))
        self._losses = merged_losses([*self._losses, *kept.losses])
        self.offset_deg = max(self.offset_deg, kept.part.offset_deg, key=abs)
        self._logs += [] if kept.log is None else [kept.log]
        self._unlogged += kept.unlogged


def _worked(
    item: RayInput, job: ScanJob, campaign: Campaign, plan: Plan, work: Path
) -> Iterator[tuple[Kept, bool, float]]:
    """The parts of one input, each worked on or taken from an earlier run, with the share that is done."""
    pending: Records | None = None
    known, log = NOTHING_KNOWN, require_log(item.attitude)
    parts = parts_of(item, job.layout, plan.places, job.range_m, rays=campaign.chunk_rays)
    for number, (part, last) in enumerate(_with_last(parts)):
        place = work / f"{file_name(job.name)}-{number:06d}.npz"
        mark = f"{part.fingerprint} {_ends_of(pending)} {last} {known} {log}"
        kept = read_kept(place, mark)
        was_there = kept is not None
        if kept is None:
            kept = _work(part, pending, known, item, job, campaign, plan, last=last)
            write_kept(place, mark, kept)
        pending, known = kept.pending, kept.known
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
    known: Known,
    item: RayInput,
    job: ScanJob,
    campaign: Campaign,
    plan: Plan,
    *,
    last: bool,
) -> Kept:
    found, notes, losses = _loaded(part, known, item, job, plan)
    records = None if found is None else found.records
    if pending is not None:
        records = pending if records is None else join([pending, records])
    shown = (known, None, 0) if found is None else (found.known, found.log, found.unlogged)
    told = (notes, losses, *shown)
    if records is None or not records.rays:
        return Kept(empty_part(), None, *told)
    later: Records | None = None
    final = records.sweep_id == records.sweep_id[-1]
    goes_on = not (last or part.whole or job.rays_stand_alone)
    if goes_on and np.count_nonzero(final) <= campaign.chunk_rays:  # a pass that never ends is cut
        records, later = records.at_rays(~final), records.at_rays(final)
        later = replace(later, notes=(), losses=())
    worked = retrieve_part(records, job, campaign) if records.rays else empty_part()
    return Kept(worked, later, *told)


def _loaded(
    part: Part, known: Known, item: RayInput, job: ScanJob, plan: Plan
) -> tuple[Pointed | None, tuple[str, ...], tuple[Loss, ...]]:
    """The rays of a part at the gate, what there is to say of them, and what was lost; a bad file among others is a note."""
    try:
        found = pointed(part.load(), item, job.layout, plan.places, known)
    except InputError as error:
        if part.alone:
            raise
        return None, (f"lost: {error}",), ()
    records = gate_of(found.records, job.layout, job.range_m)
    return found._replace(records=records), records.notes, records.losses


def _tell(progress: Progress | None, share: float) -> None:
    if progress is not None:
        progress(min(share, 1.0))
