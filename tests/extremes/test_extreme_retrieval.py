"""Retrieval at its ends: 0.001 to 360 degrees, 2 to 100,000 rays, beams that hardly cross, calm, nothing left."""

import math

import mpmath
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from reconstruct.multi_doppler import dual_doppler_wind, triple_doppler_wind
from reconstruct.radial_speed import radial_speed_mps
from reconstruct.retrieval import REASONS, cofactor, condition, gain, rows, solve
from reconstruct.sector_scan import sector_wind
from reconstruct.two_beam import two_beam_wind
from reconstruct.wind import from_deg, scalar_mean, speed_mps, uv_mps, vector_mean
from tests.extremes import oracle
from tests.extremes.digits import wind_digits

few = settings(derandomize=True, max_examples=40, deadline=None, database=None)
SHORT = REASONS[3]


@pytest.mark.parametrize("width", [0.001, 0.1, 8.0, 60.0, 360.0])
@pytest.mark.parametrize("count", [2, 3, 30])
def test_a_sector_keeps_fifteen_digits_less_those_of_its_condition(width, count):
    """Against the 50-digit fit of the azimuths in degrees; the condition itself against its closed form."""
    azimuth = 217.3 + width / count * np.arange(count)
    digits, number = wind_digits(azimuth, 3.0)
    if width == 360.0 and count == 2:
        assert digits is None and number == np.inf
        return
    assert digits > 14.5 - math.log10(number)
    exact = oracle.sector_noise(count, width / count)[2]
    assert oracle.digits(number, exact) > 14.3 - math.log10(number)


@pytest.mark.parametrize("width", [0.001, 1.0, 360.0])
def test_a_hundred_thousand_rays(width):
    """Noise along and across by the closed form, in which all rays count; an exact wind comes back."""
    step = width / 100_000
    azimuth = step * (np.arange(100_000) - 49_999.5)
    matrix = rows(azimuth, 5.0)
    along, across, number = oracle.sector_noise(100_000, step, 5.0)
    std = np.sqrt(np.diagonal(cofactor(matrix)))
    np.testing.assert_allclose(std, [float(across), float(along)], rtol=1e-9)
    assert float(condition(matrix)) == pytest.approx(float(number), rel=1e-9)
    fit = solve(matrix, radial_speed_mps(azimuth, 5.0, 3.0, -9.0))
    np.testing.assert_allclose(fit.wind_mps, [3.0, -9.0], atol=2e-14 * float(number) + 1e-12)
    assert int(fit.rays) == 100_000


@pytest.mark.parametrize("angle", [1e-11, 1e-9, 1e-6, 1e-3, 1.0, 90.0, 179.0, 180 - 1e-6, 180 - 1e-9])
@pytest.mark.parametrize("azimuth", [0.0, 33.0])
def test_two_beams_keep_sixteen_digits_less_those_of_their_condition(azimuth, angle):
    """The condition is cot of half the crossing angle, or its inverse."""
    digits, number = wind_digits(np.array([azimuth, azimuth + angle]), 0.0)
    assert digits > 14.5 - math.log10(number)
    with mpmath.workdps(50):
        half = oracle.radians(azimuth + angle) - oracle.radians(azimuth)
        cot = abs(mpmath.cot(half / 2))
        assert oracle.digits(number, max(cot, 1 / cot)) > 14.5 - math.log10(number)


