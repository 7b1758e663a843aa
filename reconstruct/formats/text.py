"""Text files as they come: encodings, truncated lines, broken numbers, and the times of three epochs."""

import csv
import gzip
import io
import math
import zlib
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd

from geometry.arrays import ArrayLike, FloatArray, IntArray
from geometry.errors import InputError
from reconstruct.losses import Loss
from reconstruct.records import TimeArray

#: 1970-01-01 in seconds since 1904-01-01, the epoch of LabVIEW.
LABVIEW_TO_UNIX_S = 2_082_844_800.0

#: A number of fields that fewer lines than this share have is a damaged line, unless it is rare as such.
RARE_SHARE = 0.02

#: Seconds that nanoseconds can count are fewer than this; a damaged number may be more.
LATEST_S = 9.0e9

#: Bytes that say nothing: a file of nothing else is empty.
BLANK = b"\x00 \t\r\n\xef\xbb\xbf"

#: How much of a damaged line an error shows.
SHOWN_CHARACTERS = 40


class Table(NamedTuple):
    """Lines of numbers with the same number of fields."""

    values: FloatArray  # (row, field)
    line: IntArray  # (row,) line in the file, from 1


def read_bytes(path: Path) -> bytes:
    """The bytes of a file, unpacked if gzip has packed it.

    Raises
    ------
    InputError
        If the file cannot be opened or is empty.
    """
    try:
        raw = path.read_bytes()
        if raw[:2] == b"\x1f\x8b":
            raw = gzip.decompress(raw)
    except (OSError, EOFError, zlib.error) as error:
        raise InputError(f"{path}: cannot be read ({error})") from error
    if not raw.strip(BLANK):
        raise InputError(f"{path}: the file is empty")
    return raw


