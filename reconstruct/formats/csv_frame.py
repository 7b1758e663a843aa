"""Delimited text with a header line, as a data frame; broken lines named and left out."""

import io
from pathlib import Path

import numpy as np
import pandas as pd

from geometry.errors import InputError
from reconstruct.formats.text import lines_of, utc_from_labview, utc_from_unix
from reconstruct.losses import Loss

#: Times outside are no times of a measurement (a fill value of 9999 reads as that year).
BETWEEN = (pd.Timestamp("1970-01-01"), pd.Timestamp("2200-01-01"))


def delimited_frame(
    path: Path, *, separator: str = ",", decimal: str = "."
) -> tuple[pd.DataFrame, list[Loss]]:
    """A table with a header line; columns that hold only numbers are numbers, others text.

    Returns
    -------
    frame : pandas.DataFrame
        Its index is the line in the file, counted from 1.
    losses : list of Loss
        Lines with another number of fields than the header, and cells that should be numbers and are not (NaN
        then).

    Raises
    ------
    InputError
        If it is no text, there is no header line, or it names a column twice.
    """
    lines = lines_of(path)
    if any(letter < " " and letter != "\t" for letter in lines[0]):
        raise InputError(f"{path}: a binary file came; a table is text with a header line of columns")
    names = [cell.strip().strip('"') for cell in lines[0].split(separator)]
    if len(names) < 2:
        raise InputError(
            f"{path}: the first line {lines[0][:40]!r} is no header of columns separated by {separator!r}"
        )
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise InputError(f"{path}: the header names the column {', '.join(map(repr, twice))} twice")
    widths = np.array([line.count(separator) + 1 if line.strip() else 0 for line in lines[1:]])
    good = widths == len(names)
    bad = np.flatnonzero((widths > 0) & ~good)
    text = f"another number of fields than the {len(names)} of the header: the line is damaged"
    losses = [Loss(path.name, text, int(bad[0]) + 2, len(bad))] if len(bad) else []
    body = "\n".join(line.replace('"', "") for line, fine in zip(lines[1:], good, strict=True) if fine)
    if not body:
        return pd.DataFrame({name: np.array([], dtype=float) for name in names}), losses
    frame = pd.read_csv(
        io.StringIO(body), sep=separator, decimal=decimal, header=None, names=names, low_memory=False
    )
    frame.index = pd.Index(np.flatnonzero(good) + 2)
    for name in names[1:]:
        if frame[name].dtype.kind not in "fiub":
            frame[name], lost = _numbers(frame[name], path.name, name)
            losses += lost
    return frame, losses


def to_times(column: "pd.Series[str]", *, unit: str = "iso") -> "pd.Series[pd.Timestamp]":
    """UTC times of a column without a zone: ISO text (an offset is taken off; without one it is UTC) or
    seconds of an epoch.
    """
    if unit == "iso":
        parsed = pd.to_datetime(column.astype(str), utc=True, errors="coerce", format="ISO8601")
        plain = parsed.dt.tz_localize(None)
        return plain.where(plain.between(*BETWEEN)).astype("datetime64[ns]")
    seconds = pd.to_numeric(column, errors="coerce").to_numpy(dtype=float)
    return pd.Series(
        utc_from_labview(seconds) if unit == "labview_s" else utc_from_unix(seconds), index=column.index
    )


def _numbers(column: "pd.Series[str]", where: str, name: str) -> tuple["pd.Series[float]", list[Loss]]:
    """A text column as numbers, if most of it is; else as it is."""
    numbers = pd.to_numeric(column, errors="coerce")
    wrong = (numbers.isna() & column.notna()).to_numpy()
    if not wrong.any():
        return numbers, []
    if wrong.sum() > 0.5 * column.notna().sum():  # empty cells are neither numbers nor text
        return column, []  # type: ignore[return-value]
    what = f"{str(column[wrong].iloc[0])[:20]!r} in {name} is no number"
    return numbers, [Loss(where, what, int(column.index[wrong][0]), int(wrong.sum()))]
