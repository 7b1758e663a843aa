"""Terrain in placement: rasters read with their CRS and datum, hills that hide targets, heads that must be raised."""

from dataclasses import replace

import numpy as np
import pytest

from geometry.errors import InputError
from geometry.terrain import HeightRaster
from planner.files.raster import load_terrain, write_geotiff
from planner.files.yaml_site import parse_site
from planner.ground import Heights
from planner.placement.maps import Grid, look, standing_m
from planner.placement.ranking import place
from planner.placement.task import task_of

SITE = """
name: a ridge
crs: EPSG:32632
lidars:
  - {name: one, position: [447000, 6255000, 3], instrument: windscanner-200s}
  - {name: two, position: [448500, 6255000, 3], instrument: windscanner-200s}
targets:
  - {name: a, position: [448000, 6256000, 60]}
"""
WEST, NORTH, CELL = 446000.0, 6258000.0, 50.0


def ridged(height_m=100.0):
    """Flat ground at 1 m with a ridge that runs east, 500 m south of the target."""
    heights = np.ones((80, 80))
    heights[50] = height_m
    return heights


def task_with(heights):
    task = task_of(parse_site(SITE), count=2)
    raster = HeightRaster(heights, WEST, NORTH, CELL, CELL, "above_sea_level")
    return replace(task, terrain=Heights(raster, raster), head_height_m=2.0)


def test_no_lidar_is_put_behind_the_ridge():
    task = task_with(ridged())
    grid = Grid(np.linspace(446200, 449800, 10), np.linspace(6257800, 6254200, 10))
    seen = look(task, standing_m(task, grid.places_m))
    behind = grid.places_m[:, 1] < 6255400.0
    assert not seen.allowed[0, behind].any()
    assert seen.allowed[0, ~behind].any()
    for item in place(task, grid, most=1).ranked:
        assert np.all(item.positions_m[:, 1] > 6255400.0)


def test_how_far_the_head_must_be_raised_is_said_and_enough():
    task = task_with(ridged())
    grid = Grid(np.linspace(447000, 449000, 6), np.linspace(6255000, 6254400, 4))
    with pytest.raises(InputError, match=r"terrain .* must give .* m .*--head-height") as caught:
        place(task, grid)
    needed = float(str(caught.value).split("must give ")[1].split(" m")[0])
    raised = replace(task, head_height_m=task.head_height_m + 1.02 * needed)
    assert look(raised, standing_m(raised, grid.places_m)).allowed.any()


def test_a_place_beyond_the_raster_is_unknown_and_so_not_allowed():
    task = task_with(np.ones((80, 80)))
    seen = look(task, standing_m(task, [[445000.0, 6256000.0], [447000.0, 6256000.0]]))
    assert np.isnan(seen.slack["terrain"][0, 0])
    assert seen.allowed[0].tolist() == [False, True]


def test_a_target_outside_the_raster_is_named():
    with pytest.raises(InputError, match="target a is not known: outside the height raster"):
        task_with(np.ones((10, 10)))


