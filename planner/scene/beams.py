"""Beams as shapes: stares, fans of rays, measured gates, range arcs and crossings, in local metres.

Rays come as end points or as azimuth (clockwise from true north) and elevation of the straight line at the
head; the caller has already brought everything into the one frame of the scene.
"""

from typing import NamedTuple

import numpy as np

from geometry.arrays import ArrayLike, FloatArray
from geometry.errors import InputError
from planner.scene.model import Lines, Mesh, Points
from planner.scene.solids import arc_m, ellipsoid, fan, joined, polyline, segments_between, surface_between


def along_rays_m(
    head_m: ArrayLike, azimuth_deg: ArrayLike, elevation_deg: ArrayLike, range_m: ArrayLike
) -> FloatArray:
    """Give the points (..., 3) at slant ranges along rays from a head [m].

    b = (sin θ cos φ, cos θ cos φ, sin φ), θ clockwise from true north, φ above the horizontal.

    Examples
    --------
    >>> along_rays_m([0, 0, 2], 90.0, 30.0, 100.0).round(2) + 0.0
    array([86.6,  0. , 52. ])
    """
    azimuth = np.radians(np.asarray(azimuth_deg, dtype=np.float64))
    elevation = np.radians(np.asarray(elevation_deg, dtype=np.float64))
    east, north, up = np.broadcast_arrays(
        np.sin(azimuth) * np.cos(elevation), np.cos(azimuth) * np.cos(elevation), np.sin(elevation)
    )
    direction = np.stack([east, north, up], axis=-1)
    head, range_ = np.asarray(head_m, dtype=np.float64), np.asarray(range_m, dtype=np.float64)
    return np.asarray(head + range_[..., None] * direction, dtype=np.float64)


class Stare(NamedTuple):
    """The parts of a drawn stare."""

    beam: Lines  # head to the last gate
    gates: Points  # all gate centres
    probe: Lines  # the measured gate, as long as its probe
    shadow: Lines  # the beam straight down on the ground


def stare(
    head_m: ArrayLike,
    azimuth_deg: float,
    elevation_deg: float,
    *,
    gate_ranges_m: ArrayLike,
    measured_range_m: float,
    probe_length_m: float,
    ground_m: float,
    name: str = "",
) -> Stare:
    """Draw a beam that stands still.

    Parameters
    ----------
    head_m
        (3,) Scanner head [m].
    azimuth_deg, elevation_deg
        Direction of the beam [deg].
    gate_ranges_m
        (gate,) Centres of the gates [m].
    measured_range_m, probe_length_m
        Centre of the gate at the target, and full width at half maximum of its weighting [m].
    ground_m
        Height of the ground under the beam, for its shadow [m].
    name
        What the hover text calls the lidar.

    Examples
    --------
    >>> s = stare([0, 0, 0], 0.0, 0.0, gate_ranges_m=[50, 100], measured_range_m=100,
    ...           probe_length_m=40, ground_m=-2)
    >>> s.beam.length_m, s.probe.length_m
    (100.0, 40.0)
    """
    ranges = np.asarray(gate_ranges_m, dtype=np.float64)
    half = probe_length_m / 2
    probe_ends = np.array([measured_range_m - half, measured_range_m + half])
    reach = max(float(ranges.max(initial=0.0)), measured_range_m)
    ends = along_rays_m(head_m, azimuth_deg, elevation_deg, np.array([0.0, reach]))
    what = f"{name}: azimuth {azimuth_deg:.2f}°, elevation {elevation_deg:.2f}°"
    return Stare(
        beam=segments_between(ends[:1], ends[1:], width_px=3.0, hover=what),
        gates=Points(
            along_rays_m(head_m, azimuth_deg, elevation_deg, ranges),
            size_px=4.0,
            hover=tuple(f"{name}: gate {i}, range {r:.1f} m" for i, r in enumerate(ranges)),
        ),
        probe=segments_between(
            *along_rays_m(head_m, azimuth_deg, elevation_deg, probe_ends)[:, None, :],
            width_px=8.0,
            hover=f"{name}: measures at {measured_range_m:.1f} m, probe {probe_length_m:.1f} m",
        ),
        shadow=_shadow(ends, ground_m),
    )


def _shadow(points_m: FloatArray, ground_m: float) -> Lines:
    flat = np.concatenate([points_m[:, :2], np.full((len(points_m), 1), ground_m)], axis=1)
    return polyline(flat, width_px=1.2, opacity=0.45)


class Fan(NamedTuple):
    """The parts of a drawn scan."""

    surface: Mesh  # swept by the rays, head to the last gate, but for the measured volume
    rays: Lines
    volume: Mesh  # what the measured gate samples: one probe long
    measured: Lines  # through the measured gates of all rays
    gates: Points  # the measured gate of each ray
    edges: Lines  # outline of the surface


