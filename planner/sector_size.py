"""Which sector size to take: the smallest that is not significantly worse than the widest, and what it saves."""

from typing import NamedTuple

from planner.error_curve import ErrorCurve, SizeError
from planner.site import Tolerance


class Recommendation(NamedTuple):
    """A sector size with its reason; None where the tier cannot tell."""

    sector_deg: float | None
    reason: str


NOT_A_SECTOR = "a pair has no sector size"
NEEDS_TURBULENCE = (
    "white noise alone always favours the widest sector: which one is small enough needs the turbulence of the air "
    "(wind.turbulence in the site file, --tier turbulent)"
)


def recommend(curve: ErrorCurve, tolerance: Tolerance) -> Recommendation:
    """Recommend the smallest sector whose ten-minute means are nearly as good as the widest's.

    Nearly as good: the slope of the regression differs by at most `tolerance.slope`, and its scatter is at most
    `tolerance.scatter_growth` larger. Every size between the recommended and the widest passes too.
    """
    widest = curve.sizes[0]
    if widest.sector_deg is None:
        return Recommendation(None, NOT_A_SECTOR)
    slope, scatter = widest.values["slope"], widest.values["residual_std_mps"]
    if slope is None or scatter is None:
        return Recommendation(None, NEEDS_TURBULENCE)
    best = widest
    for size in curve.sizes[1:]:
        failure = _failure(size, slope, scatter, tolerance)
        if failure:
            return Recommendation(
                best.sector_deg, _sentence(best, widest, tolerance) + f"; {size.sector_deg:g}° {failure}"
            )
        best = size
    return Recommendation(
        best.sector_deg, _sentence(best, widest, tolerance) + "; no smaller size was computed"
    )


def _failure(size: SizeError, slope: float, scatter: float, tolerance: Tolerance) -> str:
    """Why a size is not good enough; empty where it is."""
    own_slope, own_scatter = size.values["slope"], size.values["residual_std_mps"]
    if own_slope is None or own_scatter is None:
        return "cannot be predicted"
    failures = []
    if abs(own_slope - slope) > tolerance.slope:
        failures.append(f"moves the slope by {own_slope - slope:+.3f}")
    if own_scatter > scatter * (1 + tolerance.scatter_growth):
        failures.append(f"scatters {own_scatter / scatter - 1:.0%} more")
    return " and ".join(failures)


def _sentence(best: SizeError, widest: SizeError, tolerance: Tolerance) -> str:
    if best is widest:
        kept = "the widest computed"
    else:
        kept = (
            f"the smallest whose slope stays within {tolerance.slope:g} of that at {widest.sector_deg:g}° and whose scatter is at most "
            f"{tolerance.scatter_growth:.0%} larger"
        )
    return f"{best.sector_deg:g}°: {kept}; {best.scans_per_10min} scans in ten minutes against {widest.scans_per_10min}"
