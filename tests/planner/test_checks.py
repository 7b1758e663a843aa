"""Every check from both sides of its limit, what it says, and that the list of codes is complete."""

import ast
import json
import math
import re
from collections.abc import Callable
from copy import deepcopy
from pathlib import Path
from types import SimpleNamespace
from typing import Any, NamedTuple, cast

import pytest
from pyproj import Transformer

from planner.checks import crossing, findings
from planner.finding import Finding
from planner.plan import Plan

ROOT = Path(__file__).resolve().parents[2]
Moor = Callable[..., Plan]
Changes = dict[str, Any]

LIDAR_A = {"name": "A", "position": [500000, 6250000, 10]}
LIDAR_B = {"name": "B", "position": [501000, 6251000, 10]}
TARGET = {"name": "T", "position": [500000, 6251000, 110]}
DOWN_DEG = 0.0045 / 2  # half of what the Earth falls away over 1 km, as an angle at the lidar
ELEVATION_DEG = math.degrees(math.atan(100 / 1000.4)) - DOWN_DEG


class Case(NamedTuple):
    """One limit: the code, its severity beyond the limit, the site on this and on that side of it."""

    code: str
    severity: str
    good: Changes
    bad: Changes


def instrument(**numbers: Any) -> Changes:
    """Both lidars with another number in their instrument (see conftest)."""
    return {"instrument": numbers}


def scan(**fields: Any) -> Changes:
    """One stare of A with other fields."""
    stare = {"name": "a", "lidar": "A", "target": "T", "type": "stare", "accumulation_s": 0.5}
    return {"scans": [{**stare, **fields}], "pairs": []}


def sector(**fields: Any) -> Changes:
    return scan(**{"type": "sector", "sector_deg": 60, "step_deg": 2, "accumulation_s": 0.4, **fields})


def gates(first_m: float, count: int = 1) -> Changes:
    return scan(gates={"first_m": first_m, "spacing_m": 10, "count": count})


def opening(angle_deg: float) -> Changes:
    """B at 1 km from the target, at an angle from A as seen from there."""
    turn = math.radians(180 - angle_deg)
    east, north = 500000 + 1000 * math.sin(turn), 6251000 + 1000 * math.cos(turn)
    return {"lidars": [LIDAR_A, {**LIDAR_B, "position": [east, north, 10]}]}


def triple(elevation_deg: float) -> Changes:
    """Three lidars around the target, 120 degrees apart: noise comes out 1/(sqrt(3) sin φ) times as large in w."""
    away = 100 / math.tan(math.radians(elevation_deg))
    lidars, stares = [], []
    for name, bearing_deg in (("A", 180.0), ("B", 300.0), ("C", 60.0)):
        turn = math.radians(bearing_deg)
        east, north = 500000 + away * math.sin(turn), 6251000 + away * math.cos(turn)
        lidars.append({**LIDAR_A, "name": name, "position": [east, north, 10]})
        stares.append(
            {"name": name.lower(), "lidar": name, "target": "T", "type": "stare", "accumulation_s": 0.5}
        )
    pairs = [{"name": "triple", "scans": ["a", "b", "c"], "target": "T"}]
    return {"lidars": lidars, "scans": stares, "pairs": pairs}


def aimed(azimuth_deg: float = 0.0, elevation_deg: float = 0.0) -> Changes:
    """A's head turned away from the target."""
    head = {"azimuth_head_deg": azimuth_deg, "elevation_head_deg": ELEVATION_DEG + elevation_deg}
    stare = {"name": "a", "lidar": "A", "target": "T", "type": "stare", "accumulation_s": 0.5}
    return {"scans": [{**stare, **head}, {**stare, "name": "b", "lidar": "B"}]}


def aimed_sector(azimuth_deg: float, elevation_deg: float = 0.0) -> Changes:
    """A sector of 60° around an axis turned away from the target."""
    return sector(azimuth_head_deg=azimuth_deg, elevation_head_deg=ELEVATION_DEG + elevation_deg)


