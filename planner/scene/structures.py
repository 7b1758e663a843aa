"""Masts, turbines with their rotors, wakes and plain obstacles as shapes, in local metres east, north, up."""

from typing import NamedTuple

import numpy as np

from geometry.arrays import ArrayLike, FloatArray
from planner.scene.model import Lines, Mesh
from planner.scene.solids import (
    azimuth_direction,
    box,
    disc,
    frustum,
    joined,
    lattice_triangles,
    polyline,
    ring_m,
)

# Proportions of a drawn turbine, as shares of the rotor diameter: read off outline drawings of multi-megawatt
# machines, right to the eye and used for nothing but the picture. The rotor's diameter and the hub's height
# are the site's own.
OVERHANG = 0.04  # rotor centre in front of the tower axis
NACELLE = (0.036, 0.11, 0.038)  # across, along, high
HUB_RADIUS = 0.018
BLADE_CHORD = (
    (0.02, 0.018),
    (0.18, 0.036),
    (0.55, 0.022),
    (1.0, 0.006),
)  # (share of the radius, chord / diameter)
BLADE_THICKNESS = 0.22  # share of the chord
TOWER_TOP = 0.6  # top diameter / base diameter


class Turbine(NamedTuple):
    """The parts of a drawn turbine."""

    solid: Mesh  # tower, nacelle, hub, blades
    disc: Mesh  # the swept area, to be seen through
    rim: Lines  # its edge
    hub_m: FloatArray  # (3,) rotor centre


def turbine(
    base_m: ArrayLike,
    *,
    hub_height_m: float,
    rotor_diameter_m: float,
    tower_diameter_m: float = 4.0,
    wind_from_deg: float = 270.0,
    hover: str = "",
) -> Turbine:
    """Draw a three-bladed turbine whose rotor faces the wind.

    Parameters
    ----------
    base_m
        (3,) Foot of the tower [m].
    hub_height_m, rotor_diameter_m, tower_diameter_m
        Hub above the foot, rotor and tower foot [m].
    wind_from_deg
        Direction the wind comes from, clockwise from true north [deg]: the rotor stands on that side of the
        tower.
    hover
        Text under the pointer.

    Returns
    -------
    Turbine
        Solid, disc, rim, and the rotor's centre.

    Examples
    --------
    >>> t = turbine([0, 0, 0], hub_height_m=100, rotor_diameter_m=120, wind_from_deg=270)
    >>> t.hub_m.round(1) + 0.0
    array([ -4.8,   0. , 100. ])
    """
    upwind = azimuth_direction(wind_from_deg)
    base = np.asarray(base_m, dtype=np.float64)
    top = base + np.array([0.0, 0.0, hub_height_m])
    hub = top + OVERHANG * rotor_diameter_m * upwind
    nacelle_size = rotor_diameter_m * np.array(NACELLE)
    tower_top = top - np.array([0.0, 0.0, nacelle_size[2] / 2])
    hub_end = hub + 1.6 * HUB_RADIUS * rotor_diameter_m * upwind
    hub_start = hub - HUB_RADIUS * rotor_diameter_m * upwind
    nacelle_middle = hub_start - upwind * nacelle_size[1] / 2
    parts = [
        frustum(base, tower_top, tower_diameter_m / 2, TOWER_TOP * tower_diameter_m / 2),
        box(nacelle_middle, nacelle_size, azimuth_deg=wind_from_deg),
        frustum(hub_start, hub_end, HUB_RADIUS * rotor_diameter_m, 0.3 * HUB_RADIUS * rotor_diameter_m),
        *(_blade(hub, upwind, angle_deg, rotor_diameter_m) for angle_deg in (0.0, 120.0, 240.0)),
    ]
    swept = disc(hub, upwind, rotor_diameter_m / 2, opacity=0.25)
    rim = polyline(ring_m(hub, upwind, rotor_diameter_m / 2, 72), closed=True, width_px=1.5, opacity=0.8)
    return Turbine(joined(parts, hover=hover), swept, rim, hub)


def _blade(hub_m: FloatArray, upwind: FloatArray, angle_deg: float, diameter_m: float) -> Mesh:
    """Make one blade: diamonds of the chord along the radius, turned from straight up about the axis."""
    up = np.array([0.0, 0.0, 1.0])
    side = np.cross(up, upwind)
    angle = np.radians(angle_deg)
    radial = np.cos(angle) * up + np.sin(angle) * side
    across = -np.sin(angle) * up + np.cos(angle) * side
    rings = []
    for share, chord in BLADE_CHORD:
        half = chord * diameter_m / 2
        thick = BLADE_THICKNESS * half * upwind
        centre = hub_m + share * diameter_m / 2 * radial
        rings.append(
            np.stack([centre + half * across, centre + thick, centre - half * across, centre - thick])
        )
    vertices = np.concatenate([np.concatenate([ring, ring[:1]]) for ring in rings])
    return Mesh(vertices, lattice_triangles(len(BLADE_CHORD), 5))


