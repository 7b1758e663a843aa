"""How one axis of a scanner head sweeps: rays along a line, and the time from one pass to the next."""

import math
from typing import Literal

import numpy as np

from geometry.arrays import ArrayLike, FloatArray
from geometry.errors import InputError
from geometry.gates import require_positive
from geometry.head import Axis, turn_time_s

Motion = Literal["continuous", "step"]
Sweep = Literal["back_and_forth", "forward", "reset"]

#: More rays than any scan has: a larger count is a slip in the step and would fill the memory.
MAX_RAYS = 1_000_000

#: How far a sector may be from a whole number of steps [steps]: decimal input is not exact in binary.
STEP_TOLERANCE = 1e-6


def rest_to_rest_s(angle_deg: ArrayLike, axis: Axis) -> FloatArray:
    """Shortest time to turn an axis by an angle from rest to rest [s] (see `geometry.head.turn_time_s`)."""
    return turn_time_s(
        angle_deg, speed_deg_per_s=axis.speed_deg_per_s, acceleration_deg_per_s2=axis.acceleration_deg_per_s2
    )


def reversal_time_s(angle_deg: float, before_deg_per_s: float, after_deg_per_s: float, axis: Axis) -> float:
    """Time to leave one sweep and enter another that starts somewhere else, with a stop in between.

    The head brakes from its sweep speed (and overshoots), turns to where the run-up of the next sweep
    begins, and runs up, so that the first ray of the next sweep begins at full sweep speed.

    Parameters
    ----------
    angle_deg : float
        From the end of the first sweep to the start of the second [deg], signed.
    before_deg_per_s, after_deg_per_s : float
        Signed speeds of the two sweeps [deg/s].
    axis : Axis
        Limits of the axis.

    Returns
    -------
    float
        |v1|/A + |v2|/A + the rest-to-rest time between the two points of rest [s]: turning round on the
        spot takes 2v/A.

    Examples
    --------
    >>> round(reversal_time_s(0.0, 5.0, -5.0, Axis(50, 100)), 6)
    0.1
    """
    twice = 2.0 * axis.acceleration_deg_per_s2
    overshoot = before_deg_per_s * abs(before_deg_per_s) / twice
    run_up = after_deg_per_s * abs(after_deg_per_s) / twice
    ramps = (abs(before_deg_per_s) + abs(after_deg_per_s)) / axis.acceleration_deg_per_s2
    return ramps + float(rest_to_rest_s(angle_deg - overshoot - run_up, axis))


def passing_time_s(angle_deg: float, sweep_deg_per_s: float, axis: Axis) -> float:
    """Shortest time to turn on in the same direction, entering and leaving at the sweep speed.

    Parameters
    ----------
    angle_deg : float
        Angle to turn [deg], not negative.
    sweep_deg_per_s : float
        Speed on entering and leaving [deg/s], from 0 to the limit of the axis.
    axis : Axis
        Limits of the axis.

    Returns
    -------
    float
        Time [s]: from v up to p = min(V, sqrt(v² + A·d)) and down again, the rest of the way at p.

    Examples
    --------
    >>> round(passing_time_s(300.0, 5.0, Axis(50, 100)), 3)
    6.405
    """
    speed, acceleration = axis
    entry = min(sweep_deg_per_s, speed)  # a sweep at the very limit may be above it by rounding
    peak = min(speed, math.sqrt(entry**2 + acceleration * angle_deg))
    if peak == 0.0:
        return 0.0
    ramps_deg = (peak**2 - entry**2) / acceleration
    return 2.0 * (peak - entry) / acceleration + max(angle_deg - ramps_deg, 0.0) / peak


def whole_steps(name: str, size_deg: float, step_deg: float) -> int:
    """Count the steps in an angle; refuse an angle that is no whole number of them.

    Raises
    ------
    InputError
        If the step is not positive, the angle not a whole number of steps (at least 1), or the rays too many.
    """
    require_positive("the step", step_deg, "the degrees from one ray to the next")
    require_positive(name, size_deg, "the degrees that the rays cover")
    if size_deg / step_deg > MAX_RAYS:
        raise InputError(f"{name} {size_deg:g}° by {step_deg:g}° is over {MAX_RAYS} rays: enlarge the step")
    steps = round(size_deg / step_deg)
    if steps < 1 or abs(size_deg / step_deg - steps) > STEP_TOLERANCE:
        fewer = max(math.floor(size_deg / step_deg), 1)
        raise InputError(
            f"{name} {size_deg:g}° is no whole number of steps of {step_deg:g}°: "
            f"take {fewer * step_deg:g}° or {(fewer + 1) * step_deg:g}°, or a step of {size_deg / fewer:g}°"
        )
    return steps


def line(
    name: str, from_deg: float, size_deg: float, step_deg: float, motion: Motion
) -> tuple[FloatArray, FloatArray]:
    """Rays along a line that the beam sweeps at constant speed or in steps.

    Parameters
    ----------
    name : str
        What the size is called where the user gave it, for an error.
    from_deg, size_deg : float
        Start and signed size of the line [deg].
    step_deg : float
        Angle from one ray to the next [deg], positive.
    motion : "continuous" or "step"
        N middles half a step inside the ends, or N + 1 rays with one at each end.

    Returns
    -------
    position_deg, swept_deg : arrays (ray,)
        Middle of each ray [deg], not wrapped, and its signed turn during the ray [deg].

    Raises
    ------
    InputError
        As in `whole_steps`.

    Examples
    --------
    >>> line("sector_deg", 0, 6, 2, "continuous")
    (array([1., 3., 5.]), array([2., 2., 2.]))
    >>> line("sector_deg", 0, -6, 2, "step")
    (array([ 0., -2., -4., -6.]), array([0., 0., 0., 0.]))
    """
    steps = whole_steps(name, abs(size_deg), step_deg)
    if motion == "continuous":
        swept = np.full(steps, size_deg / steps)
        return from_deg + swept * (np.arange(steps) + 0.5), swept
    return from_deg + size_deg * (np.arange(steps + 1) / steps), np.zeros(steps + 1)


def ray_time_s(accumulation_s: float, swept_deg: FloatArray, speed_deg_per_s: float) -> float:
    """Time that one ray takes [s]: the accumulation, or longer if the head cannot turn so far in it.

    Raises
    ------
    InputError
        If the accumulation is not finite and positive.
    """
    require_positive("accumulation_s", accumulation_s, "the seconds that one ray takes")
    return max(accumulation_s, abs(float(swept_deg[0])) / speed_deg_per_s)


def gap_s(position_deg: FloatArray, swept_deg: FloatArray, axis: Axis) -> float:
    """Time from the end of one ray to the start of the next [s]: none while the head moves on."""
    if swept_deg[0] != 0.0 or len(position_deg) == 1:
        return 0.0
    return float(rest_to_rest_s(position_deg[1] - position_deg[0], axis))


def closing_s(
    position_deg: FloatArray, swept_deg: FloatArray, ray_s: float, sweep: Sweep, axis: Axis
) -> float:
    """Time from the end of a line's last ray to the start of the next pass [s], turn-round included."""
    speed = float(swept_deg[0]) / ray_s
    covered = float(position_deg[-1] - position_deg[0] + swept_deg[0])
    if sweep == "back_and_forth":
        return reversal_time_s(0.0, speed, -speed, axis)
    if sweep == "reset":
        return reversal_time_s(-covered, speed, speed, axis)
    return passing_time_s(max(360.0 - covered, 0.0), speed, axis)