def ground_stare(elevation_deg: float) -> Changes:
    """A head 20 m above the ground, a gate at 979 m: with half a probe it wants to see 1000 m."""
    lidar = {**LIDAR_A, "position": [500000, 6250000, 30]}
    head = {"azimuth_head_deg": 0, "elevation_head_deg": elevation_deg, "target": None}
    return {"lidars": [lidar], **scan(**head, gates={"first_m": 979, "spacing_m": 10, "count": 1})}


def mast(east_m: float) -> Changes:
    """A mast half way to the target, 1 m wide, beside the beam."""
    return {
        "masts": [{"name": "M", "position": [500000 + east_m, 6250500, 10], "height_m": 100}],
        **scan(),
    }


def turbine(
    east_m: float, north_m: float, *, rotor_m: float = 100.0, wind: Changes | None = None, **wakes: Any
) -> Changes:
    """A turbine at a place relative to the target, and a stare of A."""
    position = [500000 + east_m, 6251000 + north_m, 10]
    stand = {"name": "W", "position": position, "hub_height_m": 90, "rotor_diameter_m": rotor_m}
    return {"turbines": [stand], "wakes": wakes, "wind": wind, **scan()}


def wanted(start_deg: float, stop_deg: float) -> Changes:
    return {"directions_deg": [[start_deg, stop_deg]], "speed_range_mps": [4, 20]}


def speeds(fastest_mps: float, intensity: float | None = None) -> Changes:
    wind: Changes = {"speed_range_mps": [4, fastest_mps]}
    if intensity is not None:
        wind["turbulence"] = {"intensity": intensity, "length_m": 100}
    return {"wind": wind}


def at_longitude(longitude_deg: float, crs: str, latitude_deg: float = 57.0) -> Changes:
    """Lidar and target 1 km apart, the lidar at a longitude."""
    east, north = Transformer.from_crs("EPSG:4326", crs, always_xy=True).transform(
        longitude_deg, latitude_deg
    )
    return {
        "crs": crs,
        "lidars": [{**LIDAR_A, "position": [east, north, 10]}],
        "targets": [{"name": "T", "position": [east, north + 1000, 110]}],
        **scan(),
    }


def foot(height_m: float) -> Changes:
    """A mast far from all beams, its foot at this height."""
    away = {"name": "M", "position": [499000, 6249000, height_m], "height_m": 5, "width_m": 0.2}
    return {"masts": [away]}


def second_lidar(east_m: float) -> Changes:
    return {"lidars": [LIDAR_A, {**LIDAR_B, "position": [500000 + east_m, 6250000, 10]}], **scan()}


def second_target(east_m: float) -> Changes:
    return {"targets": [TARGET, {"name": "U", "position": [500000 + east_m, 6251000, 110]}]}


def synchronised(accumulation_s: float) -> Changes:
    stares = [
        {"name": name, "lidar": lidar, "target": "T", "type": "stare", "accumulation_s": seconds}
        for name, lidar, seconds in (("a", "A", 0.5), ("b", "B", accumulation_s))
    ]
    pair = {"name": "dual", "scans": ["a", "b"], "target": "T", "synchronised": True}
    return {"scans": stares, "pairs": [pair]}


