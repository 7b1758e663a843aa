"""`lidarplan export SITE`: files for instruments, maps and the field."""

from typing import Annotated

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

KindsOption = Annotated[
    str | None,
    typer.Option(
        "--as",
        metavar="KIND,...",
        help="gpkg, kmz, geojson, csv, halo, windscanner, scan-table, field-sheet. [default: all that fit the site]",
    ),
]
DeclinationOption = Annotated[
    float | None,
    typer.Option(
        "--declination",
        metavar="DEG",
        help="Magnetic declination at the site, east positive: adds magnetic bearings to the field sheet.",
    ),
]


def register(app: typer.Typer) -> None:
    """Add the command to the application."""
    app.command("export")(export)


def export(
    site: SiteArgument,
    kinds: KindsOption = None,
    declination: DeclinationOption = None,
    out: OutOption = DEFAULT_OUT,
    json: JsonOption = False,
    quiet: QuietOption = False,
) -> None:
    """Everything planned as GIS layers, tables, files for the instruments, and a field sheet per lidar."""
    from planner.commands.choices import chosen, within
    from planner.commands.load import load_plan
    from planner.handover.export import KINDS, Choice, default_kinds
    from planner.handover.export import export as export_files
    from planner.output import require_folder

    within("--declination", declination, -180.0, 180.0)
    wanted = (
        None if kinds is None else tuple(chosen("--as", kind.strip(), KINDS) for kind in kinds.split(","))
    )
    require_folder(out)
    plan = load_plan(site)
    choice = default_kinds(plan) if wanted is None else Choice(wanted, ())
    files = export_files(
        plan,
        out,
        choice.kinds,
        declination_deg=declination,
        progress=lambda text: remark(text, quiet=quiet),
    )
    if json:
        say_json({"files": [str(path) for path in files], "left_out": list(choice.left_out)})
        return
    for path in files:
        say(str(path))
    for text in choice.left_out:
        remark(text, quiet=quiet)
    if {"halo", "windscanner"} & {path.relative_to(out).parts[0] for path in files}:
        remark("Angles for instruments are head angles. Try new files with the laser off first.", quiet=quiet)
