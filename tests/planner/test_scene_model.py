"""The neutral scene: what it refuses, what it knows, cameras and the places of names."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from geometry.errors import InputError
from planner.scene.model import Label, Layer, Lines, Mesh, Points, Scene, View
from planner.scene.placement import leader_end_px, place_names
from planner.scene.views import azimuth_of_deg, close_up, overview, project_px, view_from

CORNERS = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Mesh([[0, 0]], [[0, 0, 0]]), "shape"),
        (lambda: Mesh([[0, 0, np.nan]], [[0, 0, 0]]), "not finite"),
        (lambda: Mesh(CORNERS, [[0, 1, 3]]), "points are 0 to 2"),
        (lambda: Mesh(CORNERS, [[0, 1, 2]], opacity=0.0), "opacity"),
        (lambda: Lines(CORNERS, [[0, 1, 2]]), "shape"),
        (lambda: Points(CORNERS, hover=("one",)), "1 texts"),
        (lambda: Label("here", [0, 0]), "shape"),
        (lambda: Layer("a", "red", ()), "#rrggbb"),
        (lambda: Scene("none", ()), "nothing to draw"),
        (lambda: Scene("two", (Layer("a", "#000000", (Points(CORNERS),)),) * 2), "named twice"),
        (lambda: View("v", [0, 0, 9], [0, 0, 0]), "straight"),
        (lambda: View("v", [9, 0, 0], [0, 0, 0], 180.0), "180"),
    ],
)
def test_wrong_input_is_refused_with_its_reason(make, words: str) -> None:
    """Each noun says what came and what is allowed."""
    with pytest.raises(InputError, match=words):
        make()


def test_a_scene_keeps_its_arrays() -> None:
    """A later change of the caller's array does not reach the scene, whose own cannot be written."""
    given_m = np.array(CORNERS, dtype=float)
    mesh = Mesh(given_m, [[0, 1, 2]])
    given_m[0] = 99.0
    assert mesh.vertices_m[0].tolist() == [0, 0, 0]
    with pytest.raises(ValueError, match="read-only"):
        mesh.vertices_m[0] = 1.0


def test_exaggeration_stretches_heights_only_and_is_remembered() -> None:
    """East and north stay, up is multiplied, twice twice is four."""
    items = (Mesh([[0, 0, 3], [1, 0, 3], [0, 1, 3]], [[0, 1, 2]]), Points([[5, 6, 7]]), Label("x", [1, 2, 4]))
    scene = Scene("s", (Layer("a", "#000000", items),), (View("v", [9, 0, 5], [0, 0, 1]),))
    tall = scene.exaggerated(2.0).exaggerated(2.0)
    assert tall.extent_m.tolist() == [[0, 0, 12], [5, 6, 28]]
    assert tall.views[0].position_m.tolist() == [9, 0, 20]
    assert tall.vertical_exaggeration == 4.0
    with pytest.raises(InputError, match="above 0"):
        scene.exaggerated(0.0)


def test_a_lidar_with_two_scans_is_named_once() -> None:
    """One text at one place is one name; the same text elsewhere is another."""
    layers = tuple(
        Layer(name, "#000000", (Label("K", at_m), Points([at_m])))
        for name, at_m in (("K: stare A", [0, 0, 2]), ("K: stare B", [0, 0, 2]), ("K: moved", [9, 0, 2]))
    )
    assert [layer.name for layer, _ in Scene("s", layers).names] == ["K: stare A", "K: moved"]


POINT = st.tuples(*[st.floats(-2000, 2000)] * 2, st.floats(0, 200))


@given(points=st.lists(POINT, min_size=3, max_size=8), azimuth=st.floats(0, 360), elevation=st.floats(5, 60))
@settings(max_examples=40, deadline=None, derandomize=True)
def test_a_view_holds_every_point_within_its_margin(points, azimuth: float, elevation: float) -> None:
    """Whatever is to be seen is in the picture and off its margin."""
    points_m = np.array(points)
    view = view_from("v", points_m, azimuth, elevation, aspect=1.5, margin=0.1)
    seen = project_px(view, points_m, 1500, 1000)
    assert np.all(seen[:, 2] > 0)
    assert np.all(seen[:, :2] > np.array([150, 100]) - 0.01) and np.all(
        seen[:, :2] < np.array([1350, 900]) + 0.01
    )


