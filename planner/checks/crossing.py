"""How well the beams of a pair cross: opening angle, whether they meet, and where."""

import math
from collections.abc import Iterator, Sequence
from itertools import groupby

from planner.checks.timing import PERIOD_TOLERANCE_S
from planner.crossings import PairCrossing
from planner.finding import Finding, Severity
from planner.plan import Plan

# Noise across the beams grows as 1/sin: at 30° it is twice what it is at 90°, at 10° nearly six times.
WARN_ANGLE_DEG = 30.0
ERROR_ANGLE_DEG = 10.0


def find(plan: Plan) -> Iterator[Finding]:
    """Findings about every two beams of every pair."""
    synchronised = {pair.name: pair.synchronised for pair in plan.site.pairs}
    for pair, group in groupby(plan.crossings, key=lambda met: met.pair):
        beams = list(group)
        for met in beams:
            yield from _angle(met, beams)
            yield from _gap(plan, met)
            yield from _off_target(plan, met)
            if synchronised[pair]:
                yield from _periods(met)


def _limit_passed(met: PairCrossing) -> tuple[Severity, float] | None:
    """The severer limit that an opening angle passes; None for a good angle."""
    angle_deg = met.opening_angle_deg
    if not ERROR_ANGLE_DEG <= angle_deg <= 180.0 - ERROR_ANGLE_DEG:  # also NaN, of a vertical beam
        return "error", ERROR_ANGLE_DEG
    if not WARN_ANGLE_DEG <= angle_deg <= 180.0 - WARN_ANGLE_DEG:
        return "warning", WARN_ANGLE_DEG
    return None


def _angle(met: PairCrossing, beams: Sequence[PairCrossing]) -> Iterator[Finding]:
    """Opening angle in plan, unfolded; of three scans, two that cross well are enough."""
    passed = _limit_passed(met)
    if passed is None:
        return
    severity, limit_deg = passed
    rescued = any(_limit_passed(other) is None for other in beams)
    advice = "other beams of the pair cross well and make up for it" if rescued else "move one of the lidars"
    severity = "info" if rescued else severity
    angle_deg, subject = met.opening_angle_deg, f"{met.pair} ({met.target})"
    if math.isnan(angle_deg):
        blind = f"a beam of {met.lidar1} or {met.lidar2} is vertical and sees nothing of the horizontal wind"
        text = f"{blind}: {advice}"
        yield Finding(severity, "opening-angle", subject, None, "deg", limit_deg, text)
        return
    narrow = angle_deg < 90.0
    how = (
        "run side by side"
        if narrow
        else "look at each other: the target is nearly on the line between the lidars"
    )
    text = (
        f"the beams of {met.lidar1} and {met.lidar2} open by {angle_deg:.1f}°, {met.folded_angle_deg:.1f}° "
        f"from parallel (limits {limit_deg:g}° and {180 - limit_deg:g}°). They {how}; the wind across them "
        f"is hardly seen: {advice}"
    )
    limit = limit_deg if narrow else 180.0 - limit_deg
    yield Finding(severity, "opening-angle", subject, angle_deg, "deg", limit, text)


def _gap(plan: Plan, met: PairCrossing) -> Iterator[Finding]:
    """Shortest distance of the two beams against the tolerance and the shorter probe."""
    tolerance_m, probe_m = plan.site.tolerance.position_m, met.shorter_probe_m
    if met.gap_m <= tolerance_m:
        return
    severe = met.gap_m > probe_m
    limit_m, limit = (probe_m, "shorter probe") if severe else (tolerance_m, "tolerance")
    parallel = math.isnan(met.height_difference_m)
    height = "" if parallel else f" ({abs(met.height_difference_m):.1f} m of it in height)"
    lidar, miss_m = met.worst_aimed
    text = (
        f"the beams of {met.scan1} and {met.scan2} pass each other {met.gap_m:.1f} m apart{height}, over the "
        f"{limit} of {limit_m:.1f} m: correct the pointing of {lidar}, which is {miss_m:.1f} m beside the "
        "target"
    )
    severity: Severity = "error" if severe else "warning"
    yield Finding(severity, "crossing-gap", f"{met.pair} ({met.target})", met.gap_m, "m", limit_m, text)


def _off_target(plan: Plan, met: PairCrossing) -> Iterator[Finding]:
    """How far the beam that is aimed worse passes the target: two beams that cross may do so elsewhere."""
    tolerance_m, probe_m = plan.site.tolerance.position_m, met.shorter_probe_m
    lidar, miss_m = met.worst_aimed
    if miss_m <= tolerance_m:
        return
    severe = miss_m > probe_m
    limit_m, limit = (probe_m, "shorter probe") if severe else (tolerance_m, "tolerance")
    text = (
        f"the beam of {lidar} passes target {met.target} {miss_m:.1f} m aside, over the {limit} of "
        f"{limit_m:.1f} m, so {met.scan1} and {met.scan2} do not cross there: correct the pointing of {lidar}"
    )
    severity: Severity = "error" if severe else "warning"
    yield Finding(severity, "crossing-target", f"{met.pair} ({met.target})", miss_m, "m", limit_m, text)


def _periods(met: PairCrossing) -> Iterator[Finding]:
    """Periods of two synchronised scans against each other."""
    slow_s, fast_s = max(met.period1_s, met.period2_s), min(met.period1_s, met.period2_s)
    if slow_s > fast_s + PERIOD_TOLERANCE_S:
        text = (
            f"{met.scan1} takes {met.period1_s:.2f} s and {met.scan2} {met.period2_s:.2f} s, but the pair is "
            "declared synchronised: the slower one counts; declare one period_s for both"
        )
        yield Finding("warning", "pair-period", f"{met.pair} ({met.target})", slow_s, "s", fast_s, text)
