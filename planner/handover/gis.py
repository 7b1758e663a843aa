"""GIS layers to files: GeoPackage in the site's own CRS, KMZ, GeoJSON and CSV in longitude and latitude.

Heights: a GeoPackage keeps the site's. KML's absolute altitudes count from sea level. RFC 7946 has GeoJSON count
from the ellipsoid; where a site above sea level does not say how high its geoid lies, its own heights are
written, and the column `height_datum` says so.
"""

import csv
import math
import zipfile
from io import StringIO
from pathlib import Path
from typing import TYPE_CHECKING, Any
from xml.etree import ElementTree

import numpy as np

from geometry.errors import InputError, UnavailableError
from planner.palette import CROSSING, EXCLUDED, MAST, OBSTACLE, TURBINE, WAKE, lidar_colour
from planner.report_values import FORMULA_STARTS
from planner.site import Site

if TYPE_CHECKING:
    from geopandas import GeoDataFrame

WGS84 = "EPSG:4326"
KML = "http://www.opengis.net/kml/2.2"
DRAWN = ("OGR_STYLE", "number")  # columns that nobody wants to read
DEGREE_DIGITS = 10  # a hundredth of a millimetre

# Of a layer in Google Earth: colour, width of lines [px], opacity of areas.
STYLES = {
    "masts": (MAST, 3, 1.0),
    "turbines": (TURBINE, 3, 1.0),
    "obstacles": (OBSTACLE, 3, 1.0),
    "wakes": (WAKE, 1, 0.35),
    "excluded_winds": (EXCLUDED, 1, 0.30),
    "crossings": (CROSSING, 2, 1.0),
}
OF_LIDAR = {"lidars": (3, 1.0), "beams": (2, 1.0), "sectors": (1, 0.30)}


def write_geopackage(layers: "dict[str, GeoDataFrame]", path: Path) -> None:
    """Write all layers into one GeoPackage, in the site's CRS and heights."""
    import pyogrio

    for name, layer in layers.items():
        pyogrio.write_dataframe(layer, path, layer=name, driver="GPKG", append=path.exists())


def write_kmz(layers: "dict[str, GeoDataFrame]", site: Site, path: Path) -> None:
    """Write all layers into one KMZ, a folder each, at their absolute altitudes.

    Raises
    ------
    UnavailableError
        If this machine's GDAL has no LIBKML.
    InputError
        If the site's heights are above the ellipsoid and nothing says how high the geoid lies.
    """
    import pyogrio

    if "w" not in pyogrio.list_drivers().get("LIBKML", ""):
        raise UnavailableError(
            "KMZ needs GDAL's LIBKML driver, which this pyogrio does not have; install pyogrio from its wheel, "
            "or leave kmz out of --as"
        )
    lift_m = -_undulation_m(site, "KMZ") if site.height_datum == "ellipsoidal" else 0.0
    document = path.with_suffix(".kml")
    for name, layer in layers.items():
        shown = _lifted(layer.to_crs(WGS84), lift_m).rename(columns={"name": "Name"})
        shown["altitudeMode"] = "absolute"
        if "height_datum" in shown:
            shown["height_datum"] = "above_sea_level"
        shown["OGR_STYLE"] = [_style(name, row) for row in shown.to_dict("records")]
        pyogrio.write_dataframe(shown, document, layer=name, driver="LIBKML", append=document.exists())
    # GDAL loses the layers of a KMZ that it appends to; a KMZ is a KML in a zip
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as packed:
        packed.writestr("doc.kml", _tidied(document.read_bytes()))
    document.unlink()


def _tidied(document: bytes) -> bytes:
    """Put the description of each layer's columns into its folder, where KMZ readers look, and drop what only draws."""
    ElementTree.register_namespace("", KML)
    tree = ElementTree.fromstring(document)
    root = tree.find(f"{{{KML}}}Document")
    if root is None:
        return document
    folders = {folder.get("id"): folder for folder in root.findall(f"{{{KML}}}Document")}
    for schema in root.findall(f"{{{KML}}}Schema"):
        folder = folders.get(str(schema.get("id")).removesuffix(".schema"))
        if folder is not None:
            root.remove(schema)
            folder.insert(1, schema)
    for parent in list(root.iter()):
        for child in [item for item in parent if item.get("name") in DRAWN]:
            parent.remove(child)
    text: bytes = ElementTree.tostring(tree, encoding="utf-8", xml_declaration=True)
    return text