def mast(base_m: ArrayLike, *, height_m: float, width_m: float = 1.0, hover: str = "") -> Lines:
    """Draw a triangular lattice mast: three legs, rings and diagonals.

    Parameters
    ----------
    base_m
        (3,) Foot [m].
    height_m, width_m
        Height above the foot and side of the triangle [m].
    hover
        Text under the pointer.

    Examples
    --------
    >>> float(mast([0, 0, 5], height_m=116.5).points_m[:, 2].max())
    121.5
    """
    base = np.asarray(base_m, dtype=np.float64)
    bays = max(2, int(height_m / (4 * width_m)))
    levels = np.linspace(0.0, height_m, bays + 1)
    corners = ring_m([0, 0, 0], [0, 0, 1], width_m / np.sqrt(3), 3)
    points = base + corners[None, :, :] + levels[:, None, None] * np.array([0.0, 0.0, 1.0])
    index = np.arange(3 * (bays + 1)).reshape(bays + 1, 3)
    following = np.roll(index, -1, axis=1)
    legs = np.stack([index[:-1], index[1:]], axis=-1)
    rings = np.stack([index, following], axis=-1)
    diagonals = np.stack([index[:-1], following[1:]], axis=-1)
    segments = np.concatenate([part.reshape(-1, 2) for part in (legs, rings, diagonals)])
    return Lines(points.reshape(-1, 3), segments, width_px=1.6, hover=hover)


class Wake(NamedTuple):
    """The parts of a drawn wake."""

    surface: Mesh  # the cone's mantle
    rings: Lines  # edge at the rotor, along the way and at the end


def wake(
    hub_m: ArrayLike,
    *,
    rotor_diameter_m: float,
    wind_from_deg: float,
    decay: float,
    length_m: float,
    ground_m: float = -np.inf,
    hover: str = "",
) -> Wake:
    """Draw the wake cone of Jensen (1983) downwind of a rotor: diameter D + 2 k x at the distance x.

    Parameters
    ----------
    hub_m
        (3,) Rotor centre [m].
    rotor_diameter_m, wind_from_deg, decay, length_m
        Rotor diameter D [m], direction the wind comes from [deg], decay constant k [1], drawn length [m].
    ground_m
        Height [m] under which the cone is cut flat: the ground.
    hover
        Text under the pointer.

    References
    ----------
    N. O. Jensen (1983), A note on wind generator interaction, Risø-M-2411.

    Examples
    --------
    >>> w = wake([0, 0, 100], rotor_diameter_m=100, wind_from_deg=270, decay=0.075, length_m=1000)
    >>> float(w.surface.vertices_m[:, 0].max()), round(float(w.surface.vertices_m[:, 1].max()), 3)
    (1000.0, 125.0)
    """
    downwind = -azimuth_direction(wind_from_deg)
    hub = np.asarray(hub_m, dtype=np.float64)
    stations = np.linspace(0.0, length_m, 6)
    sides = 72
    rims = [ring_m(hub + x * downwind, downwind, rotor_diameter_m / 2 + decay * x, sides) for x in stations]
    points = np.stack([np.concatenate([rim, rim[:1]]) for rim in rims])
    points[..., 2] = np.maximum(points[..., 2], ground_m)
    flat = points.reshape(-1, 3)
    surface = Mesh(flat, lattice_triangles(len(stations), sides + 1), hover=hover)
    index = np.arange(len(flat)).reshape(len(stations), sides + 1)
    around = np.stack([index[:, :-1], index[:, 1:]], axis=-1).reshape(-1, 2)
    along = np.stack([index[:-1, :: sides // 4], index[1:, :: sides // 4]], axis=-1).reshape(-1, 2)
    return Wake(surface, Lines(flat, np.concatenate([around, along]), width_px=1.0))


def obstacle(
    base_m: ArrayLike, *, width_m: float, length_m: float, height_m: float, azimuth_deg: float = 0.0
) -> Mesh:
    """Draw a box that stands on its base (3,), its length along an azimuth [m, deg].

    Examples
    --------
    >>> float(obstacle([0, 0, 2], width_m=3, length_m=4, height_m=160).vertices_m[:, 2].max())
    162.0
    """
    centre = np.asarray(base_m, dtype=np.float64) + np.array([0.0, 0.0, height_m / 2])
    return box(centre, [width_m, length_m, height_m], azimuth_deg=azimuth_deg)
