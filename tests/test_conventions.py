"""Each numbered sentence of docs/conventions.md, executed: `test_07_...` is sentence 7."""

import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pyproj import Geod, Transformer

from geometry.angles import Sector, SectorSet
from geometry.beams import beam_to, unit_vector
from geometry.frames import SiteFrame
from geometry.gates import Gates, Probe
from geometry.head import HeadLimits, Mounting
from geometry.scan import subset_rays
from geometry.scans import sector
from planner.plan import Plan
from planner.site import Site
from reconstruct.climate import Climate
from reconstruct.prediction import predict_noise
from reconstruct.radial_speed import radial_speed_mps
from reconstruct.rays import Rays
from reconstruct.regression import regress_speed
from reconstruct.spectra import Turbulence
from reconstruct.ten_minute import predict_ten_minute
from reconstruct.wind import WindState, from_deg, scalar_mean, uv_mps, vector_mean

ROOT = Path(__file__).resolve().parents[1]
HEAD = HeadLimits(50, 50, 100, 100)
HOVSORE = SiteFrame("EPSG:32632")
WHITTLE, MAST = (448937.717, 6256404.894, 5.409), (447647.39, 6255435.76, 4.836)  # Simon (2015)


def degrees_of(crs: str, *positions: tuple[float, float, float]) -> list[tuple[float, float]]:
    to_degrees = Transformer.from_crs(crs, "EPSG:4326", always_xy=True)
    return [to_degrees.transform(*position[:2]) for position in positions]


def plan_of(**changes: Any) -> Plan:
    """One lidar that stares 1 km to the north, near Høvsøre."""
    lidar = {"name": "A", "position": [447000, 6256000, 10], "instrument": "windscanner-200s"}
    site = {
        **{"name": "Moor", "crs": "EPSG:32632", "ground_height_m": 10},
        **{"lidars": [{**lidar, **changes.pop("lidar", {})}]},
        **{"targets": [{"name": "T", "position": [447000, 6257000, 110]}]},
    }
    return Plan(Site.model_validate({**site, **changes}))


def narrow_scan(count: int = 8) -> Rays:
    """Half of 16 degrees about north, from 1 km away."""
    azimuth = np.linspace(-7.0, 7.0, count)
    return Rays(
        azimuth_deg=azimuth,
        elevation_deg=np.zeros(count),
        range_m=np.full(count, 1000.0),
        head_m=np.tile([0.0, -1000.0, 0.0], (count, 1)),
        lidar=np.zeros(count, dtype=int),
        time_s=0.4 * np.arange(count) + 0.2,
        duration_s=np.full(count, 0.4),
        swept_azimuth_deg=np.full(count, 2.0),
        probes=(Probe(pulse_ns=200, window_ns=256),),
        period_s=0.4 * count,
        back_and_forth=True,
    )


def test_01_positions_are_easting_northing_height_above_sea_level_unless_said() -> None:
    """Heights count from the sea: an undulation lifts them to the ellipsoid; ellipsoidal ones stay."""
    assert Site(name="Moor", crs="EPSG:32632").height_datum == "above_sea_level"
    longitude, latitude, height = SiteFrame("EPSG:32632", geoid_undulation_m=40.0).geographic(MAST)
    (expected,) = degrees_of("EPSG:32632", MAST)
    assert (float(longitude), float(latitude)) == pytest.approx(expected)
    assert float(height) == pytest.approx(44.836)
    declared = SiteFrame("EPSG:32632", height_datum="ellipsoidal", geoid_undulation_m=40.0)
    assert float(declared.geographic(MAST)[2]) == pytest.approx(4.836)


