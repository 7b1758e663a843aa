"""From where a point can be seen: a horizon swept around it over a height raster.

The ground is sampled on spokes around the target; along each the steepest slope so far is the horizon. A head somewhere
sees the target if it stands above the horizon of its spoke. One sweep serves every place on the raster.
"""

from dataclasses import dataclass

import numpy as np

from geometry.arrays import ArrayLike, FloatArray
from geometry.earth import REFRACTION_COEFFICIENT
from geometry.errors import InputError
from geometry.terrain import HeightRaster
from geometry.terrain_sight import bulge_m

# Distance of neighbouring spokes at the far end, and of samples along them, in cells.
SPOKE_CELLS = 1.0
STEP_CELLS = 0.5

TURN_RAD = 2.0 * np.pi


@dataclass(frozen=True, eq=False)
class Horizon:
    """What hides a target: for each spoke and distance the steepest slope of the ground up to there."""

    raster: HeightRaster
    target_m: FloatArray  # (3,)
    step_m: float
    slope: FloatArray  # (spoke, ring) steepest slope seen from the target up to this ring; +inf beyond an unknown height
    refraction: float

    def needed_height_m(self, east_m: ArrayLike, north_m: ArrayLike) -> FloatArray:
        """How high above the datum a head has to be to see the target over the ground.

        Parameters
        ----------
        east_m, north_m
            Places [m], shapes that broadcast.

        Returns
        -------
        FloatArray
            Height [m]; -inf where nothing is in between, +inf outside the raster and where part of the way has no
            height.
        """
        x = np.asarray(east_m, np.float64) - self.target_m[0]
        y = np.asarray(north_m, np.float64) - self.target_m[1]
        distance = np.hypot(x, y)
        spokes, rings = self.slope.shape
        spoke = np.arctan2(x, y) * (spokes / TURN_RAD)
        first = np.floor(spoke).astype(np.intp)
        part = spoke - first
        steps = np.ceil(distance / self.step_m - 1e-9).astype(np.intp)
        ring = np.minimum(steps - 2, rings - 1)  # the last sample before the head
        flat = self.slope.ravel()
        at = np.maximum(ring, 0)
        left, right = flat[(first % spokes) * rings + at], flat[((first + 1) % spokes) * rings + at]
        with np.errstate(invalid="ignore"):
            slope = np.where(
                np.isfinite(left) & np.isfinite(right), left + part * (right - left), np.maximum(left, right)
            )
        needed = self.target_m[2] + slope * distance + bulge_m(distance, self.refraction)
        inside = self.raster.covers(east_m, north_m)
        return np.where(inside, np.where(ring < 0, -np.inf, needed), np.inf)


def horizon(
    raster: HeightRaster, target_m: ArrayLike, *, refraction: float = REFRACTION_COEFFICIENT
) -> Horizon:
    """Sweep the horizon around a target.

    Parameters
    ----------
    raster
        Heights of the ground.
    target_m
        Easting, northing, height [m], shape (3,), in the raster's CRS and datum.
    refraction
        Share of the Earth's curvature by which a beam bends down.

    Returns
    -------
    Horizon

    Raises
    ------
    InputError
        If the target lies outside the raster.

    Notes
    -----
    Seen from the target the ground at distance d and height h has the slope (h - (1 - k) d²/2R - h_t)/d. Spokes are one
    cell apart at the farthest corner and samples half a cell along them; in between slopes are interpolated. Where the
    exact line of sight (`terrain_sight`) passes within the roughness of a cell, the two may
    differ.

    Examples
    --------
    A wall 20 m high; behind it a head must look over its top.

    >>> ground = np.zeros((21, 21))
    >>> ground[:, 10] = 20.0
    >>> wall = HeightRaster(ground, 0.0, 210.0, 10.0, 10.0, "above_sea_level")
    >>> sweep = horizon(wall, [55.0, 105.0, 10.0], refraction=1.0)
    >>> sweep.needed_height_m([155.0, 500.0], [105.0, 105.0]).round(0).tolist()
    [30.0, inf]
    """
    target = np.asarray(target_m, dtype=np.float64)
    if not raster.covers(target[0], target[1]):
        raise InputError(
            f"the point ({target[0]:.0f}, {target[1]:.0f}) lies outside the height raster {raster.bounds_m}; "
            "give a raster that holds it"
        )
    west, south, east, north = raster.bounds_m
    cell = min(raster.cell_east_m, raster.cell_north_m)
    reach = float(
        np.hypot(max(target[0] - west, east - target[0]), max(target[1] - south, north - target[1]))
    )
    step = STEP_CELLS * cell
    rings = max(int(np.ceil(reach / step)), 1)
    spokes = max(int(np.ceil(TURN_RAD * reach / (SPOKE_CELLS * cell))), 8)
    slope = _slopes(raster, target, step, spokes, rings, refraction)
    np.maximum.accumulate(slope, axis=1, out=slope)
    return Horizon(raster, target, step, np.where(np.isnan(slope), np.inf, slope), refraction)


def viewshed(
    raster: HeightRaster, target_m: ArrayLike, *, refraction: float = REFRACTION_COEFFICIENT
) -> FloatArray:
    """How high above the ground a head has to stand in every cell to see a target.

    Returns
    -------
    FloatArray
        (row, column) [m]; at most 0 where a head on the ground sees it; NaN where that is not known.

    Examples
    --------
    >>> flat = HeightRaster(np.zeros((3, 3)), 0.0, 30.0, 10.0, 10.0, "above_sea_level")
    >>> bool(np.all(viewshed(flat, [15.0, 15.0, 2.0]) <= 0.0))
    True
    """
    sweep = horizon(raster, target_m, refraction=refraction)
    out = np.empty(raster.height_m.shape)
    for number, northing in enumerate(raster.northing_m):  # by rows: what a row needs stays in the cache
        out[number] = sweep.needed_height_m(raster.east_m, northing)
    out -= raster.height_m
    return np.where(out == np.inf, np.nan, out)


def _slopes(
    raster: HeightRaster, target: FloatArray, step: float, spokes: int, rings: int, refraction: float
) -> FloatArray:
    """(spoke, ring) slope of the ground seen from the target; NaN without height.

    Beyond the edge, where no place asks but its neighbours' interpolation does, the edge's height goes on.
    """
    west, south, east, north = raster.bounds_m
    distance = (np.arange(rings) + 1.0) * step
    bulge = bulge_m(distance, refraction)
    out = np.empty((spokes, rings))
    size = max(2**15 // rings, 1)
    for start in range(0, spokes, size):
        angle = np.arange(start, min(start + size, spokes))[:, None] * (TURN_RAD / spokes)
        x, y = target[0] + np.sin(angle) * distance, target[1] + np.cos(angle) * distance
        heights = raster.heights_m(np.clip(x, west, east), np.clip(y, south, north))
        out[start : start + size] = (heights - bulge - target[2]) / distance
    return out
