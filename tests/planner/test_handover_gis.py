"""Layers, KMZ, GeoJSON and the field sheet, read back by GDAL and by an XML parser."""

import json
import zipfile
from html.parser import HTMLParser
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pyogrio
import pyproj
import pytest
import shapely

from geometry.errors import InputError
from planner.cli import run
from planner.files.yaml_site import load_site
from planner.handover.export import Choice, default_kinds, export
from planner.handover.field_sheet import field_sheet_html, sight
from planner.handover.gis_layers import layers
from planner.plan import Plan
from planner.report import report_html

KML = "{http://www.opengis.net/kml/2.2}"
ECEF = pyproj.Transformer.from_crs("EPSG:4979", "EPSG:4978", always_xy=True)
EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
EVIL = "<script>alert(1)</script> & “=1+1” 風"


@pytest.fixture(scope="module")
def exported(hovsore, tmp_path_factory):
    folder = tmp_path_factory.mktemp("export")
    export(hovsore, folder, ("gpkg", "kmz", "geojson", "csv"))
    return folder


def apart_m(first, second):
    """Distance of points in degrees and ellipsoidal metres, through earth-centred coordinates."""
    a, b = (np.stack(ECEF.transform(*np.atleast_2d(points).T), axis=-1) for points in (first, second))
    return np.linalg.norm(a - b, axis=-1)


def degrees(hovsore, positions):
    """Longitude, latitude and height by pyproj alone."""
    to = pyproj.Transformer.from_crs("EPSG:32632", "EPSG:4326", always_xy=True)
    points = np.atleast_2d(np.asarray(positions, dtype=float))
    longitude, latitude = to.transform(points[:, 0], points[:, 1])
    return np.column_stack([longitude, latitude, points[:, 2]])


def coordinates(table):
    return np.array([[point.x, point.y, point.z] for point in table.geometry])


def test_geopackage_keeps_the_site_as_it_is(hovsore, exported):
    """GDAL reads the site's own easting, northing and height within 1 mm, in the site's CRS."""
    lidars = pyogrio.read_dataframe(exported / "plan.gpkg", layer="lidars")
    assert lidars.crs.to_epsg() == 32632
    assert np.abs(coordinates(lidars) - [lidar.position for lidar in hovsore.site.lidars]).max() < 0.001
    assert list(lidars["instrument"]) == ["windscanner-200s"] * 3
    targets = pyogrio.read_dataframe(exported / "plan.gpkg", layer="targets")
    assert np.abs(coordinates(targets) - [447647.39, 6255435.76, 124.836]).max() < 0.001


def test_geopackage_holds_every_layer(exported):
    """Points, 3-D lines and polygons under their names."""
    kinds = {str(name): str(kind) for name, kind in pyogrio.list_layers(exported / "plan.gpkg")}
    assert kinds == {
        **dict.fromkeys(("lidars", "masts", "turbines", "targets", "crossings"), "Point Z"),
        "beams": "LineString Z",
        **dict.fromkeys(("sectors", "wakes", "excluded_winds"), "Polygon Z"),
    }


def test_beams_are_straight_and_end_at_the_measured_gate(hovsore, exported):
    """In earth-centred coordinates a beam's vertices lie on one line, and its length is the gate's range."""
    beams = pyogrio.read_dataframe(exported / "plan.gpkg", layer="beams")
    assert len(beams) == 32
    for beam in beams.itertuples():
        xyz = np.stack(ECEF.transform(*degrees(hovsore, list(beam.geometry.coords)).T), axis=-1)
        along = xyz - xyz[0]
        length = np.linalg.norm(along[-1])
        beside = np.linalg.norm(np.cross(along, along[-1] / length), axis=-1)
        assert beside.max() < 0.001
        assert length == pytest.approx(beam.range_m, abs=0.001)
    stare = beams[beams["scan"] == "stare K"].iloc[0]
    assert stare["range_m"] == pytest.approx(1135)


def test_sector_is_an_area_around_its_target(hovsore, exported):
    """60° at 1166 m: πr²/6 on the ground, larger in the grid by the scale squared; the target lies inside."""
    sector = pyogrio.read_dataframe(exported / "plan.gpkg", layer="sectors").iloc[0]
    flat = 1166 * np.cos(np.deg2rad(5.94))
    assert sector.geometry.area == pytest.approx(np.pi * flat**2 / 6, rel=0.005)
    target = pyogrio.read_dataframe(exported / "plan.gpkg", layer="targets").geometry.iloc[0]
    assert sector.geometry.contains(target)


