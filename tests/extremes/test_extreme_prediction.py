"""Predicted errors at their ends: against closed forms, analytic limits and 50-digit integrals."""

import math
import re
import tracemalloc
from dataclasses import replace
from pathlib import Path

import mpmath
import numpy as np
import pytest

from geometry.beams import point_at
from geometry.errors import InputError
from reconstruct.correlation import correlation
from reconstruct.covariance import lag_covariance, point_covariance
from reconstruct.joint import expand
from reconstruct.lidar_map import pair_map
from reconstruct.moments import wind_moments
from reconstruct.prediction import BELOW_GROUND, CALM, DROWNED, RANK_SHORT, predict_linear, predict_noise
from reconstruct.retrieval import gain, rows
from reconstruct.spectra import Turbulence
from reconstruct.ten_minute import predict_ten_minute
from reconstruct.turbulent import predict_turbulent, turbulence_covariance
from reconstruct.uncertainty import ErrorSources, budget
from reconstruct.wind import WindState
from tests.extremes import oracle
from tests.extremes.digits import (
    PROBE,
    across_mean,
    markdown,
    noise_digits,
    ray_set,
    rice_mean,
    stare,
    table,
)

WIND = WindState(speed_mps=10.0, from_deg=30.0, shear_exponent=0.14, height_m=100.0)
AIR = Turbulence(intensity=0.09, length_m=170.0)
ERRORS = ErrorSources(
    radial_speed_mps=0.1, azimuth_deg=0.05, elevation_deg=0.05, range_m=5.0, heading_deg=0.05
)
FIELDS = ("speed_bias_mps", "speed_std_mps", "direction_bias_deg", "direction_std_deg")
DOCUMENT = Path(__file__).parents[2] / "docs" / "digits.md"


def across_turn(std_mps):
    """Root mean square angle [rad] of 10 m/s with an error across it alone."""
    with mpmath.workdps(20):
        ratio = mpmath.mpf(std_mps) / 10
        cuts = sorted({0, 1, 12} | {float(n / ratio) for n in (1, 10, 100) if ratio > n})
        square = mpmath.quad(lambda x: mpmath.npdf(x) * mpmath.atan(x * ratio) ** 2, cuts)
        return mpmath.sqrt(2 * square)


def every_tier(rays, wind, air=AIR):
    """Predictions of the three closed tiers."""
    return (
        predict_noise(rays, wind, 0.1),
        predict_linear(rays, wind, ERRORS),
        predict_turbulent(rays, wind, air, ERRORS),
    )


@pytest.mark.parametrize("width", [0.001, 8.0, 60.0, 360.0])
@pytest.mark.parametrize("count", [2, 3, 30, 100_000])
def test_noise_is_its_closed_form(width, count):
    """Along and across, to ten digits, from two rays to a hundred thousand; the condition is carried."""
    if width == 360.0 and count == 2:
        return
    digits, number = noise_digits(width, count)
    assert digits > 10
    assert oracle.digits(number, oracle.sector_noise(count, width / count)[2]) > 10


@pytest.mark.parametrize(
    ("width", "count", "elevation"),
    [(360.0, 2, 0.0), (0.0, 5, 3.0), (60.0, 30, 90.0)],
    ids=["opposite", "one azimuth", "zenith"],
)
def test_what_the_rays_cannot_tell_is_none_with_its_reason(width, count, elevation):
    """Every tier: an infinite condition, None in every field, the reason of the rays."""
    for got in every_tier(ray_set(width, count, elevation_deg=elevation, range_m=90.0), WIND):
        assert got.condition == np.inf
        for name in FIELDS:
            assert getattr(got, name) is None and got.reasons[name] == RANK_SHORT


def test_calm_has_a_speed_error_but_no_direction():
    """Without wind the error of the vector is the speed: the mean length of the noise, elliptic integral and all."""
    for got in every_tier(ray_set(60.0, 30), WindState(0.0, 30.0)):
        along, across, _ = oracle.sector_noise(30, 2.0)
        # E|x| of two independent normals: sqrt(2/pi) s_max E(1 - (s_min/s_max)^2)
        with mpmath.workdps(30):
            mean = mpmath.sqrt(2 / mpmath.pi) * across / 10 * mpmath.ellipe(1 - (along / across) ** 2)
        assert got.speed_bias_mps == pytest.approx(float(mean), rel=1e-9)
        assert got.direction_bias_deg is None and got.reasons["direction_std_deg"] == CALM
    assert budget({"noise": np.eye(2)}, WindState(0.0, 30.0))[0].direction_std_deg is None


