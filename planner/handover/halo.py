"""Scan files and the daily schedule of a HALO StreamLine.

A scan at rest on each ray becomes a step-stare file (SSM): a line a ray, azimuth and elevation glued together,
seven characters each. A scan that measures while it turns becomes a continuous file (CSM): a line a movement,
with acceleration A, speed S and position P of both axes (1 azimuth, 2 elevation), and a line with the time to
wait there. The schedule (.dss) says at which time of day which file begins; a file holds as many passes as
fit until the next one begins.

The formats are known from files that drove such lidars, not from a document of the maker: try them with the
laser off first. Range gates are not part of these files: they are set in the instrument's own software.
"""

import math
from collections.abc import Iterator, Sequence

import numpy as np

from geometry.arrays import FloatArray
from geometry.errors import InputError
from planner.handover.head_path import HeadPath, Sweep, head_path, passes, ray_order, sweeps
from planner.handover.limits import require_accumulation, require_gates, require_head, require_range
from planner.handover.names import file_stems
from planner.instruments import Head
from planner.scan_layout import ScanLayout

MAKER = "halo"  # how the names of these instruments begin

AZIMUTH_COUNTS = 500_000 / 360  # of the motor, per degree
ELEVATION_COUNTS = 250_000 / 360
SPEED_UNIT = 10  # counts/s
ACCELERATION_UNIT = 1000  # counts/s2
FOCUS = 7  # what schedules of lidars without an adjustable focus have
PULSES_UNIT = 1000  # the schedule counts the pulses of a ray in thousands

DAY_S = 86_400
SLOT_S = 600  # how long each scan of a lidar has its turn
SPARE_S = 10  # left at the end of a turn, for the head to get to the next start

LINE_END = "\r\n"  # the instrument's computer runs Windows


def halo_files(layouts: Sequence[ScanLayout], *, slot_s: int = SLOT_S) -> dict[str, str]:
    """Write the scan files of one lidar and the schedule that lets them take turns all day.

    Parameters
    ----------
    layouts
        The lidar's scans, in the order in which they take turns.
    slot_s
        Length of a turn [s], a whole part of a day; a pass that takes longer gets several.

    Returns
    -------
    dict of str to str
        Text by file name: a file for each scan, and `schedule.dss`.

    Raises
    ------
    InputError
        If a scan is not one that the lidar can do.
    """
    if slot_s < 1 or DAY_S % slot_s:
        raise InputError(f"turns of {slot_s} s came; allowed are whole parts of a day, such as 600 s")
    stems = file_stems(layout.name for layout in layouts)
    files: dict[str, str] = {}
    turns: list[tuple[str, int, str, int]] = []
    for layout in layouts:
        path = head_path(layout)
        pulses = _checked(layout, path)
        turn_s, count = _turn(layout, slot_s)
        moving = bool(np.any(layout.scan.swept_azimuth_deg) or np.any(layout.scan.swept_elevation_deg))
        text = (
            csm_text(layout, path, count)
            if moving
            else ssm_text(path.middle_deg[ray_order(layout.scan, count)])
        )
        stem = f"{'csm' if moving else 'ssm'}_{stems[layout.name]}"
        files[f"{stem}.txt"] = text
        turns.append((stem, pulses, "C" if moving else "S", turn_s))
    return {**files, "schedule.dss": schedule_text(turns)}


def ssm_text(angles_deg: FloatArray) -> str:
    """Write a step-stare file.

    Parameters
    ----------
    angles_deg
        (ray, 2) azimuth and elevation as the head shows them [deg].

    Raises
    ------
    InputError
        If an angle needs more than seven characters.

    Examples
    --------
    >>> print(ssm_text(np.array([[39.806, 14.363], [-0.0004, -0.5]])))
    039.806014.363
    000.000-00.500
    """
    azimuth = np.round(np.mod(angles_deg[:, 0], 360.0), 3) % 360.0  # 359.9996 is north, not 360.000
    elevation = np.round(angles_deg[:, 1], 3) + 0.0
    if not np.all((elevation > -100.0) & (elevation < 1000.0)):
        raise InputError(
            "an elevation came that does not fit seven characters; allowed are -90 to 180 degrees"
        )
    return "".join(f"{a:07.3f}{e:07.3f}{LINE_END}" for a, e in zip(azimuth, elevation, strict=True))


def csm_text(layout: ScanLayout, path: HeadPath, count: int) -> str:
    """Write a continuous file: to the start at full speed, then sweep after sweep.

    Parameters
    ----------
    layout
        The scan.
    path
        Its head angles.
    count
        Passes in the file.

    Notes
    -----
    P = -angle·500000/360 counts for axis 1 and -angle·250000/360 for axis 2; S in tens of counts/s, A in
    thousands of counts/s². The speed of a sweep is the step between two rays over the accumulation time.
    """
    head = require_head(layout, path)
    lines: list[str] = []
    here = np.full(2, np.nan)
    for sweep in passes(layout.scan, _joined_on(layout, sweeps(path)), 1 if _goes_on(layout) else count):
        if not np.allclose(here, sweep.begin_deg, atol=1e-6):
            lines += [_movement(sweep.begin_deg, np.array(_top_speed(head)), head), "W0"]
        lines += [
            _movement(end, _speed(layout, sweep), head) + f"{LINE_END}W0"
            for end in _ends(layout, sweep, count)
        ]
        here = sweep.end_deg
    return "".join(f"{line}{LINE_END}" for line in lines)


