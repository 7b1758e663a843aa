"""`lidarplan place SITE`: ranked lidar positions and maps."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

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
    from geometry.terrain import HeightRaster
    from planner.placement.refine import SoftCost
    from planner.placement.task import Aggregate, Limits, Task
    from planner.site import Site
    from reconstruct.beam_table import Criterion

CRITERIA: "tuple[Criterion, ...]" = ("vector", "speed", "direction")
AGGREGATES: "tuple[Aggregate, ...]" = ("worst", "mean")

TIERS = ("linear", "turbulent")

TierOption = Annotated[
    str,
    typer.Option(
        "--tier",
        metavar="linear|turbulent",
        help="Of the errors told: the search is by the linear tier, turbulent adds its own to each place.",
    ),
]
CountOption = Annotated[
    int | None,
    typer.Option(
        "--count",
        metavar="N",
        min=1,
        max=4,
        help="Lidars to place, 1 to 4. [default: what the site suggests]",
    ),
]
LidarOption = Annotated[
    list[str] | None,
    typer.Option(
        "--lidar",
        metavar="NAME",
        help="A lidar that stands where it is; may be given several times. [default: the first pair's but its last]",
    ),
]
TargetOption = Annotated[
    list[str] | None,
    typer.Option("--target", metavar="NAME", help="A target that counts; may be given several times."),
]
CriterionOption = Annotated[
    str, typer.Option("--criterion", metavar="vector|speed|direction", help="Whose error is to be small.")
]
AggregateOption = Annotated[
    str, typer.Option("--of", metavar="worst|mean", help="At the worst target, or the mean of all.")
]
GridOption = Annotated[
    int, typer.Option("--grid", metavar="N", min=5, max=400, help="Candidates along each side.")
]
ReachOption = Annotated[
    float | None, typer.Option("--reach", metavar="M", help="How far from the targets the candidates go.")
]
RangeOption = Annotated[float | None, typer.Option("--max-range", metavar="M", help="Farthest range.")]
SteepOption = Annotated[float | None, typer.Option("--max-elevation", metavar="DEG", help="Steepest beam.")]
OpeningOption = Annotated[
    float | None, typer.Option("--min-opening", metavar="DEG", help="Least angle at which beams cross.")
]
LostOption = Annotated[
    float | None,
    typer.Option("--max-lost", metavar="SHARE", help="Most of the wanted wind that wakes may take."),
]
HeadOption = Annotated[
    float | None, typer.Option("--head-height", metavar="M", help="Of the scanner head above the ground.")
]
NearOption = Annotated[
    Path | None, typer.Option("--near", metavar="FILE", help="GIS file of roads or power lines to stay near.")
]
NearCostOption = Annotated[
    float,
    typer.Option(
        "--near-cost", metavar="PER_KM", help="What a kilometre from them costs, in the criterion's unit."
    ),
]
SchedulerOption = Annotated[
    str | None,
    typer.Option(
        "--scheduler", metavar="tcp://HOST:PORT", help="A dask scheduler to work on. [default: this machine]"
    ),
]
ResumeOption = Annotated[
    Path | None,
    typer.Option(
        "--resume", metavar="FILE", help="Keeps what is done, so that a run that breaks off goes on."
    ),
]


def register(app: typer.Typer) -> None:
    """Add the command to the application."""
    app.command("place")(place)


def place(
    site: SiteArgument,
    count: CountOption = None,
    lidar: LidarOption = None,
    target: TargetOption = None,
    criterion: CriterionOption = "vector",
    of: AggregateOption = "worst",
    grid: GridOption = 100,
    reach: ReachOption = None,
    max_range: RangeOption = None,
    max_elevation: SteepOption = None,
    min_opening: OpeningOption = None,
    max_lost: LostOption = None,
    head_height: HeadOption = None,
    tier: TierOption = "linear",
    near: NearOption = None,
    near_cost: NearCostOption = 0.01,
    scheduler: SchedulerOption = None,
    resume: ResumeOption = None,
    out: OutOption = DEFAULT_OUT,
    json: JsonOption = False,
    quiet: QuietOption = False,
) -> None:
    """Where to put lidars: ranked places, what binds them, and maps of every criterion."""
    from dataclasses import replace

    from planner.commands.choices import chosen, within
    from planner.commands.progress import shown
    from planner.figures.placement_map import criteria_maps, error_map
    from planner.files.yaml_site import load_site
    from planner.output import output_folder, require_folder
    from planner.placement.fan_out import How
    from planner.placement.maps import default_grid
    from planner.placement.ranking import place as ranked_places
    from planner.placement.ranking import standing_remarks
    from planner.placement.task import on_terrain, task_of
    from planner.placement.write import rows_of, turbulent_lines, write_all

    within("--reach", reach, 0.0, open_below=True)
    within("--head-height", head_height, 0.0)
    within("--near-cost", near_cost, 0.0)
    require_folder(out)
    read = load_site(site)
    task = task_of(
        read, fixed=None if lidar is None else tuple(lidar), count=count, targets=tuple(target or ())
    )
    terrain = _terrain(read)
    if terrain is not None:
        task = on_terrain(task, terrain)
    task = replace(
        task,
        criterion=chosen("--criterion", criterion, CRITERIA),
        aggregate=chosen("--of", of, AGGREGATES),
        limits=_limits(task, max_range, max_elevation, min_opening, max_lost),
        head_height_m=task.head_height_m if head_height is None else head_height,
    )
    cost = None if near is None else _near_cost(near, read.crs, near_cost)
    with shown("placing", quiet=quiet) as progress:
        how = How(scheduler=scheduler, checkpoint=resume, progress=progress)
        found = ranked_places(task, default_grid(task, count=grid, reach_m=reach), how=how, cost=cost)
    with output_folder(out) as folder:
        names, lacking = write_all(found, folder)
        (folder / "place.png").write_bytes(error_map(found))
        (folder / "place-criteria.png").write_bytes(criteria_maps(found))
    files = [str(out / name) for name in (*names, "place.png", "place-criteria.png")]
    remarks = standing_remarks(task)
    rows = rows_of(found, turbulent=chosen("--tier", tier, TIERS) == "turbulent")
    if json:
        say_json({"why": found.why, "remarks": list(remarks), "places": rows, "files": files})
        return
    for item in found.ranked:
        say(f"{item.rank}. {item.text}")
    if found.declared:
        say(f"declared: {found.declared.text}")
    say(f"why: {found.why}")
    for text in turbulent_lines(rows) if tier == "turbulent" else ():
        say(text)
    for text in (*remarks, *([f"no GeoTIFF: {lacking}"] if lacking else [])):
        remark(text, quiet=quiet)
    remark(
        f"Errors: linear tier, one retrieval, over the site's wind. Files in {out}: {', '.join(names)}, place.png",
        quiet=quiet,
    )


def _limits(
    task: "Task",
    max_range: float | None,
    max_elevation: float | None,
    min_opening: float | None,
    max_lost: float | None,
) -> "Limits":
    from planner.commands.choices import within

    within("--max-range", max_range, 0.0, open_below=True)
    within("--max-elevation", max_elevation, 0.0, 90.0, open_below=True)
    within("--min-opening", min_opening, 0.0, 90.0)
    within("--max-lost", max_lost, 0.0, 1.0)
    given = {
        "most_range_m": max_range,
        "most_elevation_deg": max_elevation,
        "least_opening_deg": min_opening,
        "most_lost_share": max_lost,
    }
    return task.limits._replace(**{name: value for name, value in given.items() if value is not None})


def _near_cost(file: Path, crs: str, per_km: float) -> "SoftCost":
    from planner.placement.areas import distance_m

    return lambda places_m: per_km / 1000.0 * distance_m(file, crs, places_m)


def _terrain(site: "Site") -> "HeightRaster | None":
    if site.terrain is None:
        return None
    from planner.files.raster import load_terrain

    return load_terrain(
        site.terrain.file,
        crs=site.crs,
        height_datum=site.height_datum,
        declared_datum=site.terrain.height_datum,
        geoid_undulation_m=site.geoid_undulation_m,
        surface=site.terrain.surface,
    )
