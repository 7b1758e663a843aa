"""Limits by eye: the rays are shown, limits asked for, the result shown, until it is approved."""

import sys
from pathlib import Path
from typing import TYPE_CHECKING

from planner.commands.options import say

if TYPE_CHECKING:
    from planner.campaign import Campaign, Filters, RayInput
    from planner.files.yaml_campaign import Loaded
    from planner.plan import Plan
    from planner.scan_jobs import ScanJob
    from reconstruct.scan_grid import ScanGrid

YES = ("y", "yes")
NO = ("n", "no")


def asked(loaded: "Loaded") -> "Campaign":
    """Ask for the limits of every scan; the campaign with those that were approved.

    Answers are read from standard input, a line each: two numbers, or nothing for the automatic filter.

    Raises
    ------
    InputError
        If the answers end before limits are approved.
    """
    from planner.plan import Plan

    plan, campaign = Plan(loaded.site), loaded.campaign
    inputs = tuple(
        item.model_copy(update={"filters": _approved(item, campaign, plan)}) for item in campaign.inputs
    )
    return campaign.model_copy(update={"inputs": inputs})


def _approved(item: "RayInput", campaign: "Campaign", plan: "Plan") -> "Filters":
    """The limits of one scan, asked for until they are approved."""
    from planner.analysis_files import told
    from planner.scan_retrieval import filter_rays

    job = _first_job(item, campaign, plan)
    grid, rays = _first_rays(item, job, campaign, plan)
    folder, name = campaign.output, item.scan
    say(f"{name}: {rays} rays, unfiltered: {_drawn(folder, name, 'unfiltered', grid, None)}")
    while True:
        cnr = _limits(f"{name}: CNR [dB], lowest and highest (such as -25 -5; nothing: automatic): ")
        speed = _limits(f"{name}: radial speed [m/s], lowest and highest (nothing: automatic): ")
        filters = (item.filters or campaign.filters).model_copy(
            update={"cnr_db": cnr, "radial_speed_mps": speed, "automatic": "auto"}
        )
        values, steps, _ = filter_rays(grid, filters, period_s=plan.layout[name].scan.period_s)
        for step in steps:
            say(f"{name}: {told(step)}")
        say(f"{name}: filtered: {_drawn(folder, name, 'filtered', grid, values)}")
        if _yes(f"{name}: approve? [y/n] "):
            return filters


def _first_job(item: "RayInput", campaign: "Campaign", plan: "Plan") -> "ScanJob":
    """The scan's, or that of its first point or gate: limits are one for all."""
    from planner.scan_jobs import jobs_of

    layout = plan.layout[item.scan]
    return jobs_of(layout, plan.places, item, sizes_deg=campaign.sizes_deg, columns=campaign.columns)[0]


def _first_rays(
    item: "RayInput", job: "ScanJob", campaign: "Campaign", plan: "Plan"
) -> "tuple[ScanGrid, int]":
    """Scans of the first part of an input; of a slice or raster at the gate in the middle."""
    from geometry.errors import InputError
    from planner.ray_files import at_gate, parts_of
    from planner.scan_jobs import gridded

    part = next(parts_of(item, job.layout, plan.places, job.range_m, rays=campaign.chunk_rays), None)
    if part is None:
        raise InputError(f"scan '{item.scan}' has no rays to choose limits from")
    records = at_gate(part.load(), item, job.layout, plan.places, job.range_m)
    middle = records.gates // 2
    return gridded(records.at_gates(slice(middle, middle + 1)), job).grid, records.rays


def _drawn(folder: Path, scan: str, what: str, grid: "ScanGrid", after: object) -> Path:
    import numpy as np

    from planner.analysis_files import file_name
    from planner.figures.rays import rays
    from planner.output import write_bytes

    path = folder / f"rays_{file_name(scan)}_{what}.png"
    left = None if after is None else np.asarray(after)
    write_bytes(path, rays(grid.radial_speed_mps, grid.cnr_db, left, title=f"{scan}, {what}"))
    return path


def _limits(question: str) -> tuple[float, float] | None:
    """Two rising numbers, asked for again until they are; None for an empty line."""
    while True:
        answer = _answer(question).replace(",", " ").split()
        if not answer:
            return None
        try:
            low, high = (float(part) for part in answer)
        except ValueError:
            low, high = 1.0, 0.0
        if low < high:
            return low, high
        say(f"{' '.join(answer)} came; two numbers are needed, the lower one first, or nothing")


def _yes(question: str) -> bool:
    while True:
        answer = _answer(question).strip().lower()
        if answer in (*YES, *NO):
            return answer in YES
        say(f"{answer or 'nothing'} came; answer y or n")


def _answer(question: str) -> str:
    from geometry.errors import InputError

    print(question, end="", flush=True)  # noqa: T201
    line = sys.stdin.readline()
    if not line:
        raise InputError("the answers ended before limits were approved: nothing was retrieved")
    return line
