"""The neutral scene: what is drawn, in local metres, without a word about what draws it.

Positions are (n, 3) arrays of metres east, north and up from the origin of the scene. The adapters
(`pyvista_adapter`, `plotly_adapter`, `gltf_adapter`) read these nouns and nothing else.
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import numpy as np

from geometry.arrays import ArrayLike, FloatArray, IntArray
from geometry.errors import InputError


def _positions(values: ArrayLike, what: str) -> FloatArray:
    array = np.array(values, dtype=np.float64)
    if array.ndim != 2 or array.shape[1] != 3:
        raise InputError(f"{what}: came with shape {array.shape}; give (n, 3): east, north, up in metres")
    if not np.isfinite(array).all():
        raise InputError(
            f"{what}: {int((~np.isfinite(array)).sum())} coordinates are not finite; leave such points out"
        )
    array.setflags(write=False)
    return array


def _indices(values: ArrayLike, columns: int, count: int, what: str) -> IntArray:
    array = (
        np.array(values, dtype=np.intp).reshape(-1, columns)
        if np.size(values) == 0
        else np.array(values, dtype=np.intp)
    )
    if array.ndim != 2 or array.shape[1] != columns:
        raise InputError(f"{what}: came with shape {array.shape}; give (m, {columns}) indices of points")
    if array.size and (array.min() < 0 or array.max() >= count):
        raise InputError(
            f"{what}: index {int(array.min())} to {int(array.max())} came, but points are 0 to {count - 1}"
        )
    array.setflags(write=False)
    return array


def _fraction(value: float, what: str) -> None:
    if not 0 < value <= 1:
        raise InputError(f"{what}: opacity {value} came; it must be above 0 and at most 1")


@dataclass(frozen=True, eq=False)
class Mesh:
    """A surface of triangles.

    Examples
    --------
    >>> Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]]).area_m2
    0.5
    """

    vertices_m: FloatArray  # (vertex, 3)
    triangles: IntArray  # (triangle, 3) indices of vertices, counter-clockwise seen from outside
    opacity: float = 1.0  # multiplies the layer's
    hover: str = ""  # what a reader sees under the pointer
    shaded: bool = (
        True  # solid bodies have light and shadow; flat and see-through things have their plain colour
    )

    def __post_init__(self) -> None:
        object.__setattr__(self, "vertices_m", _positions(self.vertices_m, "vertices of a mesh"))
        triangles = _indices(self.triangles, 3, len(self.vertices_m), "triangles of a mesh")
        object.__setattr__(self, "triangles", triangles)
        _fraction(self.opacity, "mesh")

    @property
    def normals(self) -> FloatArray:
        """(triangle, 3) normals, as long as twice the triangle's area [m²]."""
        a, b, c = (self.vertices_m[self.triangles[:, i]] for i in range(3))
        return np.asarray(np.cross(b - a, c - a), dtype=np.float64)

    @property
    def area_m2(self) -> float:
        """Area of all triangles together [m²]."""
        return float(0.5 * np.linalg.norm(self.normals, axis=1).sum())


@dataclass(frozen=True, eq=False)
class Lines:
    """Straight segments between points.

    Examples
    --------
    >>> round(float(Lines([[0, 0, 0], [3, 4, 0]], [[0, 1]]).length_m), 3)
    5.0
    """

    points_m: FloatArray  # (point, 3)
    segments: IntArray  # (segment, 2) indices of points
    width_px: float = 2.0
    opacity: float = 1.0
    hover: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "points_m", _positions(self.points_m, "points of lines"))
        object.__setattr__(
            self, "segments", _indices(self.segments, 2, len(self.points_m), "segments of lines")
        )
        _fraction(self.opacity, "lines")

    @property
    def length_m(self) -> float:
        """Length of all segments together [m]."""
        ends = self.points_m[self.segments]
        return float(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).sum())


@dataclass(frozen=True, eq=False)
class Points:
    """Dots of a size on the screen, each with its own text under the pointer."""

    points_m: FloatArray  # (point, 3)
    size_px: float = 6.0
    opacity: float = 1.0
    hover: tuple[str, ...] = ()  # one for each point, or none

    def __post_init__(self) -> None:
        object.__setattr__(self, "points_m", _positions(self.points_m, "points"))
        if self.hover and len(self.hover) != len(self.points_m):
            raise InputError(
                f"points: {len(self.hover)} texts came for {len(self.points_m)} points; give one each or none"
            )
        _fraction(self.opacity, "points")

    @property
    def is_symbol(self) -> bool:
        """Whether the dots stand for things too small to be seen, such as lidars."""
        return self.size_px >= SYMBOL_PX


@dataclass(frozen=True, eq=False)
class Label:
    """A name at a place; the adapter finds the room for it and draws the leader line."""

    text: str
    at_m: FloatArray  # (3,)
    rank: int = 1  # 0 is placed first and stays nearest; 2 may be left out of a small picture

    def __post_init__(self) -> None:
        at_m = _positions(
            np.reshape(np.asarray(self.at_m, dtype=np.float64), (1, -1)), f"label {self.text!r}"
        )[0]
        object.__setattr__(self, "at_m", at_m)


SYMBOL_PX = 12.0  # dots from this size on are symbols: an adapter may draw them over everything

Item = Mesh | Lines | Points | Label


