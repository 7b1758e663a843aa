"""Rays to the reference study's database: SQLite files, MariaDB and MySQL."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from geometry.arrays import FloatArray
from geometry.errors import InputError
from reconstruct.formats.aas_tables import (
    CHUNK_ROWS,
    METRES_IN_DECAMETRE,
    connected,
    create_tables,
    held_columns,
    scenario_numbers,
    select,
)
from reconstruct.formats.text import labview_from_utc
from reconstruct.records import Records

if TYPE_CHECKING:
    import sqlalchemy as sa

ScanType = Literal["LOS", "PPI", "RHI", "DBS", "CTC", "CTD"]


def write_aas(
    records: Records,
    place: str | Path,
    *,
    scan_type: ScanType = "PPI",
    pulse_ns: float = 200.0,
    fft_points: int = 64,
    position: tuple[float, float, float] | None = None,
) -> None:
    """Append records to a database as one scenario for each of their scan ids; all of them or none.

    Parameters
    ----------
    records : Records
    place : str or Path
        SQLAlchemy's URL, or an SQLite file, which is made where it is not there.
    scan_type, pulse_ns, fft_points
        What `scenario` says.
    position : (float, float, float), optional
        Latitude, longitude [degrees] and altitude [m] for `system`.

    Raises
    ------
    InputError
        If a scenario of that number is there already.
    """
    if not records.rays:
        return
    with connected(place, write=True) as connection:
        create_tables(connection)
        append_aas(
            connection,
            records,
            scan_type=scan_type,
            pulse_ns=pulse_ns,
            fft_points=fft_points,
            position=position,
        )


def append_aas(
    connection: "sa.Connection",
    records: Records,
    *,
    scan_type: ScanType,
    pulse_ns: float,
    fft_points: int,
    position: tuple[float, float, float] | None = None,
) -> None:
    """As `write_aas`, in the transaction of a connection to a database that has the tables."""
    taken = set(scenario_numbers(connection, held_columns(connection), None)) & set(
        np.unique(records.scan_id).tolist()
    )
    if taken:
        raise InputError(
            f"the database already holds scenario {min(taken)}: give the records another scan_id"
        )
    start = _next_gateway(connection)
    gateway = np.arange(start, start + records.rays)
    _write_rays(connection, records, gateway, position)
    _write_measurements(connection, records, gateway)
    _write_scenarios(connection, records, gateway, scan_type, pulse_ns, fft_points)


def _next_gateway(connection: "sa.Connection") -> int:
    import sqlalchemy as sa

    clause, _ = select("control", {"gw_id": "gw_id"})
    highest = connection.execute(sa.select(sa.func.max(clause.c.gw_id))).scalar()
    return 1 if highest is None else int(highest) + 1


def _write_rays(
    connection: "sa.Connection",
    records: Records,
    gateway: "np.ndarray[tuple[int], np.dtype[np.int64]]",
    position: tuple[float, float, float] | None,
) -> None:
    """Rows of control and system."""
    duration = np.nan_to_num(records.duration_s)
    middle = labview_from_utc(records.time_utc)
    start, stop = middle - duration / 2, middle + duration / 2
    gates = np.full(records.rays, records.gates)
    columns: list[Any] = [
        records.scan_id,
        gateway,
        start,
        stop,
        records.azimuth_deg,
        records.elevation_deg,
        gates,
        duration * 1e3,
    ]
    _send(
        connection,
        "control",
        ("scn_id", "gw_id", "dt_start", "dt_stop", "azim", "elev", "nbRG", "acc"),
        columns,
    )
    if position or records.heading_deg is not None:
        blank = np.full(records.rays, np.nan)
        where = [np.full(records.rays, value) for value in position or (np.nan,) * 3]
        logs = [blank if a is None else a for a in (records.heading_deg, records.pitch_deg, records.roll_deg)]
        _send(
            connection,
            "system",
            ("scn_id", "dt", "lati", "longi", "alti", "head", "pitch", "roll"),
            [records.scan_id, stop, *where, *logs],
        )


def _write_measurements(
    connection: "sa.Connection", records: Records, gateway: "np.ndarray[tuple[int], np.dtype[np.int64]]"
) -> None:
    """Rows of measurement, some rays at a time; the sign and the unit of the tables."""
    decametres = np.round(records.range_m / METRES_IN_DECAMETRE, 7)
    step = max(CHUNK_ROWS * 10 // max(records.gates, 1), 1)
    for first in range(0, records.rays, step):
        part = slice(first, first + step)
        count = len(gateway[part])
        width = records.spectral_width_mps
        grids = [
            -records.radial_speed_mps[part],
            records.cnr_db[part],
            np.full((count, records.gates), np.nan) if width is None else width[part],
        ]
        rows = [
            np.repeat(gateway[part], records.gates),
            np.tile(decametres, count),
            *(grid.ravel() for grid in grids),
        ]
        _send(connection, "measurement", ("gw_id", "dist", "radSpeed", "cnr", "disp"), rows)


def _write_scenarios(
    connection: "sa.Connection",
    records: Records,
    gateway: "np.ndarray[tuple[int], np.dtype[np.int64]]",
    scan_type: ScanType,
    pulse_ns: float,
    fft_points: int,
) -> None:
    seconds = labview_from_utc(records.time_utc)
    half = np.nan_to_num(records.duration_s) / 2
    for scenario in np.unique(records.scan_id):
        rays = records.scan_id == scenario
        row = [
            scenario,
            scan_type,
            (seconds - half)[rays].min(),
            (seconds + half)[rays].max(),
            gateway[rays].min(),
            gateway[rays].max(),
        ]
        names = ("scn_id", "scn_type", "dt_start", "dt_stop", "gw_start_id", "gw_stop_id", "pulse", "fft")
        _send(connection, "scenario", names, [[value] for value in (*row, pulse_ns, fft_points)])


def _send(
    connection: "sa.Connection",
    table: str,
    names: Sequence[str],
    columns: Sequence[Any],
) -> None:
    """Insert columns as rows, with the driver's own bulk insert; NaN becomes NULL."""
    mark = "?" if connection.dialect.paramstyle == "qmark" else "%s"
    quote = connection.dialect.identifier_preparer.quote_identifier
    text = (
        f"INSERT INTO {quote(table)} ({', '.join(map(quote, names))}) VALUES "
        f"({', '.join([mark] * len(names))})"
    )
    rows = [tuple(row) for row in zip(*(_plain(column) for column in columns), strict=True)]
    for first in range(0, len(rows), CHUNK_ROWS):
        connection.exec_driver_sql(text, rows[first : first + CHUNK_ROWS])


def _plain(column: Sequence[object] | FloatArray) -> list[object]:
    """Python's own numbers, None for NaN."""
    values = np.asarray(column)
    if values.dtype.kind != "f":
        return list(values.tolist())
    out = values.astype(object)
    out[~np.isfinite(values)] = None
    return list(out)
