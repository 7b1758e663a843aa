"""`lidarplan wakes SITE`: which wind directions are free of wakes."""

from typing import TYPE_CHECKING

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

if TYPE_CHECKING:
    from geometry.angles import SectorSet
    from planner.exclusion import Exclusion


def register(app: typer.Typer) -> None:
    """Add the command to the application."""
    app.command("wakes", short_help="Wind directions that are free of wakes.")(wakes)


def wakes(
    site: SiteArgument, fidelity: FidelityOption = None, json: JsonOption = False, quiet: QuietOption = False
) -> None:
    """Excluded and free wind directions of each scan's measured volume, and the share of the wind lost."""
    from planner.commands.load import load_plan
    from planner.commands.table import print_table

    plan = load_plan(site, fidelity)
    if json:
        say_json([_record(item) for item in plan.exclusions])
        return
    if not plan.exclusions:
        say("No scan has a target: there is no measured volume to look at.")
        return
    columns = ("lidar", "scan", "target", "excluded, Jensen", "excluded, IEC", "free", "wanted wind lost")
    print_table(plan.site.name, columns, [_row(item) for item in plan.exclusions])
    remark(
        "Degrees from true north that the wind comes from. Excluded: a wake touches what the scan measures, "
        "the arc of its gates or the probe of a stare. Free: none does. –: not asked (wakes.model).",
        quiet=quiet,
    )


def _record(item: "Exclusion") -> dict[str, object]:
    """One exclusion for machines."""
    return {
        "lidar": item.lidar,
        "scan": item.scan,
        "target": item.target,
        "model": item.model,
        "excluded_deg": item.excluded.pairs(),
        "free_deg": item.free.pairs(),
        "excluded_at_target_deg": item.point.pairs(),
        "excluded_by": [
            {"source": source, "model": model, "excluded_deg": sectors.pairs()}
            for source, model, sectors in item.by_source
        ],
        "lost_share": item.lost_share,
    }


def _row(item: "Exclusion") -> tuple[str, ...]:
    """One exclusion for people."""
    return (
        item.lidar,
        item.scan,
        item.target,
        _spans(item.of_model("jensen")) if item.model != "iec" else "–",
        _spans(item.of_model("iec")) if item.model != "jensen" else "–",
        _spans(item.free),
        f"{item.lost_share:.0%}",
    )


def _spans(sectors: "SectorSet") -> str:
    """Sectors in words: 339–21, or none, or all."""
    if sectors.width_deg >= 360.0:
        return "all"
    return ", ".join(f"{start:.0f}–{stop:.0f}" for start, stop in sectors.pairs()) or "none"