def test_crossing_lies_at_the_target(exported):
    """The two stares of Høvsøre meet within a metre of the cup."""
    crossing = pyogrio.read_dataframe(exported / "plan.gpkg", layer="crossings").iloc[0]
    where = np.array([crossing.geometry.x, crossing.geometry.y, crossing.geometry.z])
    assert np.linalg.norm(where - [447647.39, 6255435.76, 124.836]) < 1
    assert crossing["opening_angle_deg"] == pytest.approx(63, abs=0.5)


def test_excluded_winds_lie_on_their_side_of_the_target(exported):
    """The wakes of the row north of the mast: the pieces of pie lie north of the target."""
    pies = pyogrio.read_dataframe(exported / "plan.gpkg", layer="excluded_winds")
    assert (pies.geometry.centroid.y > 6255435.76).all()


def test_kmz_is_read_at_the_right_place_and_height(hovsore, exported):
    """GDAL reads every layer of the KMZ, within 1 mm, height above sea level, with its columns."""
    names = [str(name) for name, _ in pyogrio.list_layers(exported / "plan.kmz")]
    assert names == list(layers(hovsore))
    lidars = pyogrio.read_dataframe(exported / "plan.kmz", layer="lidars")
    assert (
        apart_m(coordinates(lidars), degrees(hovsore, [i.position for i in hovsore.site.lidars])).max()
        < 0.001
    )
    assert list(lidars["role"]) == ["lidar"] * 3


def test_every_geometry_of_the_kmz_is_absolute(exported):
    """Without altitudeMode Google Earth would clamp it to the ground; the reader is an XML parser."""
    with zipfile.ZipFile(exported / "plan.kmz") as packed:
        assert packed.namelist() == ["doc.kml"]
        tree = ElementTree.fromstring(packed.read("doc.kml"))
    shapes = [shape for kind in ("Point", "LineString", "Polygon") for shape in tree.iter(f"{KML}{kind}")]
    assert len(shapes) == len(list(tree.iter(f"{KML}Placemark"))) == 50
    assert all(shape.findtext(f"{KML}altitudeMode") == "absolute" for shape in shapes)
    colours = {item.text for item in tree.iter(f"{KML}color")}
    assert "ffb27200" in colours  # alpha, blue, green, red of the first lidar's #0072b2


def test_geojson_follows_rfc_7946(hovsore, exported):
    """Longitude and latitude of WGS 84, no crs member, within 1 mm."""
    text = (exported / "geojson" / "turbines.geojson").read_text(encoding="utf-8")
    document = json.loads(text)
    assert "crs" not in document
    read = np.array([feature["geometry"]["coordinates"] for feature in document["features"]])
    assert apart_m(read, degrees(hovsore, [item.position for item in hovsore.site.turbines])).max() < 0.001
    assert document["features"][0]["properties"]["height_datum"] == "above_sea_level"


def test_heights_over_the_ellipsoid_where_the_geoid_is_known(moor, tmp_path):
    """GeoJSON counts from the ellipsoid: 10 m above a geoid of 40 m is 50 m; KML stays at 10 m above the sea."""
    plan = moor(geoid_undulation_m=40.0)
    export(plan, tmp_path, ("geojson", "kmz"))
    lidars = json.loads((tmp_path / "geojson" / "lidars.geojson").read_text(encoding="utf-8"))
    assert lidars["features"][0]["geometry"]["coordinates"][2] == pytest.approx(50, abs=1e-6)
    assert pyogrio.read_dataframe(tmp_path / "plan.kmz", layer="lidars").geometry[0].z == pytest.approx(10)


def test_kmz_of_ellipsoidal_heights_needs_the_geoid(moor, tmp_path):
    """Refused with what to give; left out, and said so, where nobody asked for it; right once it is given."""
    bare = moor(height_datum="ellipsoidal")
    with pytest.raises(InputError, match="geoid_undulation_m"):
        export(bare, tmp_path / "a", ("kmz",))
    assert list(tmp_path.iterdir()) == []
    choice = default_kinds(bare)
    assert "kmz" not in choice.kinds
    assert any("geoid_undulation_m" in text for text in choice.left_out)
    export(moor(height_datum="ellipsoidal", geoid_undulation_m=-7.0), tmp_path, ("kmz",))
    assert pyogrio.read_dataframe(tmp_path / "plan.kmz", layer="lidars").geometry[0].z == pytest.approx(17)


