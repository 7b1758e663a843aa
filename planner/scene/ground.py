"""The ground under a scene: plane with a grid, terrain, north arrow, scale bar and sectors, in local metres.

What lies on the ground is lifted a little above it, so that it does not flicker through: the argument says
how much.
"""

from typing import NamedTuple

import numpy as np

from geometry.arrays import ArrayLike, FloatArray
from geometry.errors import InputError
from planner.scene.model import Label, Lines, Mesh
from planner.scene.solids import arc_m, azimuth_direction, fan, lattice_triangles, polyline, segments_between

QUAD = np.array([[0, 1, 2], [0, 2, 3]])  # two triangles of four corners


def round_length_m(length_m: float) -> float:
    """Give the largest of 1, 2, 5 times a power of ten that is not above a length [m].

    Examples
    --------
    >>> round_length_m(730.0), round_length_m(0.21)
    (500.0, 0.2)
    """
    if not length_m > 0:
        raise InputError(f"a length of {length_m} m came; give one above 0")
    power = 10.0 ** np.floor(np.log10(length_m))
    return float(max(step for step in (1.0, 2.0, 5.0) if step * power <= length_m * (1 + 1e-12)) * power)


class Ground(NamedTuple):
    """A plane and the lines on it."""

    surface: Mesh
    grid: Lines
    spacing_m: float  # of the grid lines


def ground_plane(
    extent_m: ArrayLike, *, height_m: float, margin: float = 0.12, lift_m: float = 0.3
) -> Ground:
    """Lay a level ground under an extent, with grid lines at round distances from the scene's origin.

    Parameters
    ----------
    extent_m
        (2, 2 or 3) lowest and highest east, north (up is not used) [m].
    height_m
        Height of the ground [m].
    margin
        Share of the longer side that is added all round [1].
    lift_m
        Height of the lines above the surface [m].

    Examples
    --------
    >>> ground_plane([[0, 0], [1000, 1000]], height_m=0.0).spacing_m
    200.0
    """
    low, high = np.asarray(extent_m, dtype=np.float64)[:, :2]
    spacing = round_length_m(float(max((high - low).max(), 10.0)) / 4)
    border = margin * max((high - low).max(), 10.0)
    low, high = np.floor((low - border) / spacing) * spacing, np.ceil((high + border) / spacing) * spacing
    corners = np.array([[low[0], low[1]], [high[0], low[1]], [high[0], high[1]], [low[0], high[1]]])
    surface = Mesh(_at_height(corners, height_m), QUAD, shaded=False)
    east, north = (np.arange(low[i], high[i] + spacing / 2, spacing) for i in (0, 1))
    start = [*((e, low[1]) for e in east), *((low[0], n) for n in north)]
    end = [*((e, high[1]) for e in east), *((high[0], n) for n in north)]
    top = height_m + lift_m
    grid = segments_between(_at_height(np.array(start), top), _at_height(np.array(end), top), width_px=1.0)
    return Ground(surface, grid, spacing)


def _at_height(east_north_m: FloatArray, height_m: float) -> FloatArray:
    return np.concatenate([east_north_m, np.full((len(east_north_m), 1), height_m)], axis=1)


def terrain(east_m: ArrayLike, north_m: ArrayLike, height_m: ArrayLike) -> Mesh:
    """Make a surface from a grid of heights; cells with a missing height stay open.

    Parameters
    ----------
    east_m, north_m
        (column,) and (row,) increasing coordinates of the grid [m].
    height_m
        (row, column) heights, NaN where unknown [m].

    Raises
    ------
    InputError
        If the shapes do not fit, the coordinates do not increase, or every height is missing.

    Examples
    --------
    >>> terrain([0, 10], [0, 20], [[1, 1], [1, 1]]).area_m2
    200.0
    """
    east, north = np.asarray(east_m, dtype=np.float64), np.asarray(north_m, dtype=np.float64)
    height = np.asarray(height_m, dtype=np.float64)
    if height.shape != (north.size, east.size) or min(height.shape) < 2:
        raise InputError(
            f"heights of shape {height.shape} came for {north.size} rows and {east.size} columns; 2 or more"
        )
    if not (np.all(np.diff(east) > 0) and np.all(np.diff(north) > 0)):
        raise InputError(
            "terrain coordinates must increase: east with the column, north with the row; turn the grid round"
        )
    e, n = np.meshgrid(east, north)
    vertices = np.stack([e, n, height], axis=-1).reshape(-1, 3)
    triangles = lattice_triangles(north.size, east.size)[
        :, ::-1
    ]  # rows run north: turned, the normals point up
    known = np.asarray(np.isfinite(vertices).all(axis=1), dtype=np.bool_)
    triangles = triangles[known[triangles].all(axis=1)]
    if not len(triangles):
        raise InputError(
            "terrain: no cell has all four heights; check the file's missing value and its extent"
        )
    vertices[~known, 2] = float(np.nanmin(height))  # not used by any triangle
    return Mesh(vertices, triangles)


