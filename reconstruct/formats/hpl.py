"""HALO StreamLine `.hpl` text files.

A header of `name: value` lines ends at `****`; then each ray is one line (decimal hours, azimuth, elevation,
and in most versions pitch, roll) and one line for each gate (gate, Doppler speed positive away, intensity =
SNR + 1, backscatter, and in some versions the spectral width, which the header need not mention). The
variants are those that github.com/actris-cloudnet/doppy lists in docs/formats-halo.md and
github.com/actris-cloudnet/halo-reader in raw-formats.md.
"""

from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from geometry.arrays import BoolArray, FloatArray, IntArray
from geometry.errors import InputError
from reconstruct.formats.carrier_to_noise import cnr_from_intensity
from reconstruct.formats.hpl_header import Header, read_header
from reconstruct.formats.number_rows import NumberRows, byte_lines, number_rows
from reconstruct.formats.options import Options
from reconstruct.formats.over_the_top import folded
from reconstruct.formats.text import plain_bytes, read_bytes, seconds_delta
from reconstruct.formats.time_order import time_order
from reconstruct.losses import Loss, merged_losses
from reconstruct.records import Records, TimeArray
from reconstruct.sweep_ids import sweep_ids

#: Columns of a gate's line: gate, speed, intensity, backscatter, spectral width; of a ray's: hours, azimuth,
#: elevation, pitch, roll. One more is room for a line that is too long.
COLUMNS = 5

#: Decimal hours count from midnight and may run on into the next day, not further.
LATEST_HOUR = 48.0

#: Decimal hours that jump back by more begin a new day.
HALF_DAY = 12.0

#: A head that counts its turns does not come further than this many degrees.
MOST_TURNED_DEG = 1e6

#: Bytes that hold the header.
HEADER_BYTES = 16_384


class _Rays(NamedTuple):
    ray: FloatArray  # (ray, 5) hours, azimuth, elevation, pitch, roll
    gate: FloatArray  # (3, ray, gate) speed, intensity, spectral width
    line: IntArray  # (ray,)
    losses: list[Loss]


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
    text = plain_bytes(read_bytes(path))
    head = [line.decode("latin-1") for line in byte_lines(text[:HEADER_BYTES])]
    header, first_line = read_header(head, path)
    found = _rays(_body(text, first_line), header, path, first_line)
    time = header.midnight + seconds_delta(_hours_of_day(found.ray[:, 0], header) * 3600.0)
    sorted_ = time_order(time, path.name, found.line)
    ray, gate, time = found.ray[sorted_.order], found.gate[:, sorted_.order], time[sorted_.order]
    azimuth, elevation, turned = folded(ray[:, 1], ray[:, 2])
    records = Records(
        time_utc=time,
        duration_s=np.full(len(ray), np.nan),
        azimuth_deg=azimuth,
        elevation_deg=elevation,
        scan_id=np.zeros(len(ray), dtype=np.intp),
        sweep_id=sweep_ids(azimuth, elevation),
        range_m=header.range_m,
        radial_speed_mps=gate[0],
        cnr_db=cnr_from_intensity(gate[1]),
        spectral_width_mps=_if_any(gate[2]),
        pitch_deg=_if_any(ray[:, 3]),
        roll_deg=_if_any(ray[:, 4]),
        instrument=options.instrument or header.system,
        notes=(
            "intensity turned into CNR = 10 log10(intensity - 1)",
            *header.notes,
            *turned,
            *sorted_.notes,
        ),
        losses=merged_losses([*header.losses, *found.losses, *sorted_.losses]),
    )
    return _timed(records, header, options).mounted(options.mounting)


def _body(text: bytes, first_line: int) -> bytes:
    """The text after so many lines, with decimal points."""
    start = 0
    for _ in range(first_line):
        ends = [end for end in (text.find(b"\n", start), text.find(b"\r", start)) if end >= 0]
        end = min(ends, default=len(text) - 1)
        start = end + 1 + (text[end : end + 2] == b"\r\n")
    return text[start:].replace(b",", b".")


def _rays(body: bytes, header: Header, path: Path, first_line: int) -> _Rays:
    """Whole rays, and what was lost.

    Raises
    ------
    InputError
        If no ray is whole.
    """
    rows = number_rows(body, COLUMNS)
    whole = _whole(rows.values, header.gates, _cut(rows, body))
    if not len(whole):
        usual = _usual_gates(rows.values[:, 0])
        came = f"mostly {usual} follow" if usual else "none follows"
        raise InputError(
            f"{path}: no ray is whole: after each ray line {header.gates} gate lines are needed, as the "
            f"header says, and {came}"
        )
    gate_rows = whole[:, None] + 1 + np.arange(header.gates)
    used = np.zeros(len(rows.values), dtype=bool)
    used[whole] = True
    used[gate_rows] = True
    losses = _losses(rows, used, header, path.name, first_line)
    if len(whole) < header.rays:
        text = f"rays that the header announces ({header.rays}) and the file does not hold whole"
        losses.append(Loss(path.name, text, times=header.rays - len(whole)))
    gate = np.stack([rows.values[:, column][gate_rows] for column in (1, 2, 4)])
    return _Rays(rows.values[whole], gate, whole + first_line + 1, losses)


