"""Which wind directions are free of wakes: one rose for each scan that wakes take something from."""

from math import ceil
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from geometry.angles import SectorSet
from planner.exclusion import Exclusion
from planner.figures.canvas import canvas, image
from planner.figures.names import shown
from planner.palette import EXCLUDED, FREE, INK_SOFT, WAKE
from planner.plan import Plan
from planner.report_values import percent

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PER_ROW = 3
RING_WIDTH, RING_STEP, INNERMOST = 0.155, 0.195, 0.34
STRONG, FAINT = 0.85, 0.06


class Ring(NamedTuple):
    """One ring of a rose."""

    name: str
    colour: str
    sectors: SectorSet


def wake_rose(plan: Plan) -> bytes | None:
    """Draw the roses as a PNG, north up, directions from; None where no wake reaches any scan."""
    items = [item for item in plan.exclusions if item.excluded.sectors]
    if not items:
        return None
    columns = min(PER_ROW, len(items))
    rows = ceil(len(items) / columns)
    with canvas(3.8 * columns, 3.8 * rows + 0.9) as figure:
        for number, item in enumerate(items):
            axes = figure.add_subplot(rows, columns, number + 1, projection="polar")
            _rose(axes, item)
        _legend(figure, items[0], columns)
        return image(figure)


def rings(item: Exclusion) -> list[Ring]:
    """The rings of a rose, from the inside: what counts, what the site's models exclude, what is left."""
    found = [Ring("wind that counts", INK_SOFT, item.wanted)]
    if item.model != "iec":
        found.append(Ring("in a wake (Jensen)", WAKE, item.of_model("jensen")))
    if item.model != "jensen":
        found.append(Ring("disturbed (IEC 61400-12-1)", EXCLUDED, item.of_model("iec")))
    return [*found, Ring("counts and is free", FREE, item.wanted.intersection(item.free))]


def _rose(axes: Any, item: Exclusion) -> None:
    drawn = rings(item)
    axes.set_theta_zero_location("N")
    axes.set_theta_direction(-1)
    axes.set_ylim(0.0, INNERMOST + len(drawn) * RING_STEP)
    axes.set_yticks([])
    axes.grid(visible=False)
    axes.spines["polar"].set_visible(False)
    axes.set_xticks(
        np.deg2rad(np.arange(0, 360, 30)),
        ["N", "30°", "60°", "E", "120°", "150°", "S", "210°", "240°", "W", "300°", "330°"],
    )
    axes.tick_params(pad=-1)
    for number, ring in enumerate(drawn):
        inner = INNERMOST + number * RING_STEP
        _ring(axes, SectorSet.full(), inner, ring.colour, FAINT)
        _ring(axes, ring.sectors, inner, ring.colour, STRONG)
    axes.text(
        0,
        0,
        f"{percent(item.lost_share)}\nlost",
        ha="center",
        va="center",
        fontsize=11,
        fontweight="bold",
        linespacing=1.3,
    )
    axes.set_title(
        f"{shown(item.scan, longest=18)} → {shown(item.target, longest=18)}",
        fontsize=10,
        loc="center",
        pad=10,
        parse_math=False,
    )


def _ring(axes: Any, sectors: SectorSet, inner: float, colour: str, opacity: float) -> None:
    for sector in sectors.sectors:
        middle, width = np.deg2rad(sector.from_deg + sector.width_deg / 2), np.deg2rad(sector.width_deg)
        axes.bar(middle, RING_WIDTH, width=width, bottom=inner, color=colour, alpha=opacity, linewidth=0)


def _legend(figure: "Figure", item: Exclusion, columns: int) -> None:
    from matplotlib.patches import Patch

    patches = [Patch(color=ring.colour, label=f"{ring.name}", alpha=STRONG) for ring in rings(item)]
    patches[0].set_label(f"{patches[0].get_label()} (innermost)")
    patches[-1].set_label(f"{patches[-1].get_label()} (outermost)")
    figure.legend(
        handles=patches, loc="outside lower center", ncols=4 if columns > 2 else columns, fontsize=9
    )
