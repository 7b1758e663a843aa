"""The options of `lidarplan place`, and what their words may be."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from planner.placement.ranking import Tier
    from planner.placement.task import Aggregate
    from reconstruct.beam_table import Criterion

CRITERIA: "tuple[Criterion, ...]" = ("vector", "speed", "direction")
AGGREGATES: "tuple[Aggregate, ...]" = ("worst", "mean")

TIERS: "tuple[Tier, ...]" = ("linear", "turbulent")

TierOption = Annotated[
    str,
    typer.Option(
        "--tier",
        metavar="linear|turbulent",
        help="What the search makes small; turbulent ranks and moves the best of the linear tier.",
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
