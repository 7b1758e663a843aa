"""A height raster: heights of the ground in square or oblong cells.

Coordinates are easting and northing of the raster's own projected CRS; heights are metres above its datum. What lies
outside the raster, or in a hole of it, is unknown; sea level is a height, 0 m, like any other.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from geometry.arrays import ArrayLike, BoolArray, FloatArray
from geometry.errors import InputError
from geometry.frames import HeightDatum


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
