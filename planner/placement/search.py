"""The best places out of very many candidates: one, the best to go with those that stand, a pair, a set."""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from geometry.arrays import BoolArray, FloatArray, IntArray
from planner.placement.fan_out import LEAST_BATCH_S, Batch, How, run
from planner.placement.task import Aggregate
from reconstruct.beam_table import BeamTable, pair_variance, set_variance, widest_sine2

TILE = 256  # candidates whose pairs are worked on at once: half a megabyte a matrix

# Measured: one pair at one target, on one core.
PAIR_TARGET_S = 3.5e-9

# Measured: one member of a set at one target and candidate, on one core; and how many rounds of exchange it takes about.
MEMBER_TARGET_S = 2e-8
SET_ROUNDS = 4

# Rounds of exchange of a set; each one is exhaustive in one member.
EXCHANGES = 20

# What a target that a set cannot measure counts: more than any error, so that sets are first made complete.
UNSEEN = 1e12


class Sets(NamedTuple):
    """Sets of candidates, best first."""

    members: IntArray  # (set, lidar) indices of candidates
    value: FloatArray  # (set,) standard error in the criterion's unit


class PairTables(NamedTuple):
    """What a search for pairs shares among its batches."""

    table: BeamTable
    cost: FloatArray  # (candidate,) soft cost in the criterion's unit
    least_sine2: float
    aggregate: Aggregate


class SetTables(NamedTuple):
    """What a search for sets of more than two shares among its batches."""

    table: BeamTable  # of the candidates; one may miss some targets if others of the set see them
    fixed: tuple[BeamTable, ...]  # of lidars that stand, one candidate each
    starts: IntArray  # (start, lidar) beginnings, with none to `lidars` members each
    lidars: int  # members of a set
    cost: FloatArray  # (candidate,) soft cost in the criterion's unit
    least_opening_deg: float  # of those two of a set that cross best
    aggregate: Aggregate


def aggregated(variance: FloatArray, aggregate: Aggregate) -> FloatArray:
    """Standard error over the targets, the first axis: of the worst, or the root mean square of all."""
    joined = np.max(variance, axis=0) if aggregate == "worst" else np.mean(variance, axis=0)
    return np.asarray(np.sqrt(joined))


def added_value(
    fixed: Sequence[BeamTable], table: BeamTable, *, least_opening_deg: float, aggregate: Aggregate
) -> FloatArray:
    """Standard error (candidate,) with each candidate added to lidars that stand; inf where it is not allowed.

    Every candidate has to see all targets; those that stand may miss some.
    """
    members = [*fixed, table]
    variance = np.where(_crossing(members, least_opening_deg), set_variance(members), np.inf)
    return np.where(table.seen.all(axis=0), aggregated(variance, aggregate), np.inf)


def best_partners(tables: PairTables, *, how: How | None = None) -> tuple[FloatArray, IntArray]:
    """The best partner of every candidate, of all pairs there are.

    Returns
    -------
    tuple
        (candidate,) value with that partner, inf where there is none, and the partner's index, -1. Ties go to the
        lower index.
    """
    batches = _pair_batches(tables.table.candidates, tables.table.targets)
    pairs = tables.table.candidates**2 / 2
    parts = run(pair_batch, tables, batches, how=how, expected_s=pairs * tables.table.targets * PAIR_TARGET_S)
    value, partner = (
        np.full(tables.table.candidates, np.inf),
        np.full(tables.table.candidates, -1, dtype=np.intp),
    )
    for found, index in parts:
        _keep_better(value, partner, found, index)
    return value, partner


