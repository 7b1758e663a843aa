"""`lidarplan compare CAMPAIGN`: the retrieved wind against a mast, per sector size, beside the prediction."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from planner.commands.options import JsonOption, QuietOption, remark, say, say_json
from planner.commands.retrieve import CampaignArgument, ResultsOption

if TYPE_CHECKING:
    from planner.comparing import Comparison, Row
    from planner.comparing_files import Kind
    from reconstruct.agreement import Difference

PredictOption = Annotated[
    bool,
    typer.Option("--prediction/--no-prediction", help="Put the predicted error beside the measured one."),
]
FiguresOption = Annotated[
    str,
    typer.Option(
        "--figures",
        metavar="usual|all|NAME,...",
        help="Figures to draw: scatter, turn (scatter of directions), time, direction (residuals against it), wind (densities), "
        "rose, sizes, profile, animation. usual: each, of the widest sector; all: scatters of every size too.",
    ),
]
NoFiguresOption = Annotated[bool, typer.Option("--no-figures", help="Draw no figure.")]

SPEED = (
    "scan", "sector °", "rays", "periods", "slope", "± slope", "predicted", "± lasting", "apart in s.e.", "r²", "r² uncentred",
    "median m/s", "residual ± m/s", "predicted ± m/s", "apart in s.e.",
)  # fmt: skip
DIRECTION = (
    "scan", "sector °", "slope", "offset °", "r²", "plain slope", "plain offset °", "bias °", "residual ± °",
    "predicted ± °", "apart in s.e.",
)  # fmt: skip
MEANING = (
    "mast = slope · lidar; ± slope: standard error from the scatter; ± lasting: of the prediction, from errors that stay "
    "for the whole campaign; apart: measured less predicted, in standard errors of both; residual: mast - slope · lidar, "
    "its median and standard deviation. Directions are fitted on the circle, and plainly as numbers from 0 to 360, as the "
    "reference study did; bias: lidar - mast."
)


def register(app: typer.Typer) -> None:
    """Add the command to the application."""
    app.command("compare", short_help="Regression against the mast, beside the prediction.")(compare)


def compare(
    campaign: CampaignArgument,
    out: ResultsOption = None,
    prediction: PredictOption = True,
    figures: FiguresOption = "usual",
    no_figures: NoFiguresOption = False,
    json: JsonOption = False,
    quiet: QuietOption = False,
) -> None:
    """Regression against the mast per scan and sector size, with figures and the prediction."""
    from planner.comparing import compare as run
    from planner.comparing_files import write_comparison
    from planner.comparison_table import verdicts
    from planner.files.yaml_campaign import load_campaign

    kinds = () if no_figures else _kinds(figures)
    loaded = load_campaign(campaign)
    if out is not None:
        loaded = loaded._replace(campaign=loaded.campaign.model_copy(update={"output": out}))
    found = run(loaded, predict=prediction)
    files: list[Path] = write_comparison(
        found,
        loaded.campaign.output,
        title=loaded.campaign.name,
        kinds=kinds,
        every_size=figures.strip() == "all",
    )
    if json:
        say_json(
            {
                "rows": _documents(found),
                "verdicts": verdicts(found),
                "lost": found.lost,
                "files": [str(path) for path in files],
            }
        )
        return
    _print(found)
    if found.lost:
        say(f"{found.lost}.")
    for line in verdicts(found):
        say(line[0].upper() + line[1:] + ".")
    remark(MEANING, quiet=quiet)
    say(str(loaded.campaign.output))


def _kinds(figures: str) -> "tuple[Kind, ...]":
    """The figures that are asked for."""
    from planner.commands.choices import chosen
    from planner.comparing_files import KINDS

    if figures.strip() in ("usual", "all"):
        return KINDS
    return tuple(chosen("--figures", name.strip(), KINDS) for name in figures.split(","))


def _documents(found: "Comparison") -> list[dict[str, object]]:
    from planner.comparison_table import table_rows

    def known(value: object) -> object:
        return None if isinstance(value, float) and value != value else value

    return [{name: known(value) for name, value in row.items()} for row in table_rows(found)]


def _print(found: "Comparison") -> None:
    from planner.commands.table import print_table

    print_table(
        f"Speed: means over {found.period_s:g} s against the mast", SPEED, [_speed(row) for row in found.rows]
    )
    print_table("Direction of the same means", DIRECTION, [_direction(row) for row in found.rows])


def _speed(row: "Row") -> tuple[str, ...]:
    speed = row.speed
    return (
        *_head(row),
        str(row.matched.rays),
        str(speed.pairs),
        _text(speed.slope, ".4f"),
        _text(speed.slope_standard_error, ".4f"),
        _text(row.foreseen("slope"), ".4f"),
        _text(row.foreseen("slope_std"), ".4f"),
        _apart(row.slope_beside),
        _text(speed.r_squared, ".4f"),
        _text(speed.r_squared_uncentred, ".4f"),
        _text(speed.residual_median_mps, "+.3f"),
        _text(speed.residual_std_mps, ".3f"),
        _text(row.foreseen("residual_std_mps"), ".3f"),
        _apart(row.scatter_beside),
    )


def _direction(row: "Row") -> tuple[str, ...]:
    circle, plain = row.direction, row.plainly
    return (
        *_head(row),
        _text(circle.slope, ".4f"),
        _text(circle.intercept_deg, "+.2f"),
        _text(circle.r_squared, ".4f"),
        _text(plain.slope, ".4f"),
        _text(plain.intercept_deg, "+.2f"),
        _text(circle.bias_deg, "+.2f"),
        _text(circle.residual_std_deg, ".2f"),
        _text(row.foreseen("direction_residual_std_deg"), ".2f"),
        _apart(row.direction_beside),
    )


def _head(row: "Row") -> tuple[str, str]:
    size = row.matched.sector_deg
    return row.matched.scan, "–" if size is None else f"{size:g}"


def _apart(found: "Difference | None") -> str:
    return _text(None if found is None else found.ratio, "+.1f")


def _text(value: float | None, how: str) -> str:
    return "–" if value is None or value != value else format(value, how)
