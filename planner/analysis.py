"""A campaign end to end: measured rays -> winds of every scan and size -> period means; resumable, never half-written.

Each part of the data (a file, or a chunk of a store) is worked on once and its result is kept beside the
output until the run is whole: a run that broke off goes on where it was. Nothing that grows with the campaign
is held in memory but the sums of its periods.
"""

import hashlib
import shutil
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from geometry.errors import InputError
from planner.analysis_files import (
    Retrieved,
    Sums,
    append_fast,
    file_name,
    write_fast_parquet,
    write_log,
    write_means,
)
from planner.campaign import Campaign, RayInput
from planner.files.yaml_campaign import Loaded
from planner.kept_parts import Kept, read_kept, write_kept
from planner.output import output_folder
from planner.pair_retrieval import retrieve_pair
from planner.plan import Plan
from planner.ray_files import Part, at_gate, parts_of
from planner.scan_retrieval import ScanJob, empty_part, job_of, retrieve_part
from reconstruct.automatic_filter import Agreement
from reconstruct.filters import Step
from reconstruct.records import Records, join

if TYPE_CHECKING:
    pass

VERSION = 1  # of what is kept of a part; another one is worked on anew
WORK = ".parts"

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
    campaign, plan = loaded.campaign, Plan(loaded.site)
    work = campaign.output / WORK / key_of(loaded)
    if restart:
        shutil.rmtree(campaign.output / WORK, ignore_errors=True)
    steps, agreements, notes, offsets = {}, {}, {}, {}
    sums: Sums = {}
    resumed = 0
    with output_folder(campaign.output) as folder:
        for number, item in enumerate(campaign.inputs):
            job = job_of(plan.layout[item.scan], plan.places, campaign.sizes_deg)
            merged = _Merged()
            own = campaign if item.filters is None else campaign.model_copy(update={"filters": item.filters})
            for kept, was_there, share in _worked(item, job, own, plan, work):
                merged.add(kept)
                resumed += was_there
                append_fast(folder, item.scan, kept.part.fast)
                for (sector_deg, period_s), part in kept.part.sums.items():
                    sums.setdefault((item.scan, sector_deg, period_s), []).append(part)
                _tell(progress, (number + share) / (len(campaign.inputs) + bool(campaign.pairs)))
            steps[item.scan], agreements[item.scan] = merged.steps, merged.agreement
            notes[item.scan], offsets[item.scan] = merged.notes, merged.offset_deg
        gaps = {}
        for pair in campaign.pairs:
            gaps[pair.pair] = retrieve_pair(pair, campaign, plan, work, folder, sums)
        means = write_means(folder, campaign, plan, sums)
        found = Retrieved(campaign.output, steps, agreements, notes, offsets, means, gaps, resumed)
        write_fast_parquet(folder)
        write_log(folder, (campaign.name, loaded.site.name), found)
    shutil.rmtree(campaign.output / WORK, ignore_errors=True)
    _tell(progress, 1.0)
    return found


def key_of(loaded: Loaded) -> str:
    """A name for a campaign and its site: the same for the same settings, another for any other."""
    told = (VERSION, loaded.campaign.model_dump_json(), loaded.site.model_dump_json())
    return hashlib.sha256(repr(told).encode()).hexdigest()[:16]


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


def _tell(progress: Progress | None, share: float) -> None:
    if progress is not None:
        progress(min(share, 1.0))
