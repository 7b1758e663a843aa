"""Layouts from GIS files and tables: points with a `role` (lidar, mast, turbine, ...) -> pieces of a site.

CSV, GeoJSON, GeoPackage, KML, KMZ and Shapefile, in any CRS. A layout that does not say its CRS is refused:
a guess would put the site somewhere else in silence.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from geometry.errors import InputError
from planner.faults import key_of
from planner.files.layout_rows import KEYS, Row, pieces_of, rows_of
from planner.files.layout_tables import tables_of

if TYPE_CHECKING:
    from geopandas import GeoDataFrame

    from planner.site import Site


class Layout(NamedTuple):
    """What a layout says, by the keys of a site file."""

    crs: str  # of the site, projected
    height_datum: str | None  # where the layout states it
    geoid_undulation_m: float | None
    pieces: dict[str, list[dict[str, Any]]]
    notes: tuple[str, ...]  # what the user should know


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
    tables = tables_of(path, layout_crs)
    site_crs, notes = _site_crs(path, tables, crs)
    rows: list[Row] = []
    faults: list[str] = []
    for name, table in tables.items():
        for row in rows_of(path, name, table, site_crs):
            if isinstance(row, str):
                faults.append(row)
            else:
                rows.append(row)
    if not rows and not faults:
        faults.append("no point with a role is in it; allowed roles: " + ", ".join(KEYS))
    pieces, more = pieces_of(rows)
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
