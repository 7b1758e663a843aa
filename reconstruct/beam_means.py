"""Means of radial speeds over fixed periods, for each of many beams and gates: what one lidar knows by itself.

A stare, a list of points or a vertical slice of one lidar sees one component of the wind. It is averaged as it
stands, positive away; nothing is made up about the other two. Like the sums of `reconstruct.averaging` these can
be added: sums of the parts of a campaign make the sums of the whole.
"""

from collections.abc import Iterable
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from geometry.arrays import ArrayLike, FloatArray, IntArray
from geometry.errors import InputError

STEEPEST_DEG = 60.0
"""Beyond this elevation less than half of the horizontal wind is in a radial speed, and 1.7 of a vertical one for each
metre a second of the horizontal one made of it."""

TimeArray = NDArray[np.datetime64]


@dataclass(frozen=True, eq=False)
class BeamSums:
    """Sums of radial speeds over periods, of the cells that were met."""

    period_s: float
    number: IntArray  # (k,) whole periods since 1970, rising
    cell: IntArray  # (k,) beam and gate, rising within a period
    count: IntArray  # (k,)
    total_mps: FloatArray  # (k,) sums of radial speeds
    square_m2s2: FloatArray  # (k,) sums of their squares


@dataclass(frozen=True, eq=False)
class BeamMeans:
    """Means of radial speeds, of the cells that were met."""

    time_utc: TimeArray  # (k,) end of the period
    cell: IntArray  # (k,)
    count: IntArray  # (k,)
    radial_speed_mps: FloatArray  # (k,) positive away
    radial_speed_std_mps: FloatArray  # (k,) of the samples, n - 1; NaN for one


def beam_sums(
    time_utc: TimeArray,
    cell: IntArray,
    radial_speed_mps: FloatArray,
    *,
    period_s: float,
    shift_s: float = 0.0,
) -> BeamSums:
    """Sum radial speeds over fixed periods; missing ones are left out.

    Parameters
    ----------
    time_utc : numpy.ndarray of datetime64
        (sample,) in any order; NaT: left out.
    cell : numpy.ndarray
        (sample,) which beam and gate each is of.
    radial_speed_mps : numpy.ndarray
        (sample,) positive away [m/s]; NaN: left out.
    period_s : float
        Length of a period [s]; periods begin at whole multiples of it since 1970.
    shift_s : float
        Added to the times before anything else [s].

    Raises
    ------
    InputError
        If the shapes differ or the period is not positive.

    Examples
    --------
    >>> time = np.array(["2014-05-01T00:01", "2014-05-01T00:09", "2014-05-01T00:11"], "datetime64[ns]")
    >>> sums = beam_sums(time, np.array([3, 3, 3]), np.array([4.0, 6.0, 7.0]), period_s=600.0)
    >>> beam_means(sums).radial_speed_mps, sums.count
    (array([5., 7.]), array([2, 1]))
    """
    if not period_s > 0:
        raise InputError(f"a period of {period_s:g} s came: give one above 0")
    if not np.shape(time_utc) == np.shape(cell) == np.shape(radial_speed_mps):
        raise InputError(
            f"times {np.shape(time_utc)}, cells {np.shape(cell)} and radial speeds {np.shape(radial_speed_mps)} "
            "came: one of each per sample"
        )
    known = np.isfinite(radial_speed_mps) & ~np.isnat(time_utc)
    ticks = time_utc[known].astype("datetime64[ns]").astype(np.int64) + round(shift_s * 1e9)
    speed = radial_speed_mps[known]
    ones = np.ones(len(speed), dtype=np.intp)
    return _merged(period_s, ticks // round(period_s * 1e9), cell[known], (ones, speed, np.square(speed)))


def add_beam_sums(parts: Iterable[BeamSums]) -> BeamSums:
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
    names = [field.name for field in fields(BeamSums)[1:]]
    number, cell, count, total, square = (
        np.concatenate([getattr(part, name) for part in found]) for name in names
    )
    return _merged(lengths.pop(), number, cell, (count, total, square))


def beam_means(sums: BeamSums) -> BeamMeans:
    """Turn sums into means."""
    mean = sums.total_mps / sums.count
    spare = np.where(sums.count > 1, sums.count - 1, np.nan)
    variance = np.maximum(sums.square_m2s2 - sums.count * np.square(mean), 0.0) / spare
    ends = (sums.number.astype(np.int64) + 1) * round(sums.period_s * 1e9)
    return BeamMeans(ends.astype("datetime64[ns]"), sums.cell, sums.count, mean, np.sqrt(variance))


def along_beam_mps(radial_speed_mps: ArrayLike, elevation_deg: ArrayLike) -> FloatArray:
    """Horizontal wind along a beam's azimuth, away from the lidar, if the air does not rise: v_r / cos φ.

    Parameters
    ----------
    radial_speed_mps : array_like
        (...,) positive away [m/s].
    elevation_deg : array_like
        (...,) [deg]. A vertical wind w comes into the result as w tan φ: 0.18 w at 10 degrees, 1.7 w at 60.

    Returns
    -------
    numpy.ndarray
        (...,) [m/s]; NaN beyond 60 degrees, where it would say more of the vertical wind.

    Examples
    --------
    >>> along_beam_mps([5.0, 5.0, 5.0], [0.0, 60.0, 80.0]).round(3)
    array([ 5., 10., nan])
    """
    elevation = np.asarray(elevation_deg, dtype=float)
    level = np.where(np.abs(elevation) <= STEEPEST_DEG, np.cos(np.radians(elevation)), np.nan)
    return np.asarray(radial_speed_mps, dtype=float) / level


def _merged(
    period_s: float,
    number: IntArray,
    cell: IntArray,
    values: tuple[IntArray, FloatArray, FloatArray],
) -> BeamSums:
    """Sums with one row for each period and cell."""
    order = np.lexsort((cell, number))
    number, cell = np.asarray(number[order], dtype=np.intp), np.asarray(cell[order], dtype=np.intp)
    fresh = np.ones(len(order), dtype=bool)
    fresh[1:] = (np.diff(number) != 0) | (np.diff(cell) != 0)
    first = np.flatnonzero(fresh)

    def summed(part: FloatArray | IntArray) -> FloatArray:
        return np.add.reduceat(part[order], first).astype(float) if len(first) else np.empty(0)

    count = summed(values[0]).astype(np.intp)
    return BeamSums(period_s, number[first], cell[first], count, summed(values[1]), summed(values[2]))
