"""A height raster and the beams over it: how far they clear the ground, and where they are not known to.

Coordinates are easting and northing of the raster's own projected CRS; heights are metres above its datum. Over it a
beam is straight but for the Earth, whose surface falls away under it, and for refraction, which bends it back.
What lies outside the raster, or in a hole of it, is unknown, never clear; sea level is a height, 0 m, like any other.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal, NamedTuple

import numpy as np

from geometry.arrays import ArrayLike, BoolArray, FloatArray
from geometry.earth import EARTH_RADIUS_M, REFRACTION_COEFFICIENT
from geometry.errors import InputError

HeightDatum = Literal["above_sea_level", "ellipsoidal"]

CHUNK = 2**20  # samples that are worked on at once


@dataclass(frozen=True, eq=False)
class HeightRaster:
    """Heights of the ground (or of what stands on it) in square or oblong cells, row 0 in the north.

    Parameters
    ----------
    height_m
        Heights at the middles of the cells [m], shape (row, column); NaN where unknown.
    west_m, north_m
        Easting and northing of the outer corner of the first cell [m].
    cell_east_m, cell_north_m
        Size of a cell [m], positive.
    height_datum
        What the heights count from.

    Raises
    ------
    InputError
        If the array is no raster of at least 2 x 2 cells, or a cell has no size.

    Examples
    --------
    >>> hill = HeightRaster(np.array([[0.0, 0.0], [10.0, 10.0]]), 0.0, 200.0, 100.0, 100.0, "above_sea_level")
    >>> hill.heights_m([50.0, 50.0, 50.0, 500.0], [150.0, 100.0, 50.0, 50.0]).tolist()
    [0.0, 5.0, 10.0, nan]
    """

    height_m: FloatArray  # (row, column)
    west_m: float
    north_m: float
    cell_east_m: float
    cell_north_m: float
    height_datum: HeightDatum

    def __post_init__(self) -> None:
        heights = np.array(self.height_m, dtype=np.float64)
        sizes = (self.cell_east_m, self.cell_north_m)
        if (
            heights.ndim != 2
            or min(heights.shape) < 2
            or not all(np.isfinite(size) and size > 0 for size in sizes)
        ):
            raise InputError(
                f"a height raster of shape {heights.shape} with cells of {sizes} m came; allowed are at least 2 x 2 "
                "cells of positive size. Turn or warp a raster that is not north-up first."
            )
        heights[~np.isfinite(heights)] = np.nan
        heights.flags.writeable = False
        object.__setattr__(self, "height_m", heights)

    @classmethod
    def from_transform(
        cls, height_m: ArrayLike, transform: Sequence[float], height_datum: HeightDatum
    ) -> "HeightRaster":
        """Make a raster from an affine transform (a, b, c, d, e, f): easting = a col + b row + c, northing = d col + e row + f.

        Raises
        ------
        InputError
            If the transform turns or mirrors: b, d not 0, a not positive. A raster with its first row in the south is
            turned over.

        Examples
        --------
        >>> low = HeightRaster.from_transform([[1.0, 2.0], [3.0, 4.0]], (10, 0, 500, 0, 10, 800), "above_sea_level")
        >>> low.height_m[0].tolist(), low.north_m
        ([3.0, 4.0], 820.0)
        """
        east, turn_east, west, turn_north, north, top = (float(value) for value in transform[:6])
        heights = np.asarray(height_m, dtype=np.float64)
        if turn_east != 0 or turn_north != 0 or not east > 0 or north == 0:
            raise InputError(
                f"a raster with the transform {tuple(transform[:6])} came; allowed is one whose columns run east and whose "
                "rows run north or south. Warp it first."
            )
        if north > 0:
            heights, top = heights[::-1], top + north * heights.shape[0]
        return cls(heights, west, top, east, abs(north), height_datum)

    @property
    def bounds_m(self) -> tuple[float, float, float, float]:
        """West, south, east, north edge of the outer cells [m]."""
        rows, columns = self.height_m.shape
        return (
            self.west_m,
            self.north_m - rows * self.cell_north_m,
            self.west_m + columns * self.cell_east_m,
            self.north_m,
        )

    @property
    def east_m(self) -> FloatArray:
        """(column,) eastings of the cells' middles [m]."""
        return np.asarray(self.west_m + (np.arange(self.height_m.shape[1]) + 0.5) * self.cell_east_m)

    @property
    def northing_m(self) -> FloatArray:
        """(row,) northings of the cells' middles [m], descending."""
        return np.asarray(self.north_m - (np.arange(self.height_m.shape[0]) + 0.5) * self.cell_north_m)

    def covers(self, east_m: ArrayLike, north_m: ArrayLike) -> BoolArray:
        """Tell which points lie within the outer edges."""
        west, south, east, north = self.bounds_m
        x, y = np.asarray(east_m, dtype=np.float64), np.asarray(north_m, dtype=np.float64)
        return np.asarray((x >= west) & (x <= east) & (y >= south) & (y <= north))

    def heights_m(self, east_m: ArrayLike, north_m: ArrayLike) -> FloatArray:
        """Heights at points [m], bilinear between the middles of cells.

        Within the outer half cells the edge's height holds. A point outside, or next to a cell without height, is NaN.
        """
        x, y = np.broadcast_arrays(np.asarray(east_m, np.float64), np.asarray(north_m, np.float64))
        rows, columns = self.height_m.shape
        column = (x - self.west_m) / self.cell_east_m - 0.5
        row = (self.north_m - y) / self.cell_north_m - 0.5
        inside = (column >= -0.5) & (column <= columns - 0.5) & (row >= -0.5) & (row <= rows - 0.5)
        column = np.clip(np.where(inside, column, 0.0), 0.0, columns - 1.0)
        row = np.clip(np.where(inside, row, 0.0), 0.0, rows - 1.0)
        left = np.minimum(column.astype(np.intp), columns - 2)
        upper = np.minimum(row.astype(np.intp), rows - 2)
        across, down = column - left, row - upper
        flat, first = self.height_m.ravel(), upper * columns + left
        north = flat[first] + across * (flat[first + 1] - flat[first])
        south = flat[first + columns] + across * (flat[first + columns + 1] - flat[first + columns])
        return np.asarray(np.where(inside, north + down * (south - north), np.nan))

    def with_layer(self, added_m: ArrayLike) -> "HeightRaster":
        """The raster with a layer on top: heights of canopy or buildings above the ground [m], (row, column).

        Raises
        ------
        InputError
            If the layer has another shape or is negative somewhere. NaN in it is unknown, and so is the sum.

        Examples
        --------
        >>> flat = HeightRaster(np.zeros((2, 2)), 0.0, 20.0, 10.0, 10.0, "above_sea_level")
        >>> flat.with_layer([[0.0, 12.0], [0.0, 0.0]]).height_m.tolist()
        [[0.0, 12.0], [0.0, 0.0]]
        """
        layer = np.asarray(added_m, dtype=np.float64)
        if layer.shape != self.height_m.shape or np.any(layer < 0.0):
            raise InputError(
                f"a layer of shape {layer.shape} with a least height of {np.nanmin(layer, initial=0.0):g} m came for a "
                f"raster of shape {self.height_m.shape}; allowed is the same shape and heights from 0 up."
            )
        return replace(self, height_m=self.height_m + layer)


