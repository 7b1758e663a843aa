"""Means over fixed periods: scalar and vector, directions on the circle, with their counts.

A mean is a sum that can be added to: sums of the parts of a campaign make the sums of the whole, so that a
year needs no more memory than a day. Periods begin at whole multiples of their length since 1970 and are
named after their end, as in the reference study: the mean of 10:00 to 10:10 is stamped 10:10, and a sample at
10:10:00 belongs to the next.
"""

from collections.abc import Iterable
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from geometry.arrays import FloatArray, IntArray
from geometry.errors import InputError
from reconstruct.periods import TEN_MINUTES_S
from reconstruct.wind import from_deg, speed_mps

if TYPE_CHECKING:
    import pandas as pd

TimeArray = NDArray[np.datetime64]


@dataclass(frozen=True, eq=False)
class PeriodSums:
    """Sums over the samples of each period; periods without a sample are left out."""

    period_s: float
    number: IntArray  # (period,) whole periods since 1970, rising
    count: IntArray  # (period,) samples
    east_mps: FloatArray  # (period,) sums of u
    north_mps: FloatArray  # (period,) sums of v
    speed_mps: FloatArray  # (period,) sums of speeds
    square_m2s2: FloatArray  # (period,) sums of squared speeds
    turn_east: FloatArray  # (period,) sums of the unit vectors
    turn_north: FloatArray
    up_mps: FloatArray  # (period,) sums of w; NaN where it is not known of every sample


@dataclass(frozen=True, eq=False)
class PeriodMeans:
    """Means of each period."""

    period_s: float
    time_utc: TimeArray  # (period,) end of the period
    count: IntArray  # (period,) samples
    speed_mps: FloatArray  # (period,) scalar mean, as a cup's
    vector_speed_mps: FloatArray  # (period,) of the mean vector
    from_deg: FloatArray  # (period,) of the mean vector; NaN in a calm
    vane_deg: FloatArray  # (period,) of the mean unit vector, as a vane's
    speed_std_mps: FloatArray  # (period,) of the samples, n - 1; NaN for one
    w_mps: FloatArray  # (period,) upward; NaN where it is not known of every sample

    def availability(self, interval_s: float) -> FloatArray:
        """(period,) share of the samples that a full period has, one every `interval_s` [s]; 1 at the most."""
        return np.asarray(np.minimum(self.count / expected_count(self.period_s, interval_s), 1.0))

    def at(self, index: IntArray | NDArray[np.bool_]) -> "PeriodMeans":
        """Some of the periods."""
        parts = {f.name: getattr(self, f.name)[index] for f in fields(self) if f.name != "period_s"}
        return PeriodMeans(period_s=self.period_s, **parts)

    def frame(self) -> "pd.DataFrame":
        """One row a period, for tables and files."""
        import pandas as pd

        return pd.DataFrame({f.name: getattr(self, f.name) for f in fields(self) if f.name != "period_s"})


def expected_count(period_s: float, interval_s: float) -> int:
    """Whole samples that fit into a period, at least 1.

    Examples
    --------
    >>> expected_count(600.0, 12.0), expected_count(60.0, 12.0)
    (50, 5)
    """
    return max(int(np.floor(period_s / interval_s + 1e-9)), 1)


def period_sums(
    time_utc: TimeArray,
    u_mps: FloatArray,
    v_mps: FloatArray,
    *,
    w_mps: FloatArray | None = None,
    period_s: float = TEN_MINUTES_S,
    shift_s: float = 0.0,
) -> PeriodSums:
    """Sum samples over fixed periods; samples with a component missing are left out.

    Parameters
    ----------
    time_utc : numpy.ndarray of datetime64
        (sample,) in any order.
    u_mps, v_mps : numpy.ndarray
        (sample,) eastward and northward wind [m/s].
    w_mps : numpy.ndarray, optional
        (sample,) upward wind [m/s].
    period_s : float
        Length of a period [s], a divisor of a day or a multiple of one.
    shift_s : float
        Added to the times before anything else [s]: what the instrument's clock is late by.

    Raises
    ------
    InputError
        If the shapes differ or the period is not positive.
    """
    if not period_s > 0:
        raise InputError(f"a period of {period_s:g} s came: give one above 0")
    if not np.shape(time_utc) == np.shape(u_mps) == np.shape(v_mps):
        raise InputError(
            f"times {np.shape(time_utc)}, u {np.shape(u_mps)} and v {np.shape(v_mps)} came: one of each per sample"
        )
    known = np.isfinite(u_mps) & np.isfinite(v_mps) & ~np.isnat(time_utc)
    u, v = u_mps[known], v_mps[known]
    number, place = np.unique(_number(time_utc[known], period_s, shift_s), return_inverse=True)
    speed = speed_mps(u, v)
    with np.errstate(invalid="ignore", divide="ignore"):
        unit_u, unit_v = (np.where(speed > 0, part / speed, 0.0) for part in (u, v))

    def total(values: FloatArray) -> FloatArray:
        return np.bincount(place, weights=values, minlength=len(number)).astype(float)

    count = np.bincount(place, minlength=len(number)).astype(np.intp)
    w = np.full(len(u), np.nan) if w_mps is None else w_mps[known]
    sums = (total(values) for values in (u, v, speed, np.square(speed), unit_u, unit_v, w))
    return PeriodSums(period_s, number.astype(np.intp), count, *sums)


