"""Pointing against the geodesic inverse and the published angles."""

import math
from collections.abc import Callable

import pytest
from pyproj import Geod, Transformer

from geometry.errors import InputError
from planner.plan import Plan
from planner.pointing import Pointing, point

ELLIPSOIDS = {"EPSG:32632": ("WGS84", "EPSG:4326"), "EPSG:25832": ("GRS80", "EPSG:4258")}


@pytest.fixture(params=["hovsore", "kassel"])
def example(request: pytest.FixtureRequest) -> Plan:
    plan = request.getfixturevalue(request.param)
    assert isinstance(plan, Plan)
    return plan


def geodesic(plan: Plan, row: Pointing) -> tuple[float, float, float]:
    """Azimuth, elevation [deg] and slant range [m] from a geodesic and two heights.

    Over a distance s the ellipsoid is a sphere of its mean radius there: both heads stand on radii that open
    by c = s / R, and the law of cosines gives the chord.
    """
    ellipsoid, degrees = ELLIPSOIDS[plan.site.crs]
    geod, to_degrees = Geod(ellps=ellipsoid), Transformer.from_crs(plan.site.crs, degrees, always_xy=True)
    here, there = plan.site.lidar(row.lidar).position, plan.site.target_position_m(row.target)
    azimuth_deg, _, along_m = geod.inv(*to_degrees.transform(*here[:2]), *to_degrees.transform(*there[:2]))
    radius_m = math.sqrt(geod.a * geod.b)
    low, high, c = radius_m + here[2], radius_m + there[2], along_m / radius_m
    range_m = math.sqrt((high - low) ** 2 + 4 * low * high * math.sin(c / 2) ** 2)
    elevation_deg = math.degrees(math.atan2(high * math.cos(c) - low, high * math.sin(c)))
    return azimuth_deg % 360, elevation_deg, range_m


def test_every_beam_agrees_with_the_geodesic_inverse(example: Plan) -> None:
    """Azimuths to 0.001°, elevations to 0.001°, slant ranges to 1 cm, at both sites."""
    assert len(example.pointings) == len(example.site.lidars) * len(example.site.targets)
    for row in example.pointings:
        azimuth_deg, elevation_deg, range_m = geodesic(example, row)
        assert row.azimuth_true_deg == pytest.approx(azimuth_deg, abs=0.001)
        assert row.elevation_deg == pytest.approx(elevation_deg, abs=0.001)
        assert row.range_m == pytest.approx(range_m, abs=0.01)


def test_grid_azimuths_are_those_of_the_coordinates(example: Plan) -> None:
    """The straight line on the map; beam and map differ by the arc-to-chord correction, under 0.001° here."""
    for row in example.pointings:
        here, there = example.site.lidar(row.lidar).position, example.site.target_position_m(row.target)
        chart_deg = math.degrees(math.atan2(there[0] - here[0], there[1] - here[1])) % 360
        assert row.azimuth_grid_deg == pytest.approx(chart_deg, abs=0.001)
        assert row.azimuth_true_deg == pytest.approx(row.azimuth_grid_deg + row.convergence_deg)


def test_published_angles_of_kassel(kassel: Plan) -> None:
    """NEWA Kassel 2016, heads at grid north, flat geometry: azimuth 79.26, 142.47, elevation 3.00, 2.83."""
    rows = {(row.lidar, row.target): row for row in kassel.pointings}
    for lidar, azimuth_deg, elevation_deg, grid_m in (
        ("WS4", 79.26, 3.00, 1426.3),
        ("WS5", 142.47, 2.83, 1712.3),
    ):
        row = rows[lidar, "P1"]
        assert row.azimuth_head_deg == pytest.approx(azimuth_deg, abs=0.006)
        assert row.elevation_head_deg == pytest.approx(elevation_deg, abs=0.02)  # the Earth is not flat
        here, there = kassel.site.lidar(lidar).position, kassel.site.target_position_m("P1")
        assert math.dist(here, there) == pytest.approx(grid_m, abs=0.08)
        assert row.range_m == pytest.approx(grid_m / 0.9996, abs=0.2)  # the scale of the central meridian


