"""Rays from and to the reference study's database: SQLite files, MariaDB and MySQL."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import pandas as pd

from geometry.arrays import FloatArray
from geometry.errors import InputError
from reconstruct.formats.aas_tables import METRES_IN_DECAMETRE, connected, create_tables, held_columns, select
from reconstruct.formats.gate_table import gate_table
from reconstruct.formats.options import Options
from reconstruct.formats.over_the_top import folded
from reconstruct.formats.text import labview_from_utc, seconds_delta, utc_from_labview
from reconstruct.losses import Loss
from reconstruct.records import Records, join
from reconstruct.sweep_ids import sweep_ids
from reconstruct.sweep_lag import estimate_lead, without_lead

if TYPE_CHECKING:
    import sqlalchemy as sa

ScanType = Literal["LOS", "PPI", "RHI", "DBS", "CTC", "CTD"]

#: Rays that are fetched at once: with 41 gates some 800,000 rows.
CHUNK_RAYS = 20_000

#: Rows that are sent at once.
CHUNK_ROWS = 50_000

_NOTES = (
    "radial speeds turned from negative away to positive away",
    "ranges turned from decametres to metres",
    "times turned from seconds since 1904 to UTC at the middle between start and stop",
)


def read_aas(place: str | Path, options: Options | None = None) -> Records:
    """All rays of a database, or of one scenario; for long campaigns see `aas_chunks`.

    Parameters
    ----------
    place : str or Path
        SQLAlchemy's URL, or an SQLite file.
    options : Options, optional
        `scenario`, `clock_offset_s`, `azimuth` ("estimate" turns it back by the lead that up- against
        down-sweeps show), `mounting`, `instrument`.

    Raises
    ------
    InputError
        If there is no ray, or scenarios have different gates: take one.
    """
    options = options or Options()
    parts = list(aas_chunks(place, options))
    if not parts:
        raise InputError(
            "the database holds no ray"
            + ("" if options.scenario is None else f" of scenario {options.scenario}")
        )
    records = join(parts)
    if options.azimuth == "estimate":
        lead = estimate_lead(records)
        note = (
            f"azimuths turned back by {lead.lead_deg:.2f} +- {lead.std_deg:.2f} deg, the lead that up- "
            "against down-sweeps show"
        )
        records = replace(without_lead(records, lead.lead_deg), notes=(*records.notes, note))
    return records


def aas_chunks(
    place: str | Path, options: Options | None = None, *, rays: int = CHUNK_RAYS
) -> Iterator[Records]:
    """Rays of a database in order, scenario by scenario, in chunks that end where a sweep ends.

    Parameters
    ----------
    place : str or Path
    options : Options, optional
    rays : int
        That are fetched at once; a sweep that is longer is given whole.

    Yields
    ------
    Records
    """
    options = options or Options()
    with connected(place) as connection:
        held = held_columns(connection)
        name = (
            options.instrument
            or str(connection.engine.url.database or "").rpartition("/")[2].partition(".")[0]
        )
        for scenario in _scenarios(connection, held, options.scenario):
            attitude = _attitude(connection, held, scenario)
            yield from _whole_sweeps(_fetched(connection, held, scenario, rays, options, attitude, name))


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
        start = _next_gateway(connection)
        taken = set(_scenarios(connection, held_columns(connection), None)) & set(
            np.unique(records.scan_id).tolist()
        )
        if taken:
            raise InputError(
                f"the database already holds scenario {min(taken)}: give the records another scan_id"
            )
        gateway = np.arange(start, start + records.rays)
        _write_rays(connection, records, gateway, position)
        _write_scenarios(connection, records, gateway, scan_type, pulse_ns, fft_points)


def _scenarios(connection: "sa.Connection", held: dict[str, dict[str, str]], wanted: int | None) -> list[int]:
    """Numbers of the scenarios that have rays."""
    if wanted is not None:
        return [wanted]
    clause, _ = select("control", held["control"])
    import sqlalchemy as sa

    column = clause.c[held["control"]["scn_id"]]
    return [
        int(row[0])
        for row in connection.execute(sa.select(column).distinct().order_by(column))
        if row[0] is not None
    ]


def _attitude(
    connection: "sa.Connection", held: dict[str, dict[str, str]], scenario: int
) -> dict[str, FloatArray]:
    """Times since 1904 and heading, pitch and roll of a scenario's system log; empty where there is none."""
    columns = held.get("system", {})
    if not {"dt", "head", "pitch", "roll"} <= set(columns):
        return {}
    clause, query = select("system", columns)
    frame = pd.DataFrame(
        connection.execute(query.where(clause.c[columns["scn_id"]] == scenario)).mappings().all()
    )
    if frame.empty:
        return {}
    frame = frame[["dt", "head", "pitch", "roll"]].astype(float).dropna().sort_values("dt")
    return {str(name): frame[name].to_numpy() for name in frame.columns} if len(frame) else {}


