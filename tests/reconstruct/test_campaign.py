"""Campaigns, the errors that stay for one, and stand-ins for the rays of very fine scans."""

import numpy as np
import pytest

from geometry.beams import unit_vector
from geometry.gates import Probe
from reconstruct.campaign import predict_campaign
from reconstruct.climate import listed_climate
from reconstruct.persistence import split_covariance
from reconstruct.rays import Rays
from reconstruct.retrieval import gain, rows
from reconstruct.spectra import Turbulence
from reconstruct.ten_minute import predict_ten_minute, subset_gains
from reconstruct.thinning import thinned
from reconstruct.turbulent import predict_turbulent, turbulence_covariance
from reconstruct.uncertainty import ErrorSources, ray_covariance
from reconstruct.wind import WindState

AIR = Turbulence(0.09, 170.0)
STATES = listed_climate([6.0, 8.0, 11.0], directions_deg=[(160.0, 200.0)], directions=2)
LIKE = WindState(8.0, 0.0)


def sector(count=30, step_deg=2.0, scan_s=12.0):
    """A sector scan to a target due north."""
    azimuth = step_deg * (np.arange(count) - 0.5 * (count - 1))
    return Rays(
        azimuth_deg=azimuth,
        elevation_deg=np.zeros(count),
        range_m=np.full(count, 1000.0),
        head_m=np.tile(-1000.0 * unit_vector(0.0, 0.0), (count, 1)),
        lidar=np.zeros(count, dtype=np.intp),
        time_s=scan_s / count * (np.arange(count) + 0.5),
        duration_s=np.full(count, scan_s / count),
        swept_azimuth_deg=np.full(count, step_deg),
        probes=(Probe(pulse_ns=200, window_ns=256),),
        period_s=scan_s,
        back_and_forth=True,
    )


def test_split_errors_add_up_to_the_covariance_of_the_linear_tier():
    sources = ErrorSources(
        radial_speed_mps=0.1,
        azimuth_deg=0.1,
        azimuth_correlation=0.4,
        heading_deg=0.2,
        levelling_deg=0.1,
        position_m=1.0,
    )
    wind = WindState(8.0, 200.0, shear_exponent=0.2)
    parts = split_covariance(sector(), wind, sources)
    np.testing.assert_allclose(parts.total_m2s2, ray_covariance(sector(), wind, sources), atol=1e-15)


def test_calibration_tilts_the_regression_by_its_own_size():
    shown = predict_campaign(
        sector(), STATES, Turbulence(0.0, 170.0), like=LIKE, sources=ErrorSources(radial_speed_relative=0.01)
    )
    assert float(shown.speed.slope) == pytest.approx(1.0, abs=1e-9)
    assert float(shown.slope_std) == pytest.approx(0.01, rel=1e-6)
    assert float(shown.speed.residual_std_mps) == pytest.approx(0.0, abs=1e-6)


def test_heading_shifts_the_mean_direction_by_its_own_size():
    shown = predict_campaign(
        sector(), STATES, Turbulence(0.0, 170.0), like=LIKE, sources=ErrorSources(heading_deg=0.5)
    )
    assert float(shown.direction_offset_std_deg) == pytest.approx(0.5, rel=1e-3)
    assert float(shown.slope_std) == pytest.approx(0.0, abs=1e-4)


def test_vertical_wind_of_an_elevated_scan_shows_in_the_regression():
    still = Turbulence(0.0, 170.0)
    level = predict_campaign(sector(), STATES, still, like=WindState(8.0, 0.0, vertical_mps=0.5))
    assert float(level.speed.bias_mps) == pytest.approx(0.0, abs=1e-9)


def test_campaign_without_errors_is_the_regression_of_its_means():
    gains = subset_gains(sector(), [slice(0, 30), slice(13, 18)])
    shown = predict_campaign(sector(), STATES, AIR, like=LIKE, gains=gains)
    assert shown.speed.slope.shape == (2,)
    assert shown.speed.slope[1] < shown.speed.slope[0]
    assert np.all(shown.slope_std == 0)
    assert len(shown.means) == STATES.count