# The range of the target is 1005.4 m: hypot(1000 / 0.9996, 100), less than 1 cm by the curved Earth.
CASES = (
    Case("range-blind", "error", instrument(min_range_m=1005), instrument(min_range_m=1006)),
    Case("range-max", "error", instrument(max_range_m=1006), instrument(max_range_m=1005)),
    Case(
        "range-ambiguous",  # 299792458 / (2 · 149000) = 1006.0 m, / (2 · 149150) = 1005.0 m
        "error",
        instrument(pulses=[{"pulse_ns": 200, "pulse_repetition_hz": 149000}]),
        instrument(pulses=[{"pulse_ns": 200, "pulse_repetition_hz": 149150}]),
    ),
    Case("range-ambiguous", "error", gates(1000, 640), gates(1000, 651)),  # 20 kHz: 7494.8 m
    Case("pulse-unknown", "warning", scan(pulse_ns=200), scan(pulse_ns=250)),
    Case("gate-missing", "error", gates(1000.9), gates(1000.0)),
    Case("gate-offset", "info", gates(1003.4), gates(1002.4)),
    Case("gate-offset", "info", gates(1007.4), gates(1008.4)),
    Case("gate-count", "error", gates(1000, 500), gates(1000, 501)),
    Case("elevation-limit", "error", instrument(elevation_max_deg=5.72), instrument(elevation_max_deg=5.69)),
    Case("elevation-limit", "error", instrument(elevation_min_deg=5.69), instrument(elevation_min_deg=5.72)),
    Case(
        "elevation-limit",  # over the top
        "error",
        scan(type="rhi", elevation_from_deg=10, elevation_to_deg=180, step_deg=2)
        | {"lidar": {"elevation_offset_deg": -9.9}},
        scan(type="rhi", elevation_from_deg=10, elevation_to_deg=180, step_deg=2)
        | {"lidar": {"elevation_offset_deg": -10.1}},
    ),
    Case(
        "vertical-wind",  # tan φ is 0.0999, the tolerance 0.05 m/s
        "warning",
        {"wind": {"vertical_mps": -0.49}},
        {"wind": {"vertical_mps": -0.51}},
    ),
    Case("aim", "warning", aimed(elevation_deg=0.09), aimed(elevation_deg=0.11)),
    Case("aim", "error", aimed(azimuth_deg=2.3), aimed(azimuth_deg=2.6)),  # the probe, 42.6 m, is 2.43°
    Case("aim", "error", aimed_sector(29.9), aimed_sector(30.1)),
    Case("aim", "error", aimed_sector(0.0, 2.3), aimed_sector(20.0, 2.6)),
    Case("opening-angle", "warning", opening(30.1), opening(29.9)),
    Case("opening-angle", "warning", opening(149.9), opening(150.1)),
    Case("crossing-gap", "warning", aimed(elevation_deg=0.02), aimed(elevation_deg=0.05)),  # 17.5 m a degree
    Case("crossing-target", "warning", aimed(azimuth_deg=0.02), aimed(azimuth_deg=0.05)),
    Case("vertical-noise", "warning", triple(6.7), triple(6.5)),  # 5 at 6.63°
    Case("vertical-noise", "error", triple(1.7), triple(1.62)),  # 20 at 1.65°
    Case("pair-period", "warning", synchronised(0.54), synchronised(0.56)),
    Case("beam-blocked", "error", mast(0.6), mast(0.4)),
    Case("beam-near", "info", mast(2.0), mast(0.6)),  # margin 1.25 m: 2·hypot(0.1, 0.0707° at 500 m)
    Case("beam-blocked", "warning", turbine(31, -500), turbine(29, -500)),  # 60 m high: 40 under the hub
    Case("beam-blocked", "error", turbine(2.3, -500, rotor_m=10), turbine(1.9, -500, rotor_m=10)),
    Case("induction", "warning", turbine(251, 0), turbine(249, 0)),
    Case("iec-range", "info", turbine(201, 0), turbine(199, 0)),
    Case("iec-range", "info", turbine(1999, 0, max_diameters=30), turbine(2000, 0, max_diameters=30)),
    Case(
        "wake",  # IEC at ten diameters: 38.34° about north at the target, a degree more over the probe
        "warning",
        turbine(0, 1000, model="iec", wind=wanted(21, 180)),
        turbine(0, 1000, model="iec", wind=wanted(19, 180)),
    ),
    Case("wake", "error", turbine(0, 1000, wind=wanted(90, 180)), turbine(0, 1000, wind=wanted(355, 5))),
    Case("accumulation", "error", scan(accumulation_s=0.1), scan(accumulation_s=0.09)),
    Case("head-speed", "error", sector(accumulation_s=0.0401), sector(accumulation_s=0.039)),
    Case("period-declared", "warning", sector(period_s=12.1), sector(period_s=12.0)),
    Case("period-declared", "error", sector(period_s=12.06), sector(period_s=11.9)),
    Case("period-declared", "info", sector(period_s=12.14), sector(period_s=12.2)),
    Case("scan-count", "warning", sector(period_s=50), sector(period_s=50.1)),
    Case("radial-speed", "warning", speeds(30), speeds(30.1)),
    Case("radial-speed", "warning", speeds(23, 0.1), speeds(23.1, 0.1)),
    Case("sector-axis", "info", sector() | {"wind": wanted(34, 54)}, sector() | {"wind": wanted(36, 56)}),
    Case("sector-axis", "info", sector() | {"wind": wanted(126, 146)}, sector() | {"wind": wanted(124, 144)}),
    Case("crs-area", "warning", at_longitude(11.99, "EPSG:32632"), at_longitude(12.01, "EPSG:32632")),
    Case("central-meridian", "warning", at_longitude(18.49, "EPSG:3006"), at_longitude(18.51, "EPSG:3006")),
    Case("same-place", "warning", second_lidar(1.01), second_lidar(0.99)),
    Case("same-place", "warning", second_target(1.01), second_target(0.99)),
    Case("head-height", "warning", {"ground_height_m": 11.9}, {"ground_height_m": 12.1}),
    Case("base-height", "info", foot(59.9), foot(60.1)),  # level ground at 10 m, 50 m either way
    Case("base-height", "info", foot(-39.9), foot(-40.1)),
    Case("beam-blocked", "error", ground_stare(-1.1), ground_stare(-1.2)),  # 20 m over 1 km is 1.15°
    Case("target-height", "error", {"ground_height_m": 109.9}, {"ground_height_m": 110.0}),
    Case("head-unknown", "info", instrument(), instrument(head=None)),
    Case("limits-unknown", "info", instrument(), instrument(max_range_m=None)),
)


