"""Shapes: diameters, radii, normals, heights against elementary geometry."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from geometry.errors import InputError
from planner.scene import beams, ground, structures
from planner.scene.model import Mesh
from planner.scene.solids import (
    box,
    disc,
    ellipsoid,
    frame_of,
    frustum,
    joined,
    lattice_triangles,
    surface_between,
)


def enclosed_volume_m3(mesh: Mesh) -> float:
    """Divergence theorem: a sixth of the sum of det(a, b, c); positive where normals point outside."""
    corners = mesh.vertices_m[mesh.triangles]
    return float(np.linalg.det(corners).sum() / 6)


@pytest.mark.parametrize(
    ("solid", "volume_m3", "share"),
    [
        (box([3, -4, 5], [2, 3, 4], azimuth_deg=37.0), 24.0, 1e-12),
        (frustum([1, 2, 0], [1, 2, 90], 2.0, 1.2, sides=400), np.pi * 90 / 3 * (4 + 2.4 + 1.44), 1e-4),
        (frustum([0, 0, 9], [30, 10, 9], 5.0, 5.0, sides=400), np.pi * 25 * np.hypot(30, 10), 1e-4),
        (ellipsoid([7, 8, 9], np.diag([3.0, 2.0, 1.0]), sides=200), 4 / 3 * np.pi * 6, 1e-3),
        (structures.obstacle([0, 0, 2], width_m=3, length_m=5, height_m=160), 2400.0, 1e-12),
    ],
)
def test_solids_are_closed_with_normals_outside(solid: Mesh, volume_m3: float, share: float) -> None:
    """Their volume by the divergence theorem is the textbook's."""
    assert enclosed_volume_m3(solid) == pytest.approx(volume_m3, rel=share)


