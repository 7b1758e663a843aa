"""What a plan predicts about errors: as plain dicts for tables, as arrays for the figure."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from geometry.arrays import FloatArray
from planner.error_nouns import ErrorCurve
from planner.figures.sector_error import TierCurve
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
        "states": curve.states,
        "sizes": [size.as_dict() for size in curve.sizes],
    }


def tier_curve(entry: Entry) -> TierCurve:
    """The arrays of one entry; what is not known is NaN.

    Examples
    --------
    >>> entry = {"tier": "noise", "sizes": [{"sector_deg": 60.0, "speed_std_mps": 0.02, "slope": None}]}
    >>> curve = tier_curve(entry)
    >>> curve.speed_std_mps.tolist(), curve.slope.tolist()
    ([0.02], [nan])
    """

    def values(key: str) -> FloatArray:
        return np.array(
            [np.nan if size.get(key) is None else size[key] for size in entry["sizes"]], dtype=np.float64
        )

    return TierCurve(entry["tier"], *(values(key) for key in TierCurve._fields[1:]))


def recommended_size(entry: Entry) -> Entry | None:
    """The numbers of the recommended size, else of the first (widest, or the only one of a pair)."""
    best = entry.get("recommended_sector_deg")
    sizes: list[Entry] = entry["sizes"]
    return next(
        (size for size in sizes if best is not None and size["sector_deg"] == best),
        sizes[0] if sizes else None,
    )
