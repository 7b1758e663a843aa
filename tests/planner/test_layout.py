"""Layouts from every GIS format into a site file and back."""

import json
from pathlib import Path

import geopandas
import numpy as np
import pandas as pd
import pyogrio
import pytest
import shapely

from geometry.errors import InputError
from planner.cli import run
from planner.files.layout import layout_site, load_layout
from planner.files.layout_yaml import layout_text
from planner.files.yaml_site import load_site, parse_site
from planner.handover.export import export
from planner.handover.gis_layers import site_layers
from planner.plan import Plan
from planner.site import Site

SITE = {
    "name": "full",
    "crs": "EPSG:32632",
    "lidars": [
        {
            **{
                "name": "A: 1 # no",
                "position": [447450.5481, 6256541.1352, 4.0543],
                "instrument": "windcube-200s",
            },
            **{
                "north": "grid",
                "azimuth_offset_deg": 3.46,
                "uncertainty": {"position_m": 0.02, "radial_speed_mps": 0.2},
                "signal": {"cnr_db": -12.5, "range_m": 1000},
                "mounting": {"heading_deg": 12.5, "pitch_deg": -0.1},
            },
        },
        {
            **{"name": "=B", "position": [447893.983, 6256558.133, 5.078]},
            "instrument": {"name": "own", "pulses": [{"pulse_ns": 200, "pulse_repetition_hz": 20000}]},
        },
    ],
    "masts": [
        {"name": "mast", "position": [447647.39, 6255435.76, 4.836], "height_m": 116.5, "width_m": 1.5}
    ],
    "turbines": [
        {
            **{"name": "stand 2", "position": [447647.39, 6256566.76, 4.836], "hub_height_m": 84},
            **{"rotor_diameter_m": 90, "tower_diameter_m": 4.2, "thrust_coefficient": 0.75},
        }
    ],
    "obstacles": [
        {
            **{
                "name": "barn",
                "position": [447700, 6255500, 4],
                "width_m": 12,
                "length_m": 30,
                "height_m": 8,
            },
            "azimuth_deg": 35,
        }
    ],
    "hard_targets": [{"name": "tip", "on": "mast", "shape": "tip", "size_m": 0.1, "uncertainty_m": 0.2}],
    "targets": [
        {"name": "cup", "mast": "mast", "height_m": 120},
        {"name": "field", "position": [447900.1234, 6255300.5678, 107.25]},
    ],
}


@pytest.fixture(scope="module")
def site():
    return Site.model_validate(SITE)


@pytest.fixture(scope="module")
def written(site, tmp_path_factory):
    """The site as a layout in every format, by our export or, where that has none, by GDAL."""
    folder = tmp_path_factory.mktemp("layouts")
    export(Plan(site), folder, ("gpkg", "kmz", "csv", "geojson"))
    tables = site_layers(site)
    together = pd.concat(list(tables.values()), ignore_index=True)
    pyogrio.write_dataframe(
        together.to_crs(4326),
        folder / "all.geojson",
        driver="GeoJSON",
        layer_options={"RFC7946": "YES", "COORDINATE_PRECISION": "10"},
    )
    (folder / "shapes").mkdir()
    for name, table in tables.items():
        table.rename(columns=lambda column: column[:10]).to_file(folder / "shapes" / f"{name}.shp")
    whole = folder / "lonely.kml"
    for name, table in tables.items():
        shown = table.to_crs(4326).rename(columns={"name": "Name"}).assign(altitudeMode="absolute")
        pyogrio.write_dataframe(shown, whole, layer=name, driver="LIBKML", append=whole.exists())
    return folder


def same(read: Site, site: Site) -> None:
    """Every noun is there with every field, positions within 1 mm."""
    for key in ("lidars", "masts", "turbines", "obstacles", "hard_targets", "targets"):
        ours, theirs = ({item.name: item for item in getattr(which, key)} for which in (site, read))
        assert ours.keys() == theirs.keys()
        for name, item in ours.items():
            assert item.model_dump(exclude={"position"}) == theirs[name].model_dump(exclude={"position"})
            if item.position is not None:
                assert np.abs(np.subtract(theirs[name].position, item.position)).max() < 0.001


@pytest.mark.parametrize(
    "name", ["layout.csv", "plan.gpkg", "plan.kmz", "geojson", "all.geojson", "lonely.kml", "shapes"]
)
def test_round_trip_loses_nothing(name, written, site):
    """Site -> file -> site file -> site: all fields, positions and heights within 1 mm."""
    path = written / name
    layout = load_layout(path, crs="EPSG:32632")
    same(layout_site(path, layout, "full"), site)
    same(parse_site(layout_text(path, layout, "full")), site)


