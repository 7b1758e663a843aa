"""Which hard targets to measure: the few that fix the head's angles best, and what each would leave unsure."""

from collections.abc import Sequence
from itertools import combinations
from typing import NamedTuple

import numpy as np

from geometry.arrays import FloatArray
from geometry.beams import beam_to
from geometry.errors import InputError
from geometry.head import Mounting
from reconstruct.sightings import ANGLES, Angle, Sighting, predicted_std_deg, solvable, undetermined

MAX_CANDIDATES = 12  # 220 sets of three
SECTOR_DEG = 360.0 / MAX_CANDIDATES


class Choice(NamedTuple):
    """A set of targets and what it would give."""

    names: tuple[str, ...]
    std_deg: tuple[float, ...]  # of each angle; infinite where the targets tell nothing
    solved: tuple[Angle, ...]
    undetermined: tuple[Angle, ...]  # angles too weakly determined to be worth writing down
    solvable: tuple[Angle, ...]  # those they do determine where the others are taken as they are
    solvable_std_deg: tuple[float, ...]  # of each of these then
    compared: int  # candidates of which every set was tried
    candidates: int  # that there were


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
        Candidates with the head angles and uncertainties that are expected. Of more than twelve those are compared
        that are surest in their 30 degrees of bearing, then the next sure ones.
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
    candidates = _spread(sightings)
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
    fewer = solvable(chosen, start=start, solve=solve, head_std_m=head_std_m)
    fewer_stds = predicted_std_deg(chosen, start=start, solve=fewer, head_std_m=head_std_m) if fewer else ()
    return Choice(
        names=tuple(item.name for item in chosen),
        std_deg=tuple(float(value) for value in stds[best]),
        solved=solve,
        undetermined=undetermined(chosen, start=start, solve=solve, head_std_m=head_std_m),
        solvable=fewer,
        solvable_std_deg=tuple(float(value) for value in fewer_stds),
        compared=len(candidates),
        candidates=len(sightings),
    )


def _spread(sightings: Sequence[Sighting]) -> list[Sighting]:
    """At most twelve candidates, in their order: the surest of each sector of bearing first."""
    if len(sightings) <= MAX_CANDIDATES:
        return list(sightings)
    order = sorted(range(len(sightings)), key=lambda number: _unsure_deg(sightings[number]))
    sectors = [int(float(beam_to(item.enu_m).azimuth_deg) // SECTOR_DEG) for item in sightings]
    first = {sectors[number]: number for number in reversed(order)}  # the surest comes last and stays
    rest = [number for number in order if number not in first.values()]
    kept = sorted([*first.values(), *rest][:MAX_CANDIDATES])
    return [sightings[number] for number in kept]


def _unsure_deg(item: Sighting) -> float:
    """How well a target tells a direction: its map and its place together; the better of both angles."""
    place_deg = float(np.rad2deg(item.position_std_m / np.linalg.norm(item.enu_m)))
    return float(np.hypot(np.nanmin([item.azimuth_std_deg, item.elevation_std_deg]), place_deg))


def _rank(std_deg: FloatArray) -> tuple[int, float, float]:
    """Fewest angles without any hold first, then the least worst, then the least of all together."""
    known = std_deg[np.isfinite(std_deg)]
    return int(std_deg.size - known.size), float(known.max(initial=0.0)), float((known**2).sum())
