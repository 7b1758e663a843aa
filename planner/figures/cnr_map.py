"""The CNR map of a hard target: what came back from where, and where the target was found."""

from typing import TYPE_CHECKING, Any

import numpy as np

from geometry.angles import difference_deg
from geometry.arrays import FloatArray, IntArray
from planner.cnr_fit import Mapped
from planner.figures.canvas import canvas, image
from planner.figures.names import shown
from planner.palette import CROSSING, ERROR, INK_SOFT, LIDARS

if TYPE_CHECKING:
    from matplotlib.figure import Figure

COLOURS = "cividis"  # from dark to light for every kind of colour vision
FAINTEST_DB = -25.0
CELLS_PER_STEP = 6  # of the picture, so that staggered rays are seen where they are
MOST_CELLS = 600  # in either direction
GATES_SHOWN = (-1.0, -0.5, 0.0, 0.5, 1.0)  # probe lengths from the target


def cnr_map_figure(mapped: Mapped, probe_m: float) -> bytes:
    """Draw one map as a PNG: combined over the gates, its profile along the range, and some gates by themselves.

    Parameters
    ----------
    mapped
        The map and what was found in it.
    probe_m
        Length of the probe (full width at half maximum) [m].
    """
    with canvas(11.0, 7.4) as figure:
        grid = figure.add_gridspec(2, len(GATES_SHOWN), height_ratios=(1.9, 1.0))
        _combined(figure, figure.add_subplot(grid[0, :3]), mapped)
        _profile(figure.add_subplot(grid[0, 3:]), mapped)
        _gates(figure, grid, mapped, probe_m)
        return image(figure)


def _aside(mapped: Mapped) -> tuple[FloatArray, FloatArray]:
    """(ray,) head angles, the azimuth as a number without a jump at north."""
    middle = mapped.cnr_map.middle_deg[0]
    return middle + np.asarray(
        difference_deg(mapped.cnr_map.azimuth_deg, middle)
    ), mapped.cnr_map.elevation_deg


def _nearest(mapped: Mapped) -> tuple[IntArray, tuple[float, float, float, float]]:
    """(row, column) the nearest ray of each of the picture's cells, and their left, right, lower, upper edge [deg]."""
    from scipy.spatial import KDTree

    rays = np.stack(_aside(mapped), axis=1)
    steps = np.array([max(step, 1e-4) for step in mapped.cnr_map.step_deg])
    low, high = rays.min(axis=0) - 0.5 * steps, rays.max(axis=0) + 0.5 * steps
    counts = np.clip(np.ceil(CELLS_PER_STEP * (high - low) / steps), 1, MOST_CELLS).astype(int)
    middles = [
        first + (np.arange(count) + 0.5) * (last - first) / count
        for first, last, count in zip(low, high, counts, strict=True)
    ]
    grid = np.stack(np.meshgrid(*middles), axis=-1)
    _, nearest = KDTree(rays / steps).query(grid / steps)
    return np.asarray(nearest), (float(low[0]), float(high[0]), float(low[1]), float(high[1]))


def _mosaic(axes: Any, mapped: Mapped, values: FloatArray, low: float, high: float) -> Any:
    """Every place in the colour of its nearest ray."""
    nearest, extent = _nearest(mapped)
    mosaic = axes.imshow(
        values[nearest],
        extent=extent,
        origin="lower",
        aspect="auto",
        interpolation="nearest",
        cmap=COLOURS,
        vmin=low,
        vmax=high,
    )
    axes.grid(visible=False)
    axes.ticklabel_format(useOffset=False)
    return mosaic


def _combined(figure: "Figure", axes: Any, mapped: Mapped) -> None:
    with np.errstate(divide="ignore", invalid="ignore"):
        power_db = 10.0 * np.log10(np.maximum(mapped.found.power, 1e-9))
    mosaic = _mosaic(axes, mapped, power_db, FAINTEST_DB, 0.0)
    _cross(axes, mapped)
    bar = figure.colorbar(mosaic, ax=axes, pad=0.02, extend="min")
    bar.set_label("power above the air around it, full hit = 0 dB")
    axes.set_xlabel("head azimuth (°)")
    axes.set_ylabel("head elevation (°)")
    axes.set_title(f"{shown(mapped.name)}: found {_found(mapped)}", fontsize=11, parse_math=False)


def _cross(axes: Any, mapped: Mapped) -> None:
    """Where the target was found; a line where its shape tells one angle only."""
    azimuth = mapped.cnr_map.middle_deg[0] + float(
        difference_deg(mapped.found.azimuth_deg, mapped.cnr_map.middle_deg[0])
    )
    if np.isfinite(mapped.found.azimuth_std_deg):
        axes.axvline(azimuth, color=ERROR, linewidth=1.0)
    if np.isfinite(mapped.found.elevation_std_deg):
        axes.axhline(mapped.found.elevation_deg, color=ERROR, linewidth=1.0)


def _found(mapped: Mapped) -> str:
    found = mapped.found
    parts = [
        f"{name} {value:.4f}±{std:.4f}°"
        for name, value, std in (
            ("az", found.azimuth_deg, found.azimuth_std_deg),
            ("el", found.elevation_deg, found.elevation_std_deg),
        )
        if np.isfinite(std)
    ]
    return ", ".join(parts)


def _profile(axes: Any, mapped: Mapped) -> None:
    """CNR along the range, of rays that hit and of rays that miss."""
    ranges, cnr, hit = mapped.cnr_map.range_m, mapped.cnr_map.cnr_db, mapped.found.hit
    full = hit >= 0.5 * hit.max()
    missed = hit < 0.01 * hit.max()
    for rays, colour, label in ((missed, INK_SOFT, "rays that miss"), (full, LIDARS[0], "rays that hit")):
        if not rays.any():
            continue
        low, middle, high = np.nanpercentile(cnr[rays], [16, 50, 84], axis=0)
        axes.fill_between(ranges, low, high, color=colour, alpha=0.2, linewidth=0)
        axes.plot(ranges, middle, color=colour, linewidth=1.6, label=f"{label} ({int(rays.sum())})")
    std = mapped.found.range_std_m
    text = f"{mapped.found.range_m:.2f}" + (f"±{std:.2f} m" if np.isfinite(std) else " m")
    axes.axvline(mapped.found.range_m, color=ERROR, linewidth=1.0, label=f"found {text}")
    axes.set_xlabel("range (m)")
    axes.set_ylabel("CNR (dB), median and 68 %")
    axes.legend(loc="upper left")
    axes.set_ylim(top=axes.get_ylim()[1] + 0.25 * np.ptp(axes.get_ylim()))
    axes.set_title("along the range", fontsize=11)


def _gates(figure: "Figure", grid: Any, mapped: Mapped, probe_m: float) -> None:
    """The map at some gates, all in one scale."""
    low, high = np.nanpercentile(mapped.cnr_map.cnr_db, [1, 99.9])
    for column, part in enumerate(GATES_SHOWN):
        wanted = mapped.found.range_m + part * probe_m
        gate = int(np.abs(mapped.cnr_map.range_m - wanted).argmin())
        axes = figure.add_subplot(grid[1, column])
        mosaic = _mosaic(axes, mapped, mapped.cnr_map.cnr_db[:, gate], float(low), float(high))
        axes.set_xticks([])
        axes.set_yticks([])
        axes.set_title(
            f"{mapped.cnr_map.range_m[gate]:.0f} m", fontsize=10, color=CROSSING, fontweight="normal"
        )
    bar = figure.colorbar(mosaic, ax=figure.axes[-len(GATES_SHOWN) :], pad=0.01)
    bar.set_label("CNR (dB)")
