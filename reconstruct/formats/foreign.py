"""Files that lie beside the rays of a lidar, or come from other lidars, and are not read: what they are, and
what to read instead.
"""

import re
from collections.abc import Callable, Sequence
from typing import Literal, NamedTuple

_NUMBER = r"[-+]?\d+(?:[.,]\d+)?(?:[eE][-+]?\d+)?"
_NUMBER_LINE = re.compile(rf"\s*(?:{_NUMBER})?\s*")
_GLUED = re.compile(r"\s*(?:\d+\.\d{6}){20,}\s*")
_THREE = re.compile(rf"\s*{_NUMBER}\s+{_NUMBER}\s+{_NUMBER}\s*")
_SCHEDULE = re.compile(r"\s*-?\d+[.,]\d{3}\s*-?\d+[.,]\d{3}\s*")
_PARAMETERS = re.compile(r"\d{1,2}/\d{1,2}/\d{4} [\d:]{7,8}(?: [AP]M)?(?:\t[-\d.,]+){6}\s*")


class Foreign(NamedTuple):
    """A kind of file that holds no rays that can be read."""

    rank: Literal["companion", "other"]  # a companion is passed over in a folder, another is a loss
    text: str  # what it is and what to do


def _first(lines: Sequence[str]) -> str:
    return lines[0].strip().lower().lstrip('"')


def _windcube_text(lines: Sequence[str]) -> bool:
    """A header whose first line counts its own lines (WLS7, WLS70, WindCube V1 and V2)."""
    return re.match(r"header(size|length)\s*=\s*\d+", _first(lines)) is not None


def _windcube_means(lines: Sequence[str]) -> bool:
    head = "\n".join(lines).lower()
    return _windcube_text(lines) and ("availability" in head or "extension=sta" in head.replace(" ", ""))


def _log(lines: Sequence[str]) -> bool:
    """WindScanner: a scanner file has 4 fields, a system file 10 or 11, the first a counter."""
    fields = lines[0].split(";")
    return len(fields) in (4, 10, 11) and fields[0].strip().isdigit()


#: Each test gets the first lines that are not blank.
_KINDS: tuple[tuple[Callable[[Sequence[str]], bool], Foreign], ...] = (
    (
        lambda lines: all(_SCHEDULE.fullmatch(line) for line in lines[:5]),
        Foreign("companion", "a HALO scan schedule: name the .hpl file that was measured by it"),
    ),
    (_log, Foreign("companion", "a WindScanner scanner or system file: name the wind file beside it")),
    (
        lambda lines: _PARAMETERS.fullmatch(lines[0]) is not None,
        Foreign("companion", "HALO system parameters: name the .hpl files"),
    ),
    (
        lambda lines: len(lines) > 3 and lines[0].strip().isdigit() and bool(_THREE.fullmatch(lines[1])),
        Foreign("other", "a profile that HALO has computed (Processed_Wind_Profile): read its .hpl scan"),
    ),
    (
        lambda lines: (
            _GLUED.fullmatch(lines[0]) is not None
            or (len(lines) > 3 and all(_NUMBER_LINE.fullmatch(line) for line in lines[:20]))
        ),
        Foreign("companion", "a HALO background: name the .hpl files"),
    ),
    (
        _windcube_means,
        Foreign(
            "other", "ten-minute means of a WindCube profiler (.sta): read them as a mast, not as a lidar"
        ),
    ),
    (
        _windcube_text,
        Foreign(
            "other",
            "a text file of a WindCube profiler (.rtd or .stdsta of WLS7, WLS70, V1, V2), whose sign of the "
            "radial speed depends on the version: turn it into a CSV and give `columns`",
        ),
    ),
    (
        lambda lines: "range gate\tdoppler\tintensity\tray time" in "\n".join(lines).lower(),
        Foreign("other", "a Galion scan: turn it into a CSV and give `columns`"),
    ),
)


def foreign(lines: Sequence[str]) -> Foreign | None:
    """What kind of file that holds no rays this is; None if it is none of those known.

    Parameters
    ----------
    lines : sequence of str
        The first lines that are not blank.

    Examples
    --------
    >>> foreign(["039.806014.363", "050.000014.363"]).text
    'a HALO scan schedule: name the .hpl file that was measured by it'
    >>> foreign(["HeaderLength=41", "Version=1.1.14.b", "ID System=WLS7-164"]).rank
    'other'
    """
    head = list(lines[:60])
    return next((kind for test, kind in _KINDS if head and test(head)), None)
