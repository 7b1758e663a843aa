"""Allowed and forbidden ground, and the distance to what a lidar wants to be near, from polygons or any GIS file."""

from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from geometry.arrays import FloatArray
from geometry.errors import InputError
from planner.site import Area, Site

if TYPE_CHECKING:
    from shapely import Geometry
    from shapely.geometry.base import BaseGeometry


def area_slack_m(site: Site, positions_m: FloatArray) -> FloatArray:
    """How far inside the allowed and outside the forbidden ground places are.

    Parameters
    ----------
    site
        With its `areas`; without any allowed area everything is allowed.
    positions_m
        (place, 2 or 3) easting, northing [m].

    Returns
    -------
    FloatArray
        (place,) distance to the nearest edge that matters [m], negative where a lidar may not stand; inf without areas.

    Raises
    ------
    InputError
        If a file cannot be read, does not say its CRS, or holds no polygon.
    """
    import shapely

    points = shapely.points(positions_m[:, 0], positions_m[:, 1])
    slack = np.full(len(positions_m), np.inf)
    if site.areas.allowed:
        allowed = _union(site.areas.allowed, site.crs, "allowed")
        slack = np.minimum(slack, _inside_m(allowed, points))
    if site.areas.forbidden:
        forbidden = _union(site.areas.forbidden, site.crs, "forbidden")
        slack = np.minimum(slack, -_inside_m(forbidden, points))
    return slack


def allowed_bounds_m(site: Site) -> tuple[float, float, float, float] | None:
    """West, south, east, north of the allowed ground [m]; None where everything is allowed."""
    if not site.areas.allowed:
        return None
    west, south, east, north = _union(site.areas.allowed, site.crs, "allowed").bounds
    return float(west), float(south), float(east), float(north)


def distance_m(file: Path, crs: str, positions_m: FloatArray) -> FloatArray:
    """Distance of places to the nearest thing of a GIS file, such as roads or power lines [m]: (place,).

    Raises
    ------
    InputError
        As `area_slack_m`.
    """
    import shapely

    points = shapely.points(positions_m[:, 0], positions_m[:, 1])
    return np.asarray(shapely.distance(points, shapely.union_all(_shapes(file, crs))))


def far_cost(file: Path, crs: str, per_km: float, positions_m: FloatArray) -> FloatArray:
    """What it costs to be far from the things of a file: (place,), so much for each kilometre."""
    return np.asarray(per_km / 1000.0 * distance_m(file, crs, positions_m))


def _inside_m(area: "Geometry", points: Any) -> FloatArray:
    """Distance to the edge of an area [m], positive inside."""
    import shapely

    shapely.prepare(area)
    edge = shapely.distance(points, shapely.boundary(area))
    return np.asarray(np.where(shapely.intersects(area, points), edge, -edge))


def _union(areas: Sequence[Area], crs: str, kind: str) -> "BaseGeometry":
    import shapely

    parts = [shape for area in areas for shape in _of_area(area, crs, kind)]
    joined: BaseGeometry = shapely.union_all(parts)
    return joined


def _of_area(area: Area, crs: str, kind: str) -> "list[BaseGeometry]":
    import shapely

    if area.polygon is not None:
        polygon = shapely.Polygon(area.polygon)
        if not polygon.is_valid:
            raise InputError(
                f"{kind} area {area.name or 'without a name'}: the polygon crosses itself "
                f"({shapely.is_valid_reason(polygon)}); give its corners in order around it"
            )
        return [polygon]
    if area.file is None:
        raise InputError(f"{kind} area {area.name or 'without a name'}: give a file or a polygon")
    shapes = [shape for shape in _shapes(area.file, crs) if shape.geom_type in ("Polygon", "MultiPolygon")]
    if not shapes:
        raise InputError(f"{area.file}: no polygon is in it; {kind} ground is given as polygons")
    return shapes


@lru_cache(maxsize=16)
def _shapes(file: Path, crs: str) -> "tuple[BaseGeometry, ...]":
    """What a GIS file holds, in the site's CRS."""
    import geopandas as gpd

    try:
        table = gpd.read_file(file)
    except Exception as error:  # pyogrio's errors share no base with OSError
        raise InputError(
            f"{file} cannot be read as a GIS file ({error}); give GeoPackage, GeoJSON or Shapefile"
        ) from error
    if table.crs is None:
        raise InputError(
            f"{file} does not say in which CRS it is; give a file that does (a Shapefile needs its .prj)"
        )
    return tuple(shape for shape in table.to_crs(crs).geometry if shape is not None and not shape.is_empty)
