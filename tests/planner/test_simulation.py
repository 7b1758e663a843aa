"""The virtual campaign: its climate, its air, and what is wrong with its lidars."""

from dataclasses import replace

import numpy as np
import pytest

from geometry.angles import SectorSet
from geometry.errors import InputError
from geometry.gates import Probe
from planner.files.yaml_site import parse_site
from planner.plan import Plan
from planner.simulation import Options, draw_states, virtual
from reconstruct.alignment import time_lag
from reconstruct.rays import Rays
from reconstruct.sector_scan import sector_wind
from reconstruct.spectra import Turbulence
from reconstruct.uncertainty import ErrorSources
from reconstruct.virtual import Flown, VirtualScan, VirtualSettings, fly, split_sources
from reconstruct.wind import WindState, from_deg

SITE = """\
name: Moor
crs: EPSG:32632
ground_height_m: 5
lidars:
  - {name: A, position: [447893.983, 6256558.133, 5.078], instrument: windscanner-200s}
masts:
  - {name: mast, position: [447647.39, 6255435.76, 4.836], height_m: 116.5}
targets:
  - {name: cup, mast: mast, height_m: 120}
scans:
  - {name: s, lidar: A, target: cup, type: sector, sector_deg: 60, step_deg: 2, accumulation_s: 0.4, period_s: 12}
  - {name: rhi, lidar: A, type: rhi, elevation_from_deg: 0, elevation_to_deg: 30, step_deg: 1, accumulation_s: 0.4,
     azimuth_head_deg: 10}
wind:
  weibull: {scale_mps: 8.9, shape: 2.75}
  reference_height_m: 116.5
  directions_deg: [[300, 60], [118, 270]]
  turbulence: {intensity: 0.09, length_m: 170}
"""
CALM = VirtualSettings(averaging_s=600.0)


def fan(azimuth_deg: np.ndarray, period_s: float = 12.0) -> Rays:
    """Rays to a target 1000 m north of a lidar, at its height."""
    count = len(azimuth_deg)
    return Rays(
        azimuth_deg=azimuth_deg, elevation_deg=np.zeros(count), range_m=np.full(count, 1000.0),
        head_m=np.tile([0.0, -1000.0, 0.0], (count, 1)), lidar=np.zeros(count, dtype=int), time_s=0.2 + 0.4 * np.arange(count),
        duration_s=np.full(count, 0.4), swept_azimuth_deg=np.zeros(count), probes=(Probe(200, 256),), period_s=period_s,
    )  # fmt: skip


def scan_of(
    rays: Rays,
    sources: ErrorSources | None = None,
    offset_m: tuple[float, float, float] = (0, 0, 0),
    lidar: int = 0,
) -> VirtualScan:
    return VirtualScan(rays, np.array(offset_m, dtype=float), 1.0, 100.0, sources or ErrorSources(), lidar)


def flown(scans: list[VirtualScan], states: list[WindState], **more: object) -> list[Flown]:
    return list(fly(scans, states, **{"turbulence": None, "seed": 1, "settings": CALM, **more}))  # type: ignore[arg-type]


def test_speeds_follow_the_truncated_weibull_distribution_carried_to_the_target() -> None:
    """Kolmogorov's distance from 1 - exp(-(V/A)^k), truncated to the speed range and grown by the power law."""
    site = parse_site(SITE)
    states = draw_states(site, "cup", SectorSet.empty(), 2000, np.random.default_rng(1))
    growth = ((124.836 - 5.0) / 116.5) ** 0.14
    speed = np.sort([state.speed_mps for state in states]) / growth
    below, at, above = (1 - np.exp(-((v / 8.9) ** 2.75)) for v in (4.0, speed, 25.0))
    wanted = (at - below) / (above - below)
    assert np.max(np.abs(wanted - (np.arange(2000) + 0.5) / 2000)) < 1 / 2000


def test_directions_fill_the_wanted_sectors_evenly_across_north() -> None:
    states = draw_states(parse_site(SITE), "cup", SectorSet.empty(), 2720, np.random.default_rng(1))
    angle = np.array([state.from_deg for state in states])
    north, south = (angle >= 300) | (angle <= 60), (angle >= 118) & (angle <= 270)
    assert np.all(north | south)
    assert np.count_nonzero(north) == pytest.approx(2720 * 120 / 272, abs=1)
    speed = np.array([state.speed_mps for state in states])
    assert abs(np.corrcoef(angle[south], speed[south])[0, 1]) < 0.1


def test_without_declared_directions_the_wind_comes_from_where_no_wake_is() -> None:
    from geometry.angles import Sector

    site = parse_site(SITE.replace("  directions_deg: [[300, 60], [118, 270]]\n", ""))
    excluded = SectorSet.of([Sector.between(340.0, 20.0)])
    states = draw_states(site, "cup", excluded, 500, np.random.default_rng(1))
    assert not np.any(excluded.contains(np.array([state.from_deg for state in states])))


def test_only_scans_that_measure_wind_at_a_target_are_flown() -> None:
    campaign = virtual(Plan(parse_site(SITE)), Options(days=0.5))
    assert [layout.name for layout in campaign.layouts] == ["s"]
    assert len(campaign.states) == 72
    with pytest.raises(InputError, match="ten-minute period"):
        virtual(Plan(parse_site(SITE)), Options(days=0.0))


