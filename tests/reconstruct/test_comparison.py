"""Regression against a mast: hand-computed values, second formulas, published numbers, the circle."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from geometry.errors import InputError
from reconstruct.agreement import set_beside
from reconstruct.comparison import (
    fit_direction,
    fit_direction_plainly,
    fit_speed,
    fit_weibull,
    residual_by_direction,
    residuals,
)


def pairs(count: int = 300, seed: int = 1) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    mast = 8.9 * rng.weibull(2.75, count) + 2.0
    return mast, mast / 0.9857 + rng.normal(0.0, 0.5, count)


def test_a_hand_computed_fit() -> None:
    """mast 2, 3; lidar 1, 2: a = (2 + 6)/(1 + 4) = 1.6, residuals .4 and -.2."""
    fit = fit_speed([2.0, 3.0], [1.0, 2.0])
    assert fit.slope == pytest.approx(1.6)
    assert fit.residual_median_mps == pytest.approx(0.1)
    assert fit.residual_mean_mps == pytest.approx(0.1)
    assert fit.residual_std_mps == pytest.approx(np.sqrt(2 * 0.3**2))
    assert fit.r_squared_uncentred == pytest.approx(1 - 0.2 / 13)
    assert fit.r_squared == pytest.approx(1 - 0.2 / 0.5)
    assert fit.bias_mps == pytest.approx(-1.0)
    assert fit.std_mps == pytest.approx(0.0, abs=1e-12)


def test_the_slope_is_that_of_least_squares_without_an_intercept() -> None:
    mast, lidar = pairs()
    wanted = np.linalg.lstsq(lidar[:, None], mast, rcond=None)[0][0]
    assert fit_speed(mast, lidar).slope == pytest.approx(wanted)


def test_the_standard_error_is_that_of_the_formula_where_the_formula_holds() -> None:
    """Equal independent scatter: s / sqrt(Σ lidar²). The jackknife knows nothing of that and comes near."""
    rng = np.random.default_rng(2)
    lidar = rng.uniform(4.0, 16.0, 4000)
    mast = lidar + rng.normal(0.0, 0.5, 4000)
    fit = fit_speed(mast, lidar, blocks=200)
    assert fit.slope_standard_error == pytest.approx(fit.residual_std_mps / np.sqrt(lidar @ lidar), rel=0.2)


def test_the_standard_error_covers_the_truth_as_often_as_it_should() -> None:
    rng = np.random.default_rng(3)
    off = []
    for _ in range(200):
        lidar = rng.uniform(4.0, 16.0, 150)
        fit = fit_speed(
            lidar * (1 + 0.05 * rng.standard_normal(150)), lidar
        )  # scatter that grows with the wind
        off.append((fit.slope - 1.0) / fit.slope_standard_error)
    assert np.std(off) == pytest.approx(1.0, abs=0.15)


def test_the_scatters_standard_error_is_that_of_a_gaussians() -> None:
    """A standard deviation of n Gaussian values is known to 1/sqrt(2(n - 1)) of itself; of directions alike."""
    rng = np.random.default_rng(8)
    lidar = rng.uniform(4.0, 16.0, 4000)
    noise = rng.normal(0.0, 0.5, 4000)
    fit = fit_speed(lidar + noise, lidar, blocks=200)
    share = 1 / np.sqrt(2 * 3999)
    assert fit.residual_std_standard_error_mps == pytest.approx(0.5 * share, rel=0.25)
    angle = rng.uniform(130.0, 250.0, 4000)
    turned = fit_direction(angle + 4 * noise, angle)
    assert turned.residual_std_standard_error_deg == pytest.approx(2.0 * share, rel=0.5)


def test_two_numbers_agree_within_two_of_their_common_standard_errors() -> None:
    """3 and 4 thousandths make 5; what is not known agrees with nothing and disagrees with nothing."""
    near, far = (set_beside(0.99, 0.99 - off, errors=(0.003, 0.004)) for off in (0.0099, 0.0101))
    assert near is not None
    assert far is not None
    assert (near.agrees, far.agrees) == (True, False)
    assert set_beside(None, 1.0) is None
    assert set_beside(float("nan"), 1.0) is None
    unsure = set_beside(1.0, 1.0)
    assert unsure is not None
    assert unsure.agrees is None


@given(st.floats(0.1, 10.0))
@settings(max_examples=20, deadline=None, derandomize=True)
def test_the_slope_turns_with_the_unit_of_the_lidar_and_r_squared_does_not(scale: float) -> None:
    mast, lidar = pairs(50)
    one, other = fit_speed(mast, lidar), fit_speed(mast, scale * lidar)
    assert other.slope == pytest.approx(one.slope / scale)
    assert other.r_squared == pytest.approx(one.r_squared)


def test_missing_values_are_left_out_in_pairs_and_too_few_give_nothing() -> None:
    mast, lidar = pairs(40)
    holes = lidar.copy()
    holes[3] = np.nan
    kept = np.arange(40) != 3
    assert fit_speed(mast, holes)[:2] == pytest.approx(fit_speed(mast[kept], lidar[kept])[:2])
    assert np.isnan(fit_speed([1.0], [1.0]).slope)
    with pytest.raises(InputError, match="one of each per period"):
        fit_speed([1.0, 2.0], [1.0])


def test_directions_across_north_are_fitted_as_if_there_were_no_north() -> None:
    """Turning all directions by any angle turns slope, scatter and bias not at all."""
    rng = np.random.default_rng(4)
    lidar = rng.uniform(130.0, 250.0, 200)
    mast = 190.0 + 1.02 * (lidar - 190.0) - 1.5 + rng.normal(0.0, 0.8, 200)
    plain = fit_direction(mast, lidar)
    for turn in (100.0, 170.0, 290.0):
        turned = fit_direction((mast + turn) % 360, (lidar + turn) % 360)
        assert turned.slope == pytest.approx(plain.slope)
        assert turned.residual_std_deg == pytest.approx(plain.residual_std_deg)
        assert turned.bias_deg == pytest.approx(plain.bias_deg)


def test_away_from_north_the_circular_fit_is_the_plain_one_and_numpys() -> None:
    rng = np.random.default_rng(5)
    lidar = rng.uniform(118.0, 270.0, 148)
    mast = 1.024 * lidar - 4.5 + rng.normal(0.0, 1.0, 148)
    circular, plainly = fit_direction(mast, lidar), fit_direction_plainly(mast, lidar)
    slope, intercept = np.polyfit(lidar, mast, 1)
    for fit in (circular, plainly):
        assert fit.slope == pytest.approx(slope)
        assert fit.intercept_deg == pytest.approx(intercept)
    assert circular.slope == pytest.approx(1.024, abs=0.005)  # the study's dual Doppler: 1.024·dir - 4.5


def test_the_plain_way_is_wrecked_by_one_pair_across_north() -> None:
    lidar, mast = np.array([200.0, 230.0, 260.0, 359.0]), np.array([200.0, 230.0, 260.0, 1.0])
    assert (
        fit_direction_plainly(mast, lidar).std_deg < 2.0
    )  # the circle is never left out of the error itself
    assert fit_direction_plainly(mast, lidar).slope < 0.0
    assert fit_direction(mast, lidar).slope == pytest.approx(1.0, abs=0.02)


def test_winds_from_all_around_keep_bias_and_scatter() -> None:
    rng = np.random.default_rng(6)
    lidar = rng.uniform(0.0, 360.0, 3000)
    fit = fit_direction((lidar + 3.0 + rng.normal(0.0, 2.0, 3000)) % 360, lidar)
    assert fit.bias_deg == pytest.approx(-3.0, abs=0.15)
    assert fit.std_deg == pytest.approx(2.0, abs=0.1)


def test_a_wake_shows_as_a_dent_where_it_is() -> None:
    direction = np.arange(0.0, 360.0, 0.5)
    residual = np.where(np.abs(direction - 185.0) < 10.0, -2.0, 0.1)
    found = residual_by_direction(direction, residual)
    assert found.from_deg[np.argmin(found.median)] in (175.0, 185.0)
    assert found.count.tolist() == [20] * 36
    assert np.median(found.median) == pytest.approx(0.1)
    with pytest.raises(InputError, match="divisor of 360"):
        residual_by_direction(direction, residual, bin_deg=7.0)


def test_a_bin_without_wind_is_unknown_and_quartiles_are_numpys() -> None:
    rng = np.random.default_rng(7)
    values = rng.normal(size=101)
    found = residual_by_direction(np.full(101, 45.0), values, bin_deg=90.0)
    assert [found.lower[0], found.median[0], found.upper[0]] == pytest.approx(
        np.percentile(values, [25, 50, 75]).tolist()
    )
    assert np.isnan(found.median[1:]).all()


@pytest.mark.parametrize(("scale", "shape"), [(8.9, 2.75), (5.0, 1.1), (12.0, 9.0)])
def test_the_weibull_fit_is_scipys(scale: float, shape: float) -> None:
    from scipy.stats import weibull_min

    sample = scale * np.random.default_rng(8).weibull(shape, 400)
    fit = fit_weibull(sample)
    wanted_shape, _, wanted_scale = weibull_min.fit(sample, floc=0.0)
    assert (fit.scale_mps, fit.shape) == pytest.approx((wanted_scale, wanted_shape), rel=1e-3)


def test_a_weibull_fit_of_nothing_is_nothing() -> None:
    assert np.isnan(fit_weibull([5.0, 5.0, np.nan]).scale_mps)


def test_residuals_add_to_the_fit() -> None:
    mast, lidar = pairs(20)
    found = residuals(mast, lidar, np.full(20, 359.0), np.full(20, 2.0))
    assert np.median(found.speed_mps) == pytest.approx(fit_speed(mast, lidar).residual_median_mps)
    assert found.direction_deg == pytest.approx(np.full(20, -3.0))