def test_02_a_local_frame_is_east_true_north_up_from_its_origin() -> None:
    """From WS_W the geodesic to the mast leaves at 232.400°."""
    (azimuth_deg, _, distance_m) = Geod(ellps="WGS84").inv(
        *(number for place in degrees_of("EPSG:32632", WHITTLE, MAST) for number in place)
    )
    assert azimuth_deg % 360 == pytest.approx(232.400, abs=0.0005)
    east, north, up = HOVSORE.enu_m(WHITTLE, MAST)
    assert east == pytest.approx(distance_m * math.sin(math.radians(azimuth_deg)), abs=0.01)
    assert north == pytest.approx(distance_m * math.cos(math.radians(azimuth_deg)), abs=0.01)
    assert up == pytest.approx(4.836 - 5.409 - distance_m**2 / 2 / 6.37e6, abs=0.01)
    assert np.allclose(HOVSORE.enu_m(WHITTLE, WHITTLE), 0.0, atol=1e-6)


def test_03_true_azimuth_is_grid_azimuth_plus_convergence() -> None:
    """233.091° on the map and 232.400° on the Earth at Høvsøre; east of the meridian it is positive."""
    grid_deg = math.degrees(math.atan2(MAST[0] - WHITTLE[0], MAST[1] - WHITTLE[1])) % 360
    assert grid_deg == pytest.approx(233.091, abs=0.0005)
    assert grid_deg + float(HOVSORE.convergence_deg(WHITTLE)) == pytest.approx(232.400, abs=0.0006)
    assert float(HOVSORE.convergence_deg((600000.0, 6256000.0, 0.0))) > 0


def test_04_azimuth_runs_clockwise_from_true_north_in_0_to_360() -> None:
    """North, east, south, west, and a hair west of north."""
    places = [[0, 1, 0], [1, 0, 0], [0, -1, 0], [-1, 0, 0], [-1e-17, 1, 0]]
    assert beam_to(np.array(places) * 1000.0).azimuth_deg.tolist() == [0.0, 90.0, 180.0, 270.0, 0.0]


def test_05_elevation_is_of_the_straight_line_with_refraction_beside_it() -> None:
    """The line to a target 12 km away at the head's height goes down by half the angle of the Earth's arc."""
    plan = plan_of(targets=[{"name": "T", "position": [447000, 6268000, 10]}])
    (row,) = plan.pointings
    assert row.elevation_deg == pytest.approx(-math.degrees(12000 / 6.38e6) / 2, abs=2e-4)
    assert row.refraction_deg == pytest.approx(0.13 * -row.elevation_deg, rel=0.01)


def test_06_range_is_slant_from_the_head() -> None:
    """3, 4, 12: 13."""
    assert float(beam_to([300.0, 400.0, 1200.0]).range_m) == 1300.0


def test_07_the_unit_vector_in_east_north_up() -> None:
    azimuth, elevation = math.radians(200.0), math.radians(-15.0)
    by_hand = (
        math.sin(azimuth) * math.cos(elevation),
        math.cos(azimuth) * math.cos(elevation),
        math.sin(elevation),
    )
    assert unit_vector(200.0, -15.0) == pytest.approx(by_hand)


def test_08_straight_up_and_down_the_azimuth_is_0() -> None:
    beam = beam_to([[0.0, 0.0, 50.0], [-0.0, -0.0, -50.0]])
    assert beam.azimuth_deg.tolist() == [0.0, 0.0]
    assert beam.elevation_deg.tolist() == [90.0, -90.0]


def test_09_pointing_is_head_plus_offset_after_heading_pitch_roll() -> None:
    """Offsets add; heading turns clockwise; the nose goes up; the right side goes down; and in that order."""
    azimuth, elevation = Mounting(azimuth_offset_deg=12.31, elevation_offset_deg=0.6).to_true(179.69, 5.36)
    assert (float(azimuth), float(elevation)) == pytest.approx((192.0, 5.96))
    assert float(Mounting(heading_deg=30.0).to_true(10.0, 0.0)[0]) == pytest.approx(40.0)
    assert float(Mounting(pitch_deg=2.0).to_true(0.0, 0.0)[1]) == pytest.approx(2.0)
    assert float(Mounting(roll_deg=2.0).to_true(90.0, 0.0)[1]) == pytest.approx(-2.0)
    nose = Mounting(heading_deg=90.0, pitch_deg=10.0, roll_deg=40.0).to_true(0.0, 0.0)
    assert (float(nose[0]), float(nose[1])) == pytest.approx((90.0, 10.0))  # the roll is about the nose


