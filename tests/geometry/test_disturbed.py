"""Disturbed directions of points and measurement volumes: the Høvsøre numbers, brute force, properties."""

from collections.abc import Callable
from functools import partial

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pyproj import Proj

from geometry.angles import SectorSet, difference_deg
from geometry.arrays import BoolArray, FloatArray
from geometry.disturbed import any_of, distance_over_diameter, iec_excluded, jensen_excluded
from geometry.errors import InputError
from geometry.volumes import arc_volume_m, stare_volume_m
from geometry.wakes import Rotors

MAST = np.array([447647.39, 6255435.76, 4.836])
WS_S = np.array([447893.983, 6256558.133, 5.078])
ROW = Rotors(
    np.array([[0.0, 185.0, 99.5], [0.0, 500.3, 75.0], [0.0, 815.7, 95.0], [0.0, 1131.0, 84.0]]),
    [113.0, 100.0, 130.0, 90.0],
    0.8,
)
CUP = np.array([[0.0, 0.0, 120.0]])


def hovsore_arc(probe_m: float = 0.0) -> FloatArray:
    """The 58° arc of WS_S at 1155 m in true east and north of the mast base, its axis over the mast."""
    projection = Proj("EPSG:32632")
    lon, lat = projection(MAST[0], MAST[1], inverse=True)
    factors = projection.get_factors(lon, lat)
    turn = np.deg2rad(factors.meridian_convergence)
    east, north = (WS_S - MAST)[:2] / factors.meridional_scale
    head = np.array(
        [
            east * np.cos(turn) + north * np.sin(turn),
            north * np.cos(turn) - east * np.sin(turn),
            WS_S[2] - MAST[2],
        ]
    )
    axis = np.rad2deg(np.arctan2(-head[0], -head[1]))
    elevation = np.rad2deg(np.arctan2(CUP[0, 2] - head[2], np.hypot(head[0], head[1])))
    return arc_volume_m(head, [axis - 29.0, axis + 29.0], elevation, 1155.0, probe_m=probe_m)


def in_some_cone(
    directions: FloatArray, rotor: Rotors, points: FloatArray, decay: float, max_diameters: float
) -> BoolArray:
    """Second formula: is any point in the cone, direction by direction."""
    size = float(rotor.diameter_m[0])
    east, north, up = (points.reshape(-1, 3) - rotor.hub_m[0]).T
    hit = np.zeros(directions.size, dtype=np.bool_)
    for i, toward in enumerate(np.deg2rad(directions + 180.0)):
        downwind = east * np.sin(toward) + north * np.cos(toward)
        across_squared = (east * np.cos(toward) - north * np.sin(toward)) ** 2 + up**2
        inside = across_squared <= (size / 2 + decay * downwind) ** 2
        hit[i] = np.any(inside & (downwind > 0.0) & (downwind <= max_diameters * size))
    return hit


def in_some_sector(
    directions: FloatArray, rotor: Rotors, points: FloatArray, max_diameters: float
) -> BoolArray:
    """Second formula: is any bearing to the rotor within half a width of the direction."""
    size = float(rotor.diameter_m[0])
    east, north, _ = (rotor.hub_m[0] - points.reshape(-1, 3)).T
    distance = np.hypot(east, north)
    half = 0.5 * (1.3 * np.degrees(np.arctan(2.5 * size / distance + 0.15)) + 10.0)
    bearing = np.degrees(np.arctan2(east, north))
    near = distance <= max_diameters * size
    away = [np.abs((each - bearing + 180.0) % 360.0 - 180.0) for each in directions]
    return np.array([np.any(near & (turn <= half)) for turn in away])


def assert_same_edges(
    found: SectorSet, disturbed: Callable[[FloatArray], BoolArray], tolerance_deg: float
) -> None:
    """Just inside of each edge it is disturbed, just outside not; and no sector is missed or invented."""
    edges = np.array([edge for pair in found.pairs() for edge in pair])
    around = [edges - tolerance_deg, edges + tolerance_deg, np.arange(0.5, 360.0, 2.0)]
    directions = np.concatenate(around) % 360.0
    expected = found.contains(directions)
    near = (np.abs(difference_deg(directions[:, np.newaxis], edges)) < 0.999 * tolerance_deg).any(axis=1)
    wrong = (disturbed(directions) != expected) & ~near
    assert not wrong.any(), (directions[wrong], found.pairs())