def test_a_wind_far_below_the_error_has_no_mean_direction():
    """Under 1e-12 of the error the mean direction is rounding: None, where it was a number before; above it is known."""
    scene = ray_set(60.0, 30)
    drowned = predict_noise(scene, WindState(1e-16, 30.0), 0.1)
    assert drowned.direction_bias_deg is None and drowned.reasons["direction_std_deg"] == DROWNED
    assert drowned.speed_bias_mps is not None
    slow, slower = (predict_noise(scene, WindState(v, 30.0), 0.1).direction_bias_deg for v in (1e-5, 1e-9))
    assert slow == pytest.approx(slower, abs=1e-3)


def test_a_gate_below_ground_is_said_to_be_so():
    """The power law has no wind there: None, with that reason; without shear there is no ground."""
    low = ray_set(60.0, 30, elevation_deg=-20.0)
    head = low.head_m - [0.0, 0.0, 200.0]
    deep = replace(low, head_m=head)
    got = predict_linear(deep, WIND, ERRORS)
    assert got.speed_std_mps is None and got.reasons["speed_std_mps"] == BELOW_GROUND
    assert np.isfinite(got.condition)
    assert predict_linear(deep, WindState(10.0, 30.0), ERRORS).speed_std_mps is not None


@pytest.mark.parametrize("name", ["azimuth_deg", "elevation_deg", "range_m", "head_m", "time_s"])
def test_rays_that_are_not_there_are_refused(name):
    """A NaN in a ray, or no ray at all, is an input error, not a prediction."""
    rays = ray_set(60.0, 30)
    values = getattr(rays, name).copy()
    values[0] = np.nan
    with pytest.raises(InputError, match=name):
        replace(rays, **{name: values})
    with pytest.raises(InputError, match="without any ray"):
        replace(rays, **_nothing())


def _nothing():
    fields = ("azimuth_deg", "elevation_deg", "range_m", "time_s", "duration_s", "swept_azimuth_deg", "lidar")
    return {**{name: np.zeros(0, dtype=int) for name in fields}, "head_m": np.zeros((0, 3))}


def test_wind_along_and_across_a_sector_of_a_thousandth_of_a_degree():
    """An error of kilometres a second across: speed and direction by their one-dimensional integrals."""
    _, across, _ = oracle.sector_noise(30, 0.001 / 30)
    std = float(across) / 10
    got = predict_noise(ray_set(0.001, 30), WindState(10.0, 0.0), 0.1)
    assert got.speed_bias_mps == pytest.approx(float(across_mean(10.0, std)) - 10.0, rel=1e-4)
    assert got.direction_std_deg == pytest.approx(float(mpmath.degrees(across_turn(std))), rel=1e-4)
    beside = predict_noise(ray_set(0.001, 30), WindState(10.0, 270.0), 0.1)
    # across: the sign alone is left, 10 m/s being nothing: half of the directions are wrong by 180 degrees
    with mpmath.workdps(30):
        wrong = mpmath.ncdf(-10 / mpmath.mpf(std))
    assert beside.direction_std_deg == pytest.approx(180 * math.sqrt(float(wrong)), rel=1e-3)


@pytest.mark.parametrize("std", [1e-3, 1.0, 100.0, 2e4])
def test_mean_speed_of_an_error_across_alone(std):
    """sqrt(2) σ U(-1/2, 0, V²/2σ²), with bias to five digits; direction: mean square of an arctangent."""
    got = wind_moments([0.0, -10.0], np.diag([std**2, 0.0]))
    exact = across_mean(10.0, std)
    assert oracle.digits(got.speed_bias_mps, exact - 10) > 4.5
    assert oracle.digits(np.radians(got.direction_std_deg), across_turn(std)) > 4.5


