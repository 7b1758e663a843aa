"""Which sector size to take: the smallest that is not significantly worse than the widest, and what it saves."""

from typing import NamedTuple

from planner.error_nouns import ErrorCurve, SizeError
from planner.site import Tolerance
from reconstruct.signal import bought_noise, bought_range


class Recommendation(NamedTuple):
    """A sector size with its reason; None where the tier cannot tell."""

    sector_deg: float | None
    reason: str
    saving: str = ""  # what the time that is saved against the widest sector could buy


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
    best, stopped = widest, "no smaller size was computed"
    for size in curve.sizes[1:]:
        failure = _failure(size, slope, scatter, tolerance)
        if failure:
            stopped = f"{size.sector_deg:g}° {failure}"
            break
        best = size
    return Recommendation(
        best.sector_deg, f"{_sentence(best, widest, tolerance)}; {stopped}", _saving(best, widest)
    )


def _saving(best: SizeError, widest: SizeError) -> str:
    """What the saved time could buy instead of more scans: longer rays, so less noise or more range."""
    longer = widest.period_s / best.period_s
    if longer <= 1.0:
        return ""
    reach = bought_range(longer, best.range_m) / best.range_m
    return (
        f"at the pace of {widest.sector_deg:g}° its rays could last {longer:.2f} times as long: "
        f"noise falls to {bought_noise(longer):.0%}, "
        f"or a weak signal reaches {reach:.2f} times as far at the same noise"
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
            f"the smallest whose slope stays within {tolerance.slope:g} of that at {widest.sector_deg:g}° "
            f"and whose scatter is at most "
            f"{tolerance.scatter_growth:.0%} larger"
        )
    return f"{best.sector_deg:g}°: {kept}; {best.scans_per_10min} scans in ten minutes against {widest.scans_per_10min}"