@pytest.mark.parametrize(
    ("model", "volume_m", "first_deg", "last_deg", "tolerance_deg"),
    [
        pytest.param("jensen", CUP, 339.0, 21.0, 0.5, id="jensen-point"),
        pytest.param("jensen", hovsore_arc(), 275.0, 108.0, 1.0, id="jensen-arc"),
        pytest.param("iec", CUP, 317.0, 43.0, 0.5, id="iec-point"),
        pytest.param("iec", hovsore_arc(), 260.0, 125.0, 1.0, id="iec-arc"),
    ],
)
def test_hovsore_excluded_directions(
    model: str, volume_m: FloatArray, first_deg: float, last_deg: float, tolerance_deg: float
) -> None:
    """The four sectors that were worked out beforehand, printed in whole degrees."""
    sets = jensen_excluded(ROW, volume_m, decay=0.075) if model == "jensen" else iec_excluded(ROW, volume_m)
    pairs = any_of(sets).pairs()
    assert len(pairs) == 1
    assert abs(difference_deg(pairs[0][0], first_deg)) < tolerance_deg
    assert abs(difference_deg(pairs[0][1], last_deg)) < tolerance_deg


def test_hovsore_free_directions_beside_the_study() -> None:
    """The arc with its probe is free from about 109° to 274°; the study used 118-270°, inside of that."""
    free = any_of(jensen_excluded(ROW, hovsore_arc(probe_m=42.6), decay=0.075)).complement()
    assert len(free.sectors) == 1
    assert abs(free.sectors[0].from_deg - 109.0) < 1.5 and abs(free.sectors[0].to_deg - 274.0) < 1.5
    assert free.contains([118.0, 270.0]).all()


def test_each_stand_says_which_directions_it_takes() -> None:
    """Over the mast, the near stand takes the widest sector, and each is centred on north."""
    sets = jensen_excluded(ROW, CUP, decay=0.075)
    widths = [each.width_deg for each in sets]
    assert len(sets) == 4 and max(widths) == widths[0]
    assert all(abs(difference_deg(each.sectors[0].middle_deg, 0.0)) < 1e-6 for each in sets)


def test_too_near_for_iec_is_seen() -> None:
    """Stand 5 stands 1.64 diameters from the mast, under the 2 of the standard."""
    assert distance_over_diameter(ROW, CUP).round(2).tolist() == [1.64, 5.0, 6.27, 12.57]


@settings(derandomize=True, deadline=None, max_examples=25)
@given(
    east=st.floats(-1800, 1800),
    north=st.floats(-1800, 1800),
    height=st.floats(0, 320),
    decay=st.sampled_from([0.0, 0.04, 0.1]),
    max_diameters=st.sampled_from([5.0, 20.0]),
)
def test_jensen_point_is_exact(
    east: float, north: float, height: float, decay: float, max_diameters: float
) -> None:
    """The closed form for a point agrees with the direction scan, also past the end of the wake."""
    rotor = Rotors([[100.0, -50.0, 90.0]], 120.0, 0.8)
    point = np.array([[east, north, height]])
    found = jensen_excluded(rotor, point, decay=decay, max_diameters=max_diameters)[0]
    if found != SectorSet.full():
        scan = partial(in_some_cone, rotor=rotor, points=point, decay=decay, max_diameters=max_diameters)
        assert_same_edges(found, scan, 1e-6)


