"""A filter that follows the conditions: outliers of radial speed and CNR against their own neighbourhood.

Fixed limits cut good rays when the air is clean and let noise pass when it is not. Here each ray is measured
against the others of its time: how far its radial speed is from the median of its own direction, and how far
its CNR is below the median, both in robust standard deviations of the window (1.4826 times the median
absolute deviation). What lies outside the ellipse is an outlier. The idea of judging a ray by the density of
its neighbours in the plane of radial speed and CNR, normalised over a short interval, is that of Beck and
Kühn (2017, Remote Sens. 9, 561, doi:10.3390/rs9060561); median and MAD stand for their histogram, as in the
moving-window filters that Alcayaga (2020, Atmos. Meas. Tech. 13, 6237-6254, doi:10.5194/amt-13-6237-2020)
compares with. CNR counts on its low side only: a strong echo is a hard target, which limits are for.
"""

from collections.abc import Iterator
from itertools import chain
from typing import NamedTuple

import numpy as np

from geometry.arrays import FloatArray
from geometry.errors import InputError
from reconstruct.filters import Filtered, keep

MAD_TO_STD = 1.4826  # of a normal distribution: 1 / 0.6745, its upper quartile
WINDOW_SCANS = 50  # ten minutes of the reference study's 12 s scans
DISTANCE = 5.0  # robust standard deviations: 4e-6 of normal rays lie beyond it in two dimensions
LEAST_SPEED_STD_MPS = 0.1  # a lidar's own noise: a calm laminar hour must not make outliers of good rays
LEAST_CNR_STD_DB = 0.5
SHORT_SHARE = 5  # windows of a fifth of the length stand beside: what lasts two minutes is no outlier
SHORTEST_SCANS = 10


class Window(NamedTuple):
    """How the automatic filter looks at the data."""

    scans: int = WINDOW_SCANS
    distance: float = DISTANCE
    least_speed_std_mps: float = LEAST_SPEED_STD_MPS
    least_cnr_std_db: float = LEAST_CNR_STD_DB


DEFAULT = Window()


def filter_outliers(
    radial_speed_mps: FloatArray, cnr_db: FloatArray | None = None, *, window: Window = DEFAULT
) -> Filtered:
    """Take away the rays that do not belong to their neighbourhood.

    Parameters
    ----------
    radial_speed_mps : numpy.ndarray
        (scan, ray) in the order of time, a column for each direction [m/s]; NaN where missing.
    cnr_db : numpy.ndarray, optional
        (scan, ray) [dB]; where it is NaN, or not given, the radial speed alone counts.
    window : Window
        Length in scans, and how far is too far.

    Returns
    -------
    Filtered

    Raises
    ------
    InputError
        If the shapes differ, or the window has fewer than 3 scans.

    Notes
    -----
    Windows overlap by half, and others of a fifth of the length do so beside them: a ray lies in about four. In
    each, with s the robust standard deviations there, its distance is d² = (Δv/s_v)² + (min(ΔCNR, 0)/s_c)²; it is
    kept where d is small enough in any of them. So a ray at a front belongs to what came before or to what comes
    after, and a gust of minutes to itself.

    Examples
    --------
    >>> speed = 5.0 + 0.2 * np.sin(np.arange(60.0)).reshape(20, 3)
    >>> speed[7, 1] = -22.0
    >>> np.argwhere(np.isnan(filter_outliers(speed).values)).tolist()
    [[7, 1]]
    """
    speed = np.asarray(radial_speed_mps, dtype=float)
    cnr_shape = speed.shape if cnr_db is None else np.asarray(cnr_db).shape
    if speed.ndim != 2 or cnr_shape != speed.shape:
        raise InputError(f"radial speeds {speed.shape} and CNR {cnr_shape} came: both have to be (scan, ray)")
    if window.scans < 3:
        raise InputError(f"a window of {window.scans} scans came: 3 or more are needed for a median")
    cnr = None if cnr_db is None else np.where(np.isfinite(speed), np.asarray(cnr_db, dtype=float), np.nan)
    nearest = np.full(speed.shape, np.inf)
    short = max(window.scans // SHORT_SHARE, SHORTEST_SCANS)
    for part in chain(_windows(len(speed), window.scans), _windows(len(speed), short)):
        distance = np.square(_deviation(speed[part], window.least_speed_std_mps))
        if cnr is not None:
            faint = np.minimum(_deviation(cnr[part], window.least_cnr_std_db), 0.0)
            distance += np.square(np.where(np.isfinite(faint), faint, 0.0))
        nearest[part] = np.fmin(nearest[part], distance)
    return keep(speed, nearest <= window.distance**2, "automatic")


class Agreement(NamedTuple):
    """How the automatic filter and fixed limits agree, in rays."""

    kept_by_both: int
    kept_by_limits_only: int
    kept_by_automatic_only: int
    kept_by_neither: int


def compare_filters(before: FloatArray, limits: FloatArray, automatic: FloatArray) -> Agreement:
    """Count how two filtered versions of the same rays differ.

    Examples
    --------
    >>> before = np.array([1.0, 2.0, 3.0])
    >>> compare_filters(before, np.array([1.0, 2.0, np.nan]), np.array([1.0, np.nan, np.nan]))
    Agreement(kept_by_both=1, kept_by_limits_only=1, kept_by_automatic_only=0, kept_by_neither=1)
    """
    there, by_limits, by_itself = (np.isfinite(values) for values in (before, limits, automatic))
    parts = (by_limits & by_itself, by_limits & ~by_itself, ~by_limits & by_itself, ~by_limits & ~by_itself)
    return Agreement(*(int(np.count_nonzero(part & there)) for part in parts))


def _deviation(values: FloatArray, least: float) -> FloatArray:
    """(scan, ray) distance from the median of each column in robust standard deviations of all of them."""
    off = values - _median(values)
    spread = float(_median(np.abs(off).reshape(-1, 1))[0])
    return off / max(MAD_TO_STD * spread, least)


def _windows(count: int, scans: int) -> Iterator[slice]:
    """Windows that overlap by half; the last one ends with the data."""
    step = max(scans // 2, 1)
    for start in range(0, max(count - scans, 0), step):
        yield slice(start, start + scans)
    yield slice(max(count - scans, 0), count)


def _median(values: FloatArray) -> FloatArray:
    """(column,) median of what is there; NaN where nothing is (numpy's nanmedian warns there)."""
    ordered = np.sort(values, axis=0)  # NaN last
    count = np.count_nonzero(np.isfinite(values), axis=0)
    low, high = np.maximum((count - 1) // 2, 0), count // 2
    column = np.arange(values.shape[1])
    middle = (ordered[low, column] + ordered[np.minimum(high, len(values) - 1), column]) / 2
    return np.where(count > 0, middle, np.nan)
