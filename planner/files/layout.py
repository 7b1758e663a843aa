"""Layouts from GIS files and tables: points with a `role` (lidar, mast, turbine, ...) -> pieces of a site.

CSV, GeoJSON, GeoPackage, KML, KMZ and Shapefile, in any CRS. A layout that does not say its CRS is refused:
a guess would put the site somewhere else in silence.
"""

import json
import tempfile
import zipfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from geometry.arrays import FloatArray
from geometry.errors import InputError
from planner.faults import key_of
from planner.nouns import Noun

if TYPE_CHECKING:
    from geopandas import GeoDataFrame
    from pyproj import CRS

    from planner.site import Site

KEYS = {  # role -> key of the site file
    "lidar": "lidars",
    "mast": "masts",
    "turbine": "turbines",
    "obstacle": "obstacles",
    "hard_target": "hard_targets",
    "target": "targets",
}
RESULTS = (
    "beams",
    "sectors",
    "wakes",
    "excluded_winds",
    "crossings",
    "placement",
)  # layers of an export: no layout
TEXTS = ("instrument", "north", "shape", "on", "mast")  # fields that are no numbers
MOUNTING = ("heading_deg", "pitch_deg", "roll_deg", "range_offset_m")
LEFT_OUT = ("name", "position", "mounting", "uncertainty", "signal")  # fields that no column holds
RENAMED = {"above_base_m": "height_m"}  # of targets and hard targets: `height_m` is a mast's own
SHAPEFILE_LETTERS = 10  # longest column name there

MAX_BYTES = 200_000_000  # of a KML inside a KMZ
GEOGRAPHIC = "EPSG:4326"
EASTINGS = (("easting_m", "northing_m"), ("easting", "northing"), ("x", "y"))
DEGREES = (("longitude_deg", "latitude_deg"), ("longitude", "latitude"), ("lon", "lat"))
HEIGHTS = ("z_m", "z", "elevation_m")

READABLE = (".csv", ".geojson", ".json", ".gpkg", ".kml", ".kmz", ".shp")
POSITION_DIGITS = 4  # a tenth of a millimetre
OFF_MAST_M = 0.01  # farther from its mast than this, a target has been moved by hand


class Layout(NamedTuple):
    """What a layout says, by the keys of a site file."""

    crs: str  # of the site, projected
    height_datum: str | None  # where the layout states it
    geoid_undulation_m: float | None
    pieces: dict[str, list[dict[str, Any]]]
    notes: tuple[str, ...]  # what the user should know


class _Row(NamedTuple):
    where: str  # for messages: layer and number of the row
    role: str
    name: str
    position: tuple[float, float, float]
    cells: Mapping[str, Any]


def load_layout(path: Path, *, crs: str | None = None, layout_crs: str | None = None) -> Layout:
    """Read a layout.

    Parameters
    ----------
    path
        The file. Columns: `role` (or a layer called lidars, masts, ...), `name`, and the fields of the site file
        for that role (`hub_height_m`, `instrument`, ...). A point without a height needs a column `z_m`. A CSV
        needs `easting_m, northing_m, z_m` or `longitude_deg, latitude_deg, z_m`.
    crs
        Projected CRS of the site; default: the layout's own, or, of one in degrees, its UTM zone.
    layout_crs
        CRS of a layout that does not say it.

    Returns
    -------
    Layout
        Positions in the site's CRS [m].

    Raises
    ------
    InputError
        With every fault of the layout.
    """
    tables = _tables(path, layout_crs)
    site_crs, notes = _site_crs(path, tables, crs)
    rows: list[_Row] = []
    faults: list[str] = []
    for name, table in tables.items():
        for row in _rows(path, name, table, site_crs):
            if isinstance(row, str):
                faults.append(row)
            else:
                rows.append(row)
    if not rows and not faults:
        faults.append("no point with a role is in it; allowed roles: " + ", ".join(KEYS))
    pieces, more = _pieces(rows)
    if faults:
        raise _refusal(path, faults)
    datums = {str(row.cells["height_datum"]) for row in rows if row.cells.get("height_datum")}
    undulations = {
        float(row.cells["geoid_undulation_m"]) for row in rows if row.cells.get("geoid_undulation_m")
    }
    if len(datums) > 1 or len(undulations) > 1:
        raise _refusal(
            path, [f"heights of several kinds came ({', '.join(sorted(datums))}); allowed: one for all"]
        )
    datum = next(iter(datums), None)
    return Layout(site_crs, datum, next(iter(undulations), None), pieces, (*notes, *more))


