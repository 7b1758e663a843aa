"""A campaign against its mast: scatter, time series, residual against direction, regression per sector size, wind."""

from collections.abc import Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np

from geometry.arrays import FloatArray
from planner.figures.canvas import canvas, image
from planner.figures.names import shown
from planner.palette import EXCLUDED, INK, INK_SOFT, LIDARS
from reconstruct.averaging import TimeArray
from reconstruct.comparison import WeibullFit, fit_weibull, residual_by_direction

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MAST, LIDAR, PREDICTED = INK, LIDARS[0], EXCLUDED
ROSE_SECTORS = 12
ROSE_SPEEDS_MPS = (0.0, 5.0, 10.0, 15.0, np.inf)
LEAST_PERIODS = 2


class Series(NamedTuple):
    """The periods that lidar and mast share, for one sector size."""

    label: str
    time_utc: TimeArray  # (period,)
    lidar_mps: FloatArray  # (period,)
    lidar_deg: FloatArray
    mast_mps: FloatArray
    mast_deg: FloatArray
    slope: float  # mast = slope · lidar


class SizeCurve(NamedTuple):
    """Measured and predicted regression over sector sizes; NaN where it is not known."""

    sector_deg: FloatArray  # (size,)
    slope: FloatArray
    slope_standard_error: FloatArray
    residual_std_mps: FloatArray
    direction_std_deg: FloatArray
    predicted_slope: FloatArray
    predicted_residual_std_mps: FloatArray
    predicted_direction_std_deg: FloatArray


def scatter(series: Series, *, title: str) -> bytes:
    """Mast against lidar with the line through the origin, and the spread of both as boxes at the margins, as PNG."""
    with canvas(5.2, 5.2) as figure:
        grid = figure.add_gridspec(2, 2, width_ratios=(9, 1), height_ratios=(1, 9), wspace=0.02, hspace=0.02)
        axes = figure.add_subplot(grid[1, 0])
        above, right = (
            figure.add_subplot(grid[0, 0], sharex=axes),
            figure.add_subplot(grid[1, 1], sharey=axes),
        )
        top = 1.05 * float(max(np.max(series.lidar_mps), np.max(series.mast_mps)))
        axes.plot([0, top], [0, top], color=INK_SOFT, linewidth=0.9, linestyle=(0, (4, 3)), label="equal")
        axes.plot(
            [0, top],
            [0, series.slope * top],
            color=PREDICTED,
            linewidth=1.4,
            label=f"{series.slope:.4f} × lidar",
        )
        axes.plot(series.lidar_mps, series.mast_mps, "o", color=LIDAR, markersize=3.5, alpha=0.6)
        axes.set(xlim=(0, top), ylim=(0, top), xlabel="lidar [m/s]", ylabel="mast [m/s]", aspect="equal")
        axes.legend(loc="upper left")
        _box(above, series.lidar_mps, "horizontal")
        _box(right, series.mast_mps, "vertical")
        _title(figure, f"{title}, {series.label}")
        return image(figure)


def time_series(series: Sequence[Series], *, title: str) -> bytes:
    """Speed and direction of the mast and of some sizes over time, as PNG."""
    with canvas(9.5, 5.0) as figure:
        upper, lower = figure.subplots(2, 1, sharex=True)
        first = series[0]
        for axes, mast, name in ((upper, first.mast_mps, "speed [m/s]"), (lower, first.mast_deg, "from [°]")):
            axes.plot(first.time_utc, mast, "o", color=MAST, markersize=3, label="mast")
            axes.set_ylabel(name)
        for number, one in enumerate(series):
            colour = LIDARS[number % len(LIDARS)]
            for axes, values in ((upper, one.lidar_mps), (lower, one.lidar_deg)):
                axes.plot(one.time_utc, values, ".", color=colour, markersize=4, label=f"lidar, {one.label}")
        lower.set_ylim(0, 360)
        lower.set_yticks(range(0, 361, 90))
        upper.legend(loc="upper right", ncols=len(series) + 1)
        figure.autofmt_xdate()
        _title(figure, title)
        return image(figure)


def by_direction(series: Series, *, title: str, bin_deg: float = 10.0) -> bytes:
    """Residuals of speed and direction against where the wind comes from, as PNG: a wake shows as a dent."""
    from geometry.angles import difference_deg

    speed = series.mast_mps - series.slope * series.lidar_mps
    angle = np.asarray(difference_deg(series.mast_deg, series.lidar_deg))
    with canvas(8.5, 5.2) as figure:
        names = ("mast − slope × lidar [m/s]", "mast − lidar [°]")
        for axes, residual, name in zip(
            figure.subplots(2, 1, sharex=True), (speed, angle), names, strict=True
        ):
            found = residual_by_direction(series.mast_deg, residual, bin_deg=bin_deg)
            there = found.count > 0
            axes.plot(series.mast_deg, residual, ".", color=INK_SOFT, markersize=2.5, alpha=0.5)
            axes.vlines(
                found.from_deg[there], found.lower[there], found.upper[there], color=LIDAR, linewidth=3
            )
            axes.plot(found.from_deg[there], found.median[there], "o", color=PREDICTED, markersize=4)
            axes.axhline(0.0, color=INK, linewidth=0.8)
            axes.set_ylabel(name)
            axes.set_xlim(0, 360)
            axes.set_xticks(range(0, 361, 30))
        axes.set_xlabel("wind from [°], mast; dot: median, bar: quartiles")
        _title(figure, f"{title}, {series.label}")
        return image(figure)