def add_sums(parts: Iterable[PeriodSums]) -> PeriodSums:
    """Sums of a whole from those of its parts, which may share periods.

    Raises
    ------
    InputError
        If there are none, or their periods differ in length.
    """
    found = list(parts)
    lengths = {part.period_s for part in found}
    if len(lengths) != 1:
        raise InputError(f"sums over periods of {sorted(lengths) or 'no'} s came: give parts of one length")
    number, place = np.unique(np.concatenate([part.number for part in found]), return_inverse=True)
    added: list[FloatArray] = []
    for field in fields(PeriodSums)[2:]:
        values = np.concatenate([getattr(part, field.name) for part in found]).astype(float)
        added.append(np.bincount(place, weights=values, minlength=len(number)).astype(float))
    return PeriodSums(lengths.pop(), number, added[0].round().astype(np.intp), *added[1:])


def means_of(sums: PeriodSums) -> PeriodMeans:
    """Turn sums into means."""
    count = sums.count
    mean = sums.speed_mps / count
    spare = np.where(count > 1, count - 1, np.nan)
    variance = np.maximum(sums.square_m2s2 - count * np.square(mean), 0.0) / spare
    return PeriodMeans(
        period_s=sums.period_s,
        time_utc=_ends(sums.number, sums.period_s),
        count=count,
        speed_mps=mean,
        vector_speed_mps=speed_mps(sums.east_mps, sums.north_mps) / count,
        from_deg=from_deg(sums.east_mps, sums.north_mps),
        vane_deg=from_deg(sums.turn_east, sums.turn_north),
        speed_std_mps=np.sqrt(variance),
        w_mps=sums.up_mps / count,
    )


def period_means(
    time_utc: TimeArray,
    u_mps: FloatArray,
    v_mps: FloatArray,
    *,
    period_s: float = TEN_MINUTES_S,
    shift_s: float = 0.0,
) -> PeriodMeans:
    """Average samples over fixed periods: `period_sums` turned into means.

    Examples
    --------
    >>> time = np.array(["2014-05-01T00:09:48", "2014-05-01T00:10:00"], "datetime64[ns]")
    >>> means = period_means(time, np.array([3.0, -3.0]), np.array([4.0, 4.0]))
    >>> means.time_utc.astype("datetime64[s]").astype(str).tolist()
    ['2014-05-01T00:10:00', '2014-05-01T00:20:00']
    >>> both = period_means(time, np.array([3.0, -3.0]), np.array([4.0, 4.0]), period_s=3600.0)
    >>> both.speed_mps, both.vector_speed_mps, both.from_deg, both.count
    (array([5.]), array([4.]), array([180.]), array([2]))
    """
    return means_of(period_sums(time_utc, u_mps, v_mps, period_s=period_s, shift_s=shift_s))


def common_periods(*means: PeriodMeans) -> tuple[PeriodMeans, ...]:
    """The periods that all of some means have, in order of time.

    Raises
    ------
    InputError
        If their periods differ in length.

    Examples
    --------
    >>> time = np.array(["2014-05-01T00:01", "2014-05-01T00:11"], "datetime64[ns]")
    >>> one, two = (period_means(time[part], np.ones(n), np.ones(n)) for part, n in ((slice(0, 2), 2), (slice(1, 2), 1)))
    >>> [len(each.count) for each in common_periods(one, two)]
    [1, 1]
    """
    lengths = {each.period_s for each in means}
    if len(lengths) > 1:
        raise InputError(f"means over periods of {sorted(lengths)} s came: only equal ones can be compared")
    shared = means[0].time_utc
    for other in means[1:]:
        shared = np.intersect1d(shared, other.time_utc)
    return tuple(each.at(np.searchsorted(each.time_utc, shared)) for each in means)


def _number(time_utc: TimeArray, period_s: float, shift_s: float) -> NDArray[np.int64]:
    nanoseconds = time_utc.astype("datetime64[ns]").astype(np.int64) + round(shift_s * 1e9)
    return np.asarray(nanoseconds // round(period_s * 1e9))


def _ends(number: IntArray, period_s: float) -> TimeArray:
    return np.asarray(((number.astype(np.int64) + 1) * round(period_s * 1e9)).astype("datetime64[ns]"))
