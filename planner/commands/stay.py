"""`lidarplan stay SITE`: how many valid ten-minute values a stay yields, and how long to stay."""

import math
from typing import TYPE_CHECKING, Annotated

import typer

from planner.commands.options import JsonOption, QuietOption, SiteArgument, remark, say, say_json

if TYPE_CHECKING:
    from planner.stay import Stay

DaysOption = Annotated[float, typer.Option("--days", metavar="N", help="Length of the stay.")]
AvailabilityOption = Annotated[
    float,
    typer.Option(
        "--availability",
        metavar="SHARE",
        help="Of the periods in wanted, undisturbed wind, how many are kept: power, breaks, filters.",
    ),
]
WantOption = Annotated[
    float | None,
    typer.Option("--want", metavar="COUNT", help="Tell how long it takes to have so many values."),
]
PerBinOption = Annotated[
    float,
    typer.Option("--per-bin", metavar="COUNT", help="Tell how long it takes to have so many at each speed."),
]

# IEC 61400-12-1:2017 asks for 30 minutes in each bin of speed: three ten-minute values.
PER_BIN = 3.0

SHOWN = 0.05  # values: bins of speed beyond the last with so many are one row
LONGEST_DAYS = 3650.0  # nobody stays longer


def register(app: typer.Typer) -> None:
    """Add the command to the application."""
    app.command("stay", short_help="Ten-minute values to expect, and how long to stay.")(stay)


def stay(
    site: SiteArgument,
    days: DaysOption = 30.0,
    availability: AvailabilityOption = 1.0,
    want: WantOption = None,
    per_bin: PerBinOption = PER_BIN,
    json: JsonOption = False,
    quiet: QuietOption = False,
) -> None:
    """Valid ten-minute values to expect in a stay, by speed and direction, and how long to stay."""
    from planner.commands.choices import within
    from planner.commands.load import load_plan
    from planner.stay import stays

    within("--days", days, 0.0, open_below=True)
    within("--availability", availability, 0.0, 1.0)
    within("--want", want, 0.0, open_below=True)
    within("--per-bin", per_bin, 0.0, open_below=True)
    found = stays(load_plan(site), days, availability=availability)
    if json:
        say_json([_document(item, want, per_bin) for item in found])
        return
    for item in found:
        _print(item, want, per_bin)
    remark(
        "Expected counts: weather comes in spells, so those of a short stay scatter far more than independent draws would. "
        "The reference study at Høvsøre kept 148 of the 1008 ten-minute values of its week: 0.39 of the 381 that its Weibull "
        "distribution puts into its speeds and directions, all directions alike.",
        quiet=quiet,
    )


def _document(item: "Stay", want: float | None, per_bin: float) -> dict[str, object]:
    def known(days: float) -> float | None:
        return days if math.isfinite(days) else None

    found = item.found
    return {
        "scan": item.scan,
        "target": item.target,
        "days": item.days,
        "periods": found.periods,
        "values": item.values,
        "kept_share": found.kept_share,
        "days_for_wanted": None if want is None else known(item.days_for(want)),
        "stages": [stage._asdict() for stage in item.stages],
        "speed_edges_mps": found.speed_edges_mps.tolist(),
        "direction_edges_deg": found.direction_edges_deg.tolist(),
        "expected": found.expected.tolist(),
        "days_per_bin": [
            known(_days_for(row, item.days, per_bin)) for row in found.expected.sum(axis=1).tolist()
        ],
    }


def _days_for(expected: float, days: float, count: float) -> float:
    """How long it takes until a bin has so many."""
    return count * days / expected if expected > 0 else math.inf


def _print(item: "Stay", want: float | None, per_bin: float) -> None:
    from planner.commands.table import print_table

    rows = [("all of them", f"{item.found.periods:.0f}", "")]
    rows += [(stage.name, f"{stage.kept:.0f}", f"{stage.share:.0%}") for stage in item.stages]
    title = f"{item.scan} → {item.target}: ten-minute values of {item.days:g} days"
    print_table(title, ("after", "left", "of those before"), rows)
    _print_bins(item, per_bin)
    say(f"{item.values:.0f} values in {item.days:g} days, {item.a_day:.1f} a day.")
    if want is not None:
        days = item.days_for(want)
        say(
            f"For {want:g} values: "
            + (f"{days:.1f} days." if math.isfinite(days) else "no stay is long enough.")
        )
    say("")


def _print_bins(item: "Stay", per_bin: float) -> None:
    """Counts by speed and direction; directions without any are left out."""
    import numpy as np

    from planner.commands.table import print_table

    found = item.found
    some = [number for number, count in enumerate(found.expected.sum(axis=0)) if count > 0]
    edges, speeds = found.direction_edges_deg, found.speed_edges_mps
    columns = [f"{edges[number]:.0f}–{edges[number + 1]:.0f}°" for number in some]
    last = int(np.flatnonzero(found.expected.sum(axis=1) >= SHOWN)[-1]) + 1 if some else 0
    parts = [(number, number + 1) for number in range(last)]
    blows = int(np.flatnonzero(found.expected.sum(axis=1) > 0)[-1]) + 1 if some else 0
    parts += [(last, blows)] if last < blows else []  # what hardly ever blows, in one row
    rows = []
    for first, end in parts if some else ():
        counts = found.expected[first:end].sum(axis=0)
        days = _days_for(float(counts.sum()), item.days, per_bin)
        cells = (f"{counts[number]:.1f}" for number in some)
        told = f"{days:.1f}" if days < LONGEST_DAYS else f"> {LONGEST_DAYS:.0f}"
        rows.append((f"{speeds[first]:g}–{speeds[end]:g}", *cells, f"{counts.sum():.1f}", told))
    if rows:
        print_table("by speed and direction", ("m/s", *columns, "all", f"days for {per_bin:g}"), rows)
