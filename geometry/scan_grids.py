"""Scans of single directions: stare, raster and list of points (see `geometry.scans` for how they move)."""

from typing import Literal

import numpy as np

from geometry.angles import wrap_180_deg
from geometry.arrays import ArrayLike, FloatArray
from geometry.errors import InputError
from geometry.head import HeadLimits, move_time_s
from geometry.scan import Scan
from geometry.scan_build import assemble, require_elevation, require_finite
from geometry.sweeps import MAX_RAYS, Motion, gap_s, line, ray_time_s, rest_to_rest_s, reversal_time_s


def stare(
    azimuth_deg: float, elevation_deg: float, *, accumulation_s: float, period_s: float | None = None
) -> Scan:
    """Make a stare: one direction, one ray after the other.

    Parameters
    ----------
    azimuth_deg, elevation_deg : float
        Direction of the beam [deg].
    accumulation_s : float
        Duration of one ray [s].
    period_s : float, optional
        Declared time from one ray to the next [s]; the accumulation if not given.

    Returns
    -------
    Scan
        One ray.

    Raises
    ------
    InputError
        If a number is outside its limits.

    Examples
    --------
    >>> stare(186.5, 6.1, accumulation_s=0.5).scans_in(600)
    1200
    """
    require_finite("azimuth_deg", azimuth_deg)
    require_elevation(elevation_deg)
    return assemble(
        "stare",
        (np.array([azimuth_deg]), np.array([elevation_deg])),
        (np.zeros(1), np.zeros(1)),
        ray_s=accumulation_s,
        gaps_s=np.zeros(0),
        after_s=0.0,
        accumulation_s=accumulation_s,
        period_s=period_s,
        back_and_forth=False,
    )


def raster(
    axis_azimuth_deg: float,
    axis_elevation_deg: float,
    *,
    width_deg: float,
    height_deg: float,
    step_deg: float,
    accumulation_s: float,
    head: HeadLimits,
    elevation_step_deg: float | None = None,
    motion: Motion = "step",
    sweep: Literal["back_and_forth", "reset"] = "back_and_forth",
    period_s: float | None = None,
) -> Scan:
    """Make a raster: rows of azimuth, one above the other, every second row in reverse (serpentine).

    Parameters
    ----------
    axis_azimuth_deg, axis_elevation_deg : float
        Middle of the raster [deg].
    width_deg, height_deg : float
        What it covers [deg], whole numbers of steps; the lowest row comes first.
    step_deg, elevation_step_deg : float
        Steps in azimuth and elevation [deg]; the elevation's is the azimuth's if not given.
    accumulation_s, head, period_s
        As in `sector`.
    motion : "step" or "continuous"
        How the head moves along a row; rows stand at both ends of the height in either.
    sweep : "back_and_forth" or "reset"
        The next pass runs through all rays in reverse, or starts again at the first.

    Returns
    -------
    Scan
        Rays in the order in which they are measured.

    Raises
    ------
    InputError
        If a number is outside its limits, or width or height are no whole numbers of steps.

    Examples
    --------
    >>> head = HeadLimits(50, 50, 100, 100)
    >>> scan = raster(90, 5, width_deg=2, height_deg=1, step_deg=1, accumulation_s=0.2, head=head)
    >>> scan.azimuth_deg, scan.elevation_deg
    (array([89., 90., 91., 91., 90., 89.]), array([4.5, 4.5, 4.5, 5.5, 5.5, 5.5]))
    """
    require_finite("axis_azimuth_deg", axis_azimuth_deg)
    require_elevation(axis_elevation_deg - 0.5 * height_deg)
    require_elevation(axis_elevation_deg + 0.5 * height_deg)
    if not (0 < width_deg < 360 and height_deg > 0):
        raise InputError(
            f"a raster of {width_deg}° by {height_deg}°: give a width under 360 and a height, both above 0"
        )
    rise = step_deg if elevation_step_deg is None else elevation_step_deg
    across, swept = line("width_deg", axis_azimuth_deg - 0.5 * width_deg, width_deg, step_deg, motion)
    levels, _ = line("height_deg", axis_elevation_deg - 0.5 * height_deg, height_deg, rise, "step")
    if len(across) * len(levels) > MAX_RAYS:
        raise InputError(
            f"a raster of {len(across)} x {len(levels)} rays is over {MAX_RAYS}: enlarge the steps"
        )
    forth = (np.arange(len(levels)) % 2 == 0)[:, None]
    azimuth, turned = (np.where(forth, across, across[::-1]).ravel(), np.where(forth, swept, -swept).ravel())
    ray_s = ray_time_s(accumulation_s, swept, head.azimuth.speed_deg_per_s)
    speed = float(swept[0]) / ray_s
    round_s = reversal_time_s(0.0, speed, -speed, head.azimuth)
    gaps = np.full(len(azimuth), gap_s(across, swept, head.azimuth))
    gaps[len(across) - 1 :: len(across)] = max(
        round_s, float(rest_to_rest_s(levels[1] - levels[0], head.elevation))
    )
    return assemble(
        "raster",
        (azimuth, np.repeat(levels, len(across))),
        (turned, np.zeros_like(turned)),
        ray_s=ray_s,
        gaps_s=gaps[:-1],
        after_s=round_s
        if sweep == "back_and_forth"
        else _raster_reset_s(azimuth, turned, height_deg, ray_s, head),
        accumulation_s=accumulation_s,
        period_s=period_s,
        back_and_forth=sweep == "back_and_forth",
    )