class TerrainSight(NamedTuple):
    """How beams clear the ground."""

    clearance_m: FloatArray  # (..., gate) least height above the ground from the head to the gate; negative: through it
    distance_m: FloatArray  # (..., gate) level distance from the head where it is least
    blocked: BoolArray  # (..., gate) the ground is in the way
    unknown: BoolArray  # (..., gate) not blocked as far as is known, but part of the way has no height


def beam_height_m(
    head_height_m: ArrayLike,
    elevation_deg: ArrayLike,
    distance_m: ArrayLike,
    *,
    refraction: float = REFRACTION_COEFFICIENT,
) -> FloatArray:
    """Height of a beam above the datum.

    Parameters
    ----------
    head_height_m
        Height of the scanner head above the datum [m].
    elevation_deg
        Elevation of the beam where it leaves the head [deg].
    distance_m
        Level distance from the head [m]; the shapes broadcast.
    refraction
        Share of the Earth's curvature by which the beam bends down; 0 for a straight line.

    Returns
    -------
    FloatArray
        Height [m].

    Notes
    -----
    h + d tan φ + (1 - k) d²/2R: `geometry.earth.curvature_drop_m` less `refraction_lift_m`.

    Examples
    --------
    >>> beam_height_m(0.0, 0.0, [1000.0, 6000.0]).round(2).tolist()
    [0.07, 2.46]
    """
    distance = np.asarray(distance_m, dtype=np.float64)
    rise = np.tan(np.deg2rad(np.asarray(elevation_deg, dtype=np.float64)))
    return np.asarray(np.asarray(head_height_m, np.float64) + distance * rise + bulge_m(distance, refraction))


