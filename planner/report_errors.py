"""Predicted errors for the report: as arrays for the figure, and the row that counts."""

import numpy as np

from geometry.arrays import FloatArray
from planner.error_entry import Entry
from planner.figures.sector_error import TierCurve


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
