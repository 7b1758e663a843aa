"""Order and timing of step-stare tours: which point after which, so that one round takes the least time.

A tour is closed: after the last point the heads turn back to the first. All lidars of a tour leave one point
together and wait for the slowest at the next; each head turns about both axes at once. Times are whole
milliseconds, rounded up, as instruments' motion programs take them.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from geometry.angles import wrap_180_deg
from geometry.arrays import ArrayLike, IntArray
from geometry.errors import InputError
from geometry.head import HeadLimits, move_time_s

TimeArray = NDArray[np.int32]  # whole milliseconds: 2^31 of them are 24 days

# Rounding noise of a turning time: 1e-9 ms more than a whole millisecond is no reason to wait another one.
ROUNDING_MS = 1e-6

MAX_POINTS = 500  # the move matrices of all tours that are improved together: 5 · 500² · 4 B = 5 MB each

# Effort of the search: tours improved side by side, and rounds of kicks. On four sets of 88 random points 5
# and 35 came within 0.1 % of 8 and 60, in a third of the time.
TOURS = 5
ROUNDS = 35

# Longest piece of a tour that is moved elsewhere in one go: Or (1976) took 3.
LONGEST_PIECE = 3


class Tour(NamedTuple):
    """A closed tour and its timing, in the order in which the points are visited."""

    order: IntArray  # (point,) indices of the points; the first point of the list comes first
    lidar_ms: TimeArray  # (point, lidar) time each head needs from this point to the next
    move_ms: TimeArray  # (point,) time to the next point: that of the slowest head
    start_ms: TimeArray  # (point,) when the heads stand still at the point, since the start of the round
    dwell_ms: int  # how long they stay

    @property
    def cycle_ms(self) -> int:
        """Time of one round [ms]."""
        return int(self.move_ms.sum()) + self.dwell_ms * len(self.order)


def lidar_move_ms(azimuth_deg: ArrayLike, elevation_deg: ArrayLike, heads: Sequence[HeadLimits]) -> TimeArray:
    """Time that each head needs from every point to every other.

    Parameters
    ----------
    azimuth_deg, elevation_deg : array_like (lidar, point)
        Head angles of each lidar at each point [deg]. The azimuth turns the shorter way round.
    heads : sequence of HeadLimits (lidar,)
        Speed and acceleration of the axes.

    Returns
    -------
    TimeArray
        (lidar, point, point) [ms], rounded up; symmetric, 0 on the diagonal.

    Raises
    ------
    InputError
        If the shapes do not fit or an angle is not finite.

    Notes
    -----
    Both axes of a head turn together from rest to rest, `geometry.head.move_time_s`.

    Examples
    --------
    >>> heads = [HeadLimits(50, 50, 100, 100)]
    >>> lidar_move_ms([[0.0, 10.0, 350.0]], [[0.0, 0.0, 0.0]], heads)[0].tolist()
    [[0, 633, 633], [633, 0, 895], [633, 895, 0]]
    """
    azimuth, elevation = (np.asarray(each, dtype=np.float64) for each in (azimuth_deg, elevation_deg))
    if azimuth.shape != elevation.shape or azimuth.ndim != 2 or azimuth.shape[0] != len(heads):
        raise InputError(
            f"azimuths of shape {azimuth.shape}, elevations of shape {elevation.shape} and {len(heads)} "
            "heads came; allowed: (lidar, point) twice and one head for each lidar"
        )
    if not (np.all(np.isfinite(azimuth)) and np.all(np.isfinite(elevation))):
        raise InputError("a head angle of the tour is no finite number: check lidars and points")
    turns = wrap_180_deg(azimuth[:, :, None] - azimuth[:, None, :])
    rises = elevation[:, :, None] - elevation[:, None, :]
    seconds = [move_time_s(turn, rise, head) for turn, rise, head in zip(turns, rises, heads, strict=True)]
    return np.ceil(1000.0 * np.array(seconds) - ROUNDING_MS).clip(min=0.0).astype(np.int32)


def plan_tour(
    azimuth_deg: ArrayLike,
    elevation_deg: ArrayLike,
    heads: Sequence[HeadLimits],
    *,
    accumulation_s: float = 0.0,
) -> Tour:
    """Find the fastest closed tour through all points for one or several synchronised lidars.

    Parameters
    ----------
    azimuth_deg, elevation_deg : array_like (lidar, point)
        Head angles of each lidar at each point [deg].
    heads : sequence of HeadLimits (lidar,)
        Speed and acceleration of the axes.
    accumulation_s : float
        How long the beams stay at each point [s], rounded up to ms; 0 gives the time of motion alone.

    Returns
    -------
    Tour
        Order, timing and cycle time. The order is found by `shortest_order`: no proof that it is the best.

    Raises
    ------
    InputError
        As `lidar_move_ms` and `shortest_order`, and if the accumulation is negative.

    Examples
    --------
    >>> heads = [HeadLimits(50, 50, 100, 100)]
    >>> tour = plan_tour([[0.0, 20.0, 10.0, 30.0]], [[0.0, 0.0, 0.0, 0.0]], heads, accumulation_s=0.1)
    >>> tour.order.tolist(), tour.move_ms.tolist(), tour.cycle_ms
    ([0, 2, 1, 3], [633, 633, 633, 1100], 3399)
    """
    if not (np.isfinite(accumulation_s) and accumulation_s >= 0):
        raise InputError(f"accumulation_s of the tour is {accumulation_s}: give 0 or a positive number")
    each_ms = lidar_move_ms(azimuth_deg, elevation_deg, heads)
    return timed(shortest_order(each_ms.max(axis=0)), each_ms, accumulation_s=accumulation_s)


def timed(order: ArrayLike, each_ms: TimeArray, *, accumulation_s: float = 0.0) -> Tour:
    """Time a tour in a given order.

    Parameters
    ----------
    order : array_like (point,)
        Indices of the points.
    each_ms : TimeArray (lidar, point, point)
        What `lidar_move_ms` gave.
    accumulation_s : float
        How long the beams stay at each point [s].
    """
    here = np.asarray(order, dtype=np.intp)
    lidar_ms = each_ms[:, here, np.roll(here, -1)].T
    move_ms = lidar_ms.max(axis=1)
    dwell_ms = int(np.ceil(1000.0 * accumulation_s - ROUNDING_MS))
    start_ms = np.concatenate([[0], np.cumsum(move_ms + dwell_ms)[:-1]])
    return Tour(here, lidar_ms, move_ms, start_ms, dwell_ms)


def shortest_order(move_ms: ArrayLike, *, seed: int = 0) -> IntArray:
    """Order the points so that the closed tour takes the least time, by local search from several starts.

    Parameters
    ----------
    move_ms : array_like (point, point)
        Time from each point to each other, symmetric [ms].
    seed : int
        Of the kicks: the same matrix and seed give the same tour.

    Returns
    -------
    IntArray
        (point,) indices, 0 first; the second point is the smaller-numbered neighbour of the first.

    Raises
    ------
    InputError
        If there is no point, more than 500, or the matrix is not square and symmetric.

    Notes
    -----
    Nearest-neighbour tours from every point; the best of them are improved side by side by the best of all
    2-opt and Or-opt moves (a piece of up to 3 points put elsewhere, either way round) until none helps, then
    kicked (two pieces exchanged) and improved again. 2-opt: Croes (1958), doi:10.1287/opre.6.6.791; Or-opt:
    Or (1976), PhD thesis, Northwestern University; kick: Martin, Otto and Felten (1991), Complex Systems 5,
    299.

    Examples
    --------
    >>> shortest_order([[0, 9, 1, 1], [9, 0, 1, 1], [1, 1, 0, 9], [1, 1, 9, 0]]).tolist()
    [0, 2, 1, 3]
    """
    move = np.asarray(move_ms, dtype=np.int32)
    if move.ndim != 2 or move.shape[0] != move.shape[1] or not np.array_equal(move, move.T):
        raise InputError(f"moving times of shape {move.shape} came; allowed: a square, symmetric matrix")
    count = len(move)
    if not 1 <= count <= MAX_POINTS:
        raise InputError(
            f"a tour of {count} points came; allowed: 1 to {MAX_POINTS}. Cover them by fewer "
            "measurement points first"
        )
    if count <= 3:  # every order is the same closed tour
        return np.arange(count)
    tours = _improved(_nearest_neighbour_tours(move), move)
    return _from_first(_kicked(tours, move, np.random.default_rng(seed)))


def _nearest_neighbour_tours(move: TimeArray) -> IntArray:
    """The best of the tours that go from each point to the nearest one left: (tour, point)."""
    count = len(move)
    rows = np.arange(count)
    tours = np.empty((count, count), dtype=np.intp)
    seen = np.zeros((count, count), dtype=bool)
    tours[:, 0] = rows
    for step in range(1, count):
        seen[rows, tours[:, step - 1]] = True
        left = np.where(seen, np.iinfo(np.int32).max, move[tours[:, step - 1]])
        tours[:, step] = left.argmin(axis=1)
    best = np.argsort(_lengths(tours, move), kind="stable")[:TOURS]
    return np.asarray(tours[best])


def _lengths(tours: IntArray, move: TimeArray) -> TimeArray:
    return np.asarray(move[tours, np.roll(tours, -1, axis=1)].sum(axis=1))


def _kicked(tours: IntArray, move: TimeArray, rng: np.random.Generator) -> IntArray:
    """The best tour (point,) that kicks and renewed improvement find."""
    lengths = _lengths(tours, move)
    for _ in range(ROUNDS):
        tried = _improved(np.array([_double_bridge(tour, rng) for tour in tours]), move)
        tried_lengths = _lengths(tried, move)
        better = tried_lengths <= lengths
        tours = np.where(better[:, None], tried, tours)
        lengths = np.minimum(lengths, tried_lengths)
    return np.asarray(tours[lengths.argmin()])


def _double_bridge(tour: IntArray, rng: np.random.Generator) -> IntArray:
    """Exchange two neighbouring pieces of a tour: four moves change, none is turned round."""
    first, second, third = np.sort(rng.choice(np.arange(1, len(tour)), size=3, replace=False))
    return np.concatenate([tour[:first], tour[second:third], tour[first:second], tour[third:]])


def _improved(tours: IntArray, move: TimeArray) -> IntArray:
    """Tours (tour, point) after the best 2-opt and Or-opt moves, until none of them helps."""
    tours, working = tours.copy(), np.arange(len(tours))
    while working.size:
        here = tours[working]
        between = move[here[:, :, None], here[:, None, :]]  # (tour, position, position)
        gain, places = _best_two_opt(between)
        piece_gain, pieces = _best_piece(between)
        better = piece_gain < gain
        places = np.where(better[:, None], pieces, places)
        helped = np.minimum(gain, piece_gain) < 0
        working = working[helped]
        tours[working] = np.take_along_axis(here, places, axis=1)[helped]
    return tours


def _best_two_opt(between: TimeArray) -> tuple[TimeArray, IntArray]:
    """Least change [ms] (tour,) by turning a stretch of each tour round, and the positions that do it."""
    count = between.shape[1]
    ahead = np.roll(between, -1, axis=2).diagonal(axis1=1, axis2=2)  # (tour, position) time to the next
    change = between + np.roll(between, (-1, -1), (1, 2)) - ahead[:, :, None] - ahead[:, None, :]
    change[:, np.arange(count), np.arange(count)] = 0  # a stretch needs two ends
    best = change.reshape(len(change), -1).argmin(axis=1)
    low, high = np.sort(np.stack(np.unravel_index(best, (count, count))), axis=0)[:, :, None]
    position = np.arange(count)
    turned = np.where((position > low) & (position <= high), low + 1 + high - position, position)
    return change.reshape(len(change), -1)[np.arange(len(change)), best], turned


def _best_piece(between: TimeArray) -> tuple[TimeArray, IntArray]:
    """Least change [ms] (tour,) by putting a short piece elsewhere, and the positions that do it."""
    count = between.shape[1]
    tours = np.arange(len(between))
    ahead = np.roll(between, -1, axis=2).diagonal(axis1=1, axis2=2)
    least = np.zeros(len(between), dtype=np.int32)
    places = np.tile(np.arange(count), (len(between), 1))
    for length in range(1, min(LONGEST_PIECE, count - 2) + 1):
        for turned in (False, True) if length > 1 else (False,):
            change = _piece_changes(between, ahead, length, turned)
            best = change.reshape(len(change), -1).argmin(axis=1)
            value = change.reshape(len(change), -1)[tours, best]
            start, gap = np.unravel_index(best, (count, count))
            better = value < least
            least = np.minimum(value, least)
            places[better] = _moved(start[better], gap[better], length, turned, count)
    return least, places


def _piece_changes(between: TimeArray, ahead: TimeArray, length: int, turned: bool) -> TimeArray:
    """Change [ms] (tour, start, gap) by taking the piece at `start` out and putting it behind `gap`."""
    count = between.shape[1]
    start = np.arange(count)
    before, last, after = start - 1, (start + length - 1) % count, (start + length) % count
    closed = between[:, before, after] - ahead[:, before] - ahead[:, last]  # (tour, start)
    head, tail = (last, start) if turned else (start, last)
    into = between[:, head, :] + np.roll(between[:, tail, :], -1, axis=2)
    change = closed[:, :, None] + into - ahead[:, None, :]
    inside = (start[None, :] - start[:, None] + 1) % count <= length  # gaps that touch the piece
    return np.asarray(np.where(inside, 0, change))


def _moved(start: IntArray, gap: IntArray, length: int, turned: bool, count: int) -> IntArray:
    """Positions (tour, point) of tours whose piece at `start` goes behind `gap`, counted from the piece."""
    from_piece = np.arange(count)
    stay = (gap - start) % count - length + 1  # how many points lie between the piece and its new place
    piece = np.arange(length)[::-1] if turned else np.arange(length)
    rest = from_piece[None, :] - np.where(from_piece[None, :] < stay[:, None], -length, 0)
    behind = (from_piece[None, :] >= stay[:, None]) & (from_piece[None, :] < stay[:, None] + length)
    inside = piece[np.clip(from_piece[None, :] - stay[:, None], 0, length - 1)]
    return np.asarray((np.where(behind, inside, rest) + start[:, None]) % count)


def _from_first(tour: IntArray) -> IntArray:
    """The same closed tour from point 0, towards its smaller-numbered neighbour."""
    forth = np.roll(tour, -int(np.flatnonzero(tour == 0)[0]))
    return forth if forth[1] < forth[-1] else np.roll(forth[::-1], 1)
