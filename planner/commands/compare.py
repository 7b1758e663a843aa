"""`lidarplan compare CAMPAIGN`: the retrieved wind against a mast, per sector size, beside the prediction."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from planner.commands.options import JsonOption, QuietOption, remark, say, say_json
from planner.commands.retrieve import CampaignArgument, ResultsOption

if TYPE_CHECKING:
    from planner.comparing import Comparison

PredictOption = Annotated[
    bool,
    typer.Option("--prediction/--no-prediction", help="Put the predicted error beside the measured one."),
]
FiguresOption = Annotated[bool, typer.Option("--figures/--no-figures", help="Draw the figures.")]


def register(app: typer.Typer) -> None:
    """Add the command to the application."""
    app.command("compare")(compare)


def compare(
    campaign: CampaignArgument,
    out: ResultsOption = None,
    prediction: PredictOption = True,
    figures: FiguresOption = True,
    json: JsonOption = False,
    quiet: QuietOption = False,
) -> None:
    """Regression against the mast per scan and sector size, with figures and the prediction."""
    from planner.comparing import compare as run
    from planner.comparing_files import write_comparison
    from planner.files.yaml_campaign import load_campaign

    loaded = load_campaign(campaign)
    if out is not None:
        loaded = loaded._replace(campaign=loaded.campaign.model_copy(update={"output": out}))
    found = run(loaded, predict=prediction)
    files: list[Path] = write_comparison(
        found, loaded.campaign.output, title=loaded.campaign.name, figures=figures
    )
    if json:
        say_json({"rows": _documents(found), "files": [str(path) for path in files]})
        return
    _print(found)
    remark(
        "mast = slope · lidar; ± slope: standard error from the scatter; ± lasting: of the prediction, from "
        "errors that stay for the whole campaign; residual: mast - slope · lidar; direction: on the circle.",
        quiet=quiet,
    )
    say(str(loaded.campaign.output))


def _documents(found: "Comparison") -> list[dict[str, object]]:
    from planner.comparing import table_rows

    def known(value: object) -> object:
        return None if isinstance(value, float) and value != value else value

    return [{name: known(value) for name, value in row.items()} for row in table_rows(found)]


def _print(found: "Comparison") -> None:
    from planner.commands.table import print_table

    columns = (
        "scan", "sector °", "periods", "slope", "± slope", "predicted", "± lasting", "r²", "r² uncentred", "median m/s",
        "residual ± m/s", "predicted ± m/s", "direction", "offset °", "direction ± °", "predicted ± °",
    )  # fmt: skip
    rows = []
    for row in found.rows:
        speed, direction = row.speed, row.direction
        rows.append(
            (
                row.matched.scan,
                "–" if row.matched.sector_deg is None else f"{row.matched.sector_deg:g}",
                str(speed.pairs),
                _text(speed.slope, ".4f"),
                _text(speed.slope_standard_error, ".4f"),
                _text(row.foreseen("slope"), ".4f"),
                _text(row.foreseen("slope_std"), ".4f"),
                _text(speed.r_squared, ".4f"),
                _text(speed.r_squared_uncentred, ".4f"),
                _text(speed.residual_median_mps, "+.3f"),
                _text(speed.residual_std_mps, ".3f"),
                _text(row.foreseen("residual_std_mps"), ".3f"),
                _text(direction.slope, ".4f"),
                _text(direction.intercept_deg, "+.2f"),
                _text(direction.residual_std_deg, ".2f"),
                _text(row.foreseen("direction_residual_std_deg"), ".2f"),
            )
        )
    print_table(f"Means over {found.period_s:g} s against the mast", columns, rows)


def _text(value: float | None, how: str) -> str:
    return "–" if value is None or value != value else format(value, how)
