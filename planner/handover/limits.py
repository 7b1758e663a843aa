"""What an instrument can do, checked before a file is written for it."""

import math

import numpy as np

from geometry.errors import InputError
from geometry.gates import Gates
from planner.handover.head_path import HeadPath
from planner.instruments import Head
from planner.scan_layout import ScanLayout

# How far a number may be from a whole count: decimal input is not exact in binary.
WHOLE = 1e-6


def require_accumulation(layout: ScanLayout, step_s: float, why: str) -> int:
    """Count the steps of the accumulation time.

    Raises
    ------
    InputError
        If it is no whole number of steps, with the nearest times that are.
    """
    accumulation_s = layout.spec.accumulation_s
    steps = accumulation_s / step_s
    if round(steps) < 1 or abs(steps - round(steps)) > WHOLE * max(steps, 1.0):
        fewer = max(math.floor(steps), 1)
        raise InputError(
            f"scan '{layout.name}': accumulation_s {accumulation_s:g} came; allowed are steps of {step_s * 1e3:.6g} ms "
            f"({why}). Take {fewer * step_s:.6g} or {(fewer + 1) * step_s:.6g} s."
        )
    return round(steps)


def require_gates(layout: ScanLayout, most: int | None, what: str) -> Gates:
    """Give a scan's gates: it must have some, and no more than a file (`most`) or the instrument takes, where known.

    Raises
    ------
    InputError
        If not.
    """
    if layout.gates is None:
        raise InputError(
            f"scan '{layout.name}': no gates are declared, and {what} needs them; add "
            "gates: {first_m: ..., spacing_m: ..., count: ...} to the scan, or export with --gates FIRST,SPACING,COUNT"
        )
    limits = [limit for limit in (most, layout.lidar.device.max_gates) if limit is not None]
    if limits and layout.gates.count > (limit := min(limits)):
        raise InputError(
            f"scan '{layout.name}': {layout.gates.count} gates came; {what} takes {limit} at most. "
            "Make the spacing wider or the stretch shorter."
        )
    return layout.gates


def require_range(layout: ScanLayout) -> None:
    """Check that the gates lie within the instrument's range.

    Raises
    ------
    InputError
        If the last gate lies beyond it.
    """
    gates, most_m = layout.gates, layout.lidar.device.max_range_m
    if gates is not None and most_m is not None and gates.last_m > most_m:
        raise InputError(
            f"scan '{layout.name}': the last gate lies at {gates.last_m:g} m; {layout.lidar.device.name} sees "
            f"{most_m:g} m at most. Take fewer gates."
        )


def require_head(layout: ScanLayout, path: HeadPath) -> Head:
    """Check the head's elevations and speeds, and give the head.

    Raises
    ------
    InputError
        If the head is not described, or the scan asks more than it can do.
    """
    device = layout.lidar.device
    head = device.head
    if head is None:
        raise InputError(
            f"lidar '{layout.lidar.name}': nothing is known of the head of {device.name}; write the instrument "
            "as a mapping with its `head` in the site file"
        )
    _require_elevation(layout, path, head)
    asked = layout.scan.asked_speed_deg_per_s
    for axis, wanted, most in zip(
        ("azimuth", "elevation"),
        asked,
        (head.azimuth_speed_deg_per_s, head.elevation_speed_deg_per_s),
        strict=True,
    ):
        if wanted > most * (1 + WHOLE):
            raise InputError(
                f"scan '{layout.name}': its rays ask for {wanted:.4g} °/s in {axis}; the head turns at {most:g} °/s "
                "at most. Take a smaller step or a longer accumulation."
            )
    return head


def _require_elevation(layout: ScanLayout, path: HeadPath, head: Head) -> None:
    elevation = np.concatenate([path.begin_deg[:, 1], path.end_deg[:, 1]])
    least, most = head.elevation_min_deg, head.elevation_max_deg
    low, high = float(elevation.min()), float(elevation.max())
    if (least is not None and low < least - WHOLE) or (most is not None and high > most + WHOLE):
        allowed = f"{'-∞' if least is None else f'{least:g}'} to {'∞' if most is None else f'{most:g}'}°"
        raise InputError(
            f"scan '{layout.name}': head elevations of {low:.3f} to {high:.3f}° are asked for; the head of "
            f"{layout.lidar.name} goes from {allowed}. Change the target's height or the scan."
        )