def fine(volume_m: FloatArray, times: int) -> FloatArray:
    """Fill a sheet (ray, along, 3) in between its samples by straight lines, so many times as dense."""
    for axis in (0, 1):
        size = volume_m.shape[axis]
        if size > 1:
            places = np.linspace(0, size - 1, times * (size - 1) + 1)
            low = np.minimum(places.astype(int), size - 2)
            part = np.expand_dims(places - low, [1 - axis, 2])
            volume_m = (1 - part) * volume_m.take(low, axis) + part * volume_m.take(low + 1, axis)
    return volume_m


SHEETS = {
    "arc past the rotor": arc_volume_m([-500.0, 40.0, 0.0], [70.0, 110.0], 8.0, 660.0, probe_m=40.0),
    "arc over the rotor": arc_volume_m([-500.0, 0.0, 0.0], [70.0, 110.0], 15.0, 500.0, probe_m=40.0),
    "arc grazed from below": arc_volume_m([0.0, -1200.0, 0.0], [-20.0, 20.0], 9.5, 900.0, probe_m=40.0),
    "arc at the wake's end": arc_volume_m([0.0, -1500.0, 0.0], [-30.0, 30.0], 3.0, 500.0, probe_m=60.0),
    "rhi": arc_volume_m([-300.0, -700.0, 0.0], 20.0, [2.0, 40.0], 650.0, probe_m=60.0),
    "stare": stare_volume_m([300.0, -900.0, 5.0], 330.0, 7.0, 700.0, probe_m=80.0),
}


@pytest.mark.parametrize("name", list(SHEETS))
@pytest.mark.parametrize("model", ["jensen", "iec"])
def test_volume_edges_against_brute_force(name: str, model: str) -> None:
    """A dense cloud of samples, scanned direction by direction, gives the same edges to 0.1°."""
    rotor = Rotors([[0.0, 0.0, 90.0]], 100.0, 0.8)
    dense = fine(SHEETS[name], 12)
    scan: Callable[[FloatArray], BoolArray]
    if model == "jensen":
        found = jensen_excluded(rotor, SHEETS[name], decay=0.075, max_diameters=10.0)[0]
        scan = partial(in_some_cone, rotor=rotor, points=dense, decay=0.075, max_diameters=10.0)
    else:
        found = iec_excluded(rotor, SHEETS[name], max_diameters=10.0)[0]
        scan = partial(in_some_sector, rotor=rotor, points=dense, max_diameters=10.0)
    assert found.sectors
    assert_same_edges(found, scan, 0.1)


def model_of(name: str) -> Callable[[Rotors, FloatArray], list[SectorSet]]:
    """One of the two models with its defaults, for the properties that both must have."""
    return partial(jensen_excluded, decay=0.075) if name == "jensen" else iec_excluded


@pytest.mark.parametrize("model", ["jensen", "iec"])
@settings(derandomize=True, deadline=None, max_examples=15)
@given(turn_deg=st.floats(0, 360), distance=st.floats(50, 1500))
def test_rotating_everything_rotates_the_sectors(model: str, turn_deg: float, distance: float) -> None:
    """Rotor and volume turned clockwise together turn every excluded direction by as much."""
    turn = np.deg2rad(turn_deg)
    matrix = np.array(
        [[np.cos(turn), -np.sin(turn), 0.0], [np.sin(turn), np.cos(turn), 0.0], [0.0, 0.0, 1.0]]
    )
    sheet = arc_volume_m([0.0, 0.0, 0.0], [-15.0, 15.0], 5.0, 800.0, probe_m=40.0)
    hub = np.array([[50.0, 800.0 + distance, 90.0]])
    plain = model_of(model)(Rotors(hub, 100.0, 0.8), sheet)[0]
    turned = model_of(model)(Rotors(hub @ matrix, 100.0, 0.8), sheet @ matrix)[0]
    assert len(plain.sectors) == len(turned.sectors) == 1
    assert abs(turned.width_deg - plain.width_deg) < 0.1
    shift = difference_deg(turned.sectors[0].middle_deg, plain.sectors[0].middle_deg + turn_deg)
    assert abs(float(shift)) < 0.1