@pytest.mark.parametrize("example", ["hovsore", "kassel"])
def test_every_layer_of_both_examples_is_the_same_in_kmz_and_geopackage(example, request, tmp_path):
    """GDAL reads both; every vertex of every geometry, brought to degrees by PROJ, within 1 mm."""
    plan = request.getfixturevalue(example)
    export(plan, tmp_path, ("gpkg", "kmz"))
    to = pyproj.Transformer.from_crs(plan.site.crs, "EPSG:4326", always_xy=True)
    names = [str(name) for name, _ in pyogrio.list_layers(tmp_path / "plan.gpkg")]
    assert names == [str(name) for name, _ in pyogrio.list_layers(tmp_path / "plan.kmz")]
    assert {"lidars", "targets", "beams", "crossings"} <= set(names)
    for name in names:
        ours = pyogrio.read_dataframe(tmp_path / "plan.gpkg", layer=name)
        theirs = pyogrio.read_dataframe(tmp_path / "plan.kmz", layer=name)
        assert list(ours["name"]) == list(theirs["Name"])
        for one, other in zip(ours.geometry, theirs.geometry, strict=True):
            east, north, height = shapely.get_coordinates(one, include_z=True).T
            there = np.column_stack([*to.transform(east, north), height])
            assert apart_m(shapely.get_coordinates(other, include_z=True), there).max() < 0.001


def test_missing_gates_leave_out_the_instrument_files_only(kassel):
    """Kassel's scans have no gates: everything else is written, and the reason is told."""
    choice = default_kinds(kassel)
    assert isinstance(choice, Choice)
    assert "windscanner" not in choice.kinds
    assert "field-sheet" in choice.kinds
    assert "no gates are declared" in choice.left_out[0]
    assert "--gates FIRST,SPACING,COUNT" in choice.left_out[0]


# The field sheet


class Text(HTMLParser):
    """The text of a page by tag, and every tag that is in it."""

    def __init__(self) -> None:
        super().__init__()
        self.tags: list[str] = []
        self.rows: list[list[str]] = []
        self.all: list[str] = []

    def handle_starttag(self, tag: str, attrs: Any) -> None:  # noqa: ARG002
        self.tags.append(tag)
        if tag == "tr":
            self.rows.append([])
        elif tag in ("td", "th") and self.rows:
            self.rows[-1].append("")

    def handle_data(self, data: str) -> None:
        self.all.append(data)
        if self.rows and self.rows[-1]:
            self.rows[-1][-1] = f"{self.rows[-1][-1]} {data.strip()}".strip()


def page_of(html):
    page = Text()
    page.feed(html)
    return page


def test_sheet_has_a_page_for_each_lidar_with_its_angles(hovsore):
    """Sterenn's own head azimuth at the cup stands on it, and the bearing that a compass shows."""
    page = page_of(field_sheet_html(hovsore, declination_deg=3.2))
    assert page.tags.count("article") == 3
    row = next(row for row in page.rows if row and row[0] == "cup sector")
    point = next(item for item in hovsore.pointings if item.lidar == "WS_S")
    assert [float(cell) for cell in row[1:7]] == pytest.approx(
        [
            point.azimuth_true_deg,
            point.azimuth_grid_deg,
            point.azimuth_true_deg - 3.2,
            point.azimuth_head_deg,
            point.elevation_deg,
            point.elevation_head_deg,
        ],
        abs=0.06,
    )
    assert [row[8], row[9].split()[0]] == ["20", "1166.0"]


def test_sheet_without_declination_has_no_magnetic_bearing(hovsore):
    """It says how to get them instead."""
    text = " ".join(page_of(field_sheet_html(hovsore)).all)
    assert "magn." not in text
    assert "--declination" in text


def test_sight_agrees_with_the_geodesic(hovsore):
    """Azimuth and distance of stand 2 from Sterenn against the geodesic on the ellipsoid."""
    lidar = hovsore.site.lidar("WS_S")
    there = hovsore.site.turbine("stand 2").position
    found = sight(hovsore.exact_places, lidar, "stand 2", "base", there)
    (lon1, lat1, _), (lon2, lat2, _) = degrees(hovsore, [lidar.position, there])
    azimuth, _, distance = pyproj.Geod(ellps="WGS84").inv(lon1, lat1, lon2, lat2)
    assert found.azimuth_true_deg == pytest.approx(azimuth % 360, abs=1e-3)
    assert found.range_m == pytest.approx(distance, abs=0.01)


