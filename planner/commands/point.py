"""`lidarplan point SITE`: where every lidar points for every target."""

from typing import TYPE_CHECKING

import typer

from planner.commands.options import JsonOption, QuietOption, SiteArgument, remark, say_json

if TYPE_CHECKING:
    from planner.pointing import Pointing


def register(app: typer.Typer) -> None:
    """Add the command to the application."""
    app.command("point", short_help="Azimuth, elevation, range and gate per lidar and target.")(point)


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
            *_terrain(row),
        )
        for row in plan.pointings
    ]
    columns = (
        *("lidar", "target", "azimuth true °", "grid °", "azimuth head °", "elevation °"),
        *("elevation head °", "range m", "gate", "gate m", "convergence °"),
        *(() if plan.site.terrain is None else ("terrain", "clear by m", "at m")),
    )
    print_table(plan.site.name, columns, rows)
    if plan.site.terrain is not None:
        remark(
            "Terrain: how far the line to the target clears ground, canopy and buildings where it passes them nearest "
            "as seen from the head, and how far from the head that is; unknown: it leaves the raster.",
            quiet=quiet,
        )
    remark(
        "Azimuths clockwise, from true north, grid north and as the head shows them; elevation and slant "
        "range from the head, by the exact ellipsoid.",
        quiet=quiet,
    )


def _terrain(row: "Pointing") -> tuple[str, ...]:
    """What the terrain leaves of the way, where there is one."""
    if row.terrain is None:
        return ()
    values = (row.terrain_clearance_m, row.terrain_distance_m)
    return (row.terrain, *("–" if value is None else f"{value:.1f}" for value in values))