def test_projection_agrees_with_a_rotation_matrix() -> None:
    """Second formula: turn the world into the camera by angles, divide by depth."""
    view = View("v", [300.0, -400.0, 250.0], [0.0, 0.0, 0.0], 40.0)
    point = np.array([50.0, 20.0, 80.0])
    yaw = np.arctan2(400.0, -300.0)  # mathematical angle of the line of sight
    pitch = np.arctan2(-250.0, 500.0)
    east, north, up = point - view.position_m
    along, left = east * np.cos(yaw) + north * np.sin(yaw), -east * np.sin(yaw) + north * np.cos(yaw)
    depth, rise = along * np.cos(pitch) + up * np.sin(pitch), -along * np.sin(pitch) + up * np.cos(pitch)
    focal = 500 / np.tan(np.radians(20))
    expected = [800 - focal * left / depth, 500 + focal * rise / depth, depth]
    np.testing.assert_allclose(project_px(view, [point], 1600, 1000)[0], expected, rtol=1e-12)


def test_a_point_behind_the_camera_has_no_pixel() -> None:
    """NaN, not a mirrored ghost."""
    assert np.isnan(project_px(View("v", [0, -10, 0], [0, 0, 0]), [[0, -20, 0]], 100, 100)[0, :2]).all()


def test_the_overview_does_not_look_along_a_row_nor_at_rotors_edge_on() -> None:
    """Named places stand apart; a rotor that faces 300° is open by half at least."""
    row = np.array([[0, north, 90] for north in (0, 300, 600, 900)], dtype=float)
    view = overview(row, row, facing_deg=300.0)
    assert abs(np.cos(np.radians(azimuth_of_deg(view) - 300.0))) > 0.5
    x = np.sort(project_px(view, row, 1200, 1000)[:, 0])
    assert np.diff(x).min() > 100


def test_a_close_up_is_centred_on_its_target_and_reaches_its_radius() -> None:
    """The target is the middle of the picture; 50 m to the side is inside it and 100 m is not."""
    view = close_up([10, 20, 120], 70.0, 200.0, without=("wakes",))
    assert azimuth_of_deg(view) == pytest.approx(200.0)
    side = np.array([np.cos(np.radians(200.0)), -np.sin(np.radians(200.0)), 0.0])
    seen = project_px(view, np.array([[10, 20, 120] + d * side for d in (0, 50, 100)]), 400, 400)
    assert seen[0, :2].tolist() == pytest.approx([200, 200])
    assert abs(seen[1, 0] - 200) < 200 < abs(seen[2, 0] - 200)
    assert view.without == ("wakes",)


def test_crowded_names_lie_off_each_other_and_inside_the_picture() -> None:
    """Twelve names around one spot: no two boxes overlap, none leaves the bounds."""
    rng = np.random.default_rng(3)
    anchors = 300 + 25 * rng.standard_normal((12, 2))
    sizes = np.tile([90.0, 22.0], (12, 1))
    middles = place_names(anchors, sizes, (0, 0, 600, 600))
    apart = np.abs(middles[:, None] - middles[None]) + 1e9 * np.eye(12)[..., None]
    assert np.all((apart >= sizes[0]).any(axis=-1))
    assert np.all(middles - sizes / 2 >= 0) and np.all(middles + sizes / 2 <= 600)


def test_names_keep_off_the_drawing_and_the_lower_rank_chooses_first() -> None:
    """A name moves aside for a beam; of two at one place the lower rank lies as if alone."""
    beam = np.stack([np.linspace(0, 400, 200), np.full(200, 226.0)], axis=1)  # where the box would go
    free = place_names([[200, 200]], [[60, 20]], (0, 0, 400, 400))
    aside = place_names([[200, 200]], [[60, 20]], (0, 0, 400, 400), busy_px=beam)
    assert np.abs(free[0, 1] - 226) < 10 < np.abs(aside[0, 1] - 226)
    both = place_names([[200, 200]] * 2, [[60, 20]] * 2, (0, 0, 400, 400), ranks=[2, 0])
    assert both[1].tolist() == free[0].tolist() != both[0].tolist()


def test_a_name_at_the_edge_does_not_hide_its_own_place() -> None:
    """In a corner the box moves inside the picture and still leaves the place free."""
    for corner in ([3, 3], [397, 3], [3, 397], [397, 397]):
        middle = place_names([corner], [[60, 20]], (0, 0, 400, 400))[0]
        assert np.any(np.abs(middle - corner) >= [30, 10])


def test_names_without_a_size_each_are_refused() -> None:
    """One box for each place."""
    with pytest.raises(InputError, match="sizes"):
        place_names([[0, 0], [1, 1]], [[1, 1]], (0, 0, 9, 9))


def test_a_leader_line_ends_at_the_edge_of_its_box() -> None:
    """From the left it meets the left edge; from inside it has no length."""
    assert leader_end_px([0, 0], [100, 0], [40, 20]).tolist() == [80, 0]
    assert leader_end_px([95, 3], [100, 0], [40, 20]).tolist() == [95, 3]
