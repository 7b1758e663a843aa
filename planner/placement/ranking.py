"""From a task to ranked places: the grid, the search, the refinement, the numbers that are shown, and why."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal, NamedTuple

import numpy as np

from geometry.arrays import FloatArray, IntArray
from geometry.errors import InputError
from planner.placement import search
from planner.placement.fan_out import How, require_scheduler
from planner.placement.infeasible import refusal
from planner.placement.maps import (
    CRITERIA,
    Grid,
    Look,
    look,
    of_lidar,
    standing_m,
    table_of,
)
from planner.placement.numbers import Numbers, Turbulent, numbers_of, turbulent_numbers
from planner.placement.refine import WORTH, Improve, SoftCost, binding, refined
from planner.placement.steer import steered
from planner.placement.task import Task, default_limits
from planner.site import Lidar
from reconstruct.beam_table import BeamTable

PHYSICAL = ("range-min", "range-max", "terrain")
APART_CELLS = 4.0  # two places this many cells of the grid apart are different ones
Tier = Literal["linear", "turbulent"]
WHAT = {"vector": "wind vector", "speed": "wind speed", "direction": "wind direction"}
UNIT = {"vector": "m/s", "speed": "m/s", "direction": "°"}
MOST = 5  # distinct optima
JUDGED = 12  # distinct optima of the linear tier that the turbulent tier judges
STARTS = 12  # beginnings of sets of more than two


class Ranked(NamedTuple):
    """One set of places for the lidars that are placed."""

    rank: int  # from 1; 0 for the declared places
    positions_m: FloatArray  # (lidar, 3) easting, northing, height of the head
    value: float  # what was minimised, in the criterion's unit, soft cost included
    numbers: Numbers
    turbulent: Turbulent | None  # where the search was by the turbulent tier
    binds: tuple[
        str, ...
    ]  # constraints that keep it from being better; of the declared places: that they break
    text: str


@dataclass(frozen=True, eq=False)
class Placement:
    """What a search found."""

    task: Task
    grid: Grid
    seen: Look  # of every candidate
    error: FloatArray  # (candidate,) best error that a lidar there can be part of, inf where none
    ranked: tuple[Ranked, ...]
    declared: Ranked | None  # where the site has the lidars now; None where it has none to compare
    why: str  # the best against the declared


def place(
    task: Task,
    grid: Grid,
    *,
    how: How | None = None,
    cost: SoftCost | None = None,
    most: int = MOST,
    tier: Tier = "linear",
) -> Placement:
    """Find the best places.

    Parameters
    ----------
    task
        What is placed, for which targets.
    grid
        Candidates to begin with; the best are refined between them.
    how
        Where the work is done, and who hears of its progress.
    cost
        Soft cost of a place in the criterion's unit, such as the distance to a road times what a metre is worth.
    most
        How many distinct optima.
    tier
        "turbulent": the best of the linear tier are judged by the error with turbulence, moved to where that is least and
        ranked by it. The map of the error stays that of the linear tier.

    Returns
    -------
    Placement
        Ranked, best first.

    Raises
    ------
    InputError
        If no place keeps to every constraint: with the constraint that leaves none, and how much it must give; or if a
        target lies outside the terrain.
    UnavailableError
        If a scheduler is named and does not answer, even where the work is too little to need it.
    """
    if how is not None and how.scheduler is not None:
        require_scheduler(how.scheduler)
    seen = look(task, standing_m(task, grid.places_m))
    improve = Improve(task, fixed_tables(task), grid.spacing_m, cost or _free)
    error, sets = _searched(improve, seen, how, most if tier == "linear" else JUDGED)
    if not len(sets.members):
        raise InputError(refusal(task, seen, improve.fixed))
    found = [refined(improve, seen.positions_m[members, :2]) for members in sets.members]
    near_m = APART_CELLS / 2 * grid.spacing_m
    apart = _apart(found, near_m)
    if tier == "turbulent":
        moved = steered(improve, [places for places, _ in apart], most=most, how=how)
        apart = _apart(moved, near_m)
    ranked = _in_order([_ranked(improve, places, value, tier) for places, value in apart])
    declared = _declared(improve, tier)
    return Placement(task, grid, seen, error, ranked, declared, _why(task, ranked[0], declared))


def fixed_tables(task: Task) -> list[BeamTable]:
    """What the lidars that stand contribute, one candidate each.

    They are where they are: of the constraints only those count for them that leave no signal at all.
    """
    out = []
    for lidar in task.fixed:
        seen = _standing(task, lidar)
        physical = replace(seen, slack={name: seen.slack[name] for name in PHYSICAL})
        out.append(table_of(task, physical, lidar=lidar))
    return out


def _standing(task: Task, lidar: Lidar) -> Look:
    """The criteria of a lidar where it stands, by its own instrument's range and not by what is asked of the others."""
    seen = of_lidar(task, lidar)
    own = default_limits(lidar, task.scan_of(lidar))
    ranges = {"range-min": seen.range_m - own.least_range_m, "range-max": own.most_range_m - seen.range_m}
    return replace(seen, slack={**seen.slack, **ranges})