@pytest.mark.parametrize("name", ["plan.gpkg", "plan.kmz", "geojson", "layout.csv"])
def test_heights_above_the_ellipsoid_stay_where_they_are(name, tmp_path):
    """Every file says what its heights count from: above the ellipsoid they come back as they were, whatever KML needs."""
    site = Site.model_validate({**SITE, "height_datum": "ellipsoidal", "geoid_undulation_m": 41.5})
    export(Plan(site), tmp_path, ("gpkg", "kmz", "csv", "geojson"))
    read = layout_site(tmp_path / name, load_layout(tmp_path / name, crs="EPSG:32632"), "x")
    assert read.geoid_undulation_m == 41.5
    lift_m = 0.0 if read.height_datum == "ellipsoidal" else 41.5
    for lidar in site.lidars:
        assert read.lidar(lidar.name).position[2] + lift_m == pytest.approx(lidar.position[2], abs=0.001)


def test_shapefile_with_its_short_column_names(site, tmp_path):
    """Columns cut to ten letters are known; everything in one file of points comes back."""
    together = pd.concat(list(site_layers(site).values()), ignore_index=True)
    together.rename(columns=lambda name: name[:10]).to_file(tmp_path / "all.shp")
    same(layout_site(tmp_path / "all.shp", load_layout(tmp_path / "all.shp"), "x"), site)


def test_layout_of_another_crs_is_brought_to_the_sites(tmp_path):
    """ETRS89 / UTM 33N written, UTM 32N read: where pyproj alone puts it."""
    import pyproj

    table = geopandas.GeoDataFrame(
        {"role": ["Target"], "name": ["T"]},
        geometry=[shapely.Point(82000.0, 6260000.0, 50.0)],
        crs="EPSG:25833",
    )
    table.to_file(tmp_path / "t.gpkg")
    read = load_layout(tmp_path / "t.gpkg", crs="EPSG:25832").pieces["targets"][0]["position"]
    there = pyproj.Transformer.from_crs("EPSG:25833", "EPSG:25832", always_xy=True).transform(
        82000.0, 6260000.0
    )
    assert np.abs(np.subtract(read, (*there, 50.0))).max() < 0.001


def test_degrees_without_a_site_crs_take_their_utm_zone(tmp_path):
    """And say so: 8.15° east is zone 32."""
    path = tmp_path / "t.csv"
    path.write_text("role;name;longitude;latitude;z_m\ntarget;T;8.15;56.44;80\n", encoding="utf-8")
    layout = load_layout(path)
    assert layout.crs == "EPSG:32632"
    assert "--crs" in layout.notes[0]


def test_layout_without_crs_is_refused_with_the_way_to_state_it(tmp_path):
    """A CSV in metres and a Shapefile without .prj; stated on the command line they are read."""
    path = tmp_path / "t.csv"
    path.write_text("role,name,easting_m,northing_m,z_m\ntarget,T,447900,6255300,80\n", encoding="utf-8")
    table = geopandas.GeoDataFrame(
        {"role": ["target"], "name": ["T"]}, geometry=[shapely.Point(447900, 6255300, 80)]
    )
    with pytest.warns(UserWarning, match="crs"):
        table.to_file(tmp_path / "t.shp")
    for layout in (path, tmp_path / "t.shp"):
        with pytest.raises(InputError, match=r"does not say in which CRS .* --layout-crs"):
            load_layout(layout, crs="EPSG:32632")
        read = load_layout(layout, layout_crs="EPSG:32632")
        assert read.pieces["targets"][0]["position"] == [447900.0, 6255300.0, 80.0]


def test_every_fault_in_one_pass(tmp_path):
    """Role, name, height and coordinates, each with its row."""
    path = tmp_path / "t.csv"
    path.write_text(
        "role,name,easting_m,northing_m,z_m,crs\n"
        "tree,a,447900,6255300,80,EPSG:32632\n"
        "target,,447900,6255300,80,EPSG:32632\n"
        "target,c,447900,6255300,,EPSG:32632\n"
        "target,d,here,6255300,80,EPSG:32632\n",
        encoding="utf-8",
    )
    with pytest.raises(InputError) as refused:
        load_layout(path)
    text = str(refused.value)
    assert "4 faults" in text
    for words in (
        "row 1 ('a'): role tree came",
        "row 2: it has no name",
        "row 3 ('c'): it has no height",
        "row 4 ('d')",
    ):
        assert words in text


def test_missing_fields_are_named_with_their_thing(tmp_path):
    """A turbine without its hub height, a lidar without its instrument."""
    path = tmp_path / "t.csv"
    path.write_text(
        "role,name,easting_m,northing_m,z_m,crs,rotor_diameter_m\n"
        "turbine,T1,447900,6255300,8,EPSG:32632,big\nlidar,L1,447800,6255300,8,EPSG:32632,\n",
        encoding="utf-8",
    )
    with pytest.raises(InputError) as refused:
        layout_site(path, load_layout(path), "x")
    assert "'T1' (turbines[0]): turbines[0].hub_height_m: nothing came" in str(refused.value)
    assert "'big' came" in str(refused.value)
    assert "'L1' (lidars[0]): lidars[0].instrument" in str(refused.value)


