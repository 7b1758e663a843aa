"""Where names go in a picture: near their places, off each other, joined by leader lines.

Pixels count from the left and from the bottom. A name is a box; boxes are placed one after the other, by
rank, each at the cheapest of a fixed set of offsets. The cost is the distance, plus what the box covers and
what its leader crosses.
"""

import numpy as np

from geometry.arrays import ArrayLike, BoolArray, FloatArray
from geometry.errors import InputError

RADII_PX = (16.0, 26.0, 40.0, 58.0, 80.0, 106.0, 136.0, 170.0, 210.0)
# in order of liking: up to the right and to the left first, straight down last
BEARINGS_DEG = (
    45.0,
    -45.0,
    20.0,
    -20.0,
    70.0,
    -70.0,
    90.0,
    -90.0,
    0.0,
    110.0,
    -110.0,
    135.0,
    -135.0,
    160.0,
    -160.0,
    180.0,
)
COST_NAME = 400.0  # of covering another name
COST_LEADER = 120.0  # of a leader line across another name or leader line
COST_POINT = 60.0  # of covering a named place, its own among them
COST_BUSY = 5.0  # of covering one sample of the drawing


def place_names(
    anchors_px: ArrayLike,
    sizes_px: ArrayLike,
    bounds_px: tuple[float, float, float, float],
    *,
    ranks: ArrayLike | None = None,
    busy_px: ArrayLike | None = None,
) -> FloatArray:
    """Find the middles (n, 2) of name boxes [px].

    Parameters
    ----------
    anchors_px
        (n, 2) Places that are named [px].
    sizes_px
        (n, 2) Width and height of each box [px].
    bounds_px
        Left, bottom, right, top of the room that names may use [px].
    ranks
        (n,) Lower is placed earlier; default all alike.
    busy_px
        (m, 2) Samples of what is drawn and had better not be covered [px].

    Raises
    ------
    InputError
        If the arrays do not fit each other.

    Examples
    --------
    >>> place_names([[100, 100]], [[40, 20]], (0, 0, 400, 400)).round(0)
    array([[100., 126.]])
    """
    anchors, sizes = (
        np.reshape(anchors_px, (-1, 2)).astype(float),
        np.reshape(sizes_px, (-1, 2)).astype(float),
    )
    if anchors.shape != sizes.shape:
        raise InputError(
            f"{len(anchors)} places and {len(sizes)} box sizes came; give one size for each place"
        )
    busy = np.zeros((0, 2)) if busy_px is None else np.reshape(busy_px, (-1, 2)).astype(float)
    order = np.argsort(
        np.zeros(len(anchors)) if ranks is None else np.asarray(ranks, dtype=float), kind="stable"
    )
    middles = np.full_like(anchors, np.nan)
    for done, index in enumerate(order):
        others = order[:done]
        options = _options(anchors[index], sizes[index], bounds_px)
        cost = _distance_cost(options, anchors[index])
        cost += _covering_cost(options, sizes[index], anchors, busy)
        cost += _conflict_cost(
            options, sizes[index], anchors[index], middles[others], sizes[others], anchors[others]
        )
        middles[index] = options[int(np.argmin(cost))]
    return middles


def _options(anchor: FloatArray, size: FloatArray, bounds: tuple[float, float, float, float]) -> FloatArray:
    """(option, 2) middles of the box around its place, moved into the room where they stick out."""
    bearing = np.radians(np.array(BEARINGS_DEG))
    toward = np.stack([np.sin(bearing), np.cos(bearing)], axis=1)
    radius = np.array(RADII_PX)[:, None, None]
    middles = anchor + radius * toward + np.sign(toward.round(6)) * np.abs(toward) ** 0.5 * size / 2
    low = np.array(bounds[:2]) + size / 2
    high = np.maximum(np.array(bounds[2:]) - size / 2, low)
    return np.asarray(np.clip(middles.reshape(-1, 2), low, high), dtype=np.float64)


def _distance_cost(options: FloatArray, anchor: FloatArray) -> FloatArray:
    liking = np.tile(np.arange(len(BEARINGS_DEG)), len(RADII_PX))
    return np.asarray(np.linalg.norm(options - anchor, axis=1) + 0.5 * liking, dtype=np.float64)


def _inside(points: FloatArray, options: FloatArray, size: FloatArray, border: float) -> BoolArray:
    return np.asarray(
        np.all(np.abs(points[None] - options[:, None]) < size / 2 + border, axis=-1), dtype=np.bool_
    )


def _covering_cost(options: FloatArray, size: FloatArray, places: FloatArray, busy: FloatArray) -> FloatArray:
    over_places = _inside(places, options, size, 6.0).sum(axis=1)
    over_drawing = _inside(busy, options, size, 1.0).sum(axis=1)
    return np.asarray(COST_POINT * over_places + COST_BUSY * over_drawing, dtype=np.float64)


def _conflict_cost(
    options: FloatArray,
    size: FloatArray,
    anchor: FloatArray,
    middles: FloatArray,
    sizes: FloatArray,
    anchors: FloatArray,
) -> FloatArray:
    """Cost of lying on names that stand already, and of leader lines through names and each other."""
    apart = np.abs(middles[None] - options[:, None])
    overlap = np.all(apart < (sizes[None] + size) / 2 + 4.0, axis=-1).sum(axis=1)
    own = (
        anchor + np.linspace(0.0, 1.0, 9)[None, :, None] * (options - anchor)[:, None]
    )  # (option, sample, 2)
    through = np.all(np.abs(own[:, :, None] - middles) < sizes / 2 + 2.0, axis=-1).any(axis=1).sum(axis=1)
    theirs = (
        anchors + np.linspace(0.0, 1.0, 9)[:, None, None] * (middles - anchors)[None]
    )  # (sample, name, 2)
    under = (
        np.all(np.abs(theirs[None] - options[:, None, None]) < size / 2 + 2.0, axis=-1)
        .any(axis=1)
        .sum(axis=1)
    )
    crossed = _crossing_count(anchor, options, anchors, middles)
    return np.asarray(COST_NAME * overlap + COST_LEADER * (through + under + crossed), dtype=np.float64)


def _turn(a: FloatArray, b: FloatArray, c: FloatArray) -> FloatArray:
    cross = (b[..., 0] - a[..., 0]) * (c[..., 1] - a[..., 1]) - (b[..., 1] - a[..., 1]) * (
        c[..., 0] - a[..., 0]
    )
    return np.asarray(np.sign(cross), dtype=np.float64)


def _crossing_count(
    anchor: FloatArray, options: FloatArray, anchors: FloatArray, middles: FloatArray
) -> FloatArray:
    """(option,) number of leader lines that stand already and that each option's leader line would cross."""
    a, b = anchor[None, None], options[:, None]
    c, d = anchors[None], middles[None]
    crossed = (_turn(a, b, c) * _turn(a, b, d) < 0) & (_turn(c, d, a) * _turn(c, d, b) < 0)
    return np.asarray(crossed.sum(axis=1), dtype=np.float64)


def leader_end_px(anchor_px: ArrayLike, middle_px: ArrayLike, size_px: ArrayLike) -> FloatArray:
    """Give where a leader line from a place meets the edge of its box (2,) [px].

    Examples
    --------
    >>> leader_end_px([0, 0], [0, 50], [40, 20])
    array([ 0., 40.])
    """
    anchor, middle = np.asarray(anchor_px, dtype=np.float64), np.asarray(middle_px, dtype=np.float64)
    half = np.asarray(size_px, dtype=np.float64) / 2
    return np.asarray(np.clip(anchor, middle - half, middle + half), dtype=np.float64)