class Mark(NamedTuple):
    """A surface with its lines and its text."""

    surface: Mesh
    lines: Lines
    labels: tuple[Label, ...]


def north_arrow(at_m: ArrayLike, length_m: float) -> Mark:
    """Lay an arrow toward true north on the ground, its middle at a point (3,) [m].

    Examples
    --------
    >>> arrow = north_arrow([0, 0, 0], 100.0)
    >>> float(arrow.surface.vertices_m[:, 1].max()), arrow.labels[0].text
    (50.0, 'N')
    """
    outline = length_m * np.array([[0.0, 0.5, 0], [0.22, -0.5, 0], [0.0, -0.3, 0], [-0.22, -0.5, 0]])
    points = np.asarray(at_m, dtype=np.float64) + outline
    lines = polyline(points, closed=True, width_px=1.5)
    return Mark(Mesh(points, np.array([[0, 2, 1], [0, 3, 2]])), lines, (Label("N", points[0], rank=0),))


def scale_bar(at_m: ArrayLike, length_m: float) -> Mark:
    """Lay a bar of two halves on the ground, eastward from a point (3,) [m].

    Examples
    --------
    >>> [label.text for label in scale_bar([0, 0, 0], 500.0).labels]
    ['500 m']
    """
    start = np.asarray(at_m, dtype=np.float64)
    thick = 0.03 * length_m
    box = np.array([[0.0, 0.0, 0], [0.5 * length_m, 0, 0], [0.5 * length_m, thick, 0], [0.0, thick, 0]])
    outline = np.array([[0.0, 0.0, 0], [length_m, 0, 0], [length_m, thick, 0], [0.0, thick, 0]])
    label = Label(f"{length_m:g} m", start + np.array([length_m / 2, 0.0, 0.0]), rank=0)
    lines = polyline(start + outline, closed=True, width_px=1.5)
    return Mark(Mesh(start + box, QUAD), lines, (label,))


def direction_sector(
    centre_m: ArrayLike,
    radius_m: float,
    from_deg: float,
    width_deg: float,
    *,
    inner_m: float = 0.0,
    lift_m: float = 1.0,
) -> Mark:
    """Lay a sector of wind directions on the ground: it opens toward where the wind comes from.

    Parameters
    ----------
    centre_m
        (3,) Point on the ground below the target [m].
    radius_m, inner_m
        Outer and inner radius [m].
    from_deg, width_deg
        Clockwise from an azimuth, over a width in (0, 360] [deg].
    lift_m
        Height above the centre's [m].

    Raises
    ------
    InputError
        If the width or the radii are out of range.

    Examples
    --------
    >>> wedge = direction_sector([0, 0, 0], 100.0, 350.0, 20.0, lift_m=0.0)
    >>> float(wedge.lines.points_m[:, 1].max())
    100.0
    """
    if not 0 < width_deg <= 360:
        raise InputError(f"a sector of {width_deg}° came; the width is above 0 and at most 360°")
    if not 0 <= inner_m < radius_m:
        raise InputError(
            f"radii {inner_m} and {radius_m} m came; the inner one is 0 or more and below the outer one"
        )
    centre = np.asarray(centre_m, dtype=np.float64) + np.array([0.0, 0.0, lift_m])
    outer = arc_m(centre, radius_m, from_deg, width_deg)
    inner = arc_m(centre, inner_m, from_deg, width_deg)
    if inner_m > 0:
        surface = Mesh(np.concatenate([outer, inner]), lattice_triangles(2, len(outer)))
    else:
        surface = fan(centre, outer[::-1])
    whole = width_deg >= 360
    outline = (
        outer if whole else np.concatenate([outer, inner[::-1]] if inner_m > 0 else [outer, centre[None, :]])
    )
    text = f"{round(from_deg) % 360:.0f}-{round(from_deg + width_deg) % 360:.0f}°"  # clockwise
    middle = centre + radius_m * azimuth_direction(from_deg + width_deg / 2)
    return Mark(surface, polyline(outline, closed=True, width_px=1.5), (Label(text, middle, rank=2),))
