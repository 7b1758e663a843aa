"""`lidarplan report SITE [SITE2]`: all of it on one page, with its tables beside it."""

from typing import TYPE_CHECKING, Annotated

import typer

from planner.commands.options import (
    DEFAULT_OUT,
    FidelityOption,
    JsonOption,
    OutOption,
    QuietOption,
    SiteArgument,
    remark,
    say,
    say_json,
)

if TYPE_CHECKING:
    from planner.plan import Plan
    from planner.tradeoff import Trade

SecondSite = Annotated[
    str | None,
    typer.Argument(
        metavar="[SITE2]", help="A second site file, to be compared with the first.", show_default=False
    ),
]

TradeoffOption = Annotated[
    bool, typer.Option("--tradeoff", help="Also measure what accuracy costs here; takes a minute.")
]


def register(app: typer.Typer) -> None:
    """Add the command to the application."""
    app.command("report", short_help="All of it in one self-contained page.")(report)


def report(
    site: SiteArgument,
    site2: SecondSite = None,
    out: OutOption = DEFAULT_OUT,
    fidelity: FidelityOption = None,
    tradeoff: TradeoffOption = False,
    json: JsonOption = False,
    quiet: QuietOption = False,
) -> None:
    """Findings, map, pointing, crossings, wakes, errors and the 3-D scene in one file, report.html."""
    from geometry.errors import InputError
    from planner.commands.load import load_plan
    from planner.output import require_folder
    from planner.report import write_report

    if site == site2 == "-":
        raise InputError("both sites were to come from standard input; give one of them as a file")
    require_folder(out)
    plans = [load_plan(name, fidelity) for name in (site, site2) if name is not None]
    trades = [_measured(plan, quiet=quiet) for plan in plans] if tradeoff else []
    files = write_report(
        plans, out, trades=trades, aside=True, progress=lambda text: remark(text, quiet=quiet)
    )
    if json:
        say_json({"report": str(files[0]), "tables": [str(path) for path in files[1:]]})
    else:
        say(str(files[0]))


def _measured(plan: "Plan", *, quiet: bool) -> "tuple[Trade, ...]":
    """Time and error of every way, as `lidarplan tradeoff` measures them."""
    from numpy.random import default_rng

    from planner.commands.progress import shown

    with shown(f"{plan.site.name}: measuring", quiet=quiet) as progress:
        return plan.trades(rng=default_rng(1), progress=progress)
