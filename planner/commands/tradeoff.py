"""`lidarplan tradeoff SITE`: time and error of every tier and model, measured here."""

from typing import Annotated

import typer

from planner.commands.options import (
    DEFAULT_OUT,
    JsonOption,
    OutOption,
    QuietOption,
    SiteArgument,
    remark,
    say_json,
)

SeedOption = Annotated[int, typer.Option("--seed", metavar="N", min=0, help="Start of the random numbers.")]


def register(app: typer.Typer) -> None:
    """Add the command to the application."""
    app.command("tradeoff", short_help="What accuracy costs on this machine.")(tradeoff)


def tradeoff(
    site: SiteArgument,
    out: OutOption = DEFAULT_OUT,
    seed: SeedOption = 1,
    json: JsonOption = False,
    quiet: QuietOption = False,
) -> None:
    """Time and error of every model and tier on this site and machine, as a table and a figure."""
    import numpy as np

    from planner.commands.load import load_plan
    from planner.commands.progress import shown
    from planner.commands.table import print_table
    from planner.figures.tradeoff import tradeoff_figure
    from planner.output import require_folder, write_bytes

    require_folder(out)
    plan = load_plan(site)
    with shown("measuring", quiet=quiet) as progress:
        rows = plan.trades(rng=np.random.default_rng(seed), progress=progress)
    write_bytes(out / "tradeoff.png", tradeoff_figure(rows))
    if json:
        say_json([vars(row) for row in rows])
        return
    cells = [
        (
            row.topic,
            row.method,
            f"{row.time_s:.2e}",
            "reference" if row.error is None else f"{row.error:.2e}",
            row.unit,
            "–" if row.standard_error is None else f"{row.standard_error:.1e}",
        )
        for row in rows
    ]
    print_table(plan.site.name, ("topic", "method", "time s", "off by", "unit", "standard error"), cells)
    remark(f"Times on this machine, the fastest of several; figure: {out / 'tradeoff.png'}", quiet=quiet)
