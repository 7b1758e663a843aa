"""Times of rays that do not run forward: a damaged stamp is told from a clock that was set back."""

from bisect import bisect_right
from typing import NamedTuple

import numpy as np

from geometry.arrays import BoolArray, IntArray
from reconstruct.losses import Loss
from reconstruct.records import TimeArray

#: This many rays in a row or more that run against the others are no damaged stamps: the clock was set back,
#: or parts of a file changed places.
SET_BACK = 4


class TimeOrder(NamedTuple):
    """How to bring rays into the order of time."""

    order: IntArray  # rays that stay, in the order of time
    losses: list[Loss]  # rays whose stamp cannot be right
    notes: list[str]


def time_order(time_utc: TimeArray, where: str, lines: IntArray | None = None) -> TimeOrder:
    """Rays in the order of time, without those whose stamp stands alone against its neighbours.

    The rays that stay where they are form the longest series that runs forward; a few in a row outside of it
    have a damaged stamp and are lost, many in a row are only sorted.

    Parameters
    ----------
    time_utc : numpy.ndarray
        (ray,) in the order of the file; NaT is lost.
    where : str
        Name of the file.
    lines : numpy.ndarray, optional
        (ray,) line of each ray.

    Examples
    --------
    >>> time = np.array([10, 11, 99, 12, 13, 3, 14, 15], dtype="datetime64[s]").astype("datetime64[ns]")
    >>> found = time_order(time, "a.hpl")
    >>> found.order
    array([0, 1, 3, 4, 6, 7])
    >>> print(found.losses[0])
    a.hpl: a time that does not run on from the ray before to the next (2 times)
    """
    known = ~np.isnat(time_utc)
    lost = ~known
    notes: list[str] = []
    losses = _losses(lost, "a ray without a time", where, lines)
    stamps = time_utc.astype("int64")
    if np.any(np.diff(stamps[known]) < 0):
        places = np.flatnonzero(known)
        against = ~forward(stamps[known])
        alone = _in_short_runs(against)
        damaged = np.zeros(len(time_utc), dtype=bool)
        damaged[places[alone]] = True
        what = "a time that does not run on from the ray before to the next"
        losses += _losses(damaged, what, where, lines)
        lost |= damaged
        turned = int(np.sum(against & ~alone))
        if turned:
            notes.append(f"times run backwards within a file: {turned} rays sorted into their place")
    stay = np.flatnonzero(~lost)
    return TimeOrder(stay[np.argsort(stamps[stay], kind="stable")], losses, notes)


def forward(stamps: IntArray) -> BoolArray:
    """(ray,) whether a ray belongs to the longest series that does not run backwards (patience sorting).

    Examples
    --------
    >>> forward(np.array([1, 2, 9, 3, 3, 4]))
    array([ True,  True, False,  True,  True,  True])
    """
    if not np.any(np.diff(stamps) < 0):
        return np.ones(len(stamps), dtype=bool)
    ends: list[int] = []  # smallest stamp that a series of each length ends with
    last: list[int] = []  # ray it belongs to
    before = np.full(len(stamps), -1, dtype=np.intp)
    for ray, stamp in enumerate(stamps.tolist()):
        length = bisect_right(ends, stamp)
        before[ray] = last[length - 1] if length else -1
        ends[length : length + 1] = [stamp]
        last[length : length + 1] = [ray]
    kept = np.zeros(len(stamps), dtype=bool)
    ray = last[-1]
    while ray >= 0:
        kept[ray] = True
        ray = int(before[ray])
    return kept


def _in_short_runs(marked: BoolArray) -> BoolArray:
    """(ray,) marked and in a run of fewer than SET_BACK."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], marked, [False]]).astype(np.int8)))
    out = np.zeros(len(marked), dtype=bool)
    for first, end in zip(edges[::2], edges[1::2], strict=True):
        out[first:end] = end - first < SET_BACK
    return out


def _losses(lost: BoolArray, what: str, where: str, lines: IntArray | None) -> list[Loss]:
    if not lost.any():
        return []
    first = int(np.flatnonzero(lost)[0])
    return [Loss(where, what, None if lines is None else int(lines[first]), int(lost.sum()))]
