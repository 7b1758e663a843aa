"""Layers of what stands on a site, out of plain arrays: ground, masts, turbines, wakes, directions.

All positions are local metres east, north, up in the frame of the scene; azimuths clockwise from true north.
"""

from collections.abc import Sequence

import numpy as np

from geometry.arrays import ArrayLike, FloatArray
from planner import palette
from planner.scene import ground, structures
from planner.scene.model import Item, Label, Layer, Lines
from planner.scene.solids import segments_between

LIFT_SHARE = 1 / 120  # of a sector's radius: browsers have few bits of depth, and it must not sink


def ground_layers(
    layers: Sequence[Layer], *, height_m: float, mark_height_m: float | None = None
) -> tuple[Layer, Layer, Layer]:
    """Lay the ground and its grid under layers, and north arrow and scale bar where they leave most room.

    Parameters
    ----------
    layers
        Everything that stands on the ground.
    height_m
        Height of the ground [m].
    mark_height_m
        Height at which arrow and bar lie, where a terrain would hide them on the plane [m].

    Examples
    --------
    >>> post = mast_layer(["a", "b"], [[0, 0, 0], [1000, 800, 0]], 100.0)
    >>> [layer.name for layer in ground_layers([post], height_m=0.0)]
    ['ground', 'grid 200 m', 'north and scale']
    """
    places = _samples_m(layers)
    low, high = places.min(axis=0), places.max(axis=0)
    plane = ground.ground_plane(np.stack([low, high]), height_m=height_m)
    top = height_m + 1.0 if mark_height_m is None else mark_height_m
    size_m = max(float(np.max(high - low)), 10.0)
    bar_m = ground.round_length_m(size_m / 4)
    east, north = _emptiest_place(low, high, places)
    bar = ground.scale_bar([east - bar_m / 2, north - 0.12 * size_m / 2, top], bar_m)
    arrow = ground.north_arrow([east, north + 0.08 * size_m / 2, top], 0.1 * size_m)
    marks: tuple[Item, ...] = (bar.surface, bar.lines, *bar.labels, arrow.surface, arrow.lines, *arrow.labels)
    return (
        Layer("ground", palette.GROUND, (plane.surface,), in_legend=False),
        Layer(f"grid {plane.spacing_m:g} m", palette.GRID, (plane.grid,)),
        Layer("north and scale", palette.INK, marks, in_legend=False),
    )


def _samples_m(layers: Sequence[Layer]) -> FloatArray:
    """(n, 2) east and north of points all along the lines, and of the dots [m]."""
    step = np.linspace(0.0, 1.0, 12)[:, None, None]
    samples = [points.points_m[:, :2] for layer in layers for points in layer.points]
    for line in (line for layer in layers for line in layer.lines):
        ends = line.points_m[line.segments][..., :2]
        samples.append((ends[:, 0] + step * (ends[:, 1] - ends[:, 0])).reshape(-1, 2))
    return np.concatenate(samples)


def _emptiest_place(low: FloatArray, high: FloatArray, places_m: FloatArray) -> FloatArray:
    """Of 49 places within the extent, the one farthest from everything (2,) [m]."""
    share = np.linspace(0.08, 0.92, 7)
    options = low + np.stack(np.meshgrid(share, share), axis=-1).reshape(-1, 2) * (high - low)
    nearest = [float(np.min(np.hypot(*(places_m - option).T))) for option in options]
    return np.asarray(options[int(np.argmax(nearest))], dtype=np.float64)


def terrain_layer(east_m: ArrayLike, north_m: ArrayLike, height_m: ArrayLike) -> Layer:
    """Lay a terrain of (row, column) heights over increasing east and north [m].

    Examples
    --------
    >>> terrain_layer([0, 10], [0, 10], np.zeros((2, 2))).name
    'terrain'
    """
    return Layer("terrain", palette.TERRAIN, (ground.terrain(east_m, north_m, height_m),))


def mast_layer(
    names: Sequence[str], base_m: ArrayLike, height_m: ArrayLike, width_m: ArrayLike = 1.0
) -> Layer:
    """Draw lattice masts on their bases (mast, 3), each with its name at the top [m].

    Examples
    --------
    >>> [label.at_m.round(1).tolist() for label in mast_layer(["m"], [[0, 0, 5]], [100.0]).labels]
    [[0.0, 0.0, 65.0]]
    """
    bases = np.atleast_2d(np.asarray(base_m, dtype=np.float64))
    heights, widths = (
        np.broadcast_to(np.asarray(v, dtype=np.float64), len(names)) for v in (height_m, width_m)
    )
    items: list[Item] = []
    for name, base, height, width in zip(names, bases, heights, widths, strict=True):
        items.append(structures.mast(base, height_m=height, width_m=width, hover=f"{name}, {height:g} m"))
        items.append(segments_between(base[None, :], base[None, :] + [0.0, 0.0, height], width_px=2.5))
        items.append(
            Label(name, base + np.array([0.0, 0.0, 0.6 * height]), rank=0)
        )  # the top is where beams meet
    return Layer("masts", palette.MAST, tuple(items))


