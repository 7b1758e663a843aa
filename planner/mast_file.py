"""A wind from a CSV: of a mast's cup and vane, or of a sonic."""

from collections.abc import Iterable
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from geometry.arrays import FloatArray
from geometry.errors import InputError
from planner.campaign import MastInput
from planner.campaign_logs import SonicInput
from reconstruct.averaging import TimeArray
from reconstruct.wind import uv_mps

if TYPE_CHECKING:
    import pandas as pd


class WindSeries(NamedTuple):
    """Samples, or means over short periods."""

    time_utc: TimeArray  # (sample,) middles, rising
    u_mps: FloatArray  # (sample,) eastward; NaN where missing
    v_mps: FloatArray  # (sample,) northward
    interval_s: float  # usual time between samples


def read_mast(mast: MastInput) -> WindSeries:
    """A mast's cup and vane.

    Raises
    ------
    InputError
        If the file lacks a column or holds fewer than two times.
    """
    frame = _frame("mast", mast.path, mast.separator, (mast.time, mast.speed, mast.direction))
    stamps = _stamps(frame, "mast", mast.path, mast.time)
    speed, angle = (_numbers(frame[name], mast.missing) for name in (mast.speed, mast.direction))
    found = _series(stamps, *uv_mps(speed, angle + mast.direction_offset_deg))
    interval_s = mast.interval_s or found.interval_s
    seconds = (0.5 if mast.stamp == "start" else -0.5) * interval_s + mast.clock_s
    moved = found.time_utc + np.timedelta64(round(seconds * 1e9), "ns")
    return found._replace(time_utc=moved, interval_s=interval_s)


def read_sonic(sonic: SonicInput) -> WindSeries:
    """A sonic's samples.

    Raises
    ------
    InputError
        If the file lacks a column or holds fewer than two times.
    """
    parts = sonic_columns(sonic)
    frame = _frame(f"sonic '{sonic.name}'", sonic.path, sonic.separator, (sonic.time, *parts))
    one, other = (_numbers(frame[name], ()) for name in parts)
    u, v = uv_mps(one, other) if sonic.east is None else (one, other)
    return _series(_stamps(frame, f"sonic '{sonic.name}'", sonic.path, sonic.time), u, v)


def sonic_columns(sonic: SonicInput) -> tuple[str, str]:
    """Columns of a sonic's wind: eastward and northward, or speed and direction."""
    return (
        (sonic.speed, sonic.direction)
        if sonic.east is None or sonic.north is None
        else (sonic.east, sonic.north)
    )


def lost_of(path: str, separator: str, time: str, parts: Iterable[str]) -> str:
    """What of a wind's file cannot be used, in words; empty where all can.

    Parameters
    ----------
    path, separator
        A file that has been read.
    time, parts
        Its columns of times and of numbers.
    """
    frame = _frame("wind", path, separator, (time, *parts))
    counts = {"rows without a time": int(_times(frame[time]).isna().sum())}
    for name in parts:
        wrong = frame[name].notna() & _as_numbers(frame[name]).isna()
        counts[f"cells of {name} that are no number"] = int(wrong.sum())
    lost = ", ".join(f"{what}: {count}" for what, count in counts.items() if count)
    return f"lost of {Path(path).name}: {lost}" if lost else ""


def _frame(what: str, path: str, separator: str, needed: tuple[str, ...]) -> "pd.DataFrame":
    try:
        frame = _read(path, separator, Path(path).stat().st_mtime_ns)
    except (OSError, ValueError) as error:
        raise InputError(f"{what} file {path} cannot be read as CSV ({error})") from error
    if missing := [name for name in needed if name not in frame.columns]:
        have = ", ".join(map(str, frame.columns))
        raise InputError(
            f"{what} file {path} has no column {', '.join(missing)}; it has {have}: give the names in the campaign file"
        )
    return frame


@lru_cache(maxsize=1)  # the levels of a mast stand in one file
def _read(path: str, separator: str, written: int) -> "pd.DataFrame":  # noqa: ARG001 - a file that changed is another
    import pandas as pd

    return pd.read_csv(path, sep=separator, skipinitialspace=True)


def _times(column: "pd.Series[str]") -> "pd.Series[pd.Timestamp]":
    import pandas as pd

    return pd.to_datetime(column, utc=True, errors="coerce", format="ISO8601")


def _as_numbers(column: "pd.Series[float]") -> "pd.Series[float]":
    import pandas as pd

    return pd.to_numeric(column, errors="coerce")


def _stamps(frame: "pd.DataFrame", what: str, path: str, name: str) -> TimeArray:
    stamps: TimeArray = _times(frame[name]).dt.tz_localize(None).to_numpy().astype("datetime64[ns]")
    if np.count_nonzero(~np.isnat(stamps)) < 2:
        raise InputError(
            f"{what} file {path} has fewer than two times in {name}: they have to be ISO 8601, UTC"
        )
    return stamps


def _series(stamps: TimeArray, u: FloatArray, v: FloatArray) -> WindSeries:
    known = np.flatnonzero(~np.isnat(stamps))
    order = known[np.argsort(stamps[known], kind="stable")]
    interval_s = float(np.median(np.diff(stamps[order]) / np.timedelta64(1, "s")))
    return WindSeries(stamps[order], u[order], v[order], interval_s)


def _numbers(column: "pd.Series[float]", missing: tuple[float, ...]) -> FloatArray:
    values = _as_numbers(column).to_numpy(dtype=float)
    return np.where(np.isin(values, missing), np.nan, values)
