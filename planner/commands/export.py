"""`lidarplan export SITE`: files for instruments, maps and the field."""

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
    from planner.scan_plans import GatePlan

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


GatesOption = Annotated[
    str | None,
    typer.Option(
        "--gates",
        metavar="FIRST,SPACING,COUNT",
        help="Range gates of scans that declare none: centre of the first and spacing [m], and number.",
    ),
]


def register(app: typer.Typer) -> None:
    """Add the command to the application."""
    app.command("export", short_help="Maps, tables, instruments' files and field sheets.")(export)


def export(
    site: SiteArgument,
    kinds: KindsOption = None,
    declination: DeclinationOption = None,
    gates: GatesOption = None,
    out: OutOption = DEFAULT_OUT,
    json: JsonOption = False,
    quiet: QuietOption = False,
) -> None:
    """Everything planned as GIS layers, tables, files for the instruments, and a field sheet per lidar."""
    from planner.commands.choices import chosen, within
    from planner.commands.load import load_plan
    from planner.handover.export import KINDS, Choice, default_kinds, foreign_places, with_gates
    from planner.handover.export import export as export_files
    from planner.output import require_folder
    from planner.plan import Plan

    within("--declination", declination, -180.0, 180.0)
    wanted = (
        None if kinds is None else tuple(chosen("--as", kind.strip(), KINDS) for kind in kinds.split(","))
    )
    require_folder(out)
    plan = load_plan(site)
    if gates is not None:
        plan = Plan(with_gates(plan.site, _gates(gates)))
    choice = default_kinds(plan) if wanted is None else Choice(wanted, ())
    files = export_files(
        plan,
        out,
        choice.kinds,
        declination_deg=declination,
        progress=lambda text: remark(text, quiet=quiet),
    )
    foreign = foreign_places(plan.site, out) if "gpkg" in choice.kinds else None
    left_out = [*choice.left_out, *([foreign] if foreign else [])]
    if json:
        say_json({"files": [str(path) for path in files], "left_out": left_out})
        return
    for path in files:
        say(str(path))
    for text in left_out:
        remark(text, quiet=quiet)
    if {"halo", "windscanner"} & {path.relative_to(out).parts[0] for path in files}:
        remark("Angles for instruments are head angles. Try new files with the laser off first.", quiet=quiet)


def _gates(text: str) -> "GatePlan":
    """FIRST,SPACING,COUNT as range gates."""
    from pydantic import ValidationError

    from geometry.errors import InputError
    from planner.scan_plans import GatePlan

    parts = text.split(",")
    try:
        first, spacing, count = float(parts[0]), float(parts[1]), int(parts[2])
        if len(parts) == len(GatePlan.model_fields):
            return GatePlan(first_m=first, spacing_m=spacing, count=count)
    except (ValueError, IndexError, ValidationError):
        pass
    raise InputError(
        f"--gates {text} came; allowed: three positive numbers, metres, metres and a count, such as 100,25,200"
    )
