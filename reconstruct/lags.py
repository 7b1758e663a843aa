"""Which lags between scans are worked out, so that a sum over all of them takes few.

Ten minutes hold hundreds of scans of a narrow sector, and one is hardly farther from the next than the air moves. What
two of them have in common changes smoothly with the lag once the air has passed the whole scan: from there on lags
stand ever farther apart, and cubic interpolation between them says for how many pairs of scans each of them counts.
"""

from typing import NamedTuple

import numpy as np

from geometry.arrays import FloatArray, IntArray

GROWTH = 0.1
"""Of the distance between two lags with that from the scan: the scatter of a ten-minute mean is right to 4e-4 for two
rays two degrees apart (tested), whose fit enlarges every jump between two rules of `patches`, and 5e-3 for two lidars
that meet at the target, where it is a hundredth of the wind's own.
"""


class Lags(NamedTuple):
    """Lags, the first of them 0, and for how many pairs of scans each of them counts."""

    steps: IntArray  # (lag,) number of scans
    pairs: FloatArray  # (pass, lag) pairs whose first scan runs in that pass


def select_lags(count: int, scans: int, passes: int, *, near: float, finest: float) -> Lags:
    """Choose some of the lags from 0 to count - 1.

    Parameters
    ----------
    count
        How many lags are correlated, at least 1.
    scans
        How many scans are averaged, at least as many.
    passes
        Different scans: those an even and an odd number of scans apart are two functions of the lag.
    near
        Time that the air needs to pass the whole scan, in periods.
    finest
        Time in which it moves by the smallest length over which a ray averages, in periods.

    Examples
    --------
    >>> few = select_lags(300, 600, 1, near=2.0, finest=1.0)
    >>> few.steps[:12], len(few.steps), float(few.pairs[:, 1:].sum()) == sum(600 - lag for lag in range(1, 300))
    (array([ 0,  1,  2,  3,  4,  5,  6,  7,  8,  9, 10, 11]), 54, True)
    """
    steps, pairs = [np.zeros(1, dtype=np.intp)], [pair_counts(np.arange(1), scans, passes)]
    for parity in range(passes):
        every = np.arange(parity or passes, count, passes)
        chosen = _spread(every, near, finest)
        steps.append(every[chosen])
        pairs.append(pair_counts(every, scans, passes) @ _cubic(len(every), chosen))
    return Lags(np.concatenate(steps), np.concatenate(pairs, axis=1))


def pair_counts(lags: IntArray, scans: int, passes: int) -> FloatArray:
    """(pass, lag) how many pairs of scans start in that pass and are that far apart."""
    starts = np.clip(scans - lags, 0, None)
    return np.stack([(starts + passes - 1 - odd) // passes for odd in range(passes)]).astype(float)


def _spread(every: IntArray, near: float, finest: float) -> IntArray:
    """Places of some lags among equally spaced ones: all near the scan, ever fewer beyond; the last one too."""
    places, at = [], 0.0
    step = every[1] - every[0] if len(every) > 1 else 1
    while at < len(every):
        places.append(int(at))
        away = max(finest, GROWTH * (every[int(at)] - near))
        at = int(at) + max(1.0, away // step)
    if len(every) and places[-1] != len(every) - 1:
        places.append(len(every) - 1)
    return np.array(places, dtype=np.intp)


def _cubic(count: int, chosen: IntArray) -> FloatArray:
    """(place, chosen) what each chosen place adds to a cubic through the four that are nearest to a place."""
    weights = np.zeros((count, len(chosen)))
    if count == len(chosen):
        return np.eye(count)
    order = min(4, len(chosen))
    place = np.arange(count)
    start = np.clip(np.searchsorted(chosen, place, side="right") - order // 2, 0, len(chosen) - order)
    around = start[:, None] + np.arange(order)  # (place, corner)
    for corner in range(order):
        at, others = chosen[around[:, corner]], np.delete(around, corner, axis=1)
        factors = (place[:, None] - chosen[others]) / (at[:, None] - chosen[others])
        weights[place, around[:, corner]] = np.prod(factors, axis=1)
    return weights