def test_10_a_head_at_grid_north_shows_the_true_azimuth_less_the_convergence() -> None:
    (true,), (grid,) = (plan_of(lidar={"north": north}).pointings for north in ("true", "grid"))
    assert true.azimuth_head_deg == pytest.approx(true.azimuth_true_deg)
    assert grid.azimuth_head_deg == pytest.approx((grid.azimuth_true_deg - grid.convergence_deg) % 360)
    assert grid.convergence_deg == pytest.approx(-0.71, abs=0.01)
    assert math.sin(math.radians(grid.azimuth_head_deg)) == pytest.approx(
        0.0, abs=1e-5
    )  # due north on the map


def test_11_sectors_run_clockwise_and_may_cross_north() -> None:
    assert Sector.between(350.0, 10.0).width_deg == 20.0
    assert Sector.between(10.0, 350.0).width_deg == 340.0
    assert SectorSet.of([Sector.between(350.0, 10.0)]).contains([355.0, 0.0, 180.0]).tolist() == [
        True,
        True,
        False,
    ]


def test_12_continuous_rays_lie_inside_step_stares_at_the_ends() -> None:
    """60° at 2°: 30 rays whose middles span 58°, or 31 that span 60."""
    moving, standing = (
        sector(90.0, 5.0, sector_deg=60, step_deg=2, accumulation_s=0.4, head=HEAD, motion=motion).azimuth_deg
        for motion in ("continuous", "step")
    )
    assert (len(moving), moving[0], moving[-1]) == (30, 61.0, 119.0)
    assert (len(standing), standing[0], standing[-1]) == (31, 60.0, 120.0)


def test_13_the_time_of_a_ray_is_its_middle() -> None:
    scan = sector(90.0, 5.0, sector_deg=6, step_deg=2, accumulation_s=0.4, head=HEAD)
    assert scan.time_s == pytest.approx([0.2, 0.6, 1.0])


def test_14_first_m_is_the_centre_of_gate_0() -> None:
    """Høvsøre: the 21st of 41 gates, 25 m apart from 666 m, is at 1166 m."""
    gates = Gates(first_m=666, spacing_m=25, count=41)
    assert (gates.centres_m[0], gates.centres_m[20], gates.last_m) == (666.0, 1166.0, 1666.0)


def test_15_a_subset_is_the_middle_rays_the_extra_one_clockwise() -> None:
    """Simon (2015): 30, 26, 23 ... 3 rays; 23 of 30 leave out four on the left, three on the right."""
    kept = [subset_rays(30, 2, size) for size in (60, 50, 44, 38, 30, 22, 14, 8, 4)]
    assert [rays.stop - rays.start for rays in kept] == [30, 26, 23, 20, 16, 12, 8, 5, 3]
    assert (kept[2].start, 30 - kept[2].stop) == (4, 3)


def test_16_radial_speed_is_positive_away() -> None:
    """A west wind on a beam to the east, and on one to the west."""
    speeds = radial_speed_mps(np.array([90.0, 270.0]), np.zeros(2), 10.0, 0.0)
    assert speeds == pytest.approx([10.0, -10.0])


def test_17_wind_from_is_where_it_blows_from() -> None:
    u, v = uv_mps(10.0, 270.0)
    assert (float(u), float(v)) == pytest.approx((10.0, 0.0), abs=1e-12)
    assert float(from_deg(0.0, -1.0)) == pytest.approx(0.0)  # blowing south


def test_18_u_is_east_v_north_w_up() -> None:
    """One unit of each, seen by a beam along each."""
    beams = np.array([90.0, 0.0, 0.0]), np.array([0.0, 0.0, 90.0])
    seen = [radial_speed_mps(*beams, *unit) for unit in np.eye(3)]
    assert np.array(seen) == pytest.approx(np.eye(3), abs=1e-12)


