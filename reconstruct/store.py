"""The embedded store and cache of rays: one DuckDB file, written in the order of time, read back in chunks.

Rays of one instrument with one set of gates make a block. Memory stays bounded by the chunk, however long the
campaign.
"""

import json
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from geometry.arrays import FloatArray
from geometry.errors import InputError
from reconstruct.duck import bounded_duck
from reconstruct.losses import Loss, merged_losses
from reconstruct.records import GATE_FIELDS, RAY_FIELDS, Records, sweeps_through

if TYPE_CHECKING:
    import duckdb

#: Radial speeds in a chunk: with every quantity there some 250 MB.
CHUNK_VALUES = 4_000_000

#: Columns of rays that are never missing.
_WHOLE = ("time_utc", "scan_id", "sweep_id")

_SCHEMA = """
CREATE TABLE IF NOT EXISTS block (block INTEGER, instrument VARCHAR, fields VARCHAR, notes VARCHAR, losses VARCHAR);
ALTER TABLE block ADD COLUMN IF NOT EXISTS losses VARCHAR;
CREATE TABLE IF NOT EXISTS gate (block INTEGER, gate INTEGER, range_m DOUBLE);
CREATE TABLE IF NOT EXISTS ray (block INTEGER, ray BIGINT, time_utc TIMESTAMP_NS, duration_s DOUBLE,
azimuth_deg DOUBLE,
    elevation_deg DOUBLE, scan_id BIGINT, sweep_id BIGINT, heading_deg DOUBLE, pitch_deg DOUBLE, roll_deg
    DOUBLE);
CREATE TABLE IF NOT EXISTS value (block INTEGER, ray BIGINT, gate INTEGER, radial_speed_mps DOUBLE, cnr_db
DOUBLE,
    spectral_width_mps DOUBLE, quality DOUBLE);
"""


class Block(NamedTuple):
    """What a store holds of one instrument and one set of gates."""

    number: int
    instrument: str
    rays: int
    gates: int
    first_utc: np.datetime64
    last_utc: np.datetime64


def write_store(path: Path, records: Records) -> None:
    """Append records to a store; it is made where it is not there. All of them or none.

    Sweeps are numbered on from what the store holds; one that the end of a file cut in two is whole again.

    Raises
    ------
    InputError
        If the store already has rays of this instrument and these gates that are not earlier.
    """
    if not records.rays:
        return
    with _opened(path, read_only=False) as connection:
        connection.execute("BEGIN")
        connection.execute(_SCHEMA)
        number = _block_for(connection, records)
        (count, last) = connection.execute(
            "SELECT count(*), max(time_utc)::VARCHAR FROM ray WHERE block = ?", [number]
        ).fetchall()[0]
        if count:
            if records.time_utc[0] <= np.datetime64(last, "ns"):
                raise InputError(
                    f"{path} already holds rays of {records.instrument or 'this instrument'} up to {last}, "
                    "and these begin at "
                    f"{records.time_utc[0]}: write in the order of time, or into another store"
                )
            tail = _tail(connection, number)
            records = replace(
                records, sweep_id=sweeps_through([tail, records])[tail.rays :] + int(tail.sweep_id[0])
            )
        _insert(connection, number, count, records)
        _tell(connection, number, records)
        connection.execute("COMMIT")


def blocks(path: Path) -> list[Block]:
    """What a store holds."""
    with _opened(path) as connection:
        rows = connection.execute(
            "SELECT b.block, b.instrument, r.n, g.n, r.first::VARCHAR, r.last::VARCHAR FROM block b "
            "JOIN (SELECT block, count(*) n, min(time_utc) AS first, max(time_utc) AS last FROM ray GROUP "
            "BY block) r USING (block) "
            "JOIN (SELECT block, count(*) n FROM gate GROUP BY block) g USING (block) ORDER BY b.block"
        ).fetchall()
    return [
        Block(row[0], row[1], row[2], row[3], np.datetime64(row[4], "ns"), np.datetime64(row[5], "ns"))
        for row in rows
    ]


def read_store(path: Path, *, instrument: str | None = None, range_m: float | None = None) -> Records:
    """All rays of one instrument; for campaigns that do not fit in memory see `store_chunks`.

    Parameters
    ----------
    path : Path
    instrument : str, optional
        Needed where the store holds several.
    range_m : float, optional
        Only the gate nearest to this slant range [m].

    Raises
    ------
    InputError
        If there is no such instrument, or it was stored with several sets of gates.
    """
    chosen = _choose(path, instrument)
    with _opened(path) as connection:
        return _read(connection, chosen, 0, chosen.rays, range_m)