def write_geojson(layers: "dict[str, GeoDataFrame]", site: Site, folder: Path) -> None:
    """Write each layer as GeoJSON after RFC 7946, a file each."""
    import pyogrio

    known = site.height_datum == "ellipsoidal" or site.geoid_undulation_m is not None
    lift_m = site.geoid_undulation_m or 0.0 if site.height_datum == "above_sea_level" else 0.0
    folder.mkdir(parents=True, exist_ok=True)
    for name, layer in layers.items():
        shown = _lifted(layer.to_crs(WGS84), lift_m)
        shown["height_datum"] = "ellipsoidal" if known else site.height_datum
        if site.geoid_undulation_m is not None:
            shown["geoid_undulation_m"] = site.geoid_undulation_m
        pyogrio.write_dataframe(
            shown,
            folder / f"{name}.geojson",
            driver="GeoJSON",
            layer_options={"RFC7946": "YES", "COORDINATE_PRECISION": str(DEGREE_DIGITS)},
        )


def layout_csv(layers: "dict[str, GeoDataFrame]", site: Site) -> str:
    """Write what stands on the site as one CSV table that `lidarplan new --from` reads again."""
    rows: list[dict[str, Any]] = []
    for layer in layers.values():
        longitude, latitude = _degrees(layer)
        for number, record in enumerate(layer.drop(columns="geometry").to_dict("records")):
            point = layer.geometry.iloc[number]
            where = {
                "easting_m": point.x,
                "northing_m": point.y,
                "z_m": point.z,
                "crs": site.crs,
                "height_datum": site.height_datum,
                "longitude_deg": round(float(longitude[number]), DEGREE_DIGITS),
                "latitude_deg": round(float(latitude[number]), DEGREE_DIGITS),
            }
            rows.append({"role": record["role"], "name": record["name"], **where, **record})
    return _csv(rows)


def layer_csv(layer: "GeoDataFrame") -> str:
    """Write a layer's columns as CSV, with the end of each line or the place of each point."""
    rows = []
    for number, record in enumerate(layer.drop(columns="geometry").to_dict("records")):
        easting, northing, height = layer.geometry.iloc[number].coords[-1]
        rows.append({**record, "end_easting_m": easting, "end_northing_m": northing, "end_z_m": height})
    return _csv(rows)


def _csv(rows: list[dict[str, Any]]) -> str:
    """Rows with whatever columns they have; every digit of a number, nothing where nothing is known."""
    columns = list(dict.fromkeys(key for row in rows for key in row))
    out = StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows([_cell(row.get(key)) for key in columns] for row in rows)
    return out.getvalue()


def _cell(value: object) -> str:
    """A value as text; text that a spreadsheet would take for a formula gets an apostrophe in front."""
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return ""
    if isinstance(value, str):
        return f"'{value}" if value.startswith(FORMULA_STARTS) else value
    return repr(float(value)) if isinstance(value, float) else str(value)


def _degrees(layer: "GeoDataFrame") -> "tuple[np.ndarray[Any, Any], np.ndarray[Any, Any]]":
    points = layer.to_crs(WGS84).geometry
    return points.x.to_numpy(), points.y.to_numpy()


def _lifted(layer: "GeoDataFrame", by_m: float) -> "GeoDataFrame":
    """The layer with all heights moved."""
    import shapely

    if not by_m:
        return layer
    moved = layer.copy()
    lift = np.array([0.0, 0.0, by_m])
    moved["geometry"] = shapely.transform(layer.geometry.to_numpy(), lambda xyz: xyz + lift, include_z=True)
    return moved.set_crs(layer.crs, allow_override=True)


def _undulation_m(site: Site, what: str) -> float:
    if site.geoid_undulation_m is None:
        raise InputError(
            f"{what} counts heights from sea level, and the site's are above the ellipsoid; give "
            "geoid_undulation_m, the height of the geoid above the ellipsoid, in the site file"
        )
    return site.geoid_undulation_m


def _style(layer: str, row: dict[str, Any]) -> str:
    """How Google Earth draws a row, in OGR's style language."""
    if layer in OF_LIDAR:
        (width, opacity), colour = OF_LIDAR[layer], lidar_colour(int(row["number"]))
    else:
        colour, width, opacity = STYLES.get(layer, (CROSSING, 2, 1.0))
    fill = f"{colour}{round(255 * opacity):02x}"
    return f"PEN(c:{colour}ff,w:{width}px);BRUSH(fc:{fill});LABEL(c:{colour}ff)"