def decode(raw: bytes) -> str:
    """Text of bytes in UTF-8, UTF-16 with its mark, or else Windows' Western encoding; NUL bytes left out.

    Examples
    --------
    >>> decode("Høvsøre".encode("cp1252")), decode("Høvsøre".encode("utf-16"))
    ('Høvsøre', 'Høvsøre')
    """
    if raw[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return raw.decode("utf-16", errors="replace").replace("\x00", "")
    try:
        text = raw.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = raw.decode("cp1252", errors="replace")
    return text.replace("\x00", "")


def plain_bytes(raw: bytes) -> bytes:
    """The same text one byte a character as far as it is ASCII: without a byte order mark, NUL bytes, or
    UTF-16.

    Examples
    --------
    >>> plain_bytes("1 2".encode("utf-16")), plain_bytes("1 2".encode("utf-8-sig") + bytes(3))
    (b'1 2', b'1 2')
    """
    if raw[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return decode(raw).encode("utf-8")
    return raw.removeprefix(b"\xef\xbb\xbf").replace(b"\x00", b"")


def lines_of(path: Path) -> list[str]:
    """The lines of a text file, whatever its encoding and line ends."""
    return split_lines(decode(read_bytes(path)))


def split_lines(text: str) -> list[str]:
    """Lines as editors count them; unlike `str.splitlines` no stray control character of a damaged file ends
    one.

    Examples
    --------
    >>> split_lines("a\\r\\nb\\x85c\\n")
    ['a', 'b\\x85c']
    """
    lines = text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
    return lines[:-1] if lines and not lines[-1] else lines


def number_tables(
    lines: Sequence[str], where: str, *, separator: str = ";"
) -> tuple[list[Table], list[Loss]]:
    """Numbers of lines that hold nothing else, and what was lost.

    Lines are gathered by their number of fields; a number of fields that hardly any line has is damage (a
    line cut off, or two glued together), named and left out. A decimal comma is read as a point.

    Parameters
    ----------
    lines : sequence of str
        Of the file; blank ones do not count.
    where : str
        Name of the file, for the losses.
    separator : str
        Between fields; one at the end of a line is ignored.

    Returns
    -------
    tables : list of Table
        Most frequent number of fields first. An empty field is NaN.
    losses : list of Loss

    Examples
    --------
    >>> tables, losses = number_tables(["1;2;3", "4;5;6", "7;8", "9;x;1"], "a.txt")
    >>> tables[0].values
    array([[1., 2., 3.],
           [4., 5., 6.]])
    >>> [str(loss) for loss in losses]
    ["a.txt, line 4: '9;x;1' holds something that is no number", 'a.txt, line 3: 2 fields where 3 are usual:
    the line is damaged']
    """
    if separator != ",":
        lines = [line.replace(",", ".") for line in lines]
    stripped = [line.strip().rstrip(separator) if separator.strip() else line.strip() for line in lines]
    widths = [line.count(separator) + 1 if line else 0 for line in stripped]
    counts = Counter(width for width in widths if width)
    usual = counts.most_common(1)[0][0] if counts else 0
    tables, losses = [], []
    for width, count in counts.most_common():
        numbers = [n for n, w in enumerate(widths) if w == width]
        if width != usual and count < max(3, RARE_SHARE * len(lines)):
            losses += [
                Loss(where, f"{width} fields where {usual} are usual: the line is damaged", n + 1)
                for n in numbers
            ]
            continue
        table, lost = _numbers([stripped[n] for n in numbers], numbers, where, separator)
        losses += lost
        if len(table.line):
            tables.append(table)
    return tables, losses


def _numbers(rows: list[str], numbers: list[int], where: str, separator: str) -> tuple[Table, list[Loss]]:
    line = np.array(numbers, dtype=np.intp) + 1
    try:
        return Table(_parsed(rows, separator), line), []
    except (ValueError, OverflowError):  # some field is no number: find which lines
        parsed = [_numbers_of(row, separator) for row in rows]
        losses = [
            Loss(where, f"{rows[i][:SHOWN_CHARACTERS]!r} holds something that is no number", int(line[i]))
            for i, numbers_of_row in enumerate(parsed)
            if numbers_of_row is None
        ]
        good = np.array([numbers_of_row is not None for numbers_of_row in parsed])
        values = np.array([row for row in parsed if row is not None], dtype=float)
        return Table(
            values.reshape(int(good.sum()), -1) if good.any() else np.empty((0, 0)), line[good]
        ), losses


def _parsed(rows: list[str], separator: str) -> FloatArray:
    text = io.StringIO("\n".join(rows))
    frame = pd.read_csv(text, sep=separator, header=None, dtype=float, engine="c", quoting=csv.QUOTE_NONE)
    values = frame.to_numpy(dtype=float)
    if np.isinf(values).any():
        raise ValueError("a number without end")
    return values


def _numbers_of(row: str, separator: str) -> list[float] | None:
    """The numbers of one line; None if a field is no number."""
    try:
        numbers = [float(field or "nan") for field in row.split(separator)]
    except ValueError:
        return None
    return None if "_" in row or any(map(math.isinf, numbers)) else numbers


def utc_from_unix(seconds: ArrayLike) -> TimeArray:
    """(...,) times of seconds since 1970-01-01, to the microsecond; NaT where there is none.

    Examples
    --------
    >>> print(utc_from_unix([1398816000.25])[0])
    2014-04-30T00:00:00.250000000
    """
    value = np.asarray(seconds, dtype=float)
    known = np.abs(value) < LATEST_S
    whole = np.floor(np.where(known, value, 0.0))
    micro = np.round((np.where(known, value, 0.0) - whole) * 1e6)
    time = whole.astype("int64") * 10**9 + micro.astype("int64") * 1000
    out = time.astype("datetime64[ns]")
    return np.where(known, out, np.datetime64("NaT", "ns"))


def utc_from_labview(seconds: ArrayLike) -> TimeArray:
    """(...,) times of seconds since 1904-01-01.

    Examples
    --------
    >>> print(utc_from_labview([3564493199.764])[0])
    2016-12-13T16:59:59.764000000
    """
    return utc_from_unix(np.asarray(seconds, dtype=float) - LABVIEW_TO_UNIX_S)


def labview_from_utc(time_utc: TimeArray) -> FloatArray:
    """(...,) seconds since 1904-01-01."""
    return np.asarray(time_utc.astype("datetime64[ns]").astype("int64") / 1e9 + LABVIEW_TO_UNIX_S)


def seconds_delta(seconds: ArrayLike) -> np.ndarray[tuple[int, ...], np.dtype[np.timedelta64]]:
    """(...,) a time difference of seconds, to the microsecond; NaT where there is none."""
    value = np.asarray(seconds, dtype=float)
    known = np.abs(value) < LATEST_S
    micro = np.round(np.where(known, value, 0.0) * 1e6).astype("int64")
    return np.where(known, (micro * 1000).astype("timedelta64[ns]"), np.timedelta64("NaT", "ns"))
