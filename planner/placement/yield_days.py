"""How many valid ten-minute values to expect in a stay, by speed and direction, and so how long to stay."""

from typing import NamedTuple

import numpy as np

from geometry.angles import Sector, SectorSet
from geometry.arrays import ArrayLike, FloatArray
from geometry.errors import InputError
from planner.exclusion import wanted_directions
from planner.site import Site
from planner.wind_rose import load_rose, share_within

PERIODS_PER_DAY = 144  # of ten minutes
SPEED_EDGES_MPS = tuple(
    float(edge) for edge in range(4, 26)
)  # bins of 1 m/s, as in a verification of wind speed
DIRECTION_STEP_DEG = 30.0

# The reference study kept 148 of the 1008 ten-minute values of its week.
REFERENCE_KEPT, REFERENCE_PERIODS = 148, 1008


class Yield(NamedTuple):
    """Expected number of valid ten-minute values of a stay."""

    speed_edges_mps: FloatArray  # (speed + 1,)
    direction_edges_deg: FloatArray  # (direction + 1,) clockwise from north
    expected: FloatArray  # (speed, direction)
    periods: float  # of the whole stay, valid or not

    @property
    def kept_share(self) -> float:
        """Share of all periods that is kept."""
        return float(self.expected.sum() / self.periods)


def expected_yield(
    site: Site,
    days: float,
    *,
    availability: float = 1.0,
    excluded: SectorSet | None = None,
    speed_edges_mps: ArrayLike = SPEED_EDGES_MPS,
    direction_step_deg: float = DIRECTION_STEP_DEG,
) -> Yield:
    """Work out what a stay yields.

    Parameters
    ----------
    site
        With its wind: a Weibull distribution or a rose with one for each sector, its speed range and wanted directions.
    days
        Length of the stay, above 0.
    availability
        Share of the periods in the wanted wind that the lidars measure well enough (power, signal, filters), 0 to 1.
        The reference study's week at Høvsøre: 148 of 1008 kept where wind and directions alone allow 381: 0.39.
    excluded
        Directions lost to wakes; `Exclusion.excluded` of a scan at its target.
    speed_edges_mps
        Ascending edges of the bins [m/s]; what lies outside the site's speed range counts nothing.
    direction_step_deg
        Width of the direction bins, a whole part of 360.

    Returns
    -------
    Yield

    Raises
    ------
    InputError
        If a number is out of its range or the wind's distribution is not declared.

    Notes
    -----
    Expected counts: days · 144 · availability · P(direction bin, wanted and free) · P(speed bin). Weather comes in spells, so
    counts of a short stay scatter far more than those of independent draws.

    Examples
    --------
    >>> from planner.site import Site, Weibull, Wind
    >>> wind = Wind(weibull=Weibull(scale_mps=8.9, shape=2.75), directions_deg=((118.0, 270.0),))
    >>> week = expected_yield(Site(name="a", crs="EPSG:32632", wind=wind), 7.0)
    >>> round(float(week.expected.sum())), round(REFERENCE_KEPT / float(week.expected.sum()), 2)
    (381, 0.39)
    """
    edges = np.asarray(speed_edges_mps, dtype=np.float64)
    if not (
        days > 0
        and 0 <= availability <= 1
        and edges.ndim == 1
        and edges.size >= 2
        and np.all(np.diff(edges) > 0)
    ):
        raise InputError(
            f"{days} days with an availability of {availability} and speed edges {edges.tolist()} came; allowed are days "
            "above 0, an availability from 0 to 1, and ascending edges"
        )
    count = round(360.0 / direction_step_deg)
    if count < 1 or abs(count * direction_step_deg - 360.0) > 1e-9:
        raise InputError(f"direction bins of {direction_step_deg}° came; allowed is a whole part of 360")
    kept = wanted_directions(site).difference(excluded or SectorSet.empty())
    share = np.zeros((edges.size - 1, count))
    for number in range(count):
        cell = SectorSet.of([Sector(number * direction_step_deg, direction_step_deg)]).intersection(kept)
        share[:, number] = _speed_shares(site, cell, edges)
    periods = days * PERIODS_PER_DAY
    return Yield(edges, np.linspace(0.0, 360.0, count + 1), share * periods * availability, periods)


def _speed_shares(site: Site, cell: SectorSet, edges: FloatArray) -> FloatArray:
    """(speed,) share of all wind that comes from some directions at the speeds of each bin."""
    wind = site.assumed_wind
    low, high = wind.speed_range_mps
    limits = np.clip(edges, low, high)
    if wind.rose is not None:
        rose = load_rose(wind.rose)
        if rose.weibull_scale_mps is not None and rose.weibull_shape is not None:
            parts = zip(rose.sectors, rose.share, rose.weibull_scale_mps, rose.weibull_shape, strict=True)
            each = [
                share
                * cell.intersection(SectorSet.of([sector])).width_deg
                / sector.width_deg
                * _shares(a, k, limits)
                for sector, share, a, k in parts
            ]
            return np.asarray(np.sum(each, axis=0))
    if wind.weibull is None:
        raise InputError(
            "how often each speed blows is not declared: give wind.weibull, or a rose with weibull_scale_mps and weibull_shape"
        )
    return share_within(site, cell) * _shares(wind.weibull.scale_mps, wind.weibull.shape, limits)


def _shares(scale_mps: float, shape: float, limits_mps: FloatArray) -> FloatArray:
    """Share of a Weibull distribution between successive limits."""
    return np.asarray(-np.diff(np.exp(-((limits_mps / scale_mps) ** shape))))
