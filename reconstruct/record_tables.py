"""Records as data frames, long and wide, and as Parquet.

What is said once for a whole table (instrument, ranges, notes, losses) travels beside its columns: in `attrs` of a data
frame, in the metadata of a Parquet file. A table without it is read as well.
"""

import json
import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from geometry.errors import InputError
from reconstruct.duck import bounded_duck, quoted
from reconstruct.losses import Loss
from reconstruct.records import GATE_FIELDS, RAY_FIELDS, Records

if TYPE_CHECKING:
    import pandas as pd

#: Under which `attrs` and metadata hold what is said once for a table.
TOLD = "records"

_WIDE = re.compile(r"(?P<name>\w+)\[(?P<range>[0-9.eE+-]+)\]")


def told_once(records: Records) -> str:
    """What is said once for a whole table, as JSON."""
    told = {
        "instrument": records.instrument,
        "range_m": records.range_m.tolist(),
        "notes": records.notes,
        "losses": records.losses,
    }
    return json.dumps(told)


def once_told(text: str) -> dict[str, Any]:
    """The same as arguments of `Records`; the inverse of `told_once`."""
    told = json.loads(text)
    return {
        "instrument": told["instrument"],
        "range_m": np.array(told["range_m"], dtype=float),
        "notes": tuple(told["notes"]),
        "losses": tuple(Loss(*loss) for loss in told["losses"]),
    }


def to_long(records: Records) -> "pd.DataFrame":
    """One row for each ray and gate: ray, gate, the ray's columns, range_m, the gate's columns, instrument.

    Raises
    ------
    InputError
        If there are rays and no gates: no row would hold them.

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

    if records.rays and not records.gates:
        raise InputError(
            f"{records.rays} rays without a gate came: a table has a row for each ray and gate, and so would have none"
        )
    columns: dict[str, Any] = {"ray": np.repeat(np.arange(records.rays), records.gates)}
    columns["gate"] = np.tile(np.arange(records.gates), records.rays)
    for name, values in records.ray_fields().items():
        columns[name] = np.repeat(values, records.gates)
    columns["range_m"] = np.tile(records.range_m, records.rays)
    for name, values in records.gate_fields().items():
        columns[name] = values.ravel()
    return _framed(pd.DataFrame(columns), records)


def _framed(frame: "pd.DataFrame", records: Records) -> "pd.DataFrame":
    """The frame with its last column, and with what is said once."""
    frame["instrument"] = records.instrument
    frame.attrs[TOLD] = told_once(records)
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
    once = _once(frame, names[0] if names else "")
    if rays:
        once["range_m"] = frame["range_m"].to_numpy(dtype=float)[:gates]
    first = frame.iloc[:: max(gates, 1)]
    per_ray: dict[str, Any] = {n: first[n].to_numpy() for n in RAY_FIELDS if n in frame.columns}
    shape = (rays, len(once["range_m"]))
    values: dict[str, Any] = {
        n: frame[n].to_numpy(dtype=float).reshape(shape) for n in GATE_FIELDS if n in frame.columns
    }
    return Records(**once, **per_ray, **values)


def _once(frame: "pd.DataFrame", instrument: str) -> dict[str, Any]:
    """What is said once for a table, as arguments of `Records`; what the table's own columns say where nothing is."""
    text = frame.attrs.get(TOLD)
    if isinstance(text, str):
        told = once_told(text)
        return told | ({"instrument": instrument} if instrument else {})
    return {"instrument": instrument, "range_m": np.empty(0)}


def _instruments(frame: "pd.DataFrame") -> list[str]:
    """Names in a table's column of instruments, if it has one."""
    return (
        [str(name) for name in frame["instrument"].dropna().unique()] if "instrument" in frame.columns else []
    )


def to_wide(records: Records) -> "pd.DataFrame":
    """One row for each ray; a column `name[range]` for each quantity and gate.

    Raises
    ------
    InputError
        If two gates have the same range: their columns would have the same name.
    """
    import pandas as pd

    if len(np.unique(records.range_m)) < records.gates:
        raise InputError(
            "two gates of the records have the same range: a long table can hold them, a wide one not"
        )

    columns = dict(records.ray_fields())
    for name, values in records.gate_fields().items():
        columns |= {
            f"{name}[{range_m!r}]": values[:, g] for g, range_m in enumerate(records.range_m.tolist())
        }
    return _framed(pd.DataFrame(columns), records)


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
    once = _once(frame, names[0] if len(names) == 1 else "") | {"range_m": np.array(gates)}
    return Records(**once, **ray, **values)


def write_parquet(records: Records, path: Path) -> None:
    """Write the long table of records as Parquet, with what is said once in the file's metadata."""
    frame = to_long(records)
    frame.attrs = {}
    with bounded_duck() as connection:
        connection.register("records", frame)
        told = f"KV_METADATA {{{TOLD}: {quoted(told_once(records))}}}"
        connection.execute(f"COPY records TO {quoted(path)} (FORMAT parquet, COMPRESSION zstd, {told})")


def read_parquet(path: Path) -> Records:
    """Records of a Parquet file written by `write_parquet`, or of any with its columns.

    Raises
    ------
    InputError
        If the file is no Parquet or lacks columns.
    """
    import duckdb

    try:
        with bounded_duck() as connection:
            frame = connection.read_parquet(str(path)).df()
            told = connection.execute(
                f"SELECT value FROM parquet_kv_metadata({quoted(path)}) WHERE key = ?", [TOLD.encode()]
            ).fetchall()
    except duckdb.Error as error:
        raise InputError(f"{path}: cannot be read as Parquet ({error})") from error
    frame.attrs = {TOLD: bytes(told[0][0]).decode()} if told else {}
    return from_long(frame)
