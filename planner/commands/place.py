"""`lidarplan place SITE`: ranked lidar positions and maps."""

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from planner.commands import place_options as given
from planner.commands.options import (
    DEFAULT_OUT,
    JsonOption,
    OutOption,
    QuietOption,
    SiteArgument,
    remark,
    say,
    say_json,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from planner.placement.ranking import Placement
    from planner.placement.refine import SoftCost
    from planner.placement.task import Task


def register(app: typer.Typer) -> None:
    """Add the command to the application."""
    app.command("place", short_help="Where to put lidars, ranked, with maps.")(place)


def place(
    site: SiteArgument,
    count: given.CountOption = None,
    lidar: given.LidarOption = None,
    target: given.TargetOption = None,
    criterion: given.CriterionOption = "vector",
    of: given.AggregateOption = "worst",
    grid: given.GridOption = 100,
    reach: given.ReachOption = None,
    max_range: given.RangeOption = None,
    max_elevation: given.SteepOption = None,
    min_opening: given.OpeningOption = None,
    max_lost: given.LostOption = None,
    head_height: given.HeadOption = None,
    tier: given.TierOption = "linear",
    near: given.NearOption = None,
    near_cost: given.NearCostOption = 0.01,
    scheduler: given.SchedulerOption = None,
    resume: given.ResumeOption = None,
    out: OutOption = DEFAULT_OUT,
    json: JsonOption = False,
    quiet: QuietOption = False,
) -> None:
    """Where to put lidars: ranked places, what binds them, and maps of the error and of what hinders."""
    from planner.commands.choices import chosen, within
    from planner.commands.progress import shown
    from planner.output import require_folder
    from planner.placement.fan_out import How
    from planner.placement.maps import default_grid
    from planner.placement.ranking import place as ranked_places
    from planner.placement.ranking import ranked_by

    within("--reach", reach, 0.0, open_below=True)
    within("--head-height", head_height, 0.0)
    by = chosen("--tier", tier, given.TIERS)
    require_folder(out)
    limits = _limits(max_range, max_elevation, min_opening, max_lost)
    task = _task(site, count, lidar, target or (), criterion, of, limits, head_height)
    cost = _near_cost(near, task.site.crs, near_cost)
    with shown("placing", quiet=quiet) as progress:
        how = How(scheduler=scheduler, checkpoint=resume, progress=progress)
        candidates = default_grid(task, count=grid, reach_m=reach)
        found = ranked_places(task, candidates, how=how, cost=cost, tier=by)
    _tell(found, *_written(found, out), ranked_by(task, by, cost=cost is not None), json=json, quiet=quiet)


def _task(
    site: str,
    count: int | None,
    fixed: "Sequence[str] | None",
    targets: "Sequence[str]",
    criterion: str,
    of: str,
    limits: dict[str, float],
    head_height: float | None,
) -> "Task":
    """The task that the site suggests, with what was given in its place."""
    from dataclasses import replace

    from planner.commands.choices import chosen
    from planner.files.yaml_site import load_site
    from planner.placement.task import task_of

    standing = None if fixed is None else tuple(fixed)
    task = task_of(load_site(site), fixed=standing, count=count, targets=tuple(targets))
    return replace(
        task,
        criterion=chosen("--criterion", criterion, given.CRITERIA),
        aggregate=chosen("--of", of, given.AGGREGATES),
        limits=task.limits._replace(**limits),
        head_height_m=task.head_height_m if head_height is None else head_height,
    )


def _written(found: "Placement", out: Path) -> tuple[list[str], str | None]:
    """Write tables, maps and figures; gives the files, and why there is no GeoTIFF."""
    from planner.figures.placement_map import criteria_maps, error_map, sight_map
    from planner.output import output_folder
    from planner.placement.write import write_all

    pictures = {"place.png": error_map(found), "place-criteria.png": criteria_maps(found)}
    if (in_sight := sight_map(found)) is not None:
        pictures["place-sight.png"] = in_sight
    with output_folder(out) as folder:
        names, lacking = write_all(found, folder)
        for name, picture in pictures.items():
            (folder / name).write_bytes(picture)
    return [str(out / name) for name in (*names, *pictures)], lacking


def _tell(
    found: "Placement", files: list[str], lacking: str | None, ranked: str, *, json: bool, quiet: bool
) -> None:
    """Print the ranking, and what it is by."""
    from planner.placement.ranking import standing_remarks
    from planner.placement.write import rows_of

    remarks = standing_remarks(found.task)
    if json:
        say_json({"why": found.why, "remarks": list(remarks), "places": rows_of(found), "files": files})
        return
    for item in found.ranked:
        say(f"{item.rank}. {item.text}")
    if found.declared:
        say(f"declared: {found.declared.text}")
    say(f"why: {found.why}")
    for text in (*remarks, *([f"no GeoTIFF: {lacking}"] if lacking else [])):
        remark(text, quiet=quiet)
    turbulent = found.ranked[0].turbulent is not None
    kind = "without and with turbulence; the search was by the latter" if turbulent else "linear tier"
    folder, names = Path(files[0]).parent, ", ".join(Path(file).name for file in files)
    remark(
        f"{ranked}. Errors: {kind}, one retrieval, over the site's wind. Files in {folder}: {names}",
        quiet=quiet,
    )


def _limits(
    max_range: float | None, max_elevation: float | None, min_opening: float | None, max_lost: float | None
) -> dict[str, float]:
    """The limits that were given, by their names in `Limits`."""
    from planner.commands.choices import within

    within("--max-range", max_range, 0.0, open_below=True)
    within("--max-elevation", max_elevation, 0.0, 90.0, open_below=True)
    within("--min-opening", min_opening, 0.0, 90.0)
    within("--max-lost", max_lost, 0.0, 1.0)
    wanted = {
        "most_range_m": max_range,
        "most_elevation_deg": max_elevation,
        "least_opening_deg": min_opening,
        "most_lost_share": max_lost,
    }
    return {name: value for name, value in wanted.items() if value is not None}


def _near_cost(file: Path | None, crs: str, per_km: float) -> "SoftCost | None":
    """What it costs to be far from the things of a file, in the criterion's unit."""
    from planner.commands.choices import within
    from planner.placement.areas import far_cost

    within("--near-cost", per_km, 0.0)
    return None if file is None else partial(far_cost, file, crs, per_km)
