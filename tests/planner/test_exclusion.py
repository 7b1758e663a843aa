"""Directions that wakes take: the published sectors, volumes against points, shares of the wind."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from geometry.angles import SectorSet, difference_deg
from geometry.errors import InputError
from planner.exclusion import Exclusion, near_wakes, wanted_directions
from planner.plan import Plan

Moor = Callable[..., Plan]


def of_scan(plan: Plan, scan: str) -> Exclusion:
    return next(item for item in plan.exclusions if item.scan == scan)


def only(sectors: SectorSet) -> tuple[float, float]:
    (pair,) = sectors.pairs()
    return pair


def turbine(east_m: float, north_m: float, **fields: Any) -> dict[str, Any]:
    position = [500000 + east_m, 6251000 + north_m, 10]
    return {"name": "W", "position": position, "hub_height_m": 100, "rotor_diameter_m": 100, **fields}


def stare(**changes: Any) -> dict[str, Any]:
    scan = {"name": "a", "lidar": "A", "target": "T", "type": "stare", "accumulation_s": 0.5}
    return {"scans": [scan], "pairs": [], **changes}


@pytest.mark.parametrize(
    ("scan", "model", "expected"),
    [
        ("stare K", "jensen", (339, 21)),
        ("stare K", "iec", (317, 43)),
        ("sector", "jensen", (275, 108)),
        ("sector", "iec", (260, 125)),
    ],
)
def test_hovsores_excluded_directions(
    hovsore: Plan, scan: str, model: str, expected: tuple[float, float]
) -> None:
    """Independent numbers for a row due north of the mast, a 58° arc at 1155 m and a point.

    Ours are for true north (the row stands at grid north, 0.7° to the left of it) and for a volume: the arc
    is 60°, at 1166 m, and the probe 43 m long, so the sector holds the published one and is up to 3° wider
    on each side.
    """
    begin, end = only(of_scan(hovsore, scan).of_model(model))
    turned = -0.7
    assert -3.2 < float(difference_deg(begin, expected[0] + turned)) < 0.7
    assert -0.7 < float(difference_deg(end, expected[1] + turned)) < 3.6


def test_hovsores_point_is_the_published_one(hovsore: Plan) -> None:
    """IEC for the mast alone: 317 to 43° for a row due north, here 0.7° to the left."""
    begin, end = only(of_scan(hovsore, "stare K").point)
    assert float(difference_deg(begin, 316.5 - 0.7)) == pytest.approx(0.0, abs=0.1)
    assert end == pytest.approx(43.5 - 0.7, abs=0.1)


def test_a_volume_loses_at_least_what_its_target_loses(hovsore: Plan) -> None:
    for item in hovsore.exclusions:
        assert item.point.difference(item.excluded).width_deg == 0.0
        assert item.free.width_deg + item.excluded.width_deg == pytest.approx(360.0)
        assert item.lost_at_target.difference(item.lost).width_deg == 0.0


def test_the_lost_share_counts_degrees_of_the_wanted_wind(hovsore: Plan) -> None:
    """118 to 270° uniformly: every hundredth of a degree asked."""
    item = of_scan(hovsore, "sector")
    angles = np.arange(118.0, 270.0, 0.01) + 0.005
    assert item.lost_share == pytest.approx(np.mean(item.excluded.contains(angles)), abs=2e-4)


def test_the_union_is_both_models(moor: Moor) -> None:
    made = {
        model: moor(**stare(turbines=[turbine(0, 600)], wakes={"model": model})).exclusions[0].excluded
        for model in ("jensen", "iec", "union")
    }
    assert made["union"] == made["jensen"].union(made["iec"])


def test_the_iec_sector_of_a_stare_is_the_formula_and_the_probe(moor: Moor) -> None:
    """600 m, D = 100 m: 1.3·atan(2.5/6 + 0.15) + 10 degrees at the target, wider where the probe is near."""
    (item,) = moor(**stare(turbines=[turbine(0, 600)], wakes={"model": "iec"})).exclusions
    near_m = 600 / 0.9996 - 21.3 * np.cos(np.deg2rad(5.7))
    widths = [1.3 * np.rad2deg(np.arctan(250.0 / metres + 0.15)) + 10 for metres in (600 / 0.9996, near_m)]
    assert item.point.width_deg == pytest.approx(widths[0], abs=0.02)
    assert item.excluded.width_deg == pytest.approx(widths[1], abs=0.1)


def test_obstacles_count_in_the_iec_model_alone(moor: Moor) -> None:
    """Equivalent diameter 2·l_h·l_w / (l_h + l_w): 20 m high and 60 m broad is 30 m."""
    barn = {"name": "barn", "position": [500000, 6251300, 10], "width_m": 20, "length_m": 60, "height_m": 20}
    plans = {m: moor(**stare(obstacles=[barn], wakes={"model": m})) for m in ("jensen", "iec")}
    assert plans["jensen"].exclusions[0].excluded.width_deg == 0.0
    expected = 1.3 * np.rad2deg(np.arctan(2.5 * 30 / (300 / 0.9996) + 0.15)) + 10
    assert plans["iec"].exclusions[0].point.width_deg == pytest.approx(expected, abs=0.02)
    (near,) = plans["iec"].near_wakes(plans["iec"].exclusions[0])
    assert (near.name, near.is_rotor) == ("barn", False)
    assert near.target_diameters == pytest.approx(10.0, abs=0.01)


def test_distances_are_to_the_volume_and_to_the_target(hovsore: Plan) -> None:
    """185 m over 113 m is 1.64; the probe of WS_K reaches nearer."""
    near = {item.name: item for item in near_wakes(hovsore.exact_places, hovsore.layout["stare K"], "cup")}
    assert near["stand 5"].target_diameters == pytest.approx(185 / 113, abs=0.002)
    assert near["stand 2"].target_diameters == pytest.approx(1131 / 90, abs=0.01)
    assert near["stand 5"].volume_diameters < near["stand 5"].target_diameters


def test_the_deficit_is_jensens_where_the_wake_is(moor: Moor) -> None:
    """400 m behind D = 100 m, Ct 0.8, k 0.075: (1 - sqrt(0.2)) / (1 + 0.075·400/50)²; none from the south."""
    (item,) = moor(**stare(turbines=[turbine(0, 400 * 0.9996)])).exclusions
    assert item.deficit[0] == pytest.approx((1 - 0.2**0.5) / (1 + 0.075 * 400 / 50) ** 2, abs=1e-3)
    assert item.deficit[180] == 0.0
    assert item.deficit.shape == (360,)


def test_wanted_directions_are_all_unless_declared(moor: Moor, hovsore: Plan) -> None:
    assert wanted_directions(moor().site) == SectorSet.full()
    assert hovsore.wanted.pairs() == [(118.0, 270.0)]


def test_a_rose_without_wind_from_the_wanted_directions_is_refused(moor: Moor, tmp_path: Path) -> None:
    rose = tmp_path / "rose.csv"
    rose.write_text("direction_deg,share\n0,1\n90,0\n180,0\n270,0\n", encoding="utf-8")
    plan = moor(**stare(wind={"rose": str(rose), "directions_deg": [[100, 170]]}))
    with pytest.raises(InputError, match="no wind from the wanted directions"):
        _ = plan.exclusions


def test_a_site_without_turbines_loses_nothing(kassel: Plan) -> None:
    assert {item.lost_share for item in kassel.exclusions} == {0.0}
    assert all(item.free == SectorSet.full() for item in kassel.exclusions)
