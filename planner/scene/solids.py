"""Building blocks of shapes: polylines, arcs, frusta, discs, boxes, ellipsoids, surfaces between curves.

All take and give local metres east, north, up. A closed solid has its normals outside.
"""

import numpy as np

from geometry.arrays import ArrayLike, FloatArray, IntArray
from geometry.errors import InputError
from planner.scene.model import Lines, Mesh


def azimuth_direction(azimuth_deg: ArrayLike) -> FloatArray:
    """Give horizontal unit vectors (..., 3) toward azimuths clockwise from north [deg].

    Examples
    --------
    >>> azimuth_direction(90.0).round(3) + 0.0
    array([1., 0., 0.])
    """
    azimuth = np.radians(np.asarray(azimuth_deg, dtype=np.float64))
    return np.stack([np.sin(azimuth), np.cos(azimuth), np.zeros_like(azimuth)], axis=-1)


def polyline(
    points_m: ArrayLike, *, closed: bool = False, width_px: float = 2.0, opacity: float = 1.0
) -> Lines:
    """Join points (n, 3) [m] one after the other, and the last to the first where `closed`.

    Examples
    --------
    >>> polyline([[0, 0, 0], [3, 0, 0], [3, 4, 0]], closed=True).length_m
    12.0
    """
    points = np.asarray(points_m, dtype=np.float64)
    index = np.arange(len(points))
    segments = np.stack([index, np.roll(index, -1)], axis=1)
    return Lines(points, segments if closed else segments[:-1], width_px=width_px, opacity=opacity)


def segments_between(
    from_m: ArrayLike, to_m: ArrayLike, *, width_px: float = 2.0, opacity: float = 1.0, hover: str = ""
) -> Lines:
    """Draw one segment from each of (n, 3) points to its partner [m]; a single point serves all.

    Examples
    --------
    >>> segments_between([[0, 0, 0]], [[1, 0, 0], [0, 2, 0]]).length_m
    3.0
    """
    start, end = np.broadcast_arrays(np.atleast_2d(from_m), np.atleast_2d(to_m))
    count = len(start)
    segments = np.stack([np.arange(count), np.arange(count) + count], axis=1)
    points = np.concatenate([start, end])
    return Lines(points, segments, width_px=width_px, opacity=opacity, hover=hover)


def arc_m(centre_m: ArrayLike, radius_m: float, from_deg: float, width_deg: float) -> FloatArray:
    """Give points (n, 3) of a level arc, clockwise from an azimuth over a width [deg], every 2° or finer [m].

    Examples
    --------
    >>> arc_m([0, 0, 5], 10.0, 0.0, 90.0)[[0, -1]].round(3) + 0.0
    array([[ 0., 10.,  5.],
           [10.,  0.,  5.]])
    """
    count = max(2, int(np.ceil(abs(width_deg) / 2)) + 1)
    azimuth_deg = from_deg + np.linspace(0.0, width_deg, count)
    return np.asarray(centre_m, dtype=np.float64) + radius_m * azimuth_direction(azimuth_deg)


def surface_between(
    first_m: ArrayLike, second_m: ArrayLike, *, opacity: float = 1.0, hover: str = ""
) -> Mesh:
    """Span a surface between two curves of as many points, (n, 3) each [m].

    Raises
    ------
    InputError
        If the curves differ in their number of points.

    Examples
    --------
    >>> surface_between([[0, 0, 0], [2, 0, 0]], [[0, 3, 0], [2, 3, 0]]).area_m2
    6.0
    """
    first, second = np.asarray(first_m, dtype=np.float64), np.asarray(second_m, dtype=np.float64)
    if first.shape != second.shape:
        raise InputError(
            f"curves of {len(first)} and {len(second)} points came; a surface needs as many on each"
        )
    return Mesh(np.concatenate([first, second]), _ladder(len(first)), opacity=opacity, hover=hover)


