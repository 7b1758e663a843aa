"""Solids that can stand in a beam's way: cylinders, boxes, spheres and discs, many of each kind at once.

Positions lie in one local frame: east, true north, up [m]. Every kind answers `distance_m`: the signed
distance of points to its surface, negative inside. All are convex, so that along a straight beam the distance
falls to one least value and rises again.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from geometry.arrays import ArrayLike, BoolArray, FloatArray
from geometry.errors import InputError


class Solids(Protocol):
    """What a line of sight asks of solids."""

    def __len__(self) -> int:
        """Count the solids."""

    def distance_m(self, points_m: FloatArray) -> FloatArray:
        """Signed distance [m] of points (..., solid or 1, 3) to the surface of each: (..., solid)."""


@dataclass(frozen=True, eq=False)
class Cylinders:
    """Upright cylinders: towers and masts.

    Parameters
    ----------
    axis_m
        Where the axes stand: east, north [m], shape (solid, 2).
    radius_m, bottom_m, top_m
        Radii, and heights of both ends in the local frame [m]; (solid,) or one for all.

    Raises
    ------
    InputError
        If a radius is not positive, a top is not above its bottom, or a number is not finite.

    Examples
    --------
    >>> tower = Cylinders([[100.0, 0.0]], 2.0, 0.0, 80.0)
    >>> tower.distance_m(np.array([[[90.0, 0.0, 50.0]], [[100.0, 0.5, 50.0]], [[100.0, 0.0, 90.0]]])).tolist()
    [[8.0], [-1.5], [10.0]]
    """

    axis_m: FloatArray  # (solid, 2)
    radius_m: FloatArray  # (solid,)
    bottom_m: FloatArray  # (solid,)
    top_m: FloatArray  # (solid,)

    def __init__(self, axis_m: ArrayLike, radius_m: ArrayLike, bottom_m: ArrayLike, top_m: ArrayLike) -> None:
        axis, (radius, bottom, top) = _solids("cylinders", axis_m, 2, [radius_m, bottom_m, top_m])
        _require("cylinders", "a positive radius and a top above the bottom", (radius > 0.0) & (top > bottom))
        _freeze(self, axis_m=axis, radius_m=radius, bottom_m=bottom, top_m=top)

    def __len__(self) -> int:
        """Count the cylinders."""
        return int(self.radius_m.size)

    def distance_m(self, points_m: FloatArray) -> FloatArray:
        """Signed distance [m] of points (..., solid or 1, 3) to the surface of each: (..., solid)."""
        aside = np.hypot(points_m[..., 0] - self.axis_m[:, 0], points_m[..., 1] - self.axis_m[:, 1])
        return _signed([aside - self.radius_m, _beyond(points_m[..., 2], self.bottom_m, self.top_m)])


@dataclass(frozen=True, eq=False)
class Boxes:
    """Upright boxes: buildings and other obstacles.

    Parameters
    ----------
    centre_m
        Middles of the footprints: east, north [m], shape (solid, 2).
    width_m, length_m
        Sides of the footprints [m]; (solid,) or one for all.
    bearing_deg
        Where the length points [deg], clockwise from true north; 0 for the length running north.
    bottom_m, top_m
        Heights of both ends in the local frame [m].

    Raises
    ------
    InputError
        If a side is not positive, a top is not above its bottom, or a number is not finite.

    Examples
    --------
    >>> barn = Boxes([[0.0, 0.0]], 10.0, 40.0, 90.0, 0.0, 6.0)
    >>> barn.distance_m(np.array([[[25.0, 0.0, 3.0]], [[0.0, 6.0, 3.0]]])).round(6).tolist()
    [[5.0], [1.0]]
    """

    centre_m: FloatArray  # (solid, 2)
    width_m: FloatArray  # (solid,)
    length_m: FloatArray  # (solid,)
    bearing_deg: FloatArray  # (solid,)
    bottom_m: FloatArray  # (solid,)
    top_m: FloatArray  # (solid,)

    def __init__(
        self,
        centre_m: ArrayLike,
        width_m: ArrayLike,
        length_m: ArrayLike,
        bearing_deg: ArrayLike,
        bottom_m: ArrayLike,
        top_m: ArrayLike,
    ) -> None:
        numbers = [width_m, length_m, bearing_deg, bottom_m, top_m]
        centre, (width, length, bearing, bottom, top) = _solids("boxes", centre_m, 2, numbers)
        sound = (width > 0.0) & (length > 0.0) & (top > bottom)
        _require("boxes", "positive sides and a top above the bottom", sound)
        _freeze(self, centre_m=centre, width_m=width, length_m=length, bearing_deg=bearing)
        _freeze(self, bottom_m=bottom, top_m=top)

    def __len__(self) -> int:
        """Count the boxes."""
        return int(self.width_m.size)

    def distance_m(self, points_m: FloatArray) -> FloatArray:
        """Signed distance [m] of points (..., solid or 1, 3) to the surface of each: (..., solid)."""
        bearing = np.deg2rad(self.bearing_deg)
        east, north = points_m[..., 0] - self.centre_m[:, 0], points_m[..., 1] - self.centre_m[:, 1]
        along = np.abs(east * np.sin(bearing) + north * np.cos(bearing)) - 0.5 * self.length_m
        across = np.abs(east * np.cos(bearing) - north * np.sin(bearing)) - 0.5 * self.width_m
        return _signed([along, across, _beyond(points_m[..., 2], self.bottom_m, self.top_m)])


@dataclass(frozen=True, eq=False)
class Spheres:
    """Spheres: what a rotor sweeps when it may face any wind.

    Parameters
    ----------
    centre_m
        Middles: east, north, up [m], shape (solid, 3); the hubs.
    radius_m
        Radii [m], (solid,) or one for all; half the rotor diameter.

    Raises
    ------
    InputError
        If a radius is not positive or a number is not finite.

    Examples
    --------
    >>> Spheres([[0.0, 0.0, 80.0]], 50.0).distance_m(np.array([[0.0, 0.0, 150.0]])).tolist()
    [20.0]
    """

    centre_m: FloatArray  # (solid, 3)
    radius_m: FloatArray  # (solid,)

    def __init__(self, centre_m: ArrayLike, radius_m: ArrayLike) -> None:
        centre, (radius,) = _solids("spheres", centre_m, 3, [radius_m])
        _require("spheres", "a positive radius", radius > 0.0)
        _freeze(self, centre_m=centre, radius_m=radius)

    def __len__(self) -> int:
        """Count the spheres."""
        return int(self.radius_m.size)

    def distance_m(self, points_m: FloatArray) -> FloatArray:
        """Signed distance [m] of points (..., solid or 1, 3) to the surface of each: (..., solid)."""
        return np.asarray(np.linalg.norm(points_m - self.centre_m, axis=-1) - self.radius_m)


@dataclass(frozen=True, eq=False)
class Discs:
    """Upright discs of some thickness: rotors that face one known direction, without tilt.

    Parameters
    ----------
    centre_m
        Middles: east, north, up [m], shape (solid, 3); the hubs.
    radius_m
        Radii [m], (solid,) or one for all; half the rotor diameter.
    facing_deg
        Bearing of the disc's axis [deg], clockwise from true north: the wind direction for a rotor that
        follows it.
    thickness_m
        Extent along the axis [m], centred on the hub: blade chord and bending, as the user takes them.

    Raises
    ------
    InputError
        If a radius or thickness is not positive or a number is not finite.

    Examples
    --------
    >>> rotor = Discs([[0.0, 0.0, 80.0]], 50.0, 0.0, 4.0)
    >>> rotor.distance_m(np.array([[[40.0, 10.0, 80.0]], [[60.0, 0.0, 80.0]]])).tolist()
    [[8.0], [10.0]]
    """

    centre_m: FloatArray  # (solid, 3)
    radius_m: FloatArray  # (solid,)
    facing_deg: FloatArray  # (solid,)
    thickness_m: FloatArray  # (solid,)

    def __init__(
        self, centre_m: ArrayLike, radius_m: ArrayLike, facing_deg: ArrayLike, thickness_m: ArrayLike
    ) -> None:
        centre, (radius, facing, thickness) = _solids(
            "discs", centre_m, 3, [radius_m, facing_deg, thickness_m]
        )
        _require("discs", "a positive radius and thickness", (radius > 0.0) & (thickness > 0.0))
        _freeze(self, centre_m=centre, radius_m=radius, facing_deg=facing, thickness_m=thickness)

    def __len__(self) -> int:
        """Count the discs."""
        return int(self.radius_m.size)

    def distance_m(self, points_m: FloatArray) -> FloatArray:
        """Signed distance [m] of points (..., solid or 1, 3) to the surface of each: (..., solid)."""
        facing = np.deg2rad(self.facing_deg)
        east, north, up = np.moveaxis(points_m - self.centre_m, -1, 0)
        along = np.abs(east * np.sin(facing) + north * np.cos(facing)) - 0.5 * self.thickness_m
        aside = np.hypot(east * np.cos(facing) - north * np.sin(facing), up) - self.radius_m
        return _signed([along, aside])


def _beyond(height_m: FloatArray, bottom_m: FloatArray, top_m: FloatArray) -> FloatArray:
    """How far heights lie above the top or below the bottom [m]; negative in between."""
    return np.maximum(height_m - top_m, bottom_m - height_m)


def _signed(beyond_m: Sequence[FloatArray]) -> FloatArray:
    """Signed distance [m] to a solid from how far points are beyond each of its orthogonal bounds [m]."""
    beyond = np.stack(np.broadcast_arrays(*beyond_m))
    outside = np.sqrt(np.sum(np.maximum(beyond, 0.0) ** 2, axis=0))
    return np.asarray(outside + np.minimum(beyond.max(axis=0), 0.0))


def _solids(
    kind: str, place_m: ArrayLike, columns: int, numbers: Sequence[ArrayLike]
) -> tuple[FloatArray, list[FloatArray]]:
    """Places (solid, columns) and numbers (solid,) as own arrays."""
    place = np.array(place_m, dtype=np.float64)
    if place.ndim != 2 or place.shape[1] != columns:
        raise InputError(
            f"{kind} at places of shape {place.shape} came; allowed is (solid, {columns}) in metres. "
            "Put the solids on the first axis."
        )
    try:
        each = [np.array(np.broadcast_to(np.asarray(a, dtype=np.float64), place.shape[:1])) for a in numbers]
    except ValueError as error:
        raise InputError(
            f"{place.shape[0]} {kind} came with sizes of shapes {[np.shape(a) for a in numbers]}; allowed is "
            "one number each or one for all."
        ) from error
    _require(kind, "finite numbers", np.isfinite(np.column_stack([place, *each])))
    return place, each


def _require(kind: str, allowed: str, sound: BoolArray) -> None:
    """Refuse solids that cannot be."""
    if not np.all(sound):
        wrong = np.flatnonzero(~np.atleast_2d(sound.T).all(axis=0)).tolist()
        raise InputError(f"{kind} {wrong} (counted from 0) came without {allowed}. Check sizes and places.")


def _freeze(solids: object, **arrays: FloatArray) -> None:
    """Give a frozen dataclass its read-only arrays."""
    for name, array in arrays.items():
        array.flags.writeable = False
        object.__setattr__(solids, name, array)
