"""A campaign against its mast: scatter, time series, residual against direction, regression per sector size."""

from collections.abc import Sequence
from textwrap import wrap
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np

from geometry.angles import difference_deg
from geometry.arrays import FloatArray
from planner.figures.canvas import canvas, image
from planner.figures.names import shown
from planner.palette import EXCLUDED, INK, INK_SOFT, LIDARS
from reconstruct.averaging import TimeArray
from reconstruct.comparison import residual_by_direction

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MAST, LIDAR, PREDICTED = INK, LIDARS[0], EXCLUDED
LEAST_PERIODS = 2
HEAD_IN = 0.56  # of the paper, for the title and the line under it
LINE_IN = 0.16  # for each further line
LONG_AXIS_MPS = 14.0  # marked every 5 m/s, a shorter one every 2 m/s
MARKS = ".x+1"  # beside the colour, for who does not see it


class Series(NamedTuple):
    """The periods that lidar and mast share, for one sector size."""

    label: str
    time_utc: TimeArray  # (period,)
    lidar_mps: FloatArray  # (period,)
    lidar_deg: FloatArray
    mast_mps: FloatArray
    mast_deg: FloatArray
    slope: float  # mast = slope · lidar
    turn: tuple[float, float] = (1.0, 0.0)  # mast = turn[0] · lidar + turn[1], directions [deg]


class SizeCurve(NamedTuple):
    """Measured and predicted regression over sector sizes; NaN where it is not known."""

    sector_deg: FloatArray  # (size,)
    slope: FloatArray
    slope_standard_error: FloatArray
    residual_std_mps: FloatArray
    residual_std_standard_error_mps: FloatArray
    direction_std_deg: FloatArray
    direction_std_standard_error_deg: FloatArray
    predicted_slope: FloatArray
    predicted_residual_std_mps: FloatArray
    predicted_direction_std_deg: FloatArray


def scatter(series: Series, *, where: str, top_mps: float | None = None) -> bytes:
    """Mast against lidar with the line through the origin, and the spread of both as boxes at the margins, as PNG.

    Parameters
    ----------
    series
        One sector size.
    where
        Campaign and scan, for the line under the title: untrusted text.
    top_mps
        End of both axes [m/s]; default: a little above the highest value.
    """
    top = top_mps or 1.05 * float(max(np.max(series.lidar_mps), np.max(series.mast_mps)))
    with canvas(5.4, 5.8) as figure:
        title(figure, "Wind speed: mast against lidar", f"{where}, {told(series)}")
        axes, above, right = _margins(figure)
        axes.plot([0, top], [0, top], color=INK_SOFT, linewidth=0.9, linestyle=(0, (4, 3)), label="equal")
        axes.plot(
            [0, top], [0, series.slope * top], color=PREDICTED, linewidth=1.4, label=f"mast = {series.slope:.4f} × lidar"
        )  # fmt: skip
        axes.plot(series.lidar_mps, series.mast_mps, "o", color=LIDAR, markersize=3.5, alpha=0.6)
        axes.set(xlim=(0, top), ylim=(0, top), xlabel="lidar [m/s]", ylabel="mast [m/s]", aspect="equal")
        ticks = np.arange(0.0, top, 5.0 if top > LONG_AXIS_MPS else 2.0)
        axes.set(xticks=ticks, yticks=ticks)
        axes.legend(loc="upper left")
        _box(above, series.lidar_mps, "horizontal")
        _box(right, series.mast_mps, "vertical")
        return image(figure)


def turn_scatter(series: Series, *, where: str) -> bytes:
    """The mast's direction against the lidar's with the line fitted on the circle, as PNG."""
    slope, offset_deg = series.turn
    with canvas(5.4, 5.8) as figure:
        title(figure, "Wind direction: mast against lidar", f"{where}, {told(series)}")
        axes = figure.add_subplot()
        ends = np.array([0.0, 360.0])
        axes.plot(ends, ends, color=INK_SOFT, linewidth=0.9, linestyle=(0, (4, 3)), label="equal")
        axes.plot(
            ends, slope * ends + offset_deg, color=PREDICTED, linewidth=1.4,
            label=f"mast = {slope:.4f} × lidar {offset_deg:+.2f}°, fitted on the circle",
        )  # fmt: skip
        axes.plot(series.lidar_deg, series.mast_deg, "o", color=LIDAR, markersize=3.5, alpha=0.6)
        axes.set(
            xlim=(0, 360),
            ylim=(0, 360),
            xlabel="lidar, wind from [°]",
            ylabel="mast, wind from [°]",
            aspect="equal",
        )
        axes.set_xticks(range(0, 361, 60))
        axes.set_yticks(range(0, 361, 60))
        axes.legend(loc="upper left")
        return image(figure)


def time_series(series: Sequence[Series], *, where: str) -> bytes:
    """Speed and direction of the mast and of some sizes over time, as PNG."""
    from matplotlib.dates import AutoDateLocator, ConciseDateFormatter

    with canvas(9.5, 5.4) as figure:
        title(figure, "Wind speed and direction over time (UTC)", where)
        upper, lower = figure.subplots(2, 1, sharex=True)
        first = series[0]
        for axes, mast, name in (
            (upper, first.mast_mps, "speed [m/s]"), (lower, first.mast_deg, "wind from [°]")
        ):  # fmt: skip
            axes.plot(
                first.time_utc, mast, "o", color=MAST, markersize=5, markerfacecolor="none", label="mast"
            )
            axes.set_ylabel(name)
        for number, one in enumerate(series):
            look = {"color": LIDARS[number % len(LIDARS)], "linestyle": "none", "markersize": 4}
            for axes, values in ((upper, one.lidar_mps), (lower, one.lidar_deg)):
                axes.plot(
                    one.time_utc, values, MARKS[number % len(MARKS)], label=f"lidar, {one.label}", **look
                )
        lower.set_ylim(0, 360)
        lower.set_yticks(range(0, 361, 90))
        upper.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=len(series) + 1)
        locator = AutoDateLocator()  # type: ignore[no-untyped-call]
        lower.xaxis.set_major_locator(locator)
        lower.xaxis.set_major_formatter(ConciseDateFormatter(locator))  # type: ignore[no-untyped-call]
        return image(figure)


