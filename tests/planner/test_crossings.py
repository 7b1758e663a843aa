"""Beams of pairs: where they meet, at what angle, and what mis-pointing does to it."""

import itertools
import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from pyproj import Transformer

from planner.crossings import PairCrossing, beam_line
from planner.plan import Plan

Moor = Callable[..., Plan]


def mispointed(moor: Moor, azimuth_deg: float, elevation_deg: float) -> PairCrossing:
    """A's beam turned from where it should point (north, atan(100 / 1000.4) less the curved Earth)."""
    stare: dict[str, Any] = {"target": "T", "type": "stare", "accumulation_s": 0.5}
    head = {"azimuth_head_deg": azimuth_deg, "elevation_head_deg": 5.7061 + elevation_deg}
    scans = [{"name": "a", "lidar": "A", **stare, **head}, {"name": "b", "lidar": "B", **stare}]
    return moor(scans=scans).crossings[0]


def test_aimed_beams_meet_at_the_target(hovsore: Plan, kassel: Plan) -> None:
    """By whatever model of the Earth the plan takes: its tolerance is half a metre."""
    for met in (*hovsore.crossings, *kassel.crossings):
        assert met.gap_m < 0.5
        assert max(met.miss1_m, met.miss2_m) < 0.5
        assert met.off_target_m < 0.5 or met.folded_angle_deg < 10


def test_the_opening_angle_of_hovsore_is_63_degrees(hovsore: Plan) -> None:
    """Simon (2015), and the difference of the two grid azimuths: a conformal map keeps angles."""
    (met,) = hovsore.crossings
    rows = {row.lidar: row.azimuth_grid_deg for row in hovsore.pointings}
    assert met.opening_angle_deg == pytest.approx(rows["WS_W"] - rows["WS_K"], abs=0.002)
    assert round(met.opening_angle_deg) == 63


def test_the_first_crossing_of_kassel_is_at_63_1_degrees(kassel: Plan) -> None:
    """NEWA Kassel 2016: the angle of both beams in three dimensions."""
    assert kassel.crossings[0].angle_deg == pytest.approx(63.1, abs=0.06)


def test_the_last_crossing_of_kassel_is_4_degrees_from_the_baseline(kassel: Plan) -> None:
    """Angle at P4 in the triangle with WS7 and WS8, by the law of cosines on the map."""
    site = kassel.site
    points = [np.array(site.lidar(name).position[:2]) for name in ("WS7", "WS8")]
    target = np.array(site.target_position_m("P4")[:2])
    a, b, c = (math.dist(*pair) for pair in itertools.combinations([*points, target], 2))
    expected = math.degrees(math.acos((b**2 + c**2 - a**2) / (2 * b * c)))
    met = kassel.crossings[-1]
    assert met.opening_angle_deg == pytest.approx(expected, abs=0.01)
    assert met.folded_angle_deg == pytest.approx(180 - expected, abs=0.01)
    assert 3 < met.folded_angle_deg < 4.5


def test_a_beam_that_is_too_high_misses_in_height(moor: Moor) -> None:
    """Half a degree at 1005 m is 8.8 m."""
    met = mispointed(moor, 0.0, 0.5)
    assert met.gap_m == pytest.approx(math.radians(0.5) * 1005.4, rel=0.02)
    assert abs(met.height_difference_m) == pytest.approx(met.gap_m, rel=0.02)
    assert met.worst_aimed == ("A", pytest.approx(math.radians(0.5) * 1005.4, rel=0.01))
    assert met.miss2_m < 0.01
    assert met.shared_probe_m < mispointed(moor, 0.0, 0.1).shared_probe_m


def test_a_beam_that_is_turned_meets_the_other_beside_the_target(moor: Moor) -> None:
    """In plan two beams always meet: the gap alone would not show a degree of azimuth, 17.5 m."""
    met = mispointed(moor, 1.0, 0.0)
    assert met.gap_m < 3.0
    assert met.off_target_m == pytest.approx(math.radians(1.0) * 1000.4, rel=0.02)