def scan_fan(
    head_m: ArrayLike,
    azimuth_deg: ArrayLike,
    elevation_deg: ArrayLike,
    *,
    reach_m: float,
    measured_range_m: float,
    probe_length_m: float,
    closed: bool = False,
    name: str = "",
) -> Fan:
    """Draw a sector scan, full circle (PPI) or vertical slice (RHI): its rays in their order.

    Parameters
    ----------
    head_m
        (3,) Scanner head [m].
    azimuth_deg, elevation_deg
        (ray,) Directions of the middles of the rays [deg]; one elevation serves all azimuths and the other
        way round.
    reach_m
        Range to which the fan is drawn: the last gate [m].
    measured_range_m, probe_length_m
        Centre of the gate at the target, and full width at half maximum of its weighting [m].
    closed
        Join the last ray to the first: a full circle.
    name
        What the hover text calls the lidar.

    Raises
    ------
    InputError
        If there are fewer than two rays.

    Examples
    --------
    >>> f = scan_fan([0, 0, 0], [80, 90, 100], 0.0, reach_m=1000, measured_range_m=800, probe_length_m=40)
    >>> float(f.rays.length_m), len(f.gates.points_m)
    (3000.0, 3)
    """
    azimuth, elevation = np.broadcast_arrays(
        np.atleast_1d(np.asarray(azimuth_deg, dtype=np.float64)), np.asarray(elevation_deg, dtype=np.float64)
    )
    if azimuth.size < 2:
        raise InputError(f"a fan of {azimuth.size} ray came; give two rays or more, or draw a stare")

    def at(range_m: float) -> FloatArray:
        return along_rays_m(head_m, azimuth, elevation, np.full(azimuth.shape, range_m))

    def curve(range_m: float) -> FloatArray:
        points = at(range_m)
        return np.concatenate([points, points[:1]]) if closed else points

    rim, head = curve(reach_m), np.asarray(head_m, dtype=np.float64)
    near, far = curve(measured_range_m - probe_length_m / 2), curve(measured_range_m + probe_length_m / 2)
    outline = rim if closed else np.concatenate([head[None, :], rim, head[None, :]])
    what = f"{name}: {azimuth.size} rays, measures at {measured_range_m:.1f} m, probe {probe_length_m:.1f} m"
    hover = tuple(
        f"{name}: ray {i}, azimuth {a:.2f}°, elevation {e:.2f}°, range {measured_range_m:.1f} m"
        for i, (a, e) in enumerate(zip(azimuth, elevation, strict=True))
    )
    return Fan(
        surface=joined(
            _around_band(head, near, far, rim, reach_m > measured_range_m + probe_length_m / 2), hover=what
        ),
        rays=segments_between(head, at(reach_m), width_px=1.0, opacity=0.35),
        volume=surface_between(near, far, opacity=0.55, hover=what),
        measured=polyline(curve(measured_range_m), width_px=3.0),
        gates=Points(at(measured_range_m), size_px=6.0, hover=hover),
        edges=polyline(outline, width_px=2.0, opacity=0.9),
    )


class Spokes(NamedTuple):
    """The parts of rays that are each drawn for itself."""

    rays: Lines  # head to the measured gate and half its probe
    probes: Lines  # the measured gate of each ray, as long as its probe
    gates: Points


def spokes(
    head_m: ArrayLike,
    azimuth_deg: ArrayLike,
    elevation_deg: ArrayLike,
    *,
    measured_range_m: ArrayLike,
    probe_length_m: float,
    name: str = "",
) -> Spokes:
    """Draw rays that measure nothing on the way from one to the next: a list of points, a raster.

    Parameters
    ----------
    head_m
        (3,) Scanner head [m].
    azimuth_deg, elevation_deg
        (ray,) Directions of the rays [deg].
    measured_range_m
        (ray,) Centre of each ray's gate, or one for all [m].
    probe_length_m
        Full width at half maximum of the gate's weighting [m].
    name
        What the hover text calls the lidar.

    Examples
    --------
    >>> s = spokes([0, 0, 0], [80, 90], [0, 5], measured_range_m=[480, 980], probe_length_m=40)
    >>> round(s.rays.length_m, 6), round(s.probes.length_m, 6)
    (1500.0, 80.0)
    """
    azimuth, elevation, range_m = np.broadcast_arrays(
        *(
            np.atleast_1d(np.asarray(v, dtype=np.float64))
            for v in (azimuth_deg, elevation_deg, measured_range_m)
        )
    )
    near, middle, far = (
        along_rays_m(head_m, azimuth, elevation, range_m + share * probe_length_m)
        for share in (-0.5, 0.0, 0.5)
    )
    hover = tuple(
        f"{name}: ray {i}, azimuth {a:.2f}°, elevation {e:.2f}°, range {r:.1f} m"
        for i, (a, e, r) in enumerate(zip(azimuth, elevation, range_m, strict=True))
    )
    return Spokes(
        rays=segments_between(np.asarray(head_m, dtype=np.float64), far, width_px=1.2, opacity=0.55),
        probes=segments_between(near, far, width_px=6.0),
        gates=Points(middle, size_px=5.0, hover=hover),
    )


