"""GIS files and tables -> one table of points for each layer, with its CRS and with column names in small letters."""

import tempfile
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from geometry.errors import InputError

if TYPE_CHECKING:
    from geopandas import GeoDataFrame
    from pyproj import CRS

RESULTS = (
    "beams",
    "sectors",
    "wakes",
    "excluded_winds",
    "crossings",
    "placement",
    "places",
)  # layers of an export: no layout

MAX_BYTES = 200_000_000  # of a KML inside a KMZ
GEOGRAPHIC = "EPSG:4326"
EASTINGS = (("easting_m", "northing_m"), ("easting", "northing"), ("x", "y"))
DEGREES = (("longitude_deg", "latitude_deg"), ("longitude", "latitude"), ("lon", "lat"))

ONE_LAYER = (".geojson", ".json", ".shp")  # of these a folder may hold several
READABLE = (".csv", ".geojson", ".json", ".gpkg", ".kml", ".kmz", ".shp")


def tables_of(path: Path, layout_crs: str | None) -> "dict[str, GeoDataFrame]":
    """Every layer that may hold a layout, with its CRS and with column names in small letters."""
    tables: dict[str, GeoDataFrame] = {}
    for file in _files(path):
        tables |= _csv_table(file, layout_crs) if file.suffix.lower() == ".csv" else _gis_tables(file)
    for name, table in tables.items():
        if table.crs is None:
            if layout_crs is None:
                raise InputError(
                    f"{path}: it does not say in which CRS its coordinates are; say it with --layout-crs "
                    "EPSG:..., or give the file its CRS (a Shapefile its .prj, a CSV a column `crs`)"
                )
            tables[name] = table.set_crs(crs_of(layout_crs, "--layout-crs"))
        elif layout_crs is not None and table.crs != crs_of(layout_crs, "--layout-crs"):
            raise InputError(
                f"{path}: it says {table.crs.name} itself, and --layout-crs {layout_crs} came; leave --layout-crs out"
            )
    return tables


def _files(path: Path) -> list[Path]:
    """The file, or those of a folder: a GeoJSON or Shapefile holds one layer only."""
    if path.is_dir():
        found = [
            file
            for file in sorted(path.iterdir())
            if file.suffix.lower() in ONE_LAYER and file.stem not in RESULTS
        ]
        if found:
            return found
        raise InputError(
            f"{path}: a folder without a layout; give one with {', '.join(ONE_LAYER)}, or a file"
        )
    if not path.is_file():
        raise InputError(f"{path}: there is no such file; give {', '.join(READABLE)}")
    if path.suffix.lower() not in READABLE:
        raise InputError(f"{path}: a layout comes as {', '.join(READABLE)}")
    return [path]


def _gis_tables(path: Path) -> "dict[str, GeoDataFrame]":
    import pyogrio
    from pyogrio.errors import DataSourceError

    tables = {}
    try:
        with _unpacked(path) as file:
            for name in (str(layer) for layer, _ in pyogrio.list_layers(file)):
                if name.lower() not in RESULTS:
                    tables[name] = pyogrio.read_dataframe(file, layer=name)
    except (DataSourceError, ValueError, zipfile.BadZipFile) as error:
        raise InputError(
            f"{path} cannot be read as a GIS file ({error}); give {', '.join(READABLE)}"
        ) from error
    for name, table in tables.items():
        if "geometry" not in table.columns:
            raise InputError(f"{path}, layer '{name}': it has no points, only a table; save it as CSV")
        names = {column: str(column).lower() for column in table.columns if column != "geometry"}
        tables[name] = table.rename(columns=names)
    return {name: table for name, table in tables.items() if len(table)}


@contextmanager
def _unpacked(path: Path) -> Iterator[Path]:
    """A KMZ's only KML as a file of its own: GDAL reads columns there that it does not find in the KMZ."""
    if path.suffix.lower() != ".kmz":
        yield path
        return
    with zipfile.ZipFile(path) as packed, tempfile.TemporaryDirectory() as folder:
        inside = [item for item in packed.infolist() if item.filename.lower().endswith(".kml")]
        if len(inside) != 1 or inside[0].file_size > MAX_BYTES:
            yield path
            return
        file = Path(folder) / "doc.kml"
        file.write_bytes(packed.read(inside[0]))
        yield file


def _csv_table(path: Path, layout_crs: str | None) -> "dict[str, GeoDataFrame]":
    import geopandas
    import pandas

    try:
        table = pandas.read_csv(
            path, dtype=str, keep_default_na=False, encoding="utf-8-sig", sep=None, engine="python"
        )
    except (ValueError, UnicodeDecodeError) as error:
        raise InputError(f"{path} cannot be read as CSV in UTF-8 ({error})") from error
    table.columns = [str(column).strip().lower() for column in table.columns]
    pair = next((pair for pair in (*EASTINGS, *DEGREES) if set(pair) <= set(table.columns)), None)
    if pair is None:
        raise InputError(
            f"{path}: columns {', '.join(table.columns)} came; a layout needs easting_m and northing_m, or "
            "longitude_deg and latitude_deg"
        )
    stated = {str(value).strip() for value in table["crs"]} - {""} if "crs" in table.columns else set()
    if len(stated) > 1:
        raise InputError(f"{path}: several CRS came ({', '.join(sorted(stated))}); allowed: one for all rows")
    crs = GEOGRAPHIC if pair in DEGREES and layout_crs is None else next(iter(stated), None)
    x, y = (pandas.to_numeric(table[column], errors="coerce") for column in pair)
    table = table.map(_without_guard)
    points = geopandas.points_from_xy(x, y)
    return {
        path.stem: geopandas.GeoDataFrame(
            table, geometry=points, crs=None if crs is None else crs_of(crs, "crs")
        )
    }


def _without_guard(text: str) -> str:
    """Text without the apostrophe that keeps a spreadsheet from taking it for a formula."""
    from planner.report_values import FORMULA_STARTS

    return text[1:] if text.startswith("'") and text[1:].startswith(FORMULA_STARTS) else text


def crs_of(text: str, what: str) -> "CRS":
    from pyproj import CRS
    from pyproj.exceptions import CRSError

    try:
        return CRS.from_user_input(text)
    except CRSError:
        raise InputError(
            f"{what} {text} came, which is no CRS that is known; give one such as EPSG:32632"
        ) from None
