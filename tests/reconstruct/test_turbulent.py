"""The turbulent tier: nested in the linear one, right in the limits, and telling what it cannot know."""

import dataclasses

import numpy as np
import pytest

from geometry.beams import beam_to, unit_vector
from geometry.gates import Probe
from reconstruct.prediction import RANK_SHORT, predict_linear
from reconstruct.rays import Rays
from reconstruct.spectra import Turbulence
from reconstruct.ten_minute import predict_ten_minute, subset_gains
from reconstruct.turbulent import predict_turbulent, scalar_excess_mps, turbulence_covariance, with_ten_minute
from reconstruct.uncertainty import ErrorSources
from reconstruct.wind import WindState

PROBE = Probe(pulse_ns=200, window_ns=256)
SOURCES = ErrorSources(
    radial_speed_mps=0.1, azimuth_deg=0.1, heading_deg=0.1, range_m=5.0, levelling_deg=0.05
)
AIR = Turbulence(0.09, 170.0)


def sector(count=30, step_deg=2.0, back_and_forth=True):
    """A sector scan centred on a target due north."""
    azimuth = step_deg * (np.arange(count) - 0.5 * (count - 1))
    return Rays(
        azimuth_deg=azimuth,
        elevation_deg=np.full(count, 6.0),
        range_m=np.full(count, 1160.0),
        head_m=np.tile(-1160.0 * unit_vector(0.0, 6.0), (count, 1)),
        lidar=np.zeros(count, dtype=np.intp),
        time_s=0.4 * (np.arange(count) + 0.5),
        duration_s=np.full(count, 0.4),
        swept_azimuth_deg=np.full(count, step_deg),
        probes=(PROBE,),
        period_s=0.4 * count,
        back_and_forth=back_and_forth,
    )


def dual(crossing_deg=90.0, height_m=0.0):
    """Two lidars 1 km from the target that stare at it at the same time."""
    angle = np.radians([0.0, crossing_deg])
    head = np.stack([-1000 * np.sin(angle), -1000 * np.cos(angle), np.full(2, -height_m)], axis=1)
    beam = beam_to(-head)
    return Rays(
        azimuth_deg=beam.azimuth_deg,
        elevation_deg=beam.elevation_deg,
        range_m=beam.range_m,
        head_m=head,
        lidar=np.arange(2),
        time_s=np.full(2, 0.25),
        duration_s=np.full(2, 0.5),
        swept_azimuth_deg=np.zeros(2),
        probes=(PROBE, PROBE),
        period_s=1.0,
    )


def test_without_turbulence_the_tier_is_the_linear_one():
    wind = WindState(8.0, 200.0, shear_exponent=0.2, vertical_mps=0.1)
    linear, still = (
        predict_linear(sector(), wind, SOURCES),
        predict_turbulent(sector(), wind, Turbulence(0, 170), SOURCES),
    )
    np.testing.assert_allclose(still.covariance_m2s2, linear.covariance_m2s2, atol=1e-15)
    for name in ("speed_bias_mps", "speed_std_mps", "direction_bias_deg", "direction_std_deg", "condition"):
        assert getattr(still, name) == pytest.approx(getattr(linear, name), abs=1e-12)


def test_turbulence_adds_to_the_covariance_of_the_linear_tier():
    wind = WindState(8.0, 200.0)
    added = predict_turbulent(sector(), wind, AIR, SOURCES).covariance_m2s2
    linear = predict_linear(sector(), wind, SOURCES).covariance_m2s2
    np.testing.assert_allclose(added - linear, turbulence_covariance(sector(), wind, AIR), atol=1e-12)


def test_eddies_much_larger_than_the_scan_are_retrieved_as_the_wind_they_are():
    huge = Turbulence(0.1, 1e9)
    ours = turbulence_covariance(dual(70.0), WindState(10.0, 123.0), huge)
    np.testing.assert_allclose(ours, np.eye(2), atol=1e-3)


def test_elevation_lets_vertical_turbulence_into_the_horizontal_wind():
    """With huge eddies and elevation e at a crossing of 90°, each component gains tan²e of w's variance."""
    rays = dual(90.0, height_m=300.0)
    ours = turbulence_covariance(rays, WindState(10.0, 0.0), Turbulence(0.1, 1e9))
    np.testing.assert_allclose(ours, np.eye(2) + 0.09 * np.ones((2, 2)), atol=1e-3)


