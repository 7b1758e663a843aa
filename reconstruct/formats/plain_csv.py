"""Plain CSV: with a map of its columns, or in the column names of `reconstruct.record_tables`."""

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from geometry.errors import InputError
from reconstruct.formats.csv_frame import delimited_frame, to_times
from reconstruct.formats.gate_table import gate_table
from reconstruct.formats.options import ColumnMap, Options
from reconstruct.formats.over_the_top import folded
from reconstruct.formats.text import seconds_delta
from reconstruct.losses import Loss
from reconstruct.record_tables import from_long, from_wide
from reconstruct.records import GATE_FIELDS, Records, TimeArray
from reconstruct.sweep_ids import sweep_ids

if TYPE_CHECKING:
    import pandas as pd

#: What a column map has to give, as a column or as a constant.
NEEDED = ("time_utc", "azimuth_deg", "elevation_deg", "range_m", "radial_speed_mps")

#: What a column map may give besides.
MAY = ("duration_s", "scan_id", "sweep_id", "cnr_db", "spectral_width_mps", "quality")


def read_plain_csv(path: Path, options: Options | None = None) -> Records:
    """Rays of a CSV with one row for each ray and gate (or, in our own names, one for each ray).

    Parameters
    ----------
    path : Path
    options : Options, optional
        `columns`: how the file's columns become ours; without it the file has to be one that `to_long` or
        `to_wide` makes. `stamp` where in the ray the times stand (needs a duration), `clock_offset_s`,
        `mounting`, `instrument`.

    Returns
    -------
    Records

    Raises
    ------
    InputError
        If a column or a time is missing, or no row is usable.
    """
    options = options or Options()
    if options.columns is None:
        return _own(path, options)
    frame, losses = delimited_frame(
        path, separator=options.columns.separator, decimal=options.columns.decimal
    )
    table, notes, unread = _renamed(frame, options.columns, path)
    table, dropped = _usable(table, path.name)
    if table.empty:
        raise InputError(f"{path}: no row has a time, angles and a range")
    records = _records(table, options, path.name)
    notes += ["columns renamed by the column map"]
    return replace(
        records, notes=(*records.notes, *notes), losses=(*losses, *unread, *dropped, *records.losses)
    ).mounted(options.mounting)


def _own(path: Path, options: Options) -> Records:
    """A file in our own column names."""
    frame, losses = delimited_frame(path)
    if "time_utc" not in frame.columns:
        raise InputError(
            f"{path}: has the columns {', '.join(map(str, frame.columns[:8]))}: give a column map "
            "(options.columns), as its names are "
            "not those of a table of rays"
        )
    if frame.empty:
        raise InputError(f"{path}: no line of rays follows the header")
    frame = frame.assign(time_utc=_times(frame, path))
    records = from_long(frame) if {"range_m", "gate"} & set(frame.columns) else from_wide(frame)
    return replace(
        records, losses=tuple(losses), instrument=options.instrument or records.instrument
    ).mounted(options.mounting)


def _times(frame: "pd.DataFrame", path: Path) -> "pd.Series[pd.Timestamp]":
    """The times of a table in our names: every line needs one."""
    times = to_times(frame["time_utc"])
    absent = times.isna()
    if absent.any():
        line = int(frame.index[absent][0])
        came = "nothing" if frame["time_utc"].isna()[line] else repr(frame["time_utc"][line])
        raise InputError(
            f"{path}:{line}: {came} came as the time (in all {int(absent.sum())} lines have none); allowed: ISO 8601 from "
            "1970 to 2200. Leave lines without a time out"
        )
    return times