def plan_of(moor: Moor, changes: Changes) -> Plan:
    """The small site with changes; `instrument` and `lidar` change every lidar."""
    plan = moor().site
    known = plan.lidars[0].device.model_dump(exclude={"sources"})
    changes = deepcopy(changes)
    numbers, extra = changes.pop("instrument", {}), changes.pop("lidar", {})
    head = {
        **known["head"],
        **{key: numbers.pop(key) for key in list(numbers) if key.startswith("elevation_m")},
    }
    device = {**known, "head": head, **numbers}
    lidars = changes.pop("lidars", [LIDAR_A, LIDAR_B])
    return moor(lidars=[{**lidar, "instrument": device, **extra} for lidar in lidars], **changes)


def found(moor: Moor, changes: Changes, code: str) -> list[Finding]:
    return [finding for finding in findings(plan_of(moor, changes)) if finding.code == code]


@pytest.mark.parametrize("case", CASES, ids=lambda case: f"{case.code}-{case.severity}")
def test_a_limit_is_seen_from_both_sides(moor: Moor, case: Case) -> None:
    """On this side nothing of that code and severity, on the other a finding with all that it must say."""
    assert case.severity not in [finding.severity for finding in found(moor, case.good, case.code)]
    (finding,) = [each for each in found(moor, case.bad, case.code) if each.severity == case.severity][:1]
    assert finding.subject
    assert finding.unit
    assert finding.value is not None or finding.code in ("head-unknown", "pulse-unknown")
    assert (finding.limit is not None) or finding.code in ("head-unknown", "pulse-unknown")
    assert len(finding.text) > 60  # value, limit and what to do, in words
    assert "nan" not in finding.text.lower().split()
    assert re.search(r"\d\.\d{4}", finding.text) is None  # no number with more digits than it deserves
    json.dumps(finding._asdict(), allow_nan=False)


def test_the_small_site_itself_is_clean(moor: Moor) -> None:
    assert findings(moor()) == []


def codes_in_the_code() -> set[str]:
    """The second argument of every Finding(...) in planner/checks."""
    codes = set()
    for path in (ROOT / "planner" / "checks").glob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "Finding":
                code = node.args[1]
                assert isinstance(code, ast.Constant), f"{path.name}: a code has to be written out"
                codes.add(str(code.value))
    return codes


def test_docs_list_the_same_codes_as_the_checks() -> None:
    text = (ROOT / "docs" / "findings.md").read_text(encoding="utf-8")
    assert set(re.findall(r"^\| `([a-z-]+)` \|", text, flags=re.MULTILINE)) == codes_in_the_code()


def test_every_code_is_tested_from_both_sides() -> None:
    with_a_raster = {"terrain-unknown"}  # in test_over_terrain; of head-height and base-height one limit more
    assert {case.code for case in CASES} | with_a_raster == codes_in_the_code()


