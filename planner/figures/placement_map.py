"""Maps of where lidars may stand, what hinders elsewhere, and how wrong the wind would be."""

from textwrap import wrap
from typing import TYPE_CHECKING

import numpy as np

from geometry.angles import difference_deg
from geometry.arrays import FloatArray
from planner.figures.canvas import canvas, image
from planner.palette import CROSSING, EXCLUDED, INK, INK_SOFT, MAST, PAPER, TURBINE, lidar_colour
from planner.placement.maps import CRITERIA, of_lidar
from planner.placement.ranking import Placement
from planner.placement.search import UNSEEN
from planner.placement.write import least_slack

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.text import Annotation

WIDTH_IN = 8.5
SCALE_TOP = 2.0  # colours end at this multiple of the least error: farther out nobody wants to stand
HINDERED = "#d9d5cf"
COLOURS = "viridis_r"
SIDES = (  # where a name may stand, right and up of its place [points], in order of preference
    *((9.0, 6.0), (-9.0, 6.0), (9.0, -14.0), (-9.0, -14.0), (0.0, 12.0), (0.0, -20.0)),
    *((9.0, 20.0), (-9.0, 20.0), (9.0, -28.0), (-9.0, -28.0)),
)
BAR_LABEL = {
    "vector": "error of the wind vector [m/s]",
    "speed": "error of the wind speed [m/s]",
    "direction": "error of the wind direction [°]",
}


def error_map(found: Placement) -> bytes:
    """Draw the error that a lidar at each place can be part of, with the ranked and declared places, as a PNG."""
    error = np.where(found.error < np.sqrt(UNSEEN), found.error, np.nan).reshape(found.grid.shape)
    high, wide = _size(found)
    with canvas(WIDTH_IN, WIDTH_IN * high / wide * 0.8 + 1.1) as figure:
        axes = figure.add_subplot()
        _frame(axes, found)
        _hindered(axes, found)
        kept = np.where(np.isfinite(error), error, np.nan)
        least, most = float(np.nanmin(kept)), float(np.nanmax(kept))
        top = min(SCALE_TOP * least, most)
        shown = axes.pcolormesh(
            *_middle(found),
            kept,
            cmap=COLOURS,
            vmin=least,
            vmax=top,
            shading="nearest",
            rasterized=True,
        )
        extend = "max" if most > top else "neither"
        bar = figure.colorbar(shown, ax=axes, shrink=0.8, extend=extend)
        bar.set_label(BAR_LABEL[found.task.criterion], color=INK)
        _things(axes, found)
        axes.set_title(_title(found), parse_math=False)
        _legend(figure, axes, flat=bool(np.any(np.isnan(kept.ravel()) & found.seen.allowed.all(axis=0))))
        return image(figure)


