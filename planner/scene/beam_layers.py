"""Layers of beams: stares, fans, single rays, what is lost of them, ranges and crossings.

All positions are local metres east, north, up in the frame of the scene; azimuths clockwise from true north.
"""

from collections.abc import Sequence

import numpy as np

from geometry.arrays import ArrayLike
from planner import palette
from planner.scene import beams
from planner.scene.model import Item, Label, Layer, Points
from planner.scene.solids import azimuth_direction, segments_between


def stare_layer(
    name: str,
    colour: str,
    head_m: ArrayLike,
    azimuth_deg: float,
    elevation_deg: float,
    *,
    gate_ranges_m: ArrayLike,
    measured_range_m: float,
    probe_length_m: float,
    ground_m: float,
    scan: str = "stare",
) -> Layer:
    """Draw a lidar that stares: beam, gates, the measured gate, the beam's shadow on the ground.

    The parameters are those of `beams.stare`; `scan` names the layer after the lidar.

    Examples
    --------
    >>> layer = stare_layer("K", "#0072b2", [0, 0, 2], 10.0, 5.0, gate_ranges_m=[100, 200],
    ...                     measured_range_m=200, probe_length_m=40, ground_m=0.0)
    >>> layer.name, [label.text for label in layer.labels]
    ('K: stare', ['K'])
    """
    parts = beams.stare(
        head_m,
        azimuth_deg,
        elevation_deg,
        gate_ranges_m=gate_ranges_m,
        measured_range_m=measured_range_m,
        probe_length_m=probe_length_m,
        ground_m=ground_m,
        name=name,
    )
    return Layer(
        f"{name}: {scan}",
        colour,
        (*parts, *_head(name, head_m)),
        about="dots: gates; thick: the gate at the target",
    )


def fan_layer(
    name: str,
    colour: str,
    head_m: ArrayLike,
    azimuth_deg: ArrayLike,
    elevation_deg: ArrayLike,
    *,
    reach_m: float,
    measured_range_m: float,
    probe_length_m: float,
    closed: bool = False,
    scan: str = "sector",
) -> Layer:
    """Draw a lidar that scans: fan with its rays, and the volume that the gate at the target samples.

    The parameters are those of `beams.scan_fan`; `scan` names the layer after the lidar.

    Examples
    --------
    >>> layer = fan_layer("S", "#d55e00", [0, 0, 2], [80, 90], 5.0, reach_m=500, measured_range_m=400,
    ...                   probe_length_m=40)
    >>> layer.name, len(layer.meshes)
    ('S: sector', 2)
    """
    parts = beams.scan_fan(
        head_m,
        azimuth_deg,
        elevation_deg,
        reach_m=reach_m,
        measured_range_m=measured_range_m,
        probe_length_m=probe_length_m,
        closed=closed,
        name=name,
    )
    return Layer(
        f"{name}: {scan}",
        colour,
        (*parts, *_head(name, head_m)),
        about="band: air measured by the gate at the target",
    )


def spokes_layer(
    name: str,
    colour: str,
    head_m: ArrayLike,
    azimuth_deg: ArrayLike,
    elevation_deg: ArrayLike,
    *,
    measured_range_m: ArrayLike,
    probe_length_m: float,
    scan: str = "points",
) -> Layer:
    """Draw a lidar that goes from ray to ray: each with the gate that it measures.

    The parameters are those of `beams.spokes`; `scan` names the layer after the lidar.

    Examples
    --------
    >>> spokes_layer("S", "#d55e00", [0, 0, 2], [80, 90], 5.0, measured_range_m=400, probe_length_m=40).name
    'S: points'
    """
    parts = beams.spokes(
        head_m,
        azimuth_deg,
        elevation_deg,
        measured_range_m=measured_range_m,
        probe_length_m=probe_length_m,
        name=name,
    )
    return Layer(
        f"{name}: {scan}",
        colour,
        (*parts, *_head(name, head_m)),
        about="thick: the gate that each ray measures",
    )


def lost_layer(starts_m: ArrayLike, ends_m: ArrayLike, hover: str = "") -> Layer:
    """Draw what rays do not see: from where each meets something solid to where it should have measured.

    Parameters
    ----------
    starts_m, ends_m
        (ray, 3) [m].
    hover
        Text under the pointer.

    Examples
    --------
    >>> lost_layer([[0, 500, 60]], [[0, 1100, 120]]).name
    'lost'
    """
    starts = np.asarray(starts_m, dtype=np.float64)
    lines = segments_between(starts, ends_m, width_px=3.5, hover=hover)
    return Layer(
        "lost", palette.EXCLUDED, (lines, Points(starts, size_px=7.0)), about="rays behind something solid"
    )


def range_arc_layer(
    name: str,
    colour: str,
    head_m: ArrayLike,
    radii_m: Sequence[float],
    *,
    from_deg: float,
    width_deg: float,
    ground_m: float,
) -> Layer:
    """Draw labelled arcs of range on the ground about a lidar, over a sector [m, deg].

    Examples
    --------
    >>> layer = range_arc_layer("S", "#d55e00", [0, 0, 2], [500, 1000], from_deg=150, width_deg=60,
    ...                         ground_m=0)
    >>> [label.text for label in layer.labels]
    ['500 m', '1000 m']
    """
    centre = np.array([*np.asarray(head_m, dtype=np.float64)[:2], ground_m + 0.6])
    arcs = beams.range_arcs(centre, radii_m, from_deg=from_deg, width_deg=width_deg)
    end = azimuth_direction(from_deg + width_deg)
    labels = [Label(f"{radius:g} m", centre + radius * end, rank=2) for radius in radii_m]
    return Layer(f"{name}: ranges", colour, (arcs, *labels), opacity=0.8, in_legend=False)


def crossing_layer(
    name: str,
    text: str,
    point1_m: ArrayLike,
    point2_m: ArrayLike,
    *,
    ground_m: float,
    covariance_m2: ArrayLike | None = None,
    coverage: float = 2.0,
) -> Layer:
    """Mark where two beams meet, with a text such as the angle and the gap; parameters of `beams.crossing`.

    Examples
    --------
    >>> layer = crossing_layer("dual", "dual: 63.0°, gap 0.3 m", [0, 0, 120], [0, 0, 120.3], ground_m=5.0)
    >>> layer.labels[0].text
    'dual: 63.0°, gap 0.3 m'
    """
    parts = beams.crossing(
        point1_m, point2_m, ground_m=ground_m, covariance_m2=covariance_m2, coverage=coverage, hover=text
    )
    middle = (np.asarray(point1_m, dtype=np.float64) + np.asarray(point2_m, dtype=np.float64)) / 2
    items: list[Item] = [part for part in parts if part is not None]
    about = "" if covariance_m2 is None else f"body: {coverage:g} standard deviations of its position"
    return Layer(name, palette.CROSSING, (*items, Label(text, middle, rank=0)), about=about)


def _head(name: str, head_m: ArrayLike) -> tuple[Item, ...]:
    head = np.asarray(head_m, dtype=np.float64)
    dot = Points(head[None, :], size_px=15.0, hover=(name,))
    return (dot, Label(name, head, rank=0))
