"""Rows of a layout -> entries of a site file: what a point is, where it stands, and which columns a noun knows."""

import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from geometry.arrays import FloatArray
from geometry.errors import InputError
from planner.nouns import Noun

if TYPE_CHECKING:
    from geopandas import GeoDataFrame
    from pyproj import CRS

KEYS = {  # role -> key of the site file
    "lidar": "lidars",
    "mast": "masts",
    "turbine": "turbines",
    "obstacle": "obstacles",
    "hard_target": "hard_targets",
    "target": "targets",
}
TEXTS = ("instrument", "north", "shape", "on", "mast", "uncertainty", "signal")  # fields that are no numbers
MOUNTING = ("heading_deg", "pitch_deg", "roll_deg", "range_offset_m")
NESTED = ("instrument", "uncertainty", "signal")  # a column of JSON each; an instrument may be a name as well
LEFT_OUT = ("name", "position", "mounting")  # fields that are no column of their own
RENAMED = {  # field -> column, where the field's name is another thing's as well, or ten letters of it are
    "lidar": {"uncertainty": "lidar_uncertainty"},
    "hard_target": {"height_m": "above_base_m"},
    "target": {"height_m": "above_base_m"},
}
SHAPEFILE_LETTERS = 10  # longest column name there

HEIGHTS = ("z_m", "z", "elevation_m")
POSITION_DIGITS = 4  # a tenth of a millimetre
OFF_MAST_M = 0.01  # farther from its mast than this, a target has been moved by hand


class Row(NamedTuple):
    where: str  # for messages: layer and number of the row
    role: str
    name: str
    position: tuple[float, float, float]
    cells: Mapping[str, Any]


def rows_of(path: Path, layer: str, table: "GeoDataFrame", site_crs: str) -> Iterator[Row | str]:
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


def _row(where: str, layer: str, shape: Any, known: dict[str, Any], *, kml: bool) -> Row | str:
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
    return Row(where, role, str(known["name"]).strip(), (shape.x, shape.y, height_m), known)


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


def pieces_of(rows: list[Row]) -> tuple[dict[str, list[dict[str, Any]]], list[str]]:
    """The rows as entries of a site file, in its order of keys, and what was noticed."""
    pieces: dict[str, list[dict[str, Any]]] = {}
    notes: list[str] = []
    masts = {row.name: row for row in rows if row.role == "mast"}
    for role, key in KEYS.items():
        entries = [_piece(row, masts, notes) for row in rows if row.role == role]
        if entries:
            pieces[key] = entries
    return pieces, notes


def _piece(row: Row, masts: Mapping[str, Row], notes: list[str]) -> dict[str, Any]:
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


def _off_mast_m(position: tuple[float, float, float], mast: Row, above_base_m: object) -> float:
    top = above_base_m if above_base_m is not None else mast.cells.get("height_m", 0.0)
    there: FloatArray = np.array(mast.position) + np.array([0.0, 0.0, _number(top) or 0.0])
    return float(np.linalg.norm(np.array(position) - there))


def _fields(row: Row) -> dict[str, Any]:
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
        column = RENAMED.get(row.role, {}).get(field, field)
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
    if field in NESTED and isinstance(value, Mapping):  # GDAL reads JSON in a GeoJSON itself
        return dict(value)
    if field in NESTED and str(value).startswith("{"):
        try:
            return json.loads(str(value))
        except ValueError:
            return str(value)
    if field in TEXTS:
        return str(value).strip()
    number = _number(value)
    return str(value) if number is None else number