def test_eddies_much_smaller_than_the_scan_are_noise():
    """Eddies of 1 m leave each ray white noise, so that the covariance falls like one over the rays."""
    air = Turbulence(0.1, 1.0)
    one = turbulence_covariance(sector(30, 2.0), WindState(10.0, 0.0), air)
    two = turbulence_covariance(sector(60, 1.0), WindState(10.0, 0.0), air)
    # with half the step each ray sweeps half the arc: fewer eddies in each of twice the rays
    assert two[0, 0] == pytest.approx(one[0, 0], rel=0.25)


def test_narrow_sectors_read_too_high_a_speed():
    wind = WindState(8.0, 0.0)
    rays = sector()
    biases = [
        predict_turbulent(
            dataclasses.replace(
                rays,
                **{
                    name: getattr(rays, name)[kept]
                    for name in (
                        "azimuth_deg",
                        "elevation_deg",
                        "range_m",
                        "head_m",
                        "lidar",
                        "time_s",
                        "duration_s",
                        "swept_azimuth_deg",
                    )
                },
            ),
            wind,
            AIR,
        ).speed_bias_mps
        for kept in (slice(0, 30), slice(11, 19), slice(14, 17))
    ]
    assert abs(biases[0]) < 0.03 < 0.5 < biases[1] < 1.0 < biases[2]


def test_scalar_reference_is_higher_by_the_lateral_variance_over_twice_the_speed():
    """physics: .14 m/s at an intensity of .21 and about 6.5 m/s."""
    wind, air = WindState(6.5, 0.0), Turbulence(0.21, 170.0)
    assert scalar_excess_mps(wind, air) == pytest.approx((0.21 * 6.5) ** 2 / 13, rel=0.03)
    scalar, vector = (predict_turbulent(sector(), wind, air, reference=r) for r in ("scalar", "vector"))
    assert vector.speed_bias_mps - scalar.speed_bias_mps == pytest.approx(scalar_excess_mps(wind, air))


def test_parallel_beams_give_none_and_say_why():
    lost = predict_turbulent(dual(0.0), WindState(8.0, 0.0), AIR)
    assert lost.speed_std_mps is None
    assert lost.reasons["speed_std_mps"] == RANK_SHORT
    mean = predict_ten_minute(dual(0.0), WindState(8.0, 0.0), AIR)
    filled = with_ten_minute(lost, mean)
    assert filled.mean10_speed_std_mps is None
    assert filled.reasons["mean10_speed_std_mps"] == RANK_SHORT


def test_ten_minute_fields_are_filled_from_the_means():
    wind = WindState(8.0, 200.0)
    mean = predict_ten_minute(sector(), wind, AIR)
    filled = with_ten_minute(predict_turbulent(sector(), wind, AIR), mean)
    assert filled.mean10_speed_std_mps == float(mean.speed_std_mps)
    assert "mean10_speed_std_mps" not in filled.reasons


def test_subset_of_gains_is_the_prediction_of_the_smaller_scan():
    rays, wind = sector(), WindState(8.0, 200.0)
    kept = slice(10, 20)
    gains = subset_gains(rays, [slice(0, 30), kept])
    together = turbulence_covariance(rays, wind, AIR, gains=gains)
    names = [field.name for field in dataclasses.fields(rays)][:8]
    small = dataclasses.replace(
        rays, **{name: getattr(rays, name)[kept] for name in names}, back_and_forth=False
    )
    one_way = turbulence_covariance(dataclasses.replace(rays, back_and_forth=False), wind, AIR, gains=gains)
    np.testing.assert_allclose(one_way[1], turbulence_covariance(small, wind, AIR), rtol=1e-9)
    assert together.shape == (2, 2, 2)


def test_clocks_that_differ_by_much_more_than_an_eddy_lives_cut_the_ties_between_lidars():
    """Beams that cross at a right angle give one component each, whose variances know no clock."""
    rays, wind = dual(90.0), WindState(10.0, 45.0)
    together = predict_turbulent(rays, wind, AIR, ErrorSources()).covariance_m2s2
    apart = predict_turbulent(rays, wind, AIR, ErrorSources(clock_s=3600.0)).covariance_m2s2
    np.testing.assert_allclose(np.diag(apart), np.diag(together), rtol=1e-6)
    assert abs(apart[0, 1]) <= abs(together[0, 1])


def test_small_clock_difference_changes_the_covariance_by_its_square():
    rays, wind = dual(63.0), WindState(10.0, 45.0)
    plain, small, double = (
        predict_turbulent(rays, wind, AIR, [ErrorSources(), ErrorSources(clock_s=s)]).covariance_m2s2
        for s in (0.0, 2.0, 4.0)
    )
    first, second = np.abs(small - plain).max(), np.abs(double - plain).max()
    assert 0 < first < second < 4.5 * first