def layout_site(path: Path, layout: Layout, name: str) -> "Site":
    """Make a site of a layout.

    Parameters
    ----------
    path
        Where it came from, for messages.
    layout
        As read.
    name
        Of the site.

    Raises
    ------
    InputError
        With every field that is missing or wrong.
    """
    from pydantic import ValidationError

    from planner.files.fault_words import fault_of, is_echo
    from planner.site import CHECKED, Site
    from planner.site_faults import faults_of

    raw = site_mapping(layout, name)
    faults = faults_of(raw)
    try:
        site = Site.model_validate(raw, context=CHECKED)
    except ValidationError as error:
        details = [item for item in error.errors(include_url=False) if not is_echo(item)]
        found = [fault_of(item, raw) for item in details]
        faults = found + [fault for fault in faults if fault.loc not in {item.loc for item in found}]
        site = None
    if faults or site is None:
        raise _refusal(path, [f"{_named(raw, fault.loc)}{fault}" for fault in faults])
    return site


def site_mapping(layout: Layout, name: str) -> dict[str, Any]:
    """A layout as the mapping that a site file holds."""
    datum = {} if layout.height_datum is None else {"height_datum": layout.height_datum}
    geoid = {} if layout.geoid_undulation_m is None else {"geoid_undulation_m": layout.geoid_undulation_m}
    return {"name": name, "crs": layout.crs, **datum, **geoid, **layout.pieces}


def _named(raw: Mapping[str, Any], loc: tuple[str | int, ...]) -> str:
    """The name of the thing that a fault is about, since a layout has no keys and numbers."""
    if len(loc) > 1 and isinstance(loc[1], int) and loc[0] in raw:
        return f"'{raw[str(loc[0])][loc[1]].get('name')}' ({key_of(loc[:2])}): "
    return ""


def _refusal(path: Path, faults: list[str]) -> InputError:
    head = f"{path}: {len(faults)} fault{'s' if len(faults) > 1 else ''} in this layout; nothing was done."
    return InputError("\n".join([head, *(f"  {text}" for text in faults)]))


# Files -> tables


def _tables(path: Path, layout_crs: str | None) -> "dict[str, GeoDataFrame]":
    """Every layer that may hold a layout, with its CRS and with column names in small letters."""
    if not path.is_file():
        raise InputError(f"{path}: there is no such file; give {', '.join(READABLE)}")
    if path.suffix.lower() not in READABLE:
        raise InputError(f"{path}: a layout comes as {', '.join(READABLE)}")
    tables = _csv_table(path, layout_crs) if path.suffix.lower() == ".csv" else _gis_tables(path)
    for name, table in tables.items():
        if table.crs is None:
            if layout_crs is None:
                raise InputError(
                    f"{path}: it does not say in which CRS its coordinates are; say it with --layout-crs "
                    "EPSG:..., or give the file its CRS (a Shapefile its .prj, a CSV a column `crs`)"
                )
            tables[name] = table.set_crs(_crs(layout_crs, "--layout-crs"))
        elif layout_crs is not None and table.crs != _crs(layout_crs, "--layout-crs"):
            raise InputError(
                f"{path}: it says {table.crs.name} itself, and --layout-crs {layout_crs} came; leave --layout-crs out"
            )
    return tables


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
            table, geometry=points, crs=None if crs is None else _crs(crs, "crs")
        )
    }


