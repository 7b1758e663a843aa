"""Climates against integrals of the Weibull distribution and plain counting."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad
from scipy.special import gamma

from geometry.errors import InputError
from reconstruct.climate import Climate, listed_climate, rose_climate, spread_directions, weibull_climate
from reconstruct.wind import WindState


def test_mean_speed_of_a_whole_weibull_is_a_gamma_function():
    climate = weibull_climate(8.9, 2.75, speeds=40, directions=1)
    assert climate.mean(climate.speed_mps) == pytest.approx(8.9 * gamma(1 + 1 / 2.75), rel=1e-3)


def test_moments_of_a_truncated_weibull_agree_with_integration():
    def density(v):
        return 2.75 / 8.9 * (v / 8.9) ** 1.75 * np.exp(-((v / 8.9) ** 2.75))

    climate = weibull_climate(8.9, 2.75, speed_range_mps=(4.0, 25.0), directions=1)
    total = quad(density, 4, 25)[0]
    for power in (1, 2, 3):
        theirs = quad(lambda v, power=power: v**power * density(v), 4, 25)[0] / total
        assert climate.mean(climate.speed_mps**power) == pytest.approx(theirs, rel=2e-3)


def test_forty_states_are_five_speeds_by_eight_directions_within_the_sector():
    climate = weibull_climate(8.9, 2.75, speed_range_mps=(4.0, 25.0), directions_deg=[(118.0, 270.0)])
    assert climate.count == 40
    assert np.all((climate.from_deg > 118) & (climate.from_deg < 270))
    assert climate.mean(climate.from_deg) == pytest.approx(194.0)
    assert climate.weight.sum() == pytest.approx(1.0)


def test_sector_across_north_is_followed_through_zero():
    np.testing.assert_allclose(spread_directions([(350.0, 10.0)], 4), [352.5, 357.5, 2.5, 7.5])


def test_two_sectors_share_directions_by_their_width():
    angles = spread_directions([(0.0, 90.0), (180.0, 210.0)], 12)
    assert np.count_nonzero(angles < 90) == 9
    assert np.count_nonzero(angles > 180) == 3


def test_whole_circle_is_spread_evenly():
    np.testing.assert_allclose(np.diff(spread_directions([(0.0, 360.0)], 8)), 45.0)


@settings(max_examples=30, deadline=None, derandomize=True)
@given(start=st.floats(0, 359), width=st.floats(1, 359), count=st.integers(1, 20))
def test_spread_directions_stay_in_their_sector(start, width, count):
    angles = spread_directions([(start, (start + width) % 360)], count)
    assert np.all((angles - start) % 360 <= width + 1e-9)


def test_rose_keeps_the_bins_that_count_with_their_frequency():
    climate = rose_climate(
        [5, 9, 30], [100, 200, 200], [3, 1, 9], speed_range_mps=(4, 25), directions_deg=[(90, 270)]
    )
    np.testing.assert_allclose(climate.weight, [0.75, 0.25])


def test_states_carry_everything_else_along():
    like = WindState(1.0, 0.0, shear_exponent=0.2, height_m=116.5, vertical_mps=0.1)
    states = listed_climate([7.0, 9.0], directions_deg=[(90.0, 110.0)], directions=1).states(like)
    assert [(state.speed_mps, state.from_deg, state.shear_exponent) for state in states] == [
        (7, 100, 0.2),
        (9, 100, 0.2),
    ]


def test_climates_that_hold_nothing_are_refused():
    with pytest.raises(InputError, match="both have to be above 0"):
        weibull_climate(0.0, 2.0)
    with pytest.raises(InputError, match="no wind of that climate"):
        weibull_climate(8.0, 2.0, speed_range_mps=(5.0, 5.0))
    with pytest.raises(InputError, match="no wind direction"):
        weibull_climate(8.0, 2.0, directions_deg=[])
    with pytest.raises(InputError, match="no bin"):
        rose_climate([5.0], [0.0], [1.0], directions_deg=[(90, 180)])
    with pytest.raises(InputError, match="weight 0"):
        Climate(np.ones(1), np.ones(1), np.zeros(1))
    with pytest.raises(InputError, match="negative"):
        Climate(-np.ones(1), np.ones(1), np.ones(1))
    with pytest.raises(InputError, match="one each"):
        Climate(np.ones(2), np.ones(1), np.ones(1))