@pytest.mark.parametrize("axis", [0.0, 30.0, 90.0])
def test_an_error_flatter_than_a_hundred_thousandth_keeps_its_short_side(axis):
    """1.3 m/s along the wind and 1e-4 across it: the direction spreads by 1e-5 rad, not by a floor of the method."""
    turn = np.array([[math.sin(math.radians(axis)), math.cos(math.radians(axis))]])
    side = np.array([[turn[0, 1], -turn[0, 0]]])
    got = wind_moments(10 * turn[0], 1.69 * turn.T @ turn + 1e-8 * side.T @ side)
    with mpmath.workdps(20):
        inverse = mpmath.quad(lambda x: mpmath.npdf(x) / (10 + 1.3 * x) ** 2, [-7, -4, 0, 4, 9])
    assert float(got.direction_std_deg) == pytest.approx(math.degrees(1e-4 * math.sqrt(inverse)), rel=1e-3)


@pytest.mark.parametrize("length_m", [1.0, 170.0, 1e4])
def test_intensity_nothing_is_the_linear_tier_to_the_last_digit(length_m):
    """No turbulence of any length adds nothing."""
    rays = ray_set(60.0, 30, elevation_deg=5.0)
    still = predict_turbulent(rays, WIND, Turbulence(0.0, length_m), ERRORS)
    linear = predict_linear(rays, WIND, ERRORS)
    np.testing.assert_array_equal(still.covariance_m2s2, linear.covariance_m2s2)
    assert [getattr(still, name) for name in FIELDS] == [getattr(linear, name) for name in FIELDS]
    mean = predict_ten_minute(rays, WIND, Turbulence(0.0, length_m))
    assert float(mean.speed_std_mps) == 0.0 and float(mean.reference_variance_m2s2) == 0.0


def test_intensity_one_with_very_large_eddies_is_a_uniform_gust():
    """Eddies of 10,000 km: the scan retrieves the wind there is, and |V| has the mean and spread of Rice."""
    rays = ray_set(60.0, 30)
    got = predict_turbulent(rays, WindState(10.0, 30.0), Turbulence(1.0, 1e7))
    np.testing.assert_allclose(got.covariance_m2s2, 100 * np.eye(2), rtol=2e-3, atol=0.2)
    own = expand(np.array([10.0, 0.0]), 100 * np.eye(2))
    exact = rice_mean(10.0, 10.0)
    assert oracle.digits(float(own.mean_mps), exact) > 12
    # a cup has the same gusts; against the mean vector their excess is the bias
    assert got.speed_bias_mps == pytest.approx(0.0, abs=0.01)
    vector = predict_turbulent(rays, WindState(10.0, 30.0), Turbulence(1.0, 1e7), reference="vector")
    assert vector.speed_bias_mps == pytest.approx(float(exact) - 10.0, rel=2e-3)


@pytest.mark.parametrize("length_m", [1.0, 170.0, 1e4])
def test_correlation_against_fifty_digits(length_m):
    """f and g from a millionth of the length to 30 lengths, to the table's 4e-6."""
    tensor = correlation(Turbulence(0.1, length_m))
    for ratio in (1e-6, 1e-3, 0.1, 1.0, 5.0, 30.0):
        apart = np.array([ratio * length_m, 0.0, 0.0])
        for axis, exact in zip(
            np.eye(3)[:2], oracle.karman(ratio * length_m, oracle.eddy_length(length_m)), strict=True
        ):
            assert float(tensor(apart, axis, axis)) == pytest.approx(float(exact), abs=4e-6)


@pytest.mark.parametrize(("length_m", "share"), [(1.0, 0.02), (170.0, 2e-4), (1e4, 2e-5)])
def test_variance_of_a_resting_ray_is_the_integral_over_its_probe(length_m, share):
    """A probe of 43 m in eddies of 1 m (where it leaves 3 %) to 10 km."""
    got, exact = stare(length_m)
    assert got == pytest.approx(float(exact), rel=share)


