"""The clocks of the lidars against that of the mast, and the orientation of sonics against the lidars' beams."""

from collections.abc import Callable, Iterable, Iterator
from typing import NamedTuple

import numpy as np

from geometry.arrays import FloatArray
from geometry.beams import unit_vector
from geometry.errors import InputError
from planner.campaign_logs import SonicInput
from planner.mast_file import WindSeries, lost_of, read_sonic, sonic_columns
from reconstruct.alignment import Lag, Trim, orientation_trim, sample_lag, two_sonics_trim
from reconstruct.averaging import TimeArray
from reconstruct.pairing import RaySeries

DAY_NS = 86_400 * 10**9
ROUNDS = 2  # a sonic that is turned shows turns of the wind as changes of speed, which shifts its lag
MEAN_S = 120  # as in the two-beam study that trims its sonics this way


class ClockLag(NamedTuple):
    """How much later a lidar's rays show the wind than the mast does."""

    lag_s: float  # median of the days; NaN where nothing correlates
    standard_error_s: float  # from the scatter of the days; NaN for one
    correlation: float  # median of the days
    days: int  # that showed a lag


UNTRIED = ClockLag(0.0, float("nan"), float("nan"), 0)


class SonicTrim(NamedTuple):
    """What a sonic's clock and orientation are off by."""

    scan: str
    lag: ClockLag  # of the rays after the sonic
    trim: Trim  # to be added to the sonic's directions, clockwise
    means: int  # of two minutes, that were compared
    lost: str  # what of its file cannot be used, in words; empty where all can


def clock_lag(series: Iterable[RaySeries], mast: WindSeries, *, longest_s: float) -> ClockLag:
    """Find the lag of a lidar's rays at its target, day by day, and its median.

    Parameters
    ----------
    series
        The rays, part by part in the order of time: a day is held at a time.
    mast
        What is compared with, seen along each ray.
    longest_s
        Largest lag that is looked for, either way [s].

    Raises
    ------
    InputError
        If the mast's samples are farther apart than the longest lag.
    """
    if mast.interval_s > longest_s:
        raise InputError(
            f"the mast's values are {mast.interval_s:g} s apart: they cannot show a lag of up to {longest_s:g} s; give "
            "time_lag.longest_s more, or a file with shorter means"
        )
    found = [_lag(day, mast, longest_s) for day in _days(series)]
    lags = np.array([lag.lag_s for lag in found if np.isfinite(lag.lag_s)])
    highest = [lag.correlation for lag in found if np.isfinite(lag.correlation)]
    correlation = float(np.median(highest)) if highest else float("nan")
    if not len(lags):
        return ClockLag(float("nan"), float("nan"), correlation, 0)
    error = float(np.std(lags, ddof=1) / np.sqrt(len(lags))) if len(lags) > 1 else float("nan")
    return ClockLag(float(np.median(lags)), error, correlation, len(lags))


def told_clock(lag: ClockLag) -> str:
    """A clock's lag in words.

    Examples
    --------
    >>> told_clock(ClockLag(12.3, 0.2, 0.97, 3))
    'clock set by the mast: rays were 12.30 ± 0.20 s late (3 days, correlation 0.97) and are moved by -12.30 s'
    """
    if not np.isfinite(lag.lag_s):
        return (
            f"clock left as it is: no lag correlates with the mast (best correlation {lag.correlation:.2f})"
        )
    error = "" if np.isnan(lag.standard_error_s) else f" ± {lag.standard_error_s:.2f}"
    late = f"{abs(lag.lag_s):.2f}{error} s {'late' if lag.lag_s >= 0 else 'early'}"
    days = f"{lag.days} day{'s' if lag.days > 1 else ''}"
    return (
        f"clock set by the mast: rays were {late} ({days}, correlation {lag.correlation:.2f}) and are moved by "
        f"{-lag.lag_s:+.2f} s"
    )


def trim_sonic(sonic: SonicInput, series: Callable[[], Iterable[RaySeries]]) -> tuple[SonicTrim, WindSeries]:
    """Set a sonic's clock by a lidar's rays, then turn it so that it differs least from them over two minutes.

    Parameters
    ----------
    sonic
        Where it is, and its file.
    series
        Gives the rays at its place, part by part in the order of time; it is asked several times.

    Returns
    -------
    SonicTrim
    WindSeries
        The sonic's wind, at the lidar's time and turned.
    """
    wind, angle_deg = read_sonic(sonic), 0.0
    for _ in range(ROUNDS):
        lag = UNTRIED
        if sonic.longest_lag_s > 0:
            seen = _turned(wind, angle_deg)
            lag = clock_lag(series(), seen, longest_s=max(sonic.longest_lag_s, wind.interval_s))
        late_s = lag.lag_s if np.isfinite(lag.lag_s) else 0.0
        moved = wind._replace(time_utc=wind.time_utc + np.timedelta64(round(late_s * 1e9), "ns"))
        parts = [found for part in series() if len(found := _two_minute_means(part, moved))]
        if not parts:
            raise InputError(
                f"sonic '{sonic.name}' and scan '{sonic.scan}' share no two minutes: check their times and the scan's target"
            )
        azimuth, elevation, speed, u, v = np.concatenate(parts).T
        trim = orientation_trim(azimuth, elevation, speed, u, v)
        angle_deg = trim.trim_deg
    lost = lost_of(sonic.path, sonic.separator, sonic.time, sonic_columns(sonic))
    return SonicTrim(sonic.scan, lag, trim, len(speed), lost), _turned(moved, angle_deg)


