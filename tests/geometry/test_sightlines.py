"""Lines of sight past solids: closed forms, shapely in plan, brute force along beams, limits, properties."""

import numpy as np
import pytest
import shapely
import shapely.affinity
from hypothesis import given, settings
from hypothesis import strategies as st

from geometry.arrays import FloatArray
from geometry.errors import InputError
from geometry.sightlines import clearance, lost_rays
from geometry.solids import Boxes, Cylinders, Discs, Solids, Spheres

HEAD = np.array([10.0, -20.0, 3.0])


def beam_points(azimuth_deg: float, elevation_deg: float, reach_m: float, count: int = 20001) -> FloatArray:
    """Points along a beam from HEAD, evenly from 0 to the reach: (count, 3)."""
    azimuth, elevation = np.radians([azimuth_deg, elevation_deg])
    along = np.linspace(0.0, reach_m, count)[:, np.newaxis]
    direction = [np.sin(azimuth) * np.cos(elevation), np.cos(azimuth) * np.cos(elevation), np.sin(elevation)]
    return np.asarray(HEAD + along * np.array(direction))


@settings(derandomize=True, deadline=None, max_examples=40)
@given(
    azimuth=st.floats(0, 360),
    elevation=st.floats(-90, 90),
    reach=st.floats(0, 3000),
    east=st.floats(-900, 900),
)
def test_sphere_against_the_closed_form(azimuth: float, elevation: float, reach: float, east: float) -> None:
    """Distance from a point to a segment is its foot, cut to the ends; entry is where the quadratic says."""
    centre, radius = np.array([east, 300.0, 90.0]), 60.0
    got = clearance(HEAD, azimuth, elevation, reach, Spheres([centre], radius))
    end = beam_points(azimuth, elevation, 1.0)[-1] - HEAD
    foot = float(np.clip((centre - HEAD) @ end, 0.0, reach))
    distance = float(np.linalg.norm(HEAD + foot * end - centre))
    assert got.clearance_m[0, 0] == pytest.approx(distance - radius, abs=1e-6)
    if distance < radius - 1e-3:
        middle = float((centre - HEAD) @ end)
        half = np.sqrt(radius**2 - np.linalg.norm(HEAD + middle * end - centre) ** 2)
        assert got.entry_m[0, 0] == pytest.approx(max(middle - half, 0.0), abs=1e-5)
    elif distance > radius + 1e-3:
        assert np.isnan(got.entry_m[0, 0])


def test_towers_in_plan_against_shapely() -> None:
    """Level beams past tall cylinders: shapely's distance from line to axis, less the radius."""
    rng = np.random.default_rng(3)
    axis, radius = rng.uniform(-800, 800, (30, 2)), rng.uniform(0.5, 20.0, 30)
    azimuth, reach = rng.uniform(0, 360, 50), rng.uniform(0, 1500, 50)
    got = clearance(HEAD, azimuth, 0.0, reach, Cylinders(axis, radius, -500.0, 500.0))
    toward = np.column_stack([np.sin(np.radians(azimuth)), np.cos(np.radians(azimuth))])
    ends = HEAD[:2] + reach[:, np.newaxis] * toward
    lines = shapely.linestrings(np.stack([np.broadcast_to(HEAD[:2], ends.shape), ends], axis=1))
    expected = shapely.distance(lines[:, None], shapely.points(axis)[None]) - radius
    assert got.clearance_m.shape == (50, 30)
    assert np.abs(got.clearance_m - expected).max() < 1e-5


def test_boxes_in_plan_against_shapely() -> None:
    """Level beams past tall boxes at any bearing: shapely's distance where clear, and its crossings else."""
    rng = np.random.default_rng(4)
    centre, width, length = rng.uniform(-500, 500, (25, 2)), rng.uniform(2, 60, 25), rng.uniform(2, 60, 25)
    bearing, azimuth = rng.uniform(0, 360, 25), np.arange(0.0, 360.0, 7.0)
    got = clearance(
        HEAD, azimuth, 0.0, 700.0, Boxes(centre, width, length, bearing, -900.0, 900.0)
    ).clearance_m
    feet = [
        shapely.affinity.translate(
            shapely.affinity.rotate(shapely.box(-w / 2, -h / 2, w / 2, h / 2), -turn, origin=(0.0, 0.0)),
            *place,
        )
        for w, h, turn, place in zip(width, length, bearing, centre, strict=True)
    ]
    lines = np.array([shapely.LineString(beam_points(each, 0.0, 700.0, 2)[:, :2]) for each in azimuth])
    expected = shapely.distance(lines[:, None], np.array(feet)[None])
    assert (expected == 0.0).any()
    assert np.abs(np.maximum(got, 0.0) - expected).max() < 1e-5
    assert np.array_equal(got < 0.0, shapely.crosses(lines[:, None], np.array(feet)[None]))


