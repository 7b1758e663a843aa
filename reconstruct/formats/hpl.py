"""HALO StreamLine `.hpl` text files.

A header of `name: value` lines ends at `****`; then each ray is one line (decimal hours, azimuth, elevation,
and in most versions pitch, roll) and one line for each gate (gate, Doppler speed positive away, intensity =
SNR + 1, backscatter, and in some versions the spectral width). Versions differ in the decimal sign, in "No.
of rays" against "No. of waypoints", and in overlapping gates.
"""

import re
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from geometry.arrays import FloatArray
from geometry.errors import InputError
from reconstruct.formats.carrier_to_noise import cnr_from_intensity
from reconstruct.formats.options import Options
from reconstruct.formats.over_the_top import folded
from reconstruct.formats.text import lines_of, seconds_delta
from reconstruct.losses import Loss, merged_losses
from reconstruct.records import Records, TimeArray
from reconstruct.sweep_ids import sweep_ids

#: Numbers of a ray's line without and with pitch and roll.
RAY_NUMBERS = (3, 5)

#: Numbers of a gate's line without and with spectral width.
GATE_NUMBERS = (4, 5)

#: Decimal hours count from midnight and may run on into the next day, not further.
LATEST_HOUR = 48.0

_START = re.compile(r"(\d{4})(\d{2})(\d{2})\s+(\d{1,2}):(\d{2}):(\d{2}(?:\.\d+)?)")


@dataclass(frozen=True)
class Header:
    """What the header of a file says."""

    gates: int
    gate_length_m: float
    points: int  # samples in a gate
    pulses: int  # a ray; 0 where unknown
    start: np.datetime64  # midnight of the day that decimal hours count from
    overlapping: bool  # gates one sample apart
    system: str = ""
    scan_type: str = ""

    @property
    def range_m(self) -> FloatArray:
        """(gate,) centres [m]: (gate + 0.5) lengths, or one sample apart where gates overlap."""
        gate = np.arange(self.gates)
        if self.overlapping:
            return np.asarray(self.gate_length_m / 2 + gate * self.gate_length_m / self.points)
        return np.asarray((gate + 0.5) * self.gate_length_m)


def read_hpl(path: Path, options: Options | None = None) -> Records:
    """Rays of a HALO file.

    Parameters
    ----------
    path : Path
    options : Options, optional
        `pulse_repetition_hz` gives the rays a duration (pulses a ray over it); `stamp` tells where in the ray
        the time stands, by default taken as the middle, as the maker does not say; `clock_offset_s`,
        `mounting`, `instrument`.

    Returns
    -------
    Records
        CNR is 10 log10(intensity - 1), NaN where the intensity is not above 1. Pitch and roll as logged. A
        last ray that is cut off is lost, and said to be.

    Raises
    ------
    InputError
        If the header lacks what is needed, or no ray is whole.
    """
    options = options or Options()
    lines = lines_of(path)
    header, body = read_header(lines, path)
    text = [line.replace(",", ".") for line in lines[body:]]
    rays, gates, losses = _rays(text, header, path.name, body)
    if not len(rays):
        raise InputError(f"{path}: no ray is whole: {header.gates} gate lines are needed after each ray line")
    time = header.start + seconds_delta(_running_hours(rays[:, 0]) * 3600.0)
    order = np.argsort(time, kind="stable")
    rays, gates, time = rays[order], gates[order], time[order]
    azimuth, elevation, notes = folded(rays[:, 1], rays[:, 2])
    records = Records(
        time_utc=time,
        duration_s=np.full(len(rays), np.nan),
        azimuth_deg=azimuth,
        elevation_deg=elevation,
        scan_id=np.zeros(len(rays), dtype=np.intp),
        sweep_id=sweep_ids(azimuth, elevation),
        range_m=header.range_m,
        radial_speed_mps=gates[:, :, 1],
        cnr_db=cnr_from_intensity(gates[:, :, 2]),
        spectral_width_mps=gates[:, :, 4] if gates.shape[-1] > 4 else None,
        pitch_deg=rays[:, 3] if rays.shape[1] > 4 else None,
        roll_deg=rays[:, 4] if rays.shape[1] > 4 else None,
        instrument=options.instrument or header.system,
        notes=("intensity turned into CNR = 10 log10(intensity - 1)", *notes),
        losses=merged_losses(losses),
    )
    return _timed(records, header, options).mounted(options.mounting)


