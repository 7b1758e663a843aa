"""Numbers of lines separated by blanks, at the speed of the machine where the text is sound and line by line
where it is not.
"""

import csv
import io
from typing import NamedTuple

import numpy as np
import pandas as pd

from geometry.arrays import FloatArray, IntArray

#: Lines that are parsed at once where a file is damaged: one bad line slows only its block down.
BLOCK = 5_000


class NumberRows(NamedTuple):
    """Numbers of every line of a text, in its order."""

    values: FloatArray  # (line, column) NaN where a line ends before, and in all of a wrong line
    wrong: IntArray  # lines that hold something else than numbers, or too many, counted from 0


def number_rows(body: bytes, columns: int) -> NumberRows:
    """Numbers of every line, blank ones among them.

    Parameters
    ----------
    body : bytes
        ASCII text.
    columns : int
        A line with more numbers is wrong.

    Examples
    --------
    >>> rows = number_rows(b"0.5 30\\r\\n\\r\\n  1 2 3\\r\\n4 x\\r\\n", 3)
    >>> rows.values
    array([[ 0.5, 30. ,  nan],
           [ nan,  nan,  nan],
           [ 1. ,  2. ,  3. ],
           [ nan,  nan,  nan]])
    >>> rows.wrong
    array([3])
    """
    values = _parsed(body, columns)
    if values is not None:
        return NumberRows(values, np.empty(0, dtype=np.intp))
    lines = byte_lines(body)
    values, wrong = np.full((len(lines), columns), np.nan), []
    for first in range(0, len(lines), BLOCK):
        block = lines[first : first + BLOCK]
        parsed = _parsed(b"\n".join([*block, b""]), columns)
        if parsed is not None and len(parsed) == len(block):
            values[first : first + BLOCK] = parsed
            continue
        for n, line in enumerate(block, first):
            numbers = _numbers(line, columns)
            if numbers is None:
                wrong.append(n)
            else:
                values[n, : len(numbers)] = numbers
    return NumberRows(values, np.array(wrong, dtype=np.intp))


def byte_lines(body: bytes) -> list[bytes]:
    """Lines of a text, whatever ends them."""
    lines = body.replace(b"\r\n", b"\n").replace(b"\r", b"\n").split(b"\n")
    return lines[:-1] if not lines[-1] else lines


def _parsed(body: bytes, columns: int) -> FloatArray | None:
    """(line, column) numbers; None if something in the text is none.

    A first line of its own tells the parser how long lines are: by a longer one of the file it would take the
    first numbers of every line for a name, and warn only.
    """
    longest = b"0 " * columns + b"\n"
    try:
        frame = pd.read_csv(
            io.BytesIO(longest + body),
            sep=r"\s+",
            header=None,
            names=list(range(columns)),
            dtype=float,
            skip_blank_lines=False,
            quoting=csv.QUOTE_NONE,
            encoding="latin-1",
            index_col=False,
        )
    except (ValueError, OverflowError, pd.errors.ParserError):
        return None
    values = frame.to_numpy(dtype=float)[1:]
    return None if np.isinf(values).any() else values


def _numbers(line: bytes, columns: int) -> list[float] | None:
    cells = line.split()
    try:
        numbers = [float(cell) for cell in cells]
    except ValueError:
        return None
    sound = len(cells) <= columns and b"_" not in line and not any(map(np.isinf, numbers))
    return numbers if sound else None
