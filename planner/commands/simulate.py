"""`lidarplan simulate SITE`: a virtual campaign in the analysis' input format."""

from pathlib import Path
from typing import Annotated

import typer

from planner.commands.options import (
    FidelityOption,
    JsonOption,
    QuietOption,
    SiteArgument,
    remark,
    say,
    say_json,
)

OutFolder = Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder for the campaign.")]
DaysOption = Annotated[float, typer.Option("--days", metavar="D", help="Length of the campaign in days.")]
SeedOption = Annotated[
    int, typer.Option("--seed", metavar="N", min=0, help="The same seed gives the same campaign.")
]
FormatOption = Annotated[
    str,
    typer.Option(
        "--format", metavar="csv|parquet|store|netcdf|windscanner|database", help="Format of the rays."
    ),
]
UrlOption = Annotated[
    str | None,
    typer.Option("--url", help="Of the database, as SQLAlchemy writes it. [default: an SQLite file in DIR]"),
]
LostOption = Annotated[
    float, typer.Option("--lost", metavar="SHARE", help="Share of the rays that are noise instead of wind.")
]
CellOption = Annotated[
    float | None,
    typer.Option(
        "--cell-m", metavar="M", help="Side of the turbulence's cells. [default: 1/12 of its length]"
    ),
]


def register(app: typer.Typer) -> None:
    """Add the command to the application."""
    app.command("simulate", short_help="A virtual campaign, written as measured rays.")(simulate)


def simulate(
    site: SiteArgument,
    out: OutFolder = Path("campaign"),
    days: DaysOption = 1.0,
    seed: SeedOption = 1,
    kind: FormatOption = "csv",
    url: UrlOption = None,
    lost: LostOption = 0.003,
    cell_m: CellOption = None,
    fidelity: FidelityOption = None,
    json: JsonOption = False,
    quiet: QuietOption = False,
) -> None:
    """A virtual campaign of the site's scans through the turbulence of its wind climate."""
    from geometry.errors import InputError
    from planner.commands.choices import chosen, within
    from planner.commands.load import load_plan
    from planner.commands.progress import shown
    from planner.output import require_folder
    from planner.simulation import Options, told_scans
    from planner.virtual_files import FORMATS, write_virtual
    from reconstruct.virtual import VirtualSettings

    if site == "-":
        raise InputError(
            "a virtual campaign needs the site file beside it: give its path, not standard input"
        )
    if not 0 <= lost < 1:
        raise InputError(f"--lost {lost:g} came; allowed: a share from 0 to below 1")
    within("--days", days, 0.0, open_below=True)
    within("--cell-m", cell_m, 0.0, open_below=True)
    form = chosen("--format", kind, FORMATS)
    require_folder(out)
    plan = load_plan(site, fidelity)
    options = Options(days=days, seed=seed, lost_share=lost, settings=VirtualSettings(spacing_m=cell_m))
    path = Path(site)
    text = path.read_text(encoding="utf-8-sig")
    with shown("flying the campaign", quiet=quiet) as progress:
        files = write_virtual(
            plan, text, out, options=options, beside=path.parent, kind=form, url=url, progress=progress
        )
    notes = told_scans(plan)
    if json:
        say_json(
            {"campaign": str(files[0]), "files": [str(path) for path in files[1:]], "notes": list(notes)}
        )
    else:
        for note in notes:
            remark(f"{note}.", quiet=quiet)
        say(str(files[0]))
        remark(f"Next: lidarplan retrieve {files[0]}, then lidarplan compare {files[0]}.", quiet=quiet)
