"""How a lidar stood while it measured: pointing angles from a log of heading, pitch and roll, and the log's drift.

The log has the instrument's own signs, which `geometry.head.Mounting` shares: heading clockwise, pitch nose up, roll
right side down.
"""

from dataclasses import dataclass, fields
from typing import Literal, NamedTuple

import numpy as np

from geometry.angles import difference_deg
from geometry.arrays import ArrayLike, BoolArray, FloatArray, IntArray
from geometry.beams import beam_to, unit_vector
from geometry.head import Mounting
from reconstruct.records import TimeArray

AngleName = Literal["heading_deg", "pitch_deg", "roll_deg"]

#: Names of what a log holds, as fields of records and of a mounting.
ATTITUDE: tuple[AngleName, ...] = ("heading_deg", "pitch_deg", "roll_deg")

#: Two-sided level at which a drift is called significant.
SIGNIFICANCE = 0.05

#: Fewest independent means that a drift is told from: a line through two has no error to judge it by.
LEAST_MEANS = 3.0

#: Length of the means that the drift is fitted to [s].
DRIFT_PERIOD_S = 600.0


def pointing_angles(
    azimuth_head_deg: ArrayLike,
    elevation_head_deg: ArrayLike,
    mounting: Mounting,
    *,
    heading_deg: ArrayLike,
    pitch_deg: ArrayLike,
    roll_deg: ArrayLike,
) -> tuple[FloatArray, FloatArray]:
    """Turn head angles into pointing angles with an attitude of its own for each ray.

    Parameters
    ----------
    azimuth_head_deg, elevation_head_deg : array_like
        (ray,) encoder angles [deg].
    mounting : geometry.head.Mounting
        Its offsets count; the attitude stands in place of its heading, pitch and roll.
    heading_deg, pitch_deg, roll_deg : array_like
        (ray,) or scalars [deg].

    Returns
    -------
    azimuth_deg, elevation_deg : numpy.ndarray
        (ray,) as `Mounting.to_true`, whose rotation R = H(heading)·P(pitch)·Q(roll) it is, factor by factor.

    Examples
    --------
    >>> azimuth_deg, elevation_deg = pointing_angles([90.0, 90.0], 0.0, Mounting(),
    ...     heading_deg=[0.0, 1.0], pitch_deg=0.0, roll_deg=[2.0, 0.0])
    >>> azimuth_deg.round(6), elevation_deg.round(6) + 0.0
    (array([90., 91.]), array([-2., 0.]))
    """
    azimuth = np.asarray(azimuth_head_deg, dtype=float) + mounting.azimuth_offset_deg
    elevation = np.asarray(elevation_head_deg, dtype=float) + mounting.elevation_offset_deg
    right, front, up = np.moveaxis(unit_vector(azimuth, elevation), -1, 0)
    heading, pitch, roll = (
        np.deg2rad(np.asarray(angle, float)) for angle in (heading_deg, pitch_deg, roll_deg)
    )
    right, up = right * np.cos(roll) + up * np.sin(roll), up * np.cos(roll) - right * np.sin(roll)
    front, up = front * np.cos(pitch) - up * np.sin(pitch), up * np.cos(pitch) + front * np.sin(pitch)
    east = right * np.cos(heading) + front * np.sin(heading)
    north = front * np.cos(heading) - right * np.sin(heading)
    beam = beam_to(np.stack(np.broadcast_arrays(east, north, up), axis=-1))
    return beam.azimuth_deg, beam.elevation_deg


def running_mean(time_utc: TimeArray, values: FloatArray, *, window_s: float) -> FloatArray:
    """Mean over a window around each time, over what is there; NaN where nothing is.

    Parameters
    ----------
    time_utc : numpy.ndarray of datetime64
        (ray,) not decreasing.
    values : numpy.ndarray
        (ray,) angles without jumps at 360 [deg].
    window_s : float
        Length of the window; 0 gives the values as they are [s].

    Examples
    --------
    >>> time = np.arange(5).astype("datetime64[s]").astype("datetime64[ns]")
    >>> running_mean(time, np.array([0.0, 1.0, np.nan, 3.0, 8.0]), window_s=2.0)
    array([0.5, 0.5, 2. , 5.5, 5.5])
    """
    if window_s == 0 or not len(values):
        return values
    seconds = (time_utc - time_utc[0]) / np.timedelta64(1, "s")
    known = np.isfinite(values)
    middle = float(np.mean(values, where=known)) if np.any(known) else 0.0  # keeps the running sum small
    total = np.concatenate([[0.0], np.cumsum(np.where(known, values - middle, 0.0))])
    count = np.concatenate([[0], np.cumsum(known)])
    first = np.searchsorted(seconds, seconds - window_s / 2, side="left")
    last = np.searchsorted(seconds, seconds + window_s / 2, side="right")
    held = count[last] - count[first]
    return np.asarray(middle + (total[last] - total[first]) / np.where(held > 0, held, np.nan))


@dataclass(frozen=True, eq=False)
class LogMeans:
    """Sums of a log over fixed periods; angles are changes from a reference, so that they do not jump at 360."""

    number: IntArray  # (period,) whole periods since 1970
    count: IntArray  # (period,) rays with every quantity that the log has
    heading_deg: FloatArray  # (period,) sums; NaN where the log has none
    pitch_deg: FloatArray
    roll_deg: FloatArray


