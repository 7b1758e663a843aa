"""A predicted curve as a plain document: what `lidarplan errors --json` prints and the report reads."""

from collections.abc import Mapping
from typing import Any

from planner.error_nouns import ErrorCurve
from planner.plan import Plan

Entry = Mapping[str, Any]  # one item of `lidarplan errors --json`


def error_entries(plan: Plan) -> list[Entry]:
    """Every predicted curve of a plan, by the default tier and sizes, with its recommendation."""
    return [error_entry(plan, curve) for curve in plan.default_errors]


def error_entry(plan: Plan, curve: ErrorCurve) -> Entry:
    """One curve as `lidarplan errors --json` prints it."""
    advice = plan.recommendation(curve)
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
        "sizes": [size.as_dict() for size in curve.sizes],
    }
