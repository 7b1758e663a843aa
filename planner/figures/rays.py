"""Measured rays before and after a filter: radial speed against CNR, to choose limits by eye."""

import numpy as np

from geometry.arrays import FloatArray
from planner.figures.canvas import canvas, image
from planner.figures.names import shown
from planner.palette import EXCLUDED, LIDARS

MOST_POINTS = 50_000


def rays(
    before_mps: FloatArray, cnr_db: FloatArray, after_mps: FloatArray | None = None, *, title: str
) -> bytes:
    """Draw radial speed against CNR with both distributions, as PNG.

    Parameters
    ----------
    before_mps, cnr_db
        Of every ray, equal shapes; NaN where missing. Of more than 50,000 every so many is drawn.
    after_mps
        With NaN for what a filter took away, which is drawn in another colour.
    title
        Untrusted text.
    """
    known = np.isfinite(before_mps) & np.isfinite(cnr_db)
    kept = known if after_mps is None else known & np.isfinite(after_mps)
    step = max(int(np.count_nonzero(known)) // MOST_POINTS, 1)
    with canvas(7.0, 5.4) as figure:
        grid = figure.add_gridspec(2, 2, width_ratios=(5, 1), height_ratios=(1, 5), wspace=0.03, hspace=0.03)
        axes = figure.add_subplot(grid[1, 0])
        above, right = (
            figure.add_subplot(grid[0, 0], sharex=axes),
            figure.add_subplot(grid[1, 1], sharey=axes),
        )
        for chosen, colour, name in ((known & ~kept, EXCLUDED, "taken away"), (kept, LIDARS[0], "rays")):
            cnr, speed = cnr_db[chosen], before_mps[chosen]
            if not len(cnr):
                continue
            axes.plot(
                cnr[::step],
                speed[::step],
                ".",
                color=colour,
                markersize=2,
                alpha=0.5,
                label=f"{name}: {len(cnr)}",
            )
            above.hist(cnr, bins=80, color=colour, log=True, histtype="step")
            right.hist(speed, bins=80, color=colour, log=True, histtype="step", orientation="horizontal")
        axes.set(xlabel="CNR [dB]", ylabel="radial speed [m/s], positive away")
        axes.legend(loc="upper left", markerscale=4)
        above.tick_params(labelbottom=False)
        right.tick_params(labelleft=False)
        figure.suptitle(
            shown(title, longest=90), x=0.01, ha="left", fontsize=12, fontweight="bold", parse_math=False
        )
        return image(figure)