def _without_guard(text: str) -> str:
    """Text without the apostrophe that keeps a spreadsheet from taking it for a formula."""
    from planner.report_values import FORMULA_STARTS

    return text[1:] if text.startswith("'") and text[1:].startswith(FORMULA_STARTS) else text


def _crs(text: str, what: str) -> "CRS":
    from pyproj import CRS
    from pyproj.exceptions import CRSError

    try:
        return CRS.from_user_input(text)
    except CRSError:
        raise InputError(
            f"{what} {text} came, which is no CRS that is known; give one such as EPSG:32632"
        ) from None


def _site_crs(path: Path, tables: "dict[str, GeoDataFrame]", crs: str | None) -> tuple[str, list[str]]:
    """The site's CRS as a site file writes it, checked, and how it was found."""
    from geometry.projection import projection_of

    if crs is not None:
        projection_of(crs)
        return crs, []
    if not tables:
        raise InputError(f"{path}: there is nothing in it")
    table = next(iter(tables.values()))
    own = table.crs
    if own.is_geographic:
        zone = table.estimate_utm_crs().to_string()
        return zone, [f"The layout is in degrees: its UTM zone, {zone}, is taken; --crs takes another."]
    authority = own.to_authority()
    if authority is None:
        raise InputError(f"{path}: its CRS ({own.name}) has no code; give the site's with --crs EPSG:...")
    text = ":".join(authority)
    projection_of(text)
    return text, []


# Tables -> rows


def _rows(path: Path, layer: str, table: "GeoDataFrame", site_crs: str) -> Iterator[_Row | str]:
    """The rows of a table in the site's CRS, or, of a row at fault, what is wrong with it."""
    shapes = table.geometry.to_numpy()
    cells = table.drop(columns="geometry").to_dict("records")
    kml = path.suffix.lower() in (".kml", ".kmz")
    for number, (shape, record) in enumerate(zip(shapes, cells, strict=True), start=1):
        known = {str(key): value for key, value in record.items() if _is_given(value)}
        where = f"{layer}, row {number}" + (f" ('{known['name']}')" if "name" in known else "")
        found = _row(where, layer, shape, known, kml=kml)
        if isinstance(found, str):
            yield f"{where}: {found}"
            continue
        try:
            yield found._replace(position=_moved(found.position, table.crs, site_crs))
        except InputError as error:
            yield f"{where}: {error}"


def _row(where: str, layer: str, shape: Any, known: dict[str, Any], *, kml: bool) -> _Row | str:
    """One row in the layout's own CRS, or what is wrong with it."""
    role = _role(known.get("role"), layer)
    if role is None:
        return f"role {known.get('role', 'nothing')} came; allowed: {', '.join(KEYS)}"
    if "name" not in known:
        return "it has no name; give a column `name`"
    if shape is None or shape.is_empty or shape.geom_type != "Point":
        return f"{'nothing' if shape is None else shape.geom_type} came; allowed: a point"
    if not np.isfinite([shape.x, shape.y]).all():
        return "its coordinates are no numbers"
    height_m = _height_m(shape, known, kml=kml)
    if height_m is None:
        held = "it is clamped to the ground; make it absolute" if kml and shape.has_z else "it has no height"
        return f"{held}, or give a column `z_m`, in metres"
    return _Row(where, role, str(known["name"]).strip(), (shape.x, shape.y, height_m), known)


def _is_given(value: object) -> bool:
    return value is not None and value == value and str(value).strip() != ""


def _role(value: object, layer: str) -> str | None:
    """What a row is: its role, else the name of its layer."""
    word = str(layer if value is None else value).strip().lower().replace(" ", "_")
    return next((role for role, key in KEYS.items() if word in (role, key)), None)


def _height_m(shape: Any, known: Mapping[str, Any], *, kml: bool) -> float | None:
    """The height of a point: its own, unless Google Earth clamps it to the ground; else that of a column."""
    for column in HEIGHTS:
        if column in known:
            return _number(known[column])
    if not shape.has_z or (kml and known.get("altitudemode") != "absolute") or not np.isfinite(shape.z):
        return None
    return float(shape.z)


