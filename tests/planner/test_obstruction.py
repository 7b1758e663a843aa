"""Rays against solids, by brute force along the beam."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from geometry.arrays import FloatArray
from planner.obstruction import ground_met_m, margin_m, reach_m
from planner.plan import Plan

Moor = Callable[..., Plan]


def samples(plan: Plan, scan: str) -> FloatArray:
    """Points (ray, sample, 3) every half metre along the middle of each ray, in the lidar's own frame."""
    layout = plan.layout[scan]
    azimuth, elevation = np.deg2rad([layout.scan.azimuth_deg, layout.scan.elevation_deg])
    rays = np.stack(
        [np.sin(azimuth) * np.cos(elevation), np.cos(azimuth) * np.cos(elevation), np.sin(elevation)]
    )
    along = np.arange(0.0, (layout.target_range_m or 0.0) + layout.probe.length_m / 2, 0.5)
    return rays.T[:, None] * along[:, None]


@pytest.mark.parametrize("scan", ["stare K", "stare W"])
def test_clearances_of_hovsores_stares_by_brute_force(hovsore: Plan, scan: str) -> None:
    """Smallest distance of half-metre samples from the rotor spheres and the tower axes."""
    frame, lidar = hovsore.places.frame, hovsore.layout[scan].lidar
    points = samples(hovsore, scan)[0]
    met = {(item.thing, item.part): item.clearance_m for item in hovsore.obstructions if item.scan == scan}
    for stand in hovsore.site.turbines:
        base = frame.enu_m(lidar.position, stand.position)
        hub = base + np.array([0.0, 0.0, stand.hub_height_m])
        rotor_m = (np.linalg.norm(points - hub, axis=1) - stand.rotor_diameter_m / 2).min()
        if rotor_m < 0:
            assert met[stand.name, "rotor"] == pytest.approx(rotor_m, abs=0.01)
        else:
            assert (stand.name, "rotor") not in met
        low = points[points[:, 2] < hub[2]]
        tower_m = (np.linalg.norm(low[:, :2] - base[:2], axis=1) - stand.tower_diameter_m / 2).min()
        assert tower_m > 0
        assert tower_m < 5 or (stand.name, "tower") not in met


def test_lost_rays_of_the_sector_by_brute_force(hovsore: Plan) -> None:
    """A ray sweeps 2°: it is lost where one of 41 beams within it comes into the rotor's sphere."""
    layout = hovsore.layout["sector"]
    stand = hovsore.site.turbine("stand 5")
    base = hovsore.places.frame.enu_m(layout.lidar.position, stand.position)
    hub = base + np.array([0.0, 0.0, stand.hub_height_m])
    lost = np.zeros(30, dtype=bool)
    elevation = np.deg2rad(layout.axis_elevation_deg)
    along = np.arange(700.0, 1187.0, 1.0)
    for ray, middle in enumerate(layout.scan.azimuth_deg):
        azimuth = np.deg2rad(middle + np.linspace(-1, 1, 41))[:, None]
        beams = [np.sin(azimuth) * np.cos(elevation), np.cos(azimuth) * np.cos(elevation)]
        points = np.stack(
            [*(beam * along for beam in beams), np.sin(elevation) * along + 0 * azimuth], axis=-1
        )
        lost[ray] = (np.linalg.norm(points - hub, axis=-1) <= stand.rotor_diameter_m / 2).any()
    (met,) = [o for o in hovsore.obstructions if (o.scan, o.thing, o.part) == ("sector", "stand 5", "rotor")]
    assert met.lost.tolist() == lost.tolist()
    assert met.lost_rays == lost.sum() == 4
    assert met.lost_azimuth_deg == pytest.approx(layout.scan.azimuth_deg[lost])


def test_a_solid_behind_the_gate_is_no_matter(moor: Moor) -> None:
    scan = {"name": "a", "lidar": "A", "target": "T", "type": "stare", "accumulation_s": 0.5}
    for north_m, count in ((980, 1), (1100, 0)):
        mast = {"name": "M", "position": [500000, 6250000 + north_m, 10], "height_m": 200}
        assert len(moor(masts=[mast], scans=[scan], pairs=[]).obstructions) == count