def criteria_maps(found: Placement) -> bytes:
    """Draw one small map for each criterion that hinders anywhere: what is left over of it, as a PNG.

    The opening angle is among them where the placed lidar pairs with one that stands.
    """
    every = {**least_slack(found.seen), **_opening_slack(found)}
    slack = {name: values for name, values in every.items() if np.any(values < 0.0)} or {
        "range-max": every["range-max"]
    }
    names = list(slack)
    columns = min(len(names), 3)
    rows = -(-len(names) // columns)
    high, wide = _size(found)
    with canvas(3.6 * columns, (2.9 * high / wide + 1.2) * rows + 0.4) as figure:
        figure.suptitle("What is left over of each criterion" + _where_least(found), x=0.01, ha="left")
        panels = np.atleast_1d(figure.subplots(rows, columns, squeeze=False).ravel())
        for axes, name in zip(panels, names, strict=False):
            _criterion(figure, axes, found, name, slack[name])
        for axes in panels[len(names) :]:
            axes.set_visible(False)
        return image(figure)


def _where_least(found: Placement) -> str:
    """Tell of which target, where there are several."""
    return "" if len(found.task.targets) == 1 else ", at the target where it is least"


def _opening_slack(found: Placement) -> dict[str, FloatArray]:
    """(candidate,) folded opening angle with the standing lidar that crosses best, over what is asked [deg], by criterion.

    Empty where nothing stands: two lidars that are both placed open as their partner allows, which is no map.
    """
    task = found.task
    if not task.fixed:
        return {}
    standing = np.concatenate([of_lidar(task, lidar).azimuth_deg for lidar in task.fixed], axis=1)
    apart = np.abs(difference_deg(found.seen.azimuth_deg[:, None], standing[:, :, None]))
    folded = np.minimum(apart, 180.0 - apart).max(axis=1)
    return {"opening": np.asarray(folded.min(axis=0) - task.limits.least_opening_deg)}


def sight_map(found: Placement) -> bytes | None:
    """Draw how many targets a head at each place sees over the terrain, as a PNG; None without a terrain."""
    if found.task.terrain is None:
        return None
    from matplotlib.colors import BoundaryNorm

    slack = found.seen.slack["terrain"]
    count = len(found.task.targets)
    seen = np.where(np.isnan(slack).all(axis=0), np.nan, (slack >= 0.0).sum(axis=0)).reshape(found.grid.shape)
    high, wide = _size(found)
    steps = np.unique(np.linspace(0, count + 1, min(count + 1, 12) + 1).round()).astype(int)
    with canvas(WIDTH_IN, WIDTH_IN * high / wide * 0.8 + 1.1) as figure:
        axes = figure.add_subplot()
        _frame(axes, found)
        norm = BoundaryNorm(steps - 0.5, 256)
        shown = axes.pcolormesh(
            *_middle(found), seen, cmap="cividis", norm=norm, shading="nearest", rasterized=True
        )
        bar = figure.colorbar(shown, ax=axes, shrink=0.8, ticks=(steps[1:] + steps[:-1]) / 2 - 0.5)
        spans = zip(steps[:-1], steps[1:] - 1, strict=True)
        bar.set_ticklabels([f"{low}" if low == high else f"{low}–{high}" for low, high in spans])
        bar.set_label(f"targets, of {count}, that a head there sees over the terrain", color=INK)
        _things(axes, found)
        height_m = found.task.head_height_m
        axes.set_title(
            f"{found.task.site.name}: targets in sight of a head {height_m:.1f} m above the ground",
            parse_math=False,
        )
        _legend(figure, axes, flat=False)
        return image(figure)


def _criterion(figure: "Figure", axes: "Axes", found: Placement, name: str, slack: FloatArray) -> None:
    from matplotlib.ticker import MaxNLocator

    unit, meaning = CRITERIA[name]
    values = np.where(np.isfinite(slack), slack, np.nan).reshape(found.grid.shape)
    least = float(np.nanmin(values))
    top = -least if least < 0.0 else float(np.nanmax(values, initial=1e-9))
    shown = axes.pcolormesh(
        *_middle(found), values, cmap="RdYlBu", vmin=-top, vmax=top, shading="nearest", rasterized=True
    )
    if np.nanmin(values) < 0.0 < np.nanmax(values):
        axes.contour(*_middle(found), values, levels=[0.0], colors=[INK], linewidths=1.0)
    extend = "max" if np.nanmax(values) > top else "neither"
    figure.colorbar(
        shown,
        ax=axes,
        extend=extend,
        shrink=0.75,
        location="bottom",
        label=f"left over [{unit}]; red: not allowed",
    )
    _frame(axes, found)
    axes.set_title("\n".join(wrap(meaning, 34)), fontsize=9)
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_locator(MaxNLocator(5))
        axis.label.set_fontsize(8)
    axes.tick_params(labelsize=8)
    for target in found.task.targets_m:
        axes.plot(
            *_from_middle(found, target[None])[0],
            marker="*",
            color=CROSSING,
            markersize=8,
            markeredgecolor=PAPER,
        )


def _title(found: Placement) -> str:
    task = found.task
    many = "" if len(task.targets) == 1 else f", {task.aggregate} of {len(task.targets)} targets"
    if task.single:
        return f"{task.site.name}: sector scan from each place{many}"
    with_whom = " and ".join(lidar.name for lidar in task.fixed) or "its best partner"
    return f"{task.site.name}: a lidar at each place with {with_whom}{many}"


def _size(found: Placement) -> tuple[float, float]:
    grid = found.grid
    return abs(float(grid.north_m[0] - grid.north_m[-1])), abs(float(grid.east_m[-1] - grid.east_m[0]))


def _origin(found: Placement) -> FloatArray:
    """(2,) easting and northing that the axes count from [m]: round, near the targets."""
    return np.asarray(np.round(found.task.targets_m[:, :2].mean(axis=0)))


def _middle(found: Placement) -> tuple[FloatArray, FloatArray]:
    origin = _origin(found)
    return found.grid.east_m - origin[0], found.grid.north_m - origin[1]


def _from_middle(found: Placement, points_m: FloatArray) -> FloatArray:
    return np.asarray(points_m[:, :2] - _origin(found))


def _frame(axes: "Axes", found: Placement) -> None:
    east, north = _middle(found)
    half = found.grid.spacing_m / 2
    axes.set_xlim(east[0] - half, east[-1] + half)
    axes.set_ylim(north[-1] - half, north[0] + half)
    axes.set_aspect("equal")
    axes.grid(False)
    origin = _origin(found)
    axes.set_xlabel(f"easting less {origin[0]:.0f} [m]")
    axes.set_ylabel(f"northing less {origin[1]:.0f} [m]")


def _hindered(axes: "Axes", found: Placement) -> None:
    """Grey ground where no lidar may stand."""
    from matplotlib.colors import ListedColormap

    out = np.where(found.seen.allowed.all(axis=0), np.nan, 1.0).reshape(found.grid.shape)
    axes.pcolormesh(*_middle(found), out, cmap=ListedColormap([HINDERED]), shading="nearest", rasterized=True)
    axes.plot([], [], marker="s", color=HINDERED, markersize=10, linestyle="none", label="not allowed")


def _things(axes: "Axes", found: Placement) -> None:
    site, task = found.task.site, found.task
    if site.turbines:
        points = _from_middle(found, np.array([turbine.position for turbine in site.turbines]))
        axes.plot(
            *points.T,
            "o",
            color=PAPER,
            markeredgecolor=TURBINE,
            markeredgewidth=1.5,
            markersize=7,
            label="turbine",
        )
    if site.masts:
        points = _from_middle(found, np.array([mast.position for mast in site.masts]))
        axes.plot(*points.T, "^", color=MAST, markeredgecolor=PAPER, markersize=9, label="mast")
    targets = _from_middle(found, task.targets_m)
    axes.plot(
        *targets.T,
        "*",
        color=PAPER,
        markeredgecolor=CROSSING,
        markersize=11,
        linestyle="none",
        label="target",
    )
    for lidar in task.fixed:
        index = site.lidars.index(lidar)
        here = _from_middle(found, np.array([lidar.position]))[0]
        axes.plot(
            *here, "D", color=lidar_colour(index), markeredgecolor=PAPER, markersize=9, linestyle="none"
        )
        axes.plot(
            [here[0], targets[0, 0]], [here[1], targets[0, 1]], color=lidar_colour(index), linewidth=1.5
        )
        _name(axes, lidar.name, here)
    _ranked(axes, found, targets[0])


def _ranked(axes: "Axes", found: Placement, target: FloatArray) -> None:
    if found.declared is not None:
        for lidar, here in zip(
            found.task.replaced, _from_middle(found, found.declared.positions_m), strict=True
        ):
            axes.plot(
                *here,
                "D",
                color=PAPER,
                markeredgecolor=EXCLUDED,
                markeredgewidth=1.8,
                markersize=8,
                linestyle="none",
            )
            _name(axes, f"{lidar.name} as declared", here)
    for item in reversed(found.ranked):
        best = item.rank == 1
        for here in _from_middle(found, item.positions_m):
            axes.plot(
                *here,
                "D",
                color=EXCLUDED if best else PAPER,
                markeredgecolor=PAPER if best else INK_SOFT,
                markersize=10 if best else 7,
            )
            if best:
                axes.plot([here[0], target[0]], [here[1], target[1]], color=EXCLUDED, linewidth=1.5)
            _name(axes, f"{item.rank}", here)


def _name(axes: "Axes", text: str, here: FloatArray) -> None:
    """Write a name beside a place, on the side where it covers neither the frame nor a name that is there already."""
    from matplotlib.patheffects import withStroke

    halo = [withStroke(linewidth=2.5, foreground=PAPER)]
    label = axes.annotate(
        text,
        tuple(here),
        xytext=SIDES[0],
        textcoords="offset points",
        fontsize=9,
        color=INK,
        parse_math=False,
        path_effects=halo,
        zorder=9,
    )
    others = [item for item in axes.texts if item is not label]
    scores = []
    for side in SIDES:
        _put(label, side)
        box = label.get_window_extent()
        out = not (axes.bbox.contains(box.x0, box.y0) and axes.bbox.contains(box.x1, box.y1))
        scores.append(sum(box.overlaps(other.get_window_extent()) for other in others) + out)
    _put(label, SIDES[int(np.argmin(scores))])


def _put(label: "Annotation", side: tuple[float, float]) -> None:
    right, up = side
    label.xyann = (right, up)
    label.set_horizontalalignment("left" if right > 0 else "right" if right < 0 else "center")


def _legend(figure: "Figure", axes: "Axes", *, flat: bool) -> None:
    axes.plot(
        [],
        [],
        "D",
        color=EXCLUDED,
        markeredgecolor=PAPER,
        markersize=10,
        linestyle="none",
        label="best place",
    )
    axes.plot(
        [],
        [],
        "D",
        color=PAPER,
        markeredgecolor=INK_SOFT,
        markersize=7,
        linestyle="none",
        label="next best, by rank",
    )
    if flat:
        axes.plot(
            [],
            [],
            "s",
            color=PAPER,
            markeredgecolor=INK_SOFT,
            markersize=9,
            linestyle="none",
            label="beams cross too flat",
        )
    figure.legend(loc="outside lower left", ncols=4)
