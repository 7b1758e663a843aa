"""A site's terrain in findings, pointing, wind and report: against heights worked out by hand along the beam."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from geometry.errors import InputError
from planner.checks import findings
from planner.cli import run
from planner.files.raster import write_geotiff
from planner.plan import Plan
from planner.wind_climate import height_above_ground_m

pytest.importorskip("rasterio")

Moor = Callable[..., Plan]

EARTH_M, BENT = 6_371_008.8, 0.13
CELL_M = 20.0
EAST_M, NORTH_M = 499_500.0 + CELL_M * np.arange(100), 6_251_500.0 - CELL_M * np.arange(100)


def terrain(folder: Path, heights: np.ndarray, name: str = "ground") -> Path:
    """A raster of 2 x 2 km around the small site: lidar A in its south, the target 1 km north of it."""
    write_geotiff(folder / f"{name}.tif", {"height": heights}, EAST_M, NORTH_M, "EPSG:32632")
    return folder / f"{name}.tif"


def flat(height_m: float = 8.0) -> np.ndarray:
    return np.full((NORTH_M.size, EAST_M.size), height_m)


def ridge(height_m: float, north_m: float = 6_250_500.0) -> np.ndarray:
    """Flat but for one row of cells."""
    heights = flat()
    heights[np.argmin(np.abs(NORTH_M - north_m))] = height_m
    return heights


def on(moor: Moor, file: Path, surface: Path | None = None, **changes: Any) -> Plan:
    named = {"file": file, "height_datum": "above_sea_level", "surface": surface}
    stare = {"name": "a", "lidar": "A", "target": "T", "type": "stare", "accumulation_s": 0.5}
    return moor(**{"ground_height_m": None, "terrain": named, "scans": [stare], "pairs": [], **changes})


def beam_height_m(distance_m: float) -> float:
    """Of a beam from 10 m to the target at 110 m, 1000.4 m away: up the chord, less what Earth and air bend it."""
    reach_m = 1000.4
    return 10 + 100 * distance_m / reach_m - (1 - BENT) * distance_m * (reach_m - distance_m) / 2 / EARTH_M


@pytest.mark.parametrize(("above_m", "state"), [(-3.0, "clear"), (3.0, "blocked")])
def test_a_ridge_blocks_the_beam_that_it_rises_above(
    moor: Moor, tmp_path: Path, above_m: float, state: str
) -> None:
    plan = on(moor, terrain(tmp_path, ridge(beam_height_m(500.0) + above_m)))
    row = next(row for row in plan.pointings if row.lidar == "A")
    assert row.terrain == state
    assert row.terrain_clearance_m == pytest.approx(-above_m, abs=0.05)
    assert row.terrain_distance_m == pytest.approx(500.0, abs=0.5)
    codes = [finding.code for finding in findings(plan)]
    assert codes == (["beam-blocked"] if state == "blocked" else ["beam-near"] if above_m > -2.3 else [])
    assert bool(plan.obstructions) == (state == "blocked")


def test_the_ground_is_met_where_the_slope_of_the_ridge_rises_through_the_beam(
    moor: Moor, tmp_path: Path
) -> None:
    """From 480 to 500 m the ground rises from 8 to 200 m, the beam from 58 to 60 m."""
    (met,) = on(moor, terrain(tmp_path, ridge(200.0))).obstructions
    assert (met.part, met.thing, met.lost.tolist()) == ("ground", "the terrain", [True])
    assert met.range_m == pytest.approx(480.0 + 20.0 * (58 - 8) / (192 - 2), abs=0.3)
    assert met.clearance_m == pytest.approx(beam_height_m(500.0) - 200.0, abs=0.1)


def test_each_gate_is_judged_by_the_way_up_to_it(moor: Moor, tmp_path: Path) -> None:
    gates = {"first_m": 100, "spacing_m": 100, "count": 12}
    stare = {"name": "a", "lidar": "A", "target": "T", "type": "stare", "accumulation_s": 0.5, "gates": gates}
    (sight,) = on(moor, terrain(tmp_path, ridge(200.0)), scans=[stare]).over_terrain
    blocked = dict(zip(sight.range_m[0].round().tolist(), sight.blocked[0].tolist(), strict=True))
    assert [blocked[float(gate)] for gate in (100, 400, 500, 1200)] == [False, False, True, True]
    assert sight.lost.tolist() == [True]


def test_only_the_rays_over_the_hill_are_lost_and_what_a_ray_sweeps_counts(
    moor: Moor, tmp_path: Path
) -> None:
    """A hill 60 m wide, 500 m away, is met by rays of 2 degrees (17 m) whose sweep touches it."""
    heights = flat()
    heights[np.ix_(np.abs(NORTH_M - 6_250_500) < 15, np.abs(EAST_M - 500_000) < 25)] = 300.0
    sector = {"name": "s", "lidar": "A", "target": "T", "type": "sector", "sector_deg": 60, "step_deg": 2}
    plan = on(moor, terrain(tmp_path, heights), scans=[{**sector, "accumulation_s": 0.4}])
    (met,) = plan.obstructions
    side_deg = np.abs((met.lost_azimuth_deg + 180) % 360 - 180)
    # the slope of the hill goes on for a cell to each side: 20 to 40 m from the middle, 2.3 to 4.6 degrees
    assert side_deg.max() == pytest.approx(4.0, abs=1.1)
    assert met.lost_rays == 2 * np.unique(side_deg.round(3)).size


def test_a_beam_that_leaves_the_raster_is_unknown_and_not_clear(moor: Moor, tmp_path: Path) -> None:
    far = [{"name": "B", "position": [503000, 6251000, 10], "instrument": "windscanner-200s"}]
    stare = {"name": "b", "lidar": "B", "target": "T", "type": "stare", "accumulation_s": 0.5}
    plan = on(moor, terrain(tmp_path, flat()), lidars=far, scans=[stare])
    assert [row.terrain for row in plan.pointings] == ["unknown"]
    (finding,) = [each for each in findings(plan) if each.code == "terrain-unknown"]
    assert (finding.severity, finding.subject, finding.value) == ("warning", "b", 1)


def test_the_sea_is_a_height_and_a_hole_is_not(moor: Moor, tmp_path: Path) -> None:
    assert next(iter(on(moor, terrain(tmp_path, flat(0.0))).pointings)).terrain == "clear"
    holed = flat(0.0)
    holed[np.argmin(np.abs(NORTH_M - 6_250_500))] = np.nan
    assert next(iter(on(moor, terrain(tmp_path, holed, "holed")).pointings)).terrain == "unknown"


def test_trees_hide_but_nothing_stands_on_them(moor: Moor, tmp_path: Path) -> None:
    """A canopy of 60 m in the way blocks; the wind's profile counts from the ground below it."""
    ground, trees = terrain(tmp_path, flat()), np.zeros_like(flat())
    trees[np.abs(NORTH_M - 6_250_500) < 50] = 60.0
    trees[np.abs(NORTH_M - 6_251_000) < 50] = 20.0
    plan = on(moor, ground, terrain(tmp_path, trees, "trees"))
    assert next(iter(plan.pointings)).terrain == "blocked"
    assert height_above_ground_m(plan.site, "T") == pytest.approx(102.0)
    assert plan.places.height_above_ground_m("T") == pytest.approx(102.0)


