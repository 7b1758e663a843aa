"""The winds that were compared: densities of speed and direction, roses, profile over height."""

from collections.abc import Sequence
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from geometry.angles import wrap_180_deg
from geometry.arrays import FloatArray
from planner.figures.canvas import canvas, image
from planner.figures.comparison import LIDAR, MAST, Series, title, told
from planner.figures.names import shown
from planner.palette import LIDARS
from reconstruct.comparison import WeibullFit, fit_weibull

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

ROSE_SECTORS = 12
ROSE_SPEEDS_MPS = (0.0, 5.0, 10.0, 15.0, np.inf)
ROSE_COLOURS = ("#fde68a", "#e69f00", "#b5474d", "#3b0f4f")  # light to dark: told apart in grey too
DIRECTION_BIN_DEG = 10.0
COMPASS = ("N", "NE", "E", "SE", "S", "SW", "W", "NW")
MARKS = "sD^vP"


def densities(series: Series, *, where: str) -> bytes:
    """How often each speed and direction came, by mast and lidar, with the Weibull distributions fitted, as PNG."""
    with canvas(10.0, 4.0) as figure:
        title(figure, "Speeds and directions that were compared", f"{where}, {told(series)}")
        speed, direction = figure.subplots(1, 2)
        _speeds(speed, series)
        _directions(direction, series)
        return image(figure)


def roses(series: Series, *, where: str) -> bytes:
    """The wind roses of mast and lidar, on one scale, as PNG."""
    with canvas(10.0, 4.6) as figure:
        title(figure, "Wind roses: where the wind came from, and how fast", f"{where}, {told(series)}")
        pairs = (("mast", series.mast_mps, series.mast_deg), ("lidar", series.lidar_mps, series.lidar_deg))
        shares = [_shares(speed, angle) for _, speed, angle in pairs]
        top = max(float(np.max(np.sum(share, axis=0))) for share in shares)
        for number, ((name, _, _), share) in enumerate(zip(pairs, shares, strict=True)):
            _rose(figure, number + 1, name, share, top)
        return image(figure)


def profile(levels: Sequence[tuple[str, FloatArray, FloatArray, FloatArray]], *, where: str) -> bytes:
    """Mean speed and direction against height, as PNG.

    Parameters
    ----------
    levels
        Name, heights above ground [m], mean speeds [m/s] and directions [deg] of each instrument; the mast is
        called so.
    where
        Campaign and number of periods, for the line under the title.
    """
    with canvas(8.0, 5.2) as figure:
        title(figure, "Wind profile: means over the periods that all heights share", where)
        left, right = figure.subplots(1, 2, sharey=True)
        centre = float(levels[0][3][-1])
        for number, (name, height, speed, angle) in enumerate(levels):
            mast = name == "mast"
            look = {
                "color": MAST if mast else LIDARS[(number - 1) % len(LIDARS)],
                "marker": "o" if mast else MARKS[number % len(MARKS)],
                "linestyle": "-" if mast else "--",
                "markersize": 6,
                "label": shown(name),
            }
            left.plot(speed, height, **look)
            right.plot(centre + np.asarray(wrap_180_deg(angle - centre)), height, **look)
        left.set(xlabel="mean speed [m/s]", ylabel="height above ground [m]", ylim=(0, None))
        right.set(xlabel="mean direction, wind from [°]")
        right.xaxis.set_major_formatter(lambda value, _: f"{value % 360:g}")  # profiles may cross north
        for axes in (left, right):
            axes.margins(x=0.15)
        left.legend(loc="upper left")
        return image(figure)


