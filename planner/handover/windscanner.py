"""Motion program and range-gate table of a long-range WindScanner.

The motion program is in the language of the controller (Delta Tau Turbo PMAC): X is the azimuth, Y the
elevation of the head [deg], absolute; TM and TA are the times of a move and of its ramps [ms]; motor 3 gives
the triggers of the laser, one count a pulse, at I322 counts a millisecond. A program runs until the client
sets P1001 to -78. What else a client exchanges with the controller (synchronisation of several scanners) differs
from one installation to another and is not in here.

None of these programs has been run on a scanner: read them through, and try them with the laser off.

References
----------
The range-gate table and the numbers 1983, P1001 and I322 are those with which N. Vasiljević's
campaign-planning-tool (DTU Wind Energy, 2019) talks to the WindScanner client software.
"""

import math
from collections.abc import Sequence

import numpy as np

from geometry.arrays import FloatArray
from geometry.errors import InputError
from planner.handover.head_path import HeadPath, Sweep, head_path, ray_order, sweeps
from planner.handover.limits import require_accumulation, require_gates, require_head, require_range
from planner.handover.names import file_stem, file_stems
from planner.instruments import Head
from planner.scan_layout import ScanLayout

MAKER = "windscanner"  # how the names of these instruments begin

MODES = {400.0: "Long", 200.0: "Middle", 100.0: "Short"}  # by the length of the pulse [ns]
MOST_GATES = 100
ACCUMULATION_STEP_S = 0.1
MOST_LINES = 1000  # of a range-gate table and of a program: more is not known to fit into the controller
FFT_POINTS = (64, 128, 256)

PROGRAM = 1983
STOP = "P1001!=-78"
START_DEG_PER_S = 5
START_RAMP_MS = 500
SETTLE_MS = 1  # at rest before the triggers begin; the dwell also keeps the controller from reading on

LINE_END = "\r\n"


def windscanner_files(layouts: Sequence[ScanLayout]) -> dict[str, str]:
    """Write motion program and range-gate table for each scan of one lidar.

    Parameters
    ----------
    layouts
        The lidar's scans.

    Returns
    -------
    dict of str to str
        Text by file name: `<scan>_motion.pmc` and `<scan>_range_gates.txt`.

    Raises
    ------
    InputError
        If a scan is not one that the lidar can do.
    """
    stems = file_stems(layout.name for layout in layouts)
    files: dict[str, str] = {}
    for layout in layouts:
        stem = stems[layout.name]
        files[f"{stem}_motion.pmc"] = motion_program(layout)
        files[f"{stem}_range_gates.txt"] = range_gate_table(layout)
    return files


def range_gate_table(layout: ScanLayout) -> str:
    """Write the range-gate table: pulse mode, farthest gate, FFT size, then a line a ray.

    Parameters
    ----------
    layout
        The scan; its gates count from the instrument's own zero.

    Returns
    -------
    str
        Lines with tabs: number of the ray, accumulation [ms], centres of the gates [m], whole metres.

    Raises
    ------
    InputError
        If gates, pulse, FFT or accumulation are not the instrument's.
    """
    centres = require_gates(layout, MOST_GATES, "a range-gate table").centres_m
    require_range(layout)
    accumulation_ms = 100 * require_accumulation(
        layout, ACCUMULATION_STEP_S, "accumulation of the WindScanner"
    )
    pulse_ns, fft_points = _pulse(layout)
    whole = np.round(centres)
    if np.abs(centres - whole).max() > 1e-6:
        raise InputError(
            f"scan '{layout.name}': gates at {centres[0]:g}, {centres[1] if len(centres) > 1 else centres[0]:g} m ... "
            "came; the table takes whole metres. Round first_m and spacing_m."
        )
    row = "\t".join(f"{value:.0f}" for value in whole)
    head = [f"LidarMode\t{MODES[pulse_ns]}", f"MaxDistance\t{whole[-1]:.0f}", f"FFTSize\t{fft_points}"]
    rows = [f"{number + 1}\t{accumulation_ms}\t{row}" for number in range(_rays(layout))]
    return "".join(f"{line}{LINE_END}" for line in (*head, *rows))


def motion_program(layout: ScanLayout) -> str:
    """Write the motion program: one round through the scan's rays, again and again.

    Parameters
    ----------
    layout
        The scan.

    Returns
    -------
    str
        The program.

    Raises
    ------
    InputError
        If the scan asks more than the head can do.

    Notes
    -----
    A move of d degrees takes TM + TA with top speed d/TM and acceleration d/(TM·TA), both at most the
    head's; TM >= TA. A sweep at constant speed v begins v²/2A before its first ray and ends as much after its last.
    """
    path = head_path(layout)
    head = require_head(layout, path)
    accumulation_ms = 100 * require_accumulation(
        layout, ACCUMULATION_STEP_S, "accumulation of the WindScanner"
    )
    pulses_per_ms = _pulse_rate(layout) / 1000
    one_round = _round(layout, path)
    lines = [
        f"; {file_stem(layout.lidar.name)}, scan {file_stem(layout.name)}: head angles, X azimuth, Y elevation [deg]",
        f"; {_rays(layout)} rays of {accumulation_ms} ms; laser off for the first try",
        "CLOSE",
        f"OPEN PROG {PROGRAM} CLEAR",
        "LINEAR",
        "ABS",
        f"I322={pulses_per_ms:g}",
        *_start(one_round[-1].end_deg),
        f"WHILE({STOP})",
    ]
    here = one_round[-1].end_deg
    for sweep in one_round:
        lines += _sweep_lines(layout, sweep, here, head, pulses_per_ms)
        here = sweep.end_deg
    return "".join(f"{line}{LINE_END}" for line in (*lines, "ENDWHILE", 'CMD"#3j/"', "CLOSE"))