def schedule_text(turns: Sequence[tuple[str, int, str, int]]) -> str:
    """Write a daily schedule in which scans take turns from midnight to midnight.

    Parameters
    ----------
    turns
        Of each scan: name of its file without the ending, thousands of pulses of a ray, C or S, length of
        its turn [s].

    Returns
    -------
    str
        A line a start: HHMMSS, scan, thousands of pulses, C or S, focus, with tabs between.

    Examples
    --------
    >>> print(schedule_text([("ssm_a", 7, "S", 43200), ("csm_b", 10, "C", 43200)]).replace(chr(9), " "))
    000000 ssm_a 7 S 7
    120000 csm_b 10 C 7
    """
    lines: list[str] = []
    start_s = 0
    while turns and start_s < DAY_S:
        for stem, pulses, kind, turn_s in turns:
            if start_s + turn_s > DAY_S:
                start_s = DAY_S
                break
            clock = f"{start_s // 3600:02d}{start_s // 60 % 60:02d}{start_s % 60:02d}"
            lines.append(f"{clock}\t{stem}\t{pulses}\t{kind}\t{FOCUS}{LINE_END}")
            start_s += turn_s
    return "".join(lines)


def _checked(layout: ScanLayout, path: HeadPath) -> int:
    """Thousands of pulses of one ray, once all limits are checked."""
    if layout.pulse is None:
        device = layout.lidar.device
        known = (
            ", ".join(f"{pulse.pulse_ns:g}" for pulse in device.pulses if pulse.pulse_ns) or "its only one"
        )
        raise InputError(
            f"scan '{layout.name}': {device.name} has no pulse of {layout.spec.pulse_ns} ns; allowed: {known}"
        )
    rate = layout.pulse.pulse_repetition_hz
    why = f"the schedule counts pulses in thousands, at {rate / 1e3:g} kHz"
    pulses = require_accumulation(layout, PULSES_UNIT / rate, why)
    if layout.gates is not None:
        require_gates(layout, None, layout.lidar.device.name)
        require_range(layout)
    require_head(layout, path)
    return pulses


def _turn(layout: ScanLayout, slot_s: int) -> tuple[int, int]:
    """Length of a scan's turn [s] and passes that fit into it."""
    period_s = max(layout.scan.period_s, layout.scan.measured_period_s)
    slots = max(math.ceil((period_s + SPARE_S) / slot_s), 1)
    if slots * slot_s > DAY_S:
        raise InputError(
            f"scan '{layout.name}': one pass takes {period_s:.0f} s, more than a day; take fewer rays"
        )
    return slots * slot_s, math.floor((slots * slot_s - SPARE_S) / period_s)


def _goes_on(layout: ScanLayout) -> bool:
    """Whether the head turns on in the same direction from one pass to the next."""
    return getattr(layout.spec, "sweep", None) == "forward"


def _joined_on(layout: ScanLayout, one_pass: list[Sweep]) -> list[Sweep]:
    """The sweeps of a pass; one that goes round on is a single one by its making."""
    if _goes_on(layout) and len(one_pass) != 1:
        raise InputError(
            f"scan '{layout.name}': its head does not go round at one elevation and cannot go round on; "
            "take sweep: back_and_forth"
        )
    return one_pass


def _ends(layout: ScanLayout, sweep: Sweep, count: int) -> Iterator[FloatArray]:
    """Where the movements of a sweep end: pass after pass, a turn farther each, where the head goes round on."""
    yield sweep.end_deg
    if _goes_on(layout):
        full = abs(abs(float(sweep.turn_deg[0])) - 360.0) < 1e-6
        if not full:
            raise InputError(
                f"scan '{layout.name}': a part of a circle that goes round on measures outside the sector on its way; "
                "take sweep: back_and_forth or reset for this instrument"
            )
        yield from (sweep.end_deg + number * sweep.turn_deg for number in range(1, count))


def _top_speed(head: Head) -> tuple[float, float]:
    return head.azimuth_speed_deg_per_s, head.elevation_speed_deg_per_s


def _speed(layout: ScanLayout, sweep: Sweep) -> FloatArray:
    """(2,) speed of both axes in a sweep [deg/s]."""
    return np.asarray(np.abs(sweep.turn_deg) / (sweep.rays * layout.spec.accumulation_s))


def _movement(to_deg: FloatArray, speed_deg_per_s: FloatArray, head: Head) -> str:
    """One movement of both axes; an axis that stays keeps a speed that moves it, should it be off."""
    parts = []
    limits = (
        (AZIMUTH_COUNTS, head.azimuth_speed_deg_per_s, head.azimuth_acceleration_deg_per_s2),
        (ELEVATION_COUNTS, head.elevation_speed_deg_per_s, head.elevation_acceleration_deg_per_s2),
    )
    for axis, (counts, top, acceleration) in enumerate(limits):
        asked = round(float(speed_deg_per_s[axis]) * counts / SPEED_UNIT)
        speed = asked if asked > 0 else round(top * counts / SPEED_UNIT)
        ramp = round(acceleration * counts / ACCELERATION_UNIT)
        position = round(-float(to_deg[axis]) * counts)
        parts.append(f"A.{axis + 1}={ramp},S.{axis + 1}={speed},P.{axis + 1}={position}")
    return "*".join(parts)
