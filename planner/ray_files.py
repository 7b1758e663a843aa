"""The measured rays of a campaign: found, read part by part, brought to one gate and to true angles."""

import os
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from geometry.errors import InputError
from geometry.head import Mounting
from planner.campaign import Columns, RayInput
from planner.files.yaml_campaign import PATTERN
from planner.places import Places
from planner.scan_layout import ScanLayout
from reconstruct.formats.options import ColumnMap, Options
from reconstruct.formats.reading import detect, read
from reconstruct.records import Records

# Columns that a plain CSV is taken to have under our names where nothing else is said.
OWN_COLUMNS = ("time_utc", "azimuth_deg", "elevation_deg", "range_m", "radial_speed_mps")


class Part(NamedTuple):
    """A piece of the measured rays that fits in memory."""

    load: Callable[[], Records]  # raises InputError where the piece cannot be read
    fingerprint: str  # changes when the piece does
    share: float  # of the input that is done with it, 0 to 1
    alone: bool  # nothing else could be read in its place


def parts_of(item: RayInput, layout: ScanLayout, places: Places, *, rays: int) -> Iterator[Part]:
    """The pieces of an input, in order: a file each, or the chunks of a store or database.

    Parameters
    ----------
    item
        Where the rays are.
    layout, places
        Of its scan: a store gives the gate that is wanted alone.
    rays
        Of a store or database that are read at once.

    Raises
    ------
    InputError
        If there is nothing to read.
    """
    if item.url is not None:
        yield from _chunked(_database(item.url, item, rays))
        return
    paths = _files(str(item.path))
    for number, path in enumerate(paths):
        kind = detect(path) if item.kind == "auto" else item.kind
        if kind == "database":
            yield from _chunked(_database(path, item, rays))
        elif kind == "store":
            yield from _chunked(_store(path, item, _wanted_head_range_m(item, layout, places), rays))
        elif kind != "companion":
            stat = path.stat()
            mark = f"{path.name} {stat.st_size} {stat.st_mtime_ns}"
            load = _loader(path, item)
            yield Part(load, mark, (number + 1) / len(paths), len(paths) == 1)


def at_gate(records: Records, item: RayInput, layout: ScanLayout, places: Places) -> Records:
    """One gate of the records, with angles from true north and the horizontal, and the clock set right."""
    seconds = item.offsets.clock_s
    if seconds:
        moved = records.time_utc + np.timedelta64(round(seconds * 1e9), "ns")
        records = replace(records, time_utc=moved, notes=(*records.notes, f"clock moved by {seconds:g} s"))
    records = records.mounted(_mounting(item, layout, places))
    gate = records.gate_at(_wanted_m(item, layout))
    return records.at_gates(slice(gate, gate + 1))


def _wanted_m(item: RayInput, layout: ScanLayout) -> float:
    """True range of the gate that is wanted [m]."""
    wanted_m = item.gate_m or layout.target_range_m
    if wanted_m is None:
        raise InputError(
            f"scan '{layout.name}' has no target: give its input's gate_m, the range that is wanted"
        )
    return wanted_m


def _wanted_head_range_m(item: RayInput, layout: ScanLayout, places: Places) -> float:
    """The same as the instrument states it."""
    return float(_mounting(item, layout, places).head_range_m(_wanted_m(item, layout)))


def _mounting(item: RayInput, layout: ScanLayout, places: Places) -> Mounting:
    """The site's mounting with the input's own offsets on top; of true angles the offsets alone."""
    stands = places.mounting(layout.lidar) if item.angles == "head" else Mounting()
    more = item.offsets
    return replace(
        stands,
        azimuth_offset_deg=stands.azimuth_offset_deg + more.azimuth_deg,
        elevation_offset_deg=stands.elevation_offset_deg + more.elevation_deg,
        range_offset_m=stands.range_offset_m + more.range_m,
    )


def _files(name: str) -> list[Path]:
    """The files that a path stands for: itself, those in a folder, or those of a pattern."""
    path = Path(name)
    if any(letter in name for letter in PATTERN):
        anchor = path.anchor
        root, rest = (Path(anchor), name[len(anchor) :]) if anchor else (Path(), name)
        found = sorted(item for item in root.glob(rest) if item.is_file())
    elif path.is_dir():
        found = sorted(item for item in path.iterdir() if item.is_file() and not item.name.startswith("."))
    else:
        found = [path]
    if not found:
        raise InputError(f"{name}: no file of rays is there")
    return found


def _loader(path: Path, item: RayInput) -> Callable[[], Records]:
    kind = None if item.kind == "auto" else item.kind
    return lambda: read(path, kind=kind, options=_options(item))


def _options(item: RayInput, scenario: int | None = None) -> Options:
    return Options(
        instrument=item.instrument,
        stamp=item.stamp,
        azimuth=item.azimuth,
        columns=None if item.columns is None else _column_map(item.columns),
        scenario=scenario,
    )


def _column_map(columns: Columns) -> ColumnMap:
    own = {name: name for name in OWN_COLUMNS if name not in columns.constants}
    return ColumnMap(
        names=own | columns.names,
        speed_positive=columns.speed_positive,
        separator=columns.separator,
        decimal=columns.decimal,
        time_unit=columns.time_unit,
        factors=columns.factors,
        constants=columns.constants,
    )


def _database(place: str | Path, item: RayInput, rays: int) -> Iterator[Records]:
    from reconstruct.formats.aas_database import aas_chunks

    known = (
        os.path.expandvars(place) if isinstance(place, str) else place
    )  # a password need not stand in the file
    for scenario in item.scenarios or (None,):
        yield from aas_chunks(known, _options(item, scenario), rays=rays)


def _store(path: Path, item: RayInput, range_m: float, rays: int) -> Iterator[Records]:
    from reconstruct.store import store_chunks

    yield from store_chunks(path, instrument=item.instrument, range_m=range_m, values=rays)


def _chunked(chunks: Iterator[Records]) -> Iterator[Part]:
    """Chunks as parts; how many there will be is not known."""
    for number, chunk in enumerate(chunks):
        ends = f"{chunk.time_utc[0]} {chunk.time_utc[-1]}" if chunk.rays else ""
        mark = f"{chunk.rays} {chunk.gates} {ends} {np.nansum(chunk.radial_speed_mps)!r}"
        yield Part(lambda chunk=chunk: chunk, mark, 1 - 1 / (number + 2), False)  # type: ignore[misc]
