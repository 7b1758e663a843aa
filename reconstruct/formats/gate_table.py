"""Long tables (one row a ray and gate) to arrays (ray, gate)."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import pandas as pd

from geometry.arrays import FloatArray


class GateTable(NamedTuple):
    """A long table as arrays."""

    first: pd.DataFrame  # one row for each ray, in rising order of its first key
    range_m: FloatArray  # (gate,)
    grids: dict[str, FloatArray]  # name: (ray, gate), NaN where the table has no row


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
    first = frame.iloc[order].iloc[np.flatnonzero(np.diff(rays[order], prepend=-1))]
    out = {}
    for name in values:
        grid = np.full((len(first), len(ranges)), np.nan)
        if name in frame.columns:
            grid[rays, column] = frame[name].to_numpy(dtype=float)
        out[name] = grid
    return GateTable(first.reset_index(drop=True), ranges, out)