def _speeds(axes: "Axes", series: Series) -> None:
    top = float(max(np.max(series.lidar_mps), np.max(series.mast_mps)))
    edges = np.arange(0.0, top + 1.0, 1.0)
    at = np.linspace(1e-3, 1.1 * top, 200)
    for name, speed, colour, dash in (
        ("mast", series.mast_mps, MAST, (0, (4, 3))), ("lidar", series.lidar_mps, LIDAR, (0, (1, 1.5)))
    ):  # fmt: skip
        axes.hist(
            speed, bins=edges.tolist(), density=True, histtype="step", color=colour, linewidth=1.4, label=name
        )
        fit = fit_weibull(speed)
        label = f"Weibull of {name}: A {fit.scale_mps:.1f} m/s, k {fit.shape:.2f}"
        axes.plot(at, _weibull_density(at, fit), color=colour, linewidth=1.4, linestyle=dash, label=label)
    axes.set(xlabel="speed [m/s]", ylabel="density [1/(m/s)]", xlim=(0, None))
    axes.set_ylim(0, 1.45 * axes.get_ylim()[1])  # room for the legend
    axes.legend(fontsize=8, loc="upper left")


def _directions(axes: "Axes", series: Series) -> None:
    edges = np.arange(0.0, 360.0 + DIRECTION_BIN_DEG, DIRECTION_BIN_DEG)
    for name, angle, colour, dash in (
        ("mast", series.mast_deg, MAST, "-"),
        ("lidar", series.lidar_deg, LIDAR, "--"),
    ):
        axes.hist(
            np.mod(angle, 360.0), bins=edges.tolist(), density=True, histtype="step", color=colour, linewidth=1.4,
            linestyle=dash, label=name,
        )  # fmt: skip
    axes.set(xlabel="wind from [°]", ylabel="density [1/°]", xlim=(0, 360))
    axes.set_xticks(range(0, 361, 60))
    axes.set_ylim(0, 1.25 * axes.get_ylim()[1])
    axes.legend(fontsize=8, loc="upper left")


def _weibull_density(speed: FloatArray, fit: WeibullFit) -> FloatArray:
    share = speed / fit.scale_mps
    return np.asarray(fit.shape / fit.scale_mps * share ** (fit.shape - 1) * np.exp(-(share**fit.shape)))


def _shares(speed: FloatArray, angle: FloatArray) -> FloatArray:
    """(speed class, sector) share of the periods [%]."""
    width = 360.0 / ROSE_SECTORS
    sector = (np.mod(angle + width / 2, 360.0) // width).astype(int) % ROSE_SECTORS
    inside = [(speed >= low) & (speed < high) for low, high in pairwise(ROSE_SPEEDS_MPS)]
    return (
        np.stack([np.bincount(sector[each], minlength=ROSE_SECTORS) for each in inside]) * 100.0 / len(speed)
    )


def _rose(figure: "Figure", place: int, name: str, shares: FloatArray, top: float) -> None:
    axes = figure.add_subplot(1, 2, place, projection="polar")
    axes.set_theta_zero_location("N")  # type: ignore[attr-defined]
    axes.set_theta_direction(-1)  # type: ignore[attr-defined]
    axes.set_thetagrids(range(0, 360, 45), COMPASS)  # type: ignore[attr-defined]
    width = 360.0 / ROSE_SECTORS
    bottom = np.zeros(ROSE_SECTORS)
    for (low, high), share, colour in zip(pairwise(ROSE_SPEEDS_MPS), shares, ROSE_COLOURS, strict=True):
        label = f"{low:g} to {high:g} m/s" if np.isfinite(high) else f"over {low:g} m/s"
        axes.bar(
            np.radians(np.arange(ROSE_SECTORS) * width), share, np.radians(0.9 * width), bottom=bottom,
            color=colour, edgecolor=MAST, linewidth=0.3, label=label if np.any(share) else None,
        )  # fmt: skip
        bottom += share
    axes.set_ylim(0, 1.05 * top)
    axes.set_rlabel_position(22.5)  # type: ignore[attr-defined]
    axes.yaxis.set_major_formatter(lambda value, _: f"{value:g} %")
    axes.tick_params(axis="y", labelsize=7.5)
    axes.set_title(name, fontsize=10)
    if place == 2:
        axes.legend(loc="center left", bbox_to_anchor=(1.15, 0.5), fontsize=8)
