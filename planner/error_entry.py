"""A predicted curve as a plain document: what `lidarplan errors --json` prints and the report reads."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from planner.error_nouns import ErrorCurve
from planner.plan import Plan

Entry = Mapping[str, Any]  # one item of `lidarplan errors --json`

TURNING = "rotor"  # the part of a thing that a beam meets in some winds only


def error_entries(plan: Plan, curves: Sequence[ErrorCurve]) -> list[Entry]:
    """Every predicted curve of a plan, by the default tier and sizes, with its recommendation."""
    return [error_entry(plan, curve) for curve in curves]


def error_entry(plan: Plan, curve: ErrorCurve) -> Entry:
    """One curve as `lidarplan errors --json` prints it."""
    advice = plan.recommendation(curve)
    scans = scans_of(plan, curve)
    return {
        "lidar" if curve.lidar else "pair": curve.lidar or curve.scan,
        "scan": curve.scan,
        "target": curve.target,
        "tier": curve.tier,
        "reference": curve.reference,
        "recommended_sector_deg": advice.sector_deg,
        "reason": advice.reason,
        "saving": advice.saving or None,
        "states": curve.states,
        "blocked_rays": sum(rays_lost(plan, name) for name in scans),
        "blocked_remark": blocked_remark(plan, scans) or None,
        "sizes": [size.as_dict() for size in curve.sizes],
    }


def scans_of(plan: Plan, curve: ErrorCurve) -> tuple[str, ...]:
    """Names of the scans that a curve is about: its own, or those of its pair."""
    if curve.lidar:
        return (curve.scan,)
    return next(pair.scans for pair in plan.site.pairs if pair.name == curve.scan)


def rays_lost(plan: Plan, scan: str) -> int:
    """Number of a scan's rays that touch something solid on their way."""
    return _blocked(plan, scan, always=False)


def blocked_remark(plan: Plan, scans: Sequence[str]) -> str:
    """Say that a prediction counts blocked rays as measured; empty where no ray is blocked."""
    lost, always = (sum(_blocked(plan, name, always=only) for name in scans) for only in (False, True))
    if not lost:
        return ""
    total = sum(plan.layout[name].scan.count for name in scans)
    verb, them = ("is", "it") if lost == 1 else ("are", "them")
    when = {0: " in some winds", lost: " in every wind"}.get(always, f", {always} of {them} in every wind")
    return f"{lost} of {total} rays {verb} blocked{when}; the prediction counts {them} as measured"


def _blocked(plan: Plan, scan: str, *, always: bool) -> int:
    """Number of a scan's rays that are blocked: at all, or by what stands still."""
    lost = [
        met.lost for met in plan.obstructions if met.scan == scan and not (always and met.part == TURNING)
    ]
    return int(np.any(lost, axis=0).sum()) if lost else 0