def test_placemark_on_the_ground_has_no_height(tmp_path):
    """Google Earth's clamped points state an altitude of 0 that means nothing."""
    kml = (
        '<kml xmlns="http://www.opengis.net/kml/2.2"><Document><Folder><name>targets</name><Placemark><name>T</name>'
        "<Point><coordinates>8.15,56.44,0</coordinates></Point></Placemark></Folder></Document></kml>"
    )
    (tmp_path / "t.kml").write_text(kml, encoding="utf-8")
    with pytest.raises(InputError, match="clamped to the ground"):
        load_layout(tmp_path / "t.kml")
    (tmp_path / "t.kml").write_text(
        kml.replace("<Point>", "<Point><altitudeMode>absolute</altitudeMode>").replace(",0<", ",75<"),
        encoding="utf-8",
    )
    assert load_layout(tmp_path / "t.kml").pieces["targets"][0]["position"][2] == 75.0


def test_target_moved_off_its_mast_keeps_its_new_place(site, tmp_path):
    """Someone dragged the point in a GIS: the place counts, and it is said."""
    tables = site_layers(site)
    tables["targets"].geometry = tables["targets"].geometry.translate(10.0, 0.0, 0.0)
    for name, table in tables.items():
        table.to_file(tmp_path / "t.gpkg", layer=name)
    layout = load_layout(tmp_path / "t.gpkg")
    cup = layout.pieces["targets"][0]
    assert cup["position"] == pytest.approx([447657.39, 6255435.76, 124.836])
    assert "'cup' lies 10.00 m" in layout.notes[0]


@pytest.mark.parametrize(
    ("name", "text", "says"),
    [
        ("t.txt", "", "a layout comes as"),
        ("t.csv", "role,name\n", "easting_m and northing_m"),
        (
            "t.csv",
            "role,name,easting_m,northing_m,crs\na,b,1,2,EPSG:32632\na,c,1,2,EPSG:32633\n",
            "several CRS",
        ),
        ("t.geojson", "{", "cannot be read"),
        ("t.kmz", "no zip", "cannot be read"),
        ("t.gpkg", "no database", "cannot be read"),
    ],
)
def test_files_that_are_no_layout(tmp_path, name, text, says):
    """Said plainly, with what is taken."""
    (tmp_path / name).write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=says):
        load_layout(tmp_path / name)


def test_site_crs_in_degrees_is_refused(written):
    """The site's CRS must be projected."""
    with pytest.raises(InputError, match="projected"):
        load_layout(written / "layout.csv", crs="EPSG:4326")


def test_new_makes_a_site_file_of_a_layout(written, site, tmp_path, capsys):
    """`lidarplan new DIR --from LAYOUT --crs ...` and `point` goes on from it."""
    folder = tmp_path / "new"
    code = run(
        [
            "new",
            str(folder),
            "--from",
            str(written / "plan.gpkg"),
            "--crs",
            "EPSG:32632",
            "--name",
            "x: y",
            "--json",
        ]
    )
    assert code == 0
    assert json.loads(capsys.readouterr().out)["site"] == str(folder / "site.yaml")
    read = load_site(folder / "site.yaml")
    assert read.name == "x: y"
    same(read, site)
    assert run(["point", str(folder / "site.yaml"), "--json"]) == 0
    assert len(json.loads(capsys.readouterr().out)) == 4


def test_new_never_touches_a_site_file_that_is_there(written, tmp_path, capsys):
    """Exit code 2, and the file stays."""
    (tmp_path / "site.yaml").write_text("mine", encoding="utf-8")
    assert run(["new", str(tmp_path), "--from", str(written / "plan.gpkg")]) == 2
    assert "exists already" in capsys.readouterr().err
    assert Path(tmp_path / "site.yaml").read_text(encoding="utf-8") == "mine"


def test_names_of_a_layout_cannot_break_the_site_file(tmp_path):
    """A name with a line break is refused, one with YAML in it stays a name."""
    path = tmp_path / "t.csv"
    row = 'target,"{name}",447900,6255300,80,EPSG:32632\n'
    head = "role,name,easting_m,northing_m,z_m,crs\n"
    evil = "a} # x: [b, *c, !!python/object:d"
    path.write_text(head + row.format(name=evil), encoding="utf-8")
    assert parse_site(layout_text(path, load_layout(path), "x")).targets[0].name == evil
    path.write_text(head + row.format(name="a\nlidars: []"), encoding="utf-8")
    with pytest.raises(InputError, match="one line"):
        layout_text(path, load_layout(path), "x")
