"""Two-beam nacelle lidar: a CSV with one row for each time and line of sight.

Columns Timestamp, LOSindex, Distance, RWS, DRWS, CNR, Tilt, Roll, RWSStatus, OverrunStatus; the radial wind
speed is positive **toward** the lidar. The file does not say where the lines of sight look: that has to be
told.
"""

import re
from pathlib import Path

import numpy as np
import pandas as pd

from geometry.arrays import BoolArray, FloatArray
from geometry.errors import InputError
from reconstruct.formats.csv_frame import delimited_frame, to_times
from reconstruct.formats.gate_table import gate_table
from reconstruct.formats.options import Options
from reconstruct.formats.over_the_top import folded
from reconstruct.formats.text import lines_of, seconds_delta
from reconstruct.losses import Loss
from reconstruct.records import Records, TimeArray

#: Columns without which there is no ray.
NEEDED = ("Timestamp", "LOSindex", "Distance", "RWS")

#: Our spelling of a column, by the file's in small letters without blanks, underscores and units.
SPELLINGS = {
    name.lower(): name for name in (*NEEDED, "DRWS", "CNR", "Tilt", "Roll", "RWSStatus", "OverrunStatus")
} | {"dateandtime": "Timestamp", "datetime": "Timestamp", "los": "LOSindex", "losid": "LOSindex"}

#: Numbers from here on stand for nothing.
FILL = 9990.0


def read_nacelle(path: Path, options: Options | None = None) -> Records:
    """Rays of one file of a nacelle lidar, positive away.

    Parameters
    ----------
    path : Path
    options : Options
        `beam_azimuth_deg` (needed): LOSindex to azimuth [degrees]; `elevation_deg` (default 0);
        `attitude_limit_deg`; `clock_offset_s`, `stamp`, `mounting`, `instrument`.

    Returns
    -------
    Records
        `scan_id` is the LOSindex; Tilt and Roll are in `pitch_deg` and `roll_deg`. Rays that are dropped
        (fill values, RWSStatus other than 1, absurd tilt or roll) are counted one after the other in
        `losses`.

    Raises
    ------
    InputError
        If a needed column is missing, nothing is left, or a line of sight has no azimuth.
    """
    options = options or Options()
    separator = separator_of(lines_of(path)[0])
    frame, losses = delimited_frame(path, separator=separator, decimal="," if separator == ";" else ".")
    frame = frame.rename(columns={name: spelled(name) for name in frame.columns})
    missing = [name for name in NEEDED if name not in frame.columns]
    if missing:
        raise InputError(
            f"{path}: column {', '.join(missing)} is missing: a nacelle lidar's file has {', '.join(NEEDED)}"
        )
    frame = frame.assign(Timestamp=to_times(frame["Timestamp"]))
    kept, dropped = _quality(frame, path.name, options.attitude_limit_deg)
    if kept.empty:
        raise InputError(
            f"{path}: no row is left: {'; '.join(str(loss) for loss in [*losses, *dropped]) or 'it has none'}"
        )
    table = gate_table(kept, ray=["Timestamp", "LOSindex"], gate="Distance", values=("RWS", "CNR", "DRWS"))
    if table.doubles:
        dropped.append(
            Loss(path.name, "a time, line of sight and distance that come twice", times=table.doubles)
        )
    lines = table.first["LOSindex"].to_numpy(dtype=np.intp)
    azimuth, elevation, _ = folded(
        _azimuths(lines, path, options), np.full(len(lines), options.elevation_deg or 0.0)
    )
    time: TimeArray = table.first["Timestamp"].to_numpy(dtype="datetime64[ns]")
    records = Records(
        time_utc=time + seconds_delta(options.clock_offset_s),
        duration_s=np.full(len(lines), np.nan),
        azimuth_deg=azimuth,
        elevation_deg=elevation,
        scan_id=lines,
        sweep_id=np.cumsum(
            np.diff(lines, prepend=lines[:1]) < 0
        ),  # a pass ends where the first line comes again
        range_m=table.range_m,
        radial_speed_mps=-table.grids["RWS"],
        cnr_db=table.grids["CNR"],
        spectral_width_mps=table.grids["DRWS"] if "DRWS" in kept.columns else None,
        pitch_deg=_column(table.first, "Tilt"),
        roll_deg=_column(table.first, "Roll"),
        instrument=options.instrument or "nacelle lidar",
        notes=("radial speeds turned from positive toward to positive away", "times as stored"),
        losses=(*losses, *dropped),
    )
    return records.mounted(options.mounting)


def spelled(column: str) -> str:
    """A column's name as we spell it.

    Examples
    --------
    >>> spelled("LOS index"), spelled("RWS [m/s]"), spelled("Height")
    ('LOSindex', 'RWS', 'Height')
    """
    plain = re.sub(r"\[.*?\]|\(.*?\)|[\s_]", "", column).lower()
    return SPELLINGS.get(plain, column)


def separator_of(line: str) -> str:
    """What stands between the columns of a header line.

    Examples
    --------
    >>> separator_of("Timestamp;LOSindex;RWS")
    ';'
    """
    return max((",", ";", "\t"), key=line.count)


def _quality(frame: pd.DataFrame, where: str, limit_deg: float) -> tuple[pd.DataFrame, list[Loss]]:
    """Rows that pass, and how many each rule dropped."""
    speed = frame["RWS"].to_numpy(dtype=float)
    numbers = frame[["LOSindex", "Distance"]].to_numpy(dtype=float)
    known = frame["Timestamp"].notna().to_numpy() & np.all(
        np.isfinite(numbers) & (np.abs(numbers) < FILL), axis=1
    )
    rules: list[tuple[str, BoolArray]] = [
        ("no time, line of sight or distance", known & (numbers[:, 0] % 1 == 0) & (numbers[:, 1] >= 0)),
        ("no radial speed (a fill value)", np.isfinite(speed) & (np.abs(speed) < FILL)),
    ]
    if "RWSStatus" in frame:
        rules.append(("RWSStatus is not 1", frame["RWSStatus"].to_numpy(dtype=float) == 1))
    for name in ("Tilt", "Roll"):
        if name in frame:
            rules.append(
                (
                    f"{name} is beyond {limit_deg:g} degrees",
                    np.abs(frame[name].to_numpy(dtype=float)) <= limit_deg,
                )
            )
    kept = np.ones(len(frame), dtype=bool)
    losses = []
    for what, passed in rules:
        lost = int(np.sum(kept & ~passed))
        if lost:
            losses.append(Loss(where, what, line=int(frame.index[kept & ~passed][0]), times=lost))
        kept &= passed
    return frame[kept], losses


def _azimuths(lines: np.ndarray[tuple[int], np.dtype[np.intp]], path: Path, options: Options) -> FloatArray:
    given = {int(line): float(azimuth) for line, azimuth in (options.beam_azimuth_deg or {}).items()}
    unknown = sorted({int(line) for line in np.unique(lines)} - set(given))
    if unknown:
        raise InputError(
            f"{path}: the file does not say where line of sight {', '.join(map(str, unknown))} looks: give "
            "beam_azimuth_deg, "
            "for example {2: 221.8, 3: 250.2}"
        )
    return np.array([given[int(line)] for line in lines])


def _column(frame: pd.DataFrame, name: str) -> FloatArray | None:
    return frame[name].to_numpy(dtype=float) if name in frame.columns else None
