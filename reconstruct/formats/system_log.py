"""WindScanner's system file: how the head stood, and what its GPS says of the clock."""

from pathlib import Path
from typing import NamedTuple

import numpy as np

from geometry.angles import wrap_180_deg
from geometry.arrays import FloatArray
from reconstruct.formats.text import LABVIEW_TO_UNIX_S, lines_of
from reconstruct.losses import Loss

#: Fields: id; date (ddmmyy); time (hhmmss.ss); latitude; longitude; height; heading; pitch; roll; temperature.
FIELDS = 10

#: The GPS time is written with up to this delay: less is no difference of clocks [s].
CLOCK_S = 2.0


class SystemLog(NamedTuple):
    """Numbers of a system file, in the order of its counter."""

    attitude: FloatArray  # (sample, 4) id, heading, pitch, roll [degrees]
    gps: FloatArray  # (sample, 2) id, seconds since 1904 UTC

    def attitude_at(self, start_id: FloatArray, stop_id: FloatArray) -> dict[str, FloatArray]:
        """Heading, pitch and roll [degrees] at the middle of each ray; nothing where the file has none."""
        if not len(self.attitude):
            return {}
        middle, log = (start_id + stop_id) / 2, self.attitude
        names = ("heading_deg", "pitch_deg", "roll_deg")
        angles = [np.interp(middle, log[:, 0], np.unwrap(log[:, k + 1], period=360.0)) for k in range(3)]
        return {name: np.asarray(wrap_180_deg(a)) for name, a in zip(names, angles, strict=True)}

    def clock_notes(self, header: FloatArray) -> list[str]:
        """How far the GPS is ahead of the wind file's clock; nothing where the file has no GPS times.

        Parameters
        ----------
        header : numpy.ndarray
            (ray, 4) counters and times [s since 1904] of the start and the end of each ray.
        """
        known = self.gps[(self.gps[:, 0] >= header[0, 0]) & (self.gps[:, 0] <= header[-1, 1])]
        counter, clock = np.ravel(header[:, :2]), np.ravel(header[:, 2:])
        if not len(known) or np.any(np.diff(counter) < 0):
            return []
        ahead = float(np.median(known[:, 1] - np.interp(known[:, 0], counter, clock)))
        way = "ahead of" if ahead >= 0 else "behind"
        advice = (
            "" if abs(ahead) < CLOCK_S else f": a clock offset of {ahead:.1f} s would bring them together"
        )
        return [f"the GPS of the system file is {abs(ahead):.1f} s {way} the wind file's clock{advice}"]


def read_system(path: Path) -> tuple[SystemLog, list[Loss]]:
    """A `system.txt`, and what was lost."""
    fields = [line.strip().split(";") for line in lines_of(path)]
    bad = [n + 1 for n, row in enumerate(fields) if len(row) < FIELDS and any(row)]
    text = f"fewer than {FIELDS} fields: the line is damaged"
    losses = [Loss(path.name, text, bad[0], len(bad))] if bad else []
    rows = [row for row in fields if len(row) >= FIELDS]
    attitude = [[_number(cell) for cell in (row[0], *row[6:9])] for row in rows]
    gps = [[_number(row[0]), _gps_s(row[1], row[2])] for row in rows]
    return SystemLog(_sorted(attitude, 4), _sorted(gps, 2)), losses


def _sorted(rows: list[list[float]], columns: int) -> FloatArray:
    """(sample, column) whole rows by their first number."""
    values = np.array(rows, dtype=float).reshape(-1, columns)
    values = values[np.all(np.isfinite(values), axis=1)]
    return values[np.argsort(values[:, 0], kind="stable")]


def _number(cell: str) -> float:
    try:
        return float(cell.replace(",", ".") or "nan")
    except ValueError:
        return float("nan")


def _gps_s(date: str, time: str) -> float:
    """Seconds since 1904 of a date ddmmyy and a time hhmmss.ss; NaN where they are none.

    Examples
    --------
    >>> round(_gps_s("161116", "152001.09") - _gps_s("161116", "142000.00"), 3)
    3601.09
    """
    try:
        day = np.datetime64(f"20{date[4:6]}-{date[2:4]}-{date[:2]}", "s").astype(float)
        seconds = 3600 * int(time[:2]) + 60 * int(time[2:4]) + float(time[4:])
    except ValueError:
        return float("nan")
    return float(day + seconds + LABVIEW_TO_UNIX_S)