def patch_variance(length_m, arc_m):
    """Share of the variance that a ray leaves which sweeps an arc: polar integral over the offsets of two places."""
    from scipy.special import kv

    eddy = float(oracle.eddy_length(length_m))
    offset = np.linspace(-150.0, 150.0, 6001)
    weight = PROBE.weight(offset)
    overlap = np.convolve(weight, weight, mode="same") * (offset[1] - offset[0])
    angle, angle_weight = (a * np.pi / 4 for a in np.polynomial.legendre.leggauss(120))
    angle = angle + np.pi / 4
    node, share = np.polynomial.legendre.leggauss(300)
    end = min(36 * eddy, math.hypot(arc_m, 150.0))
    r, r_weight = end * ((node + 1) / 2) ** 3, end * 1.5 * share * ((node + 1) / 2) ** 2
    x = r / eddy
    c = 2 ** (2 / 3) / math.gamma(1 / 3)
    f, excess = c * x ** (1 / 3) * kv(1 / 3, x), c / 2 * x ** (4 / 3) * kv(2 / 3, x)
    along, side = np.outer(np.cos(angle), r), np.outer(np.sin(angle), r)
    density = np.interp(along, offset, overlap, right=0.0) * np.clip(1 - side / arc_m, 0.0, None) / arc_m
    tensor = f - excess + excess * np.cos(angle)[:, None] ** 2
    return float(4 * angle_weight @ (tensor * density) @ (r_weight * r))


@pytest.mark.parametrize(
    ("length_m", "range_m", "share"),
    [
        (10.0, 1000.0, 0.01),
        (170.0, 1000.0, 1e-3),
        (1e4, 1000.0, 1e-4),
        (170.0, 1e5, 0.01),
        (1e4, 1e5, 1e-3),
        (1.0, 1000.0, 0.01),
        (1.0, 1e5, 0.01),
        (10.0, 1e5, 0.01),
    ],
)
def test_variance_of_a_sweeping_ray_is_the_integral_over_its_patch(length_m, range_m, share):
    """Two degrees a ray, 35 m at 1 km and 3.5 km at 100 km, in eddies of 1 m to 10 km: where the eddies are small
    against it the patch leaves as little as its size says, a hundred-thousandth at 1 m and 100 km.
    """
    slow = WindState(1e-6, 0.0)
    got = (
        lag_covariance(ray_set(60.0, 30, range_m=range_m), slow, Turbulence(1.0, length_m))[0, 0, 0, 0]
        / 1e-12
    )
    assert got == pytest.approx(patch_variance(length_m, math.radians(2.0) * range_m), rel=share)


@pytest.mark.parametrize("back_and_forth", [False, True])
@pytest.mark.parametrize(
    ("length_m", "range_m"),
    [(1.0, 1000.0), (10.0, 1000.0), (30.0, 1e4), (170.0, 1e4), (1.0, 1e5), (10.0, 1e5)],
)
def test_a_patch_that_is_swept_again_at_once_is_the_same_patch(length_m, range_m, back_and_forth):
    """In air that hardly moves the next scan sees in each ray what this one saw, from two lengths a sweep to 3500."""
    rays = replace(ray_set(60.0, 30, range_m=range_m), back_and_forth=back_and_forth)
    again = lag_covariance(rays, WindState(1e-6, 0.0), Turbulence(1.0, length_m), [1])[0, 0] / 1e-12
    want = patch_variance(length_m, math.radians(2.0) * range_m)
    np.testing.assert_allclose(np.diagonal(again), want, rtol=0.02)


@pytest.mark.parametrize(("length_m", "range_m"), [(1.0, 1e5), (10.0, 1e5), (10.0, 1e4)])
def test_ten_minutes_of_eddies_smaller_than_a_sweep_are_as_many_scans_of_noise(length_m, range_m):
    """Along the axis no air is seen twice: the variance is that of one scan over their number, and above 0. Back and
    forth the rays at the turn see theirs twice, which adds some.
    """
    rays, wind, air = ray_set(60.0, 30, range_m=range_m), WindState(10.0, 0.0), Turbulence(0.01, length_m)
    fit = gain(rows(rays.azimuth_deg, rays.elevation_deg))
    one = patch_variance(length_m, math.radians(2.0) * range_m) * 0.01 * (fit @ fit.T)[1, 1]
    once = float(predict_ten_minute(rays, wind, air).lidar_variance_m2s2)
    assert once == pytest.approx(one / 48, rel=0.05)
    twice = predict_ten_minute(replace(rays, back_and_forth=True), wind, air).lidar_variance_m2s2
    assert once < float(twice) < 1.3 * once


