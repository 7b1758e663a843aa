"""Rays from the reference study's database: SQLite files, MariaDB and MySQL."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from geometry.arrays import FloatArray, IntArray
from geometry.errors import InputError
from reconstruct.formats.aas_tables import (
    CHUNK_ROWS,
    METRES_IN_DECAMETRE,
    connected,
    held_columns,
    scenario_numbers,
    select,
)
from reconstruct.formats.gate_table import gate_table
from reconstruct.formats.options import Options
from reconstruct.formats.over_the_top import folded
from reconstruct.formats.text import seconds_delta, utc_from_labview
from reconstruct.formats.time_order import time_order
from reconstruct.formats.wind_lines import EARLIEST_S, LATEST_S, LONGEST_RAY_S
from reconstruct.losses import Loss, losses_text, merged_losses
from reconstruct.records import Records, join
from reconstruct.sweep_ids import sweep_ids
from reconstruct.sweep_lag import estimate_lead, evened, without_lead

if TYPE_CHECKING:
    import sqlalchemy as sa

#: Rays that are fetched at once: with 41 gates some 800,000 rows.
CHUNK_RAYS = 20_000

#: What a gate has.
QUANTITIES = ("radSpeed", "cnr", "disp")

#: Measurements that show where the gates are, and how near to one is on it [decametre].
LOOKED_AT, SAME_GATE = 2_000, 0.005

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
        even, _ = evened(records)
        lead = estimate_lead(even)
        note = (
            f"azimuths turned back by {lead.lead_deg:.2f} +- {lead.std_deg:.2f} deg, the lead that up- "
            "against down-sweeps show"
        )
        records = replace(without_lead(even, lead.lead_deg), notes=(*records.notes, note))
    return records


def aas_chunks(
    place: str | Path,
    options: Options | None = None,
    *,
    rays: int = CHUNK_RAYS,
    range_m: float | None = None,
) -> Iterator[Records]:
    """Rays of a database in order, scenario by scenario, in chunks that end where a sweep ends if one ends in them.

    Parameters
    ----------
    place : str or Path
    options : Options, optional
    rays : int
        That are fetched at once; no chunk is longer than twice as many. A sweep that is longer is cut: a stare
        is one that never ends. Its parts keep its number.
    range_m : float, optional
        Only the gate that is nearest to this range, as the instrument states it, in the first rays of each
        scenario [m]: nothing else is sent.

    Yields
    ------
    Records
        Sweeps are numbered through within a scenario.
    """
    options = options or Options()
    with connected(place) as connection:
        held = held_columns(connection)
        name = (
            options.instrument
            or str(connection.engine.url.database or "").rpartition("/")[2].partition(".")[0]
        )

        def every() -> Iterator[Records]:
            for scenario in scenario_numbers(connection, held, options.scenario):
                attitude = _attitude(connection, held, scenario)
                fetched = _fetched(connection, held, scenario, rays, options, attitude, name, range_m)
                yield from _whole_sweeps(fetched, rays)

        yield from _with_rays(every(), _nameless_values(connection, held["measurement"]))


def _with_rays(parts: Iterator[Records], untold: list[Loss]) -> Iterator[Records]:
    """The parts that have rays; what the others lost is told with the next of them, or with the last.

    Raises
    ------
    InputError
        If something was lost and there is no part to tell it with.
    """
    held: Records | None = None
    for part in parts:
        if not part.rays:
            untold = [*untold, *part.losses]
            continue
        if held is not None:
            yield held
        held, untold = replace(part, losses=merged_losses([*untold, *part.losses])), []
    if held is not None:
        yield replace(held, losses=merged_losses([*held.losses, *untold]))
    elif untold:
        raise InputError(f"the database holds no ray that can be used:\n{losses_text(merged_losses(untold))}")


def _nameless_values(connection: "sa.Connection", columns: dict[str, str]) -> list[Loss]:
    """Values that belong to no ray, in any scenario."""
    import sqlalchemy as sa

    clause, _ = select("measurement", columns)
    key = clause.c[columns["gw_id"]]
    count = int(
        connection.execute(sa.select(sa.func.count()).select_from(clause).where(key.is_(None))).scalar_one()
    )
    return [Loss("measurement", "a value without a gw_id", times=count)] if count else []


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
    frame = frame[["dt", "head", "pitch", "roll"]].apply(pd.to_numeric, errors="coerce").astype(float)
    frame = frame.dropna().sort_values("dt")
    frame["head"] = np.unwrap(frame["head"], period=360.0)  # between 359 and 1 degree lies north, not south
    return {str(name): frame[name].to_numpy() for name in frame.columns} if len(frame) else {}


def _fetched(
    connection: "sa.Connection",
    held: dict[str, dict[str, str]],
    scenario: int,
    rays: int,
    options: Options,
    attitude: dict[str, FloatArray],
    name: str,
    range_m: float | None,
) -> Iterator[Records]:
    """Rays of a scenario as they are fetched, some at a time; of a page without a usable ray only what was lost."""
    control, ray_query = select("control", held["control"])
    values, value_query = select("measurement", held["measurement"])
    key, other = control.c[held["control"]["gw_id"]], values.c[held["measurement"]["gw_id"]]
    ray_query = ray_query.where(control.c[held["control"]["scn_id"]] == scenario)
    nameless = len(connection.execute(ray_query.where(key.is_(None))).all())
    untold = [Loss("control", "a ray without a gw_id", times=nameless)] if nameless else []
    ray_query = ray_query.where(key.is_not(None)).order_by(key).limit(rays)
    last: int | None = None
    gate: float | None = None
    while True:
        page = ray_query if last is None else ray_query.where(key > last)
        found = _frame(connection, page, held["control"])
        if found.empty:
            return
        last = int(found["gw_id"].iloc[-1])
        within = value_query.where(other >= int(found["gw_id"].iloc[0])).where(other <= last)
        if range_m is not None:
            gate = _nearest_gate(connection, within, range_m) if gate is None else gate
            distance = values.c[held["measurement"]["dist"]]
            within = within.where(distance >= gate - SAME_GATE).where(distance <= gate + SAME_GATE)
        measured = _frame(connection, within, held["measurement"])
        records = _records(found, measured[measured["gw_id"].isin(found["gw_id"])], attitude, options)
        losses = merged_losses([*records.losses, *untold])
        untold = []
        yield replace(records, instrument=name, losses=losses).mounted(options.mounting)


def _nearest_gate(
    connection: "sa.Connection", rows: "sa.Select[tuple[object, ...]]", range_m: float
) -> float:
    """Distance [decametre] of the gate that is nearest to a range, among the first rows of a query."""
    found = connection.execute(rows.limit(LOOKED_AT)).mappings().all()
    listed = [float(row["dist"]) for row in found if row["dist"] is not None]
    wanted = range_m / METRES_IN_DECAMETRE
    return min(listed, key=lambda distance: abs(distance - wanted), default=wanted)


def _frame(
    connection: "sa.Connection", query: "sa.Select[tuple[object, ...]]", columns: dict[str, str]
) -> pd.DataFrame:
    """Rows of a query as numbers; a NULL, a text that is no number and a value without end are NaN.

    `_wrong` counts in each row those of the gate's quantities that came and are no number.
    """
    streamed = connection.execution_options(stream_results=True, yield_per=CHUNK_ROWS).execute(query)
    names, parts = list(columns), []
    for rows in streamed.partitions():
        came = dict(zip(names, zip(*rows, strict=True), strict=True))
        numbers = {name: _numbers(column) for name, column in came.items()}
        wrong = [_no_number(came[name], numbers[name]) for name in QUANTITIES if name in came]
        parts.append(pd.DataFrame({**numbers, "_wrong": np.sum(wrong, axis=0) if wrong else 0}))
    return (
        pd.concat(parts, ignore_index=True)
        if parts
        else pd.DataFrame(columns=[*names, "_wrong"], dtype=float)
    )


def _no_number(column: Sequence[object], numbers: FloatArray) -> IntArray:
    """(row,) 1 where something came that is no number, a NULL being nothing."""
    out = np.zeros(len(numbers), dtype=np.intp)
    missing = np.flatnonzero(np.isnan(numbers)).tolist()
    out[missing] = [column[row] is not None for row in missing]
    return out


def _numbers(column: Sequence[object]) -> FloatArray:
    """A column as numbers; NaN where it holds none."""
    try:
        values = np.array(column, dtype=float)
    except (TypeError, ValueError):  # SQLite takes a text in any column
        values = np.array(pd.to_numeric(np.array(column, dtype=object), errors="coerce"), dtype=float)
    return np.where(np.isfinite(values), values, np.nan)


def _usable(control: pd.DataFrame, measured: pd.DataFrame) -> tuple[pd.DataFrame, pd.DataFrame, list[Loss]]:
    """Rays with a time, angles and measurements, in the order of time, and what is left out."""
    lasts = control["dt_stop"] - control["dt_start"]
    sound = control[["dt_start", "dt_stop", "azim", "elev"]].notna().all(axis=1)
    sound &= control["dt_start"].between(EARLIEST_S, LATEST_S) & lasts.between(0.0, LONGEST_RAY_S)
    sound &= control["elev"].abs() <= 360.0
    sound &= control["gw_id"].isin(measured["gw_id"].unique())
    ranged = measured["dist"] >= 0
    first = ~control["gw_id"].duplicated()
    rules = (
        ("control", "a ray without time, angles or measurement", int((~sound).sum())),
        ("control", "a ray with the gw_id of one before", int((sound & ~first).sum())),
        ("measurement", "a value without a distance", int((~ranged).sum())),
        ("measurement", "a speed, CNR or width that is no number", int(measured["_wrong"].sum())),
    )
    losses = [Loss(table, text, times=times) for table, text, times in rules if times]
    control, measured = control[sound & first], measured[ranged]
    control = control[control["gw_id"].isin(measured["gw_id"].unique())]
    control = control.sort_values("gw_id", kind="stable")
    middle = (control["dt_start"] + control["dt_stop"]).to_numpy(dtype=float) / 2
    sorted_ = time_order(utc_from_labview(middle), "control")
    control = control.iloc[sorted_.order]
    return control, measured[measured["gw_id"].isin(control["gw_id"])], [*losses, *sorted_.losses]


def _records(
    control: pd.DataFrame, measured: pd.DataFrame, attitude: dict[str, FloatArray], options: Options
) -> Records:
    """Rays in our convention."""
    control, measured, losses = _usable(control, measured)
    grid = gate_table(measured, ray=["gw_id"], gate="dist", values=QUANTITIES)
    if grid.doubles:
        losses.append(Loss("measurement", "a gw_id and distance that come twice", times=grid.doubles))
    place = np.searchsorted(grid.first["gw_id"].to_numpy(dtype=float), control["gw_id"].to_numpy(dtype=float))
    grids = {name: values[place] for name, values in grid.grids.items()}
    start, stop = control["dt_start"].to_numpy(dtype=float), control["dt_stop"].to_numpy(dtype=float)
    middle = start + (stop - start) / 2
    azimuth, elevation, notes = folded(control["azim"], control["elev"])
    logged: dict[str, Any] = {
        name: np.interp(middle, attitude["dt"], attitude[own]) if attitude else None
        for name, own in (("heading_deg", "head"), ("pitch_deg", "pitch"), ("roll_deg", "roll"))
    }
    time = utc_from_labview(middle) + seconds_delta(options.clock_offset_s)
    return Records(
        time_utc=time,
        duration_s=stop - start,
        azimuth_deg=azimuth,
        elevation_deg=elevation,
        scan_id=control["scn_id"].to_numpy(dtype=np.intp),
        sweep_id=np.zeros(len(control), dtype=np.intp),
        range_m=np.round(grid.range_m * METRES_IN_DECAMETRE, 6),
        radial_speed_mps=-grids["radSpeed"],
        cnr_db=grids["cnr"],
        spectral_width_mps=grids["disp"] if "disp" in measured else None,
        notes=(*_NOTES, *notes),
        losses=tuple(losses),
        **logged,
    )


def _whole_sweeps(parts: Iterator[Records], rays: int) -> Iterator[Records]:
    """The same rays cut where a sweep ends, with sweeps numbered through; no sweep longer than `rays` is held."""
    rest: Records | None = None
    number = 0
    for part in parts:
        if not part.rays:
            yield part
            continue
        every = part if rest is None else _end_to_end(rest, part)
        every = replace(every, sweep_id=sweep_ids(every.azimuth_deg, every.elevation_deg) + number)
        number = int(every.sweep_id[-1])
        held = np.flatnonzero(every.sweep_id == number)
        if len(held) > rays:  # two rays stay: they show which way the sweep goes on
            held = held[-2:]
        if held[0] > 0:
            yield every.at_rays(slice(0, held[0]))
            every = replace(every.at_rays(held), losses=())
        rest = every
    if rest is not None:
        yield rest


def _end_to_end(first: Records, second: Records) -> Records:
    """Two parts as one, without looking at their sweeps."""
    return join([replace(part, sweep_id=np.zeros(part.rays, dtype=np.intp)) for part in (first, second)])
