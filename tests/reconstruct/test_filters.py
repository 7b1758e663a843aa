"""Filters: what is kept, what is counted, and that good rays survive where noise does not."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from geometry.angles import Sector, SectorSet
from geometry.errors import InputError
from reconstruct.automatic_filter import Window, compare_filters, filter_outliers
from reconstruct.filters import (
    Step,
    goodness,
    limit_availability,
    limit_cnr,
    limit_directions,
    limit_goodness,
    limit_radial_speed,
    limit_speed,
    partial_scans,
    reduce_sector,
    within,
)
from reconstruct.retrieval import rows
from reconstruct.sector_scan import sector_wind

AZIMUTH = np.arange(163.0, 222.0, 2.0)  # 30 rays


def test_limits_are_inside_and_a_missing_value_is_not() -> None:
    assert within([-25.0, -5.0, np.nan, -4.999], (-25.0, -5.0)).tolist() == [True, True, False, False]


def test_limits_that_run_backwards_are_refused() -> None:
    with pytest.raises(InputError, match="lower one has to come first"):
        within([1.0], (5.0, -5.0))


def test_each_filter_counts_what_came_and_what_is_left() -> None:
    speed = np.array([[5.0, np.nan, -40.0], [6.0, 7.0, 8.0]])
    cnr = np.array([[-12.0, -12.0, -12.0], [-26.0, np.nan, -6.0]])
    first = limit_cnr(speed, cnr, (-25.0, -5.0))
    second = limit_radial_speed(first.values, (-30.0, 30.0))
    assert first.step == Step("CNR", 5, 3)
    assert second.step == Step("radial speed", 3, 2)
    np.testing.assert_array_equal(second.values, [[5.0, np.nan, np.nan], [np.nan, np.nan, 8.0]])


def test_filters_do_not_write_to_what_came() -> None:
    speed = np.array([[5.0, 50.0]])
    limit_radial_speed(speed, (-30.0, 30.0))
    partial_scans(speed * np.nan)
    assert speed.tolist() == [[5.0, 50.0]]


@given(
    st.lists(st.lists(st.booleans(), min_size=6, max_size=6), min_size=1, max_size=8), st.floats(0.01, 1.0)
)
@settings(max_examples=50, deadline=None, derandomize=True)
def test_a_partial_scan_is_kept_whole_or_dropped_whole(there: list[list[bool]], share: float) -> None:
    speed = np.where(np.array(there), 5.0, np.nan)
    left = partial_scans(speed, ray_share=share)
    for before, after in zip(speed, left.values, strict=True):
        count = int(np.sum(~np.isnan(before)))
        expected = before if count >= share * 6 - 1e-9 and count else np.full(6, np.nan)
        np.testing.assert_array_equal(after, expected)


def test_a_step_adds_up_over_the_parts_of_a_campaign_and_only_with_its_like() -> None:
    assert Step("CNR", 10, 8) + Step("CNR", 5, 5) == Step("CNR", 15, 13)
    with pytest.raises(TypeError):
        Step("CNR", 10, 8) + Step("speed", 5, 5)


def test_sizes_of_the_study_are_its_middle_rays() -> None:
    """Simon (2015): 60, 50, 44, 38, 30, 22, 14, 8, 4 degrees are 30, 26, 23, 20, 16, 12, 8, 5, 3 rays."""
    slices = reduce_sector(30, 2.0, [60, 50, 44, 38, 30, 22, 14, 8, 4], motion="continuous")
    assert [s.stop - s.start for s in slices] == [30, 26, 23, 20, 16, 12, 8, 5, 3]


def test_directions_that_cross_north_are_kept_and_unknown_ones_are_not() -> None:
    allowed = SectorSet.of([Sector.between(350.0, 10.0)])
    kept = limit_directions(np.ones(4), np.array([355.0, 5.0, 180.0, np.nan]), allowed)
    np.testing.assert_array_equal(kept.values, [1.0, 1.0, np.nan, np.nan])
    assert limit_directions(np.ones(1), np.array([np.nan]), SectorSet.full()).step.after == 1


def test_the_studys_19_of_50_scans() -> None:
    kept = limit_availability(np.ones(3), [18, 19, 50], expected=50, share=0.38)
    np.testing.assert_array_equal(kept.values, [np.nan, 1.0, 1.0])


def test_speeds_at_the_ends_of_the_range_count() -> None:
    kept = limit_speed(np.ones(4), np.array([3.99, 4.0, 25.0, 25.01]), (4.0, 25.0))
    assert kept.step.after == 2


def test_goodness_is_that_of_the_textbook() -> None:
    """Residual std, r² and reduced χ² against numpy's own least squares."""
    rng = np.random.default_rng(3)
    matrix = rows(AZIMUTH, 5.96)
    speed = matrix @ [3.0, 8.0] + rng.normal(0.0, 0.3, 30)
    speed[[2, 17]] = np.nan
    found = goodness(sector_wind(AZIMUTH, 5.96, speed), speed, noise_mps=0.3)
    known = np.isfinite(speed)
    _, squares, _, _ = np.linalg.lstsq(matrix[known], speed[known], rcond=None)
    total = np.sum((speed[known] - speed[known].mean()) ** 2)
    assert found.residual_std_mps == pytest.approx(np.sqrt(squares[0] / 26))
    assert found.r_squared == pytest.approx(1 - squares[0] / total)
    assert found.reduced_chi2 == pytest.approx(squares[0] / 26 / 0.09)