@pytest.mark.parametrize("from_deg", [180.0, 200.0, 270.0])
def test_stand_ins_for_600_rays_give_the_covariance_of_600_rays(from_deg):
    rays, wind = sector(600, 0.1), WindState(8.0, from_deg)
    fit = gain(rows(rays.azimuth_deg, rays.elevation_deg))
    few, few_fit = thinned(rays, fit, most=60)
    assert few.count == 60
    thin = turbulence_covariance(few, wind, AIR, gains=few_fit)
    medium, medium_fit = thinned(rays, fit, most=200)
    np.testing.assert_allclose(
        thin, turbulence_covariance(medium, wind, AIR, gains=medium_fit), rtol=0.01, atol=1e-3
    )


def test_a_hundred_thousand_rays_are_predicted():
    rays = sector(100_000, 60 / 100_000)
    whole = predict_turbulent(rays, WindState(8.0, 200.0), AIR)
    coarse = predict_turbulent(sector(60, 1.0), WindState(8.0, 200.0), AIR)
    assert whole.speed_std_mps == pytest.approx(coarse.speed_std_mps, rel=0.03)
    mean = predict_ten_minute(rays, WindState(8.0, 200.0), AIR, random_m2s2=0.01)
    few = predict_ten_minute(sector(60, 1.0), WindState(8.0, 200.0), AIR, random_m2s2=0.01)
    assert float(mean.speed_std_mps) == pytest.approx(float(few.speed_std_mps), rel=0.03)


def test_headings_that_stay_wrong_scatter_the_points_as_misturned_beams_do():
    """Two stares, each off by a heading of its own all campaign: radial speeds of the turned beams, solved with the
    nominal ones, and a line fitted by numpy to the exact winds of every state; root mean square over 4000 campaigns."""
    azimuth = np.array([170.0, 232.0])
    pair = Rays(
        azimuth_deg=azimuth,
        elevation_deg=np.zeros(2),
        range_m=np.full(2, 1000.0),
        head_m=-1000.0 * unit_vector(azimuth, np.zeros(2)),
        lidar=np.arange(2),
        time_s=np.zeros(2),
        duration_s=np.full(2, 0.5),
        swept_azimuth_deg=np.zeros(2),
        probes=(Probe(200, 256),) * 2,
        period_s=0.5,
    )
    states = listed_climate([7.0, 9.0], directions_deg=[(118.0, 270.0)], directions=12)
    shown = predict_campaign(
        pair, states, Turbulence(0.0, 170.0), like=LIKE, sources=ErrorSources(heading_deg=0.2)
    )

    turned = azimuth + np.random.default_rng(3).normal(0.0, 0.2, (4000, 2))
    wind = -states.speed_mps * np.stack(
        [np.sin(np.radians(states.from_deg)), np.cos(np.radians(states.from_deg))]
    )
    nominal = np.stack([np.sin(np.radians(azimuth)), np.cos(np.radians(azimuth))], axis=-1)
    seen = np.stack([np.sin(np.radians(turned)), np.cos(np.radians(turned))], axis=-1) @ wind
    u, v = np.moveaxis(np.linalg.inv(nominal) @ seen, 1, 0)  # (campaign, state)
    speed = np.hypot(u, v)
    slope = np.sum(speed * states.speed_mps, axis=1) / np.sum(speed**2, axis=1)
    left = states.speed_mps - slope[:, None] * speed
    assert float(shown.speed.residual_std_mps) == pytest.approx(
        np.sqrt(np.mean(np.var(left, axis=1))), rel=0.03
    )

    off = states.from_deg - (np.degrees(np.arctan2(-u, -v)) % 360.0)
    lines = [np.polyfit(states.from_deg, each, 1) for each in off]
    about = off - np.stack([np.polyval(line, states.from_deg) for line in lines])
    assert float(shown.direction.residual_std_deg) == pytest.approx(np.sqrt(np.mean(about**2)), rel=0.03)
