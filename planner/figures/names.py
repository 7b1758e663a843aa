"""Names in figures: untrusted text that is drawn as it stands, placed so that none covers another."""

from collections.abc import Sequence
from functools import lru_cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from geometry.arrays import FloatArray
from planner.palette import INK_SOFT, PAPER
from planner.scene.placement import leader_end_px, place_names

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.text import Text

LONGEST = 32  # characters of a name in a figure; the tables have it whole
NO_GLYPH = "□"  # where the font has no such letter
PAD_PX = 5.0
BORDER_PX = 6.0
LEADER_PX = 14.0  # a name nearer than this to its place needs no line to it


class Name(NamedTuple):
    """A name at a place."""

    text: str
    at: FloatArray  # (2,) in the axes' data
    colour: str
    rank: int = 1  # lower is placed first, nearest to its place
    size: float = 9.0
    bold: bool = True


def shown(text: str, *, longest: int = LONGEST) -> str:
    """Make a name fit for a figure: not too long, without letters that its font lacks.

    Dollar signs stay: draw it with `parse_math=False`.

    Examples
    --------
    >>> shown("Košava $x$"), shown("a" * 40, longest=8), shown("風 1")
    ('Košava $x$', 'aaaaaaa…', '□ 1')
    """
    short = text if len(text) <= longest else text[: longest - 1].rstrip() + "…"
    known = _letters()
    return "".join(letter if ord(letter) in known else NO_GLYPH for letter in short)


@lru_cache(maxsize=1)
def _letters() -> frozenset[int]:
    from matplotlib.font_manager import findfont, get_font

    return frozenset(get_font(findfont("DejaVu Sans")).get_charmap())


def draw_names(axes: "Axes", names: Sequence[Name], busy: FloatArray) -> "list[Text]":
    """Write names near their places, off each other and off what is drawn, joined by leader lines.

    The axes must have their final limits: the layout is made once to learn where everything is.

    Parameters
    ----------
    axes
        Where to write.
    names
        What to write.
    busy
        (n, 2) Samples of what had better not be covered, in the axes' data.

    Returns
    -------
    list of Text
        One for each name, in their order.
    """
    if not names:
        return []
    axes.figure.canvas.figure.draw_without_rendering()
    to_px = axes.transData.transform
    texts = [
        axes.text(
            0,
            0,
            name.text,
            fontsize=name.size,
            color=name.colour,
            fontweight="bold" if name.bold else "normal",
            ha="center",
            va="center",
            zorder=10,
            parse_math=False,
            in_layout=False,
            bbox={"boxstyle": "round,pad=0.15", "facecolor": PAPER, "edgecolor": "none", "alpha": 0.8},
        )
        for name in names
    ]
    boxes = [text.get_window_extent() for text in texts]
    sizes = np.array([(box.width + PAD_PX, box.height + PAD_PX) for box in boxes])
    anchors = to_px(np.array([name.at for name in names]))
    frame = axes.get_window_extent()
    bounds = (frame.x0 + BORDER_PX, frame.y0 + BORDER_PX, frame.x1 - BORDER_PX, frame.y1 - BORDER_PX)
    middles = place_names(anchors, sizes, bounds, ranks=[name.rank for name in names], busy_px=to_px(busy))
    back = axes.transData.inverted().transform
    for text, anchor, middle, size in zip(texts, anchors, middles, sizes, strict=True):
        text.set_position(tuple(back(middle)))
        end = leader_end_px(anchor, middle, size)
        if np.linalg.norm(end - anchor) > LEADER_PX:
            line = back(np.stack([anchor, end]))
            axes.plot(line[:, 0], line[:, 1], color=INK_SOFT, linewidth=0.7, zorder=8)
    return texts