def test_19_bias_is_retrieved_less_true_against_the_mean_scalar_speed() -> None:
    """Noise across makes the retrieved speed too high: positive; the scalar mean is above the vector's."""
    noise = predict_noise(narrow_scan(), WindState(8.0, 180.0), 0.5)
    assert (noise.speed_bias_mps or 0.0) > 0
    u, v = np.array([8.0, 8.0]), np.array([2.0, -2.0])
    assert float(scalar_mean(u, v)) == pytest.approx(math.hypot(8, 2))
    assert [float(mean) for mean in vector_mean(u, v)] == pytest.approx([8.0, 0.0])
    air = Turbulence(0.09, 170.0)
    scalar = predict_ten_minute(narrow_scan(), WindState(8.0, 180.0), air)
    vector = predict_ten_minute(narrow_scan(), WindState(8.0, 180.0), air, reference="vector")
    assert float(scalar.reference_mean_mps) > float(vector.reference_mean_mps)
    expected = scalar.lidar_mean_mps - scalar.reference_mean_mps
    assert float(scalar.speed_bias_mps) == pytest.approx(float(expected))


def test_20_slope_minimises_the_squares_of_mast_less_slope_times_lidar() -> None:
    """Draws with the means and covariances of two states, and numpy's least squares over them."""
    air, rays = Turbulence(0.15, 120.0), narrow_scan(3)
    speeds, weights = np.array([6.0, 12.0]), np.array([1.0, 3.0])
    means = [predict_ten_minute(rays, WindState(speed, 180.0), air) for speed in speeds]
    rng = np.random.default_rng(1)
    mast, lidar = [], []
    for mean, weight in zip(means, weights, strict=True):
        both = float(mean.covariance_m2s2)
        covariance = [[float(mean.lidar_variance_m2s2), both], [both, float(mean.reference_variance_m2s2)]]
        centre = [float(mean.lidar_mean_mps), float(mean.reference_mean_mps)]
        drawn = rng.multivariate_normal(centre, covariance, size=int(100_000 * weight))
        lidar.append(drawn[:, 0])
        mast.append(drawn[:, 1])
    a, *_ = np.linalg.lstsq(np.concatenate(lidar)[:, None], np.concatenate(mast), rcond=None)
    slope = float(regress_speed(Climate(speeds, np.full(2, 180.0), weights), means).slope)
    assert slope == pytest.approx(float(a[0]), abs=2e-4)
    assert slope != pytest.approx(1.0, abs=2e-3)


def test_21_length_is_the_integral_scale_and_1_339_of_it_the_formulas_own() -> None:
    """The von Kármán correlation 2^(2/3)/Γ(1/3)·x^(1/3)·K_1/3(x), x = r/l, integrated over r, is L."""
    from scipy.integrate import quad
    from scipy.special import gamma, kv

    def correlation(x: float) -> float:
        return float(2 ** (2 / 3) / gamma(1 / 3) * x ** (1 / 3) * kv(1 / 3, x))

    air = Turbulence(0.1, 170.0)
    integral, _ = quad(correlation, 0.0, 60.0, epsabs=1e-10)
    assert air.eddy_length_m * integral == pytest.approx(170.0, rel=1e-5)
    assert air.eddy_length_m / 170.0 == pytest.approx(1.339, abs=5e-4)


def test_every_numbered_sentence_has_a_test_and_every_test_a_sentence() -> None:
    text = (ROOT / "docs" / "conventions.md").read_text(encoding="utf-8")
    sentences = [int(number) for number in re.findall(r"^(\d+)\. ", text, flags=re.MULTILINE)]
    tests = sorted(int(match[1]) for name in globals() if (match := re.match(r"test_(\d\d)_", name)))
    assert sentences == list(range(1, len(sentences) + 1))
    assert tests == sentences