@pytest.mark.parametrize("columns", [2, 3])
@pytest.mark.parametrize(
    ("azimuth", "elevation"),
    [
        ([33.0, 33.0], 2.0),
        ([33.0, 213.0], 0.0),
        ([33.0, 393.0, -327.0], 2.0),
        ([0.0, 1e-13], 0.0),
        ([0.0, 90.0, 180.0, 270.0], 90.0),
        ([0.0, 90.0, 180.0, 270.0], -90.0),
    ],
    ids=["parallel", "opposite", "turns", "1e-13 degrees", "zenith", "nadir"],
)
def test_what_no_ray_sees_is_nan_with_an_infinite_condition(azimuth, elevation, columns):
    """Wind, cofactor, gain and residual are NaN, for any weights, and the reason is the rays."""
    matrix = rows(azimuth, elevation, columns=columns)
    for weights in (None, np.full(len(azimuth), 1e-12), np.full(len(azimuth), 1e12)):
        fit = solve(matrix, np.ones(len(azimuth)), weights=weights)
        assert np.isnan(fit.wind_mps).all() and np.isnan(fit.cofactor).all()
        assert not np.isfinite(fit.condition)
        assert fit.lost == {REASONS[2] if len(azimuth) < columns else SHORT: 1}
        assert np.isnan(gain(matrix, weights)).all()


@pytest.mark.parametrize("elevation", [80.0, 89.0, 89.999, 89.999999])
def test_steep_rays_cost_the_cosine_and_nothing_else(elevation):
    """The condition stays that of the sector, the noise grows by 1/cos φ."""
    azimuth = 2.0 * (np.arange(30) - 14.5)
    along, across, number = oracle.sector_noise(30, 2.0, elevation)
    matrix = rows(azimuth, elevation)
    std = np.sqrt(np.diagonal(cofactor(matrix)))
    steep = 1e-15 / math.cos(math.radians(elevation))
    np.testing.assert_allclose(std, [float(across), float(along)], rtol=1e-14 + steep)
    assert float(condition(matrix)) == pytest.approx(float(number), rel=1e-12)


@few
@given(st.integers(1, 50), st.integers(1, 50), st.floats(1e-3, 180 - 1e-3))
def test_repeated_azimuths_are_two_rays_with_their_weights(first, second, angle):
    """m rays at one azimuth and n at another: the fit of two rays with the means, exactly seen."""
    azimuth = np.repeat([10.0, 10.0 + angle], [first, second])
    speed = np.concatenate([np.linspace(1, 2, first), np.linspace(-1, 3, second)])
    want = solve(rows([10.0, 10.0 + angle], 4.0), [speed[:first].mean(), speed[first:].mean()])
    got = solve(rows(azimuth, 4.0), speed)
    np.testing.assert_allclose(got.wind_mps, want.wind_mps, atol=2e-14 * float(want.condition))


def test_calm_wind_is_zero_speed_from_nowhere():
    """No radial speed at all: exactly no wind, no direction, no residual, and a finite condition."""
    fit = sector_wind(np.arange(0.0, 60.0, 2.0), 5.0, np.zeros(30))
    assert fit.wind_mps.tolist() == [0.0, 0.0] and float(fit.residual_std_mps) == 0.0
    assert float(speed_mps(*fit.wind_mps)) == 0.0 and np.isnan(from_deg(*fit.wind_mps))
    assert np.isfinite(fit.condition)


@pytest.mark.parametrize("width", [0.001, 2.0, 60.0])
def test_wind_across_the_beam_comes_back_though_the_middle_ray_sees_none(width):
    """10 m/s from the west on a sector to the north: what is seen is the sine of half the sector."""
    azimuth = np.linspace(-width / 2, width / 2, 31)
    speed = [float(10 * mpmath.sin(oracle.radians(a))) for a in azimuth]
    fit = solve(rows(azimuth, 0.0), speed)
    assert speed[15] == 0.0
    np.testing.assert_allclose(fit.wind_mps, [10.0, 0.0], atol=1e-14 * float(fit.condition))


def test_all_filtered_and_nan_scans_count_their_losses():
    """Of six scans only the complete one gives a wind; every other says why, and none writes to another."""
    azimuth, nan = np.array([0.0, 40.0, 80.0, 80.0]), np.nan
    speed = np.array(
        [
            [1.0, 2.0, 3.0, 3.0],
            [nan, nan, nan, nan],
            [1.0, nan, nan, nan],
            [nan, nan, 3.0, 3.0],
            [np.inf, -np.inf, nan, 3.0],
            [1.0, 2.0, nan, nan],
        ]
    )
    fit = solve(rows(azimuth, 3.0), speed)
    assert np.isfinite(fit.wind_mps).all(axis=-1).tolist() == [True, False, False, False, False, True]
    assert fit.lost == {REASONS[1]: 1, REASONS[2]: 2, SHORT: 1}
    assert np.isnan(fit.residual_std_mps[5]) and fit.rays.tolist() == [4, 0, 1, 2, 1, 2]
    empty = solve(rows(azimuth, 3.0), np.full((3, 4), nan), weights=np.ones(4))
    assert empty.lost == {REASONS[1]: 3} and np.isnan(empty.wind_mps).all()