@pytest.mark.parametrize("model", ["jensen", "iec"])
@settings(derandomize=True, deadline=None, max_examples=20)
@given(
    east=st.floats(-1000, 1000),
    north=st.floats(-1000, 1000),
    size=st.floats(20, 150),
    growth=st.floats(1.0, 2.0),
)
def test_bigger_rotor_never_excludes_less(
    model: str, east: float, north: float, size: float, growth: float
) -> None:
    """The sectors of a point under a rotor lie within those under a bigger one at the same hub."""
    point = np.array([[east, north, 60.0]])
    small, big = (
        model_of(model)(Rotors([[0.0, 0.0, 90.0]], d, 0.8), point)[0] for d in (size, size * growth)
    )
    assert small.difference(big).width_deg < 1e-6


@pytest.mark.parametrize("model", ["jensen", "iec"])
def test_volume_excludes_at_least_what_its_points_do(model: str) -> None:
    """A sheet that holds a point is disturbed whenever the point is."""
    sheet = SHEETS["arc past the rotor"]
    rotor = Rotors([[0.0, 0.0, 90.0]], 100.0, 0.8)
    whole, points = (model_of(model)(rotor, each)[0] for each in (sheet, sheet.reshape(-1, 3)))
    assert points.difference(whole).width_deg < 1e-6


def test_limits_of_a_point() -> None:
    """In the rotor: every direction; straight above the tip: none; beside the hub: half the circle."""
    rotor = Rotors([[0.0, 0.0, 90.0]], 100.0, 0.8)
    inside, above, beside = (
        jensen_excluded(rotor, np.array([point]))[0]
        for point in ([0.0, 0.0, 95.0], [0, 0, 150.0], [10.0, 0, 90.0])
    )
    assert inside == SectorSet.full()
    assert above == SectorSet.empty()
    assert beside.pairs() == [(180.0, 0.0)]
    assert iec_excluded(rotor, np.array([[0.0, 0.0, 0.0]]))[0] == SectorSet.full()


def test_a_volume_around_a_rotor_is_never_free() -> None:
    """A ring of samples with the rotor in the middle is in some wake whatever the wind."""
    ring = arc_volume_m([0.0, 0.0, 90.0], np.arange(0.0, 361.0, 30.0), 0.0, 300.0)
    rotor = Rotors([[0.0, 0.0, 90.0]], 100.0, 0.8)
    assert jensen_excluded(rotor, ring)[0] == SectorSet.full()
    assert iec_excluded(rotor, ring)[0] == SectorSet.full()


@pytest.mark.parametrize("volume", [np.empty((0, 3)), np.zeros(3), np.full((2, 3), np.nan)])
def test_bad_volumes_are_refused(volume: FloatArray) -> None:
    """Empty, flat or missing samples are named with what is allowed."""
    with pytest.raises(InputError, match="allowed are finite sample points"):
        jensen_excluded(ROW, volume)


def test_arc_crosses_north_the_shorter_way() -> None:
    """Rays at 350, 0 and 10° span 20°, not 340°."""
    sheet = arc_volume_m([0.0, 0.0, 0.0], [350.0, 0.0, 10.0], 0.0, 1000.0)
    assert sheet[:, :, 1].min() > 980.0
    step = np.linalg.norm(np.diff(sheet[:, 0], axis=0), axis=1)
    assert step.max() < 10.0 and step.sum() == pytest.approx(1000.0 * np.deg2rad(20.0), rel=1e-4)


@pytest.mark.parametrize(("range_m", "probe_m"), [(0.0, 10.0), (100.0, 201.0), (100.0, -1.0)])
def test_bad_gates_are_refused(range_m: float, probe_m: float) -> None:
    """A probe must not reach behind the head."""
    with pytest.raises(InputError, match="twice the range"):
        arc_volume_m([0.0, 0.0, 0.0], [0.0, 10.0], 5.0, range_m, probe_m=probe_m)


def test_bad_rays_are_refused() -> None:
    """A ray without a number is no ray."""
    with pytest.raises(InputError, match="rays of one scan"):
        arc_volume_m([0.0, 0.0, 0.0], [0.0, np.nan], 5.0, 100.0)
