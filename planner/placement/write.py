"""Placement results as files: tables, a map for each criterion as GeoTIFF, places as GeoPackage."""

from pathlib import Path

import numpy as np

from geometry.arrays import FloatArray
from planner.placement.maps import CRITERIA, Look
from planner.placement.numbers import lidar_names
from planner.placement.ranking import Placement, Ranked
from planner.placement.search import UNSEEN

TURBULENT = ("turbulent_speed_std_mps", "turbulent_direction_std_deg")
PLACES = "places.gpkg"
UNIT = {"vector": "m/s", "speed": "m/s", "direction": "deg"}


def rows_of(found: Placement) -> list[dict[str, object]]:
    """One row for each ranked set and, with rank 0, for the declared places: what `--json` prints."""
    return [_row(found, item) for item in (*([found.declared] if found.declared else []), *found.ranked)]


def _row(found: Placement, item: Ranked) -> dict[str, object]:
    numbers, task = item.numbers, found.task
    placed = lidar_names(task)[len(task.fixed) :]
    if item.rank == 0:
        placed = tuple(lidar.name for lidar in task.replaced)
    return {
        "rank": item.rank,
        "declared": item.rank == 0,
        "positions": [
            {
                "lidar": name,
                "easting_m": round(east, 2),
                "northing_m": round(north, 2),
                "height_m": round(height, 2),
            }
            for name, (east, north, height) in zip(placed, item.positions_m.tolist(), strict=True)
        ],
        "standing": [lidar.name for lidar in task.fixed],
        "criterion": task.criterion,
        "aggregate": task.aggregate,
        "value": item.value,
        "unit": UNIT[task.criterion],
        "binds" if item.rank else "breaks": list(item.binds),
        "targets": [
            {
                "target": name,
                "speed_std_mps": float(numbers.speed_std_mps[number]),
                "direction_std_deg": float(numbers.direction_std_deg[number]),
                "opening_angle_deg": _known(numbers.opening_deg[number]),
                "range_m": numbers.range_m[number].tolist(),
                "azimuth_true_deg": numbers.azimuth_deg[number].tolist(),
                "elevation_deg": numbers.elevation_deg[number].tolist(),
                "lost_share": float(numbers.lost_share[number]),
                **_with_turbulence(item, number),
            }
            for number, name in enumerate(task.targets)
        ],
        "text": item.text,
    }


def _with_turbulence(item: Ranked, number: int) -> dict[str, float | None]:
    """The turbulent tier's error at one target, where it was asked for."""
    if item.turbulent is None:
        return {}
    return {
        "turbulent_speed_std_mps": _known(item.turbulent.speed_std_mps[number]),
        "turbulent_direction_std_deg": _known(item.turbulent.direction_std_deg[number]),
    }


