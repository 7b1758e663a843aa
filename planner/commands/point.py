"""`lidarplan point SITE`: where every lidar points for every target."""

import typer

from planner.commands.options import JsonOption, QuietOption, SiteArgument, remark, say_json


def register(app: typer.Typer) -> None:
    """Add the command to the application."""
    app.command("point")(point)


def point(site: SiteArgument, json: JsonOption = False, quiet: QuietOption = False) -> None:
    """Azimuth (true, grid, head), elevation, range and gate per lidar and target."""
    from planner.commands.load import load_plan
    from planner.commands.table import print_table

    plan = load_plan(site)
    if json:
        say_json([row._asdict() for row in plan.pointings])
        return
    rows = [
        (
            row.lidar,
            row.target,
            f"{row.azimuth_true_deg:.3f}",
            f"{row.azimuth_grid_deg:.3f}",
            f"{row.azimuth_head_deg:.3f}",
            f"{row.elevation_deg:.3f}",
            f"{row.elevation_head_deg:.3f}",
            f"{row.range_m:.2f}",
            "–" if row.gate_index is None else f"{row.gate_index}",
            "–" if row.gate_centre_m is None else f"{row.gate_centre_m:.1f}",
            f"{row.convergence_deg:+.3f}",
        )
        for row in plan.pointings
    ]
    columns = (
        *("lidar", "target", "azimuth true °", "grid °", "azimuth head °", "elevation °"),
        *("elevation head °", "range m", "gate", "gate m", "convergence °"),
    )
    print_table(plan.site.name, columns, rows)
    remark(
        "Azimuths clockwise, from true north, grid north and as the head shows them; elevation and slant "
        "range from the head, by the exact ellipsoid.",
        quiet=quiet,
    )
