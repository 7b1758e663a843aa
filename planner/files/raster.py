"""Height rasters and maps as GeoTIFF, through rasterio (extra `terrain`)."""

from collections.abc import Mapping
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from geometry.arrays import FloatArray
from geometry.errors import InputError, UnavailableError
from geometry.frames import HeightDatum
from geometry.terrain import HeightRaster


def load_terrain(
    file: Path,
    *,
    crs: str,
    height_datum: HeightDatum,
    declared_datum: HeightDatum | None = None,
    geoid_undulation_m: float | None = None,
    surface: Path | None = None,
) -> HeightRaster:
    """Read a height raster into the site's CRS and height datum.

    Parameters
    ----------
    file
        A raster that rasterio reads, one band of heights [m].
    crs
        The site's projected CRS; a raster in another one is transformed (bilinear, cells of the same size).
    height_datum
        The site's.
    declared_datum
        The raster's, where the file itself does not say (`terrain.height_datum` in the site file).
    geoid_undulation_m
        Ellipsoidal less sea-level height, to turn one datum into the other.
    surface
        A second raster of the same grid: heights of canopy and buildings above the ground, added on top.

    Returns
    -------
    HeightRaster

    Raises
    ------
    UnavailableError
        If rasterio is not installed.
    InputError
        If the file cannot be read, does not say its CRS, or the datum is not known or cannot be transformed.
    """
    rasterio = _rasterio("the terrain of a site")
    heights, transform, own_crs = _read(rasterio, file)
    datum = _datum(file, own_crs, declared_datum)
    if surface is not None:
        added, other, other_crs = _read(rasterio, surface)
        if other != transform or added.shape != heights.shape or other_crs != own_crs:
            raise InputError(f"{surface} has another grid or CRS than {file}; give both on the same cells")
        heights = heights + added
    if not _same_plane(own_crs, crs):
        heights, transform = _warped(heights, transform, own_crs, crs)
    if datum != height_datum:
        if geoid_undulation_m is None:
            raise InputError(
                f"{file} has heights {_spelled(datum)} and the site {_spelled(height_datum)}; give geoid_undulation_m in the "
                "site file, or a raster with the site's datum"
            )
        heights = heights + (geoid_undulation_m if height_datum == "ellipsoidal" else -geoid_undulation_m)
    return HeightRaster.from_transform(heights, tuple(transform)[:6], height_datum)


def fault_of_raster(file: Path) -> str:
    """Say why a file is no height raster; empty where it is one, or where rasterio is not installed.

    Parameters
    ----------
    file
        Only its head is read.
    """
    from importlib.util import find_spec

    if find_spec("rasterio") is None:
        return ""
    import rasterio
    from rasterio.errors import RasterioError

    try:
        with rasterio.open(file) as raster:
            return "" if raster.crs is not None else "It does not say in which CRS it is."
    except RasterioError as error:
        return f"It cannot be read as a raster: {str(error).rstrip('.')}."


def fault_of_datum(file: Path, declared: object) -> str:
    """Say why it is not known what a raster's heights count from; empty where it is, or where it is no raster.

    Parameters
    ----------
    file
        Only its head is read.
    declared
        `terrain.height_datum` of the site file, None where it is not given; what is no datum is a fault of its own.
    """
    from importlib.util import find_spec

    if find_spec("rasterio") is None or declared not in (None, "above_sea_level", "ellipsoidal"):
        return ""
    import rasterio
    from rasterio.errors import RasterioError

    try:
        with rasterio.open(file) as raster:
            said = None if raster.crs is None else _said_datum(raster.crs)
            nameless = raster.crs is None
    except RasterioError:
        return ""
    if nameless:
        return ""
    if said is None and declared is None:
        return f"{file.name} does not say it itself; most GeoTIFFs do not."
    if said is not None and declared not in (None, said):
        return f"{file.name} itself says that its heights are {_spelled(said)}: leave height_datum out."
    return ""


