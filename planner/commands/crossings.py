"""`lidarplan crossings SITE`: how the beams of each pair meet."""

from math import isfinite
from typing import TYPE_CHECKING

import typer

from planner.commands.options import JsonOption, QuietOption, SiteArgument, remark, say, say_json

if TYPE_CHECKING:
    from planner.crossings import PairCrossing


def register(app: typer.Typer) -> None:
    """Add the command to the application."""
    app.command("crossings", short_help="Opening angles, and how near the beams of pairs come.")(crossings)


def crossings(site: SiteArgument, json: JsonOption = False, quiet: QuietOption = False) -> None:
    """Opening angle of each pair of beams, how they pass the target and each other, and shared probe."""
    from planner.commands.load import load_plan
    from planner.commands.table import print_table

    plan = load_plan(site)
    if json:
        say_json([_record(met) for met in plan.crossings])
        return
    if not plan.crossings:
        say("The site file declares no pairs: there are no beams to cross.")
        return
    columns = (
        *("pair", "target", "scans", "opening °", "in space °", "gap m", "height gap m"),
        *("pass target at m", "range m", "shared probe m"),
    )
    print_table(plan.site.name, columns, [_row(met) for met in plan.crossings])
    remark(
        "From where the beams really point. Opening angle in plan, 0 to 180°. Gap: where the beams come closest; in "
        "height, second less first. Shared probe: of the shorter probe, what lies near the longer one.",
        quiet=quiet,
    )


def _record(met: "PairCrossing") -> dict[str, object]:
    """One crossing for machines; what parallel beams leave unknown is null."""
    known = {
        name: None if isinstance(value, float) and not isfinite(value) else value
        for name, value in met._asdict().items()
    }
    return {**known, "point_m": [float(part) for part in met.point_m]}


def _row(met: "PairCrossing") -> tuple[str, ...]:
    """One crossing for people."""
    return (
        met.pair,
        met.target,
        f"{met.scan1}, {met.scan2}",
        _told(met.opening_angle_deg, 1),
        _told(met.angle_deg, 1),
        _told(met.gap_m, 2),
        _told(met.height_difference_m, 2),
        f"{met.miss1_m:.2f}, {met.miss2_m:.2f}",
        f"{_told(met.range1_m, 1)}, {_told(met.range2_m, 1)}",
        _told(met.shared_probe_m, 1),
    )


def _told(value: float, digits: int) -> str:
    """A number, or a dash where parallel beams leave it unknown."""
    return f"{round(value, digits) + 0.0:.{digits}f}" if isfinite(value) else "–"