def by_direction(series: Series, *, where: str, bin_deg: float = 10.0) -> bytes:
    """Residuals of speed and direction against where the wind comes from, as PNG: a wake shows as a dent."""
    speed = series.mast_mps - series.slope * series.lidar_mps
    angle = np.asarray(difference_deg(series.mast_deg, series.lidar_deg))
    with canvas(8.5, 5.6) as figure:
        title(figure, "Residuals against wind direction: a wake shows as a dent", f"{where}, {told(series)}")
        names = (f"mast − {series.slope:.3f} × lidar\n[m/s]", "mast − lidar\n[°]")
        rows = figure.subplots(2, 1, sharex=True)
        for axes, residual, name in zip(rows, (speed, angle), names, strict=True):
            found = residual_by_direction(series.mast_deg, residual, bin_deg=bin_deg)
            there = found.count > 0
            at = found.from_deg[there]
            axes.axhline(0.0, color=INK, linewidth=0.8)
            axes.vlines(
                at, found.lower[there], found.upper[there], color=LIDAR, linewidth=4, alpha=0.45,
                label=f"quartiles of {bin_deg:g}°",
            )  # fmt: skip
            axes.plot(series.mast_deg, residual, ".", color=INK_SOFT, markersize=3, label="a period")
            axes.plot(
                at, found.median[there], "D", color=PREDICTED, markersize=4, label=f"median of {bin_deg:g}°"
            )
            axes.set(ylabel=name, xlim=(0, 360))
            axes.set_xticks(range(0, 361, 30))
        rows[0].legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=3)
        rows[1].set_xlabel("wind from [°], mast")
        return image(figure)


def per_size(curve: SizeCurve, *, where: str) -> bytes:
    """Slope and scatter against the sector size, measured and predicted, as PNG."""
    panels = (
        ("Slope: mast = slope × lidar", "slope", curve.slope, curve.predicted_slope, curve.slope_standard_error),
        (
            "Scatter of mast − slope × lidar", "standard deviation [m/s]", curve.residual_std_mps,
            curve.predicted_residual_std_mps, curve.residual_std_standard_error_mps,
        ),
        (
            "Scatter of direction about its line", "standard deviation [°]", curve.direction_std_deg,
            curve.predicted_direction_std_deg, curve.direction_std_standard_error_deg,
        ),
    )  # fmt: skip
    with canvas(11.0, 4.0) as figure:
        title(figure, "Regression against the mast, by sector size", f"{where}; bars: standard error")
        for axes, (name, unit, measured, predicted, error) in zip(figure.subplots(1, 3), panels, strict=True):
            if np.any(np.isfinite(predicted)):
                axes.plot(curve.sector_deg, predicted, "-", color=PREDICTED, linewidth=1.5, label="predicted")
            axes.errorbar(
                curve.sector_deg, measured, yerr=error, fmt="o", color=LIDAR, markersize=4, capsize=2, label="measured"
            )  # fmt: skip
            axes.set(xlabel="sector [°]", ylabel=unit)
            axes.set_title(name, fontsize=10)
            axes.legend()
        return image(figure)


def told(series: Series) -> str:
    """What a figure of one size says of it."""
    count = len(series.time_utc)
    return f"{series.label}, {count} period{'' if count == 1 else 's'}"


def title(figure: "Figure", what: str, where: str) -> None:
    """Say above a figure what it shows, and under that of what."""
    width_in, height_in = figure.get_size_inches()
    longest = int(width_in * 13)  # letters of the second size to the inch
    told = [shown(line, longest=longest) for line in wrap(where, longest, max_lines=3, placeholder="…")]
    head_in = HEAD_IN + (len(told) - 1) * LINE_IN
    engine = figure.get_layout_engine()
    if engine is not None:
        engine.set(rect=(0, 0, 1, 1 - head_in / height_in))  # type: ignore[call-arg]
    lines = ((0.06, shown(what, longest=90), 12, "bold", INK), (0.30, "\n".join(told), 9, "normal", INK_SOFT))
    for down_in, text, size, weight, colour in lines:
        figure.text(
            0.01, 1 - down_in / height_in, text, fontsize=size, fontweight=weight, color=colour,
            ha="left", va="top", parse_math=False,
        )  # fmt: skip


def _margins(figure: "Figure") -> tuple["Axes", "Axes", "Axes"]:
    """Axes with a strip above and one at the right."""
    grid = figure.add_gridspec(2, 2, width_ratios=(9, 1), height_ratios=(1, 9), wspace=0.02, hspace=0.02)
    axes = figure.add_subplot(grid[1, 0])
    return axes, figure.add_subplot(grid[0, 0], sharex=axes), figure.add_subplot(grid[1, 1], sharey=axes)


def _box(axes: "Axes", values: FloatArray, way: Literal["vertical", "horizontal"]) -> None:
    axes.boxplot(
        values,
        orientation=way,
        widths=0.6,
        flierprops={"markersize": 2},
        medianprops={"color": PREDICTED},
        manage_ticks=False,
    )
    axes.set_axis_off()