def log_means(time_utc: TimeArray, changes_deg: FloatArray) -> LogMeans:
    """Sum a log over periods of ten minutes.

    Parameters
    ----------
    time_utc : numpy.ndarray of datetime64
        (ray,)
    changes_deg : numpy.ndarray
        (ray, 3) of heading, pitch and roll from a reference; a column of NaN where the log has none.
    """
    has = np.any(np.isfinite(changes_deg), axis=0)
    known = np.all(np.isfinite(changes_deg[:, has]), axis=1) & bool(np.any(has))
    ticks = time_utc[known].astype("datetime64[ns]").astype(np.int64)
    number, place = np.unique(ticks // round(DRIFT_PERIOD_S * 1e9), return_inverse=True)
    sums: list[FloatArray] = [
        np.bincount(place, weights=changes_deg[known, column], minlength=len(number)).astype(float)
        if has[column]
        else np.full(len(number), np.nan)
        for column in range(len(ATTITUDE))
    ]
    count = np.bincount(place, minlength=len(number)).astype(np.intp)
    return LogMeans(number.astype(np.intp), count, *sums)


def add_log_means(parts: list[LogMeans]) -> LogMeans:
    """Sums of a whole log from those of its parts, which may share periods."""
    number, place = np.unique(np.concatenate([part.number for part in parts]), return_inverse=True)
    added = {}
    for field in fields(LogMeans)[1:]:
        values = np.concatenate([getattr(part, field.name) for part in parts]).astype(float)
        added[field.name] = np.bincount(place, weights=values, minlength=len(number)).astype(float)
    return LogMeans(number.astype(np.intp), added.pop("count").round().astype(np.intp), **added)


class Drift(NamedTuple):
    """How one angle of a log changed over a campaign."""

    change_deg: float  # mean, from the reference
    std_deg: float  # of the ten-minute means about their line
    per_day_deg: float  # slope of the line; NaN with fewer than two means
    standard_error_deg: float  # of the slope; NaN where too little is independent to tell
    significant: bool  # the slope differs from 0 at the 5 % level
    means: int  # of ten minutes
    independent: float  # as many independent ones would tell as much


def drift(days: ArrayLike, angle_deg: ArrayLike) -> Drift:
    """Fit a line to an angle's means.

    Parameters
    ----------
    days : array_like
        (mean,) times, evenly spaced but for gaps [days].
    angle_deg : array_like
        (mean,) [deg].

    Notes
    -----
    The slope is that of ordinary least squares. Neighbouring means of a compass or of a mast that warms up in
    the sun are alike, which makes its usual standard error too small. As Santer et al. (2000, J. Geophys. Res.
    105(D6), 7337-7356, doi:10.1029/1999JD901105) the n residuals count as n (1 - r)/(1 + r)
    independent ones, with r their correlation with their own neighbours (not below 0 here: no more than n), and the
    slope over its standard error is compared with Student's t of that number less two.

    Examples
    --------
    >>> days = np.arange(200) / 144
    >>> found = drift(days, days + 0.1 * np.cos(2.5 * np.arange(200)))
    >>> round(found.per_day_deg, 2), round(found.standard_error_deg, 3), found.significant
    (1.0, 0.013, True)
    """
    time, angle = np.asarray(days, dtype=float), np.asarray(angle_deg, dtype=float)
    known = np.isfinite(time) & np.isfinite(angle)
    time, angle = time[known], angle[known]
    count, nan = len(time), float("nan")
    mean = float(np.mean(angle)) if count else nan
    spread = float(np.sum(np.square(time - np.mean(time)))) if count else 0.0
    if spread == 0:
        return Drift(mean, nan, nan, nan, False, count, float(count))
    slope = float(np.sum((time - np.mean(time)) * angle) / spread)
    left = angle - mean - slope * (time - np.mean(time))
    power = float(left @ left)
    alike = float(left[1:] @ left[:-1]) / power if power > 0 else 0.0
    independent = count * (1 - max(alike, 0.0)) / (1 + max(alike, 0.0))
    if independent < LEAST_MEANS:
        return Drift(mean, float(np.std(left)), slope, nan, False, count, independent)
    error = float(np.sqrt(power / (independent - 2) / spread))
    return Drift(
        mean,
        float(np.std(left)),
        slope,
        error,
        _significant(slope, error, independent - 2),
        count,
        independent,
    )


def drifts(means: LogMeans) -> dict[str, Drift]:
    """The drift of each angle that a log has."""
    days = (means.number - (means.number[0] if len(means.number) else 0)) * (DRIFT_PERIOD_S / 86_400.0)
    with np.errstate(invalid="ignore", divide="ignore"):
        found = {name: getattr(means, name) / means.count for name in ATTITUDE}
    return {name: drift(days, values) for name, values in found.items() if np.any(np.isfinite(values))}


def changes_from(logged_deg: FloatArray, reference_deg: FloatArray) -> FloatArray:
    """(ray, 3) changes of a log from a reference (3,), the shorter way round; NaN where the log has nothing."""
    known: BoolArray = np.isfinite(logged_deg)
    away = np.asarray(difference_deg(np.where(known, logged_deg, 0.0), np.nan_to_num(reference_deg)))
    return np.where(known, away, np.nan)


def _significant(slope: float, error: float, freedom: float) -> bool:
    from scipy.special import stdtrit

    return bool(abs(slope) > float(stdtrit(freedom, 1 - SIGNIFICANCE / 2)) * error)
