"""Between the grid's points: places moved to where the error is least, and what keeps them from going further."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from geometry.arrays import BoolArray, FloatArray
from planner.placement.maps import CRITERIA, Look, look, single_variance, standing_m, table_of
from planner.placement.search import added_value, aggregated
from planner.placement.task import Task
from reconstruct.beam_table import BeamTable

SoftCost = Callable[[FloatArray], FloatArray]
"""Places (place, 2) easting, northing [m] -> (place,) cost in the criterion's unit."""

LEVELS = 3  # of ever finer grids around each place
FINER = 4.0
AROUND = np.stack(np.meshgrid(np.arange(-3, 4), np.arange(-3, 4)), axis=-1).reshape(-1, 2) / 3.0
SWEEPS = 2  # through the lidars of a set on each level
POLISH_STEPS = 20  # of Nelder and Mead's simplex, for each coordinate
WORTH = 1e-4  # a place is better if its error is smaller by this share
TOUCHED = {
    "m": 1.0,
    "deg": 0.05,
    "share": 0.002,
}  # less than this is left over: the constraint is met with nothing to spare
LOOK_AROUND = 16  # directions in which the constraint that binds is sought


@dataclass(frozen=True, eq=False)
class Improve:
    """What moving a lidar is judged by."""

    task: Task
    fixed: Sequence[BeamTable]
    spacing_m: float
    cost: SoftCost

    def values(self, others: Sequence[BeamTable], seen: Look) -> FloatArray:
        """(place,) value of each place with the others of its set, inf where it is not allowed."""
        task = self.task
        soft = self.cost(seen.positions_m[:, :2])
        if task.single:
            return aggregated(single_variance(task, seen), task.aggregate) + soft
        return soft + self.added([*self.fixed, *others], table_of(task, seen))

    def tables(self, places_m: FloatArray) -> list[BeamTable]:
        """What each of some lidars at places (lidar, 2) contributes."""
        if not len(places_m):
            return []
        table = table_of(self.task, look(self.task, standing_m(self.task, places_m)))
        return [table.take([number]) for number in range(table.candidates)]

    def value(self, places_m: FloatArray) -> float:
        """Value of one set of places (lidar, 2), soft costs included."""
        soft = float(self.cost(places_m).sum())
        if self.task.single:
            seen = look(self.task, standing_m(self.task, places_m))
            return soft + float(aggregated(single_variance(self.task, seen), self.task.aggregate)[0])
        *others, last = self.tables(places_m)
        return soft + float(self.added([*self.fixed, *others], last)[0])

    def added(self, others: Sequence[BeamTable], table: BeamTable) -> FloatArray:
        """(candidate,) value with each candidate of a table added to others, without soft costs."""
        opening = self.task.limits.least_opening_deg
        return added_value(others, table, least_opening_deg=opening, aggregate=self.task.aggregate)


def refined(improve: Improve, places_m: FloatArray, *, polish: bool = True) -> tuple[FloatArray, float]:
    """Move the places of a set to where its error is least nearby.

    On ever finer grids around each lidar in turn, then all together by Nelder and Mead's simplex
    (`scipy.optimize.minimize`).

    Parameters
    ----------
    improve
        What is minimised.
    places_m
        (lidar, 2) where to begin, allowed [m].
    polish
        Whether to end with the simplex.

    Returns
    -------
    tuple
        Places (lidar, 2) and their value, never worse than where it began.
    """
    places, now, step = places_m.copy(), improve.value(places_m), improve.spacing_m
    for _ in range(LEVELS):
        for _ in range(SWEEPS):
            before = now
            for number in range(len(places)):
                places, now = _moved(improve, places, number, step, now)
            if not now < before * (1.0 - WORTH):
                break
        step /= FINER
    return _polished(improve, places, now, step * FINER) if polish else (places, now)


def _moved(
    improve: Improve, places: FloatArray, number: int, step_m: float, now: float
) -> tuple[FloatArray, float]:
    """One lidar moved to the best of the places around it, if that is better."""
    rest = np.delete(places, number, axis=0)
    around = places[number] + step_m * AROUND
    others = [] if improve.task.single else improve.tables(rest)
    values = (
        improve.values(others, look(improve.task, standing_m(improve.task, around)))
        + improve.cost(rest).sum()
    )
    best = int(np.argmin(values))
    if not values[best] < now:
        return places, now
    out = places.copy()
    out[number] = around[best]
    return out, float(values[best])


def _polished(improve: Improve, places: FloatArray, now: float, step_m: float) -> tuple[FloatArray, float]:
    from scipy.optimize import minimize

    def value(flat: FloatArray) -> float:
        return improve.value(flat.reshape(places.shape))

    start = places.ravel()
    simplex = np.vstack([start, start + step_m * np.eye(start.size)])
    found = minimize(
        value,
        start,
        method="Nelder-Mead",
        options={
            "initial_simplex": simplex,
            "maxfev": POLISH_STEPS * start.size,
            "xatol": 0.1,
            "fatol": 1e-7,
        },
    )
    return (found.x.reshape(places.shape), float(found.fun)) if found.fun < now else (places, now)


def binding(improve: Improve, places_m: FloatArray, value: float) -> tuple[str, ...]:
    """The constraints that keep a set from a smaller error: those that are broken where it would be smaller nearby.

    Returns
    -------
    tuple of str
        Names in `maps.CRITERIA`, that with most to gain first; empty where the error is least without any constraint.
    """
    gain: dict[str, float] = {}
    angles = np.arange(LOOK_AROUND) * (2.0 * np.pi / LOOK_AROUND)
    ring = np.stack([np.sin(angles), np.cos(angles)], axis=-1)
    for number, place in enumerate(places_m):
        rest = np.delete(places_m, number, axis=0)
        around = np.concatenate([place + 0.25 * improve.spacing_m * ring, place + improve.spacing_m * ring])
        seen = look(improve.task, standing_m(improve.task, around))
        free, broken = _unconstrained(improve, rest, seen)
        better = 1.0 - (free + improve.cost(rest).sum()) / value
        for name, out in broken.items():
            most = float(np.max(better[out], initial=0.0))
            if most > WORTH:
                gain[name] = max(gain.get(name, 0.0), most)
    here = look(improve.task, standing_m(improve.task, places_m))
    for name, values in here.slack.items():
        if float(np.nanmin(values)) < TOUCHED[CRITERIA[name][0]]:
            gain.setdefault(name, 0.0)
    return tuple(sorted(gain, key=lambda name: (-gain[name], list(CRITERIA).index(name))))


def _unconstrained(improve: Improve, rest: FloatArray, seen: Look) -> tuple[FloatArray, dict[str, BoolArray]]:
    """(place,) value as if everything were allowed, and which places break which constraint."""
    task = improve.task
    broken = {name: ~np.all(values >= 0.0, axis=0) for name, values in seen.slack.items()}
    known = Look(**{**vars(seen), "slack": {"none": np.zeros_like(seen.range_m)}})
    if task.single:
        return improve.values([], known), broken
    others, table = [*improve.fixed, *improve.tables(rest)], table_of(task, known)
    free = added_value(others, table, least_opening_deg=0.0, aggregate=task.aggregate)
    crossing = improve.added(others, table)
    return free + improve.cost(seen.positions_m[:, :2]), {
        **broken,
        "opening": np.isinf(crossing) & np.isfinite(free),
    }
