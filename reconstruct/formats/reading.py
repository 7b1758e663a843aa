"""One door to every kind of file: what it is, is found out from its first bytes; a folder is read file by
file.
"""

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Literal, NamedTuple, get_args

from geometry.errors import InputError, UnavailableError
from reconstruct.formats.aas_database import read_aas
from reconstruct.formats.cfradial import read_cfradial
from reconstruct.formats.foreign import foreign
from reconstruct.formats.hpl import read_hpl
from reconstruct.formats.nacelle import read_nacelle, spelled
from reconstruct.formats.options import Options
from reconstruct.formats.plain_csv import read_plain_csv
from reconstruct.formats.text import BLANK, decode, read_bytes, split_lines
from reconstruct.formats.wind_lines import EARLIEST_S
from reconstruct.formats.windscanner import read_windscanner
from reconstruct.losses import Loss, losses_text, merged_losses
from reconstruct.record_tables import read_parquet
from reconstruct.records import Records, join, same_gates
from reconstruct.store import read_store

Kind = Literal["windscanner", "cfradial", "hpl", "nacelle", "csv", "database", "store", "parquet"]

#: What a file is said to be.
LABELS: dict[str, str] = {
    "windscanner": "a WindScanner wind file",
    "cfradial": "netCDF of a scanning lidar (WindCube, CfRadial, ARM)",
    "hpl": "a HALO StreamLine .hpl file",
    "nacelle": "a CSV of a nacelle lidar",
    "csv": "a CSV of rays",
    "database": "a four-table database",
    "store": "a DuckDB store of rays",
    "parquet": "a Parquet table of rays",
}

#: Bytes of a file that are looked at to find out its kind.
LOOKED_AT = 65_536


class Reading(NamedTuple):
    """What a file or folder holds."""

    records: tuple[Records, ...]  # one for each instrument and set of gates
    losses: tuple[Loss, ...]  # files, lines and rays that could not be read, or are of no known kind


def read(place: str | Path, *, kind: Kind | None = None, options: Options | None = None) -> Records:
    """Rays of a file, a folder or a database, as one table.

    Parameters
    ----------
    place : str or Path
        File, folder, or URL of a database as SQLAlchemy writes it.
    kind : str, optional
        In place of the kind that the file shows; of a folder only files that can be read as this kind.
    options : Options, optional
        What the files do not say themselves.

    Returns
    -------
    Records
        `losses` counts what could not be read: a bad file of a folder is among them, the others are read.

    Raises
    ------
    InputError
        If nothing can be read, or there are several instruments or sets of gates (see `read_all`).
    UnavailableError
        If an extra is missing.
    """
    found = read_all(place, kind=kind, options=options)
    if len(found.records) > 1:
        held = "; ".join(
            f"{r.instrument or 'no name'}, {r.gates} gates, {r.rays} rays" for r in found.records
        )
        raise InputError(
            f"{place} holds {len(found.records)} tables ({held}): read one file or instrument at a time"
        )
    return replace(found.records[0], losses=found.losses)


def read_all(place: str | Path, *, kind: Kind | None = None, options: Options | None = None) -> Reading:
    """All tables of a file, a folder or a database, one for each instrument and set of gates; see `read`."""
    options = options or Options()
    if kind is not None and kind not in get_args(Kind):
        raise InputError(f"there is no kind of file {kind!r}: known are {', '.join(get_args(Kind))}")
    if "://" in str(place):
        records = _said(read_aas(str(place), options), "database", kind)
        return Reading((records,), records.losses)
    path = Path(place)
    if path.is_dir():
        return _folder(path, kind, options)
    if not path.is_file():
        raise InputError(f"{path}: there is no such file or folder")
    found = kind or detect(path)
    if found is None or found == "companion":
        raise InputError(f"{path}: {_unknown(path)}")
    records = _said(_read_file(path, found, options), found, kind)
    return Reading((records,), records.losses)


def detect(path: Path) -> Kind | Literal["companion"] | None:
    """What kind of file this is, from its first bytes.

    Returns
    -------
    str or None
        "companion" for files that others need but that hold no rays (scanner and system logs, scan
        schedules); None where it is of no known kind.

    Raises
    ------
    InputError
        If the file is empty or cannot be opened.
    """
    raw = _start(path)
    if raw[:3] == b"CDF" or raw[:8] == b"\x89HDF\r\n\x1a\n":
        return "cfradial"
    if raw[:15] == b"SQLite format 3":
        return "database"
    if raw[8:12] == b"DUCK":
        return "store"
    if raw[:4] == b"PAR1":
        return "parquet"
    return _detect_text(split_lines(decode(raw)))


