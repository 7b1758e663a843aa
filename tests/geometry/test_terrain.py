"""Terrain: heights, beams over it, and the viewshed, against geometry worked out by hand and an exact line of sight."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from geometry.errors import InputError
from geometry.segments import passing
from geometry.solids import Boxes, Cylinders, Spheres
from geometry.terrain import HeightRaster
from geometry.terrain_sight import beam_height_m, nearest_pass, terrain_sight
from geometry.viewshed import horizon, viewshed

EARTH_M = 6_371_008.8


def raster_of(heights, cell_m=10.0):
    heights = np.asarray(heights, dtype=float)
    return HeightRaster(heights, 0.0, heights.shape[0] * cell_m, cell_m, cell_m, "above_sea_level")


def rough(rows, columns, seed, cell_m=20.0):
    """Random ground, smooth over a few cells."""
    heights = np.random.default_rng(seed).standard_normal((rows, columns))
    for _ in range(4):
        heights = (heights + np.roll(heights, 1, 0) + np.roll(heights, 1, 1) + np.roll(heights, -1, 1)) / 4
    return raster_of(100.0 * heights + 200.0, cell_m)


@settings(max_examples=25, deadline=None, derandomize=True)
@given(st.floats(-2, 2), st.floats(-2, 2), st.floats(-100, 100), st.floats(5, 95), st.floats(5, 75))
def test_a_plane_is_interpolated_exactly(slope_east, slope_north, base, east, north):
    raster = raster_of(np.zeros((8, 10)))
    plane = base + slope_east * raster.east_m + slope_north * raster.northing_m[:, None]
    found = raster_of(plane).heights_m(east, north)
    assert abs(float(found) - (base + slope_east * east + slope_north * north)) < 1e-9


def test_a_raster_upside_down_is_turned_over():
    south_first = HeightRaster.from_transform(
        [[1.0, 1.0], [5.0, 5.0]], (10, 0, 0, 0, 10, 0), "above_sea_level"
    )
    assert south_first.heights_m(10.0, 5.0) == 1.0
    assert south_first.heights_m(10.0, 15.0) == 5.0


def test_a_turned_raster_is_refused():
    with pytest.raises(InputError, match="Warp it first"):
        HeightRaster.from_transform(np.zeros((3, 3)), (10, 1, 0, 1, -10, 0), "above_sea_level")


def test_sea_level_is_a_height_and_a_hole_is_unknown():
    heights = np.zeros((5, 30))
    over_sea = terrain_sight(raster_of(heights), [5, 25, 5], [295, 25, 5])
    assert not over_sea.blocked.any() and not over_sea.unknown.any()
    heights[2, 15] = np.nan
    over_hole = terrain_sight(raster_of(heights), [5, 25, 5], [295, 25, 5])
    assert over_hole.unknown.all() and not over_hole.blocked.any()


def test_a_beam_that_leaves_the_raster_is_unknown_and_one_blocked_before_is_blocked():
    heights = np.zeros((5, 30))
    assert terrain_sight(raster_of(heights), [5, 25, 5], [900, 25, 5]).unknown.all()
    heights[:, 10] = 50.0
    sight = terrain_sight(raster_of(heights), [5, 25, 5], [900, 25, 5])
    assert sight.blocked.all() and not sight.unknown.any()


@pytest.mark.parametrize(("distance_m", "seen"), [(23_000.0, True), (25_500.0, False)])
def test_over_the_sea_two_points_see_each_other_up_to_the_sum_of_their_horizons(distance_m, seen):
    """Each of 10 m sees to sqrt(2 R h/(1 - k)) = 12.10 km."""
    reach = 2 * np.sqrt(2 * EARTH_M * 10.0 / (1 - 0.13))
    assert (distance_m < reach) == seen
    sea = raster_of(np.zeros((3, 300)), 100.0)
    sight = terrain_sight(sea, [100.0, 150.0, 10.0], [100.0 + distance_m, 150.0, 10.0])
    assert bool(sight.blocked.all()) != seen
    needed = horizon(sea, [100.0, 150.0, 10.0]).needed_height_m(100.0 + distance_m, 150.0)
    assert (float(needed) <= 10.0) == seen


def test_each_gate_is_judged_by_the_way_up_to_it():
    heights = np.zeros((3, 100))
    heights[:, 50] = 40.0
    sight = terrain_sight(raster_of(heights), [5, 15, 20], [995, 15, 20], shares=[0.2, 0.4, 0.6, 1.0])
    assert sight.blocked.tolist() == [False, False, True, True]
    assert abs(sight.distance_m[-1] - 500.0) < 1.0
    assert abs(sight.clearance_m[-1] + 20.0) < 0.1


def test_a_beam_rises_over_the_earth_by_the_surveyors_formula():
    """2.83 m of curvature less 13 % at 6 km."""
    assert (
        abs(float(beam_height_m(5.0, 1.0, 6000.0)) - (5.0 + 6000 * np.tan(np.radians(1)) + 0.87 * 2.8253))
        < 1e-3
    )


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_the_viewshed_agrees_with_the_exact_line_of_sight(seed):
    raster = rough(60, 70, seed)
    target = np.array([700.0, 500.0, float(raster.heights_m(700.0, 500.0)) + 80.0])
    seen = viewshed(raster, target) <= 2.0
    east, north = np.meshgrid(raster.east_m, raster.northing_m)
    heads = np.stack([east, north, raster.height_m + 2.0], axis=-1)
    exact = ~terrain_sight(raster, heads, target).blocked[..., 0]
    assert 0.05 < exact.mean() < 0.98
    assert np.mean(seen != exact) < 0.03


def test_a_layer_never_lets_a_head_see_more():
    raster = rough(40, 40, 5)
    canopy = np.zeros(raster.height_m.shape)
    canopy[10:14] = 15.0
    target = [400.0, 100.0, float(raster.heights_m(400.0, 100.0)) + 20.0]
    head = np.stack([np.linspace(20, 780, 40), np.full(40, 700.0), np.full(40, 225.0)], axis=-1)
    bare, grown = (
        terrain_sight(each, head, target).clearance_m for each in (raster, raster.with_layer(canopy))
    )
    assert np.all(grown <= bare + 1e-9) and np.any(grown < bare - 1.0)


def test_a_target_outside_the_raster_is_refused():
    with pytest.raises(InputError, match="outside the height raster"):
        horizon(raster_of(np.zeros((3, 3))), [500.0, 10.0, 5.0])


def test_many_beams_pass_solids_as_far_as_dense_sampling_says():
    rng = np.random.default_rng(7)
    start, end = rng.uniform(-200, 200, (150, 3)), rng.uniform(-200, 200, (150, 3))
    points = start[:, None] + np.linspace(0, 1, 4001)[:, None] * (end - start)[:, None]
    for solids in (
        Spheres([[0.0, 0.0, 50.0], [100.0, 50.0, 0.0]], [40.0, 30.0]),
        Cylinders([[0.0, 30.0], [-80.0, 0.0]], 5.0, -100.0, 90.0),
        Boxes([[20.0, 20.0]], 30.0, 60.0, 25.0, -50.0, 40.0),
    ):
        found = passing(start, end, solids).clearance_m
        dense = solids.distance_m(points[..., None, :]).min(axis=(1, 2))
        near = dense < 40.0
        assert near.sum() > 5
        assert np.abs(found - dense)[near].max() < 0.2
        assert np.all(found <= dense + 0.01)


@pytest.mark.parametrize("seed", [1, 2])
def test_the_nearest_pass_and_the_entry_are_those_of_dense_sampling(seed):
    """Every 0.2 m along 40 beams: where height over distance is least, and where the ground is first met."""
    raster, rng = rough(60, 70, seed), np.random.default_rng(seed)
    spots = rng.uniform([30, 30], [1370, 1170], (40, 2, 2))
    ground = raster.heights_m(spots[..., 0], spots[..., 1])
    beams = np.concatenate([spots, (ground + rng.uniform(2, 40, ground.shape))[..., None]], axis=-1)
    near = nearest_pass(raster, beams[:, 0], beams[:, 1])
    entry = terrain_sight(raster, beams[:, 0], beams[:, 1]).entry_m[:, 0]
    met, heights = 0, raster.height_m  # inside a cell the ground bulges by up to a sixteenth of its twist
    twist = np.abs(heights[1:, 1:] + heights[:-1, :-1] - heights[1:, :-1] - heights[:-1, 1:]).max()
    for number, (head, end) in enumerate(beams):
        span = np.hypot(*(end - head)[:2])
        way = np.arange(0.2, span, 0.2)
        points = head + way[:, None] / span * (end - head)
        above = points[:, 2] - (1 - 0.13) * way * (span - way) / (2 * EARTH_M)
        above = above - raster.heights_m(points[:, 0], points[:, 1])
        slope = near.clearance_m[number] / near.distance_m[number]
        assert abs(slope - np.min(above / way)) * near.distance_m[number] < twist / 16
        below = np.flatnonzero(above < 0)
        deep = below.size and above[below].min() < -1.0
        assert abs(way[below[0]] - entry[number]) < 5.0 if deep else True
        assert below.size or np.isnan(entry[number]) or above.min() < 0.05
        met += below.size > 0
    assert 5 < met < 35