def test_eddies_of_one_metre_are_noise():
    """Rays that share no eddy: P = G diag(variance of a ray) Gᵀ."""
    rays = ray_set(60.0, 30)
    wind = WindState(10.0, 0.0)
    each = np.diagonal(lag_covariance(rays, wind, Turbulence(0.1, 1.0))[0, 0])
    fit = gain(rows(rays.azimuth_deg, rays.elevation_deg))
    np.testing.assert_allclose(
        turbulence_covariance(rays, wind, Turbulence(0.1, 1.0)), fit * each @ fit.T, rtol=0.02, atol=1e-6
    )


@pytest.mark.parametrize("length_m", [1.0, 1e4])
def test_ten_minute_variance_at_the_target_has_its_limits(length_m):
    """Small eddies: 2 L/(V T) of the variance along the wind, half of it across; large ones: all of it, nearly."""
    wind, air = (
        WindState(10.0, 0.0),
        Turbulence(0.01, length_m),
    )  # at .1 the bend of |V| takes 1 % of its variance
    mean = predict_ten_minute(ray_set(60.0, 30), wind, air)
    speed = float(mean.reference_variance_m2s2) / 0.01
    across = math.radians(mean.reference_direction_std_deg) * 100.0
    if length_m == 1.0:
        assert speed == pytest.approx(2 * 1.0 / 6000.0, rel=0.01)
        assert across**2 == pytest.approx(1.0 / 6000.0, rel=0.015)
        return
    node, weight = np.polynomial.legendre.leggauss(40)
    lag = 300.0 * (node + 1)
    averaged = 2 / 600.0 * 300.0 * weight * (1 - lag / 600.0)
    want = [
        averaged @ [float(oracle.karman(10 * t, oracle.eddy_length(1e4))[k]) for t in lag] for k in (0, 1)
    ]
    # the correlation bends like r^(2/3) at 0, which costs the rule a permille
    assert speed == pytest.approx(want[0], rel=5e-3)
    assert across**2 == pytest.approx(want[1], rel=5e-3)


@pytest.mark.parametrize("speed", [0.0, 1e-3])
def test_ten_minutes_of_calm_have_a_speed_error_and_no_direction(speed):
    """The mean length of the noise is the bias; without wind the direction is NaN."""
    mean = predict_ten_minute(ray_set(60.0, 30), WindState(speed, 30.0), AIR, random_m2s2=0.01)
    along, across, _ = oracle.sector_noise(30, 2.0)
    if speed == 0.0:
        with mpmath.workdps(30):
            length = mpmath.sqrt(2 / mpmath.pi) * across / 10 * mpmath.ellipe(1 - (along / across) ** 2)
        assert float(mean.speed_bias_mps) == pytest.approx(float(length), rel=1e-6)
        assert np.isnan(mean.direction_std_deg) and np.isnan(mean.reference_direction_std_deg)
    assert np.isfinite(mean.speed_std_mps)
    assert np.isfinite(point_covariance(WindState(speed, 30.0), AIR, [0.0, 600.0])).all()


def test_a_hundred_thousand_rays_are_predicted_in_megabytes():
    """Every tier and the ten-minute mean: no matrix of all rays, and the same answer as of 1000 rays."""
    fine, coarse = ray_set(60.0, 100_000, elevation_deg=5.0), ray_set(60.0, 1000, elevation_deg=5.0)
    tracemalloc.start()
    got = predict_turbulent(fine, WIND, AIR, replace(ERRORS, azimuth_correlation=0.5))
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 400e6  # a matrix of 100,000 x 100,000 would be 80 GB
    mean = predict_ten_minute(fine, WIND, AIR, random_m2s2=0.01)
    few = predict_turbulent(coarse, WIND, AIR, replace(ERRORS, azimuth_correlation=0.5))
    assert got.speed_std_mps == pytest.approx(few.speed_std_mps, rel=0.01)
    assert got.direction_std_deg == pytest.approx(few.direction_std_deg, rel=0.01)
    assert np.isfinite(mean.speed_std_mps) and got.condition == pytest.approx(few.condition, rel=1e-3)