def test_a_scan_without_a_ray_to_spare_passes_the_goodness_filter() -> None:
    speed = np.array([[5.0, 5.1]])
    good = goodness(sector_wind([170.0, 200.0], 5.0, speed), speed, noise_mps=0.1)
    assert limit_goodness(np.ones(1), good, residual_std_mps=0.01, reduced_chi2=1.0).step.lost == 0


def windy(scans: int, rng: np.random.Generator, *, turbulence: float = 0.8) -> np.ndarray:
    """Radial speeds of a wind that grows from 6 to 12 m/s and turns by 40 degrees."""
    speed = np.linspace(6.0, 12.0, scans)[:, None]
    angle = np.radians(200.0 + np.linspace(0.0, 40.0, scans))[:, None]
    axis = np.radians(AZIMUTH)
    return -speed * np.cos(angle - axis) + rng.normal(0.0, turbulence, (scans, 30))


def test_the_automatic_filter_follows_a_changing_wind() -> None:
    """Fixed limits that are as tight on the calm hour cut the windy one; the automatic filter cuts neither."""
    rng = np.random.default_rng(1)
    clean = windy(600, rng)
    assert filter_outliers(clean).step.lost_share < 1e-4
    calm = clean[:100]
    limits = (float(calm.min()), float(calm.max()))
    assert limit_radial_speed(clean, limits).step.lost_share > 0.1


def test_noise_that_the_eye_would_take_away_is_taken_away() -> None:
    rng = np.random.default_rng(2)
    speed, cnr = windy(600, rng), rng.normal(-12.0, 1.0, (600, 30))
    bad = rng.uniform(size=speed.shape) < 0.01
    speed[bad] = rng.uniform(-30.0, 30.0, int(bad.sum()))
    cnr[bad] = rng.normal(-28.0, 1.0, int(bad.sum()))
    left = filter_outliers(speed, cnr)
    assert not np.any(np.isfinite(left.values[bad]))
    assert np.mean(np.isnan(left.values[~bad])) < 1e-3
    agreed = compare_filters(speed, limit_cnr(speed, cnr, (-25.0, -5.0)).values, left.values)
    assert agreed.kept_by_neither == int(np.sum(bad & (cnr < -25.0)))  # limits let the brightest noise pass
    assert sum(agreed) == speed.size


def test_without_cnr_only_noise_that_differs_from_the_wind_is_found() -> None:
    rng = np.random.default_rng(5)
    speed = windy(600, rng, turbulence=0.3)
    bad = rng.uniform(size=speed.shape) < 0.01
    speed[bad] = rng.uniform(-30.0, 30.0, int(bad.sum()))
    found = np.isnan(filter_outliers(speed).values)
    assert np.mean(found[bad]) > 0.85  # of 60 m/s, what is within 5 std of the wind cannot be told from it
    assert np.mean(found[~bad]) < 1e-3


def test_a_front_does_not_make_outliers_of_good_rays() -> None:
    rng = np.random.default_rng(4)
    speed = rng.normal(0.0, 0.3, (120, 10)) + np.where(np.arange(120) < 55, 4.0, 13.0)[:, None]
    assert filter_outliers(speed, window=Window(scans=20)).step.lost == 0


def test_a_laminar_calm_is_not_cut_by_its_own_quiet() -> None:
    speed = np.full((60, 5), 3.0)
    speed[10, 2] = 3.3  # three standard deviations of a lidar's noise, while the air does not move at all
    assert filter_outliers(speed).step.lost == 0


def test_missing_rays_and_missing_cnr_are_no_obstacle() -> None:
    rng = np.random.default_rng(6)
    speed, cnr = windy(100, rng), np.full((100, 30), np.nan)
    speed[:, 4] = np.nan
    speed[20:40] = np.nan
    assert filter_outliers(speed, cnr).step.lost == 0


@given(st.floats(-20.0, 20.0), st.floats(0.2, 5.0))
@settings(max_examples=20, deadline=None, derandomize=True)
def test_the_filter_does_not_care_for_offset_and_scale(offset: float, scale: float) -> None:
    speed = windy(80, np.random.default_rng(7))
    speed[5, 5] = 40.0
    wanted = np.isnan(filter_outliers(speed, window=Window(least_speed_std_mps=0.0)).values)
    found = np.isnan(filter_outliers(offset + scale * speed, window=Window(least_speed_std_mps=0.0)).values)
    np.testing.assert_array_equal(found, wanted)


@pytest.mark.parametrize(("scans", "shape"), [(2, (5, 3)), (50, (5,))])
def test_a_window_too_short_or_a_wrong_shape_is_refused(scans: int, shape: tuple[int, ...]) -> None:
    with pytest.raises(InputError):
        filter_outliers(np.zeros(shape), window=Window(scans=scans))