def store_chunks(
    path: Path, *, instrument: str | None = None, range_m: float | None = None, values: int = CHUNK_VALUES
) -> Iterator[Records]:
    """Rays of one instrument in order, in chunks that end where a sweep ends if one ends in them.

    Parameters
    ----------
    path : Path
    instrument : str, optional
        Needed where the store holds several.
    range_m : float, optional
        Only the gate nearest to this slant range [m].
    values : int
        Radial speeds in a chunk, at the most. A sweep that is longer is cut: a stare is one that never ends.
        Its parts keep its number.

    Yields
    ------
    Records
        Sweeps are numbered through. What was lost is told with the first chunk alone.
    """
    chosen = _choose(path, instrument)
    size = max(values // (1 if range_m is not None else max(chosen.gates, 1)), 1)
    with _opened(path) as connection:
        start = 0
        while start < chosen.rays:
            stop = _sweep_end(connection, chosen, start, start + size)
            part = _read(connection, chosen, start, stop, range_m)
            yield part if start == 0 else replace(part, losses=())
            start = stop


@contextmanager
def _opened(path: Path, *, read_only: bool = True) -> "Iterator[duckdb.DuckDBPyConnection]":
    import duckdb

    if read_only and not path.is_file():
        raise InputError(f"{path}: there is no such store")
    try:
        with bounded_duck(path, read_only=read_only) as connection:
            yield connection
    except duckdb.CatalogException as error:
        raise InputError(f"{path}: is a DuckDB file, but not a store of rays ({error})") from error
    except (duckdb.IOException, duckdb.ConnectionException) as error:
        raise InputError(
            f"{path}: cannot be opened as a DuckDB store ({error}); one program at a time may write"
        ) from error


def _block_for(connection: "duckdb.DuckDBPyConnection", records: Records) -> int:
    """Number of the block for these records, made where there is none."""
    fields = json.dumps([*records.ray_fields(), *records.gate_fields()])
    same = connection.execute(
        "SELECT block FROM block WHERE instrument = ? AND fields = ? ORDER BY block",
        [records.instrument, fields],
    ).fetchall()
    for (number,) in same:
        ranges = _ranges(connection, number)
        if len(ranges) == records.gates and np.allclose(ranges, records.range_m, rtol=0, atol=1e-3):
            return int(number)
    (number,) = connection.execute("SELECT coalesce(max(block), -1) + 1 FROM block").fetchall()[0]
    connection.execute(
        "INSERT INTO block VALUES (?, ?, ?, ?, ?)", [number, records.instrument, fields, "[]", "[]"]
    )
    _insert_columns(
        connection,
        "gate",
        {
            "block": np.full(records.gates, number),
            "gate": np.arange(records.gates),
            "range_m": records.range_m,
        },
    )
    return int(number)


def _insert(connection: "duckdb.DuckDBPyConnection", number: int, first: int, records: Records) -> None:
    ray = np.arange(first, first + records.rays)
    _insert_columns(
        connection, "ray", {"block": np.full(records.rays, number), "ray": ray, **records.ray_fields()}
    )
    step = max(CHUNK_VALUES // max(records.gates, 1), 1)
    for start in range(0, records.rays, step):
        part = slice(start, start + step)
        count = len(ray[part])
        columns = {name: values[part].ravel() for name, values in records.gate_fields().items()}
        where = {"ray": np.repeat(ray[part], records.gates), "gate": np.tile(np.arange(records.gates), count)}
        _insert_columns(
            connection, "value", {"block": np.full(count * records.gates, number), **where, **columns}
        )


def _tell(connection: "duckdb.DuckDBPyConnection", number: int, records: Records) -> None:
    """Add what these records say of themselves to what the block says already."""
    notes, losses = _told(connection, number)
    notes = tuple(dict.fromkeys((*notes, *records.notes)))
    losses = merged_losses((*losses, *records.losses)) if losses else records.losses
    connection.execute(
        "UPDATE block SET notes = ?, losses = ? WHERE block = ?",
        [json.dumps(notes), json.dumps(losses), number],
    )


def _told(connection: "duckdb.DuckDBPyConnection", number: int) -> tuple[tuple[str, ...], tuple[Loss, ...]]:
    """Notes and losses of a block; a store of an older version has no losses."""
    row = connection.execute("SELECT * FROM block WHERE block = ?", [number]).fetchall()[0]
    losses = json.loads(row[4] or "[]") if len(row) > 4 else []
    return tuple(json.loads(row[3])), tuple(Loss(*loss) for loss in losses)


def _insert_columns(connection: "duckdb.DuckDBPyConnection", table: str, columns: dict[str, Any]) -> None:
    import pandas as pd

    connection.register("incoming", pd.DataFrame(columns))
    connection.execute(f"INSERT INTO {table} BY NAME SELECT * FROM incoming")
    connection.unregister("incoming")


def _ranges(connection: "duckdb.DuckDBPyConnection", number: int) -> FloatArray:
    found = connection.execute(
        "SELECT range_m FROM gate WHERE block = ? ORDER BY gate", [number]
    ).fetchnumpy()
    return np.asarray(found["range_m"], dtype=float)


def _tail(connection: "duckdb.DuckDBPyConnection", number: int) -> Records:
    """The last two sweeps of a block, without gates."""
    frame = connection.execute(
        "SELECT * FROM ray WHERE block = $1 AND sweep_id >= (SELECT max(sweep_id) - 1 FROM ray WHERE block "
        "= $1) ORDER BY ray",
        [number],
    ).df()
    empty = np.empty((len(frame), 0))
    fields: dict[str, Any] = {name: frame[name].to_numpy() for name in RAY_FIELDS[:6]}
    return Records(range_m=np.empty(0), radial_speed_mps=empty, cnr_db=empty, **fields)


def _choose(path: Path, instrument: str | None) -> Block:
    held = blocks(path)
    found = [block for block in held if instrument is None or block.instrument == instrument]
    if len(found) != 1:
        have = "; ".join(f"{b.instrument!r} with {b.gates} gates, {b.rays} rays" for b in held) or "nothing"
        raise InputError(
            f"{path} holds {have}: name one instrument that was stored with one set of gates and quantities"
        )
    return found[0]


def _sweep_end(connection: "duckdb.DuckDBPyConnection", block: Block, start: int, stop: int) -> int:
    """Ray after the last whole sweep in a range of rays; the end of the range if no sweep ends there."""
    if stop >= block.rays:
        return block.rays
    (begun,) = connection.execute(
        "SELECT min(ray) FROM ray WHERE block = $1 AND ray > $3 AND ray <= $2 "
        "AND sweep_id = (SELECT sweep_id FROM ray WHERE block = $1 AND ray = $2) "
        "AND sweep_id <> (SELECT sweep_id FROM ray WHERE block = $1 AND ray = $3)",
        [block.number, stop, start],
    ).fetchall()[0]
    return stop if begun is None else int(begun)


def _read(
    connection: "duckdb.DuckDBPyConnection", block: Block, start: int, stop: int, range_m: float | None
) -> Records:
    (fields_text,) = connection.execute(
        "SELECT fields FROM block WHERE block = ?", [block.number]
    ).fetchall()[0]
    fields, ranges = json.loads(fields_text), _ranges(connection, block.number)
    where, chosen = [block.number, start, stop], ""
    if range_m is not None:
        gate = int(np.argmin(np.abs(ranges - range_m)))
        ranges, chosen, where = ranges[gate : gate + 1], "AND gate = ?", [*where, gate]
    within = "WHERE block = ? AND ray >= ? AND ray < ?"
    names = [name for name in RAY_FIELDS if name in fields]
    table: dict[str, Any] = connection.execute(
        f"SELECT {', '.join(names)} FROM ray {within} ORDER BY ray", where[:3]
    ).fetchnumpy()
    quantities = [name for name in GATE_FIELDS if name in fields]
    values: dict[str, Any] = connection.execute(
        f"SELECT {', '.join(quantities)} FROM value {within} {chosen}", where
    ).fetchnumpy()  # in the order in which they were inserted, which DuckDB keeps: by ray and gate
    shape = (stop - start, len(ranges))
    grids: dict[str, Any] = {name: _grid(values[name], shape, block) for name in quantities}
    rays: dict[str, Any] = {
        name: column if name in _WHOLE else np.ma.filled(column, np.nan) for name, column in table.items()
    }
    notes, losses = _told(connection, block.number)
    return Records(range_m=ranges, instrument=block.instrument, notes=notes, losses=losses, **rays, **grids)


def _grid(values: FloatArray, shape: tuple[int, int], block: Block) -> FloatArray:
    """(ray, gate) of values in their order; DuckDB takes the NaN of a data frame for NULL."""
    if len(values) != shape[0] * shape[1]:
        raise InputError(
            f"the store holds {len(values)} values of {block.instrument or 'an instrument'} where {shape[0]} rays of "
            f"{shape[1]} gates need {shape[0] * shape[1]}: it is damaged, write it again"
        )
    return np.ma.filled(values, np.nan).reshape(shape)