def points(
    azimuth_deg: ArrayLike,
    elevation_deg: ArrayLike,
    *,
    accumulation_s: float,
    head: HeadLimits,
    sweep: Literal["back_and_forth", "reset"] = "reset",
    period_s: float | None = None,
) -> Scan:
    """Make a scan of listed directions in the given order, standing still for each.

    Parameters
    ----------
    azimuth_deg, elevation_deg : array_like (ray,)
        Directions [deg], elevations -90 to 90. From one to the next the azimuth turns the shorter way.
    accumulation_s : float
        Duration of one ray [s].
    head : HeadLimits
        Speed and acceleration of the scanner head; both axes turn together.
    sweep : "reset" or "back_and_forth"
        Back to the first direction after the last, or through the list in reverse.
    period_s : float, optional
        Declared time from one pass to the next [s].

    Returns
    -------
    Scan
        One ray for each direction.

    Raises
    ------
    InputError
        If the lists are empty, unequal, not finite or beyond the limits.

    Examples
    --------
    >>> scan = points([350, 0, 90], [5, 5, 5], accumulation_s=1, head=HeadLimits(50, 50, 100, 100))
    >>> scan.time_s.round(3)
    array([0.5  , 2.132, 5.432])
    """
    azimuth = np.atleast_1d(np.asarray(azimuth_deg, dtype=np.float64))
    elevation = np.atleast_1d(np.asarray(elevation_deg, dtype=np.float64))
    if azimuth.ndim != 1 or azimuth.shape != elevation.shape or len(azimuth) == 0:
        raise InputError(
            f"points with {azimuth.size} azimuths and {elevation.size} elevations: give one of each"
        )
    if not (np.all(np.isfinite(azimuth)) and np.all(np.abs(elevation) <= 90)):
        raise InputError(
            "a direction of the points is no number or too steep: give elevations from -90 to 90 degrees"
        )
    closed_azimuth, closed_elevation = (np.append(azimuth, azimuth[0]), np.append(elevation, elevation[0]))
    moves_s = move_time_s(wrap_180_deg(np.diff(closed_azimuth)), np.diff(closed_elevation), head)
    return assemble(
        "points",
        (azimuth, elevation),
        (np.zeros_like(azimuth), np.zeros_like(azimuth)),
        ray_s=accumulation_s,
        gaps_s=moves_s[:-1],
        after_s=0.0 if sweep == "back_and_forth" else float(moves_s[-1]),
        accumulation_s=accumulation_s,
        period_s=period_s,
        back_and_forth=sweep == "back_and_forth",
    )


def _raster_reset_s(
    azimuth_deg: FloatArray, swept_deg: FloatArray, height_deg: float, ray_s: float, head: HeadLimits
) -> float:
    """Time from the end of a raster's last ray back to the start of its first [s]: the slower axis counts."""
    start = float(azimuth_deg[0] - 0.5 * swept_deg[0])
    end = float(azimuth_deg[-1] + 0.5 * swept_deg[-1])
    across = reversal_time_s(
        start - end, float(swept_deg[-1]) / ray_s, float(swept_deg[0]) / ray_s, head.azimuth
    )
    return max(across, float(rest_to_rest_s(height_deg, head.elevation)))
