"""Records as data frames, long and wide, and as Parquet."""

import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from geometry.errors import InputError
from reconstruct.records import GATE_FIELDS, RAY_FIELDS, Records

if TYPE_CHECKING:
    import pandas as pd

_WIDE = re.compile(r"(?P<name>\w+)\[(?P<range>[0-9.eE+-]+)\]")


def to_long(records: Records) -> "pd.DataFrame":
    """One row for each ray and gate: ray, gate, the ray's columns, range_m, the gate's columns, instrument.

    Examples
    --------
    >>> from reconstruct.records import Records
    >>> zero = np.zeros(1)
    >>> one = Records(np.array(["2014-05-01"], "datetime64[ns]"), np.ones(1), zero, zero, zero, zero,
    ...     np.array([50.0, 60.0]), np.array([[3.0, 4.0]]), np.full((1, 2), -10.0), instrument="WS_S")
    >>> to_long(one)[["ray", "range_m", "radial_speed_mps"]].to_numpy()
    array([[ 0., 50.,  3.],
           [ 0., 60.,  4.]])
    """
    import pandas as pd

    columns: dict[str, Any] = {"ray": np.repeat(np.arange(records.rays), records.gates)}
    columns["gate"] = np.tile(np.arange(records.gates), records.rays)
    for name, values in records.ray_fields().items():
        columns[name] = np.repeat(values, records.gates)
    columns["range_m"] = np.tile(records.range_m, records.rays)
    for name, values in records.gate_fields().items():
        columns[name] = values.ravel()
    frame = pd.DataFrame(columns)
    frame["instrument"] = records.instrument
    return frame


def from_long(frame: "pd.DataFrame") -> Records:
    """Records of a long table; the inverse of `to_long`.

    Raises
    ------
    InputError
        If a column is missing, or the table holds several instruments or not every gate of every ray.
    """
    needed = ("ray", "gate", "range_m", *RAY_FIELDS[:6], *GATE_FIELDS[:2])
    missing = [name for name in needed if name not in frame.columns]
    if missing:
        raise InputError(f"the table of rays lacks {', '.join(missing)}: it needs {', '.join(needed)}")
    names = _instruments(frame)
    if len(names) > 1:
        raise InputError(
            f"the table holds {len(names)} instruments ({', '.join(names[:3])}...): take one at a time"
        )
    frame = frame.sort_values(["ray", "gate"], kind="stable")
    gates = int(frame["gate"].nunique())
    rays = int(frame["ray"].nunique())
    if rays * gates != len(frame):
        raise InputError(
            f"{len(frame)} rows are not {rays} rays of {gates} gates: every ray needs every gate once"
        )
    first = frame.iloc[:: max(gates, 1)]
    optional: dict[str, Any] = {n: first[n].to_numpy() for n in RAY_FIELDS if n in frame.columns}
    values: dict[str, Any] = {
        n: frame[n].to_numpy(dtype=float).reshape(rays, gates) for n in GATE_FIELDS if n in frame.columns
    }
    ranges = frame["range_m"].to_numpy(dtype=float)[:gates]
    return Records(range_m=ranges, instrument=names[0] if len(names) else "", **optional, **values)


def _instruments(frame: "pd.DataFrame") -> list[str]:
    """Names in a table's column of instruments, if it has one."""
    return (
        [str(name) for name in frame["instrument"].dropna().unique()] if "instrument" in frame.columns else []
    )


def to_wide(records: Records) -> "pd.DataFrame":
    """One row for each ray; a column `name[range]` for each quantity and gate."""
    import pandas as pd

    columns = dict(records.ray_fields())
    for name, values in records.gate_fields().items():
        columns |= {f"{name}[{range_m:.10g}]": values[:, g] for g, range_m in enumerate(records.range_m)}
    frame = pd.DataFrame(columns)
    frame["instrument"] = records.instrument
    return frame


def from_wide(frame: "pd.DataFrame") -> Records:
    """Records of a wide table; the inverse of `to_wide`.

    Raises
    ------
    InputError
        If a column is missing or the quantities have different gates.
    """
    found = [match for match in map(_WIDE.fullmatch, map(str, frame.columns)) if match]
    ranges = {
        name: [float(m["range"]) for m in found if m["name"] == name] for name in {m["name"] for m in found}
    }
    missing = [n for n in RAY_FIELDS[:6] if n not in frame.columns] + [
        n for n in GATE_FIELDS[:2] if n not in ranges
    ]
    if missing:
        raise InputError(
            f"the table of rays lacks {', '.join(missing)}: gates are columns like radial_speed_mps[1166]"
        )
    gates = ranges["radial_speed_mps"]
    if any(own != gates for name, own in ranges.items() if name in GATE_FIELDS):
        raise InputError(
            "the quantities of the table have different gates: every one needs the same ranges in the same "
            "order"
        )
    values: dict[str, Any] = {
        name: frame[[str(m.string) for m in found if m["name"] == name]].to_numpy(dtype=float)
        for name in GATE_FIELDS
        if name in ranges
    }
    names = _instruments(frame)
    ray: dict[str, Any] = {n: frame[n].to_numpy() for n in RAY_FIELDS if n in frame.columns}
    return Records(range_m=np.array(gates), instrument=names[0] if len(names) == 1 else "", **ray, **values)


def write_parquet(records: Records, path: Path) -> None:
    """Write the long table of records as Parquet."""
    import duckdb

    frame = to_long(records)
    with duckdb.connect() as connection:
        connection.register("records", frame)
        connection.table("records").write_parquet(str(path), compression="zstd")


def read_parquet(path: Path) -> Records:
    """Records of a Parquet file written by `write_parquet`, or of any with its columns.

    Raises
    ------
    InputError
        If the file is no Parquet or lacks columns.
    """
    import duckdb

    try:
        with duckdb.connect() as connection:
            frame = connection.read_parquet(str(path)).df()
    except duckdb.Error as error:
        raise InputError(f"{path}: cannot be read as Parquet ({error})") from error
    return from_long(frame)
