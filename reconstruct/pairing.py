"""Rays of two lidars that look at one place at nearly one time, made into winds.

Synchronised lidars give one ray each at the same moment. Lidars that run on their own meet at the crossing
now and then: their rays are paired where the time between them is small enough. The reference study (Simon
2015, Appendix F) tried gaps of 0.5, 2, 5 and 8 s between two unsynchronised sector scans and found 5 s best:
a larger gap gives more pairs, and more wind that has changed in between.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from geometry.arrays import FloatArray, IntArray
from geometry.errors import InputError
from reconstruct.multi_doppler import dual_doppler_wind
from reconstruct.retrieval import Retrieval

STUDY_GAPS_S = (0.5, 2.0, 5.0, 8.0)

TimeArray = NDArray[np.datetime64]


class RaySeries(NamedTuple):
    """The rays of one lidar that look at the crossing, in the order of time."""

    time_utc: TimeArray  # (ray,) middle of the ray
    azimuth_deg: FloatArray  # (ray,)
    elevation_deg: FloatArray  # (ray,)
    radial_speed_mps: FloatArray  # (ray,) positive away; NaN where missing

    def at(self, index: IntArray | NDArray[np.bool_]) -> "RaySeries":
        """Some of the rays."""
        return RaySeries(
            self.time_utc[index],
            self.azimuth_deg[index],
            self.elevation_deg[index],
            self.radial_speed_mps[index],
        )


class Pairs(NamedTuple):
    """Indices of the rays that belong together."""

    first: IntArray  # (pair,) rising
    second: IntArray  # (pair,) rising
    gap_s: FloatArray  # (pair,) second less first [s]


def pair_within(first_utc: TimeArray, second_utc: TimeArray, *, gap_s: float) -> Pairs:
    """Pair two series of times, each time used once, the nearest ones that are near enough.

    Parameters
    ----------
    first_utc, second_utc : numpy.ndarray of datetime64
        (time,) not decreasing.
    gap_s : float
        Largest time between the two [s], 0 or more.

    Returns
    -------
    Pairs
        A pair is made where each is the other's nearest: no ray stands in two winds, which would then not be
        independent.

    Raises
    ------
    InputError
        If the gap is negative or times run backwards.

    Examples
    --------
    >>> first = np.array(["2014-05-01T00:00:00", "2014-05-01T00:00:12"], "datetime64[ns]")
    >>> second = np.array(["2014-05-01T00:00:03", "2014-05-01T00:00:09"], "datetime64[ns]")
    >>> len(pair_within(first, second, gap_s=2.0).first), pair_within(first, second, gap_s=5.0).gap_s.tolist()
    (0, [3.0, -3.0])
    """
    if not gap_s >= 0:
        raise InputError(f"a time gap of {gap_s:g} s came: give 0 or more")
    one, other = (np.asarray(t, "datetime64[ns]").astype(np.int64) for t in (first_utc, second_utc))
    if np.any(np.diff(one) < 0) or np.any(np.diff(other) < 0):
        raise InputError("times run backwards: sort both series first")
    if not len(one) or not len(other):
        return Pairs(np.empty(0, np.intp), np.empty(0, np.intp), np.empty(0))
    there, back = _nearest(other, one), _nearest(one, other)
    own = np.arange(len(one))
    off = other[there] - one
    chosen = (back[there] == own) & (np.abs(off) <= round(gap_s * 1e9))
    return Pairs(own[chosen], there[chosen], off[chosen] / 1e9)


class DualWind(NamedTuple):
    """Winds of paired rays."""

    time_utc: TimeArray  # (pair,) the middle between the two rays
    gap_s: FloatArray  # (pair,)
    fit: Retrieval  # (pair,) u, v


def dual_wind(first: RaySeries, second: RaySeries, *, gap_s: float) -> DualWind:
    """Winds where rays of two lidars meet within a time gap; missing rays find no partner.

    Parameters
    ----------
    first, second : RaySeries
        Rays at the crossing.
    gap_s : float
        Largest time between the two rays [s].

    Examples
    --------
    >>> time = np.array(["2014-05-01T00:00:00"], "datetime64[ns]")
    >>> north, east = (RaySeries(time, np.array([a]), np.zeros(1), np.array([v])) for a, v in ((0.0, 3.0), (90.0, 4.0)))
    >>> dual_wind(north, east, gap_s=0.5).fit.wind_mps.round(6) + 0.0
    array([[4., 3.]])
    """
    first, second = (rays.at(np.isfinite(rays.radial_speed_mps)) for rays in (first, second))
    pairs = pair_within(first.time_utc, second.time_utc, gap_s=gap_s)
    one, other = first.at(pairs.first), second.at(pairs.second)
    fit = dual_doppler_wind(
        np.stack([one.azimuth_deg, other.azimuth_deg], axis=-1),
        np.stack([one.elevation_deg, other.elevation_deg], axis=-1),
        np.stack([one.radial_speed_mps, other.radial_speed_mps], axis=-1),
    )
    middle = one.time_utc.astype("datetime64[ns]") + (pairs.gap_s * 5e8).astype("timedelta64[ns]")
    return DualWind(middle, pairs.gap_s, fit)


class GapResult(NamedTuple):
    """What one time gap gives."""

    gap_s: float
    pairs: int
    share: float  # of the rays of the series that has fewer
    median_gap_s: float  # between the two rays of a pair, without sign
    wind: DualWind


def compare_gaps(
    first: RaySeries, second: RaySeries, *, gaps_s: Sequence[float] = STUDY_GAPS_S
) -> tuple[GapResult, ...]:
    """Winds for several time gaps, as the study's Appendix F compares them."""
    fewer = min(int(np.count_nonzero(np.isfinite(rays.radial_speed_mps))) for rays in (first, second))
    results = []
    for gap_s in gaps_s:
        wind = dual_wind(first, second, gap_s=gap_s)
        count = len(wind.gap_s)
        middle = float(np.median(np.abs(wind.gap_s))) if count else float("nan")
        results.append(GapResult(gap_s, count, count / fewer if fewer else 0.0, middle, wind))
    return tuple(results)


def _nearest(among: NDArray[np.int64], wanted: NDArray[np.int64]) -> IntArray:
    """Index in rising numbers of the one nearest to each wanted number; of two as near the earlier."""
    right = np.clip(np.searchsorted(among, wanted), 0, len(among) - 1)
    left = np.maximum(right - 1, 0)
    return np.where(np.abs(among[left] - wanted) <= np.abs(among[right] - wanted), left, right)
