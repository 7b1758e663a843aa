"""Speed against accuracy as a figure: one log-log panel a topic."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from planner.figures.canvas import canvas, image
from planner.palette import INK_SOFT, LIDARS
from planner.tradeoff import TOPICS, Trade

if TYPE_CHECKING:
    from matplotlib.axes import Axes

TITLES = {
    "geometry": "Earth model, one beam",
    "error tier": "Error tier, one scan's spread of speed",
    "probe points": "Points along the probe",
    "number format": "Number format, one flat beam",
}
SMALLEST = 1e-9  # an error below it is drawn there: a logarithm has no 0


MARKERS = "osD^vP"  # beside the colour, for who does not see it
LEAST_RATIO = 6.0  # of the ends of an axis of times, so that it has at least two round ones
MANY_RATIO = 60.0  # an axis longer than this has powers of ten only
ROOM = 1.4  # beyond the first and the last time
JUDGE = "standard error of the judge"


def tradeoff_figure(trades: Sequence[Trade]) -> bytes:
    """Draw time (across) against error (up) of every method as a PNG; the reference of each panel stands at the bottom."""
    topics = [topic for topic in TOPICS if any(trade.topic == topic for trade in trades)]
    with canvas(13.0, 3.6 * ((len(topics) + 1) // 2)) as figure:
        for number, topic in enumerate(topics):
            axes = figure.add_subplot((len(topics) + 1) // 2, 2, number + 1)
            _panel(axes, [trade for trade in trades if trade.topic == topic])
            axes.set_title(TITLES[topic], fontsize=10.5)
        return image(figure)


def _panel(axes: "Axes", rows: Sequence[Trade]) -> None:
    """One topic; the names stand in a legend beside the axes, where they cover neither points nor each other."""
    errors = [trade.error for trade in rows if trade.error]
    floor = min(errors) / 5 if errors else SMALLEST
    for index, trade in enumerate(rows):
        reference = trade.error is None
        axes.plot(
            trade.time_s,
            floor if trade.error is None else max(trade.error, floor),
            marker="*" if reference else MARKERS[index % len(MARKERS)],
            markersize=13 if reference else 8,
            color=LIDARS[index % len(LIDARS)],
            linestyle="none",
            label=trade.method + (" (reference: distance 0)" if reference else ""),
        )
    noise = next((trade.standard_error for trade in rows if trade.standard_error), None)
    if noise:
        axes.axhline(noise, color=INK_SOFT, linestyle=":", linewidth=1, label=JUDGE)
    axes.set_yscale("log")
    axes.margins(y=0.15)
    _times(axes, [trade.time_s for trade in rows])
    axes.set_ylabel(f"distance from the reference [{rows[0].unit}]")
    axes.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), borderaxespad=0.2)


def _times(axes: "Axes", times_s: Sequence[float]) -> None:
    """A logarithmic axis of times in ns, µs, ms or s, with few enough labels that they stay apart."""
    from matplotlib.ticker import EngFormatter, LogLocator, NullFormatter

    low, high = min(times_s) / ROOM, max(times_s) * ROOM
    widen = max(LEAST_RATIO / (high / low), 1.0) ** 0.5
    axes.set_xscale("log")
    axes.set_xlim(low / widen, high * widen)
    axes.xaxis.set_major_locator(LogLocator(subs=(1.0,) if high / low > MANY_RATIO else (1.0, 2.0, 5.0)))
    axes.xaxis.set_major_formatter(EngFormatter("s"))
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.set_xlabel("time")