def distance_to_cylinder(points: FloatArray, axis: list[float], radius: float, top: float) -> FloatArray:
    """Second formula, outside only: distance to the nearest point of the solid from height 0 to the top."""
    aside = points[:, :2] - axis
    scale = np.minimum(1.0, radius / np.maximum(np.linalg.norm(aside, axis=1), 1e-12))
    nearest = np.column_stack([axis + aside * scale[:, None], np.clip(points[:, 2], 0.0, top)])
    return np.asarray(np.linalg.norm(points - nearest, axis=1))


@settings(derandomize=True, deadline=None, max_examples=40)
@given(azimuth=st.floats(30, 60), elevation=st.floats(-3, 90), reach=st.floats(0, 600))
def test_tower_of_a_height_against_samples(azimuth: float, elevation: float, reach: float) -> None:
    """20 001 samples along the beam come as near to the tower as the search, and enter where it does."""
    got = clearance(HEAD, azimuth, elevation, reach, Cylinders([[210.0, 180.0]], 15.0, 0.0, 80.0))
    points = beam_points(azimuth, elevation, reach)
    sampled = distance_to_cylinder(points, [210.0, 180.0], 15.0, 80.0)
    assert max(float(got.clearance_m[0, 0]), 0.0) == pytest.approx(sampled.min(), abs=0.02)
    if sampled.min() == 0.0:
        first = np.linspace(0.0, reach, 20001)[np.argmax(sampled == 0.0)]
        assert got.entry_m[0, 0] == pytest.approx(first, abs=0.05)


@pytest.mark.parametrize("facing", [0.0, 35.0, 90.0, 200.0])
def test_rotor_that_faces_a_wind(facing: float) -> None:
    """A beam is cut by a thin disc where it crosses the disc's plane within the radius."""
    hub, azimuth = np.array([310.0, 380.0, 100.0]), np.linspace(20.0, 55.0, 141)
    sight = clearance(HEAD, azimuth, 12.0, 900.0, Discs([hub], 60.0, facing, 0.01))
    normal = np.array([np.sin(np.radians(facing)), np.cos(np.radians(facing)), 0.0])
    cut = []
    for each in azimuth:
        direction = beam_points(each, 12.0, 1.0)[-1] - HEAD
        crossing = HEAD + direction * ((hub - HEAD) @ normal) / (direction @ normal)
        cut.append(np.linalg.norm(crossing - hub) < 60.0)
    agreed = lost_rays(sight) == np.array(cut)
    assert np.any(cut) and not np.all(cut)
    assert agreed.sum() >= azimuth.size - 1  # the disc's own thickness may decide the ray at the rim


def test_sphere_holds_every_yaw() -> None:
    """A beam that misses the sphere misses the disc at any yaw, and no disc is nearer than the sphere."""
    azimuth = np.linspace(0.0, 80.0, 81)
    hub, facing = [[310.0, 380.0, 100.0]], np.arange(0.0, 180.0, 15.0)
    ball = clearance(HEAD, azimuth, 9.0, 900.0, Spheres(hub, 60.0)).clearance_m
    discs = clearance(HEAD, azimuth, 9.0, 900.0, Discs(hub * 12, 59.9, facing, 0.5)).clearance_m
    assert (discs.min(axis=1) >= ball[:, 0] - 1e-6).all()


def test_tower_between_two_rays_is_found_in_the_sweep() -> None:
    """A mast at 1 km stands between rays 2° apart: no still ray hits it, the sweeping one does."""
    place = HEAD[:2] + 1000.0 * np.array([np.sin(np.radians(2.6)), np.cos(np.radians(2.6))])
    mast = Cylinders([place], 0.5, 0.0, 99.0)
    azimuth = np.array([0.0, 2.0, 4.0, 6.0])
    still = clearance(HEAD, azimuth, 2.0, 1100.0, mast)
    swept = clearance(HEAD, azimuth, 2.0, 1100.0, mast, swept_azimuth_deg=2.0)
    assert lost_rays(still).tolist() == [False] * 4
    assert lost_rays(swept).tolist() == [False, True, False, False]
    assert swept.entry_m[1, 0] == pytest.approx(999.5 / np.cos(np.radians(2.0)), abs=0.05)