def turbine_layer(
    names: Sequence[str],
    base_m: ArrayLike,
    hub_height_m: ArrayLike,
    rotor_diameter_m: ArrayLike,
    tower_diameter_m: ArrayLike = 4.0,
    *,
    wind_from_deg: float,
) -> Layer:
    """Draw turbines on their bases (turbine, 3), rotors facing the wind, names at the hubs [m, deg].

    Examples
    --------
    >>> layer = turbine_layer(["5"], [[0, 185, 5]], [99.5], [113.0], wind_from_deg=0.0)
    >>> [label.text for label in layer.labels], len(layer.meshes)
    (['5'], 2)
    """
    count = len(names)
    bases = np.atleast_2d(np.asarray(base_m, dtype=np.float64))
    sizes = [
        np.broadcast_to(np.asarray(v, dtype=np.float64), count)
        for v in (hub_height_m, rotor_diameter_m, tower_diameter_m)
    ]
    items: list[Item] = []
    for name, base, hub, rotor, tower in zip(names, bases, *sizes, strict=True):
        parts = structures.turbine(
            base,
            hub_height_m=hub,
            rotor_diameter_m=rotor,
            tower_diameter_m=tower,
            wind_from_deg=wind_from_deg,
            hover=f"{name}: hub {hub:g} m, rotor {rotor:g} m",
        )
        items += [parts.solid, parts.disc, parts.rim, Label(name, parts.hub_m, rank=1)]
    return Layer("turbines", palette.TURBINE, tuple(items))


def wake_layer(
    names: Sequence[str],
    hub_m: ArrayLike,
    rotor_diameter_m: ArrayLike,
    *,
    wind_from_deg: float,
    decay: float,
    length_m: float,
    ground_m: float,
) -> Layer:
    """Draw the wake cones of rotors (turbine, 3) for one wind direction, cut at the ground [m, deg].

    Examples
    --------
    >>> wake_layer(["5"], [[0, 0, 99.5]], [113.0], wind_from_deg=300, decay=0.075, length_m=600,
    ...            ground_m=0).name
    'wakes, wind from 300°'
    """
    items: list[Item] = []
    hubs = np.atleast_2d(np.asarray(hub_m, dtype=np.float64))
    for name, hub, rotor in zip(names, hubs, np.broadcast_to(rotor_diameter_m, len(names)), strict=True):
        items += structures.wake(
            hub,
            rotor_diameter_m=float(rotor),
            wind_from_deg=wind_from_deg,
            decay=decay,
            length_m=length_m,
            ground_m=ground_m,
            hover=f"wake of {name}, wind from {wind_from_deg:g}°",
        )
    return Layer(f"wakes, wind from {wind_from_deg:g}°", palette.WAKE, tuple(_fainter(items)), opacity=0.25)


def _fainter(items: list[Item]) -> list[Item]:
    return [
        Lines(i.points_m, i.segments, width_px=i.width_px, opacity=0.7) if isinstance(i, Lines) else i
        for i in items
    ]


def direction_layer(
    name: str,
    colour: str,
    centre_m: ArrayLike,
    radius_m: float,
    sectors_deg: Sequence[tuple[float, float]],
    *,
    inner_m: float = 0.0,
    opacity: float = 0.5,
    about: str = "",
) -> Layer:
    """Lay sectors (from, width) of wind directions about a target on the ground [m, deg].

    Examples
    --------
    >>> layer = direction_layer("excluded", "#b5474d", [0, 0, 5], 300.0, [(275.0, 193.0)])
    >>> [label.text for label in layer.labels]
    ['excluded 275-108°']
    """
    items: list[Item] = []
    for start, width in sectors_deg:
        mark = ground.direction_sector(
            centre_m, radius_m, start, width, inner_m=inner_m, lift_m=max(1.0, LIFT_SHARE * radius_m)
        )
        items += [mark.surface, mark.lines]
        items += [Label(f"{name} {label.text}", label.at_m, rank=label.rank) for label in mark.labels]
    return Layer(name, colour, tuple(items), opacity=opacity, about=about)
