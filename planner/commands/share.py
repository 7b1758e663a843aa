"""`lidarplan share SITE`: several heights or targets for the same lidars, and the error that each gets."""

from typing import TYPE_CHECKING, Annotated

import typer

from planner.commands.options import JsonOption, QuietOption, SiteArgument, names_in, remark, say_json

if TYPE_CHECKING:
    from planner.placement.sharing import Shared

LidarsOption = Annotated[
    str | None,
    typer.Option(
        "--lidars",
        metavar="NAME,...",
        help="Lidars that share; one alone by its sector scan. [default: the first pair's, else all]",
    ),
]
TargetsOption = Annotated[
    str | None, typer.Option("--targets", metavar="NAME,...", help="Targets that share them. [default: all]")
]


def register(app: typer.Typer) -> None:
    """Add the command to the application."""
    app.command("share", short_help="Several heights or targets for the same lidars.")(share)


def share(
    site: SiteArgument,
    lidars: LidarsOption = None,
    targets: TargetsOption = None,
    json: JsonOption = False,
    quiet: QuietOption = False,
) -> None:
    """Several heights or targets for the same lidars: elevations, split of the time, error of each."""
    from planner.commands.table import print_table
    from planner.files.yaml_site import load_site
    from planner.placement.sharing import shared_by

    names, found = shared_by(load_site(site), lidars=names_in(lidars), targets=names_in(targets))
    if json:
        say_json({"lidars": list(names), "targets": [item._asdict() for item in found]})
        return
    columns = (
        *("target", *(f"{name} elevation °" for name in names), "time", "speed ± m/s", "alone"),
        *("direction ± °", "alone"),
    )
    what = "1 target has" if len(found) == 1 else f"{len(found)} targets share"
    title = f"{what} {' and '.join(names)}"
    print_table(title, columns, [_row(item) for item in found])
    remark(
        "Linear tier, one retrieval of every target in the time that one of them alone would take: noise grows with the "
        "square root of their number, pointing and position errors stay. `lidarplan tour` gives the order and its time.",
        quiet=quiet,
    )


def _row(item: "Shared") -> tuple[str, ...]:
    return (
        item.target,
        *(f"{angle:.2f}" for angle in item.elevation_deg),
        f"{item.time_share:.0%}",
        f"{item.speed_std_mps:.3f}",
        f"{item.alone_speed_std_mps:.3f}",
        f"{item.direction_std_deg:.2f}",
        f"{item.alone_direction_std_deg:.2f}",
    )