def standing_remarks(task: Task) -> tuple[str, ...]:
    """What the lidars that stand break, in words."""
    remarks = []
    for lidar in task.fixed:
        for name, slack in _standing(task, lidar).slack.items():
            out = [target for target, values in zip(task.targets, slack, strict=True) if not values[0] >= 0.0]
            if out:
                remarks.append(f"{lidar.name}, which stands, breaks at {', '.join(out)}: {CRITERIA[name][1]}")
    return tuple(remarks)


def _free(places_m: FloatArray) -> FloatArray:
    return np.zeros(len(places_m))


def _searched(improve: Improve, seen: Look, how: How | None, most: int) -> tuple[FloatArray, search.Sets]:
    """(candidate,) best error that a lidar there can be part of, and the best sets."""
    task, places = improve.task, seen.positions_m[:, :2]
    apart, cost = APART_CELLS * improve.spacing_m, improve.cost(places)
    if task.count == 1:
        error = improve.values([], seen)
        return error, search.distinct_singles(error, places, apart_m=apart, most=most)
    table, opening = table_of(task, seen), task.limits.least_opening_deg
    if improve.fixed:
        error = improve.values([], seen)
        starts = search.distinct_singles(error, places, apart_m=apart, most=STARTS)
    else:
        error, starts = _pairs(task, table, cost, places, apart, how, most if task.count == 2 else STARTS)
        if task.count == 2:
            return error, starts
    members: IntArray = starts.members if len(starts.members) else np.empty((1, 0), dtype=np.intp)
    if not improve.fixed and not len(starts.members):
        return error, search.Sets(np.empty((0, task.count), dtype=np.intp), np.empty(0))
    tables = search.SetTables(table, tuple(improve.fixed), members, task.count, cost, opening, task.aggregate)
    sets = search.best_sets(tables, how=how)
    return error, search.Sets(sets.members[:most], sets.value[:most])


def _pairs(
    task: Task,
    table: BeamTable,
    cost: FloatArray,
    places: FloatArray,
    apart: float,
    how: How | None,
    most: int,
) -> tuple[FloatArray, search.Sets]:
    """Best partner's value of every candidate, and the best distinct pairs, of those that see every target."""
    kept = np.flatnonzero(table.seen.all(axis=0))
    error = np.full(table.candidates, np.inf)
    if not kept.size:
        return error, search.Sets(np.empty((0, 2), dtype=np.intp), np.empty(0))
    least = np.sin(np.radians(task.limits.least_opening_deg)) ** 2
    tables = search.PairTables(table.take(kept), cost[kept], float(least), task.aggregate)
    value, partner = search.best_partners(tables, how=how)
    found = search.distinct_pairs(value, partner, places[kept], apart_m=apart, most=most)
    error[kept] = value
    return error, search.Sets(kept[found.members], found.value)


Found = tuple[FloatArray, float]  # places (lidar, 2) and their value


def _apart(found: Sequence[Found], apart_m: float) -> list[Found]:
    """Best first; of those that refinement has brought to one place, the best."""
    kept: list[Found] = []
    for places, value in sorted(found, key=lambda item: item[1]):
        if not any(search.near(places[None], other, apart_m)[0] for other, _ in kept):
            kept.append((places, value))
    return kept


def _ranked(improve: Improve, places_m: FloatArray, value: float, tier: Tier) -> Ranked:
    """One set with its numbers, the constraint that binds, and its line."""
    task = improve.task
    positions = np.concatenate([standing_m(task, place) for place in places_m])
    looks = [*(of_lidar(task, lidar) for lidar in task.fixed), *(look(task, one[None]) for one in positions)]
    numbers, turbulent = numbers_of(task, looks), None
    binds = binding(improve, places_m, improve.value(places_m))
    if tier == "turbulent":
        turbulent = turbulent_numbers(task, looks)
        value = turbulent.value(task.criterion, task.aggregate) + float(improve.cost(places_m).sum())
    text = _line(task, positions, value, numbers, turbulent, binds)
    return Ranked(0, positions, value, numbers, turbulent, binds, text)


def _in_order(found: Sequence[Ranked]) -> tuple[Ranked, ...]:
    """Best first, numbered from 1."""
    ordered = sorted(found, key=lambda item: item.value)
    return tuple(item._replace(rank=rank) for rank, item in enumerate(ordered, start=1))


def _declared(improve: Improve, tier: Tier) -> Ranked | None:
    """The lidars where the site has them, judged alike, whether or not they keep to the constraints."""
    task = improve.task
    if not task.replaced:
        return None
    replaced = [of_lidar(task, lidar) for lidar in task.replaced]
    looks = [*(of_lidar(task, lidar) for lidar in task.fixed), *replaced]
    numbers = numbers_of(task, looks)
    turbulent = turbulent_numbers(task, looks) if tier == "turbulent" else None
    positions = np.array([lidar.position for lidar in task.replaced], dtype=np.float64)
    broken = [name for one in replaced for name, slack in one.slack.items() if not (slack >= 0.0).all()]
    soft = float(improve.cost(positions[:, :2]).sum())
    value = (turbulent or numbers).value(task.criterion, task.aggregate) + soft
    text = _line(task, positions, value, numbers, turbulent, None)
    return Ranked(0, positions, value, numbers, turbulent, tuple(dict.fromkeys(broken)), text)