def _whole(values: FloatArray, gates: int, cut: BoolArray) -> IntArray:
    """(ray,) rows of ray lines that all their gate lines follow."""
    number = values[:, 0]
    breaks = np.cumsum(np.concatenate([[True], np.diff(number) != 1]))  # a run of gates counts up by one
    cut_before = np.concatenate([[0], np.cumsum(cut)])
    wide_before = np.concatenate([[0], np.cumsum(np.isfinite(values[:, 4]))])
    first = np.flatnonzero((number == 0) | (number == 1))
    first = first[(first >= 1) & (first + gates <= len(number))]
    last = first + gates - 1
    wide = wide_before[last + 1] - wide_before[first]
    sound = (breaks[first] == breaks[last]) & (cut_before[last + 1] == cut_before[first])
    sound &= (wide == 0) | (wide == gates)
    sound &= (number[first] == 0) | (breaks[first] != breaks[first - 1])
    ray = first[sound] - 1
    hours, azimuth, elevation = values[ray, 0], values[ray, 1], values[ray, 2]
    sound = (hours >= 0) & (hours < LATEST_HOUR)
    sound &= (np.abs(azimuth) < MOST_TURNED_DEG) & (np.abs(elevation) <= 360.0)
    sound &= np.isfinite(values[ray, 3]) == np.isfinite(values[ray, 4])
    ray = ray[sound]
    ray = ray[~_doubtful(values[:, 0], ray, gates)]
    apart = np.concatenate([[True], np.diff(ray) > gates]) if len(ray) else np.empty(0, dtype=bool)
    return np.asarray(ray[apart], dtype=np.intp)


def _doubtful(number: FloatArray, ray: IntArray, gates: int) -> BoolArray:
    """(ray,) that two ray lines begin, or whose gates a gate line follows that comes again: which of the two
    is the ray's own is unknown.
    """
    around = np.concatenate([[np.nan], number, [np.nan, np.nan]])
    before, after, then = around[ray], around[ray + gates + 2], around[ray + gates + 3]
    hours_before = before % 1 > 0
    gate_again = (after % 1 == 0) & (after >= 0) & (after < gates) & (then != 0) & (then != 1)
    return np.asarray(hours_before | gate_again)


def _cut(rows: NumberRows, body: bytes) -> BoolArray:
    """(row,) whether a line has too few fields for a gate; one that holds NaN in words has not."""
    short: BoolArray = ~np.all(np.isfinite(rows.values[:, 1:4]), axis=1)
    doubtful = np.flatnonzero(short & np.isfinite(rows.values[:, 0]) & (rows.values[:, 0] % 1 == 0))
    if len(doubtful):
        lines = byte_lines(body)
        fields = np.array([len(lines[n].split()) for n in doubtful])
        short[doubtful[fields >= COLUMNS - 1]] = False
    return short


def _usual_gates(number: FloatArray) -> int:
    """How many gate lines mostly follow each other; 0 if none does."""
    if not len(number):
        return 0
    starts = np.flatnonzero(np.concatenate([[True], np.diff(number) != 1, [True]]))
    lengths = np.diff(starts)[(number[starts[:-1]] == 0) | (number[starts[:-1]] == 1)]
    return int(np.bincount(lengths).argmax()) if len(lengths) else 0


def _losses(rows: NumberRows, used: BoolArray, header: Header, where: str, first_line: int) -> list[Loss]:
    """Lines that are in no whole ray."""
    wrong = np.zeros(len(used), dtype=bool)
    wrong[rows.wrong] = True
    left = np.flatnonzero(~used & np.isfinite(rows.values).any(axis=1))
    losses = []
    if len(rows.wrong):
        text = "a line that holds something else than numbers, or too many"
        losses.append(Loss(where, text, int(rows.wrong[0]) + first_line + 1, len(rows.wrong)))
    if len(left):
        text = f"a line in no whole ray of {header.gates} gates"
        losses.append(Loss(where, text, int(left[0]) + first_line + 1, len(left)))
    return losses


def _hours_of_day(hours: FloatArray, header: Header) -> FloatArray:
    """Decimal hours from the midnight of the header's day, that go on over midnight instead of beginning
    again.

    A stamp just after midnight in a file begun just before it counts on, and the other way round.
    """
    into_day = (header.start_utc - header.midnight) / np.timedelta64(1, "h")
    steps = np.diff(hours, prepend=into_day)
    days, day = np.zeros(len(hours)), 0
    for ray in np.flatnonzero(np.abs(steps) > HALF_DAY):
        if steps[ray] < 0:
            day += 1
        elif day > 0 or ray == 0:  # a damaged stamp that looked like midnight; else a gap of half a day
            day -= 1
        days[ray:] = day
    return np.asarray(hours + 24.0 * days)


def _if_any(values: FloatArray) -> FloatArray | None:
    return values if np.isfinite(values).any() else None


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
