"""Period means of a two-beam lidar with the quality rules of the WindEye test (Risø 2014)."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from geometry.arrays import FloatArray, IntArray
from geometry.errors import InputError
from reconstruct.filters import Step
from reconstruct.two_beam import TwoBeamWind, two_beam_wind

PERIOD_S = 120.0
LEAST_SAMPLES = 100  # of the 120 that a period of two minutes has at 1 Hz, on each beam
LEAST_SPEED_MPS = 1.0  # of each beam's radial speed: a continuous-wave lidar cannot tell slower air from none
LARGEST_ANGLE_DEG = 30.0  # of the wind from the axis

TimeArray = NDArray[np.datetime64]


class TwoBeamMeans(NamedTuple):
    """Means of the periods that pass every rule."""

    time_utc: TimeArray  # (period,) end of the period
    samples: IntArray  # (period, 2) good ones of the left and the right beam
    wind: TwoBeamWind  # (period,) of the beams' mean radial speeds
    steps: tuple[Step, ...]


def two_beam_means(
    time_utc: TimeArray,
    left_mps: FloatArray,
    right_mps: FloatArray,
    *,
    half_angle_deg: float,
    elevation_deg: float = 0.0,
    period_s: float = PERIOD_S,
    least_samples: int = LEAST_SAMPLES,
    least_speed_mps: float = LEAST_SPEED_MPS,
    largest_angle_deg: float = LARGEST_ANGLE_DEG,
) -> TwoBeamMeans:
    """Average both beams over fixed periods and keep the means that can be trusted.

    Parameters
    ----------
    time_utc : numpy.ndarray of datetime64
        (sample,).
    left_mps, right_mps : numpy.ndarray
        (sample,) radial speeds, positive away [m/s]; NaN where a beam has none.
    half_angle_deg, elevation_deg
        As for `two_beam_wind`.
    period_s : float
        Length of a period [s].
    least_samples : int
        On each beam.
    least_speed_mps : float
        Of each beam's mean radial speed, without sign [m/s].
    largest_angle_deg : float
        Of the wind from the axis [deg].

    Raises
    ------
    InputError
        If the arrays differ in length or the period is not positive.

    Examples
    --------
    >>> time = np.datetime64("2014-10-01", "ns") + np.arange(120) * np.timedelta64(1, "s")
    >>> means = two_beam_means(time, np.full(120, -9.0), np.full(120, -7.0), half_angle_deg=30.0)
    >>> means.wind.speed_mps.round(4), [step.after for step in means.steps]
    (array([9.4516]), [1, 1, 1])
    """
    if not np.shape(time_utc) == np.shape(left_mps) == np.shape(right_mps):
        raise InputError("times and radial speeds of both beams have to be equally many")
    if not period_s > 0:
        raise InputError(f"a period of {period_s:g} s came: give one above 0")
    length = round(period_s * 1e9)
    number, place = np.unique(
        time_utc.astype("datetime64[ns]").astype(np.int64) // length, return_inverse=True
    )
    both = [_means(speed, place, len(number)) for speed in (left_mps, right_mps)]
    count, mean = np.stack([part[0] for part in both], axis=-1), np.stack([part[1] for part in both], axis=-1)
    ends = ((number + 1) * length).astype("datetime64[ns]")
    return trusted_means(
        ends,
        count,
        mean,
        half_angle_deg=half_angle_deg,
        elevation_deg=elevation_deg,
        least_samples=least_samples,
        least_speed_mps=least_speed_mps,
        largest_angle_deg=largest_angle_deg,
    )


def trusted_means(
    time_utc: TimeArray,
    count: IntArray,
    mean: FloatArray,
    *,
    half_angle_deg: float,
    elevation_deg: float = 0.0,
    least_samples: int = LEAST_SAMPLES,
    least_speed_mps: float = LEAST_SPEED_MPS,
    largest_angle_deg: float = LARGEST_ANGLE_DEG,
) -> TwoBeamMeans:
    """Winds of the periods whose beams pass every rule, from the means of each beam.

    Parameters
    ----------
    time_utc : numpy.ndarray of datetime64
        (period,) ends.
    count : numpy.ndarray
        (period, 2) good samples of the left and the right beam.
    mean : numpy.ndarray
        (period, 2) mean radial speeds, positive away [m/s]; NaN where there is no sample.
    half_angle_deg, elevation_deg, least_samples, least_speed_mps, largest_angle_deg
        As for `two_beam_means`.
    """
    wind = two_beam_wind(mean[:, 0], mean[:, 1], half_angle_deg=half_angle_deg, elevation_deg=elevation_deg)
    kept, steps = np.ones(len(time_utc), dtype=bool), []
    rules = (
        ("samples on both beams", np.all(count >= least_samples, axis=1)),
        ("radial speed of both beams", np.all(np.abs(mean) > least_speed_mps, axis=1)),
        ("angle from the axis", np.abs(wind.angle_deg) <= largest_angle_deg),
    )
    for name, passes in rules:
        left = kept & passes
        steps.append(Step(name, int(kept.sum()), int(left.sum()), "periods"))
        kept = left
    return TwoBeamMeans(
        time_utc[kept], count[kept], TwoBeamWind(*(values[kept] for values in wind)), tuple(steps)
    )


def _means(values: FloatArray, place: IntArray, periods: int) -> tuple[IntArray, FloatArray]:
    """Good samples of each period and their mean; NaN where there is none."""
    known = np.isfinite(values)
    count = np.bincount(place[known], minlength=periods).astype(np.intp)
    total = np.bincount(place[known], weights=values[known], minlength=periods)
    return count, np.asarray(total / np.where(count > 0, count, np.nan))
