"""Predicted error against sector size: speed, direction and slope, of one scan and of ten-minute means."""

from collections.abc import Sequence
from math import ceil
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from geometry.arrays import FloatArray
from planner.figures.canvas import canvas, image
from planner.figures.names import shown
from planner.palette import INK_SOFT, LIDARS

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

PER_ROW = 2


class TierCurve(NamedTuple):
    """The error of one scan as one tier predicts it, over sizes; NaN where the tier does not know."""

    tier: str
    sector_deg: FloatArray  # (size,)
    speed_bias_mps: FloatArray  # (size,) of one scan
    speed_std_mps: FloatArray
    direction_std_deg: FloatArray
    mean10_speed_bias_mps: FloatArray  # (size,) of a ten-minute mean
    mean10_speed_std_mps: FloatArray
    mean10_direction_std_deg: FloatArray
    slope: FloatArray


class Panel(NamedTuple):
    """One panel: heading, axis, and which arrays it draws as solid and dashed lines."""

    title: str
    axis: str
    lines: tuple[tuple[str, str, str], ...]  # (field, what it is, line style)
    zero: bool = True  # the axis reaches 0


PANELS = (
    Panel("Speed, one scan", "m/s", (("speed_std_mps", "std", "-"), ("speed_bias_mps", "bias", "--"))),
    Panel(
        "Speed, ten-minute mean",
        "m/s",
        (("mean10_speed_std_mps", "std", "-"), ("mean10_speed_bias_mps", "bias", "--")),
    ),
    Panel(
        "Direction",
        "°",
        (
            ("direction_std_deg", "std, one scan", "-"),
            ("mean10_direction_std_deg", "std, ten-minute mean", ":"),
        ),
    ),
    Panel("Slope, mast = slope × lidar", "", (("slope", "slope", "-"),), zero=False),
)


def sector_error(
    curves: Sequence[TierCurve],
    *,
    title: str,
    recommended_deg: float | None = None,
) -> bytes | None:
    """Draw the errors against the sector size as a PNG; panels of which nothing is known are left out.

    Parameters
    ----------
    curves
        One for each tier.
    title
        What is measured: untrusted text.
    recommended_deg
        Marked by a line; None where there is no recommendation.

    Returns
    -------
    bytes or None
        None where nothing at all is known for at least two sizes.
    """
    panels = [
        panel
        for panel in PANELS
        if any(_known(curve, field) for curve in curves for field, _, _ in panel.lines)
    ]
    if not panels:
        return None
    columns = min(PER_ROW, len(panels))
    rows = ceil(len(panels) / columns)
    with canvas(4.6 * columns, 2.9 * rows + 0.5) as figure:
        all_axes = figure.subplots(rows, columns, squeeze=False, sharex=True).ravel()
        for axes, panel in zip(all_axes, panels, strict=False):
            _panel(axes, panel, curves, recommended_deg)
        for axes in all_axes[len(panels) :]:
            axes.set_axis_off()
        for axes in all_axes[max(len(panels) - columns, 0) : len(panels)]:
            axes.set_xlabel("sector [°]")
            axes.tick_params(labelbottom=True)
        _finish(figure, list(all_axes[: len(panels)]), shown(title, longest=70))
        return image(figure)


def _known(curve: TierCurve, field: str) -> bool:
    return int(np.isfinite(getattr(curve, field)).sum()) >= 2


def _panel(axes: "Axes", panel: Panel, curves: Sequence[TierCurve], recommended_deg: float | None) -> None:
    for number, curve in enumerate(curves):
        for field, what, style in panel.lines:
            if not _known(curve, field):
                continue
            axes.plot(
                curve.sector_deg,
                getattr(curve, field),
                style,
                marker="o",
                markersize=3.5,
                linewidth=1.6,
                color=LIDARS[number % len(LIDARS)],
                label=what if len(curves) == 1 else f"{what}, {curve.tier}",
            )
    if panel.zero:
        low, high = axes.get_ylim()
        axes.set_ylim(min(low, 0.0), max(high, 0.0))
    if recommended_deg is not None:
        axes.axvline(
            recommended_deg,
            color=INK_SOFT,
            linewidth=1.2,
            linestyle=(0, (4, 3)),
            zorder=1,
            label=f"recommended: {recommended_deg:g}°",
        )
    axes.set_title(panel.title, fontsize=10.5)
    axes.set_ylabel(f"[{panel.axis}]" if panel.axis else "")


def _finish(figure: "Figure", all_axes: Sequence["Axes"], title: str) -> None:
    figure.suptitle(title, x=0.01, ha="left", fontsize=12, fontweight="bold", parse_math=False)
    for axes in all_axes:
        axes.legend(fontsize=8.5)