def test_every_point_of_a_list_has_its_own_reach(moor: Moor) -> None:
    """A mast behind the near target, in front of nothing else, blocks nothing."""
    targets = [
        {"name": "near", "position": [500000, 6250500, 60]},
        {"name": "far", "position": [502000, 6250000, 110]},
    ]
    scan = {"name": "a", "lidar": "A", "type": "points", "targets": ["near", "far"], "accumulation_s": 0.5}
    mast = {"name": "M", "position": [500000, 6250700, 10], "height_m": 200}
    plan = moor(targets=targets, scans=[scan], pairs=[], masts=[mast])
    assert plan.obstructions == ()
    assert reach_m(plan.layouts[0]) == pytest.approx([502.7 + 21.3, 2003.3 + 21.3], abs=0.1)


def test_a_box_is_turned_from_grid_north(moor: Moor) -> None:
    """A wall 100 m long, east to west across the beam, or along it 10 m aside."""
    scan = {"name": "a", "lidar": "A", "target": "T", "type": "stare", "accumulation_s": 0.5}
    wall: dict[str, Any] = {"name": "wall", "width_m": 1, "length_m": 100, "height_m": 90}
    for azimuth_deg, east_m, blocked in ((90, 10, True), (0, 10, False)):
        box = {**wall, "position": [500000 + east_m, 6250500, 10], "azimuth_deg": azimuth_deg}
        met = moor(obstacles=[box], scans=[scan], pairs=[]).obstructions
        assert bool(met) is blocked
        assert all(item.part == "obstacle" and item.lost.all() for item in met)


def test_the_margin_is_two_standard_deviations_of_the_worse_direction(moor: Moor) -> None:
    """2·hypot(0.1 m, 500 m · 0.13°): levelling and elevation here, not azimuth and heading."""
    unsure = {
        "position_m": 0.1,
        "azimuth_deg": 0.05,
        "heading_deg": 0.0,
        "elevation_deg": 0.05,
        "levelling_deg": 0.12,
    }
    lidar = {"name": "A", "position": [500000, 6250000, 10], "instrument": "windscanner-200s"}
    made = moor(lidars=[{**lidar, "uncertainty": unsure}], scans=[], pairs=[]).site.lidars[0]
    assert margin_m(made, 500.0) == pytest.approx(2 * np.hypot(0.1, 500 * np.deg2rad(0.13)))


def test_where_a_beam_meets_the_round_earth_by_brute_force() -> None:
    """Distance to the Earth's centre along the beam, in steps of 1 m, first below the ground's radius.

    To a beam that bends with 0.13 of the Earth's curvature the Earth seems that much flatter.
    """
    radius_m, height_m = 6_371_000.0 / (1.0 - 0.13), 10.0
    along = np.arange(0.0, 20_000.0)
    for elevation_deg in (-3.0, -0.2, -0.0952, -0.093, 0.0, 5.0):
        turn = np.deg2rad(elevation_deg)
        up = np.hypot(radius_m + height_m + along * np.sin(turn), along * np.cos(turn)) - radius_m
        met = along[up < 0.0]
        found = float(ground_met_m(height_m, elevation_deg))
        assert found == pytest.approx(met[0] if met.size else np.inf, abs=1.5 + 0.01 * found * (found < 1e9))


def test_a_beam_into_the_level_ground_is_lost_where_it_meets_it(moor: Moor) -> None:
    scan = {"name": "a", "lidar": "A", "type": "stare", "accumulation_s": 0.5, "gates": None}
    head = {"azimuth_head_deg": 0, "elevation_head_deg": -5}
    gates = {"first_m": 500, "spacing_m": 10, "count": 1}
    down = [{**scan, **head, "gates": gates}]
    (met,) = moor(ground_height_m=0, scans=down, pairs=[]).obstructions
    assert (met.part, met.lost.tolist()) == ("ground", [True])
    assert met.range_m == pytest.approx(10 / np.sin(np.deg2rad(5)), abs=0.1)