def test_errors_come_first(hovsore: Plan) -> None:
    ranks = [("error", "warning", "info").index(finding.severity) for finding in findings(hovsore)]
    assert ranks == sorted(ranks)


@pytest.mark.parametrize(
    ("angle_deg", "severity"),
    [(10.1, "warning"), (9.9, "error"), (169.9, "warning"), (170.1, "error"), (63.0, None), (117.0, None)],
)
def test_opening_angles_are_told_unfolded(moor: Moor, angle_deg: float, severity: str | None) -> None:
    """60 and 120 degrees are different geometries: the value is the unfolded angle."""
    seen = found(moor, opening(angle_deg), "opening-angle")
    assert [finding.severity for finding in seen] == ([severity] if severity else [])
    assert all(finding.value == pytest.approx(angle_deg, abs=0.02) for finding in seen)
    assert all(finding.limit == (10 if angle_deg < 90 else 170) for finding in seen if severity == "error")


@pytest.mark.parametrize("code", ["crossing-gap", "crossing-target"])
def test_beams_that_pass_by_more_than_a_probe_are_an_error(moor: Moor, code: str) -> None:
    """The probe of 200 ns and 64 points is 42.6 m; a degree at 1 km is 17.5 m."""
    key = "elevation_deg" if code == "crossing-gap" else "azimuth_deg"
    (warned,) = found(moor, aimed(**{key: 2.3}), code)
    (refused,) = found(moor, aimed(**{key: 2.6}), code)
    assert (warned.severity, warned.limit) == ("warning", 0.5)
    assert (refused.severity, round(refused.limit or 0.0, 1)) == ("error", 42.6)
    assert refused.value == pytest.approx(math.radians(2.6) * 1005.4, rel=0.02)
    assert "pointing of A" in refused.text


def test_a_vertical_beam_has_no_opening_angle_in_plan(moor: Moor) -> None:
    changes = {"lidars": [LIDAR_A, {**LIDAR_B, "position": [500000, 6251000, 10]}]}
    plan = plan_of(moor, changes)
    met = plan.crossings[0]._replace(opening_angle_deg=math.nan, folded_angle_deg=math.nan)
    (finding,) = crossing.find(cast("Plan", SimpleNamespace(site=plan.site, crossings=(met,))))
    assert (finding.severity, finding.code, finding.value) == ("error", "opening-angle", None)
    assert "vertical" in finding.text
    json.dumps(finding._asdict(), allow_nan=False)


def test_a_third_beam_makes_up_for_two_that_are_alike(moor: Moor) -> None:
    """Two lidars 5 degrees apart and a third across: no error, but the pair of the two is told."""
    beside = {"name": "C", "position": [500087, 6250004, 10]}
    stares = [
        {"name": name.lower(), "lidar": name, "target": "T", "type": "stare", "accumulation_s": 0.5}
        for name in "ABC"
    ]
    changes = {
        "lidars": [LIDAR_A, LIDAR_B, beside],
        "scans": stares,
        "pairs": [{"name": "triple", "scans": ["a", "b", "c"], "target": "T"}],
    }
    (finding,) = found(moor, changes, "opening-angle")
    assert finding.severity == "info"
    assert "A and C" in finding.text


@pytest.mark.parametrize(("bearing_deg", "number"), [(11.0, 21), (-29.0, 1), (29.0, 30), (1.0, 16)])
def test_which_rays_of_a_sector_are_lost(moor: Moor, bearing_deg: float, number: int) -> None:
    """A 4 m tower at 500 m spans half a degree: one ray of 2°, the one whose sweep holds its bearing."""
    turn = math.radians(bearing_deg)
    position = [500000 + 500 * math.sin(turn), 6250000 + 500 * math.cos(turn), 10]
    stand = {"name": "W", "position": position, "hub_height_m": 100, "rotor_diameter_m": 1}
    (finding,) = found(moor, sector() | {"turbines": [stand], "wakes": {"model": "jensen"}}, "beam-blocked")
    assert (
        f"1 of 30 rays (number {number}, azimuth {bearing_deg % 360:.1f}°) is lost to the tower"
        in finding.text
    )
    assert finding.severity == "warning"