def test_published_angles_of_hovsore(hovsore: Plan) -> None:
    """Convergence -0.690°, grid azimuth 233.091°, geodesic azimuth 232.400° at WS_W; ground distances."""
    rows = {row.lidar: row for row in hovsore.pointings}
    whittle = rows["WS_W"]
    assert whittle.convergence_deg == pytest.approx(-0.690, abs=0.0005)
    assert whittle.azimuth_grid_deg == pytest.approx(233.091, abs=0.0006)
    assert whittle.azimuth_true_deg == pytest.approx(232.400, abs=0.0006)
    for name, ground_m in (("WS_K", 1123.18), ("WS_S", 1149.56), ("WS_W", 1614.34)):
        row = rows[name]
        assert row.range_m * math.cos(math.radians(row.elevation_deg)) == pytest.approx(ground_m, abs=0.05)


@pytest.mark.parametrize(
    ("name", "azimuth_offset_deg", "elevation_offset_deg", "head_elevation_deg"),
    [("WS_K", 3.46, 0.78, 5.32), ("WS_S", 12.31, 0.6, 5.36), ("WS_W", 2.82, 1.15, 3.1)],
)
def test_head_angles_are_pointing_angles_less_the_offsets(
    hovsore: Plan,
    name: str,
    azimuth_offset_deg: float,
    elevation_offset_deg: float,
    head_elevation_deg: float,
) -> None:
    """Simon (2015) lists the head elevations; the beams were aimed a few metres above the cup."""
    row = next(row for row in hovsore.pointings if row.lidar == name)
    assert row.azimuth_head_deg == pytest.approx(row.azimuth_true_deg - azimuth_offset_deg)
    assert row.elevation_head_deg == pytest.approx(row.elevation_deg - elevation_offset_deg)
    assert row.elevation_head_deg == pytest.approx(head_elevation_deg, abs=0.05)


def test_refraction_is_beside_the_elevation_not_inside(hovsore: Plan) -> None:
    """k d² / 2R over d: 0.13 · 1619 m / (2 · 6.37e6 m) is 0.0009°."""
    row = next(row for row in hovsore.pointings if row.lidar == "WS_W")
    assert row.refraction_deg == pytest.approx(math.degrees(0.13 * 1619 / (2 * 6.37e6)), rel=0.01)


def test_gates_are_named_where_the_lidar_scans(hovsore: Plan, kassel: Plan) -> None:
    assert [(row.gate_index, row.gate_centre_m) for row in hovsore.pointings] == [
        (20, 1135),
        (20, 1166),
        (20, 1625),
    ]
    assert {row.gate_index for row in kassel.pointings} == {None}
    assert [row.scan for row in kassel.pointings][:4] == ["WS4 P1", "WS4 P2", None, None]


def test_a_site_without_targets_points_nowhere(moor: Callable[..., Plan]) -> None:
    with pytest.raises(InputError, match="2 lidars and 0 targets"):
        _ = moor(targets=[], scans=[], pairs=[]).pointings


def test_straight_up_and_on_the_spot(moor: Callable[..., Plan]) -> None:
    """Above the head the azimuth is 0; at the head itself all three are."""
    targets = [
        {"name": "up", "position": [500000, 6250000, 260]},
        {"name": "here", "position": [500000, 6250000, 10]},
    ]
    plan = moor(targets=targets, scans=[], pairs=[])
    up, here = (point(plan.places, plan.site.lidars[0], name, None) for name in ("up", "here"))
    assert (up.elevation_deg, up.range_m) == pytest.approx((90.0, 250.0))
    assert here.range_m == pytest.approx(0.0, abs=1e-6)
    assert here.refraction_deg == pytest.approx(0.0, abs=1e-9)


def test_a_gate_is_named_only_for_a_target_inside_it(moor: Callable[..., Plan]) -> None:
    """Gates each 50 m from 500 m on, the last at 950: the target at 1005 m is beyond half a spacing from it."""
    target = [{"name": "T", "position": [500000, 6251000, 110]}]
    for count, centre_m in ((10, None), (11, 1000.0)):
        gates = {"first_m": 500, "spacing_m": 50, "count": count}
        stare = {"name": "a", "lidar": "A", "target": "T", "type": "stare", "accumulation_s": 0.5}
        plan = moor(targets=target, scans=[{**stare, "gates": gates}], pairs=[])
        row = plan.pointings[0]
        assert (row.gate_index, row.gate_centre_m) == (None if centre_m is None else 10, centre_m)