def pair_batch(tables: PairTables, batch: Batch) -> tuple[FloatArray, IntArray]:
    """Best partners among the pairs of some rows of tiles: a batch for `fan_out.run`."""
    count = tables.table.candidates
    value, partner = np.full(count, np.inf), np.full(count, -1, dtype=np.intp)
    for row in batch:
        first = slice(row * TILE, min((row + 1) * TILE, count))
        ours = tables.table.take(first)
        for column in range(row, -(-count // TILE)):
            second = slice(column * TILE, min((column + 1) * TILE, count))
            errors = _tile(tables, ours, tables.table.take(second))
            errors += tables.cost[first, None] + tables.cost[second]
            for part, other, axis in ((first, second, 1), (second, first, 0)):
                best = np.argmin(errors, axis=axis)
                least = np.take_along_axis(errors, np.expand_dims(best, axis), axis).ravel()
                _keep_better(value[part], partner[part], least, best + other.start)
    return value, partner


def _tile(tables: PairTables, first: BeamTable, second: BeamTable) -> FloatArray:
    """(first, second) standard error of all pairs of two tiles."""
    total, least = (
        np.zeros((first.candidates, second.candidates)),
        np.ones((first.candidates, second.candidates)),
    )
    for target in range(first.targets):
        variance, sine2 = pair_variance(first, second, target)
        np.minimum(least, sine2, out=least)
        if tables.aggregate == "worst":
            np.maximum(total, variance, out=total)
        else:
            total += variance / first.targets
    total[(least < tables.least_sine2) | ~np.isfinite(total)] = np.inf
    return np.asarray(np.sqrt(total, out=total))


def _pair_batches(candidates: int, targets: int) -> list[Batch]:
    """Rows of tiles, the longest with the shortest, together long enough to be worth handing out."""
    rows = -(-candidates // TILE)
    paired = [(row, rows - 1 - row) if row != rows - 1 - row else (row,) for row in range((rows + 1) // 2)]
    each_s = (rows + 1) * TILE**2 * targets * PAIR_TARGET_S
    size = max(int(np.ceil(LEAST_BATCH_S / max(each_s, 1e-9))), 1)
    return [tuple(row for pair in paired[i : i + size] for row in pair) for i in range(0, len(paired), size)]


def _keep_better(value: FloatArray, partner: IntArray, found: FloatArray, index: IntArray) -> None:
    """Take what is better, or as good with a lower index, in place."""
    better = (found < value) | ((found == value) & np.isfinite(found) & (index < partner))
    value[better], partner[better] = found[better], index[better]


def distinct_singles(value: FloatArray, places_m: FloatArray, *, apart_m: float, most: int) -> Sets:
    """The best places that lie apart from each other."""
    return _distinct(np.arange(len(value))[:, None], value, places_m, apart_m=apart_m, most=most)


def distinct_pairs(
    value: FloatArray, partner: IntArray, places_m: FloatArray, *, apart_m: float, most: int
) -> Sets:
    """The best pairs, each candidate with its best partner, that are not near to each other in both places."""
    members = np.sort(np.stack([np.arange(len(value)), partner], axis=-1), axis=1)
    return _distinct(members, np.where(partner >= 0, value, np.inf), places_m, apart_m=apart_m, most=most)


def _distinct(
    members: IntArray, value: FloatArray, places_m: FloatArray, *, apart_m: float, most: int
) -> Sets:
    chosen: list[int] = []
    left = np.isfinite(value)
    while left.any() and len(chosen) < most:
        best = int(np.flatnonzero(left)[np.argmin(value[left])])
        chosen.append(best)
        left &= ~near(places_m[members], places_m[members[best]], apart_m)
    return Sets(members[chosen], value[chosen])


def near(sets_m: FloatArray, one_m: FloatArray, apart_m: float) -> BoolArray:
    """Whether each set (set, lidar, 2) has every lidar near one of the lidars (lidar, 2) of one set, either way round."""
    between = np.linalg.norm(sets_m[:, :, None] - one_m, axis=-1) < apart_m  # (set, lidar, lidar)
    return np.asarray(between.any(axis=2).all(axis=1) & between.any(axis=1).all(axis=1))


def best_sets(tables: SetTables, *, how: How | None = None) -> Sets:
    """Sets of more than two, grown from good beginnings: the best member is added, then each is exchanged in turn.

    Every exchange looks at all candidates and keeps the rest, until none helps: a set that no single move betters.

    Returns
    -------
    Sets
        One for each start, best first, each only once.
    """
    table, count = tables.table, tables.lidars
    each_s = SET_ROUNDS * count**2 * table.candidates * table.targets * MEMBER_TARGET_S
    size = max(int(np.ceil(LEAST_BATCH_S / each_s)), 1)
    numbers = range(len(tables.starts))
    batches = [tuple(numbers[start : start + size]) for start in range(0, len(numbers), size)]
    parts = run(set_batch, tables, batches, how=how, expected_s=each_s * len(numbers))
    found = dict(item for part in parts for item in part)
    unseen = np.sqrt(UNSEEN / table.targets)
    ordered = [item for item in sorted(found.items(), key=_by_value) if item[1] < unseen]
    indices = np.array([members for members, _ in ordered], dtype=np.intp).reshape(-1, count)
    return Sets(indices, np.array([value for _, value in ordered]))


def set_batch(tables: SetTables, batch: Batch) -> list[tuple[tuple[int, ...], float]]:
    """Members and value of the sets grown from some of the beginnings: a batch for `fan_out.run`."""
    found = []
    for number in batch:
        members = [int(index) for index in tables.starts[number]]
        while len(members) < tables.lidars:
            members.append(int(np.argmin(_values_with(tables, members))))
        members, value = _exchanged(members, lambda others: _values_with(tables, others))
        found.append((tuple(sorted(members)), value))
    return found


def _values_with(tables: SetTables, others: list[int]) -> FloatArray:
    """(candidate,) value of each candidate together with other candidates and the lidars that stand."""
    members = [*tables.fixed, *(tables.table.take([index]) for index in others), tables.table]
    crossing = _crossing(members, tables.least_opening_deg)
    variance = np.where(crossing, set_variance(members), UNSEEN)
    return np.asarray(aggregated(variance, tables.aggregate) + tables.cost + tables.cost[others].sum())


def _by_value(item: tuple[tuple[int, ...], float]) -> tuple[float, tuple[int, ...]]:
    return item[1], item[0]


def _exchanged(members: list[int], value_of: Callable[[list[int]], FloatArray]) -> tuple[list[int], float]:
    """Exchange one member at a time for the best candidate, until no exchange helps."""
    now = np.inf
    for _ in range(EXCHANGES):
        before = now
        for place in range(len(members)):
            values = value_of(members[:place] + members[place + 1 :])
            best = int(np.argmin(values))
            if values[best] < min(now, float(values[members[place]])):
                members[place] = best
            now = float(values[members[place]])
        if not now < before:
            break
    return members, now


def _crossing(members: Sequence[BeamTable], least_opening_deg: float) -> BoolArray:
    """(target, candidate) whether some two beams of the set cross at enough."""
    return np.asarray(widest_sine2(members) >= np.sin(np.radians(least_opening_deg)) ** 2)