def test_a_rotor_in_the_way_of_every_ray_is_a_warning(moor: Moor) -> None:
    """It turns with the wind: a tower stands still, a rotor does not."""
    severities = {finding.severity for finding in found(moor, turbine(29, -500), "beam-blocked")}
    assert severities == {"warning"}


def test_a_raster_is_meant_to_hit_its_hard_target(moor: Moor) -> None:
    """No blocked beam, no wake and no number of scans for a map of a mast."""
    raster = {
        **{"name": "map", "lidar": "A", "hard_target": "tip", "type": "raster", "accumulation_s": 0.5},
        **{"width_deg": 1.0, "height_deg": 1.0, "step_deg": 0.05, "pulse_ns": 200},
    }
    changes = {
        "masts": [{"name": "M", "position": [500000, 6250800, 10], "height_m": 80}],
        "hard_targets": [{"name": "tip", "on": "M", "shape": "tip", "size_m": 0.2, "uncertainty_m": 1}],
        **{"scans": [raster], "pairs": []},
    }
    plan = plan_of(moor, changes)
    assert plan.layouts[0].scan.count == 21 * 21
    assert findings(plan) == []
    assert plan.exclusions == ()


def test_hovsore_opens_by_63_degrees_without_a_finding(hovsore: Plan) -> None:
    """Simon (2015): opening angle of K and W 63 degrees."""
    (met,) = hovsore.crossings
    assert round(met.opening_angle_deg) == 63
    assert not [finding for finding in findings(hovsore) if finding.code in ("opening-angle", "crossing-gap")]


def test_hovsore_beams_past_stand_5_are_found(hovsore: Plan) -> None:
    met = {(item.scan, item.thing, item.part) for item in hovsore.obstructions}
    assert {("sector", "stand 5", "rotor"), ("stare K", "stand 5", "rotor")} <= met
    texts = [finding.text for finding in findings(hovsore) if finding.code == "beam-blocked"]
    assert any("stand 5" in text for text in texts)


def test_hovsore_stand_5_is_outside_the_range_of_the_iec_formula(hovsore: Plan) -> None:
    """185 m and a rotor of 113 m: 1.64 diameters at the target, less at what is measured."""
    seen = [finding for finding in findings(hovsore) if finding.code == "iec-range"]
    assert {finding.subject for finding in seen} == {"sector → cup", "stare K → cup", "stare W → cup"}
    assert all("stand 5" in finding.text and "1.64 from the target" in finding.text for finding in seen)
    assert all(finding.value is not None and finding.value < 1.64 for finding in seen)


def test_hovsore_declares_a_shorter_period_than_the_head_can_keep(hovsore: Plan) -> None:
    """30 rays of 0.4 s and 0.1 s to turn round at 5 degrees a second and 100 degrees a second squared."""
    (finding,) = [each for each in findings(hovsore) if each.code == "period-declared"]
    assert (finding.severity, finding.value) == ("warning", 12.0)
    assert finding.limit == pytest.approx(30 * 0.4 + 2 * 5 / 100)


def test_kassels_last_crossing_is_the_only_error(kassel: Plan) -> None:
    """WS7 and WS8 look at each other at P4, about 4 degrees from their baseline."""
    problems = [finding for finding in findings(kassel) if finding.severity != "info"]
    assert [(finding.severity, finding.code, finding.subject) for finding in problems] == [
        ("error", "opening-angle", "WS7+WS8 at P4 (P4)")
    ]
    assert 175.5 < (problems[0].value or 0.0) < 177.0


