"""Bringing two instruments together: time lag by correlation, orientation of a sonic by a lidar's beams."""

from typing import NamedTuple

import numpy as np

from geometry.angles import wrap_180_deg
from geometry.arrays import ArrayLike, FloatArray
from geometry.beams import unit_vector
from geometry.errors import InputError

MIN_OVERLAP = 10  # samples that two shifted series must share
MIN_CORRELATION = 0.2  # below it the best lag is chance
LAG_STEPS = 30  # lags that are tried on each side; the parabola finds those between
LONGEST_GAP = 3.0  # of the usual step of a reference: a longer one is not bridged


class Lag(NamedTuple):
    """How much later a series is than its reference."""

    lag_s: float  # positive: the series shows later what the reference showed; NaN where nothing correlates
    correlation: float  # at the best whole lag


def time_lag(reference: ArrayLike, series: ArrayLike, *, interval_s: float, longest_s: float) -> Lag:
    """Find the lag at which two series correlate best.

    Parameters
    ----------
    reference, series : array_like
        (sample,) at the same regular times, NaN where missing.
    interval_s : float
        Between samples [s].
    longest_s : float
        Largest lag that is looked for, to either side [s].

    Returns
    -------
    Lag
        Subtract `lag_s` from the series' times. A fraction of the interval comes from the parabola through
        the best correlation and its neighbours.

    Raises
    ------
    InputError
        If the series differ in length or are shorter than the lag and 10 samples.

    Notes
    -----
    At each lag the correlation is Pearson's over the samples that both have, so that gaps do not pull it
    towards zero.

    Examples
    --------
    >>> wave = np.sin(np.arange(200) / 7.0)
    >>> lag = time_lag(wave, np.roll(wave, 3), interval_s=0.5, longest_s=5.0)
    >>> round(lag.lag_s, 1), round(lag.correlation, 2)
    (1.5, 1.0)
    """
    one, other = np.asarray(reference, dtype=float), np.asarray(series, dtype=float)
    most = int(longest_s / interval_s + 1e-9)
    if one.shape != other.shape or one.ndim != 1 or len(one) < most + MIN_OVERLAP:
        raise InputError(
            f"series of {one.shape} and {other.shape} samples came for lags up to {most}: give two of one length, "
            f"{most + MIN_OVERLAP} samples or more"
        )
    lags = np.arange(-most, most + 1)
    found = np.array([_correlation(*_shifted(one, other, int(lag))) for lag in lags])
    return _best_lag(np.asarray(lags * interval_s, dtype=float), found)


def sample_lag(
    reference_s: ArrayLike,
    reference: ArrayLike,
    sample_s: ArrayLike,
    sample: ArrayLike,
    *,
    weights: ArrayLike = 1.0,
    longest_s: float,
    steps: int = LAG_STEPS,
) -> Lag:
    """Find the lag of samples that were taken at times of their own, such as the rays of a scan.

    Parameters
    ----------
    reference_s : array_like
        (time,) rising [s].
    reference : array_like
        (time,) or (time, part): what is compared with, NaN where missing.
    sample_s, sample : array_like
        (sample,) times [s] and values, NaN where missing.
    weights : array_like
        (part,) or (sample, part): what a sample sees of each part, such as the beam's direction of the wind's
        components.
    longest_s : float
        Largest lag that is looked for, to either side [s].
    steps : int
        Lags that are tried on each side.

    Returns
    -------
    Lag
        As of `time_lag`.

    Notes
    -----
    For each lag the reference is taken, straight between its samples, at the samples' times less the lag. Where its
    samples are farther apart than three times their usual step nothing is known.

    Examples
    --------
    >>> time = np.arange(0.0, 600.0, 2.0)
    >>> ray = np.sort(np.random.default_rng(1).uniform(50.0, 550.0, 300))
    >>> lag = sample_lag(time, np.sin(time / 9.0), ray, np.sin((ray - 4.3) / 9.0), longest_s=10.0)
    >>> round(lag.lag_s, 1), round(lag.correlation, 2)
    (4.3, 1.0)
    """
    at, when = np.asarray(reference_s, dtype=float), np.asarray(sample_s, dtype=float)
    parts = np.asarray(reference, dtype=float).reshape(len(at), -1)
    seen = np.broadcast_to(np.asarray(weights, dtype=float), (len(when), parts.shape[1]))
    measured = np.asarray(sample, dtype=float)
    known = np.all(np.isfinite(parts), axis=1)
    at, parts = at[known], parts[known]
    if len(at) < MIN_OVERLAP or not longest_s > 0 or steps < 1:
        return Lag(float("nan"), float("nan"))
    apart = LONGEST_GAP * float(np.median(np.diff(at)))
    lags = np.linspace(-longest_s, longest_s, 2 * steps + 1)
    found = np.array([_correlation(_taken(at, parts, seen, when - lag, apart), measured) for lag in lags])
    return _best_lag(lags, found)


def _taken(at: FloatArray, parts: FloatArray, seen: FloatArray, when: FloatArray, apart: float) -> FloatArray:
    """A reference at some times, as it is seen; NaN outside it and in its gaps."""
    total = np.zeros(len(when))
    for column, weight in zip(parts.T, seen.T, strict=True):
        total += weight * np.interp(when, at, column, left=np.nan, right=np.nan)
    after = np.clip(np.searchsorted(at, when), 1, len(at) - 1)
    return np.where(at[after] - at[after - 1] <= apart, total, np.nan)


def _best_lag(lags: FloatArray, found: FloatArray) -> Lag:
    """Where the correlation is highest, between the lags that were tried."""
    if not np.any(np.isfinite(found)) or np.nanmax(found) < MIN_CORRELATION:
        return Lag(float("nan"), float(np.nanmax(found)) if np.any(np.isfinite(found)) else float("nan"))
    best = int(np.nanargmax(found))
    return Lag(float(lags[best] + _vertex(found, best) * (lags[1] - lags[0])), float(found[best]))