def _renamed(
    frame: "pd.DataFrame", columns: ColumnMap, path: Path
) -> "tuple[pd.DataFrame, list[str], list[Loss]]":
    """Our columns of the file's, times and signs turned, with notes, and cells that are no numbers."""
    import pandas as pd

    unknown = sorted((set(columns.names) | set(columns.constants)) - set(NEEDED) - set(MAY))
    if unknown:
        raise InputError(f"the column map names {', '.join(unknown)}: known are {', '.join((*NEEDED, *MAY))}")
    absent = [f"{own} (from {name!r})" for own, name in columns.names.items() if name not in frame.columns]
    absent += [name for name in NEEDED if name not in columns.names and name not in columns.constants]
    if absent:
        raise InputError(
            f"{path}: no column for {', '.join(absent)}; the file has {', '.join(map(str, frame.columns))}"
        )
    out: dict[str, Any] = {}
    losses = []
    for own, name in columns.names.items():
        if own == "time_utc":
            out[own] = to_times(frame[name], unit=columns.time_unit)
            continue
        values = pd.to_numeric(frame[name], errors="coerce").to_numpy(dtype=float)
        wrong = np.isnan(values) & frame[name].notna().to_numpy()
        if wrong.any():
            first = int(frame.index[wrong][0])
            losses.append(Loss(path.name, f"no number in {name}", first, int(wrong.sum())))
        values = np.where(np.isin(values, columns.missing), np.nan, values)
        out[own] = pd.Series(values * columns.factors.get(own, 1.0), index=frame.index)
    table = pd.DataFrame(out).assign(**dict(columns.constants))
    notes = []
    if columns.speed_positive == "toward":
        table["radial_speed_mps"] = -table["radial_speed_mps"]
        notes.append("radial speeds turned from positive toward to positive away")
    return table, notes, losses


def _usable(table: "pd.DataFrame", where: str) -> "tuple[pd.DataFrame, list[Loss]]":
    known = table[list(NEEDED[:4])].notna().all(axis=1).to_numpy()
    if known.all():
        return table, []
    first = int(table.index[~known][0])
    return table[known], [Loss(where, "no time, angle or range", first, int(np.sum(~known)))]


def _records(table: "pd.DataFrame", options: Options, where: str) -> Records:
    keys = ["time_utc", "azimuth_deg", "elevation_deg"]
    grid = gate_table(table, ray=keys, gate="range_m", values=GATE_FIELDS)
    first = grid.first
    azimuth, elevation, notes = folded(first["azimuth_deg"], first["elevation_deg"])
    rays = len(first)
    duration = first["duration_s"].to_numpy(dtype=float) if "duration_s" in first else np.full(rays, np.nan)
    half = {"start": 0.5, "end": -0.5}.get(options.stamp, 0.0) * np.nan_to_num(duration)
    stamps: TimeArray = first["time_utc"].to_numpy(dtype="datetime64[ns]")
    time: TimeArray = stamps + seconds_delta(half + options.clock_offset_s)
    if np.any(half):
        notes.append(f"times turned from the {options.stamp} to the middle of the ray; angles as stored")
    if options.stamp in ("start", "end") and (unknown := int(np.count_nonzero(~np.isfinite(duration)))):
        notes.append(
            f"{unknown} of {rays} rays have no duration_s: their times stay at the {options.stamp} of the ray"
        )
    own_sweeps = (
        first["sweep_id"].to_numpy(dtype=np.intp) if "sweep_id" in first else sweep_ids(azimuth, elevation)
    )
    values: dict[str, Any] = {
        name: grid.grids[name] for name in GATE_FIELDS if name in table.columns or name in GATE_FIELDS[:2]
    }
    order = np.argsort(time, kind="stable")
    records = Records(
        time_utc=time[order],
        duration_s=duration,
        azimuth_deg=azimuth,
        elevation_deg=elevation,
        scan_id=first["scan_id"].to_numpy(dtype=np.intp)
        if "scan_id" in first
        else np.zeros(rays, dtype=np.intp),
        sweep_id=own_sweeps,
        range_m=grid.range_m,
        instrument=options.instrument or "",
        notes=tuple(notes),
        losses=(Loss(where, "a ray and range that come twice", times=grid.doubles),) if grid.doubles else (),
        **values,
    )
    return replace(records.at_rays(order), time_utc=time[order])