def per_size(curve: SizeCurve, *, title: str) -> bytes:
    """Slope and scatter against the sector size, measured and predicted, as PNG."""
    panels = (
        ("slope, mast = slope × lidar", curve.slope, curve.predicted_slope, curve.slope_standard_error),
        ("residual [m/s]", curve.residual_std_mps, curve.predicted_residual_std_mps, None),
        ("direction [°]", curve.direction_std_deg, curve.predicted_direction_std_deg, None),
    )
    with canvas(10.0, 3.4) as figure:
        for axes, (name, measured, predicted, error) in zip(figure.subplots(1, 3), panels, strict=True):
            axes.errorbar(
                curve.sector_deg,
                measured,
                yerr=error,
                fmt="o",
                color=LIDAR,
                markersize=4,
                capsize=2,
                label="measured",
            )
            if np.any(np.isfinite(predicted)):
                axes.plot(curve.sector_deg, predicted, "-", color=PREDICTED, linewidth=1.5, label="predicted")
            axes.set(xlabel="sector [°]", title=name)
            axes.title.set_fontsize(10.5)
            axes.legend()
        _title(figure, title)
        return image(figure)


def wind(series: Series, *, title: str) -> bytes:
    """Density of speeds with their Weibull distributions, and the wind roses of mast and lidar, as PNG."""
    with canvas(10.0, 3.6) as figure:
        density = figure.add_subplot(1, 3, 1)
        _densities(density, series)
        pairs = (("mast", series.mast_mps, series.mast_deg), ("lidar", series.lidar_mps, series.lidar_deg))
        for number, (name, speed, angle) in enumerate(pairs):
            _rose(figure, number + 2, name, speed, angle)
        _title(figure, f"{title}, {series.label}")
        return image(figure)


def _densities(axes: "Axes", series: Series) -> None:
    top = float(max(np.max(series.lidar_mps), np.max(series.mast_mps)))
    edges = np.arange(0.0, top + 1.0, 1.0)
    at = np.linspace(1e-3, top, 200)
    for name, speed, colour in (("mast", series.mast_mps, MAST), ("lidar", series.lidar_mps, LIDAR)):
        axes.hist(speed, bins=edges.tolist(), density=True, histtype="step", color=colour, linewidth=1.2)
        fit = fit_weibull(speed)
        axes.plot(at, _weibull_density(at, fit), color=colour, linewidth=1.0, linestyle=(0, (4, 3)),
                  label=f"{name}: A {fit.scale_mps:.1f}, k {fit.shape:.2f}")  # fmt: skip
    axes.set(xlabel="speed [m/s]", ylabel="density [1/(m/s)]", ylim=(0, 1.3 * axes.get_ylim()[1]))
    axes.legend(fontsize=8)


def _weibull_density(speed: FloatArray, fit: WeibullFit) -> FloatArray:
    share = speed / fit.scale_mps
    return np.asarray(fit.shape / fit.scale_mps * share ** (fit.shape - 1) * np.exp(-(share**fit.shape)))


def _rose(figure: "Figure", place: int, name: str, speed: FloatArray, angle: FloatArray) -> None:
    axes = figure.add_subplot(1, 3, place, projection="polar")
    axes.set_theta_zero_location("N")  # type: ignore[attr-defined]
    axes.set_theta_direction(-1)  # type: ignore[attr-defined]
    width = 360.0 / ROSE_SECTORS
    sector = (np.mod(angle + width / 2, 360.0) // width).astype(int) % ROSE_SECTORS
    bottom = np.zeros(ROSE_SECTORS)
    for number, (low, high) in enumerate(pairwise(ROSE_SPEEDS_MPS)):
        inside = (speed >= low) & (speed < high)
        share = np.bincount(sector[inside], minlength=ROSE_SECTORS) / len(speed)
        label = f"{low:g} to {high:g} m/s" if np.isfinite(high) else f"over {low:g} m/s"
        axes.bar(
            np.radians(np.arange(ROSE_SECTORS) * width), share, np.radians(0.9 * width), bottom=bottom,
            color=LIDARS[number % len(LIDARS)], label=label,
        )  # fmt: skip
        bottom += share
    axes.set_yticklabels([])
    axes.set_title(name, fontsize=10)
    if place == 3:
        axes.legend(loc="center left", bbox_to_anchor=(1.15, 0.5), fontsize=7.5)


def _box(axes: "Axes", values: FloatArray, way: Literal["vertical", "horizontal"]) -> None:
    axes.boxplot(
        values,
        orientation=way,
        widths=0.6,
        flierprops={"markersize": 2},
        medianprops={"color": PREDICTED},
    )
    axes.set_axis_off()


def _title(figure: "Figure", text: str) -> None:
    figure.suptitle(
        shown(text, longest=90), x=0.01, ha="left", fontsize=12, fontweight="bold", parse_math=False
    )