def read_header(lines: list[str], path: Path) -> tuple[Header, int]:
    """The header of a file and the index of the first line after it.

    Raises
    ------
    InputError
        If the end of the header or one of its needed lines is missing.
    """
    end = next((n for n, line in enumerate(lines[:60]) if line.strip().startswith("****")), None)
    if end is None:
        raise InputError(
            f"{path}: no line '****' ends the header: this is no HALO .hpl file, or it is cut off"
        )
    pairs = [line.partition(":") for line in lines[:end] if ":" in line]
    said = {name.strip().lower(): value.strip() for name, _, value in pairs}
    gates = _number(said, "number of gates", path)
    length = _number(said, "range gate length (m)", path)
    points = float(said.get("gate length (pts)", "1").replace(",", ".") or 1)
    if not (gates >= 1 and length > 0 and points >= 1):
        raise InputError(
            f"{path}: {gates:g} gates of {length:g} m and {points:g} points make no ray: all have to be "
            "positive"
        )
    scan = said.get("scan type", "")
    name = said.get("system id", "")
    start = _start(said.get("start time", ""), path)
    overlapping = scan.endswith("-overlapping") or "overlapping gates: 1" in " ".join(lines[:end]).lower()
    pulses = re.sub(r"\D", "", said.get("pulses/ray", "")) or "0"
    return Header(
        int(gates), length, int(points), int(pulses), start, overlapping, f"HALO {name}".strip(), scan
    ), end + 1


def _number(said: dict[str, str], name: str, path: Path) -> float:
    try:
        return float(said[name].replace(",", "."))
    except (KeyError, ValueError):
        raise InputError(
            f"{path}: the header says {said.get(name, 'nothing')!r} for {name!r}: a number is needed"
        ) from None


def _start(text: str, path: Path) -> np.datetime64:
    found = _START.search(text.replace(",", "."))
    if found is None:
        raise InputError(
            f"{path}: the start time is {text!r}: a date and time like '20190308 20:05:03.76' is needed"
        )
    try:
        return np.datetime64("-".join(found.groups()[:3]), "ns")
    except ValueError:
        raise InputError(f"{path}: the start time {text!r} is no date") from None


def _rays(
    text: list[str], header: Header, where: str, offset: int
) -> tuple[FloatArray, FloatArray, list[Loss]]:
    """Numbers of the rays (ray, number) and of their gates (ray, gate, number), and what was lost."""
    cells = [line.split() for line in text]
    while cells and not cells[-1]:
        cells.pop()
    block = header.gates + 1
    good, losses = [], []
    n = 0
    while n < len(cells):
        if _is_ray(cells, n, header.gates):
            good.append(n)
            n += block
            continue
        if cells[n]:
            losses.append(Loss(where, f"part of no whole ray of {header.gates} gates", n + offset + 1))
        n += 1
    widths = {len(cells[n]) for n in good}, {len(cells[n + 1]) for n in good}
    ray_width, gate_width = (min(w, default=0) for w in widths)
    rays = np.array([cells[n][:ray_width] for n in good], dtype=float).reshape(len(good), ray_width)
    flat = [cell for n in good for row in cells[n + 1 : n + block] for cell in row[:gate_width]]
    return rays, np.array(flat, dtype=float).reshape(len(good), header.gates, gate_width), losses


def _is_ray(cells: list[list[str]], n: int, gates: int) -> bool:
    """Whether a ray line stands there with all its gate lines after it."""
    if len(cells[n]) not in RAY_NUMBERS or n + gates >= len(cells):
        return False
    rows = cells[n + 1 : n + 1 + gates]
    width = len(rows[0])
    if width not in GATE_NUMBERS or any(len(row) != width for row in rows):
        return False
    try:
        numbers = [row[0] for row in rows]
        hour = float(np.array(cells[n], dtype=float)[0])
        np.array(rows, dtype=float)
        return 0 <= hour < LATEST_HOUR and int(numbers[-1]) - int(numbers[0]) == gates - 1
    except ValueError:
        return False


def _running_hours(hours: FloatArray) -> FloatArray:
    """Decimal hours that go on over midnight instead of beginning again."""
    return np.asarray(hours + 24.0 * np.concatenate([[0], np.cumsum(np.diff(hours) < -12.0)]))


def _timed(records: Records, header: Header, options: Options) -> Records:
    """Records with a duration and times at the middle of the ray, as far as that is known."""
    time: TimeArray = records.time_utc + seconds_delta(options.clock_offset_s)
    notes = list(records.notes)
    if options.pulse_repetition_hz and header.pulses:
        duration = header.pulses / options.pulse_repetition_hz
        half = {"start": 0.5, "end": -0.5}.get(options.stamp, 0.0) * duration
        notes.append(
            f"duration of a ray {duration:.3f} s from its pulses; stamps taken as its {options.stamp}, moved "
            f"by {half:g} s"
        )
        return replace(
            records,
            time_utc=time + seconds_delta(half),
            duration_s=np.full(records.rays, duration),
            notes=tuple(notes),
        )
    notes.append(
        "times as stored: the file does not say how long a ray lasts, nor where in it the stamp stands"
    )
    return replace(records, time_utc=time, notes=tuple(notes))
