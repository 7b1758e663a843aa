"""The header of a HALO StreamLine file: its lines, and where its gates stand.

Versions differ in the decimal sign, in "No. of rays" against "No. of waypoints", in capitals, and in how they
say that gates overlap: some by the scan type alone ("Stare - overlapping") under a range formula that denies
it, some by the formula ("Gate length / 2 + (range gate x 3)").
"""

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from geometry.arrays import FloatArray
from geometry.errors import InputError
from reconstruct.losses import Loss

#: A header has 17 lines; an end further down is no end of a header.
HEADER_LINES = 60

#: More gates than any instrument has: the longest files known have 4000.
MOST_GATES = 20_000

_DATA = re.compile(r"\s*[-+]?\d+(?:[.,]\d+)?(?:\s+[-+\d.,eE]+){2,}\s*")
_START = re.compile(r"(\d{4})(\d{2})(\d{2})\s+(\d{1,2}):(\d{2}):(\d{2}(?:\.\d+)?)")
_NAME_DATE = re.compile(r"_(\d{4})(\d{2})(\d{2})_(\d{2})(\d{2})?(\d{2})?")
_OVERLAPPING = re.compile(r"(?<!non)(?<!non[- ])overlapping")
_FORMULA = re.compile(r"= *gate length */ *(\d+(?:\.\d+)?) *\+ *\(range gate *x *(\d+(?:\.\d+)?)\)")


@dataclass(frozen=True)
class Header:
    """What the header of a file says."""

    gates: int
    gate_length_m: float
    pulses: int  # a ray; 0 where unknown
    rays: int  # in the file; 0 where unknown
    start_utc: Any  # of the file
    first_m: float  # centre of gate 0
    spacing_m: float  # from centre to centre
    system: str = ""
    notes: tuple[str, ...] = ()
    losses: tuple[Loss, ...] = ()

    @property
    def midnight(self) -> Any:
        """Of the day that decimal hours count from."""
        return np.datetime64(self.start_utc, "D").astype("datetime64[ns]")

    @property
    def range_m(self) -> FloatArray:
        """(gate,) centres [m]."""
        return np.asarray(self.first_m + np.arange(self.gates) * self.spacing_m)


def read_header(lines: list[str], path: Path) -> tuple[Header, int]:
    """The header of a file and the index of the first line after it.

    Raises
    ------
    InputError
        If the end of the header or one of its needed lines is missing.
    """
    end = next((n for n, line in enumerate(lines[:HEADER_LINES]) if line.strip().startswith("****")), None)
    if end is None:
        raise InputError(
            f"{path}: no line '****' ends the header: this is no HALO .hpl file, or it is cut off"
        )
    pairs = [line.partition(":") for line in lines[:end] if ":" in line]
    said = {name.strip().lower(): value.strip() for name, _, value in pairs}
    numbers = [n for n, line in enumerate(lines[:end]) if _DATA.fullmatch(line)]
    gates = _number(said, "number of gates", path)
    length = _number(said, "range gate length (m)", path)
    points = _number({"gate length (pts)": "1", **said}, "gate length (pts)", path)
    if not (1 <= gates <= MOST_GATES and gates == int(gates) and 0 < length < 1e4 and 1 <= points < 1e4):
        raise InputError(
            f"{path}: {gates:g} gates of {length:g} m and {points:g} points make no ray: a whole number of "
            f"gates up to {MOST_GATES}, and a length and points above 0 are needed"
        )
    start, notes = _start(said.get("start time", ""), path)
    first_m, spacing_m, overlap = _gates(lines[:end], said.get("scan type", ""), length, points)
    return Header(
        gates=int(gates),
        gate_length_m=length,
        pulses=_count(said, "pulses/ray"),
        rays=_count(said, "no. of rays in file"),
        start_utc=start,
        first_m=first_m,
        spacing_m=spacing_m,
        system=f"HALO {said.get('system id', '')}".strip(),
        notes=(*notes, *overlap),
        losses=tuple(
            Loss(path.name, "a line of numbers before the end of the header", numbers[0] + 1, len(numbers))
            for _ in numbers[:1]
        ),
    ), end + 1


def _gates(lines: list[str], scan: str, length: float, points: float) -> tuple[float, float, list[str]]:
    """Centre of gate 0 and distance between centres [m], and a note where gates overlap."""
    stated = _FORMULA.search("\n".join(lines).lower().replace(",", "."))
    if stated is not None and float(stated[1]) > 0 and float(stated[2]) > 0:
        first, spacing, why = length / float(stated[1]), float(stated[2]), "as the header's formula says"
    elif overlapping(scan):
        first, spacing, why = length / 2, length / points, "one sample apart, as the scan type says"
    else:
        return length / 2, length, []
    return first, spacing, [f"gates overlap: centres at {first:g} m + {spacing:g} m a gate, {why}"]


def overlapping(scan: str) -> bool:
    """Whether a scan type says that its gates overlap.

    Examples
    --------
    >>> overlapping("Stare - overlapping"), overlapping("User file 5 - csm-nonoverlapping")
    (True, False)
    """
    return _OVERLAPPING.search(scan.lower()) is not None


def _number(said: dict[str, str], name: str, path: Path) -> float:
    try:
        text = said[name].replace(",", ".")
        value = float("nan" if "_" in text else text)
    except (KeyError, ValueError):
        value = float("nan")
    if not np.isfinite(value):
        raise InputError(
            f"{path}: the header says {said.get(name, 'nothing')!r} for {name!r}: a number is needed"
        )
    return value


def _count(said: dict[str, str], name: str) -> int:
    """A number that can be done without; 0 where there is none."""
    text = said.get(name, "")
    return int(text) if re.fullmatch(r"\d{1,9}", text) else 0


def _start(text: str, path: Path) -> tuple[np.datetime64, list[str]]:
    """When the file begins: as its header says, or else its name."""
    found = _START.search(text.replace(",", "."))
    if found is not None:
        return _moment([*found.groups()], f"{path}: the start time {text!r} is no date"), []
    named = _NAME_DATE.search(path.name)
    if named is not None:
        wrong = f"{path}: there is no start time, and the file's name holds no date"
        return _moment([part or "00" for part in named.groups()], wrong), [
            f"the header's start time is {text!r}: taken from the file's name"
        ]
    raise InputError(
        f"{path}: the start time is {text!r}: a date and time like '20190308 20:05:03.76' is needed, or a "
        "file name like Stare_96_20190308_20.hpl"
    )


def _moment(parts: list[str], wrong: str) -> np.datetime64:
    year, month, day, hour, minute, second = parts
    try:
        return np.datetime64(f"{year}-{month}-{day}T{int(hour):02d}:{minute}:{second}", "ns")
    except ValueError:
        raise InputError(f"{wrong}: a day and time of the calendar is needed") from None