def write_geotiff(
    path: Path, layers: Mapping[str, FloatArray], east_m: FloatArray, north_m: FloatArray, crs: str
) -> None:
    """Write maps (row, column) as the bands of one GeoTIFF, each described by its name.

    Parameters
    ----------
    path
        The file.
    layers
        Maps by name; NaN is no data.
    east_m, north_m
        Middles of columns, and of rows from north to south [m].
    crs
        Their CRS.

    Raises
    ------
    UnavailableError
        If rasterio is not installed.
    """
    rasterio = _rasterio("a GeoTIFF")
    east, north = abs(float(east_m[1] - east_m[0])), abs(float(north_m[1] - north_m[0]))
    transform = rasterio.Affine(
        east, 0.0, float(east_m[0]) - east / 2, 0.0, -north, float(north_m[0]) + north / 2
    )
    shape = next(iter(layers.values())).shape
    profile = {
        "driver": "GTiff",
        "height": shape[0],
        "width": shape[1],
        "count": len(layers),
        "dtype": "float32",
    }
    with rasterio.open(
        path, "w", crs=crs, transform=transform, nodata=np.nan, compress="deflate", **profile
    ) as file:
        for band, (name, values) in enumerate(layers.items(), start=1):
            file.write(values.astype(np.float32), band)
            file.set_band_description(band, name)


def _rasterio(what: str) -> ModuleType:
    try:
        import rasterio
    except ImportError:
        raise UnavailableError(
            f"{what} needs rasterio, which is not installed: pip install '.[terrain]'"
        ) from None
    module: ModuleType = rasterio
    return module


def _read(rasterio: ModuleType, file: Path) -> tuple[FloatArray, Any, Any]:
    """Heights with NaN for no data, transform and CRS of a raster's first band."""
    from rasterio.errors import RasterioError

    try:
        with rasterio.open(file) as raster:
            if raster.crs is None:
                raise InputError(f"{file} does not say in which CRS it is; give a raster that does")
            heights = raster.read(1, masked=True).astype(np.float64).filled(np.nan)
            scale, offset = raster.scales[0], raster.offsets[0]
            return np.asarray(heights * scale + offset), raster.transform, raster.crs
    except RasterioError as error:
        raise InputError(
            f"{file} cannot be read as a raster ({str(error).rstrip('.')}); give a GeoTIFF"
        ) from error


def _same_plane(own: Any, crs: str) -> bool:
    from pyproj import CRS

    horizontal = CRS.from_user_input(own.to_wkt())
    return (horizontal.sub_crs_list[0] if horizontal.is_compound else horizontal) == CRS.from_user_input(crs)


def _datum(file: Path, own: Any, declared: HeightDatum | None) -> HeightDatum:
    """What a raster's heights count from: as its CRS says, else as declared; never assumed."""
    said = _said_datum(own)
    if said is None and declared is None:
        raise InputError(
            f"{file} does not say what its heights count from; give terrain.height_datum in the site file, as in "
            f"terrain: {{file: {file.name}, height_datum: above_sea_level}} (or ellipsoidal)"
        )
    if said is not None and declared is not None and said != declared:
        raise InputError(
            f"{file} says that its heights are {_spelled(said)}, the site file {_spelled(declared)}; leave height_datum out"
        )
    return said or declared or "above_sea_level"


def _said_datum(own: Any) -> HeightDatum | None:
    """What the CRS of a raster says that its heights count from; None where it says nothing."""
    from pyproj import CRS

    full = CRS.from_user_input(own.to_wkt())
    vertical = (
        next((part for part in full.sub_crs_list if part.is_vertical), None) if full.is_compound else None
    )
    if vertical is not None:
        return "ellipsoidal" if "ellips" in vertical.name.lower() else "above_sea_level"
    return "ellipsoidal" if len(full.axis_info) == 3 else None


def _spelled(datum: HeightDatum) -> str:
    return "above the ellipsoid" if datum == "ellipsoidal" else "above sea level"


def _warped(heights: FloatArray, transform: Any, own: Any, crs: str) -> tuple[FloatArray, tuple[float, ...]]:
    """Heights on square cells of the site's CRS, bilinear, and their transform; NaN where the raster does not reach."""
    from pyproj import CRS, Transformer

    source = HeightRaster.from_transform(
        heights, tuple(transform)[:6], "above_sea_level"
    )  # the datum is not looked at
    full = CRS.from_user_input(own.to_wkt())
    flat = full.sub_crs_list[0] if full.is_compound else full
    there = Transformer.from_crs(flat, crs, always_xy=True)
    west, south, east, north = there.transform_bounds(*source.bounds_m)
    cell = float(np.sqrt((east - west) * (north - south) / heights.size))
    columns, rows = (max(int(np.ceil(side / cell)), 2) for side in (east - west, north - south))
    x, y = np.meshgrid(west + (np.arange(columns) + 0.5) * cell, north - (np.arange(rows) + 0.5) * cell)
    back = there.transform(x, y, direction="INVERSE")
    return source.heights_m(*back), (cell, 0.0, west, 0.0, -cell, north)