def _fetched(
    connection: "sa.Connection",
    held: dict[str, dict[str, str]],
    scenario: int,
    rays: int,
    options: Options,
    attitude: dict[str, FloatArray],
    name: str,
) -> Iterator[Records]:
    """Rays of a scenario as they are fetched, some at a time."""
    control, ray_query = select("control", held["control"])
    values, value_query = select("measurement", held["measurement"])
    key, other = control.c[held["control"]["gw_id"]], values.c[held["measurement"]["gw_id"]]
    ray_query = ray_query.where(control.c[held["control"]["scn_id"]] == scenario).order_by(key).limit(rays)
    last: int | None = None
    while True:
        page = ray_query if last is None else ray_query.where(key > last)
        found = _frame(connection, page, held["control"])
        if found.empty:
            return
        last = int(found["gw_id"].iloc[-1])
        within = value_query.where(other >= int(found["gw_id"].iloc[0])).where(other <= last)
        measured = _frame(connection, within, held["measurement"])
        records = _records(found, measured[measured["gw_id"].isin(found["gw_id"])], attitude, options)
        if records.rays:
            yield replace(records, instrument=name).mounted(options.mounting)


def _frame(
    connection: "sa.Connection", query: "sa.Select[tuple[object, ...]]", columns: dict[str, str]
) -> pd.DataFrame:
    """Rows of a query as numbers; a NULL is NaN."""
    streamed = connection.execution_options(stream_results=True, yield_per=CHUNK_ROWS).execute(query)
    parts = [
        [np.array(column, dtype=float) for column in zip(*rows, strict=True)]
        for rows in streamed.partitions()
    ]
    names = list(columns)
    if not parts:
        return pd.DataFrame({name: np.empty(0) for name in names})
    return pd.DataFrame({name: np.concatenate([part[i] for part in parts]) for i, name in enumerate(names)})


def _records(
    control: pd.DataFrame, measured: pd.DataFrame, attitude: dict[str, FloatArray], options: Options
) -> Records:
    """Rays in our convention."""
    known = control[["gw_id", "dt_start", "dt_stop", "azim", "elev"]].notna().all(axis=1)
    listed = measured["gw_id"].unique()
    whole = known & control["gw_id"].isin(listed)
    losses = (
        []
        if whole.all()
        else [Loss("control", "a ray without time, angles or measurement", times=int((~whole).sum()))]
    )
    control = control[whole].drop_duplicates("gw_id").sort_values("gw_id", kind="stable")
    measured = measured[measured["gw_id"].isin(control["gw_id"]) & measured["dist"].notna()]
    grid = gate_table(measured, ray=["gw_id"], gate="dist", values=("radSpeed", "cnr", "disp"))
    control = control[control["gw_id"].isin(grid.first["gw_id"])]
    start, stop = control["dt_start"].to_numpy(dtype=float), control["dt_stop"].to_numpy(dtype=float)
    middle = start + (stop - start) / 2
    azimuth, elevation, notes = folded(control["azim"], control["elev"])
    logged: dict[str, Any] = {
        name: np.interp(middle, attitude["dt"], attitude[own]) if attitude else None
        for name, own in (("heading_deg", "head"), ("pitch_deg", "pitch"), ("roll_deg", "roll"))
    }
    time = utc_from_labview(middle) + seconds_delta(options.clock_offset_s)
    order = np.argsort(time, kind="stable")
    records = Records(
        time_utc=np.sort(time),
        duration_s=stop - start,
        azimuth_deg=azimuth,
        elevation_deg=elevation,
        scan_id=control["scn_id"].to_numpy(dtype=np.intp),
        sweep_id=np.zeros(len(control), dtype=np.intp),
        range_m=np.round(grid.range_m * METRES_IN_DECAMETRE, 6),
        radial_speed_mps=-grid.grids["radSpeed"],
        cnr_db=grid.grids["cnr"],
        spectral_width_mps=grid.grids["disp"] if "disp" in measured else None,
        notes=(*_NOTES, *notes),
        losses=tuple(losses),
        **logged,
    )
    return replace(records.at_rays(order), time_utc=time[order])


def _whole_sweeps(parts: Iterator[Records]) -> Iterator[Records]:
    """The same rays cut where a sweep ends, with sweeps numbered through."""
    rest: Records | None = None
    number = 0
    for part in parts:
        every = part if rest is None else _end_to_end(rest, part)
        every = replace(every, sweep_id=sweep_ids(every.azimuth_deg, every.elevation_deg) + number)
        last = every.sweep_id == every.sweep_id[-1]
        if not np.all(last):
            yield every.at_rays(~last)
        rest, number = (
            replace(every.at_rays(last), losses=()) if not np.all(last) else every,
            int(every.sweep_id[-1]),
        )
    if rest is not None:
        yield rest


def _end_to_end(first: Records, second: Records) -> Records:
    """Two parts as one, without looking at their sweeps."""
    return join([replace(part, sweep_id=np.zeros(part.rays, dtype=np.intp)) for part in (first, second)])


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
    """Rows of control, measurement and system."""
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
