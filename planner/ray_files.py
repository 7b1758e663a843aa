"""The measured rays of a campaign: found, read part by part, brought to one gate and to true angles."""

from collections.abc import Callable, Iterator
from dataclasses import fields, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from geometry.errors import InputError
from geometry.head import Mounting
from planner.campaign import Kind, RayInput
from planner.files.yaml_campaign import PATTERN
from planner.places import Places
from planner.scan_layout import ScanLayout
from reconstruct.records import Records

SUFFIXES: dict[str, Kind] = {
    ".csv": "csv", ".parquet": "parquet", ".duckdb": "store", ".hpl": "hpl", ".nc": "cfradial", ".cdf": "cfradial",
    ".txt": "windscanner", ".sqlite": "database", ".db": "database",
}


class Part(NamedTuple):
    """A piece of the measured rays that fits in memory."""

    name: str
    load: Callable[[], Records]
    fingerprint: str  # changes when the piece does


def parts_of(item: RayInput) -> Iterator[Part]:
    """The pieces of an input, in order: a file each, or the chunks of a store.

    Raises
    ------
    InputError
        If there is nothing to read, or the kind of a file is not known.
    """
    if item.url is not None:
        raise InputError(f"inputs of scan '{item.scan}': reading a database by its url is not possible here")
    for path in _files(str(item.path)):
        kind = _kind(path, item.kind)
        stat = path.stat()
        mark = f"{path.name} {stat.st_size} {stat.st_mtime_ns}"
        yield Part(path.name, lambda path=path, kind=kind: _read(path, kind, item), mark)  # type: ignore[misc]


def at_gate(records: Records, item: RayInput, layout: ScanLayout, places: Places) -> Records:
    """One gate of the records, with angles that count from true north and the horizontal, and the clock set right."""
    mounting = _mounting(item, layout, places)
    seconds = item.offsets.clock_s
    if seconds:
        moved = records.time_utc + np.timedelta64(round(seconds * 1e9), "ns")
        records = replace(records, time_utc=moved, notes=(*records.notes, f"clock moved by {seconds:g} s"))
    records = records.mounted(mounting)
    wanted_m = item.gate_m or layout.target_range_m
    if wanted_m is None:
        raise InputError(f"scan '{layout.name}' has no target: give inputs' gate_m, the range that is wanted")
    gate = records.gate_at(wanted_m)
    return records.at_gates(slice(gate, gate + 1))


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
        anchor = Path(name).anchor
        root, rest = (Path(anchor), name[len(anchor) :]) if anchor else (Path(), name)
        found = sorted(item for item in root.glob(rest) if item.is_file())
    elif path.is_dir():
        found = sorted(item for item in path.iterdir() if item.is_file() and item.suffix.lower() in SUFFIXES)
    else:
        found = [path]
    if not found:
        raise InputError(f"{name}: no file of rays is there")
    return found


def _kind(path: Path, asked: Kind) -> Kind:
    kind = SUFFIXES.get(path.suffix.lower()) if asked == "auto" else asked
    if kind is None:
        raise InputError(f"{path}: the ending does not say what kind of file it is; give `kind` of the input")
    return kind


def _read(path: Path, kind: Kind, item: RayInput) -> Records:
    from reconstruct.record_tables import from_long, read_parquet

    if kind == "parquet":
        return read_parquet(path)
    if kind == "csv" and item.columns is None:
        import pandas as pd

        try:
            frame = pd.read_csv(path, parse_dates=["time_utc"], date_format="ISO8601")
        except (OSError, ValueError) as error:
            raise InputError(f"{path}: cannot be read as CSV ({error})") from error
        return from_long(frame)
    raise InputError(f"{path}: files of kind {kind} cannot be read here")


SAVED = tuple(field.name for field in fields(Records) if field.name not in ("notes", "losses"))
