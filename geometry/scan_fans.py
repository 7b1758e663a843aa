"""Scans that sweep one axis: sector, full PPI and RHI (see `geometry.scans` for how they move)."""

from dataclasses import replace
from typing import Literal

import numpy as np

from geometry.errors import InputError
from geometry.head import HeadLimits
from geometry.scan import Scan
from geometry.scan_build import assemble, require_elevation, require_finite
from geometry.sweeps import Motion, Sweep, closing_s, gap_s, line, ray_time_s


def sector(
    axis_azimuth_deg: float,
    elevation_deg: float,
    *,
    sector_deg: float,
    step_deg: float,
    accumulation_s: float,
    head: HeadLimits,
    motion: Motion = "continuous",
    sweep: Sweep = "back_and_forth",
    period_s: float | None = None,
) -> Scan:
    """Make a sector scan: a part of a PPI, at one elevation.

    Parameters
    ----------
    axis_azimuth_deg : float
        Middle of the sector [deg].
    elevation_deg : float
        Elevation of every ray [deg], -90 to 90.
    sector_deg : float
        What the beam sweeps [deg], more than 0, at most 360, a whole number of steps.
    step_deg : float
        Turn from one ray to the next [deg].
    accumulation_s : float
        Duration of one ray [s].
    head : HeadLimits
        Speed and acceleration of the scanner head.
    motion : "continuous" or "step"
        Turn while measuring, or stand for each ray.
    sweep : "back_and_forth", "forward" or "reset"
        How the next pass begins (see the module's text).
    period_s : float, optional
        Declared time from one pass to the next [s]: wins over what head and accumulation give. Where it
        is too short for the rays, their times are pressed together to fit.

    Returns
    -------
    Scan
        Rays in clockwise order. A continuous ray takes the accumulation time, or longer if the head cannot
        turn by a step in it. Of a full circle in steps, start and end are one ray.

    Raises
    ------
    InputError
        If a number is outside its limits or the sector is no whole number of steps.

    Examples
    --------
    >>> head = HeadLimits(50, 50, 100, 100)
    >>> scan = sector(191.31, 5.96, sector_deg=60, step_deg=2, accumulation_s=0.4, period_s=12, head=head)
    >>> scan.count, round(float(scan.azimuth_deg[-1] - scan.azimuth_deg[0]), 6)
    (30, 58.0)
    >>> round(scan.measured_period_s, 3), scan.scans_in(600)
    (12.1, 50)
    """
    require_finite("axis_azimuth_deg", axis_azimuth_deg)
    require_elevation(elevation_deg)
    if not 0 < sector_deg <= 360:
        raise InputError(f"sector_deg is {sector_deg}: give more than 0 and at most 360 degrees")
    start = axis_azimuth_deg - 0.5 * sector_deg
    azimuth, swept = line("sector_deg", start, sector_deg, step_deg, motion)
    if motion == "step" and sector_deg == 360:
        azimuth, swept = azimuth[:-1], swept[:-1]
    ray_s = ray_time_s(accumulation_s, swept, head.azimuth.speed_deg_per_s)
    return assemble(
        "sector",
        (azimuth, np.full_like(azimuth, elevation_deg)),
        (swept, np.zeros_like(swept)),
        ray_s=ray_s,
        gaps_s=np.full(len(azimuth) - 1, gap_s(azimuth, swept, head.azimuth)),
        after_s=closing_s(azimuth, swept, ray_s, sweep, head.azimuth),
        accumulation_s=accumulation_s,
        period_s=period_s,
        back_and_forth=sweep == "back_and_forth",
    )


def ppi(
    elevation_deg: float,
    *,
    step_deg: float,
    accumulation_s: float,
    head: HeadLimits,
    start_azimuth_deg: float = 0.0,
    motion: Motion = "continuous",
    sweep: Sweep = "forward",
    period_s: float | None = None,
) -> Scan:
    """Make a full PPI: the whole circle at one elevation, clockwise from a start.

    Parameters
    ----------
    elevation_deg, step_deg, accumulation_s, head, motion, sweep, period_s
        As in `sector`; 360 must be a whole number of steps.
    start_azimuth_deg : float
        Where the beam begins to sweep [deg].

    Returns
    -------
    Scan
        360/Δ rays; going forward in continuous motion nothing is lost between two passes.

    Raises
    ------
    InputError
        As in `sector`.

    Examples
    --------
    >>> scan = ppi(75, step_deg=2, accumulation_s=0.5, head=HeadLimits(50, 50, 100, 100))
    >>> scan.count, scan.measured_period_s, float(scan.azimuth_deg[0])
    (180, 90.0, 1.0)
    """
    circle = sector(
        start_azimuth_deg + 180.0,
        elevation_deg,
        sector_deg=360.0,
        step_deg=step_deg,
        accumulation_s=accumulation_s,
        head=head,
        motion=motion,
        sweep=sweep,
        period_s=period_s,
    )
    return replace(circle, kind="ppi")


def rhi(
    azimuth_deg: float,
    *,
    from_deg: float,
    to_deg: float,
    step_deg: float,
    accumulation_s: float,
    head: HeadLimits,
    motion: Motion = "continuous",
    sweep: Literal["back_and_forth", "reset"] = "back_and_forth",
    period_s: float | None = None,
) -> Scan:
    """Make an RHI: a fan in elevation at one azimuth, which may cross the zenith.

    Parameters
    ----------
    azimuth_deg : float
        Azimuth of the rays before the zenith [deg].
    from_deg, to_deg : float
        Elevations between which the beam sweeps [deg], -90 to 270; beyond 90 the head is over the top.
    step_deg, accumulation_s, head, motion, period_s
        As in `sector`.
    sweep : "back_and_forth" or "reset"
        How the next pass begins.

    Returns
    -------
    Scan
        Rays from `from_deg` to `to_deg`. Beyond the zenith azimuths are turned by 180° and elevations (and
        the sign of their sweep) are those above the horizon, never more than 90.

    Raises
    ------
    InputError
        If a number is outside its limits or the fan is no whole number of steps.

    Examples
    --------
    >>> head = HeadLimits(50, 50, 100, 100)
    >>> scan = rhi(20, from_deg=60, to_deg=120, step_deg=20, accumulation_s=1, head=head)
    >>> scan.azimuth_deg, scan.elevation_deg
    (array([ 20.,  20., 200.]), array([70., 90., 70.]))
    """
    require_finite("azimuth_deg", azimuth_deg)
    if not (-90 <= from_deg <= 270 and -90 <= to_deg <= 270) or from_deg == to_deg:
        raise InputError(
            f"an RHI from {from_deg} to {to_deg}: give two elevations from -90 to 270 that differ"
        )
    elevation, swept = line("RHI from from_deg to to_deg", from_deg, to_deg - from_deg, step_deg, motion)
    over = elevation > 90.0
    ray_s = ray_time_s(accumulation_s, swept, head.elevation.speed_deg_per_s)
    return assemble(
        "rhi",
        (np.where(over, azimuth_deg + 180.0, azimuth_deg), np.where(over, 180.0 - elevation, elevation)),
        (np.zeros_like(swept), np.where(over, -swept, swept)),
        ray_s=ray_s,
        gaps_s=np.full(len(elevation) - 1, gap_s(elevation, swept, head.elevation)),
        after_s=closing_s(elevation, swept, ray_s, sweep, head.elevation),
        accumulation_s=accumulation_s,
        period_s=period_s,
        back_and_forth=sweep == "back_and_forth",
    )
