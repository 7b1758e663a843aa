"""What a stay yields, what a shared lidar gives each target, and how noisy a far ray is, against other ways to know."""

import numpy as np
import pytest

from geometry.angles import Sector, SectorSet
from geometry.errors import InputError
from planner.files.yaml_site import parse_site
from planner.placement.echo import echo
from planner.placement.maps import of_lidar
from planner.placement.sharing import shared
from planner.placement.task import task_of
from planner.placement.yield_days import expected_yield
from planner.places import Places
from planner.scan_layout import lay_out
from planner.signal_noise import ray_noise
from planner.site import Site, Weibull, Wind

STACK = """
name: a stack of heights
crs: EPSG:32632
ground_height_m: 0
lidars:
  - {name: one, position: [447000, 6255000, 2], instrument: windscanner-200s, uncertainty: {azimuth_deg: 0, elevation_deg: 0,
     heading_deg: 0, levelling_deg: 0, position_m: 0, range_m: 0}, signal: {cnr_db: -18, range_m: 1000}}
  - {name: two, position: [449000, 6255000, 2], instrument: windscanner-200s, uncertainty: {azimuth_deg: 0, elevation_deg: 0,
     heading_deg: 0, levelling_deg: 0, position_m: 0, range_m: 0}, signal: {cnr_db: -18, range_m: 1000}}
targets:
  - {name: high, position: [448000, 6256000, 200]}
  - {name: low, position: [448000, 6256000, 50]}
  - {name: middle, position: [448000, 6256000, 100]}
scans:
  - {name: s1, lidar: one, target: high, type: stare, accumulation_s: 0.5, pulse_ns: 200, fft_points: 64}
  - {name: s2, lidar: two, target: high, type: stare, accumulation_s: 0.5, pulse_ns: 200, fft_points: 64}
wind: {weibull: {scale_mps: 9, shape: 2}}
"""


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


def test_wind_without_a_distribution_is_said():
    with pytest.raises(InputError, match=r"wind\.weibull"):
        expected_yield(Site(name="a", crs="EPSG:32632"), 1.0)


def test_three_heights_of_noise_alone_get_the_root_of_three_times_the_error():
    task = task_of(parse_site(STACK), fixed=("one",), targets=("high", "low", "middle"))
    found = shared(task, [of_lidar(task, lidar) for lidar in task.site.lidars])
    assert [item.target for item in found] == ["low", "middle", "high"]
    for item in found:
        assert item.speed_std_mps == pytest.approx(np.sqrt(3) * item.alone_speed_std_mps)
        assert item.direction_std_deg == pytest.approx(np.sqrt(3) * item.alone_direction_std_deg)


def test_the_noise_over_many_ranges_is_that_of_the_scan_at_its_target():
    site = parse_site(STACK)
    layout = lay_out(Places(site), site.scan("s1"))
    one = ray_noise(site, layout, "high")
    many = echo(site.lidar("one"), site.scan("s1"), np.array([layout.range_to_m("high"), 4000.0]))
    # 2e-3: the scan takes its range on the map, 0.04 % off, and noise grows with its square
    assert many.noise_mps[0] == pytest.approx(one.noise_mps, rel=2e-3)
    assert many.valid_share[0] == pytest.approx(one.valid_share, rel=2e-3)
    assert many.noise_mps[1] > many.noise_mps[0]