def range_arcs(
    centre_m: ArrayLike, radii_m: ArrayLike, *, from_deg: float = 0.0, width_deg: float = 360.0
) -> Lines:
    """Draw level arcs about a lidar on the ground [m, deg].

    Examples
    --------
    >>> arcs = range_arcs([0, 0, 0], [500, 1000])
    >>> round(arcs.length_m / (2 * np.pi * 1500), 2)
    1.0
    """
    arcs = [
        polyline(arc_m(centre_m, float(radius), from_deg, width_deg)) for radius in np.atleast_1d(radii_m)
    ]
    starts = np.cumsum([0, *(len(arc.points_m) for arc in arcs)])[:-1]
    segments = [arc.segments + start for arc, start in zip(arcs, starts, strict=True)]
    points = np.concatenate([arc.points_m for arc in arcs])
    return Lines(points, np.concatenate(segments), width_px=1.2, opacity=0.7)


def _around_band(
    head_m: FloatArray, near_m: FloatArray, far_m: FloatArray, rim_m: FloatArray, goes_on: bool
) -> list[Mesh]:
    """Leave the measured band out of the swept surface: two surfaces in one plane would flicker."""
    inner = [fan(head_m, near_m, opacity=0.13)]
    return [*inner, surface_between(far_m, rim_m, opacity=0.13)] if goes_on else inner


class Cross(NamedTuple):
    """The parts of a drawn crossing."""

    ellipsoid: Mesh | None  # where the crossing may be, from the position covariance
    gap: Lines  # between the nearest points of the two beams
    points: Points  # those points
    plumb: Lines  # down to the ground, so that the eye finds the place


def crossing(
    point1_m: ArrayLike,
    point2_m: ArrayLike,
    *,
    ground_m: float,
    covariance_m2: ArrayLike | None = None,
    coverage: float = 2.0,
    hover: str = "",
) -> Cross:
    """Mark where two beams meet, or how they miss.

    Parameters
    ----------
    point1_m, point2_m
        (3,) The nearest points of the two beams [m].
    ground_m
        Height of the ground below [m].
    covariance_m2
        (3, 3) covariance of the crossing's position [m²]; drawn as the ellipsoid of `coverage` standard
        deviations.
    coverage
        Semi-axes of the ellipsoid in standard deviations [1].
    hover
        Text under the pointer.

    Raises
    ------
    InputError
        If the covariance is not symmetric and positive.

    Examples
    --------
    >>> c = crossing([0, 0, 120], [0, 2, 120], ground_m=5.0)
    >>> c.gap.length_m, c.plumb.length_m
    (2.0, 115.0)
    """
    first, second = (np.asarray(p, dtype=np.float64) for p in (point1_m, point2_m))
    middle = (first + second) / 2
    foot = np.array([middle[0], middle[1], ground_m])
    body = None if covariance_m2 is None else error_ellipsoid(middle, covariance_m2, coverage=coverage)
    return Cross(
        ellipsoid=body,
        gap=segments_between(first[None, :], second[None, :], width_px=3.0, hover=hover),
        points=Points(np.stack([first, second]), size_px=5.0, hover=(hover, hover) if hover else ()),
        plumb=segments_between(middle[None, :], foot[None, :], width_px=1.2, opacity=0.6),
    )


def error_ellipsoid(centre_m: ArrayLike, covariance_m2: ArrayLike, *, coverage: float = 2.0) -> Mesh:
    """Draw the ellipsoid of so many standard deviations about a point [m].

    Semi-axes are coverage · sqrt(eigenvalue) along the eigenvectors of the covariance.

    Raises
    ------
    InputError
        If the covariance is not symmetric, or has a negative eigenvalue.

    Examples
    --------
    >>> e = error_ellipsoid([0, 0, 0], np.diag([4.0, 1.0, 1.0]))
    >>> round(float(abs(e.vertices_m[:, 0]).max()), 6)
    4.0
    """
    covariance = np.asarray(covariance_m2, dtype=np.float64)
    if covariance.shape != (3, 3) or not np.allclose(covariance, covariance.T):
        raise InputError(
            f"a covariance of shape {covariance.shape} came that is not symmetric (3, 3); give one [m²]"
        )
    values, vectors = np.linalg.eigh(covariance)
    if values[0] < -1e-9 * values[-1]:
        raise InputError(
            f"a covariance with the eigenvalue {values[0]:.3g} m² came; variances cannot be negative"
        )
    axes = coverage * np.sqrt(np.maximum(values, 0.0))[:, None] * vectors.T
    if np.linalg.det(axes) < 0:
        axes = axes * np.array(
            [[1.0], [1.0], [-1.0]]
        )  # keep a right-handed set, so that normals stay outside
    return ellipsoid(centre_m, axes, opacity=0.3)