def test_names_stay_text_on_the_sheet_and_in_the_kmz(moor, tmp_path):
    """Markup and formulas in a name reach neither the page, nor Google Earth, nor a spreadsheet as such."""
    lidar = {"name": EVIL, "position": [500000, 6250000, 10], "instrument": "windcube-200s"}
    plan = moor(lidars=[lidar], scans=[], pairs=[], name=EVIL)
    export(plan, tmp_path, ("kmz", "field-sheet", "csv"))
    html = (tmp_path / "field_sheet.html").read_text(encoding="utf-8")
    page = page_of(html)
    assert "script" not in page.tags
    assert EVIL in " ".join(page.all)
    assert pyogrio.read_dataframe(tmp_path / "plan.kmz", layer="lidars")["Name"][0] == EVIL
    with zipfile.ZipFile(tmp_path / "plan.kmz") as packed:
        assert ElementTree.fromstring(packed.read("doc.kml")).find(f".//{KML}script") is None


def test_sheet_says_how_far_to_search_and_which_targets_fix_the_head():
    """The rehearsal at Høvsøre: three standard deviations of azimuth, and the same three targets as `cnr-map plan`."""
    plan = Plan(load_site(EXAMPLES / "hovsore" / "hard_target_test.yaml"))
    page = page_of(field_sheet_html(plan))
    row = next(row for row in page.rows if row and row[0].startswith("tip of tower N"))
    off_deg = np.hypot(0.02, 0.02) / 801.2 * 180 / np.pi / np.cos(np.deg2rad(11.5))
    tilt_deg = 0.03 * np.tan(np.deg2rad(11.5))
    std_deg = np.linalg.norm([0.05, 0.02, tilt_deg, off_deg])
    assert float(row[-5]) == pytest.approx(3 * std_deg, abs=0.006)
    assert "Map tip at stand 2, tip of tower N, tip of tower S" in " ".join(page.all)


def test_report_holds_the_sheet_of_each_lidar(moor, monkeypatch):
    """The same page as alone, under its own heading; names stay text there too."""
    lidar = {"name": EVIL, "position": [500000, 6250000, 10], "instrument": "windcube-200s"}
    monkeypatch.setattr("planner.scene.opengl.off_screen_window", lambda: None)
    html = report_html([moor(lidars=[lidar], scans=[], pairs=[])])
    page = page_of(html[html.index('id="sheets-1"') :])
    assert page.tags.count("article") == 1
    assert "script" not in page.tags
    assert "Setting up" in page.all
    assert any(EVIL in text for text in page.all)


def test_sheet_needs_a_lidar(moor):
    """Said plainly."""
    with pytest.raises(InputError, match="no lidar"):
        field_sheet_html(moor(lidars=[], scans=[], pairs=[]))


# The command


def test_export_command_lists_what_it_wrote(tmp_path, capsys):
    """--json names every file; all of them are there, and nothing else."""
    site = Path(__file__).resolve().parents[2] / "examples" / "hovsore" / "site.yaml"
    assert (
        run(["export", str(site), "--as", "csv,scan-table", "--out", str(tmp_path / "o"), "--json", "-q"])
        == 0
    )
    files = json.loads(capsys.readouterr().out)["files"]
    assert sorted(files) == sorted(str(path) for path in (tmp_path / "o").rglob("*"))
    assert [Path(name).name for name in files] == [
        *("beams.csv", "crossings.csv", "layout.csv", "pointing.csv", "scan_table.csv", "scan_table.json"),
    ]


def test_export_command_refuses_an_unknown_kind(capsys, tmp_path):
    """Exit code 2 and the words that are allowed."""
    assert run(["export", "site.yaml", "--as", "gpkg,shp", "--out", str(tmp_path)]) == 2
    assert "allowed: gpkg, kmz" in capsys.readouterr().err


def test_plan_without_scans_still_has_its_places(moor, tmp_path):
    """A site with lidars and targets only."""
    plan: Plan = moor(scans=[], pairs=[])
    export(plan, tmp_path, default_kinds(plan).kinds)
    assert {str(name) for name, _ in pyogrio.list_layers(tmp_path / "plan.gpkg")} == {"lidars", "targets"}
