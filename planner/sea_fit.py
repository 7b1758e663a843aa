"""Low scans over water -> how a lidar's head is tilted: the range at which each ray meets the sea."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from geometry.arrays import FloatArray
from geometry.errors import InputError
from geometry.head import Mounting
from planner.places import Places
from planner.site import Lidar, Site
from reconstruct.range_fit import EDGE_GATES, edge_range
from reconstruct.records import Records
from reconstruct.sea_level import SEEN_RADIUS_M, Level, level_from_sea, sea_range_m

# Tide, swell and the foot of the waves: how well the height of the sea is taken to be known (k = 1), ASSUMED.
SEA_STD_M = 0.1


class SeaFit(NamedTuple):
    """The evaluation of low scans over water."""

    lidar: Lidar
    before: Mounting
    height_m: float  # of the head above the sea of the moment, as stated
    level: Level
    rays: int  # all that came; `level.rays` of them met the sea
    offset_solved: bool


def level_head(
    places: Places,
    lidar: str,
    scans: Sequence[tuple[str, Records]],
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
    scans : sequence of (file, Records)
        Rays with CNR in the head's own angles, at bearings over water; the file is for messages.
    sea_height_m, sea_std_m : float
        The sea of the moment above mean sea level (tide) and its standard deviation [m].
    solve_offset : bool
        Solve for the elevation offset as well; else the site file's is kept.

    Raises
    ------
    InputError
        If a scan cannot show the sea or too few rays meet it, they do not determine the tilt (the files are named),
        or the head is not above the sea.

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
    edges = [_met(name, scan, before, height_m) for name, scan in scans]
    azimuth, elevation, met, std = (np.concatenate(parts) for parts in zip(*edges, strict=True))
    try:
        level = level_from_sea(
            azimuth + before.azimuth_offset_deg,
            elevation + before.elevation_offset_deg,
            before.true_range_m(met),
            range_std_m=std,
            height_m=height_m,
            height_std_m=float(np.hypot(sea_std_m, chosen.uncertainty.position_m)),
            solve_offset=solve_offset,
        )
    except InputError as error:
        raise InputError(f"{', '.join(name for name, _ in scans)}: {error}") from error
    return SeaFit(chosen, before, height_m, level, int(met.size), solve_offset)


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


def _met(
    name: str, scan: Records, before: Mounting, height_m: float
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Head azimuth and elevation of a scan's rays, range at which each meets the sea and its standard deviation."""
    if not np.any(np.isfinite(scan.cnr_db)):
        raise InputError(
            f"{name}: these rays have no CNR: the edge of the sea cannot be found by radial speed"
        )
    if scan.range_m.size < EDGE_GATES:
        raise InputError(
            f"{name}: rays of {scan.range_m.size} range gate(s) came; the edge of the sea needs {EDGE_GATES} or more"
        )
    offsets = Mounting(
        azimuth_offset_deg=before.azimuth_offset_deg, elevation_offset_deg=before.elevation_offset_deg
    )
    level_m = sea_range_m(
        scan.azimuth_deg, scan.elevation_deg, height_m=height_m, mounting=offsets, radius_m=SEEN_RADIUS_M
    )
    if not np.any(np.isfinite(level_m)):
        raise InputError(
            f"{name}: no ray of a level head would meet the sea: the lowest looks {np.nanmin(scan.elevation_deg):.2f}° up. "
            "Needed: low scans over water, that look below the horizon; for maps of hard targets see `cnr-map fit`"
        )
    edge = edge_range(scan.range_m, scan.cnr_db)
    return scan.azimuth_deg, scan.elevation_deg, edge.range_m, edge.std_m
