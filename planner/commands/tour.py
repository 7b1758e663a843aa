"""`lidarplan tour SITE`: in which order to step through the targets, and when each is measured."""

from typing import TYPE_CHECKING, Annotated

import typer

from planner.commands.options import JsonOption, QuietOption, SiteArgument, names_in, remark, say_json

if TYPE_CHECKING:
    from planner.site_tour import SiteTour

CoverOption = Annotated[
    float | None,
    typer.Option(
        "--cover",
        metavar="RADIUS",
        help="Stop in the middles of the fewest discs of this radius [m] instead.",
    ),
]
LidarsOption = Annotated[
    str | None, typer.Option("--lidars", metavar="NAME,...", help="Lidars that step together. [default: all]")
]
TargetsOption = Annotated[
    str | None, typer.Option("--targets", metavar="NAME,...", help="Targets to go through. [default: all]")
]
AccumulationOption = Annotated[
    float, typer.Option("--accumulation", metavar="S", help="Time at each point [s]; 0: motion alone.")
]


def register(app: typer.Typer) -> None:
    """Add the command to the application."""
    app.command("tour", short_help="Fastest order of a step-stare tour.")(tour)


def tour(
    site: SiteArgument,
    cover: CoverOption = None,
    lidars: LidarsOption = None,
    targets: TargetsOption = None,
    accumulation: AccumulationOption = 0.0,
    json: JsonOption = False,
    quiet: QuietOption = False,
) -> None:
    """Fastest order of a step-stare tour through all targets, and its timing table [ms]."""
    from planner.commands.choices import within
    from planner.commands.load import load_plan
    from planner.site_tour import site_tour

    within("--cover", cover, 0.0, open_below=True)
    within("--accumulation", accumulation, 0.0)
    plan = load_plan(site)
    found = site_tour(
        plan.exact_places,
        lidars=names_in(lidars),
        targets=names_in(targets),
        cover_m=cover,
        accumulation_s=accumulation,
    )
    if json:
        say_json(_document(found))
        return
    _print_cover(found)
    _print_tour(found)
    staying = f", {found.tour.dwell_ms} ms of it at each point" if found.tour.dwell_ms else ", motion alone"
    remark(
        f"One round: {found.tour.cycle_ms / 1000:.3f} s{staying}. "
        "The order is the best that was found, without a proof.",
        quiet=quiet,
    )


def _steps(found: "SiteTour") -> list[dict[str, object]]:
    """One record a stop, in the order of the tour."""
    azimuth, elevation = found.head_deg
    steps: list[dict[str, object]] = []
    for place, stop in enumerate(found.tour.order):
        heads = [
            {
                "lidar": lidar.name,
                "azimuth_true_deg": float(found.beams[number].azimuth_deg[stop]),
                "azimuth_head_deg": float(azimuth[number, stop]),
                "elevation_deg": float(found.beams[number].elevation_deg[stop]),
                "elevation_head_deg": float(elevation[number, stop]),
                "range_m": float(found.beams[number].range_m[stop]),
                "move_ms": int(found.tour.lidar_ms[place, number]),
            }
            for number, lidar in enumerate(found.lidars)
        ]
        steps.append(
            {
                "target": found.stops.names[stop],
                "position": list(found.stops.positions[stop]),
                "start_ms": int(found.tour.start_ms[place]),
                "move_ms": int(found.tour.move_ms[place]),
                "heads": heads,
            }
        )
    return steps


def _document(found: "SiteTour") -> dict[str, object]:
    return {
        "lidars": [lidar.name for lidar in found.lidars],
        "cycle_ms": found.tour.cycle_ms,
        "dwell_ms": found.tour.dwell_ms,
        "steps": _steps(found),
        "cover": None if found.stops.cover is None else _cover(found),
    }


def _cover(found: "SiteTour") -> dict[str, object]:
    cover = found.stops.cover
    assert cover is not None
    discs = [
        {
            "name": name,
            "position": list(found.stops.positions[number]),
            "reach_m": float(cover.reach_m[number]),
            "targets": [found.stops.covered[point] for point in (cover.disc == number).nonzero()[0]],
        }
        for number, name in enumerate(found.stops.names)
    ]
    return {"discs": discs, "at_least": cover.at_least, "gap": cover.gap}


def _print_cover(found: "SiteTour") -> None:
    from planner.commands.table import print_table

    cover = found.stops.cover
    if cover is None:
        return
    rows = [
        (
            name,
            *(f"{value:.1f}" for value in found.stops.positions[number]),
            f"{cover.reach_m[number]:.1f}",
            ", ".join(found.stops.covered[point] for point in (cover.disc == number).nonzero()[0]),
        )
        for number, name in enumerate(found.stops.names)
    ]
    proof = "which is proven to be the fewest" if not cover.gap else f"at least {cover.at_least} are needed"
    title = f"{len(found.stops.covered)} targets in {len(rows)} discs, {proof}"
    print_table(
        title, ("disc", "easting m", "northing m", "height m", "reach m", "targets"), rows, fold="targets"
    )


def _print_tour(found: "SiteTour") -> None:
    from planner.commands.table import print_table

    azimuth, elevation = found.head_deg
    rows = [
        (
            f"{place + 1}",
            found.stops.names[stop],
            f"{found.tour.start_ms[place]}",
            *(
                text
                for number in range(len(found.lidars))
                for text in (
                    f"{azimuth[number, stop]:.3f}",
                    f"{elevation[number, stop]:.3f}",
                    f"{found.tour.lidar_ms[place, number]}",
                )
            ),
            f"{found.tour.move_ms[place]}",
        )
        for place, stop in enumerate(found.tour.order)
    ]
    heads = [
        f"{lidar.name} {what}" for lidar in found.lidars for what in ("azimuth °", "elevation °", "move ms")
    ]
    print_table(
        f"{found.places.site.name}: angles as the heads count them, time to the next point",
        ("", "target", "start ms", *heads, "move ms"),
        rows,
    )