def _number(value: object) -> float | None:
    try:
        number = float(str(value))
    except ValueError:
        return None
    return number if np.isfinite(number) else None


def _moved(position: tuple[float, float, float], crs: "CRS", site_crs: str) -> tuple[float, float, float]:
    """A position in the site's CRS; the height stays as it is."""
    from pyproj import Transformer
    from pyproj.exceptions import ProjError

    from geometry.projection import projection_of

    try:
        move = Transformer.from_crs(
            crs.to_2d(), projection_of(site_crs).crs, always_xy=True, allow_ballpark=False
        )
        easting, northing = move.transform(*position[:2], errcheck=True)
    except ProjError as error:
        raise InputError(
            f"{crs.name} cannot be brought to {site_crs} here ({error}); convert the layout with a GIS first"
        ) from error
    return easting, northing, position[2]


# Rows -> pieces


def _pieces(rows: list[_Row]) -> tuple[dict[str, list[dict[str, Any]]], list[str]]:
    """The rows as entries of a site file, in its order of keys, and what was noticed."""
    pieces: dict[str, list[dict[str, Any]]] = {}
    notes: list[str] = []
    masts = {row.name: row for row in rows if row.role == "mast"}
    for role, key in KEYS.items():
        entries = [_piece(row, masts, notes) for row in rows if row.role == role]
        if entries:
            pieces[key] = entries
    return pieces, notes


def _piece(row: _Row, masts: Mapping[str, _Row], notes: list[str]) -> dict[str, Any]:
    position = [round(value, POSITION_DIGITS) for value in row.position]
    fields = _fields(row)
    on = fields.get("mast", fields.get("on"))
    if row.role in ("target", "hard_target") and on in masts:
        away_m = _off_mast_m(row.position, masts[str(on)], fields.get("height_m"))
        if away_m <= OFF_MAST_M:
            return {"name": row.name, **fields}
        notes.append(
            f"'{row.name}' lies {away_m:.2f} m from where its mast '{on}' has it: its own place is taken."
        )
        fields = {key: value for key, value in fields.items() if key not in ("mast", "on", "height_m")}
    return {"name": row.name, "position": position, **fields}


def _off_mast_m(position: tuple[float, float, float], mast: _Row, above_base_m: object) -> float:
    top = above_base_m if above_base_m is not None else mast.cells.get("height_m", 0.0)
    there: FloatArray = np.array(mast.position) + np.array([0.0, 0.0, _number(top) or 0.0])
    return float(np.linalg.norm(np.array(position) - there))


def _fields(row: _Row) -> dict[str, Any]:
    """The columns that a noun of this role knows; a number that is none is left for the site to refuse."""
    from planner import standing

    nouns: tuple[type[Noun], ...] = (
        standing.Lidar,
        standing.Mast,
        standing.Turbine,
        standing.Obstacle,
        standing.HardTarget,
        standing.Target,
    )
    model = dict(zip(KEYS, nouns, strict=True))[row.role]
    fields: dict[str, Any] = {}
    for field in model.model_fields:
        column = next((c for c, f in RENAMED.items() if f == field and "target" in row.role), field)
        if field not in LEFT_OUT and (value := _cell(row.cells, column)) is not None:
            fields[field] = _value(field, value)
    mounting = {key: _value(key, value) for key in MOUNTING if (value := _cell(row.cells, key)) is not None}
    if row.role == "lidar" and any(mounting.values()):
        fields["mounting"] = mounting
    return fields


def _cell(cells: Mapping[str, Any], column: str) -> object:
    """A column's value, also under the name that a Shapefile cuts it to."""
    return cells.get(column, cells.get(column[:SHAPEFILE_LETTERS]))


def _value(field: str, value: object) -> object:
    if field == "instrument" and str(value).startswith("{"):
        try:
            return json.loads(str(value))
        except ValueError:
            return str(value)
    if field in TEXTS:
        return str(value).strip()
    number = _number(value)
    return str(value) if number is None else number