@given(east=st.floats(-9, 9), north=st.floats(-9, 9), up=st.floats(-9, 9))
@settings(max_examples=40, deadline=None, derandomize=True)
def test_a_frame_is_orthonormal_and_right_handed(east: float, north: float, up: float) -> None:
    """Along any axis."""
    axis = np.array([east, north, up])
    if np.linalg.norm(axis) < 1e-3:
        axis = np.array([0.0, 0.0, 1.0])
    along, first, second = frame_of(axis)
    frame = np.stack([first, second, along])
    np.testing.assert_allclose(frame @ frame.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(frame) == pytest.approx(1.0)


WIND = (0.0, 45.0, 180.0, 271.0)


@pytest.mark.parametrize("wind_from_deg", WIND)
def test_a_rotor_has_its_diameter_and_faces_the_wind(wind_from_deg: float) -> None:
    """Tips at D/2 from the hub, disc normal toward the wind, rotor upwind of the tower, tip height."""
    t = structures.turbine(
        [100, 200, 5],
        hub_height_m=99.5,
        rotor_diameter_m=113,
        tower_diameter_m=4,
        wind_from_deg=wind_from_deg,
    )
    upwind = np.array([np.sin(np.radians(wind_from_deg)), np.cos(np.radians(wind_from_deg)), 0.0])
    assert (t.hub_m - [100, 200, 104.5]) @ upwind == pytest.approx(4.52)
    assert np.linalg.norm(t.rim.points_m - t.hub_m, axis=1) == pytest.approx(np.full(72, 56.5))
    assert t.solid.vertices_m[:, 2].max() == pytest.approx(5 + 99.5 + 56.5, abs=0.1)
    assert t.solid.vertices_m[:, 2].min() == 5.0
    normals = t.disc.normals / np.linalg.norm(t.disc.normals, axis=1, keepdims=True)
    np.testing.assert_allclose(normals, np.broadcast_to(upwind, normals.shape), atol=1e-9)
    reach = (t.solid.vertices_m - t.hub_m) - ((t.solid.vertices_m - t.hub_m) @ upwind)[:, None] * upwind
    blades = reach[t.solid.vertices_m[:, 2] > 104.5 + 10]
    assert np.linalg.norm(blades, axis=1).max() == pytest.approx(56.5, abs=0.1)


def test_three_blades_stand_120_degrees_apart_and_one_points_up() -> None:
    """The farthest points from the hub: at 0, 120 and 240° about the axis."""
    t = structures.turbine([0, 0, 0], hub_height_m=100, rotor_diameter_m=120, wind_from_deg=0.0)
    offset = (t.solid.vertices_m - t.hub_m)[:, [0, 2]]
    tips = offset[np.linalg.norm(offset, axis=1) > 59.9]
    tips = tips[tips[:, 1] > -50]  # without the foot of the tower
    angles = np.degrees(np.arctan2(tips[:, 0], tips[:, 1])) % 360
    assert sorted({round(a / 120) % 3 for a in angles}) == [0, 1, 2]
    assert np.abs((angles + 60) % 120 - 60).max() < 1.0


def test_a_tower_tapers() -> None:
    """Four metres at the foot, 60 % of it under the nacelle."""
    t = structures.turbine([0, 0, 0], hub_height_m=100, rotor_diameter_m=100, tower_diameter_m=4.0)
    foot = t.solid.vertices_m[t.solid.vertices_m[:, 2] == 0.0]
    assert np.hypot(foot[:, 0], foot[:, 1]).max() == pytest.approx(2.0)


@pytest.mark.parametrize("x_m", [0.0, 600.0])
def test_a_wake_widens_by_twice_its_decay(x_m: float) -> None:
    """D + 2kx at the rotor and at the end: 113 and 203 m at k .075, wind from the north, so southward."""
    w = structures.wake([0, 0, 300], rotor_diameter_m=113, wind_from_deg=0.0, decay=0.075, length_m=600)
    ring = w.surface.vertices_m[np.isclose(w.surface.vertices_m[:, 1], -x_m)]
    assert np.hypot(ring[:, 0], ring[:, 2] - 300).max() * 2 == pytest.approx(113 + 0.15 * x_m)


def test_a_wake_has_the_widths_of_the_reference_study() -> None:
    """The study prints 280 m for D 110 at 1131 m and about 140 m for D 113 at 185 m."""
    for diameter, distance, printed in ((110, 1131, 280), (113, 185, 140)):
        w = structures.wake(
            [0, 0, 500], rotor_diameter_m=diameter, wind_from_deg=270.0, decay=0.075, length_m=distance
        )
        assert np.ptp(w.surface.vertices_m[:, 1]) == pytest.approx(printed, abs=1)


def test_a_wake_is_cut_at_the_ground() -> None:
    """Nothing of it lies under the ground."""
    w = structures.wake(
        [0, 0, 80], rotor_diameter_m=100, wind_from_deg=200.0, decay=0.075, length_m=900, ground_m=5.0
    )
    assert w.surface.vertices_m[:, 2].min() == 5.0


def test_a_mast_is_as_high_and_wide_as_it_says() -> None:
    """Sides of the triangle 1 m, from foot to top."""
    m = structures.mast([10, 20, 5], height_m=116.5, width_m=1.0)
    top = m.points_m[m.points_m[:, 2] == 121.5]
    assert len(top) == 3
    assert np.linalg.norm(top - np.roll(top, 1, axis=0), axis=1) == pytest.approx(np.ones(3))


def test_a_stare_goes_to_its_last_gate_and_its_probe_is_centred_on_the_measured_one() -> None:
    """Kassel, WS4: azimuth 79.26°, elevation 3.00°, range 1426.3 m leads to the published target."""
    head, target = np.array([510686.85, 5687916.63, 287.4]), np.array([512086.2, 5688182.1, 362.1])
    s = beams.stare(
        head - target,
        79.26,
        3.00,
        gate_ranges_m=np.arange(100, 2000, 50),
        measured_range_m=1426.3,
        probe_length_m=85.1,
        ground_m=-80.0,
    )
    assert np.linalg.norm(s.probe.points_m.mean(axis=0)) < 0.5
    assert s.probe.length_m == pytest.approx(85.1)
    assert s.beam.length_m == pytest.approx(1950.0)
    assert s.shadow.points_m[:, 2].tolist() == [-80.0, -80.0]


def test_a_fan_keeps_its_ranges_and_angles() -> None:
    """60° at 2°, 1166 m: band one probe wide, areas of circular sectors (chords of 2°: .02 % less)."""
    azimuth = np.arange(150.0, 210.0 + 1, 2.0)
    f = beams.scan_fan([0, 0, 5], azimuth, 5.0, reach_m=1666, measured_range_m=1166, probe_length_m=42.6)
    assert np.linalg.norm(f.gates.points_m - [0, 0, 5], axis=1) == pytest.approx(np.full(31, 1166.0))
    np.testing.assert_allclose(f.gates.points_m[:, 2], 5 + 1166 * np.sin(np.radians(5)))
    flat = np.radians(60) * np.cos(np.radians(5))  # a shallow cone unrolls to a slightly narrower sector
    assert f.volume.area_m2 == pytest.approx(flat * 1166 * 42.6, rel=1e-3)
    whole = flat / 2 * (1666**2 - (1166 + 21.3) ** 2 + (1166 - 21.3) ** 2)
    assert f.surface.area_m2 == pytest.approx(whole, rel=1e-3)


def test_a_full_circle_closes() -> None:
    """The outline of 360 rays at one elevation is a circle; a fan of one ray is refused."""
    f = beams.scan_fan(
        [0, 0, 0], np.arange(360.0), 0.0, reach_m=100, measured_range_m=90, probe_length_m=30, closed=True
    )
    assert f.edges.length_m == pytest.approx(2 * np.pi * 100, rel=1e-4)
    with pytest.raises(InputError, match="two rays"):
        beams.scan_fan([0, 0, 0], [1.0], 0.0, reach_m=9, measured_range_m=8, probe_length_m=1)


def test_an_rhi_stands_upright() -> None:
    """One azimuth, many elevations: all in one vertical plane."""
    f = beams.scan_fan(
        [0, 0, 2], 90.0, np.arange(0.0, 91.0, 5.0), reach_m=500, measured_range_m=400, probe_length_m=40
    )
    assert np.abs(f.rays.points_m[:, 1]).max() < 1e-9
    assert f.rays.points_m[:, 2].max() == pytest.approx(502.0)


def test_an_error_ellipsoid_has_the_standard_deviations_of_its_covariance() -> None:
    """Turned by 30°: its largest extent along the turned axis is 2 sigma."""
    turn = np.radians(30.0)
    axes = np.array([[np.cos(turn), np.sin(turn), 0], [-np.sin(turn), np.cos(turn), 0], [0, 0, 1.0]])
    covariance = axes.T @ np.diag([9.0, 4.0, 1.0]) @ axes
    body = beams.error_ellipsoid([5, 6, 7], covariance, coverage=2.0)
    reach = np.abs((body.vertices_m - [5, 6, 7]) @ axes.T).max(axis=0)
    np.testing.assert_allclose(reach, [6.0, 4.0, 2.0], rtol=0.02)
    assert enclosed_volume_m3(body) > 0
    with pytest.raises(InputError, match="negative"):
        beams.error_ellipsoid([0, 0, 0], np.diag([1.0, 1.0, -1.0]))
    with pytest.raises(InputError, match="symmetric"):
        beams.error_ellipsoid([0, 0, 0], [[1, 1, 0], [0, 1, 0], [0, 0, 1]])


def test_a_crossing_shows_its_gap_and_its_plumb_line() -> None:
    """Gap of 3 m, plumb from the middle to the ground, no body without a covariance."""
    c = beams.crossing([0, 0, 120], [0, 3, 120], ground_m=4.8)
    assert c.gap.length_m == pytest.approx(3.0)
    assert c.plumb.points_m.tolist() == [[0, 1.5, 120], [0, 1.5, 4.8]]
    assert c.ellipsoid is None


def upward(mesh: Mesh) -> bool:
    return bool(np.all(mesh.normals[:, 2] > 0))


def test_everything_on_the_ground_looks_up() -> None:
    """Normals of plane, terrain, arrow, bar and both kinds of sector point up."""
    east, north = np.arange(0, 50, 10.0), np.arange(0, 40, 10.0)
    height = 20 + np.sin(east / 9)[None, :] * np.cos(north / 7)[:, None]
    for mesh in (
        ground.ground_plane([[0, 0], [900, 500]], height_m=4.8).surface,
        ground.terrain(east, north, height),
        ground.north_arrow([0, 0, 0], 100.0).surface,
        ground.scale_bar([0, 0, 0], 100.0).surface,
        ground.direction_sector([0, 0, 0], 100.0, 275.0, 193.0).surface,
        ground.direction_sector([0, 0, 0], 100.0, 275.0, 193.0, inner_m=80.0).surface,
    ):
        assert upward(mesh)


@pytest.mark.parametrize(("from_deg", "width_deg"), [(275.0, 193.0), (0.0, 360.0), (350.0, 20.0)])
def test_a_sector_of_directions_has_its_area(from_deg: float, width_deg: float) -> None:
    """Half the angle times the difference of the squared radii."""
    s = ground.direction_sector([0, 0, 5], 420.0, from_deg, width_deg, inner_m=350.0)
    assert s.surface.area_m2 == pytest.approx(np.radians(width_deg) / 2 * (420**2 - 350**2), rel=1e-3)


def test_a_sector_lies_clockwise_from_its_start() -> None:
    """From 350° over 20°: on both sides of north, none elsewhere."""
    s = ground.direction_sector([0, 0, 0], 100.0, 350.0, 20.0, inner_m=50.0)
    bearing = np.degrees(np.arctan2(s.surface.vertices_m[:, 0], s.surface.vertices_m[:, 1]))
    assert bearing.min() == pytest.approx(-10.0) and bearing.max() == pytest.approx(10.0)
    assert s.labels[0].text == "350-10°"
    with pytest.raises(InputError, match="at most 360"):
        ground.direction_sector([0, 0, 0], 100.0, 0.0, 361.0)
    with pytest.raises(InputError, match="radii"):
        ground.direction_sector([0, 0, 0], 100.0, 0.0, 90.0, inner_m=100.0)


def test_terrain_keeps_its_holes() -> None:
    """A missing height takes its four cells away and nothing else."""
    height = np.zeros((5, 5))
    height[2, 2] = np.nan
    surface = ground.terrain(np.arange(5.0), np.arange(5.0), height)
    assert surface.area_m2 == pytest.approx(
        16 - 4 + 1
    )  # two of the eight triangles around the hole do not touch it
    with pytest.raises(InputError, match="increase"):
        ground.terrain([0, 1], [1, 0], np.zeros((2, 2)))
    with pytest.raises(InputError, match="rows"):
        ground.terrain([0, 1], [0, 1], np.zeros((3, 2)))
    with pytest.raises(InputError, match="missing value"):
        ground.terrain([0, 1], [0, 1], np.full((2, 2), np.nan))


@given(length=st.floats(1e-3, 1e6))
@settings(max_examples=60, deadline=None, derandomize=True)
def test_a_round_length_is_round_and_not_too_short(length: float) -> None:
    """One of 1, 2, 5 times a power of ten, within a factor 2.5 below."""
    found = ground.round_length_m(length)
    assert length / 2.5 <= found * (1 + 1e-9) and found <= length * (1 + 1e-9)
    assert round(found / 10 ** np.floor(np.log10(found * (1 + 1e-9)))) in (1, 2, 5)


def test_north_arrow_and_scale_bar_are_true() -> None:
    """The arrow points north, the bar is as long as its text says."""
    arrow = ground.north_arrow([5, 5, 0], 80.0)
    tip = arrow.surface.vertices_m[np.argmax(arrow.surface.vertices_m[:, 1])]
    assert tip.tolist() == [5, 45, 0]
    bar = ground.scale_bar([0, 0, 0], 500.0)
    assert np.ptp(bar.lines.points_m[:, 0]) == 500.0 and bar.labels[0].text == "500 m"


def test_building_blocks_refuse_what_they_cannot_build() -> None:
    """No length, unlike curves, unlike opacities."""
    with pytest.raises(InputError, match="no length"):
        frustum([0, 0, 0], [0, 0, 0], 1, 1)
    with pytest.raises(InputError, match="as many"):
        surface_between([[0, 0, 0]], [[0, 0, 1], [0, 1, 1]])
    with pytest.raises(InputError, match="opacities"):
        joined([disc([0, 0, 0], [0, 0, 1], 1.0), disc([0, 0, 0], [0, 0, 1], 1.0, opacity=0.5)])
    assert len(lattice_triangles(4, 5)) == 2 * 3 * 4