def terrain_sight(
    raster: HeightRaster,
    head_m: ArrayLike,
    end_m: ArrayLike,
    *,
    shares: ArrayLike = (1.0,),
    refraction: float = REFRACTION_COEFFICIENT,
) -> TerrainSight:
    """Clearance of beams above the ground, from the head to each of some gates on the way.

    Parameters
    ----------
    raster
        Heights of the ground, with what stands on it where that counts.
    head_m
        Heads, easting, northing, height [m], shape (..., 3), in the raster's CRS and datum.
    end_m
        Far ends of the beams, the same; the shapes broadcast.
    shares
        (gate,) where the gates are, as ascending shares of the level distance to the end; 1 is the end.
    refraction
        Share of the Earth's curvature by which the beam bends down.

    Returns
    -------
    TerrainSight
        Of shape (..., gate). Clearance is NaN where no height is known on the whole way.

    Raises
    ------
    InputError
        If the shares are not ascending between 0 and 1.

    Notes
    -----
    Between head and end the straight line lies d (D - d) (1 - k) / 2R lower over the curved datum than the chord of the
    two heights. The ground is bilinear between the middles of cells, and sampled wherever a beam
    crosses a line through them: its ridges are met exactly.

    Examples
    --------
    A wall 20 m high half way between two points 10 m above the plain.

    >>> ground = np.zeros((3, 11))
    >>> ground[:, 5] = 20.0
    >>> wall = HeightRaster(ground, 0.0, 300.0, 100.0, 100.0, "above_sea_level")
    >>> sight = terrain_sight(wall, [50.0, 150.0, 10.0], [1050.0, 150.0, 10.0], shares=[0.3, 1.0])
    >>> sight.clearance_m.round(1).tolist(), sight.blocked.tolist()
    ([10.0, -10.0], [False, True])
    >>> terrain_sight(wall, [50.0, 150.0, 99.0], [2000.0, 150.0, 99.0]).unknown.tolist()
    [True]
    """
    gates = np.asarray(shares, dtype=np.float64)
    if gates.ndim != 1 or gates.size == 0 or np.any(np.diff(gates) < 0) or gates[0] <= 0 or gates[-1] > 1:
        raise InputError(
            f"gates at the shares {gates.tolist()} came; allowed are ascending shares over 0, up to 1"
        )
    head, end = np.broadcast_arrays(np.asarray(head_m, np.float64), np.asarray(end_m, np.float64))
    shape = head.shape[:-1]
    head, end = head.reshape(-1, 3), end.reshape(-1, 3)
    step = max(CHUNK // max(int(np.sum(_cells_crossed(raster, head, end)).max(initial=1)), 1), 1)
    slices = [slice(start, start + step) for start in range(0, max(len(head), 1), step)]
    parts = [_sight(raster, head[part], end[part], gates, refraction) for part in slices]
    joined = (np.concatenate([part[i] for part in parts]).reshape(*shape, gates.size) for i in range(3))
    least, where, complete = joined
    blocked = np.asarray(least < 0.0)
    return TerrainSight(least, where, blocked, ~blocked & ~complete.astype(bool))


def _sight(
    raster: HeightRaster, head: FloatArray, end: FloatArray, gates: FloatArray, refraction: float
) -> tuple[FloatArray, FloatArray, BoolArray]:
    """Least clearance, where, and whether every height is known: (beam, gate) each."""
    share = _crossings(raster, head, end, gates)
    points = head[:, None] + share[..., None] * (end - head)[:, None]
    span = np.hypot(*(end - head)[:, :2].T)
    bulge = 4.0 * share * (1.0 - share) * bulge_m(0.5 * span, refraction)[:, None]
    above = points[..., 2] - bulge - raster.heights_m(points[..., 0], points[..., 1])
    least, where, complete = (np.empty((len(head), gates.size)) for _ in range(3))
    for number, gate in enumerate(gates):
        upto = np.where((share <= gate) & ~np.isnan(above), above, np.inf)
        lowest = np.argmin(upto, axis=1)[:, None]
        least[:, number] = np.take_along_axis(upto, lowest, axis=1)[:, 0]
        where[:, number] = span * np.take_along_axis(share, lowest, axis=1)[:, 0]
        complete[:, number] = ~np.any((share <= gate) & np.isnan(above), axis=1)
    return np.where(np.isinf(least), np.nan, least), where, complete.astype(bool)


def _cells_crossed(raster: HeightRaster, head: FloatArray, end: FloatArray) -> FloatArray:
    """(2, beam) how many lines through the middles of cells each beam crosses, running north and running east."""
    east, north = np.abs(end - head)[:, :2].T
    return np.asarray(np.ceil(np.stack([east / raster.cell_east_m, north / raster.cell_north_m])) + 1.0)


def _crossings(raster: HeightRaster, head: FloatArray, end: FloatArray, gates: FloatArray) -> FloatArray:
    """(beam, sample) ascending shares of the way: both ends, the gates, and every line through the middles of cells.

    On those lines lie the edges of the bilinear ground, and so its ridges.
    """
    counts = _cells_crossed(raster, head, end).max(axis=1, initial=1).astype(int)
    shares = [np.zeros((len(head), 1)), np.broadcast_to(gates, (len(head), gates.size))]
    sizes, corner = (raster.cell_east_m, -raster.cell_north_m), (raster.west_m, raster.north_m)
    for axis, (size, first, count) in enumerate(zip(sizes, corner, counts, strict=True)):
        start = (head[:, axis] - first) / size - 0.5
        along = (end[:, axis] - head[:, axis]) / size
        forward = np.sign(along)
        lines = np.where(forward > 0, np.floor(start), np.ceil(start))[:, None] + forward[:, None] * (
            1 + np.arange(count)
        )
        with np.errstate(divide="ignore", invalid="ignore"):
            share = (lines - start[:, None]) / along[:, None]
        shares.append(np.where((share > 0.0) & (share < gates[-1]), share, gates[-1]))
    return np.sort(np.concatenate(shares, axis=1), axis=1)


def bulge_m(distance_m: ArrayLike, refraction: float) -> FloatArray:
    """How far the datum falls away under a beam [m]: (1 - k) d²/2R."""
    distance = np.asarray(distance_m, dtype=np.float64)
    return np.asarray((1.0 - refraction) * distance * distance / (2.0 * EARTH_RADIUS_M))