def test_means_of_nothing_are_nothing():
    """All-NaN means are NaN, without a warning; the direction of a wind that cancels is NaN."""
    nan = np.full((2, 3), np.nan)
    assert np.isnan(scalar_mean(nan, nan)).all() and np.isnan(vector_mean(nan, nan)).all()
    assert np.isnan(from_deg(*vector_mean([5.0, -5.0], [0.0, 0.0])))


def test_float32_angles_are_widened_before_their_sines():
    """Half degrees are exact in float32: the rows, the winds and dual Doppler are those of float64."""
    azimuth = np.arange(200.5, 260.0, 1.5)
    np.testing.assert_array_equal(rows(azimuth.astype(np.float32), np.float32(5.5)), rows(azimuth, 5.5))
    np.testing.assert_array_equal(uv_mps(10.0, np.float32([217.5])), uv_mps(10.0, [217.5]))
    narrow = dual_doppler_wind(np.float32([0.5, 90.5]), np.float32([5.5, 3.5]), [3.0, 4.0], vertical_mps=1.0)
    wide = dual_doppler_wind([0.5, 90.5], [5.5, 3.5], [3.0, 4.0], vertical_mps=1.0)
    np.testing.assert_array_equal(narrow.wind_mps, wide.wind_mps)


@pytest.mark.parametrize("size", [1e-300, 1e-150, 1.0, 1e150])
def test_the_unit_of_speed_does_not_matter(size):
    """Winds of any magnitude are retrieved alike."""
    azimuth = np.array([0.0, 20.0, 40.0])
    fit = solve(rows(azimuth, 0.0), size * radial_speed_mps(azimuth, 0.0, 3.0, -4.0))
    np.testing.assert_allclose(fit.wind_mps, [3 * size, -4 * size], rtol=1e-13)


@pytest.mark.parametrize("half", [1e-9, 1e-3, 30.0, 89.999, 90 - 1e-9])
def test_two_beams_of_a_nacelle_lidar_at_any_half_angle(half):
    """WindEye's equations with 50 digits: V1 = 3 and V2 = -4 m/s toward the lidar."""
    got = two_beam_wind(-3.0, 4.0, half_angle_deg=half)
    with mpmath.workdps(50):
        a = oracle.radians(half)
        across, along = 7 / (2 * mpmath.sin(a)), -1 / (2 * mpmath.cos(a))
    assert oracle.digits(got.across_mps, across) > 13 - abs(math.log10(math.tan(math.radians(half))))
    assert oracle.digits(got.along_mps, along) > 13 - abs(math.log10(math.tan(math.radians(half))))


def test_triple_doppler_with_a_third_beam_in_the_plane_of_the_others_knows_nothing():
    """Three level beams see no vertical wind: NaN; a third beam raised by 1e-6 degrees sees it with its condition."""
    level = triple_doppler_wind([0.0, 60.0, 120.0], 0.0, [1.0, 2.0, 3.0])
    assert np.isnan(level.wind_mps).all() and level.lost == {SHORT: 1}
    raised = rows([0.0, 60.0, 120.0], [0.0, 0.0, 1e-6], columns=3)
    fit = solve(raised, raised @ [3.0, -9.0, 0.5])
    number = float(fit.condition)
    assert number == pytest.approx(np.linalg.cond(raised), rel=1e-6) and number > 1e7
    np.testing.assert_allclose(fit.wind_mps, [3.0, -9.0, 0.5], atol=1e-14 * number)