def test_a_steady_wind_without_errors_is_seen_as_it_is() -> None:
    azimuth = np.array([-20.0, 0.0, 20.0])
    wind = WindState(speed_mps=9.0, from_deg=230.0)
    period = flown([scan_of(fan(azimuth))], [wind])[0]
    wanted = -9.0 * np.cos(np.radians(230.0 - azimuth))
    np.testing.assert_allclose(period.radial_speed_mps[0], np.tile(wanted, (50, 1)), atol=1e-9)
    np.testing.assert_allclose(period.reference_mps, np.tile(wind.uv_mps, (1200, 1)), atol=1e-12)


def test_a_wrong_heading_stays_for_the_campaign_and_is_one_for_all_scans_of_a_lidar() -> None:
    azimuth = np.arange(-30.0, 31.0, 4.0)
    wrong = ErrorSources(heading_deg=1.0)
    scans = [
        scan_of(fan(azimuth), wrong),
        scan_of(fan(azimuth + 5.0), wrong),
        scan_of(fan(azimuth), wrong, lidar=1),
    ]
    states = [WindState(speed_mps=9.0, from_deg=angle) for angle in (190.0, 200.0, 215.0)]
    errors = []
    for period in flown(scans, states):
        found = [
            sector_wind(s.rays.azimuth_deg, 0.0, v).wind_mps
            for s, v in zip(scans, period.radial_speed_mps, strict=True)
        ]
        errors.append([float(np.mean(from_deg(*wind.T))) - period.state.from_deg for wind in found])
    spread = np.array(errors)
    np.testing.assert_allclose(spread, np.tile(spread[0], (3, 1)), atol=1e-9)
    assert spread[0, 0] == pytest.approx(spread[0, 1], abs=1e-9)
    assert abs(spread[0, 2] - spread[0, 0]) > 0.05


def test_lasting_and_fresh_errors_make_up_the_whole() -> None:
    whole = ErrorSources(
        radial_speed_mps=0.3,
        radial_speed_correlation=0.4,
        azimuth_deg=0.2,
        azimuth_correlation=0.5,
        levelling_deg=0.1,
    )
    lasting, fresh = split_sources(whole)
    for name in ("radial_speed_mps", "azimuth_deg"):
        assert getattr(lasting, name) ** 2 + getattr(fresh, name) ** 2 == pytest.approx(
            getattr(whole, name) ** 2
        )
    assert (lasting.levelling_deg, fresh.levelling_deg) == (0.1, 0.0)


def test_noise_is_as_strong_as_it_is_said_to_be() -> None:
    scan = scan_of(fan(np.array([0.0])), ErrorSources(radial_speed_mps=0.25))
    speeds = np.concatenate([p.radial_speed_mps[0] for p in flown([scan], [WindState(8.0, 180.0)] * 20)])
    assert np.std(speeds) == pytest.approx(0.25, rel=0.05)


def test_the_same_seed_gives_the_same_campaign_and_another_another() -> None:
    scan = scan_of(fan(np.array([0.0, 10.0])), ErrorSources(radial_speed_mps=0.25, heading_deg=0.1))
    once, again, other = (
        flown([scan], [WindState(8.0, 180.0)], seed=seed)[0].radial_speed_mps[0] for seed in (3, 3, 4)
    )
    np.testing.assert_array_equal(once, again)
    assert np.all(once != other)


def test_the_air_passes_one_target_and_then_the_other() -> None:
    """Taylor's hypothesis: 400 m further downwind at 8 m/s the same gusts come 50 s later."""
    stare = replace(fan(np.array([0.0]), period_s=2.0), head_m=np.array([[0.0, -1000.0, 0.0]]))
    scans = [scan_of(stare), scan_of(stare, offset_m=(0.0, 400.0, 0.0))]
    settings = VirtualSettings(spacing_m=15.0)
    period = flown(scans, [WindState(8.0, 180.0)], turbulence=Turbulence(0.15, 80.0), settings=settings)[0]
    first, second = (speeds[:, 0] for speeds in period.radial_speed_mps)
    lag = time_lag(first, second, interval_s=2.0, longest_s=100.0)
    assert lag.lag_s == pytest.approx(50.0, abs=3.0)
    assert lag.correlation > 0.8


def test_the_mast_meets_the_turbulence_that_was_asked_for() -> None:
    settings = VirtualSettings(spacing_m=15.0)
    states = [WindState(8.0, 180.0)] * 8
    periods = flown(
        [scan_of(fan(np.array([0.0])))], states, turbulence=Turbulence(0.15, 80.0), settings=settings
    )
    along = np.concatenate([period.reference_mps[:, 1] for period in periods])
    assert np.std(along) == pytest.approx(1.2, rel=0.1)
    assert np.mean(along) == pytest.approx(8.0, abs=0.15)


def test_scans_and_reference_share_the_eddies_that_they_meet() -> None:
    """Two lidars in one place that stare along one beam see the same air, down to the smallest eddy."""
    stare = fan(np.array([0.0]), period_s=2.0)
    scans = [scan_of(stare), scan_of(stare, lidar=1)]
    settings = VirtualSettings(averaging_s=60.0, spacing_m=16.0)
    period = flown(scans, [WindState(8.0, 180.0)], turbulence=Turbulence(0.15, 80.0), settings=settings)[0]
    np.testing.assert_allclose(period.radial_speed_mps[0], period.radial_speed_mps[1], atol=1e-5)


def test_nothing_to_fly_is_told() -> None:
    with pytest.raises(InputError, match="no scan to fly"):
        flown([], [WindState(8.0, 180.0)])
    with pytest.raises(InputError, match="averaging time"):
        flown([scan_of(fan(np.array([0.0]), period_s=700.0))], [WindState(8.0, 180.0)])