def _start(at_deg: FloatArray) -> list[str]:
    """Slowly to where a round ends, from wherever the head is."""
    return [f"TA({START_RAMP_MS})F({START_DEG_PER_S})", _target(at_deg), f"DWELL{SETTLE_MS}"]


def _sweep_lines(
    layout: ScanLayout, sweep: Sweep, here_deg: FloatArray, head: Head, pulses_per_ms: float
) -> list[str]:
    """To the start of a sweep, and through it with the laser triggered."""
    total_ms = sweep.rays * layout.spec.accumulation_s * 1e3
    trigger = f'CMD"#3j^{round(total_ms * pulses_per_ms)}"'
    if not sweep.moving:
        return [*_move(here_deg, sweep.begin_deg, head), f"DWELL{SETTLE_MS}", trigger, f"DWELL{total_ms:g}"]
    speed = sweep.turn_deg / (total_ms / 1e3)
    ramp_s = max(
        np.abs(speed)
        / np.array([head.azimuth_acceleration_deg_per_s2, head.elevation_acceleration_deg_per_s2])
    )
    ramp_s = math.ceil(1e3 * ramp_s) / 1e3  # whole milliseconds
    run_up = speed * ramp_s / 2
    return [
        *_move(here_deg, sweep.begin_deg - run_up, head),
        f"DWELL{SETTLE_MS}",
        f"TA({ramp_s * 1e3:g})TM({total_ms + ramp_s * 1e3:g})",
        _target(sweep.end_deg + run_up),
        *_wait(ramp_s * 1e3),
        trigger,
        *_wait(total_ms),
        f"DWELL{SETTLE_MS}",
    ]


def _move(here_deg: FloatArray, to_deg: FloatArray, head: Head) -> list[str]:
    """A move from rest to rest, as fast as both axes allow, in whole milliseconds."""
    turn = np.abs(to_deg - here_deg)
    longest = float((turn / np.array([head.azimuth_speed_deg_per_s, head.elevation_speed_deg_per_s])).max())
    steepest = float(
        (
            turn / np.array([head.azimuth_acceleration_deg_per_s2, head.elevation_acceleration_deg_per_s2])
        ).max()
    )
    move_ms = max(math.ceil(1e3 * max(longest, math.sqrt(steepest))), 1)
    ramp_ms = max(math.ceil(1e6 * steepest / move_ms), 1)
    return [f"TA({ramp_ms})TM({move_ms})", _target(to_deg)]


def _target(to_deg: FloatArray) -> str:
    azimuth, elevation = (float(value) for value in np.round(to_deg, 4) + 0.0)
    return f"X({azimuth:.4f})Y({elevation:.4f})"


def _wait(time_ms: float) -> list[str]:
    """Wait by the controller's timer while the head moves on."""
    return [f"I5111={time_ms:g}*8388608/I10", "WHILE(I5111>0)", "ENDWHILE"]


def _round(layout: ScanLayout, path: HeadPath) -> list[Sweep]:
    """What is repeated for ever: a pass, with its way back where the scan goes back and forth."""
    if getattr(layout.spec, "sweep", None) == "forward":
        raise InputError(
            f"scan '{layout.name}': sweep: forward came; a motion program has an end and a way back. "
            "Take sweep: back_and_forth or reset."
        )
    one_pass = sweeps(path)
    if sum(sweep.rays for sweep in one_pass) == 1:
        return one_pass
    back = [sweep.reversed() for sweep in reversed(one_pass)] if layout.scan.back_and_forth else []
    both = one_pass + back
    if len(both) > MOST_LINES:
        raise InputError(
            f"scan '{layout.name}': {len(both)} movements came; a motion program takes {MOST_LINES} at most. "
            "Take larger steps, or motion: continuous."
        )
    return both


def _rays(layout: ScanLayout) -> int:
    """Rays of one round, the way back included."""
    count = layout.scan.count
    rays = len(ray_order(layout.scan, 2 if layout.scan.back_and_forth and count > 1 else 1))
    if rays > MOST_LINES:
        raise InputError(
            f"scan '{layout.name}': {rays} rays came in one round; a range-gate table takes {MOST_LINES} at most. "
            "Take larger steps."
        )
    return rays


def _pulse(layout: ScanLayout) -> tuple[float, int]:
    """Pulse length [ns] and FFT points, checked."""
    pulse = layout.pulse
    pulse_ns = layout.spec.pulse_ns or (pulse.pulse_ns if pulse else None)
    fft_points = layout.spec.fft_points or (pulse.fft_points if pulse else None)
    if pulse_ns not in MODES:
        allowed = ", ".join(f"{key:g} ({mode})" for key, mode in MODES.items())
        raise InputError(f"scan '{layout.name}': pulse_ns {pulse_ns} came; allowed: {allowed}")
    if fft_points not in FFT_POINTS:
        raise InputError(
            f"scan '{layout.name}': fft_points {fft_points} came; allowed: {', '.join(map(str, FFT_POINTS))}"
        )
    return float(pulse_ns), int(fft_points)


def _pulse_rate(layout: ScanLayout) -> float:
    """Pulses per second, of a pulse that is one of the modes."""
    _pulse(layout)
    if layout.pulse is None:
        raise InputError(
            f"scan '{layout.name}': {layout.lidar.device.name} has no pulse of {layout.spec.pulse_ns} ns; "
            "its repetition frequency is not known"
        )
    return layout.pulse.pulse_repetition_hz
