"""The lines of a WindScanner wind file: whole rays in the order of time, and what of them is lost.

Besides cut lines there are two kinds of damage that public files of these units show or that would go
unnoticed: two lines that carry the same counters and times but other speeds (the header of one of them has
been overwritten: e-WindLidar/Lidaco, samples/Kassel_Experiment/data/WS1), and a list of ranges that no other
line has.
"""

from pathlib import Path
from typing import NamedTuple

import numpy as np

from geometry.arrays import BoolArray, FloatArray, IntArray
from geometry.errors import InputError
from reconstruct.formats.gate_union import GateBlock, common_gates
from reconstruct.formats.text import Table, lines_of, number_tables, utc_from_labview
from reconstruct.formats.time_order import time_order
from reconstruct.losses import Loss, merged_losses

#: Header fields of one ray; units without scan_id and los_id write the last six.
LONG_HEADER, SHORT_HEADER = 8, 6

#: Numbers of one gate: range, radial speed, CNR, dispersion.
GATE_NUMBERS = 4

#: Seconds since 1904 of any lidar campaign lie above this (1967-05), below it is no time.
EARLIEST_S = 2.0e9

#: They lie below this (2126).
LATEST_S = 7.0e9

#: No ray lasts longer [s].
LONGEST_RAY_S = 3600.0

#: A list of ranges that one line alone has is damage where there are this many lines or more.
ENOUGH_LINES = 5


class WindLines(NamedTuple):
    """Rays of a wind file."""

    header: FloatArray  # (ray, 8) scan, line of sight, two counters, start, stop, azimuth, elevation
    range_m: FloatArray  # (gate,)
    gates: list[FloatArray]  # (ray, gate) radial speed, CNR, dispersion
    losses: tuple[Loss, ...]
    notes: list[str]


class _Block(NamedTuple):
    header: FloatArray  # (ray, 8)
    gates: GateBlock
    line: IntArray  # (ray,)


def read_wind_lines(path: Path) -> WindLines:
    """Rays of a wind file, as its lines have them.

    Raises
    ------
    InputError
        If no line is a ray.
    """
    tables, losses = number_tables(lines_of(path), path.name)
    split = [_split(table, path.name, losses) for table in tables]
    blocks = [block for block in split if block is not None and len(block.line)]
    if not blocks:
        raise InputError(
            f"{path}: no line is a ray: {SHORT_HEADER} or {LONG_HEADER} header fields and {GATE_NUMBERS} "
            "numbers for each gate are needed, separated by ';'"
        )
    header = np.concatenate([block.header for block in blocks])
    line = np.concatenate([block.line for block in blocks])
    range_m, gates = common_gates([block.gates for block in blocks])
    middle = (header[:, 4] + header[:, 5]) / 2
    in_file = np.argsort(line)
    sorted_ = time_order(utc_from_labview(middle[in_file]), path.name, line[in_file])
    order = in_file[sorted_.order]
    single, repeated = _single(header[order], np.stack(gates, axis=-1)[order], line[order], path.name)
    order = order[single]
    losses += [*sorted_.losses, *repeated]
    return WindLines(
        header[order], range_m, [grid[order] for grid in gates], merged_losses(losses), sorted_.notes
    )


def _split(table: Table, where: str, losses: list[Loss]) -> _Block | None:
    """Header and gates of lines of one width; None, with the loss, if they are no rays."""
    width = table.values.shape[1]
    for size in (LONG_HEADER, SHORT_HEADER):
        if (
            width <= size
            or (width - size) % GATE_NUMBERS
            or np.mean(_is_time(table.values[:, size - 4])) < 0.5
        ):
            continue
        header = table.values[:, :size]
        if size == SHORT_HEADER:
            header = np.column_stack([np.zeros(len(header)), np.arange(len(header)), header])
        gates = table.values[:, size:].reshape(len(header), -1, GATE_NUMBERS)
        rules = {
            "an empty field, or a time or an angle that is none, in the header": _sound_header(header),
            "ranges that do not rise from 0 on": _rising(gates[..., 0]),
            "a list of ranges that no other line has": ~_lone(gates[..., 0]),
        }
        whole = np.ones(len(header), dtype=bool)
        for text, passed in rules.items():
            lost = whole & ~passed
            if lost.any():
                losses.append(Loss(where, text, int(table.line[lost][0]), int(lost.sum())))
            whole &= passed
        return _Block(header[whole], GateBlock(gates[whole, :, 0], gates[whole, :, 1:]), table.line[whole])
    text = f"{width} fields are no ray: 6 or 8 header fields and 4 numbers for each gate are needed"
    losses.append(Loss(where, text, int(table.line[0]), len(table.line)))
    return None


def _is_time(seconds: FloatArray) -> BoolArray:
    """Whether numbers can be times of a campaign in seconds since 1904."""
    return np.asarray((seconds > EARLIEST_S) & (seconds < LATEST_S))


def _sound_header(header: FloatArray) -> BoolArray:
    """(ray,) all fields there, times of a campaign, and an elevation that a head can have."""
    start, stop = header[:, 4], header[:, 5]
    lasts = stop - start
    sound = np.all(np.isfinite(header), axis=1) & _is_time(start) & _is_time(stop)
    return np.asarray(sound & (lasts >= 0) & (lasts <= LONGEST_RAY_S) & (np.abs(header[:, 7]) <= 360.0))


def _rising(ranges: FloatArray) -> BoolArray:
    """(ray,) ranges that do not fall; some lists hold one twice, for two targets."""
    return np.asarray(np.all(np.diff(ranges, axis=1, prepend=0.0) >= 0, axis=1))


def _lone(ranges: FloatArray) -> BoolArray:
    """(ray,) whose list of ranges is the line's own, where nearly all others share theirs."""
    lone = np.zeros(len(ranges), dtype=bool)
    other = np.flatnonzero(np.any(ranges != np.median(ranges, axis=0), axis=1))
    if len(ranges) >= ENOUGH_LINES and 0 < len(other) < len(ranges) / 2:
        _, kind, count = np.unique(ranges[other], axis=0, return_inverse=True, return_counts=True)
        lone[other] = (count == 1)[np.ravel(kind)]
    return lone


def _single(
    header: FloatArray, gates: FloatArray, line: IntArray, where: str
) -> tuple[BoolArray, list[Loss]]:
    """(ray,) that stand in the file once, and what was lost: second copies, and rays whose header is another
    ray's, so that it is not known where they looked.
    """
    single = np.ones(len(header), dtype=bool)
    if not np.any(np.diff(header[:, 4] + header[:, 5]) == 0):
        return single, []
    _, kind, count = np.unique(header[:, 2:], axis=0, return_inverse=True, return_counts=True)
    copies: list[int] = []
    foreign: list[int] = []
    for repeated in np.flatnonzero(count > 1):
        rays = np.flatnonzero(np.ravel(kind) == repeated)
        same = np.array([np.array_equal(gates[ray], gates[rays[0]], equal_nan=True) for ray in rays])
        if same.all():
            copies.extend(rays[1:].tolist())
        else:
            foreign.extend(rays.tolist())
    losses = []
    for lost, text in (
        (copies, "a ray that stands in the file before"),
        (foreign, "a ray with the counters, times and angles of another one: which it belongs to is unknown"),
    ):
        if lost:
            single[lost] = False
            losses.append(Loss(where, text, int(line[lost].min()), len(lost)))
    return single, losses