def test_targets_outside_the_raster_are_named_and_the_command_ends_with_2(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    terrain(tmp_path, flat())
    site = """
name: far away
crs: EPSG:32632
terrain: {file: ground.tif, height_datum: above_sea_level}
lidars: [{name: A, position: [500000, 6250000, 10], instrument: windscanner-200s}]
targets: [{name: near, position: [500000, 6250900, 60]}, {name: east, position: [504000, 6250900, 60]},
          {name: west, position: [490000, 6250900, 60]}]
"""
    (tmp_path / "site.yaml").write_text(site, encoding="utf-8")
    for command in (["point"], ["check"], ["place", "--count", "2", "--out", str(tmp_path / "out")]):
        assert run([command[0], str(tmp_path / "site.yaml"), *command[1:]]) == 2
        told = capsys.readouterr().err
        assert "under targets east, west is not known" in told and "near" not in told.split(":")[1]
        assert "Traceback" not in told


def test_a_raster_of_unstated_datum_is_refused_by_every_command(moor: Moor, tmp_path: Path) -> None:
    file = terrain(tmp_path, flat())
    plan = on(moor, file, terrain={"file": file})
    with pytest.raises(InputError, match="does not say what its heights count from"):
        findings(plan)


def test_the_report_has_every_ray_and_gate(moor: Moor, tmp_path: Path) -> None:
    from planner.report_tables import pointing_table, terrain_table

    plan = on(moor, terrain(tmp_path, ridge(200.0)))
    (row,) = terrain_table(plan).rows
    assert row[0] == "a" and row[5] == "blocked"
    assert "terrain" in [column.key for column in pointing_table(plan).columns if column.on_page]
    assert json.dumps([pointing._asdict() for pointing in plan.pointings], allow_nan=False)


def test_the_scene_shows_the_hills_instead_of_a_plane(moor: Moor, tmp_path: Path) -> None:
    from planner.plan_scene import plan_scene

    heights = flat()
    heights[NORTH_M > 6_250_800] = 200.0
    scene = plan_scene(on(moor, terrain(tmp_path, heights)))
    (hills,) = [layer for layer in scene.layers if layer.name == "terrain"]
    top_m = max(float(item.vertices_m[:, 2].max()) for item in hills.items)
    assert top_m == pytest.approx(200.0 - 10.0, abs=1.0)  # above the origin, which lies at the lidar's level
    assert "ground" not in [layer.name for layer in scene.layers]


BURIED_LIMIT_M = 4.0  # on a flat raster: the accuracy of a good one


@pytest.mark.parametrize(("height_m", "buried"), [(8.0 - 3.9, False), (8.0 - 4.1, True), (-40.0, True)])
def test_a_head_inside_the_terrain_sees_nothing(
    moor: Moor, tmp_path: Path, height_m: float, buried: bool
) -> None:
    """Flat ground at 8 m: a little below it the head stands on it, farther below all its beams are lost."""
    lidar = [{"name": "A", "position": [500000, 6250000, height_m], "instrument": "windscanner-200s"}]
    plan = on(moor, terrain(tmp_path, flat()), lidars=lidar)
    (row,) = plan.pointings
    assert row.terrain == ("blocked" if buried else "clear")
    assert row.terrain_distance_m is not None
    assert (row.terrain_distance_m == 0.0) == buried
    assert (row.terrain_clearance_m < 0.0) == buried
    assert [sight.blocked.all() for sight in plan.over_terrain] == [buried]
    (finding,) = [each for each in findings(plan) if each.code == "head-height"]
    assert finding.severity == ("error" if buried else "warning")
    assert finding.value == pytest.approx(height_m - 8.0)
    assert finding.limit == (-BURIED_LIMIT_M if buried else -2.0)


def test_on_a_slope_the_raster_is_given_half_of_what_it_changes_over_a_cell(
    moor: Moor, tmp_path: Path
) -> None:
    """10 m up for each cell to the east: 4 m and 5 m."""
    slope = flat() + 10.0 * np.arange(EAST_M.size)
    ground_m = float(np.interp(500_000.0, EAST_M, slope[0]))
    for below_m, codes in ((8.9, "warning"), (9.1, "error")):
        place = [500000, 6250000, ground_m - below_m]
        lidar = [{"name": "A", "position": place, "instrument": "windscanner-200s"}]
        target = [{"name": "T", "position": [500000, 6251000, ground_m + 200]}]
        plan = on(moor, terrain(tmp_path, slope), lidars=lidar, targets=target)
        assert [each.severity for each in findings(plan) if each.code == "head-height"] == [codes]


STANDING = {
    "masts": {"name": "M", "height_m": 5, "width_m": 0.2},
    "turbines": {"name": "W", "hub_height_m": 80, "rotor_diameter_m": 50, "thrust_coefficient": 0.8},
    "obstacles": {"name": "O", "width_m": 5, "length_m": 5, "height_m": 5, "azimuth_deg": 0},
    "hard_targets": {"name": "H", "shape": "tip", "size_m": 0.1, "uncertainty_m": 0.2},
}


@pytest.mark.parametrize("kind", list(STANDING))
@pytest.mark.parametrize(("above_m", "found"), [(3.9, False), (4.1, True), (-3.9, False), (-4.1, True)])
def test_a_foot_that_is_not_on_the_ground_is_found(
    moor: Moor, tmp_path: Path, kind: str, above_m: float, found: bool
) -> None:
    """Flat ground at 8 m; a hard target may be above it on anything."""
    thing = {**STANDING[kind], "position": [500300.0, 6249700.0, 8.0 + above_m]}
    plan = on(moor, terrain(tmp_path, flat()), **{kind: [thing]})
    seen = [each for each in findings(plan) if each.code == "base-height"]
    assert len(seen) == (found and not (kind == "hard_targets" and above_m > 0))
    for each in seen:
        assert (each.severity, each.subject) == ("warning", thing["name"])
        assert each.value == pytest.approx(above_m)
        assert each.limit == np.sign(above_m) * BURIED_LIMIT_M


def test_the_table_of_rays_and_point_tell_the_same_clearance(moor: Moor, tmp_path: Path) -> None:
    """A ridge 12 m under the beam counts, the 2 m of the head above its own ground do not; before the ridge the flat."""
    from planner.report_tables import terrain_table

    gates = {"first_m": 100, "spacing_m": 100, "count": 10}
    stare = {"name": "a", "lidar": "A", "target": "T", "type": "stare", "accumulation_s": 0.5, "gates": gates}
    plan = on(moor, terrain(tmp_path, ridge(beam_height_m(500.0) - 12.0)), scans=[stare])
    row = next(row for row in plan.pointings if row.lidar == "A")
    assert row.terrain_clearance_m == pytest.approx(12.0, abs=0.05)
    clear = {round(line[4]): line[6] for line in terrain_table(plan).rows}
    assert clear[600] == clear[1000] == pytest.approx(row.terrain_clearance_m, abs=0.2)
    assert clear[200] == pytest.approx(beam_height_m(199.0) - 8.0, abs=0.2)
    assert min(clear.values()) > 5.0


def test_a_zone_that_is_wrong_is_suspected_where_targets_lie_off_the_raster(
    moor: Moor, tmp_path: Path
) -> None:
    with pytest.raises(InputError, match="check `crs`: with the wrong UTM zone"):
        findings(on(moor, terrain(tmp_path, flat()), crs="EPSG:32631"))


@pytest.mark.parametrize(("given", "told"), [("", "nothing came"), (", height_datum: ellipsoidal", "")])
def test_a_datum_that_is_needed_is_asked_for_by_its_line(
    given: str, told: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Every command that reads the site says the same, whether or not it looks at the ground."""
    terrain(tmp_path, flat())
    site = f"""name: moor
crs: EPSG:32632
height_datum: ellipsoidal
terrain: {{file: ground.tif{given}}}
lidars: [{{name: A, position: [500000, 6250000, 10], instrument: windscanner-200s}}]
targets: [{{name: T, position: [500000, 6250900, 60]}}]
"""
    (tmp_path / "site.yaml").write_text(site, encoding="utf-8")
    for command in ("check", "wakes", "crossings"):
        assert run([command, str(tmp_path / "site.yaml")]) == (2 if told else 0)
        errors = capsys.readouterr().err
        assert ("site.yaml:4: terrain.height_datum: nothing came" in errors) == bool(told)


def test_a_datum_that_the_file_contradicts_is_told_by_its_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """EPSG:5773 counts from the geoid EGM96."""
    write_geotiff(tmp_path / "ground.tif", {"height": flat()}, EAST_M, NORTH_M, "EPSG:32632+5773")
    site = "name: moor\ncrs: EPSG:32632\nterrain:\n  file: ground.tif\n  height_datum: ellipsoidal\n"
    (tmp_path / "site.yaml").write_text(site, encoding="utf-8")
    assert run(["check", str(tmp_path / "site.yaml")]) == 2
    assert "site.yaml:5: terrain.height_datum: 'ellipsoidal' came" in (told := capsys.readouterr().err)
    assert "above sea level: leave height_datum out" in told