@pytest.mark.parametrize("range_m", [1.0, 1e5])
def test_pointing_errors_of_one_metre_and_a_hundred_kilometres(range_m):
    """Level rays in a uniform wind across the axis: an azimuth error acts as the wind's own share, at any range."""
    rays = ray_set(60.0, 30, range_m=range_m)
    got = predict_linear(rays, WindState(10.0, 270.0), ErrorSources(azimuth_deg=0.1))
    azimuth = np.radians(rays.azimuth_deg)
    fit = np.linalg.pinv(np.stack([np.sin(azimuth), np.cos(azimuth)], axis=-1))
    each = math.radians(0.1) * 10.0 * np.cos(azimuth)
    np.testing.assert_allclose(got.covariance_m2s2, (fit * each**2) @ fit.T, rtol=1e-9, atol=1e-18)


@pytest.mark.parametrize(("size", "origin"), [(1.0, 0.0), (1e5, 0.0), (1000.0, 1e7)])
def test_maps_know_no_scale(size, origin):
    """Noise alone: the same error from 1 m to 100 km and at coordinates of 1e7 m, by Cramer's rule."""
    heads = np.array([[0.0, 0.0, 0.0], [size, size, 0.0]]) + origin * np.array([1.0, 1.0, 0.0])
    wind, noise = WindState(10.0, 0.0), ErrorSources(radial_speed_mps=0.1)
    got = pair_map(heads, origin + 0.5 * size, origin - 0.5 * size, 0.0, wind, noise)
    a, b = np.radians([135.0, math.degrees(math.atan2(-0.5, -1.5)) % 360])
    want = 0.1 * math.hypot(math.sin(a), math.sin(b)) / abs(math.sin(b - a))
    assert float(got.speed_std_mps) == pytest.approx(want, rel=1e-12)


@pytest.mark.parametrize(
    "target",
    [(500.0, 0.0, 0.0), (3000.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 100.0), (np.nan, 1.0, 1.0)],
    ids=["baseline", "beyond it", "at a head", "above a head", "missing"],
)
def test_maps_know_nothing_on_the_baseline_and_above_a_lidar(target):
    """NaN with an infinite condition; the neighbours on the map keep their numbers."""
    heads = [[0.0, 0.0, 0.0], [1000.0, 0.0, 0.0]]
    wind = WindState(10.0, 0.0, height_m=100.0)
    east, north, up = np.transpose([target, (500.0, 500.0, 0.0)])
    got = pair_map(heads, east, north, up, wind, ERRORS, ground_m=-1.0)
    assert (
        np.isnan(got.speed_std_mps[0]) and np.isnan(got.direction_std_deg[0]) and got.condition[0] == np.inf
    )
    alone = pair_map(heads, 500.0, 500.0, 0.0, wind, ERRORS, ground_m=-1.0)
    for all_of_it, one in zip(got, alone, strict=True):
        assert all_of_it[1] == pytest.approx(float(one), rel=1e-12)


def test_the_table_in_the_documents_is_what_is_measured():
    """Every row of docs/digits.md is made by the script, to within a digit and a half."""
    fresh = {line.rsplit(" | ", 2)[0]: line for line in markdown(table()).splitlines()[2:]}
    written = [
        line
        for line in DOCUMENT.read_text(encoding="utf-8").splitlines()
        if re.match(r"\| .* \| (\d+|NaN) \|", line)
    ]
    assert {line.rsplit(" | ", 2)[0] for line in written} == set(fresh)
    for line in written:
        key, value, _ = line.rsplit(" | ", 2)
        now = fresh[key].rsplit(" | ", 2)[1]
        assert (value == now) if "NaN" in (value, now) else abs(int(value) - int(now)) <= 1.5, line


def test_targets_stand_where_the_rays_look():
    """The scene of these tests: the middle of an odd sector measures at the target itself."""
    np.testing.assert_allclose(ray_set(60.0, 3, elevation_deg=5.0).centre_m[1], 0.0, atol=1e-12)
    assert np.linalg.norm(point_at(0.0, 5.0, 1000.0)) == pytest.approx(1000.0)
