"""How high the ground is under things of a site: one level, or the raster that its `terrain` names."""

from collections.abc import Mapping
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from geometry.arrays import ArrayLike, FloatArray
from geometry.errors import InputError
from geometry.frames import HeightDatum
from geometry.terrain import HeightRaster
from planner.site import Site, Terrain

# Copernicus DEM GLO-30: absolute vertical accuracy better than 4 m at 90 % (product handbook).
RASTER_ACCURACY_M = 4.0

Stamps = tuple[int, ...]  # when the files were last written: a raster that has changed is read again


class Heights(NamedTuple):
    """A terrain as read, in the site's CRS and datum."""

    ground: HeightRaster  # what lidars and masts stand on, and what the wind's profile counts from
    top: HeightRaster  # with canopy and buildings: what beams have to clear


def heights_of(site: Site) -> Heights | None:
    """Read the terrain of a site, once; None where the ground is level.

    Raises
    ------
    UnavailableError
        If rasterio is not installed.
    InputError
        If a raster cannot be read, its CRS or datum cannot be turned into the site's, or a target lies outside it.
    """
    if site.terrain is None:
        return None
    files = (site.terrain.file, site.terrain.surface)
    stamps = tuple(file.stat().st_mtime_ns for file in files if file is not None and file.is_file())
    heights = _read(site.terrain, site.crs, site.height_datum, site.geoid_undulation_m, stamps)
    refuse_unknown(heights.ground, {target.name: site.target_position_m(target) for target in site.targets})
    return heights


def ground_under_m(site: Site, positions_m: ArrayLike) -> FloatArray:
    """Height of the ground under positions (..., 2 or more) easting, northing [m]; NaN where it is not known.

    Examples
    --------
    >>> ground_under_m(Site(name="Moor", crs="EPSG:32632", ground_height_m=10.0), [[500000.0, 6250000.0]]).tolist()
    [10.0]
    """
    positions = np.asarray(positions_m, dtype=np.float64)
    heights = heights_of(site)
    if heights is None:
        return np.full(positions.shape[:-1], site.ground_m)
    return heights.ground.heights_m(positions[..., 0], positions[..., 1])


def ground_doubt_m(raster: HeightRaster, positions_m: ArrayLike) -> FloatArray:
    """How far the real ground may be from a raster's surface under positions (..., 2 or more) [m]; NaN where not known.

    The accuracy of a good raster, 4 m, and half the difference of the highest and lowest of the four cells around: as much
    as the surface changes over half a cell, within which a raster says nothing.

    Examples
    --------
    >>> slope = HeightRaster(np.array([[0.0, 10.0], [0.0, 10.0]]), 0.0, 200.0, 100.0, 100.0, "above_sea_level")
    >>> ground_doubt_m(slope, [[100.0, 100.0]]).tolist()
    [9.0]
    """
    positions = np.asarray(positions_m, dtype=np.float64)
    aside = np.array([[-0.5, -0.5], [-0.5, 0.5], [0.5, -0.5], [0.5, 0.5]])
    corners = positions[..., None, :2] + aside * (raster.cell_east_m, raster.cell_north_m)
    west, south, east, north = raster.bounds_m
    inside = np.clip(corners, (west, south), (east, north))
    heights = raster.heights_m(inside[..., 0], inside[..., 1])
    return np.asarray(RASTER_ACCURACY_M + np.ptp(heights, axis=-1) / 2)


def refuse_unknown(raster: HeightRaster, targets_m: Mapping[str, ArrayLike]) -> None:
    """Refuse targets under which a raster has no height.

    Parameters
    ----------
    raster
        Heights of the ground.
    targets_m
        Easting, northing and more [m] by name.

    Raises
    ------
    InputError
        Naming them all.
    """
    if not targets_m:
        return
    east, north = np.array([np.asarray(position)[:2] for position in targets_m.values()]).T
    unknown = np.isnan(raster.heights_m(east, north))
    if unknown.any():
        names = [name for name, out in zip(targets_m, unknown, strict=True) if out]
        west, south, right, top = raster.bounds_m
        raise InputError(
            f"the height of the ground under target{'s' if len(names) > 1 else ''} {', '.join(names)} is not known: outside "
            f"the height raster (easting {west:.0f} to {right:.0f}, northing {south:.0f} to {top:.0f}) or in a hole of it; "
            "give a raster that holds the targets, and check `crs`: with the wrong UTM zone everything stands elsewhere"
        )


@lru_cache(maxsize=4)
def _read(
    terrain: Terrain,
    crs: str,
    height_datum: HeightDatum,
    geoid_undulation_m: float | None,
    stamps: Stamps,  # noqa: ARG001 - part of the key
) -> Heights:
    from planner.files.raster import load_terrain

    ground, top = (
        load_terrain(
            terrain.file,
            crs=crs,
            height_datum=height_datum,
            declared_datum=terrain.height_datum,
            geoid_undulation_m=geoid_undulation_m,
            surface=surface,
        )
        for surface in (None, terrain.surface)
    )
    return Heights(ground, top if terrain.surface else ground)