def test_gap_and_miss_agree_with_earth_centred_coordinates(moor: Moor) -> None:
    """PROJ's topocentric frames, points every 0.1 m along both beams: the smallest distance."""
    stare: dict[str, Any] = {"target": "T", "type": "stare", "accumulation_s": 0.5}
    head = {"azimuth_head_deg": 0.4, "elevation_head_deg": 6.2}
    scans = [{"name": "a", "lidar": "A", **stare, **head}, {"name": "b", "lidar": "B", **stare}]
    plan = moor(scans=scans, fidelity="all")
    met = plan.crossings[0]
    to_degrees = Transformer.from_crs("EPSG:32632", "EPSG:4326", always_xy=True)
    lines = []
    for layout in plan.layouts:
        longitude, latitude = to_degrees.transform(*layout.lidar.position[:2])
        place = f"+lon_0={longitude} +lat_0={latitude} +h_0={layout.lidar.position[2]}"
        frame = f"+proj=topocentric +ellps=WGS84 {place}"
        azimuth, elevation = np.deg2rad([layout.axis_azimuth_deg, layout.axis_elevation_deg])
        reach = np.arange(985.0, 1025.0, 0.1)
        enu = reach * np.array(
            [
                [np.sin(azimuth) * np.cos(elevation)],
                [np.cos(azimuth) * np.cos(elevation)],
                [np.sin(elevation)],
            ]
        )
        ecef = Transformer.from_pipeline(frame).transform(*enu, direction="INVERSE")
        lines.append(np.stack(ecef, axis=-1))
    apart = np.linalg.norm(lines[0][:, None] - lines[1][None], axis=-1)
    assert met.gap_m == pytest.approx(apart.min(), abs=0.01)


def lidars_at(*east_m: float) -> list[dict[str, Any]]:
    """Lidars A, B, ... 1 km south of the target, so far to the east."""
    return [
        {"name": name, "position": [500000 + east, 6250000, 10], "instrument": "windscanner-200s"}
        for name, east in zip("ABC", east_m, strict=False)
    ]


def test_three_scans_make_three_pairs_of_beams(moor: Moor) -> None:
    stare: dict[str, Any] = {"target": "T", "type": "stare", "accumulation_s": 0.5}
    scans = [{**stare, "name": name, "lidar": name.upper()} for name in "abc"]
    met = moor(
        lidars=lidars_at(0, 500, 1000),
        scans=scans,
        pairs=[{"name": "three", "scans": list("abc"), "target": "T"}],
    ).crossings
    assert [(item.scan1, item.scan2) for item in met] == [("a", "b"), ("a", "c"), ("b", "c")]


def test_beams_in_one_line_have_no_point_but_a_distance(moor: Moor) -> None:
    """Two lidars in one place and one target: parallel, gap 0, nowhere."""
    stare: dict[str, Any] = {"target": "T", "type": "stare", "accumulation_s": 0.5}
    scans = [{**stare, "name": name, "lidar": name.upper()} for name in "ab"]
    (met,) = moor(lidars=lidars_at(0, 0), scans=scans).crossings
    assert (met.angle_deg, met.gap_m) == pytest.approx((0.0, 0.0), abs=1e-6)
    assert math.isnan(met.range1_m)


def test_a_point_of_a_list_crosses_with_its_own_ray(moor: Moor) -> None:
    """The second point of a list is not where the list begins."""
    targets = [
        {"name": "U", "position": [503000, 6250000, 110]},
        {"name": "T", "position": [500000, 6251000, 110]},
    ]
    scans = [
        {"name": "a", "lidar": "A", "type": "points", "targets": ["U", "T"], "accumulation_s": 0.5},
        {"name": "b", "lidar": "B", "target": "T", "type": "stare", "accumulation_s": 0.5},
    ]
    plan = moor(targets=targets, scans=scans)
    assert plan.crossings[0].off_target_m < 0.5
    head, beam = beam_line(plan.places, plan.layout["a"], "T")
    assert beam[:2] == pytest.approx([0.0, math.cos(math.radians(5.706))], abs=1e-3)
    assert np.linalg.norm(beam) == pytest.approx(1.0)
    assert head == pytest.approx(plan.places.local_m((500000, 6250000, 10)), abs=1e-3)
