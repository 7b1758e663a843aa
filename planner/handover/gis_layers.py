"""Everything planned as GIS layers: what stands where as points, beams as 3-D lines, areas as polygons.

Each layer is a table in the site's own CRS, heights in the site's datum: nothing is lost to a
transformation. The columns of what stands on the site are those that `planner.files.layout` reads.
"""

import json
import math
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from geometry.arrays import FloatArray
from geometry.beams import unit_vector
from geometry.projection import projection_of
from geometry.wakes import wake_outline_m
from planner.exclusion import Exclusion
from planner.nouns import Noun
from planner.palette import WAKE_DIAMETERS
from planner.places import Places
from planner.plan import Plan
from planner.scan_layout import ScanLayout
from planner.site import Lidar, Site

if TYPE_CHECKING:
    from geopandas import GeoDataFrame
    from shapely.geometry.base import BaseGeometry

# A straight beam is a bent line in a map: pieces of 250 m stay within 1.3 mm of it (d²/8R).
PIECE_M = 250.0
PIE_M = 300.0  # radius of the excluded directions around a target
PIE_STEP_DEG = 2.0

SITE_LAYERS = ("lidars", "masts", "turbines", "obstacles", "hard_targets", "targets")
RESULT_LAYERS = ("beams", "sectors", "wakes", "excluded_winds", "crossings")

Record = dict[str, Any]


def layers(plan: Plan) -> "dict[str, GeoDataFrame]":
    """Make all layers that have something in them.

    Parameters
    ----------
    plan
        What is planned.

    Returns
    -------
    dict of str to GeoDataFrame
        By name, in the order of `SITE_LAYERS` and `RESULT_LAYERS`; geometries have easting, northing and
        height [m] of the site.
    """
    return {**site_layers(plan.site), **result_layers(plan)}


def site_layers(site: Site) -> "dict[str, GeoDataFrame]":
    """Make the layers of what stands on the site or is to be measured there."""
    made: dict[str, Sequence[tuple[Sequence[float], Record]]] = {
        "lidars": [_lidar(site, number) for number in range(len(site.lidars))],
        "masts": [(item.position, _plain("mast", item)) for item in site.masts],
        "turbines": [(item.position, _plain("turbine", item)) for item in site.turbines],
        "obstacles": [(item.position, _plain("obstacle", item)) for item in site.obstacles],
        "hard_targets": [
            (site.target_position_m(item), _plain("hard_target", item, rename={"height_m": "above_base_m"}))
            for item in site.hard_targets
        ],
        "targets": [
            (site.target_position_m(item), _plain("target", item, rename={"height_m": "above_base_m"}))
            for item in site.targets
        ],
    }
    return {name: _points(site, rows) for name, rows in made.items() if rows}


def result_layers(plan: Plan) -> "dict[str, GeoDataFrame]":
    """Make the layers of what follows from the plan."""
    made = {
        "beams": [row for layout in plan.layouts for row in _beams(plan, layout)],
        "sectors": [row for layout in plan.layouts for row in _sector(plan, layout)],
        "wakes": list(_wakes(plan)),
        "excluded_winds": [row for item in plan.exclusions for row in _pies(plan, item)],
        "crossings": list(_crossings(plan)),
    }
    return {name: _frame(plan.site, rows) for name, rows in made.items() if rows}


def _lidar(site: Site, number: int) -> tuple[Sequence[float], Record]:
    lidar = site.lidars[number]
    record = {
        "role": "lidar",
        "name": lidar.name,
        "instrument": _instrument(lidar),
        "north": lidar.north,
        "azimuth_offset_deg": lidar.azimuth_offset_deg,
        "elevation_offset_deg": lidar.elevation_offset_deg,
        **lidar.mounting.model_dump(),
        "lidar_uncertainty": _stated(lidar.uncertainty),
        "signal": _stated(lidar.signal),
        "number": number,
    }
    return lidar.position, record


def _instrument(lidar: Lidar) -> str:
    """The name in the catalogue, or the instrument's own numbers as JSON."""
    if isinstance(lidar.instrument, str):
        return lidar.instrument
    return json.dumps(lidar.instrument.model_dump(mode="json", exclude_unset=True))


def _stated(noun: Noun | None) -> str | None:
    """What a part of a lidar says beyond its defaults, as JSON; None where that is nothing."""
    stated = {} if noun is None else noun.model_dump(mode="json", exclude_defaults=True)
    return json.dumps(stated) if stated else None


def _plain(role: str, item: Any, *, rename: dict[str, str] | None = None) -> Record:
    """All fields of a noun but its position; what is not given stays away if nothing of the layer gives it."""
    names = rename or {}
    fields = item.model_dump(exclude={"position"})
    return {"role": role, **{names.get(key, key): value for key, value in fields.items()}}


def _points(site: Site, rows: "Sequence[tuple[Sequence[float], Record]]") -> "GeoDataFrame":
    import shapely

    datum = {"height_datum": site.height_datum, "geoid_undulation_m": site.geoid_undulation_m}
    return _frame(site, [(shapely.Point(*position), {**record, **datum}) for position, record in rows])


def _frame(site: Site, rows: "Sequence[tuple[BaseGeometry, Record]]") -> "GeoDataFrame":
    """A layer; a column that is empty in every row is left out."""
    import geopandas

    records = [record for _, record in rows]
    keys = [
        key for key in dict.fromkeys(key for record in records for key in record) if _any_given(key, records)
    ]
    columns = {key: [record.get(key) for record in records] for key in keys}
    shapes = [shape for shape, _ in rows]
    return geopandas.GeoDataFrame(columns, geometry=shapes, crs=projection_of(site.crs).crs)


def _any_given(key: str, records: Iterable[Record]) -> bool:
    return any(record.get(key) is not None for record in records)