class Trim(NamedTuple):
    """What has to be added to a sonic's directions so that it agrees with the lidar."""

    trim_deg: float  # clockwise
    before_mps: float  # rms mismatch of the radial speeds as they are
    after_mps: float  # and with the trim


def orientation_trim(
    azimuth_deg: ArrayLike,
    elevation_deg: ArrayLike,
    radial_speed_mps: ArrayLike,
    u_mps: ArrayLike,
    v_mps: ArrayLike,
    w_mps: ArrayLike = 0.0,
) -> Trim:
    """Turn a sonic so that its wind, seen along the lidar's beams, differs least from what the lidar saw.

    Parameters
    ----------
    azimuth_deg, elevation_deg, radial_speed_mps : array_like
        (sample,) or (sample, beam): beams and what they measured, positive away.
    u_mps, v_mps, w_mps : array_like
        The sonic's wind at the same times, of shapes that broadcast with the beams [m/s].

    Returns
    -------
    Trim
        NaN where nothing is known.

    Notes
    -----
    Turning the wind clockwise by δ makes its radial speed A cos δ + B sin δ + w sin φ with A = u s + v c and
    B = v s - u c, where (s, c) = (sin θ, cos θ) cos φ. The sum of squared mismatches is a trigonometric
    polynomial of second degree in δ: its minimum is found on a fine grid and by Newton's method from there.

    Examples
    --------
    >>> trim = orientation_trim([0.0, 90.0], 0.0, [0.0, 8.0], 8.0 * np.cos(np.radians(5.0)), 8.0 * np.sin(np.radians(5.0)))
    >>> round(trim.trim_deg, 4), round(trim.after_mps, 6)
    (5.0, 0.0)
    """
    beam = unit_vector(azimuth_deg, elevation_deg)
    u, v, w, measured = (np.asarray(part, dtype=float) for part in (u_mps, v_mps, w_mps, radial_speed_mps))
    straight, turned = u * beam[..., 0] + v * beam[..., 1], v * beam[..., 0] - u * beam[..., 1]
    a, b, m = (part.ravel() for part in np.broadcast_arrays(straight, turned, measured - w * beam[..., 2]))
    known = np.isfinite(a) & np.isfinite(b) & np.isfinite(m)
    a, b, m = a[known], b[known], m[known]
    if not len(m):
        return Trim(float("nan"), float("nan"), float("nan"))

    def mismatch(angle: float) -> float:
        return float(np.sqrt(np.mean(np.square(m - a * np.cos(angle) - b * np.sin(angle)))))

    angle = _least(a, b, m)
    return Trim(float(wrap_180_deg(np.degrees(angle))), mismatch(0.0), mismatch(angle))


def two_sonics_trim(trims: tuple[Trim, Trim]) -> tuple[float, float]:
    """Mean trim of two sonics and how much they disagree about the lidar's own axis [deg].

    Each sonic at the focus of its own beam gives one trim. What they share may as well be the lidar's
    heading; what is left is the sonics' own disagreement.

    Examples
    --------
    >>> two_sonics_trim((Trim(3.0, 1.0, 0.1), Trim(1.0, 1.0, 0.1)))
    (2.0, 2.0)
    """
    apart = float(wrap_180_deg(trims[0].trim_deg - trims[1].trim_deg))
    return float(wrap_180_deg(trims[1].trim_deg + apart / 2)), apart


def _shifted(one: FloatArray, other: FloatArray, lag: int) -> tuple[FloatArray, FloatArray]:
    """The samples of a reference, and those of a series `lag` samples later."""
    if lag >= 0:
        return one[: len(one) - lag], other[lag:]
    return one[-lag:], other[:lag]


def _correlation(one: FloatArray, other: FloatArray) -> float:
    known = np.isfinite(one) & np.isfinite(other)
    if np.count_nonzero(known) < MIN_OVERLAP:
        return float("nan")
    a, b = one[known] - np.mean(one[known]), other[known] - np.mean(other[known])
    power = float((a @ a) * (b @ b))
    return float(a @ b) / np.sqrt(power) if power > 0 else float("nan")


def _vertex(values: FloatArray, best: int) -> float:
    """Where the parabola through the largest value and its neighbours has its top, -0.5 to 0.5."""
    if not 0 < best < len(values) - 1:
        return 0.0
    before, at, after = values[best - 1 : best + 2]
    bend = before - 2 * at + after
    return float(0.5 * (before - after) / bend) if np.isfinite(bend) and bend < 0 else 0.0


def _least(a: FloatArray, b: FloatArray, m: FloatArray) -> float:
    """Angle [rad] that minimises the sum of (m - a cos - b sin)²: grid of a degree, then Newton."""
    aa, bb, ab, am, bm = (float(x @ y) for x, y in ((a, a), (b, b), (a, b), (a, m), (b, m)))
    grid = np.radians(np.arange(-180.0, 180.0))
    cosine, sine = np.cos(grid), np.sin(grid)
    cost = aa * cosine**2 + bb * sine**2 + 2 * ab * cosine * sine - 2 * am * cosine - 2 * bm * sine
    angle = float(grid[int(np.argmin(cost))])
    for _ in range(20):
        c, s = np.cos(angle), np.sin(angle)
        slope = (bb - aa) * s * c + ab * (c * c - s * s) + am * s - bm * c
        bend = (bb - aa) * (c * c - s * s) - 4 * ab * s * c + am * c + bm * s
        if bend <= 0:
            break
        angle -= float(slope / bend)
    return angle
