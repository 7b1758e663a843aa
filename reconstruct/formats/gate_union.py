"""One set of range gates for rays whose files list ranges ray by ray."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from geometry.arrays import FloatArray
from geometry.errors import InputError
from reconstruct.records import Records, same_gates

#: Different ranges that one table may have: more is a file whose ranges are no gates.
MAX_GATES = 20_000


class GateBlock(NamedTuple):
    """Rays that list the same number of gates."""

    range_m: FloatArray  # (ray, gate)
    values: FloatArray  # (ray, gate, quantity)


def common_gates(blocks: Sequence[GateBlock]) -> tuple[FloatArray, list[FloatArray]]:
    """Put the values of all blocks on one set of gates.

    Where every ray lists the same ranges they stay as they are, doubles included (some lists hold a range
    twice, for two targets); else the gates are all the ranges that occur, and a ray is NaN where it lists
    none.

    Returns
    -------
    range_m : numpy.ndarray
        (gate,) in rising order [m].
    values : list of numpy.ndarray
        (ray, gate) of each quantity.

    Examples
    --------
    >>> ranges = np.array([[100.0, 200.0], [200.0, 300.0]])
    >>> block = GateBlock(ranges, np.array([[[1.0], [2.0]], [[3.0], [4.0]]]))
    >>> range_m, (speed,) = common_gates([block])
    >>> range_m
    array([100., 200., 300.])
    >>> speed
    array([[ 1.,  2., nan],
           [nan,  3.,  4.]])
    """
    first = blocks[0].range_m[0]
    if len(blocks) == 1 and bool(np.all(blocks[0].range_m == first)):
        order = np.argsort(first, kind="stable")
        return first[order], list(np.moveaxis(blocks[0].values[:, order], -1, 0))
    ranges = np.unique(np.concatenate([block.range_m.ravel() for block in blocks]))
    if len(ranges) > MAX_GATES:
        raise InputError(
            f"{len(ranges)} different ranges: the range column is no list of gates (at most {MAX_GATES})"
        )
    parts = [_placed(block, ranges) for block in blocks]
    return ranges, list(np.moveaxis(np.concatenate(parts), -1, 0))


def on_one_set_of_gates(parts: Sequence[Records]) -> list[Records]:
    """The same tables with the ranges of all of them, NaN where one has none, if they differ."""
    if all(same_gates(parts[0], part) for part in parts):
        return list(parts)
    ranges = np.unique(np.concatenate([part.range_m for part in parts]))
    note = f"the sweeps have different gates: put on all their {len(ranges)} ranges"
    out = []
    for part in parts:
        place = np.searchsorted(ranges, part.range_m)
        grids: dict[str, Any] = {}
        for name, grid in part.gate_fields().items():
            grids[name] = np.full((part.rays, len(ranges)), np.nan)
            grids[name][:, place] = grid
        out.append(replace(part, range_m=ranges, notes=(*part.notes, note), **grids))
    return out


def _placed(block: GateBlock, ranges: FloatArray) -> FloatArray:
    out = np.full((len(block.range_m), len(ranges), block.values.shape[-1]), np.nan)
    ray = np.arange(len(block.range_m))[:, None]
    out[ray, np.searchsorted(ranges, block.range_m)] = block.values
    return out
