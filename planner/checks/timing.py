"""Scan times against head and instrument, and the wind's speed against the radial-speed limit."""

from collections.abc import Iterator

from planner.finding import Finding, Severity
from planner.plan import Plan
from planner.scan_layout import ScanLayout
from reconstruct.periods import TEN_MINUTES_S

# Scans in ten minutes.
FEWEST_SCANS = 12
# Declared against computed, and against that of the scan it runs with; periods are written down to a tenth of a second.
PERIOD_TOLERANCE_S = 0.05
# A sector whose axis is farther from the prevailing wind sees more of it across than along.
AXIS_LIMIT_DEG = 45.0
# Rounding of a product of ray number and time.
ROUNDING_S = 1e-6


def find(plan: Plan) -> Iterator[Finding]:
    """Findings about time and speed."""
    for layout in plan.layouts:
        yield from _accumulation(layout)
        yield from _head_speed(layout)
        yield from _period(layout)
        yield from _scan_count(layout)
        yield from _radial_speed(plan, layout)
        yield from _sector_axis(plan, layout)


def _accumulation(layout: ScanLayout) -> Iterator[Finding]:
    """Time of a ray against the instrument's least."""
    accumulation_s, least_s = layout.spec.accumulation_s, layout.lidar.device.min_accumulation_s
    if least_s is not None and accumulation_s < least_s:
        text = (
            f"a ray is to take {accumulation_s:g} s, {layout.lidar.device.name} takes {least_s:g} s at "
            "least: accumulate longer"
        )
        yield Finding("error", "accumulation", layout.name, accumulation_s, "s", least_s, text)


def _head_speed(layout: ScanLayout) -> Iterator[Finding]:
    """Speed that the rays ask of the head against what it can do."""
    head = layout.lidar.device.head
    if head is None:
        return
    azimuth_speed, elevation_speed = layout.scan.asked_speed_deg_per_s
    for name, asked, limit in (
        ("azimuth", azimuth_speed, head.azimuth_speed_deg_per_s),
        ("elevation", elevation_speed, head.elevation_speed_deg_per_s),
    ):
        if asked > limit:
            text = (
                f"{name} has to turn at {asked:.1f}°/s to sweep a ray in {layout.spec.accumulation_s:g} s, "
                f"the head turns at {limit:g}°/s: rays are counted as longer; accumulate longer or take "
                "smaller steps"
            )
            yield Finding("error", "head-speed", layout.name, asked, "deg/s", limit, text)


def _period(layout: ScanLayout) -> Iterator[Finding]:
    """Declared period against what rays and head need."""
    declared_s, needed_s = layout.spec.period_s, layout.scan.measured_period_s
    if declared_s is None or abs(declared_s - needed_s) <= PERIOD_TOLERANCE_S:
        return
    severity: Severity = "info"
    if declared_s >= needed_s:
        text = (
            f"period_s is declared as {declared_s:g} s, rays and turning take {needed_s:.2f} s: the declared "
            "one is used and the head waits; a shorter one would give more scans"
        )
    else:
        severity = "error" if declared_s < layout.rays_s - ROUNDING_S else "warning"
        text = (
            f"period_s is declared as {declared_s:g} s, but the rays take {layout.rays_s:.2f} s and with "
            f"turning {needed_s:.2f} s: the declared one is used, though the head cannot keep it; declare "
            f"{needed_s:.2f} s or shorten the rays"
        )
    yield Finding(severity, "period-declared", layout.name, declared_s, "s", needed_s, text)


def _scan_count(layout: ScanLayout) -> Iterator[Finding]:
    """Scans in ten minutes; a raster that looks for a hard target needs none."""
    count = layout.scan.scans_in(TEN_MINUTES_S)
    if layout.measures_wind and count < FEWEST_SCANS:
        text = (
            f"{count} scans of {layout.scan.period_s:.1f} s fit into ten minutes, under {FEWEST_SCANS}: a "
            "mean of so few follows the gusts that it happens to meet; take fewer or shorter rays"
        )
        yield Finding("warning", "scan-count", layout.name, count, "scans", FEWEST_SCANS, text)


def _radial_speed(plan: Plan, layout: ScanLayout) -> Iterator[Finding]:
    """Fastest wanted wind with its gusts against what the instrument can tell."""
    limit_mps, gust_mps = layout.lidar.device.radial_speed_limit_mps, plan.largest_gust_mps(layout)
    if limit_mps is not None and layout.measures_wind and gust_mps > limit_mps:
        text = (
            f"the fastest wanted wind with its gusts is {gust_mps:.1f} m/s at the target, over the "
            f"±{limit_mps:g} m/s of {layout.lidar.device.name}: along the beam such winds are folded or "
            "lost; end speed_range_mps lower, or expect gaps"
        )
        yield Finding("warning", "radial-speed", layout.name, gust_mps, "m/s", limit_mps, text)


def _sector_axis(plan: Plan, layout: ScanLayout) -> Iterator[Finding]:
    """Axis of a sector against the prevailing wind."""
    off_deg = plan.axis_from_wind_deg(layout)
    if off_deg is not None and off_deg > AXIS_LIMIT_DEG:
        text = (
            f"the sector's axis is {off_deg:.0f}° from the line of the prevailing wind (from "
            f"{plan.prevailing_deg:.0f}°), over {AXIS_LIMIT_DEG:g}°: the wind blows across the beams, where "
            "a sector scan errs most in speed; stand up- or downwind of the target"
        )
        yield Finding("info", "sector-axis", layout.name, off_deg, "deg", AXIS_LIMIT_DEG, text)
