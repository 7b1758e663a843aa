"""Long tables (one row a ray and gate) to arrays (ray, gate)."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import pandas as pd

from geometry.arrays import FloatArray
from geometry.errors import InputError

#: Cells of a grid that is made in any case; a larger one has to be filled by one row in so many.
MOST_CELLS, FULLEST = 20_000_000, 100


class GateTable(NamedTuple):
    """A long table as arrays."""

    first: pd.DataFrame  # one row for each ray, in rising order of its first key
    range_m: FloatArray  # (gate,)
    grids: dict[str, FloatArray]  # name: (ray, gate), NaN where the table has no row
    doubles: int  # rows of a ray and gate that a row before has, too


def gate_table(frame: pd.DataFrame, *, ray: list[str], gate: str, values: Sequence[str]) -> GateTable:
    """Put a long table on a grid of rays and gates; of rows that come twice the last one counts.

    Parameters
    ----------
    frame : pandas.DataFrame
        One row for each ray and gate.
    ray : list of str
        Columns that tell rays apart, the first in order of time.
    gate : str
        Column with the range.
    values : sequence of str
        Columns to put on the grid; one that is missing is all NaN.

    Examples
    --------
    >>> frame = pd.DataFrame({"t": [1, 1, 2], "r": [50.0, 60.0, 60.0], "v": [3.0, 4.0, 5.0]})
    >>> gate_table(frame, ray=["t"], gate="r", values=["v"]).grids["v"]
    array([[ 3.,  4.],
           [nan,  5.]])
    """
    rays = frame.groupby(ray, sort=True, dropna=False).ngroup().to_numpy()
    ranges, column = np.unique(frame[gate].to_numpy(dtype=float), return_inverse=True)
    order = np.argsort(rays, kind="stable")
    cells = (int(rays.max(initial=-1)) + 1) * len(ranges)
    if cells > max(MOST_CELLS, FULLEST * len(frame)):
        raise InputError(
            f"{len(ranges)} different ranges in {len(frame)} rows: {gate!r} is no column of range gates"
        )
    first = frame.iloc[order].iloc[np.flatnonzero(np.diff(rays[order], prepend=-1))]
    out = {}
    for name in values:
        grid = np.full((len(first), len(ranges)), np.nan)
        if name in frame.columns:
            grid[rays, column] = frame[name].to_numpy(dtype=float)
        out[name] = grid
    held = np.zeros((len(first), len(ranges)), dtype=bool)
    held[rays, column] = True
    doubles = len(frame) - int(held.sum())
    return GateTable(first.reset_index(drop=True), ranges, out, doubles)