def _known(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def layers(found: Placement) -> dict[str, FloatArray]:
    """Maps (row, column) by name: the error, whether a place is allowed, and what is left over of each criterion."""
    shape = found.grid.shape
    error = np.where(found.error < np.sqrt(UNSEEN), found.error, np.nan)
    maps = {
        f"error_{found.task.criterion}": np.where(np.isfinite(error), error, np.nan),
        "allowed": found.seen.allowed.all(axis=0).astype(float),
    }
    for name, slack in least_slack(found.seen).items():
        if np.isfinite(slack).any():
            maps[f"left_over_{name.replace('-', '_')}_{CRITERIA[name][0]}"] = slack
    return {name: values.reshape(shape) for name, values in maps.items()}


def sight_layers(found: Placement) -> dict[str, FloatArray]:
    """For each target a map (row, column) of how far a head stands above what it needs to see it over the terrain [m].

    Negative: by so much it would have to be raised; NaN: not known. Empty without a terrain.
    """
    if found.task.terrain is None:
        return {}
    slack = found.seen.slack["terrain"]
    return {
        f"{name}_m": values.reshape(found.grid.shape)
        for name, values in zip(found.task.targets, slack, strict=True)
    }


def least_slack(seen: Look) -> dict[str, FloatArray]:
    """(place,) what is left over of each criterion at the target where it is least; NaN where it is not known."""
    return {name: np.asarray(values.min(axis=0)) for name, values in seen.slack.items()}


def write_tables(found: Placement, folder: Path) -> list[str]:
    """Write the ranking, its targets and the candidates as CSV; gives the names of the files."""
    import pandas as pd

    rows = rows_of(found)
    ranking = [
        {key: row[key] for key in ("rank", "declared", "criterion", "aggregate", "value", "unit", "text")}
        | _flat(row)
        for row in rows
    ]
    pd.DataFrame(ranking).to_csv(folder / "places.csv", index=False)
    names = lidar_names(found.task)
    pd.DataFrame([line for row in rows for line in _target_lines(row, names)]).to_csv(
        folder / "place-targets.csv", index=False
    )
    candidates = pd.DataFrame(found.seen.positions_m, columns=["easting_m", "northing_m", "height_m"])
    for name, values in layers(found).items():
        candidates[name] = values.ravel()
    candidates.to_csv(folder / "candidates.csv", index=False, float_format="%.6g")
    return ["places.csv", "place-targets.csv", "candidates.csv"]


def _flat(row: dict[str, object]) -> dict[str, object]:
    places = row["positions"]
    assert isinstance(places, list)
    return {f"{key}_{number}": place[key] for number, place in enumerate(places, start=1) for key in place}


def _target_lines(row: dict[str, object], names: tuple[str, ...]) -> list[dict[str, object]]:
    targets = row["targets"]
    assert isinstance(targets, list)
    return [
        {"rank": row["rank"], "target": item["target"], "lidar": name, "range_m": item["range_m"][number]}
        | {key: item[key][number] for key in ("azimuth_true_deg", "elevation_deg")}
        | {
            key: item[key]
            for key in ("speed_std_mps", "direction_std_deg", *TURBULENT, "opening_angle_deg", "lost_share")
            if key in item
        }
        for item in targets
        for number, name in enumerate(names)
    ]


def write_geopackage(found: Placement, folder: Path) -> str:
    """Write the ranked and declared places as points with their numbers; gives the file's name."""
    import geopandas as gpd

    rows = [
        {"rank": row["rank"], "lidar": place["lidar"], "height_m": place["height_m"], "value": row["value"]}
        | {
            "site": found.task.site.name,
            "unit": row["unit"],
            "text": row["text"],
            "easting_m": place["easting_m"],
            "northing_m": place["northing_m"],
        }
        for row in rows_of(found)
        for place in _places(row)
    ]
    points = gpd.points_from_xy(
        *([row[key] for row in rows] for key in ("easting_m", "northing_m", "height_m"))
    )
    table = gpd.GeoDataFrame(rows, geometry=points, crs=found.task.site.crs)
    table.to_file(folder / PLACES, layer="places", driver="GPKG")
    return PLACES


def _places(row: dict[str, object]) -> list[dict[str, object]]:
    places = row["positions"]
    assert isinstance(places, list)
    return places


def write_all(found: Placement, folder: Path) -> tuple[list[str], str | None]:
    """Write everything but figures.

    Returns
    -------
    tuple
        Names of the files, and why there is no GeoTIFF, None where there is.
    """
    from geometry.errors import UnavailableError
    from planner.files.raster import write_geotiff

    names = [*write_tables(found, folder), write_geopackage(found, folder)]
    rasters = {"maps.tif": layers(found), "sight.tif": sight_layers(found)}
    rasters = {name: bands for name, bands in rasters.items() if bands}
    try:
        for name, bands in rasters.items():
            write_geotiff(folder / name, bands, found.grid.east_m, found.grid.north_m, found.task.site.crs)
    except UnavailableError as error:
        return names, str(error)
    return [*names, *rasters], None