@dataclass(frozen=True, eq=False)
class Layer:
    """Things of one kind and colour, switched on and off together."""

    name: str
    colour: str  # #rrggbb
    items: tuple[Item, ...]
    opacity: float = 1.0
    in_legend: bool = True
    about: str = ""  # a second line in the legend

    def __post_init__(self) -> None:
        if not re.fullmatch(r"#[0-9a-fA-F]{6}", self.colour):
            raise InputError(f"layer {self.name!r}: colour {self.colour!r} came; write it as #rrggbb")
        _fraction(self.opacity, f"layer {self.name!r}")

    @property
    def meshes(self) -> tuple[Mesh, ...]:
        """The surfaces of the layer."""
        return tuple(item for item in self.items if isinstance(item, Mesh))

    @property
    def lines(self) -> tuple[Lines, ...]:
        """The lines of the layer."""
        return tuple(item for item in self.items if isinstance(item, Lines))

    @property
    def points(self) -> tuple[Points, ...]:
        """The dots of the layer."""
        return tuple(item for item in self.items if isinstance(item, Points))

    @property
    def labels(self) -> tuple[Label, ...]:
        """The names of the layer."""
        return tuple(item for item in self.items if isinstance(item, Label))


@dataclass(frozen=True, eq=False)
class View:
    """A camera: where it stands, what it looks at, how wide it sees; up is up."""

    name: str
    position_m: FloatArray  # (3,)
    focus_m: FloatArray  # (3,)
    view_angle_deg: float = 30.0  # vertical field of view
    without: tuple[str, ...] = ()  # names of layers that this view leaves out

    def __post_init__(self) -> None:
        for name in ("position_m", "focus_m"):
            row = np.reshape(np.asarray(getattr(self, name), dtype=np.float64), (1, -1))
            object.__setattr__(self, name, _positions(row, f"view {self.name!r}, {name}")[0])
        if not 0 < self.view_angle_deg < 180:
            raise InputError(
                f"view {self.name!r}: {self.view_angle_deg}° came; the field of view is between 0 and 180°"
            )
        if not np.linalg.norm((self.focus_m - self.position_m)[:2]) > 0:
            raise InputError(
                f"view {self.name!r}: looks straight up or down; move the camera a little to the side"
            )


def positions_m(item: Item) -> FloatArray:
    """Give the (n, 3) points that an item occupies [m]."""
    if isinstance(item, Mesh):
        return item.vertices_m
    if isinstance(item, Label):
        return item.at_m[None, :]
    return item.points_m


@dataclass(frozen=True, eq=False)
class Scene:
    """Everything to be drawn, in local metres.

    Raises
    ------
    InputError
        If two layers have one name, or there is nothing to draw.

    Examples
    --------
    >>> scene = Scene("empty field", (Layer("post", "#000000", (Lines([[0, 0, 0], [0, 0, 10]], [[0, 1]]),)),))
    >>> scene.extent_m
    array([[ 0.,  0.,  0.],
           [ 0.,  0., 10.]])
    >>> float(scene.exaggerated(3.0).extent_m[1, 2])
    30.0
    """

    title: str
    layers: tuple[Layer, ...]
    views: tuple[View, ...] = ()  # the first is the overview
    note: str = ""  # one line under the title
    vertical_exaggeration: float = field(default=1.0)

    def __post_init__(self) -> None:
        names = [layer.name for layer in self.layers]
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise InputError(
                f"scene {self.title!r}: layers named twice: {', '.join(twice)}; give each its own name"
            )
        if not any(len(positions_m(item)) for layer in self.layers for item in layer.items):
            raise InputError(f"scene {self.title!r}: nothing to draw; give at least one layer with an item")

    def items(self) -> Iterator[tuple[Layer, Item]]:
        """Go through all items with their layers."""
        for layer in self.layers:
            for item in layer.items:
                yield layer, item

    @property
    def names(self) -> tuple[tuple[Layer, Label], ...]:
        """Labels with the layers they belong to; a lidar with several scans is named once."""
        found: dict[tuple[str, tuple[float, ...]], tuple[Layer, Label]] = {}
        for layer in self.layers:
            for label in layer.labels:
                found.setdefault((label.text, tuple(label.at_m.round(2).tolist())), (layer, label))
        return tuple(found.values())

    @property
    def extent_m(self) -> FloatArray:
        """(2, 3) lowest and highest east, north, up of everything [m]."""
        everything = np.concatenate([positions_m(item) for _, item in self.items()])
        return np.stack([everything.min(axis=0), everything.max(axis=0)])

    def exaggerated(self, factor: float) -> "Scene":
        """Stretch all heights, cameras' included, by a factor that the picture then states.

        Raises
        ------
        InputError
            If the factor is not a positive number.
        """
        if not (np.isfinite(factor) and factor > 0):
            raise InputError(
                f"vertical exaggeration {factor} came; give a number above 0 (1 is true proportions)"
            )
        stretch = np.array([1.0, 1.0, factor])
        layers = tuple(
            replace(layer, items=tuple(_stretched(item, stretch) for item in layer.items))
            for layer in self.layers
        )
        views = tuple(
            replace(v, position_m=v.position_m * stretch, focus_m=v.focus_m * stretch) for v in self.views
        )
        return replace(
            self, layers=layers, views=views, vertical_exaggeration=self.vertical_exaggeration * factor
        )


def _stretched(item: Item, stretch: FloatArray) -> Item:
    if isinstance(item, Mesh):
        return replace(item, vertices_m=item.vertices_m * stretch)
    if isinstance(item, Label):
        return replace(item, at_m=item.at_m * stretch)
    return replace(item, points_m=item.points_m * stretch)
