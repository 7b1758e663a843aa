"""Cameras: an overview from the side where things stand farthest apart, and a close-up of the target.

The pinhole projection is the one that VTK and WebGL use, so that names can be placed before anything is
drawn.
"""

import numpy as np

from geometry.arrays import ArrayLike, FloatArray
from planner.scene.model import Lines, Mesh, Points, Scene, View, positions_m
from planner.scene.solids import azimuth_direction

OVERVIEW_ELEVATION_DEG = 30.0  # low enough to see heights, high enough to see the plan
CLOSE_UP_ELEVATION_DEG = 16.0
NEAREST_M = 1.0  # no point is nearer to the camera


def camera_axes(view: View) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Give the camera's unit vectors to its right, up and forward, each (3,).

    Examples
    --------
    >>> right, up, forward = camera_axes(View("from the south", [0, -10, 0], [0, 0, 0]))
    >>> right.round(3) + 0.0
    array([1., 0., 0.])
    """
    forward = view.focus_m - view.position_m
    forward = forward / np.linalg.norm(forward)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right = right / np.linalg.norm(right)
    return right, np.cross(right, forward), forward


def project_px(view: View, points_m: ArrayLike, width_px: float, height_px: float) -> FloatArray:
    """Give where points (n, 3) appear: (n, 3) pixels from the left and bottom, and depth [m].

    Points behind the camera have NaN pixels.

    Examples
    --------
    >>> project_px(View("v", [0, -10, 0], [0, 0, 0], 90.0), [[0, 0, 0], [0, 0, 10]], 200, 100).round(3)
    array([[100.,  50.,  10.],
           [100., 100.,  10.]])
    """
    right, up, forward = camera_axes(view)
    offset = np.asarray(points_m, dtype=np.float64) - view.position_m
    depth = offset @ forward
    focal_px = height_px / 2 / np.tan(np.radians(view.view_angle_deg) / 2)
    safe = np.where(depth > 0, depth, np.nan)
    across = width_px / 2 + focal_px * (offset @ right) / safe
    return np.stack([across, height_px / 2 + focal_px * (offset @ up) / safe, depth], axis=1)


def view_from(
    name: str,
    points_m: ArrayLike,
    azimuth_deg: float,
    elevation_deg: float,
    *,
    aspect: float = 1.6,
    view_angle_deg: float = 30.0,
    margin: float = 0.06,
) -> View:
    """Stand on an azimuth and elevation from points (n, 3), as near as all of them are in the picture.

    Parameters
    ----------
    name
        Name of the view.
    points_m
        (n, 3) What has to be seen [m].
    azimuth_deg, elevation_deg
        Where the camera stands, seen from the points [deg].
    aspect
        Width of the picture over its height [1].
    view_angle_deg
        Vertical field of view [deg].
    margin
        Share of the picture left free on each side [1].

    Examples
    --------
    >>> view = view_from("south", [[-1, 0, 0], [1, 0, 0], [0, 0, 1]], 180.0, 10.0, aspect=1.0, margin=0.0)
    >>> project_px(view, [[-1, 0, 0], [1, 0, 0]], 100, 100)[:, 0].round(2) + 0.0
    array([  0., 100.])
    """
    points = np.asarray(points_m, dtype=np.float64)
    elevation = np.radians(elevation_deg)
    toward = np.cos(elevation) * azimuth_direction(azimuth_deg) + np.array([0.0, 0.0, np.sin(elevation)])
    middle = (points.min(axis=0) + points.max(axis=0)) / 2
    right, up, forward = camera_axes(View(name, middle + toward, middle, view_angle_deg))
    offset = points - middle
    tangent = np.tan(np.radians(view_angle_deg) / 2) * (1 - 2 * margin)
    x, y, z = offset @ right, offset @ up, offset @ forward
    # |x - cx| <= (distance + z) tangent·aspect for all points: the two outermost edges fix the shift and the
    # distance
    shift_x, distance_x = _frame(x, z, tangent * aspect)
    shift_y, distance_y = _frame(y, z, tangent)
    focus = middle + shift_x * right + shift_y * up
    distance = max(distance_x, distance_y, NEAREST_M - float(z.min()))  # a line seen end-on has no width
    return View(name, focus + distance * toward, focus, view_angle_deg)


def _frame(across_m: FloatArray, along_m: FloatArray, tangent: float) -> tuple[float, float]:
    """Shift c and distance d of a camera that sees x edge to edge: |x - c| <= (d + z) t."""
    high = float((across_m - tangent * along_m).max())  # <= c + d t
    low = float((across_m + tangent * along_m).min())  # >= c - d t
    return (high + low) / 2, (high - low) / (2 * tangent)


def overview(
    points_m: ArrayLike,
    named_m: ArrayLike,
    *,
    elevation_deg: float = OVERVIEW_ELEVATION_DEG,
    aspect: float = 1.2,
    facing_deg: float | None = None,
    name: str = "overview",
) -> View:
    """See everything, from the one of 24 sides where the named places stand farthest apart on the screen.

    Each side is judged by the mean logarithm of the distances between all pairs of named places: two that
    fall on one another cost much, and far ones win little. Rotors should not be seen edge-on: a side gets the
    logarithm of how open they look besides.

    Parameters
    ----------
    points_m
        (n, 3) What has to be seen [m].
    named_m
        (m, 3) Lidars, targets, masts, turbines [m].
    elevation_deg
        Height of the camera above the horizontal [deg].
    aspect
        Width of the picture over its height [1].
    facing_deg
        Azimuth toward which rotors face: the drawn wind direction [deg]; None where there are none.
    name
        Name of the view.

    Examples
    --------
    >>> row = [[0, 0, 0], [500, 0, 0], [1000, 0, 0]]
    >>> view = overview(row, row)
    >>> view.name, bool(abs(np.cos(np.radians(azimuth_of_deg(view)))) > 0.5)  # not along the row
    ('overview', True)
    """
    named = np.asarray(named_m, dtype=np.float64)
    sides = [view_from(name, points_m, a, elevation_deg, aspect=aspect) for a in np.arange(0.0, 360.0, 15.0)]
    return max(sides, key=lambda view: _spread(view, named, aspect) + _openness(view, facing_deg))


def _spread(view: View, named_m: FloatArray, aspect: float) -> float:
    screen = project_px(view, named_m, aspect, 1.0)[:, :2]
    first, second = np.triu_indices(len(screen), k=1)
    if not len(first):
        return 0.0
    apart = np.linalg.norm(screen[first] - screen[second], axis=1)
    return float(np.log(apart + 0.01).mean())


def _openness(view: View, facing_deg: float | None) -> float:
    if facing_deg is None:
        return 0.0
    share = abs(np.cos(np.radians(azimuth_of_deg(view) - facing_deg)))
    return 0.5 * float(np.log(share + 0.05))


def close_up(
    target_m: ArrayLike,
    radius_m: float,
    azimuth_deg: float,
    *,
    aspect: float = 1.0,
    name: str = "at the target",
    without: tuple[str, ...] = (),
) -> View:
    """See the surroundings of a target within a radius from an azimuth [m, deg], without some layers.

    Examples
    --------
    >>> view = close_up([0, 0, 120], 100.0, 180.0)
    >>> float(view.focus_m[2])
    120.0
    """
    target = np.asarray(target_m, dtype=np.float64)
    view = view_from(
        name,
        target + radius_m * np.concatenate([np.eye(3), -np.eye(3)]),
        azimuth_deg,
        CLOSE_UP_ELEVATION_DEG,
        aspect=aspect,
        margin=0.02,
    )
    return View(name, view.position_m + (target - view.focus_m), target, view.view_angle_deg, without)


def azimuth_of_deg(view: View) -> float:
    """Give the azimuth on which the camera stands, seen from what it looks at [deg].

    Examples
    --------
    >>> azimuth_of_deg(View("v", [10, 0, 5], [0, 0, 0]))
    90.0
    """
    east, north = (view.position_m - view.focus_m)[:2]
    return float(np.degrees(np.arctan2(east, north)) % 360.0)


def default_view(scene: Scene) -> View:
    """Choose the overview of a scene that has no view of its own.

    Examples
    --------
    >>> from planner.scene.model import Layer, Points
    >>> default_view(Scene("two", (Layer("dots", "#000000", (Points([[0, 0, 0], [9, 0, 0]]),)),))).name
    'overview'
    """
    named = [label.at_m for _, label in scene.names]
    low, high = scene.extent_m
    corners = np.stack(np.meshgrid(*np.stack([low, high], axis=1)), axis=-1).reshape(-1, 3)
    return overview(corners, np.stack(named) if named else corners)


def drawn_px(
    scene: Scene, view: View, width_px: float, height_px: float, *, cell_px: float = 6.0
) -> FloatArray:
    """Give samples (n, 2) of what names had better not cover: strong lines, dots, solid bodies [px].

    Examples
    --------
    >>> from planner.scene.model import Layer, Lines
    >>> post = Scene("post", (Layer("post", "#000000", (Lines([[0, 0, 0], [0, 0, 9]], [[0, 1]]),)),))
    >>> drawn_px(post, View("v", [0, -10, 0], [0, 0, 0], 90.0), 60, 60)
    array([[30., 30.],
           [30., 36.],
           [30., 42.],
           [30., 48.],
           [30., 54.],
           [30., 60.]])
    """
    samples = [np.zeros((0, 3))]
    for layer, item in scene.items():
        if isinstance(item, Lines) and item.width_px > 1.2:
            ends = item.points_m[item.segments]
            step = np.linspace(0.0, 1.0, 96 if len(ends) < 50 else 2)[:, None, None]
            samples.append((ends[:, 0] + step * (ends[:, 1] - ends[:, 0])).reshape(-1, 3))
        elif isinstance(item, Points) or (
            isinstance(item, Mesh) and item.shaded and layer.opacity * item.opacity > 0.9
        ):
            samples.append(positions_m(item))
    spots = project_px(view, np.concatenate(samples), width_px, height_px)[:, :2]
    seen = np.all(
        (spots > 0) & (spots < np.array([width_px, height_px])), axis=1
    )  # false for NaN: behind the camera
    return np.asarray(np.unique((spots[seen] / cell_px).round(), axis=0) * cell_px, dtype=np.float64)
