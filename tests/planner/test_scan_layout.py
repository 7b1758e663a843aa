"""Scans laid out in space: axis, rays, gates, probe, tilt."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from geometry.errors import InputError
from geometry.head import Mounting
from planner.plan import Plan
from planner.scan_layout import ScanLayout, volume_m
from planner.scan_making import INSTANT_HEAD, head_limits

Moor = Callable[..., Plan]
BASE: dict[str, Any] = {"name": "a", "lidar": "A", "target": "T", "accumulation_s": 0.5}


def layout_of(moor: Moor, *, lidar: dict[str, Any] | None = None, **fields: Any) -> ScanLayout:
    first = {
        "name": "A",
        "position": [500000, 6250000, 10],
        "instrument": "windscanner-200s",
        **(lidar or {}),
    }
    return moor(lidars=[first], scans=[{**BASE, **fields}], pairs=[]).layouts[0]


def test_hovsores_sector_has_thirty_rays_whose_middles_span_58_degrees(hovsore: Plan) -> None:
    """Simon (2015): 60°, 2° a ray, head azimuths 150 to 208, aimed at the mast."""
    layout = hovsore.layout["sector"]
    azimuth = layout.scan.azimuth_deg
    assert layout.scan.count == 30
    assert azimuth[-1] - azimuth[0] == pytest.approx(58.0)
    assert azimuth.mean() == pytest.approx(float(layout.aim.azimuth_deg[0]))
    first, last = layout.edges_deg()[0][[0, -1]]
    assert last - first == pytest.approx(60.0)


def test_probes_are_those_of_the_pulses(hovsore: Plan, kassel: Plan) -> None:
    """200 ns with 64 points 42.6 m, 400 ns with 128 points 85.1 m (Gaussian pulse, rectangular window)."""
    assert {round(layout.probe.length_m, 1) for layout in hovsore.layouts} == {42.6}
    assert {round(layout.probe.length_m, 1) for layout in kassel.layouts} == {85.1}


@pytest.mark.parametrize(("scan", "stated_m"), [("sector", 1166), ("stare K", 1135), ("stare W", 1625)])
def test_hovsores_gates_are_the_stated_ones(hovsore: Plan, scan: str, stated_m: float) -> None:
    """Simon (2015): the gate at the cup is the 21st."""
    assert hovsore.layout[scan].target_range_m == stated_m
    assert hovsore.layout[scan].gate_at(stated_m) == (20, stated_m, 0.0)


def test_a_range_offset_moves_the_gates_not_the_target(moor: Moor) -> None:
    """True range is stated range plus offset: gate 2 of 900, 950, 1000 m is at 1007 m."""
    layout = layout_of(
        moor,
        type="stare",
        lidar={"mounting": {"range_offset_m": 7.0}},
        gates={"first_m": 900, "spacing_m": 50, "count": 5},
    )
    index, centre_m, offset_m = layout.gate_at(1005.4) or (0, 0.0, 0.0)
    assert (index, centre_m) == (2, 1007.0)
    assert offset_m == pytest.approx(1.6)
    assert layout.range_to_m("T") == pytest.approx(np.hypot(1000 / 0.9996, 100), abs=0.05)


def test_declared_head_angles_win_over_the_target(moor: Moor) -> None:
    """Pointing = head angle + offset; the target is at 0° and 5.7°."""
    offsets = {"azimuth_offset_deg": 12.31, "elevation_offset_deg": 0.6}
    layout = layout_of(moor, type="stare", lidar=offsets, azimuth_head_deg=348.69, elevation_head_deg=5.1)
    assert layout.axis_azimuth_deg == pytest.approx(1.0)
    assert layout.axis_elevation_deg == pytest.approx(5.7)
    assert layout.aim_error_deg == pytest.approx(np.cos(np.deg2rad(5.7)), abs=0.001)
    assert layout.aim_miss_m == pytest.approx(17.46, abs=0.03)  # 1 km · 1°
    assert layout_of(moor, type="stare", lidar=offsets).aim_error_deg is None


def test_one_declared_head_angle_leaves_the_other_to_the_target(moor: Moor) -> None:
    layout = layout_of(moor, type="stare", azimuth_head_deg=90.0)
    assert layout.axis_azimuth_deg == pytest.approx(90.0)
    assert layout.axis_elevation_deg == pytest.approx(float(layout.aim.elevation_deg[0]))


def test_a_raster_covers_its_window_about_the_target(moor: Moor) -> None:
    layout = layout_of(
        moor, type="raster", width_deg=2.0, height_deg=1.0, step_deg=0.5, elevation_step_deg=0.25
    )
    scan, elevation = layout.scan, float(layout.aim.elevation_deg[0])
    assert scan.count == 5 * 5
    assert (scan.elevation_deg.min(), scan.elevation_deg.max()) == pytest.approx(
        (elevation - 0.5, elevation + 0.5)
    )
    assert np.ptp((scan.azimuth_deg + 180) % 360) == pytest.approx(2.0)


def test_an_rhi_and_points_keep_their_way_back(moor: Moor) -> None:
    """Back and forth needs no long turn between two passes, a reset does."""
    rhi = {"type": "rhi", "elevation_from_deg": 0, "elevation_to_deg": 40, "step_deg": 2}
    there, reset = (layout_of(moor, **rhi, sweep=sweep).scan for sweep in ("back_and_forth", "reset"))
    assert (there.back_and_forth, reset.back_and_forth) == (True, False)
    assert there.period_s < reset.period_s
    points = {"type": "points", "targets": ["T"], "target": None}
    assert layout_of(moor, **points, sweep="back_and_forth").scan.back_and_forth


def two_points(moor: Moor) -> Plan:
    targets = [
        {"name": "T", "position": [500000, 6251000, 110]},
        {"name": "U", "position": [502000, 6250000, 110]},
    ]
    scan = {**BASE, "type": "points", "targets": ["T", "U"], "target": None}
    return moor(targets=targets, scans=[scan], pairs=[])


def test_a_list_of_points_measures_a_probe_at_each_and_nothing_between(moor: Moor) -> None:
    plan = two_points(moor)
    layout = plan.layouts[0]
    assert layout.scan.azimuth_deg == pytest.approx(layout.aim.azimuth_deg)
    for target, range_m in (("T", 1005.4), ("U", 2003.3)):
        sheet = volume_m(plan.exact_places, layout, target)
        assert sheet.shape[0] == 1
        middle = sheet[0].mean(axis=0)
        assert middle == pytest.approx(
            plan.exact_places.local_m(plan.site.target_position_m(target)), abs=0.02
        )
        assert layout.range_to_m(target) == pytest.approx(range_m, abs=0.1)
        assert np.linalg.norm(sheet[0, -1] - sheet[0, 0]) == pytest.approx(layout.probe.length_m, abs=0.01)
    assert layout.beam_at("U") == pytest.approx((90.0, 2.85), abs=0.03)


def test_a_sector_measures_its_whole_arc(hovsore: Plan) -> None:
    """60° at 1166 m: a chord of 2 r sin 30° between the ends of its middle line."""
    layout = hovsore.layout["sector"]
    sheet = volume_m(hovsore.exact_places, layout, "cup")
    middle = sheet.mean(axis=1)
    chord_m = 2 * 1166 * np.cos(np.deg2rad(layout.axis_elevation_deg)) * np.sin(np.deg2rad(30))
    assert np.linalg.norm(middle[-1] - middle[0]) == pytest.approx(chord_m, abs=0.05)


def test_a_tilted_head_sweeps_a_tilted_cone(moor: Moor) -> None:
    """Every ray keeps its angle to the head's own vertical axis (scipy's rotation)."""
    mounting = {"heading_deg": 20.0, "pitch_deg": 3.0, "roll_deg": -2.0}
    layout = layout_of(
        moor,
        type="sector",
        sector_deg=120,
        step_deg=10,
        lidar={"mounting": mounting, "azimuth_offset_deg": 7.0},
    )
    azimuth, elevation = np.deg2rad([layout.scan.azimuth_deg, layout.scan.elevation_deg])
    rays = np.stack(
        [np.sin(azimuth) * np.cos(elevation), np.cos(azimuth) * np.cos(elevation), np.sin(elevation)]
    )
    turned = Rotation.from_euler("ZXY", [-20.0, 3.0, -2.0], degrees=True)
    own = np.rad2deg(np.arcsin(turned.as_matrix()[:, 2] @ rays))
    assert own == pytest.approx(np.full(12, own[0]), abs=1e-9)
    assert np.ptp(layout.scan.elevation_deg) > 2.0
    middle = (layout.scan.azimuth_deg[5:7] + 180) % 360 - 180
    assert middle.mean() == pytest.approx(0.0, abs=0.1)  # still about the target
    low, high = layout.head_elevation_deg
    assert high - low < 1e-9


def test_a_level_head_keeps_true_elevations(moor: Moor) -> None:
    layout = layout_of(moor, type="sector", sector_deg=60, step_deg=2, lidar={"elevation_offset_deg": 0.6})
    assert np.ptp(layout.scan.elevation_deg) == 0.0
    assert layout.head_elevation_deg[0] == pytest.approx(layout.axis_elevation_deg - 0.6)


def test_the_mounting_of_a_layout_counts_from_true_north(kassel: Plan) -> None:
    layout = kassel.layouts[0]
    assert layout.mounting == Mounting(heading_deg=kassel.places.convergence_deg(layout.lidar))


def test_a_head_that_nothing_is_known_of_turns_at_once(moor: Moor) -> None:
    layout = layout_of(
        moor, type="sector", sector_deg=60, step_deg=2, motion="step", lidar={"instrument": "windcube-100s"}
    )
    assert head_limits(layout.lidar) == INSTANT_HEAD
    assert layout.scan.measured_period_s == pytest.approx(31 * 0.5, abs=0.02)
    assert layout.unambiguous_range_m is None
    assert layout.rays_s == 15.5


def test_farthest_is_the_last_gate_or_the_target(moor: Moor) -> None:
    gates = {"first_m": 100, "spacing_m": 50, "count": 41}
    assert layout_of(moor, type="stare", gates=gates).farthest_m == 2100
    assert layout_of(moor, type="stare").farthest_m == pytest.approx(1005.4, abs=0.1)
    assert layout_of(moor, type="ppi", step_deg=2, target=None, elevation_head_deg=5).farthest_m == 0.0


def test_vertical_wind_looks_like_w_tan_of_the_elevation(moor: Moor) -> None:
    """0.5 m/s at atan(100 / 1000.4), less the curved Earth."""
    layout = layout_of(moor, type="stare")
    assert layout.vertical_bias_mps(-0.5) == pytest.approx(0.5 * 100 / 1000.4, abs=1e-4)


@pytest.mark.parametrize(
    ("fields", "said"),
    [
        ({"type": "raster", "width_deg": 2, "height_deg": 180, "step_deg": 1}, "scan 'a': an elevation"),
        ({"type": "stare", "target": "near"}, "0.50 m from the head of A"),
    ],
)
def test_what_is_no_scan_is_refused_with_its_name(moor: Moor, fields: dict[str, Any], said: str) -> None:
    targets = [
        {"name": "T", "position": [500000, 6251000, 110]},
        {"name": "near", "position": [500000, 6250000, 10.5]},
    ]
    with pytest.raises(InputError, match=said):
        _ = moor(targets=targets, scans=[{**BASE, **fields}], pairs=[]).layouts
