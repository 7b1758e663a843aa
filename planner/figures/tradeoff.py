"""Speed against accuracy as a figure: one log-log panel a topic."""

from collections.abc import Sequence

from planner.figures.canvas import canvas, image
from planner.palette import INK, INK_SOFT, LIDARS
from planner.tradeoff import TOPICS, Trade

TITLES = {
    "geometry": "Earth model, one beam",
    "error tier": "Error tier, one scan's spread of speed",
    "probe points": "Points along the probe",
    "number format": "Number format, one flat beam",
}
SMALLEST = 1e-9  # an error below it is drawn there: a logarithm has no 0


def tradeoff_figure(trades: Sequence[Trade]) -> bytes:
    """Draw time (across) against error (up) of every method as a PNG; the reference of each panel stands at the bottom."""
    topics = [topic for topic in TOPICS if any(trade.topic == topic for trade in trades)]
    with canvas(11.5, 4.2 * ((len(topics) + 1) // 2)) as figure:
        for number, topic in enumerate(topics):
            axes = figure.add_subplot((len(topics) + 1) // 2, 2, number + 1)
            rows = [trade for trade in trades if trade.topic == topic]
            errors = [trade.error for trade in rows if trade.error]
            floor = min(errors) / 5 if errors else SMALLEST
            for index, trade in enumerate(rows):
                height = max(trade.error, floor) if trade.error is not None else floor
                marker = "o" if trade.error is not None else "*"
                axes.plot(
                    trade.time_s,
                    height,
                    marker=marker,
                    markersize=9,
                    color=LIDARS[index % len(LIDARS)],
                    linestyle="none",
                )
                axes.annotate(
                    trade.method + (" (star: reference)" if trade.error is None else ""),
                    (trade.time_s, height),
                    xytext=(8, 6 if index % 2 == 0 else -10),
                    textcoords="offset points",
                    fontsize=8.5,
                    color=INK,
                )
            noise = next((trade.standard_error for trade in rows if trade.standard_error), None)
            if noise:
                axes.axhline(noise, color=INK_SOFT, linestyle=":", linewidth=1)
                axes.annotate(
                    "standard error of the judge",
                    (0.98, noise),
                    xycoords=("axes fraction", "data"),
                    ha="right",
                    va="bottom",
                    fontsize=8,
                    color=INK_SOFT,
                )
            axes.set_xscale("log")
            axes.set_yscale("log")
            axes.margins(x=0.45, y=0.2)
            axes.set_xlabel("time [s]")
            axes.set_ylabel(f"distance from the reference [{rows[0].unit}]")
            axes.set_title(TITLES[topic], fontsize=10.5)
        return image(figure)