@pytest.mark.parametrize(
    "fields",
    [
        {"type": "ppi", "step_deg": 2, "target": None, "elevation_head_deg": 5},
        {"type": "ppi", "step_deg": 2, "sweep": "back_and_forth"},
        {"type": "rhi", "elevation_from_deg": 0, "elevation_to_deg": 180, "step_deg": 2},
        {"type": "raster", "width_deg": 4, "height_deg": 2, "step_deg": 0.5, "motion": "continuous"},
        {"type": "points", "targets": ["T", "up"], "target": None},
        {"type": "stare", "target": "up"},
        {"type": "stare", "target": None, "azimuth_head_deg": -370, "elevation_head_deg": 95},
        {"type": "sector", "sector_deg": 360, "step_deg": 1, "motion": "step", "target": "up"},
    ],
    ids=lambda fields: str(fields["type"]),
)
@pytest.mark.parametrize("device", ["windscanner-200s", "windcube-400s"])
def test_any_scan_is_checked_without_a_nan(moor: Moor, fields: Changes, device: str) -> None:
    """Also straight up, over the top, without a target, with an instrument of which little is known."""
    targets = [TARGET, {"name": "up", "position": [500000, 6250000, 510]}]
    lidars = [{**each, "instrument": device} for each in (LIDAR_A, LIDAR_B)]
    stand = {"name": "W", "position": [500300, 6250400, 10], "hub_height_m": 100, "rotor_diameter_m": 90}
    scans = [
        {"name": "a", "lidar": "A", "target": "T", "accumulation_s": 0.5, **fields},
        {"name": "b", "lidar": "B", "target": "up", "type": "stare", "accumulation_s": 0.5},
    ]
    pairs = [{"name": "dual", "scans": ["a", "b"], "target": "up", "synchronised": True}]
    plan = moor(lidars=lidars, targets=targets, scans=scans, pairs=pairs, turbines=[stand])
    json.dumps([finding._asdict() for finding in findings(plan)], allow_nan=False)


def test_an_rhi_tells_the_elevations_that_it_loses(moor: Moor) -> None:
    """A mast 90 m high at 500 m hides what is below 10.2°: the rays from 0° to 10°; its azimuth is one."""
    fields = {"type": "rhi", "elevation_from_deg": 0, "elevation_to_deg": 20, "step_deg": 2}
    stand = {"masts": [{"name": "M", "position": [500000, 6250500, 10], "height_m": 90}]}
    (finding,) = found(moor, scan(**fields) | stand, "beam-blocked")
    assert "numbers 1-6, elevation 1.0 to 11.0°" in finding.text
    assert "azimuth" not in finding.text


def test_rays_of_an_rhi_that_go_into_the_ground_are_told(moor: Moor) -> None:
    """From 10 m above the ground, rays steeper than 0.57° downwards do not reach 1 km."""
    fields = {"type": "rhi", "elevation_from_deg": -4, "elevation_to_deg": 4, "step_deg": 2}
    (finding,) = found(moor, scan(**fields) | {"ground_height_m": 0}, "beam-blocked")
    assert finding.severity == "warning"
    assert "2 of 4 rays (numbers 1-2, elevation -3.0 to -1.0°) are lost to the ground, 143 m" in finding.text


def test_hovsores_head_just_below_the_declared_ground_is_no_finding(hovsore: Plan) -> None:
    """WS_K stands 0.75 m below the 4.8 m that are declared for the ground."""
    assert not [each for each in findings(hovsore) if each.code == "head-height" or "ground" in each.text]


def test_a_pulse_that_nobody_names_is_told_once_for_an_instrument(moor: Moor) -> None:
    (finding,) = found(moor, instrument(pulses=[]), "pulse-unknown")
    assert (finding.subject, finding.value) == ("test lidar", 200.0)
    assert "200 ns are taken" in finding.text
    assert "neither the scan (a, b) nor test lidar names one" in finding.text


def test_only_a_zone_of_transverse_mercator_has_neighbours(moor: Moor) -> None:
    """EPSG:2154 is a cone with its meridian at 3° east."""
    (zone,) = found(moor, at_longitude(18.51, "EPSG:3006"), "central-meridian")
    (cone,) = found(moor, at_longitude(7.0, "EPSG:2154", 45.0), "central-meridian")
    assert "neighbouring zone" in zone.text
    assert "neighbouring" not in cone.text
    assert "local UTM zone" in cone.text


def test_check_says_first_where_the_site_is(capsys: pytest.CaptureFixture[str]) -> None:
    """Høvsøre lies at 56.4° north and 8.2° east; `--quiet` keeps it to itself."""
    from planner.commands.check import check

    site = str(ROOT / "examples" / "hovsore" / "site.yaml")
    check(site)
    assert re.match(r"site at 56\.4\d° N 8\.1\d° E\n", capsys.readouterr().err)
    check(site, quiet=True)
    assert capsys.readouterr().err == ""