def _start(path: Path) -> bytes:
    """The first bytes of a file, unpacked if need be."""
    if path.suffix == ".gz":
        return read_bytes(path)[:LOOKED_AT]
    try:
        with path.open("rb") as file:
            raw = file.read(LOOKED_AT)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error})") from error
    return raw if raw.strip(BLANK) else read_bytes(path)


def _detect_text(lines: list[str]) -> Kind | Literal["companion"] | None:
    lines = _written(lines)
    if not lines:
        return None
    head = "\n".join(lines[:20]).lower()
    if "range gate length" in head or "number of gates" in head:
        return "hpl"
    first = lines[0]
    names = {cell.strip().strip('"') for cell in re.split("[,;\t]", first)}
    if {"LOSindex", "RWS"} <= {spelled(name) for name in names}:
        return "nacelle"
    if any(_is_wind(line) for line in lines[:5]):
        return "windscanner"
    other = foreign(lines)
    if other is not None:
        return "companion" if other.rank == "companion" else None
    return "csv" if len(names) > 1 and not any(_is_number(name) for name in names) else None


def _written(lines: list[str]) -> list[str]:
    """The lines that are not blank."""
    return [line for line in lines if line.strip()]


def _is_wind(line: str) -> bool:
    """Whether a line looks like a ray of a WindScanner wind file."""
    fields = line.replace(",", ".").strip().rstrip(";").split(";")
    for header in (8, 6):
        gates = len(fields) - header
        if gates > 0 and gates % 4 == 0 and _is_number(fields[header - 4]):
            return float(fields[header - 4]) > EARLIEST_S
    return False


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _folder(folder: Path, kind: Kind | None, options: Options) -> Reading:
    """Every file of a folder; what cannot be read is a loss."""
    tables: list[Records] = []
    losses: list[Loss] = []
    for path in sorted(p for p in folder.iterdir() if p.is_file() and not p.name.startswith(".")):
        try:
            found = detect(path)
            if found == "companion" or (kind is not None and found is not None and found != kind):
                continue
            if found is None:
                losses.append(Loss(path.name, _unknown(path)))
                continue
            tables.append(_said(_read_file(path, found, options), found, kind))
        except UnavailableError:
            raise
        except InputError as error:
            losses.append(Loss(path.name, str(error).removeprefix(f"{path}: ")))
    groups: list[list[Records]] = []
    for table in tables:
        same = (g for g in groups if g[0].instrument == table.instrument and same_gates(g[0], table))
        group = next(same, None)
        groups.append([table]) if group is None else group.append(table)
    if not groups:
        raise InputError(
            f"{folder}: no file could be read" + (f":\n{losses_text(losses)}" if losses else ": it is empty")
        )
    joined = tuple(join(group) for group in groups)
    return Reading(joined, merged_losses([*losses, *(loss for table in joined for loss in table.losses)]))


def _read_file(path: Path, found: str, options: Options) -> Records:
    """Rays of a file; an error names it."""
    try:
        return _READERS[found](path, options)
    except InputError as error:
        if str(path) in str(error):
            raise
        raise InputError(f"{path}: {error}") from error


def _unknown(path: Path) -> str:
    """What a file is that cannot be read, and what to do."""
    other = foreign(_written(split_lines(decode(_start(path)))))
    if other is not None:
        return f"holds no rays: it is {other.text}"
    return (
        f"is of no kind that is known: give its kind ({', '.join(get_args(Kind))}), and for a CSV its columns"
    )


def _said(records: Records, found: str, asked: Kind | None) -> Records:
    """Records that say what their file was taken for."""
    note = (
        f"read, as asked, as {LABELS[found]}" if asked else f"recognised as {LABELS[found]}: `kind` overrules"
    )
    return replace(records, notes=(note, *records.notes))


def _store(path: Path, options: Options) -> Records:
    return read_store(path, instrument=options.instrument).mounted(options.mounting)


def _parquet(path: Path, options: Options) -> Records:
    return read_parquet(path).mounted(options.mounting)


_READERS: dict[str, Callable[[Path, Options], Records]] = {
    "windscanner": read_windscanner,
    "cfradial": read_cfradial,
    "hpl": read_hpl,
    "nacelle": read_nacelle,
    "csv": read_plain_csv,
    "database": read_aas,
    "store": _store,
    "parquet": _parquet,
}
