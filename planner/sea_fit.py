"""Low scans over water -> how a lidar's head is tilted: the range at which each ray meets the sea."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from geometry.arrays import FloatArray
from geometry.errors import InputError
from geometry.head import Mounting
from planner.places import Places
from planner.site import Lidar, Site
from reconstruct.range_fit import edge_range
from reconstruct.records import Records
from reconstruct.sea_level import Level, level_from_sea

# Tide, swell and the foot of the waves: how well the height of the sea is taken to be known (k = 1), ASSUMED.
SEA_STD_M = 0.1


class SeaFit(NamedTuple):
    """The evaluation of low scans over water."""

    lidar: Lidar
    before: Mounting
    level: Level
    rays: int  # all that came; `level.rays` of them met the sea
    offset_solved: bool


def level_head(
    places: Places,
    lidar: str,
    scans: Sequence[Records],
    *,
    sea_height_m: float = 0.0,
    sea_std_m: float = SEA_STD_M,
    solve_offset: bool = False,
) -> SeaFit:
    """Solve for pitch and roll from the ranges at which low rays meet the sea.

    Parameters
    ----------
    places, lidar
        The site, and the name of the lidar that measured.
    scans : sequence of Records
        Rays with CNR in the head's own angles, at bearings over water.
    sea_height_m, sea_std_m : float
        The sea of the moment above mean sea level (tide) and its standard deviation [m].
    solve_offset : bool
        Solve for the elevation offset as well; else the site file's is kept.

    Raises
    ------
    InputError
        If too few rays meet the sea, they do not determine the tilt, or the head is not above the sea.

    Notes
    -----
    Azimuth and elevation offset, heading and range offset of the site file are applied first: pitch and roll turn
    what the offsets have corrected (`geometry.head`).
    """
    chosen = places.site.lidar(lidar)
    before = places.mounting(chosen)
    height_m = _above_mean_sea_m(places.site, chosen) - sea_height_m
    if not height_m > 0:
        raise InputError(
            f"{lidar} stands {height_m:.2f} m above the sea of the moment; needed: more than 0. Check its height in the "
            "site file and --sea-height"
        )
    azimuth, elevation, met, std = _met(scans)
    level = level_from_sea(
        azimuth + before.azimuth_offset_deg,
        elevation + before.elevation_offset_deg,
        before.true_range_m(met),
        range_std_m=std,
        height_m=height_m,
        height_std_m=float(np.hypot(sea_std_m, chosen.uncertainty.position_m)),
        solve_offset=solve_offset,
    )
    return SeaFit(chosen, before, level, int(met.size), solve_offset)


def sea_keys(result: SeaFit) -> dict[str, float]:
    """The site file's keys of the lidar that the fit changes, and their new values."""
    keys = {
        "mounting.pitch_deg": round(result.level.pitch_deg, 4),
        "mounting.roll_deg": round(result.level.roll_deg, 4),
    }
    if result.offset_solved:
        offset = result.before.elevation_offset_deg + result.level.elevation_offset_deg
        keys["elevation_offset_deg"] = round(offset, 4)
    return keys


def _above_mean_sea_m(site: Site, lidar: Lidar) -> float:
    """Height of the head above the geoid [m]."""
    if site.height_datum == "above_sea_level":
        return lidar.position[2]
    if site.geoid_undulation_m is None:
        raise InputError(
            "the site's heights are above the ellipsoid, and the sea follows the geoid; give geoid_undulation_m in the "
            "site file"
        )
    return lidar.position[2] - site.geoid_undulation_m


def _met(scans: Sequence[Records]) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Head azimuth and elevation of all rays, range at which each meets the sea and its standard deviation."""
    if not scans or any(not np.any(np.isfinite(scan.cnr_db)) for scan in scans):
        raise InputError("these rays have no CNR: the edge of the sea cannot be found by radial speed")
    edges = [edge_range(scan.range_m, scan.cnr_db) for scan in scans]
    return (
        np.concatenate([scan.azimuth_deg for scan in scans]),
        np.concatenate([scan.elevation_deg for scan in scans]),
        np.concatenate([edge.range_m for edge in edges]),
        np.concatenate([edge.std_m for edge in edges]),
    )
