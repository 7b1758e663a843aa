"""The plan map: everything to scale, beams, sectors, wakes, excluded directions and opening angles."""

from itertools import chain
from typing import TYPE_CHECKING, Any

import numpy as np

from geometry.arrays import FloatArray
from planner.figures import map_layers
from planner.figures.canvas import canvas, image
from planner.figures.map_layers import Layer
from planner.figures.names import draw_names, shown
from planner.palette import INK, INK_SOFT
from planner.plan import Plan

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

WIDTH_IN = 9.0
MARGIN = 0.07  # of the longer side, around everything
SMALLEST_M = 100.0  # side of the smallest map
FLATTEST, STEEPEST = 0.45, 1.25  # height over width of the map
SIDES_IN, HEAD_AND_FOOT_IN = 0.9, 1.15  # around the axes: numbers and title
LINE_IN = 0.2  # a line of the legend
TWO_COLUMNS = 52  # characters of the longest text of a legend in two columns


def site_map(plan: Plan) -> bytes:
    """Draw the map as a PNG; east to the right, true north up, axes in metres from the middle of the site."""
    low, high = _limits(plan)
    wide, tall = high - low
    with canvas(WIDTH_IN, WIDTH_IN) as figure:
        axes = figure.add_subplot()
        _frame(axes, low, high)
        layers = list(_layers(plan, axes, float(max(wide, tall))))
        _marks(axes, float(wide))
        axes.set_title(f"{shown(plan.site.name)}: plan", parse_math=False, pad=14)
        lines = _legend(figure, layers)
        figure.set_size_inches(
            WIDTH_IN, (WIDTH_IN - SIDES_IN) * tall / wide + HEAD_AND_FOOT_IN + LINE_IN * lines
        )
        busy = np.vstack([np.empty((0, 2)), *(samples for layer in layers for samples in layer.busy)])
        draw_names(axes, [name for layer in layers for name in layer.names], busy)
        return image(figure)


def _layers(plan: Plan, axes: "Axes", side_m: float) -> "chain[Layer]":
    return chain(
        map_layers.wakes(plan, axes),
        map_layers.scans(plan, axes),
        map_layers.excluded_rings(plan, axes, side_m),
        map_layers.opening_angles(plan, axes),
        [map_layers.things(plan, axes)],
    )


def _limits(plan: Plan) -> tuple[FloatArray, FloatArray]:
    """South-west and north-east corner (2,) of the map [m]: tight, but neither a strip nor a point."""
    with canvas(1, 1) as nowhere:  # drawn once to learn what has to be seen
        corners = [
            corner for layer in _layers(plan, nowhere.add_subplot(), SMALLEST_M) for corner in layer.corners
        ]
    points = np.vstack(corners)
    low, high = points.min(axis=0), points.max(axis=0)
    room = MARGIN * max(float(np.max(high - low)), SMALLEST_M)
    wide, tall = np.maximum(high - low, SMALLEST_M) + 2 * room
    half = np.array([max(wide, tall / STEEPEST), max(tall, wide * FLATTEST)]) / 2
    middle = (low + high) / 2
    return middle - half, middle + half


def _frame(axes: "Axes", low: FloatArray, high: FloatArray) -> None:
    from matplotlib.ticker import MultipleLocator

    axes.set_xlim(low[0], high[0])
    axes.set_ylim(low[1], high[1])
    axes.set_aspect("equal")
    axes.set_autoscale_on(False)
    axes.set_xlabel("east of the middle of the site [m]")
    axes.set_ylabel("north of it (true north) [m]")
    step_m = _round_m(float(high[0] - low[0]) / 5)
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_locator(MultipleLocator(step_m))


def _marks(axes: "Axes", wide_m: float) -> None:
    """North arrow and scale bar, above the map where nothing is drawn."""
    low, high = axes.get_ylim()
    inch = wide_m / (high - low) / (WIDTH_IN - SIDES_IN)  # as a share of the height of the axes
    foot, head = 1.0 + 0.05 * inch, 1.0 + 0.36 * inch
    axes.annotate(
        "",
        xy=(0.985, head),
        xytext=(0.985, foot),
        xycoords="axes fraction",
        annotation_clip=False,
        arrowprops={
            "arrowstyle": "-|>",
            "color": INK,
            "linewidth": 1.6,
            "mutation_scale": 14,
            "shrinkA": 0,
            "shrinkB": 0,
        },
    )
    axes.text(
        0.972, foot, "N", transform=axes.transAxes, ha="right", va="bottom", fontsize=11, fontweight="bold"
    )
    length_m = _round_m(wide_m / 5)
    right = axes.get_xlim()[0] + 0.93 * wide_m
    across = axes.get_xaxis_transform()  # metres across, share of the axes upwards
    bar = 1.0 + 0.12 * inch
    axes.plot(
        [right - length_m, right],
        [bar, bar],
        color=INK,
        linewidth=3,
        transform=across,
        clip_on=False,
        solid_capstyle="butt",
    )
    label = f"{length_m:g} m" if length_m < 1000 else f"{length_m / 1000:g} km"
    axes.text(
        right - length_m / 2,
        bar + 0.05 * inch,
        label,
        transform=across,
        ha="center",
        va="bottom",
        fontsize=9,
        color=INK_SOFT,
    )


def _round_m(length_m: float) -> float:
    """The largest of 1, 2, 5 times a power of ten that is not longer."""
    power = 10.0 ** np.floor(np.log10(length_m))
    return float(max(step for step in (1.0, 2.0, 5.0) if step * power <= length_m * (1 + 1e-9)) * power)


def _legend(figure: "Figure", layers: list[Layer]) -> int:
    """Below the map, each text once; gives its number of lines."""
    entries: dict[str, Any] = {}
    for handle, text in chain.from_iterable(layer.legend for layer in layers):
        entries.setdefault(text, handle)
    if not entries:
        return 0
    columns = 2 if max(map(len, entries)) <= TWO_COLUMNS else 1
    legend = figure.legend(list(entries.values()), list(entries), loc="outside lower left", ncols=columns)
    for line in legend.get_texts():
        line.set_parse_math(False)
    return -(-len(entries) // columns)
