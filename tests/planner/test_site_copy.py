"""A site file that is copied still finds every file that it names."""

from pathlib import Path

import numpy as np
import pytest

from planner import cli
from planner.files.raster import write_geotiff
from planner.files.site_copy import copy_site
from planner.files.yaml_site import load_site, named_files
from planner.site import Site

LIDAR = """\
name: Moor
crs: EPSG:32632
lidars:
  - {name: A, position: [500000, 6250000, 12], instrument: windscanner-200s}
masts:
  - {name: mast, position: [500800, 6250000, 10], height_m: 100}
targets:
  - {name: cup, mast: mast, height_m: 100}
scans:
  - {name: s, lidar: A, target: cup, type: sector, sector_deg: 60, step_deg: 10, accumulation_s: 2}
"""
ROSE = (
    "direction_deg,share,weibull_scale_mps,weibull_shape\n0,0.1,9,2\n90,0.2,9,2\n180,0.4,9,2\n270,0.3,9,2\n"
)
GROUND = (
    '{"type": "FeatureCollection", "features": [{"type": "Feature", "properties": {}, "geometry": {"type": "Polygon", '
    '"coordinates": [[[8.9, 56.3], [9.1, 56.3], [9.1, 56.5], [8.9, 56.5], [8.9, 56.3]]]}}]}'
)


def raster(path: Path, height_m: float) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    east, north = np.arange(499000.0, 502001.0, 100.0), np.arange(6251000.0, 6248999.0, -100.0)
    heights = np.full((len(north), len(east)), height_m)
    write_geotiff(path, {"height": heights}, east, north, "EPSG:32632")


@pytest.fixture
def source(tmp_path: Path) -> Path:
    """A site with a file below it, one above it, one at an absolute path, two of one name, and one called as the mast's."""
    home = tmp_path / "home"
    raster(home / "maps" / "dem.tif", 10.0)
    raster(tmp_path / "shared" / "canopy.tif", 0.0)
    (home / "mast.csv").write_text(ROSE, encoding="utf-8")
    (home / "fields.geojson").write_text(GROUND, encoding="utf-8")
    (tmp_path / "shared" / "fields.geojson").write_text(GROUND, encoding="utf-8")
    (tmp_path / "fields.geojson").write_text(GROUND + "\n", encoding="utf-8")
    text = LIDAR + (
        "terrain: {file: maps/dem.tif, surface: ../shared/canopy.tif, height_datum: above_sea_level}  # flat\n"
        "wind: {rose: mast.csv, reference_height_m: 100}\n"
        f"areas: {{allowed: [fields.geojson, ../fields.geojson], forbidden: [{{file: '{tmp_path}/shared/fields.geojson'}}]}}\n"
    )
    (home / "site.yaml").write_text(text, encoding="utf-8")
    return home


def files_of(site: Site) -> list[Path | None]:
    terrain, wind = site.terrain, site.wind
    assert terrain is not None
    assert wind is not None
    areas = [area.file for area in (*site.areas.allowed, *site.areas.forbidden)]
    return [terrain.file, terrain.surface, wind.rose, *areas]


def test_every_file_that_a_site_names_is_copied_and_found(source: Path, tmp_path: Path) -> None:
    copy = tmp_path / "copy"
    copy.mkdir()
    (copy / "mast.csv").write_text("time_utc,speed_mps\n", encoding="utf-8")
    copy_site((source / "site.yaml").read_text(encoding="utf-8"), source, copy)
    before, after = load_site(source / "site.yaml"), load_site(copy / "site.yaml")
    for old, new in zip(files_of(before), files_of(after), strict=True):
        assert old is not None
        assert new is not None
        assert new.resolve().is_relative_to(copy.resolve())
        assert new.read_bytes() == old.read_bytes()
    assert (copy / "maps" / "dem.tif").is_file()  # a relative path stays
    assert (copy / "mast.csv").read_text(encoding="utf-8") == "time_utc,speed_mps\n"  # not overwritten
    assert "# flat" in (copy / "site.yaml").read_text(encoding="utf-8")


def test_a_site_whose_files_lie_below_it_is_copied_letter_for_letter(source: Path, tmp_path: Path) -> None:
    text = LIDAR + "terrain: {file: maps/dem.tif,   height_datum: above_sea_level}\n"
    (tmp_path / "copy").mkdir()
    copy_site(text, source, tmp_path / "copy")
    assert (tmp_path / "copy" / "site.yaml").read_text(encoding="utf-8") == text


def test_what_belongs_to_a_file_goes_with_it(tmp_path: Path) -> None:
    for folder in ("home", "copy"):
        (tmp_path / folder).mkdir()
    for name in ("pond.shp", "pond.dbf", "pond.PRJ", "pond.shp.aux.xml", "pond.yaml", "pond2.dbf"):
        (tmp_path / "home" / name).write_text(name, encoding="utf-8")
    copy_site(LIDAR + "areas: {forbidden: [pond.shp]}\n", tmp_path / "home", tmp_path / "copy")
    found = sorted(item.name for item in (tmp_path / "copy").iterdir())
    assert found == ["pond.PRJ", "pond.dbf", "pond.shp", "pond.shp.aux.xml", "site.yaml"]


def test_every_path_of_a_site_is_known() -> None:
    """Whoever adds a key with a path to the nouns of a site has to add it to `named_files`."""
    raw = {
        "terrain": {"file": "a", "surface": "b"},
        "wind": {"rose": "c"},
        "areas": {"allowed": ["d", {"file": "e"}]},
    }
    assert sorted(name for _, name in named_files(raw)) == ["a", "b", "c", "d", "e"]
    schema = Site.model_json_schema()
    nouns = [schema, *schema["$defs"].values()]
    paths = sum(
        str(field).count("'format': 'path'")
        for noun in nouns
        for field in noun.get("properties", {}).values()
    )
    assert paths == 4  # file and surface of a terrain, a rose, the file of an area


def test_a_virtual_campaign_of_a_site_with_files_is_retrieved_by_its_next_command(
    source: Path, tmp_path: Path
) -> None:
    out = tmp_path / "virtual"
    assert (
        cli.run(["simulate", str(source / "site.yaml"), "--days", "0.014", "--out", str(out), "--quiet"]) == 0
    )
    source.rename(tmp_path / "gone")
    assert cli.run(["retrieve", str(out / "campaign.yaml"), "--quiet"]) == 0