def _line(
    task: Task,
    positions: FloatArray,
    value: float,
    numbers: Numbers,
    turbulent: Turbulent | None,
    binds: tuple[str, ...] | None,
) -> str:
    """What one set is, in a line."""
    spots = " and ".join(f"E {east:.0f} N {north:.0f}" for east, north, _ in positions)
    worst = int(np.argmax(numbers.speed_std_mps))
    parts = [
        f"{spots}: {WHAT[task.criterion]} {value:.4f} {UNIT[task.criterion]}",
        f"speed {numbers.speed_std_mps.max():.4f} m/s, direction {numbers.direction_std_deg.max():.3f}°",
    ]
    if len(task.targets) > 1:
        parts[1] += f" at the worst target ({task.targets[worst]} for speed)"
    if turbulent is not None:
        gusts = f"{turbulent.speed_std_mps.max():.3f} m/s and {turbulent.direction_std_deg.max():.2f}°"
        parts.append(f"with turbulence {gusts}")
    if np.isfinite(numbers.opening_deg).all():
        parts.append(f"opening {_span(numbers.opening_deg, '°')}")
    placed = slice(len(task.fixed), None)
    parts.append(f"range {_span(numbers.range_m[:, placed], ' m')}")
    parts.append(f"elevation {_span(numbers.elevation_deg[:, placed], '°', 1)}")
    if binds is None:
        return ", ".join(parts)
    parts.append(
        "bound by "
        + (", ".join(CRITERIA[name][1] for name in binds) if binds else "nothing: the error is least here")
    )
    return ", ".join(parts)


def _span(values: FloatArray, unit: str, digits: int = 0) -> str:
    low, high = f"{float(np.min(values)):.{digits}f}", f"{float(np.max(values)):.{digits}f}"
    return f"{low}{unit}" if low == high else f"{low} to {high}{unit}"


def _changes(best: Ranked, declared: Ranked) -> list[str]:
    """The errors of the best against those of the declared, with turbulence first where that was asked for."""
    old, new = declared.numbers, best.numbers
    said = [
        f"speed {new.speed_std_mps.max():.4f} against {old.speed_std_mps.max():.4f} m/s",
        f"direction {new.direction_std_deg.max():.3f} against {old.direction_std_deg.max():.3f}°",
    ]
    if best.turbulent is None or declared.turbulent is None:
        return said
    after, before = best.turbulent, declared.turbulent
    return [
        f"with turbulence speed {after.speed_std_mps.max():.3f} against {before.speed_std_mps.max():.3f} m/s",
        f"direction {after.direction_std_deg.max():.2f} against {before.direction_std_deg.max():.2f}°",
        f"without it {said[0]}",
        said[1],
    ]


def ranked_by(task: Task, tier: Tier, *, cost: bool) -> str:
    """What the first number of every line is, and that it ranks."""
    where = "" if len(task.targets) == 1 else " at the worst target"
    if len(task.targets) > 1 and task.aggregate == "mean":
        where = ", root mean square over the targets"
    both = " (along and across it together)" if task.criterion == "vector" else ""
    gusts = " with turbulence" if tier == "turbulent" else ""
    added = " plus --near's cost" if cost else ""
    return f"Ranked by the first number: the error of the {WHAT[task.criterion]}{both}{where}{gusts}{added}"


def _why(task: Task, best: Ranked, declared: Ranked | None) -> str:
    """What the best does better than the declared, and by what."""
    if declared is None:
        return "the site has no lidars to compare with"
    names = " and ".join(lidar.name for lidar in task.replaced)
    change = best.value / declared.value - 1.0
    verdict = (
        f"{-change:.1%} smaller"
        if change < -WORTH
        else "as small"
        if change <= WORTH
        else f"{change:.1%} larger"
    )
    old, new = declared.numbers, best.numbers
    reasons = [
        f"the error of the {WHAT[task.criterion]} at {'the worst target' if len(task.targets) > 1 else task.targets[0]} is "
        f"{verdict} than with {names} where declared"
        if change < -WORTH or change > WORTH
        else f"the error of the {WHAT[task.criterion]} is {verdict} as with {names} where declared",
        *_changes(best, declared),
    ]
    if np.isfinite(new.opening_deg).all() and np.isfinite(old.opening_deg).all():
        reasons.append(
            f"the beams cross at {_span(new.opening_deg, '°')} instead of {_span(old.opening_deg, '°')}"
        )
    placed = slice(len(task.fixed), None)
    reasons.append(
        f"at ranges of {_span(new.range_m[:, placed], ' m')} instead of {_span(old.range_m[:, placed], ' m')} and elevations of "
        f"{_span(new.elevation_deg[:, placed], '°', 1)} instead of {_span(old.elevation_deg[:, placed], '°', 1)}"
    )
    if declared.binds:
        reasons.append(
            f"the declared place breaks: {', '.join(CRITERIA[name][1] for name in declared.binds)}"
        )
    return "; ".join(reasons)
