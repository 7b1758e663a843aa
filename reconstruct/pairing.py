"""Rays of two or more lidars that look at one place at nearly one time, made into winds.

Synchronised lidars give one ray each at the same moment. Lidars that run on their own meet at the crossing
now and then: their rays are paired where the time between them is small enough. The reference study (Simon
2015, Appendix F) tried gaps of 0.5, 2, 5 and 8 s between two unsynchronised sector scans and found 5 s best:
a larger gap gives more pairs, and more wind that has changed in between.
"""

from collections.abc import Sequence
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from geometry.arrays import FloatArray, IntArray
from geometry.errors import InputError
from reconstruct.averaging import period_sums
from reconstruct.multi_doppler import dual_doppler_wind, triple_doppler_wind
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

    time_utc: TimeArray  # (pair,) the middle between the first and the last ray
    gap_s: FloatArray  # (pair,) of two lidars second less first; of three or more last less first
    fit: Retrieval  # (pair,) u, v; or u, v, w


def joint_wind(
    series: Sequence[RaySeries], *, gap_s: float, columns: Literal[2, 3] | None = None
) -> DualWind:
    """Winds where rays of two, three or more lidars meet within a time gap; missing rays find no partner.

    Parameters
    ----------
    series : sequence of RaySeries
        Rays of each lidar at the crossing.
    gap_s : float
        Largest time between any two of the rays that make a wind [s].
    columns : {2, 3}, optional
        2: u and v, of more than two lidars their least-squares mean; 3: u, v and w. Default: 3 from three lidars on.

    Notes
    -----
    The rays of the first lidar look for a partner among those of every other; a ray that lacks one makes no wind.

    Raises
    ------
    InputError
        If there are fewer than two lidars, or three components are asked of two.

    Examples
    --------
    >>> time = np.array(["2014-05-01T00:00:00"], "datetime64[ns]")
    >>> beams = ((0.0, 0.0, 3.0), (90.0, 0.0, 4.0), (0.0, 90.0, 0.5))
    >>> rays = [RaySeries(time, np.array([a]), np.array([e]), np.array([v])) for a, e, v in beams]
    >>> joint_wind(rays, gap_s=0.5).fit.wind_mps.round(6) + 0.0
    array([[4. , 3. , 0.5]])
    """
    if len(series) < 2:
        raise InputError(f"{len(series)} lidar came: winds are made of the rays of two or more")
    known = [rays.at(np.isfinite(rays.radial_speed_mps)) for rays in series]
    first, chosen = known[0], [np.arange(len(known[0].time_utc))]
    for other in known[1:]:
        pairs = pair_within(first.time_utc, other.time_utc, gap_s=gap_s)
        _, here, there = np.intersect1d(chosen[0], pairs.first, assume_unique=True, return_indices=True)
        chosen = [*(index[here] for index in chosen), pairs.second[there]]
    met = [rays.at(index) for rays, index in zip(known, chosen, strict=True)]
    times = np.stack([rays.time_utc.astype("datetime64[ns]").astype(np.int64) for rays in met])
    off = times[1] - times[0] if len(series) == 2 else np.ptp(times, axis=0)
    near = np.abs(off) <= round(gap_s * 1e9)
    met, times, off = [rays.at(near) for rays in met], times[:, near], off[near]
    azimuth, elevation, speed = (np.stack(parts, axis=-1) for parts in list(zip(*met, strict=True))[1:])
    solve = triple_doppler_wind if (columns or (3 if len(series) > 2 else 2)) == 3 else dual_doppler_wind
    begin = np.min(times, axis=0, initial=np.iinfo(np.int64).max)
    middle = begin + np.ptp(times, axis=0) // 2
    return DualWind(middle.astype("datetime64[ns]"), off / 1e9, solve(azimuth, elevation, speed))


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
    return joint_wind((first, second), gap_s=gap_s)


class GapResult(NamedTuple):
    """What one time gap gives, as sums: those of the parts of a campaign make those of the whole."""

    gap_s: float
    pairs: int
    rays: int  # of the series that has the fewest
    between_s: float  # sum of the times between the rays of each pair, without sign
    squares_m2s2: float  # sum of squared speeds about the means of their ten minutes
    freedom: int  # of that sum

    @property
    def share(self) -> float:
        """Share of the rays that found a partner."""
        return self.pairs / self.rays if self.rays else 0.0

    @property
    def mean_gap_s(self) -> float:
        """Mean time between the rays of a pair [s]; NaN without pairs."""
        return self.between_s / self.pairs if self.pairs else float("nan")

    @property
    def spread_mps(self) -> float:
        """Standard deviation of the speeds within ten minutes [m/s]: turbulence, and what the wind changed in the gap."""
        return float(np.sqrt(self.squares_m2s2 / self.freedom)) if self.freedom else float("nan")

    def __add__(self, other: object) -> "GapResult":
        """The same gap over two parts of a campaign."""
        if not isinstance(other, GapResult) or other.gap_s != self.gap_s:
            return NotImplemented
        return GapResult(
            self.gap_s,
            self.pairs + other.pairs,
            self.rays + other.rays,
            self.between_s + other.between_s,
            self.squares_m2s2 + other.squares_m2s2,
            self.freedom + other.freedom,
        )


def compare_gaps(
    *series: RaySeries, gaps_s: Sequence[float] = STUDY_GAPS_S, columns: Literal[2, 3] | None = None
) -> tuple[GapResult, ...]:
    """Winds for several time gaps, as the study's Appendix F compares them; `columns` as in `joint_wind`.

    A larger gap gives more pairs. Its winds scatter more, since the air has moved on between the rays of a pair.
    """
    rays = min(int(np.count_nonzero(np.isfinite(each.radial_speed_mps))) for each in series)
    return tuple(_gap_result(series, gap_s, rays, columns) for gap_s in gaps_s)


def _gap_result(
    series: Sequence[RaySeries], gap_s: float, rays: int, columns: Literal[2, 3] | None
) -> GapResult:
    wind = joint_wind(series, gap_s=gap_s, columns=columns)
    sums = period_sums(wind.time_utc, wind.fit.wind_mps[:, 0], wind.fit.wind_mps[:, 1])
    squares = float(np.sum(sums.square_m2s2 - np.square(sums.speed_mps) / np.maximum(sums.count, 1)))
    freedom = int(np.sum(sums.count - 1))
    return GapResult(
        gap_s, len(wind.gap_s), rays, float(np.sum(np.abs(wind.gap_s))), max(squares, 0.0), freedom
    )


def _nearest(among: NDArray[np.int64], wanted: NDArray[np.int64]) -> IntArray:
    """Index in rising numbers of the one nearest to each wanted number; of two as near the earlier."""
    right = np.clip(np.searchsorted(among, wanted), 0, len(among) - 1)
    left = np.maximum(right - 1, 0)
    return np.where(np.abs(among[left] - wanted) <= np.abs(among[right] - wanted), left, right)
