"""The measured rays of a campaign: found, read part by part, brought to one gate and to true angles."""

import os
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from geometry.errors import InputError
from planner.campaign import Columns, RayInput
from planner.files.yaml_campaign import PATTERN
from planner.nouns import made_of
from planner.places import Places
from planner.pointing_log import mounting_of, pointed
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
    whole: bool  # no pass goes on in the next piece


def parts_of(
    item: RayInput, layout: ScanLayout, places: Places, range_m: float | None, *, rays: int
) -> Iterator[Part]:
    """The pieces of an input, in order: a file each, or the chunks of a store or database.

    Parameters
    ----------
    item
        Where the rays are.
    layout, places
        Of its scan.
    range_m
        True range of the gate that is wanted [m]: a store gives it alone. None: every gate.
    rays
        Of a store or database that are read at once.

    Raises
    ------
    InputError
        If there is nothing to read.
    """
    head_m = None if range_m is None else float(mounting_of(item, layout, places).head_range_m(range_m))
    if item.url is not None:
        yield from _chunked(_database(item.url, item, rays, head_m))
        return
    paths = _files(str(item.path))
    for number, path in enumerate(paths):
        kind = _kind(path) if item.kind == "auto" else item.kind
        if kind == "database":
            yield from _chunked(_database(path, item, rays, head_m))
        elif kind == "store":
            yield from _chunked(_store(path, item, head_m, rays))
        elif kind != "companion":
            stat = path.stat()
            mark = f"{path.name} {stat.st_size} {stat.st_mtime_ns}"
            load = _loader(path, item)
            yield Part(load, mark, (number + 1) / len(paths), len(paths) == 1, False)


def _kind(path: Path) -> str | None:
    """What a file is; None where it cannot be found out: whoever loads the piece says why, and goes on."""
    try:
        return detect(path)
    except InputError:
        return None


def at_gate(
    records: Records, item: RayInput, layout: ScanLayout, places: Places, range_m: float | None
) -> Records:
    """The gate at a true range, with angles from true north and the horizontal, and the clock set right.

    Without a range every gate is left. A nearest gate that is far away is told in the notes.
    """
    return gate_of(pointed(records, item, layout, places).records, layout, range_m)


def gate_of(records: Records, layout: ScanLayout, range_m: float | None) -> Records:
    """The gate nearest to a true range, or all of them; a nearest gate that is far away is told in the notes."""
    if range_m is None:
        return records
    gate = records.gate_at(range_m)
    off_m = float(records.range_m[gate]) - range_m
    if abs(off_m) > _far_m(records, layout):
        told = f"the nearest gate is at {records.range_m[gate]:.1f} m, {off_m:+.1f} m from the one that is wanted"
        records = replace(records, notes=(*records.notes, told))
    return records.at_gates(slice(gate, gate + 1))


def _far_m(records: Records, layout: ScanLayout) -> float:
    """Half the spacing of the gates, or half a probe: beyond it another piece of air is measured [m]."""
    spacing_m = float(np.median(np.diff(records.range_m))) if records.gates > 1 else 0.0
    return max(spacing_m, layout.probe.length_m) / 2 + 1e-6


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
    columns = None if item.columns is None else _column_map(item.columns)
    return made_of(item, Options, columns=columns, scenario=scenario)


def _column_map(columns: Columns) -> ColumnMap:
    own = {name: name for name in OWN_COLUMNS if name not in columns.constants}
    return made_of(columns, ColumnMap, names=own | columns.names)


def _database(place: str | Path, item: RayInput, rays: int, range_m: float | None) -> Iterator[Records]:
    from reconstruct.formats.aas_database import CHUNK_RAYS, aas_chunks

    known = (
        os.path.expandvars(place) if isinstance(place, str) else place
    )  # a password need not stand in the file
    for scenario in item.scenarios or (None,):
        fetched = rays if range_m is not None else min(rays, CHUNK_RAYS)
        yield from aas_chunks(known, _options(item, scenario), rays=fetched, range_m=range_m)


def _store(path: Path, item: RayInput, range_m: float | None, rays: int) -> Iterator[Records]:
    from reconstruct.store import store_chunks

    yield from store_chunks(path, instrument=item.instrument, range_m=range_m, values=rays)


def _chunked(chunks: Iterator[Records]) -> Iterator[Part]:
    """Chunks as parts; how many there will be is not known."""
    for number, chunk in enumerate(chunks):
        ends = f"{chunk.time_utc[0]} {chunk.time_utc[-1]}" if chunk.rays else ""
        mark = f"{chunk.rays} {chunk.gates} {ends} {np.nansum(chunk.radial_speed_mps)!r}"
        yield Part(lambda chunk=chunk: chunk, mark, 1 - 1 / (number + 2), False, True)  # type: ignore[misc]