@pytest.mark.parametrize("swept", [2.0, -2.0, 10.0])
@pytest.mark.parametrize(
    "solids",
    [
        Cylinders([[100.0, 700.0], [-400.0, 300.0], [10.0, 5.0]], [2.0, 0.3, 5.0], 0.0, [90.0, 200.0, 60.0]),
        Spheres([[100.0, 700.0, 90.0], [-90.0, 350.0, 20.0]], 30.0),
        Boxes([[100.0, 400.0]], 10.0, 30.0, 40.0, 0.0, 35.0),
    ],
    ids=["cylinders", "spheres", "boxes"],
)
def test_fan_against_many_still_beams(swept: float, solids: Solids) -> None:
    """The clearance of a sweeping ray is that of the nearest of 2001 beams in its fan, up and down alike."""
    azimuth = np.arange(-60.0, 60.0, 20.0)
    got = clearance(HEAD, azimuth, 4.0, 900.0, solids, swept_azimuth_deg=swept, swept_elevation_deg=0.5)
    part = np.linspace(-0.5, 0.5, 2001)
    for ray, middle in enumerate(azimuth):
        many = clearance(HEAD, middle + part * swept, 4.0 + 0.5 * part, 900.0, solids)
        assert np.abs(got.clearance_m[ray] - many.clearance_m.min(axis=0)).max() < 0.05


def test_limits() -> None:
    """Straight up beside a tower; no reach; the head inside; straight down onto a roof; no solids."""
    tower = Cylinders([[13.0, -16.0]], 2.0, 0.0, 80.0)  # 5 m aside of the head
    assert clearance(HEAD, 0.0, 90.0, 500.0, tower).clearance_m[0, 0] == pytest.approx(3.0)
    assert clearance(HEAD, 0.0, 0.0, 0.0, tower).clearance_m[0, 0] == pytest.approx(3.0)
    inside = clearance(HEAD, 0.0, 45.0, 100.0, Cylinders([HEAD[:2]], 4.0, 0.0, 80.0))
    assert inside.entry_m[0, 0] == 0.0 and inside.clearance_m[0, 0] < 0.0
    above = clearance([0.0, 0.0, 50.0], 0.0, -90.0, 50.0, Boxes([[0.0, 0.0]], 10.0, 10.0, 0.0, 0.0, 20.0))
    assert above.entry_m[0, 0] == pytest.approx(30.0) and above.clearance_m[0, 0] == pytest.approx(-5.0)
    none = clearance(HEAD, [0.0, 9.0], 0.0, 9.0, Spheres(np.empty((0, 3)), []), swept_azimuth_deg=1.0)
    assert none.clearance_m.shape == (2, 0) and lost_rays(none).tolist() == [False, False]


def test_reach_ends_the_beam() -> None:
    """A tower behind the last gate is not touched; one metre further it is."""
    tower = Cylinders([[10.0, 480.0]], 2.0, 0.0, 80.0)  # its near side 498 m north of the head
    assert lost_rays(clearance(HEAD, 0.0, 0.0, [497.5, 498.5], tower)).tolist() == [False, True]


@settings(derandomize=True, deadline=None, max_examples=20)
@given(radius=st.floats(1.0, 80.0), growth=st.floats(0.0, 50.0), azimuth=st.floats(0, 360))
def test_bigger_solids_leave_less_room(radius: float, growth: float, azimuth: float) -> None:
    """A sphere that grows by some metres takes as many metres of clearance."""
    centre = [[90.0, 400.0, 70.0]]
    small = clearance(HEAD, azimuth, 6.0, 800.0, Spheres(centre, radius))
    big = clearance(HEAD, azimuth, 6.0, 800.0, Spheres(centre, radius + growth))
    assert small.clearance_m[0, 0] - big.clearance_m[0, 0] == pytest.approx(growth, abs=1e-6)


@pytest.mark.parametrize(
    "make",
    [
        lambda: Cylinders([[0.0, 0.0]], 0.0, 0.0, 10.0),
        lambda: Cylinders([[0.0, 0.0]], 1.0, 10.0, 10.0),
        lambda: Boxes([[0.0, 0.0]], 1.0, -1.0, 0.0, 0.0, 10.0),
        lambda: Spheres([[0.0, np.nan, 0.0]], 1.0),
        lambda: Spheres([[0.0, 0.0, 0.0]], [1.0, 2.0]),
        lambda: Spheres([[0.0, 0.0]] * 3, 1.0),
        lambda: Discs([[0.0, 0.0, 0.0]], 1.0, 0.0, 0.0),
    ],
)
def test_impossible_solids_are_refused(make: type[Solids]) -> None:
    """Sizes must be positive, numbers finite, lists as long as the places."""
    with pytest.raises(InputError):
        make()


@pytest.mark.parametrize(("azimuth", "reach"), [(np.nan, 10.0), (0.0, -1.0)])
def test_impossible_rays_are_refused(azimuth: float, reach: float) -> None:
    """A ray needs an angle and a reach."""
    with pytest.raises(InputError, match="reach of at least 0"):
        clearance(HEAD, azimuth, 0.0, reach, Spheres([[0.0, 0.0, 0.0]], 1.0))