def _ladder(count: int) -> IntArray:
    low = np.arange(count - 1)
    high = low + count
    return np.concatenate(
        [np.stack([low, low + 1, high], axis=1), np.stack([low + 1, high + 1, high], axis=1)]
    )


def fan(apex_m: ArrayLike, rim_m: ArrayLike, *, opacity: float = 1.0, hover: str = "") -> Mesh:
    """Span triangles from an apex (3,) to a rim (n, 3) [m].

    Examples
    --------
    >>> fan([0, 0, 0], [[4, 0, 0], [0, 3, 0]]).area_m2
    6.0
    """
    rim = np.asarray(rim_m, dtype=np.float64)
    vertices = np.concatenate([np.reshape(np.asarray(apex_m, dtype=np.float64), (1, 3)), rim])
    index = np.arange(1, len(rim))
    triangles = np.stack([np.zeros_like(index), index, index + 1], axis=1)
    return Mesh(vertices, triangles, opacity=opacity, hover=hover)


def frame_of(axis: ArrayLike) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Give the unit axis and two unit vectors across it, a right-handed set (first, second, axis).

    Examples
    --------
    >>> along, first, second = frame_of([0, 0, 2])
    >>> np.cross(first, second).round(3) + 0.0
    array([0., 0., 1.])
    """
    along = np.asarray(axis, dtype=np.float64)
    along = along / np.linalg.norm(along)
    helper = np.array([0.0, 0.0, 1.0]) if abs(along[2]) < 0.9 else np.array([0.0, 1.0, 0.0])
    first = np.cross(helper, along)
    first = first / np.linalg.norm(first)
    return along, first, np.cross(along, first)


def ring_m(centre_m: ArrayLike, axis: ArrayLike, radius_m: float, sides: int) -> FloatArray:
    """Give points (sides, 3) of a circle about an axis, counter-clockwise seen from the axis' tip [m].

    Examples
    --------
    >>> ring_m([0, 0, 0], [0, 0, 1], 2.0, 4).sum(axis=0).round(3) + 0.0
    array([0., 0., 0.])
    """
    _, first, second = frame_of(axis)
    angle = 2 * np.pi * np.arange(sides) / sides
    offset = np.cos(angle)[:, None] * first + np.sin(angle)[:, None] * second
    return np.asarray(centre_m, dtype=np.float64) + radius_m * offset


def frustum(
    start_m: ArrayLike,
    end_m: ArrayLike,
    start_radius_m: float,
    end_radius_m: float,
    *,
    sides: int = 24,
    opacity: float = 1.0,
) -> Mesh:
    """Make a closed cone frustum from one centre to the other (3,) [m].

    Raises
    ------
    InputError
        If both centres are one point.

    Examples
    --------
    >>> box_m2 = frustum([0, 0, 0], [0, 0, 2], 1.0, 1.0, sides=4).area_m2  # a prism of side sqrt(2)
    >>> round(box_m2, 6) == round(4 * 2 * 2**0.5 + 2 * 2, 6)
    True
    """
    start, end = np.asarray(start_m, dtype=np.float64), np.asarray(end_m, dtype=np.float64)
    if not np.linalg.norm(end - start) > 0:
        raise InputError("a frustum of no length came; give two different centres")
    rims = [ring_m(start, end - start, start_radius_m, sides), ring_m(end, end - start, end_radius_m, sides)]
    vertices = np.concatenate([*rims, start[None, :], end[None, :]])
    low = np.arange(sides)
    following = np.roll(low, -1)
    triangles = np.concatenate(
        [
            np.stack([low, following, following + sides], axis=1),
            np.stack([low, following + sides, low + sides], axis=1),
            np.stack([following, low, np.full(sides, 2 * sides)], axis=1),
            np.stack([low + sides, following + sides, np.full(sides, 2 * sides + 1)], axis=1),
        ]
    )
    return Mesh(vertices, triangles, opacity=opacity)


def disc(
    centre_m: ArrayLike, axis: ArrayLike, radius_m: float, *, sides: int = 72, opacity: float = 1.0
) -> Mesh:
    """Make a flat disc whose normal is the axis [m].

    Examples
    --------
    >>> round(disc([0, 0, 0], [0, 1, 0], 1.0, sides=720).area_m2, 3)
    3.142
    """
    rim = ring_m(centre_m, axis, radius_m, sides)
    return fan(centre_m, np.concatenate([rim, rim[:1]]), opacity=opacity)


def box(centre_m: ArrayLike, size_m: ArrayLike, *, azimuth_deg: float = 0.0) -> Mesh:
    """Make a box of size (across, along, high) [m], its length along an azimuth [deg].

    Examples
    --------
    >>> box([0, 0, 0], [1, 2, 3], azimuth_deg=30.0).area_m2
    22.0
    """
    along = azimuth_direction(azimuth_deg)
    axes = np.stack([np.array([along[1], -along[0], 0.0]), along, np.array([0.0, 0.0, 1.0])])
    signs = np.array(
        [[x, y, z] for z in (-1, 1) for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))], dtype=np.float64
    )
    vertices = (
        np.asarray(centre_m, dtype=np.float64) + (signs * np.asarray(size_m, dtype=np.float64) / 2) @ axes
    )
    quads = np.array([[3, 2, 1, 0], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]])
    return Mesh(vertices, np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]))


def ellipsoid(centre_m: ArrayLike, semi_axes_m: ArrayLike, *, sides: int = 24, opacity: float = 1.0) -> Mesh:
    """Make an ellipsoid whose semi-axes are the rows of (3, 3) [m].

    Examples
    --------
    >>> ball = ellipsoid([0, 0, 0], np.eye(3) * 2.0)
    >>> np.linalg.norm(ball.vertices_m, axis=1).max().round(6) == 2.0
    np.True_
    """
    polar = np.linspace(0.0, np.pi, sides // 2 + 1)
    around = np.linspace(0.0, 2 * np.pi, sides + 1)
    p, a = np.meshgrid(polar, around, indexing="ij")
    unit = np.stack([np.sin(p) * np.cos(a), np.sin(p) * np.sin(a), np.cos(p)], axis=-1).reshape(-1, 3)
    vertices = np.asarray(centre_m, dtype=np.float64) + unit @ np.asarray(semi_axes_m, dtype=np.float64)
    return Mesh(vertices, lattice_triangles(sides // 2 + 1, sides + 1), opacity=opacity)


def lattice_triangles(rows: int, columns: int) -> IntArray:
    """Give triangles (m, 3) that join a lattice of rows × columns points stored row by row.

    Examples
    --------
    >>> lattice_triangles(2, 2)
    array([[0, 2, 1],
           [1, 2, 3]])
    """
    corner = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).ravel()
    below = corner + columns
    return np.concatenate(
        [np.stack([corner, below, corner + 1], axis=1), np.stack([corner + 1, below, below + 1], axis=1)]
    )


def joined(meshes: tuple[Mesh, ...] | list[Mesh], *, hover: str = "") -> Mesh:
    """Put several meshes of one opacity into one.

    Raises
    ------
    InputError
        If their opacities differ or there is none.

    Examples
    --------
    >>> joined([box([0, 0, 0], [1, 1, 1]), box([5, 0, 0], [1, 1, 1])]).area_m2
    12.0
    """
    opacities = {mesh.opacity for mesh in meshes}
    if len(opacities) != 1:
        raise InputError(f"meshes with opacities {sorted(opacities)} came; join those of one opacity")
    starts = np.cumsum([0, *(len(mesh.vertices_m) for mesh in meshes)])[:-1]
    triangles = [mesh.triangles + start for mesh, start in zip(meshes, starts, strict=True)]
    return Mesh(
        np.concatenate([mesh.vertices_m for mesh in meshes]),
        np.concatenate(triangles),
        opacity=opacities.pop(),
        hover=hover,
    )
