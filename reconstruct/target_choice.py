"""Which hard targets to measure: the few that fix the head's angles best, and what each would leave unsure."""

from collections.abc import Sequence
from itertools import combinations
from typing import NamedTuple

import numpy as np

from geometry.arrays import FloatArray
from geometry.errors import InputError
from geometry.head import Mounting
from reconstruct.sightings import ANGLES, Angle, Sighting, predicted_std_deg, undetermined

MAX_CANDIDATES = 12  # 220 sets of three


class Choice(NamedTuple):
    """A set of targets and what it would give."""

    names: tuple[str, ...]
    std_deg: tuple[float, ...]  # of each angle; infinite where the targets tell nothing
    solved: tuple[Angle, ...]
    undetermined: tuple[Angle, ...]  # angles too weakly determined to be worth writing down

    @property
    def worst_deg(self) -> float:
        """Standard deviation of the least known angle [deg]."""
        return max(self.std_deg)


def best_targets(
    sightings: Sequence[Sighting],
    *,
    count: int = 3,
    start: Mounting | None = None,
    solve: tuple[Angle, ...] = ANGLES,
    head_std_m: float = 0.0,
) -> Choice:
    """Choose the targets whose bearings and ranges fix the head best: the least worst standard deviation.

    Parameters
    ----------
    sightings : sequence of Sighting
        Candidates with the head angles and uncertainties that are expected; the first twelve are looked at.
    count : int
        How many to choose; fewer candidates are all taken.
    start, solve, head_std_m
        As in `mounting_fit.fit_mounting`.

    Returns
    -------
    Choice

    Raises
    ------
    InputError
        If there is no candidate or the count is not positive.

    Notes
    -----
    Every set of that size is tried; the standard deviations are those of `fit_mounting` to first order, known
    before anything is measured.

    Examples
    --------
    >>> from geometry.beams import unit_vector
    >>> def at(name, azimuth_deg, range_m):
    ...     there = range_m * unit_vector(azimuth_deg, 3.0)
    ...     return Sighting(name, there, azimuth_deg, 3.0, range_m, .003, .003, .1, .2)
    >>> near = [at("a", 0.0, 900.0), at("b", 60.0, 900.0), at("c", 120.0, 900.0), at("d", 240.0, 900.0)]
    >>> best_targets(near).names
    ('a', 'c', 'd')
    """
    candidates = list(sightings)[:MAX_CANDIDATES]
    if not candidates or count < 1:
        raise InputError(
            f"{count} of {len(candidates)} hard targets are to be chosen; allowed: 1 or more of 1 or more"
        )
    sets = list(combinations(range(len(candidates)), min(count, len(candidates))))
    stds = [
        predicted_std_deg(
            [candidates[place] for place in chosen], start=start, solve=solve, head_std_m=head_std_m
        )
        for chosen in sets
    ]
    best = min(range(len(sets)), key=lambda number: _rank(stds[number]))
    chosen = [candidates[place] for place in sets[best]]
    return Choice(
        names=tuple(item.name for item in chosen),
        std_deg=tuple(float(value) for value in stds[best]),
        solved=solve,
        undetermined=undetermined(chosen, start=start, solve=solve, head_std_m=head_std_m),
    )


def _rank(std_deg: FloatArray) -> tuple[int, float, float]:
    """Fewest angles without any hold first, then the least worst, then the least of all together."""
    known = std_deg[np.isfinite(std_deg)]
    return int(std_deg.size - known.size), float(known.max(initial=0.0)), float((known**2).sum())