def _two_minute_means(rays: RaySeries, wind: WindSeries) -> FloatArray:
    """(mean, 5) azimuth, elevation, radial speed of rays and the wind's u and v at their times."""
    u, v = (_at(rays.time_utc, wind, part) for part in (wind.u_mps, wind.v_mps))
    columns = np.stack([rays.azimuth_deg, rays.elevation_deg, rays.radial_speed_mps, u, v], axis=1)
    known = np.all(np.isfinite(columns), axis=1)
    if not np.any(known):
        return np.empty((0, 5))
    ticks = rays.time_utc[known].astype("datetime64[ns]").astype(np.int64)
    _, place = np.unique(ticks // (MEAN_S * 10**9), return_inverse=True)
    first = columns[known][0, 0]  # azimuths are averaged about it: they may lie on both sides of north
    columns[:, 0] = (columns[:, 0] - first + 180.0) % 360.0 - 180.0
    sums = np.stack([np.bincount(place, weights=column) for column in columns[known].T], axis=1)
    return np.asarray(sums / np.bincount(place)[:, None] + np.array([first, 0.0, 0.0, 0.0, 0.0]))


def told_trims(trims: dict[str, SonicTrim]) -> list[str]:
    """What was found of the sonics, in words."""
    lines = []
    for name, each in trims.items():
        lag = each.lag
        side = "after" if lag.lag_s >= 0 else "before"
        late = f"rays came {abs(lag.lag_s):.2f} s {side} it (correlation {lag.correlation:.2f})"
        if np.isnan(lag.lag_s):
            late = f"lag not found (best correlation {lag.correlation:.2f})"
        lines.append(
            f"sonic {name} against {each.scan}: turned by {each.trim.trim_deg:+.2f}°; its mismatch over {each.means} means "
            f"of two minutes falls from {each.trim.before_mps:.3f} to {each.trim.after_mps:.3f} m/s"
            + ("" if lag is UNTRIED else f"; {late}")
            + (f"; {each.lost}" if each.lost else "")
        )
    if len(trims) == 2:
        one, other = (each.trim for each in trims.values())
        shared, apart = two_sonics_trim((one, other))
        lines.append(
            f"both sonics: {shared:+.2f}° is common to them and may as well be the lidars' heading; they disagree by "
            f"{apart:+.2f}°"
        )
    return lines


def _days(series: Iterable[RaySeries]) -> Iterator[RaySeries]:
    """The rays of each day, whatever parts they come in."""
    held: list[RaySeries] = []
    for part in series:
        while len(part.time_utc):
            day = _day_of(held[0] if held else part)
            own = part.time_utc.astype(np.int64) // DAY_NS <= day
            held.append(part.at(own))
            part = part.at(~own)
            if len(part.time_utc):
                yield RaySeries(*(np.concatenate(columns) for columns in zip(*held, strict=True)))
                held = []
    if held:
        yield RaySeries(*(np.concatenate(columns) for columns in zip(*held, strict=True)))


def _day_of(rays: RaySeries) -> int:
    return int(rays.time_utc[0].astype(np.int64)) // DAY_NS


def _lag(rays: RaySeries, wind: WindSeries, longest_s: float) -> Lag:
    """Lag of rays after a wind, seen along them."""
    start = rays.time_utc[0]
    near = np.abs(wind.time_utc - start) <= np.ptp(rays.time_utc) + np.timedelta64(
        round(3e9 * longest_s), "ns"
    )
    beam = unit_vector(rays.azimuth_deg, rays.elevation_deg)[:, :2]
    return sample_lag(
        _seconds(wind.time_utc[near], start),
        np.stack([wind.u_mps[near], wind.v_mps[near]], axis=1),
        _seconds(rays.time_utc, start),
        rays.radial_speed_mps,
        weights=beam,
        longest_s=longest_s,
    )


def _seconds(time_utc: TimeArray, start: np.datetime64) -> FloatArray:
    return np.asarray((time_utc - start) / np.timedelta64(1, "s"))


def _at(time_utc: TimeArray, wind: WindSeries, values: FloatArray) -> FloatArray:
    """A component of the wind at the times of rays; NaN outside it."""
    known = np.isfinite(values)
    if np.count_nonzero(known) < 2:
        return np.full(len(time_utc), np.nan)
    start = wind.time_utc[0]
    at = _seconds(wind.time_utc[known], start)
    return np.asarray(np.interp(_seconds(time_utc, start), at, values[known], left=np.nan, right=np.nan))


def _turned(wind: WindSeries, clockwise_deg: float) -> WindSeries:
    """A wind whose direction is turned clockwise; as it is where the angle is not known."""
    if not np.isfinite(clockwise_deg):
        return wind
    cosine, sine = np.cos(np.radians(clockwise_deg)), np.sin(np.radians(clockwise_deg))
    return wind._replace(
        u_mps=wind.u_mps * cosine + wind.v_mps * sine, v_mps=wind.v_mps * cosine - wind.u_mps * sine
    )