class TestFiles:
    """GeoTIFF, where rasterio is installed."""

    @pytest.fixture
    def tif(self, tmp_path):
        pytest.importorskip("rasterio")
        east, north = WEST + CELL * (np.arange(80) + 0.5), NORTH - CELL * (np.arange(80) + 0.5)
        plane = 100.0 + 0.01 * (east - WEST) + 0.02 * (north[:, None] - NORTH)
        write_geotiff(tmp_path / "dem.tif", {"height": plane}, east, north, "EPSG:32632")
        return tmp_path / "dem.tif"

    def test_what_is_written_is_read_again(self, tif):
        raster = load_terrain(
            tif, crs="EPSG:32632", height_datum="above_sea_level", declared_datum="above_sea_level"
        )
        assert abs(float(raster.heights_m(447000.0, 6257000.0)) - (100 + 10 - 20)) < 0.01

    def test_another_crs_is_transformed(self, tif):
        from pyproj import Transformer

        raster = load_terrain(
            tif, crs="EPSG:25833", height_datum="above_sea_level", declared_datum="above_sea_level"
        )
        east, north = Transformer.from_crs("EPSG:32632", "EPSG:25833", always_xy=True).transform(
            447500.0, 6256500.0
        )
        assert abs(float(raster.heights_m(east, north)) - (100 + 15 - 30)) < 0.5

    def test_an_unstated_datum_is_refused(self, tif):
        with pytest.raises(InputError, match="does not say what its heights count from"):
            load_terrain(tif, crs="EPSG:32632", height_datum="above_sea_level")

    def test_another_datum_needs_the_undulation_and_then_is_turned(self, tif):
        with pytest.raises(InputError, match="geoid_undulation_m"):
            load_terrain(tif, crs="EPSG:32632", height_datum="ellipsoidal", declared_datum="above_sea_level")
        raster = load_terrain(
            tif,
            crs="EPSG:32632",
            height_datum="ellipsoidal",
            declared_datum="above_sea_level",
            geoid_undulation_m=41.0,
        )
        assert abs(float(raster.heights_m(447000.0, 6257000.0)) - 131.0) < 0.01

    def test_a_layer_on_top_is_added(self, tif, tmp_path):
        east, north = WEST + CELL * (np.arange(80) + 0.5), NORTH - CELL * (np.arange(80) + 0.5)
        write_geotiff(tmp_path / "trees.tif", {"height": np.full((80, 80), 12.0)}, east, north, "EPSG:32632")
        raster = load_terrain(
            tif,
            crs="EPSG:32632",
            height_datum="above_sea_level",
            declared_datum="above_sea_level",
            surface=tmp_path / "trees.tif",
        )
        assert abs(float(raster.heights_m(447000.0, 6257000.0)) - 102.0) < 0.01

    def test_a_text_file_is_no_raster(self, tmp_path):
        pytest.importorskip("rasterio")
        (tmp_path / "no.tif").write_text("no", encoding="utf-8")
        with pytest.raises(InputError, match="cannot be read as a raster"):
            load_terrain(tmp_path / "no.tif", crs="EPSG:32632", height_datum="ellipsoidal")


def test_the_command_places_on_a_terrain_and_writes_everything(tmp_path, capsys):
    """CSV, GeoPackage, GeoTIFF and figures; the JSON says what the files are, and an export takes the places with it."""
    import json

    import pyogrio

    rasterio = pytest.importorskip("rasterio")
    from planner.cli import run

    east, north = WEST + CELL * (np.arange(80) + 0.5), NORTH - CELL * (np.arange(80) + 0.5)
    write_geotiff(tmp_path / "dem.tif", {"height": ridged()}, east, north, "EPSG:32632")
    terrain = "terrain: {file: dem.tif, height_datum: above_sea_level}\n"
    (tmp_path / "site.yaml").write_text(SITE + terrain, encoding="utf-8")
    out = tmp_path / "out"
    assert (
        run(["place", str(tmp_path / "site.yaml"), "--grid", "10", "--out", str(out), "--json", "--quiet"])
        == 0
    )
    told = json.loads(capsys.readouterr().out)
    assert [row["rank"] for row in told["places"]][:2] == [0, 1]
    names = {
        "places.csv",
        "place-targets.csv",
        "candidates.csv",
        "places.gpkg",
        "maps.tif",
        "sight.tif",
        "place.png",
        "place-criteria.png",
        "place-sight.png",
    }
    assert {path.name for path in out.iterdir()} == names
    with rasterio.open(out / "maps.tif") as maps:
        assert maps.crs.to_epsg() == 32632
        assert "error_vector" in maps.descriptions
    with rasterio.open(out / "sight.tif") as sight:
        assert sight.descriptions == ("a_m",)
        above = sight.read(1)
    assert (above[:4] >= 0).all() and (above[-2:] < 0).all()  # north of the ridge the target is seen
    assert run(["export", str(tmp_path / "site.yaml"), "--as", "gpkg", "--out", str(out), "--quiet"]) == 0
    assert "placement" in pyogrio.list_layers(out / "plan.gpkg")[:, 0]
    capsys.readouterr()
    for change in (("name: a", "name: no"), ("EPSG:32632", "EPSG:25832")):  # another site, the same folder
        (tmp_path / "other.yaml").write_text(SITE.replace(*change), encoding="utf-8")
        assert run(["export", str(tmp_path / "other.yaml"), "--as", "gpkg", "--out", str(out), "--json"]) == 0
        told = json.loads(capsys.readouterr().out)["left_out"]
        assert "placement" not in pyogrio.list_layers(out / "plan.gpkg")[:, 0]
        assert len(told) == 1 and "its places were found for" in told[0]
    (out / "places.gpkg").write_bytes(b"torn")
    assert run(["export", str(tmp_path / "site.yaml"), "--as", "gpkg", "--out", str(out)]) == 0
    assert "places.gpkg is left out: it cannot be read" in capsys.readouterr().err