def beam_m(
    places: Places, layout: ScanLayout, azimuth_deg: float, elevation_deg: float, to_m: float
) -> FloatArray:
    """Points (n, 3) on a straight beam in the site's coordinates, from the head on, every 250 m or closer."""
    ranges = np.linspace(0.0, to_m, max(math.ceil(to_m / PIECE_M), 1) + 1)
    enu = ranges[:, None] * unit_vector(azimuth_deg, elevation_deg)
    return places.frame.projected_m(layout.lidar.position, enu)


def _beams(plan: Plan, layout: ScanLayout) -> "Iterable[tuple[BaseGeometry, Record]]":
    import shapely

    places, scan = plan.exact_places, layout.scan
    to_m = layout.drawn_reach_m
    head_azimuth, head_elevation = layout.mounting.to_head(scan.azimuth_deg, scan.elevation_deg)
    for ray in range(scan.count):
        azimuth_deg, elevation_deg = float(scan.azimuth_deg[ray]), float(scan.elevation_deg[ray])
        range_m = to_m if scan.kind != "points" else layout.measured_range_m(float(layout.aim.range_m[ray]))
        record = {
            "name": layout.name if scan.count == 1 else f"{layout.name} {ray + 1}",
            "lidar": layout.lidar.name,
            "scan": layout.name,
            "type": layout.spec.type,
            "ray": ray,
            "azimuth_deg": azimuth_deg,
            "elevation_deg": elevation_deg,
            "head_azimuth_deg": float(head_azimuth[ray]),
            "head_elevation_deg": float(head_elevation[ray]),
            "range_m": range_m,
            "number": layout.lidar_index,
        }
        yield shapely.LineString(beam_m(places, layout, azimuth_deg, elevation_deg, range_m)), record


def _sector(plan: Plan, layout: ScanLayout) -> "Iterable[tuple[BaseGeometry, Record]]":
    """The area of a sector scan or circle, from the head to the measured gate."""
    import shapely

    if layout.spec.type not in ("sector", "ppi"):
        return
    to_m = layout.drawn_reach_m
    azimuth_deg, elevation_deg = layout.edges_deg()
    enu = to_m * unit_vector(azimuth_deg, elevation_deg)
    arc = plan.exact_places.frame.projected_m(layout.lidar.position, enu)
    _, width_deg = layout.scan.azimuth_arc_deg
    head = np.asarray(layout.lidar.position)[None]
    ring = arc if width_deg >= 360.0 - 1e-9 else np.vstack([head, arc, head])
    record = {
        "name": layout.name,
        "lidar": layout.lidar.name,
        "scan": layout.name,
        "type": layout.spec.type,
        "width_deg": width_deg,
        "axis_azimuth_deg": layout.axis_azimuth_deg,
        "range_m": to_m,
        "number": layout.lidar_index,
    }
    yield shapely.Polygon(ring), record


def _wakes(plan: Plan) -> "Iterable[tuple[BaseGeometry, Record]]":
    """Wakes in the prevailing wanted wind, at hub height; none where wind comes from everywhere alike."""
    import shapely

    wind_deg, places = plan.prevailing_deg, plan.exact_places
    if np.isnan(wind_deg):
        return
    for hub, turbine in zip(places.hubs_m, plan.site.turbines, strict=True):
        length_m = WAKE_DIAMETERS * turbine.rotor_diameter_m
        outline = wake_outline_m(
            hub, turbine.rotor_diameter_m, wind_deg, decay=plan.site.wakes.decay, length_m=length_m
        )
        plan_m = outline.polygon_m
        ring = np.column_stack([plan_m, np.full(len(plan_m), hub[2])])
        record = {
            "name": f"wake of {turbine.name}",
            "turbine": turbine.name,
            "wind_from_deg": wind_deg,
            "decay": plan.site.wakes.decay,
            "length_m": length_m,
        }
        yield shapely.Polygon(places.frame.projected_m(places.origin_m, ring)), record


def _pies(plan: Plan, item: Exclusion) -> "Iterable[tuple[BaseGeometry, Record]]":
    """The wind directions in which a wake touches what a scan measures, as pieces of pie around the target."""
    import shapely

    target = np.asarray(plan.site.target_position_m(item.target))
    for sector in item.excluded.sectors:
        steps = max(math.ceil(sector.width_deg / PIE_STEP_DEG), 1) + 1
        azimuth_deg = sector.from_deg + np.linspace(0.0, sector.width_deg, steps)
        arc = plan.exact_places.frame.projected_m(target, PIE_M * unit_vector(azimuth_deg, np.zeros(steps)))
        ring = arc if sector.width_deg >= 360.0 else np.vstack([target, arc, target])
        record = {
            "name": f"{item.scan}: wind from {sector.from_deg:.0f} to {sector.to_deg:.0f}° is in a wake",
            "lidar": item.lidar,
            "scan": item.scan,
            "target": item.target,
            "model": item.model,
            "from_deg": sector.from_deg,
            "to_deg": sector.to_deg,
            "lost_share": item.lost_share,
        }
        yield shapely.Polygon(ring), record


def _crossings(plan: Plan) -> "Iterable[tuple[BaseGeometry, Record]]":
    """Where the beams of pairs come closest; beams that are parallel meet nowhere."""
    import shapely

    places = plan.exact_places
    for met in plan.crossings:
        if not np.isfinite(met.point_m).all():
            continue
        fields = {key: value for key, value in met._asdict().items() if key not in ("pair", "point_m")}
        known = {
            key: value
            for key, value in fields.items()
            if not (isinstance(value, float) and math.isnan(value))
        }
        position = places.frame.projected_m(places.origin_m, met.point_m)
        yield shapely.Point(*position), {"name": met.pair, **known}
