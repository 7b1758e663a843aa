"""How many ten-minute values a stay yields, against the Weibull distribution worked out by hand."""

import numpy as np
import pytest

from geometry.angles import Sector, SectorSet
from geometry.errors import InputError
from planner.placement.yield_days import days_needed, expected_yield
from planner.site import Site, Weibull, Wind


def site_with(**wind):
    return Site(name="a", crs="EPSG:32632", wind=Wind(weibull=Weibull(scale_mps=8.0, shape=2.0), **wind))


def test_all_wind_of_a_week_is_all_its_periods():
    found = expected_yield(
        site_with(speed_range_mps=(0.0, 100.0)), 7.0, speed_edges_mps=[0.0, 5.0, 10.0, 100.0]
    )
    assert found.expected.sum() == pytest.approx(1008.0, rel=1e-6)
    below_five = 1.0 - np.exp(-((5.0 / 8.0) ** 2))
    assert found.expected[0].sum() == pytest.approx(1008.0 * below_five)


def test_directions_lost_to_wakes_are_not_counted():
    free = expected_yield(site_with(), 10.0)
    halved = expected_yield(site_with(), 10.0, excluded=SectorSet.of([Sector(0.0, 180.0)]), availability=0.5)
    assert halved.expected.sum() == pytest.approx(free.expected.sum() / 4)
    assert np.all(halved.expected[:, :6] == 0.0)


def test_days_needed_fill_the_emptiest_wanted_bin():
    day = expected_yield(site_with(), 1.0, speed_edges_mps=[4.0, 8.0, 12.0])
    days = days_needed(day, least_per_bin=3.0)
    longer = expected_yield(site_with(), days, speed_edges_mps=[4.0, 8.0, 12.0])
    assert longer.expected.min() == pytest.approx(3.0)


def test_wind_without_a_distribution_is_said():
    with pytest.raises(InputError, match=r"wind\.weibull"):
        expected_yield(Site(name="a", crs="EPSG:32632"), 1.0)
