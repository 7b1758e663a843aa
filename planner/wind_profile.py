"""Mean wind against height: what the lidars measured at several heights, beside the levels of the mast."""

from collections.abc import Mapping, Sequence
from functools import reduce
from typing import NamedTuple

import numpy as np

from geometry.angles import circular_mean_deg
from geometry.arrays import FloatArray
from planner.comparing import Matched
from reconstruct.averaging import PeriodMeans, TimeArray

LEAST_HEIGHTS = 2


class Levels(NamedTuple):
    """Means of one instrument at its heights, rising."""

    name: str
    height_m: FloatArray  # (level,)
    speed_mps: FloatArray  # (level,) mean of the periods' mean speeds
    from_deg: FloatArray  # (level,) circular mean of the periods' directions


class Profile(NamedTuple):
    """Mean winds over the periods that all heights share."""

    levels: tuple[Levels, ...]  # the mast first, if it says its heights
    periods: int


def wind_profile(
    matched: Sequence[Matched], levels: Mapping[float | None, PeriodMeans], series: Mapping[str, str]
) -> Profile | None:
    """Mean wind at every height over the same periods.

    Parameters
    ----------
    matched
        The widest size of each result; one without a height is left out.
    levels
        Of the mast, by height.
    series
        Name of the profile that each result belongs to: its scan, if that has several gates.

    Returns
    -------
    Profile or None
        None where there is but one height, or no period that all share.
    """
    known = [one for one in matched if one.height_m is not None and len(one.time_utc)]
    heights = {round(one.height_m or 0.0, 1) for one in known}
    masts = {height: means for height, means in levels.items() if height is not None}
    if not known or max(len(heights), len(masts)) < LEAST_HEIGHTS:
        return None
    shared: TimeArray = reduce(np.intersect1d, [one.time_utc for one in known], next(iter(known)).time_utc)
    shared = reduce(np.intersect1d, [_known(means) for means in masts.values()], shared)
    if not len(shared):
        return None
    found = []
    if masts:
        rows = [(height, *_at(means, shared)) for height, means in sorted(masts.items())]
        found.append(_levels("mast", rows))
    for name in dict.fromkeys(series[one.scan] for one in known):
        mine = [one for one in known if series[one.scan] == name]
        picked = [(one.height_m or 0.0, one, np.isin(one.time_utc, shared)) for one in mine]
        rows = [(height, one.lidar_mps[here], one.lidar_deg[here]) for height, one, here in picked]
        found.append(_levels(name, sorted(rows, key=lambda row: row[0])))
    return Profile(tuple(found), len(shared))


def _known(means: PeriodMeans) -> TimeArray:
    return means.time_utc[np.isfinite(means.speed_mps) & np.isfinite(means.from_deg)]


def _at(means: PeriodMeans, shared: TimeArray) -> tuple[FloatArray, FloatArray]:
    here = np.isin(means.time_utc, shared)
    return means.speed_mps[here], means.from_deg[here]


def _levels(name: str, rows: Sequence[tuple[float, FloatArray, FloatArray]]) -> Levels:
    return Levels(
        name,
        np.array([height for height, _, _ in rows]),
        np.array([float(np.mean(speed)) for _, speed, _ in rows]),
        np.array([float(circular_mean_deg(angle)) for _, _, angle in rows]),
    )
