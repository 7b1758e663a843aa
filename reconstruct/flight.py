"""What the rays of a scan see of a field that the wind carries past them.

Everything here is in the frame of the wind: downwind, left of it, up, with the origin at the target. A field
point that is at the target at time 0 is at U t at time t, so a ray at place x and time t meets the air of x -
U t.
"""

from dataclasses import dataclass
from itertools import combinations_with_replacement
from typing import NamedTuple

import numpy as np

from geometry.arrays import ArrayLike, FloatArray, IntArray
from reconstruct.error_draws import Draws
from reconstruct.field import Field, subgrid_covariance
from reconstruct.radial_speed import power_law_mps
from reconstruct.rays import Rays
from reconstruct.spectra import Turbulence
from reconstruct.wind import WindState

_CHUNK_POINTS = 1 << 17


@dataclass(frozen=True)
class Sampling:
    """How finely one ray is averaged, along its probe and over its own sweep."""

    probe_points: int = 7  # Gauss rule of the probe's weighting: 43 m resolved to 6 m
    sweep_points: int = 4  # Gauss-Legendre over the accumulation


def beams(azimuth_deg: ArrayLike, elevation_deg: ArrayLike, from_deg: float) -> FloatArray:
    """Unit vectors (..., 3) downwind, left and up of beams given by azimuth and elevation.

    Examples
    --------
    >>> beams([90.0, 180.0], 0.0, 270.0).round(6) + 0.0
    array([[ 1.,  0.,  0.],
           [ 0., -1.,  0.]])
    """
    turn = np.radians(np.asarray(azimuth_deg, dtype=float) - (from_deg + 180.0))
    elevation = np.radians(elevation_deg)
    level = np.cos(elevation)
    parts = np.broadcast_arrays(np.cos(turn) * level, -np.sin(turn) * level, np.sin(elevation))
    return np.stack(parts, axis=-1)


def to_wind_frame(enu: FloatArray, from_deg: float) -> FloatArray:
    """Vectors (..., 3) east, north, up as downwind, left, up.

    Examples
    --------
    >>> to_wind_frame(np.array([0.0, 1.0, 2.0]), 270.0).round(6) + 0.0
    array([0., 1., 2.])
    """
    angle = np.radians(from_deg)
    east, north = -np.sin(angle), -np.cos(angle)  # of the downwind axis
    turn = np.array([[east, north, 0.0], [-north, east, 0.0], [0.0, 0.0, 1.0]])
    return np.asarray(enu @ turn.T)


def carried_mps(wind: WindState) -> FloatArray:
    """(3,) velocity that carries the field [m/s], downwind, left, up."""
    return np.array([wind.speed_mps, 0.0, wind.vertical_mps])


def mean_speed_mps(points_m: FloatArray, wind: WindState) -> FloatArray:
    """Mean speed (...,) at places (..., 3): power law on the height above ground, and the gradient to the
    right.

    Under the ground it is NaN, and the ray is lost.
    """
    speed = power_law_mps(
        wind.height_m + points_m[..., 2],
        speed_mps=wind.speed_mps,
        reference_height_m=wind.height_m,
        exponent=wind.shear_exponent,
    )
    return np.asarray(speed - wind.lateral_gradient_per_s * points_m[..., 1])


def is_uniform(wind: WindState) -> bool:
    """Whether the mean wind is the same at every place."""
    return wind.shear_exponent == 0 and wind.lateral_gradient_per_s == 0


def uniform_radial_speed_mps(rays: Rays, wind: WindState, draws: Draws) -> FloatArray:
    """Radial speeds (..., ray) of a wind that is the same everywhere, without noise.

    The mean beam of a steady turn by a is the middle one with its horizontal part times sin(a/2)/(a/2).
    """
    turn = np.radians(rays.azimuth_deg + draws.azimuth_deg - (wind.from_deg + 180.0))
    elevation = np.radians(rays.elevation_deg + draws.elevation_deg)
    speed = np.cos(turn) * np.cos(elevation) * (np.sinc(rays.swept_azimuth_deg / 360.0) * wind.speed_mps)
    return np.asarray(speed + np.sin(elevation) * wind.vertical_mps if wind.vertical_mps else speed)


def radial_speed_mps(
    rays: Rays,
    wind: WindState,
    draws: Draws,
    *,
    scans: int,
    sampling: Sampling,
    field: Field | None = None,
    std_mps: float = 0.0,
    shift_m: ArrayLike = (0.0, 0.0, 0.0),
) -> FloatArray:
    """Radial speeds of consecutive scans in one flight through a field, without noise.

    Parameters
    ----------
    rays : Rays
        The scan as planned.
    wind : WindState
        Mean wind.
    draws : Draws
        What pointing, ranging and position do wrong in this flight.
    scans : int
        Number of consecutive scans.
    sampling : Sampling
        Points over probe and sweep.
    field : Field, optional
        Turbulence; without it the mean wind alone.
    std_mps : float
        Standard deviation of the downwind component [m/s].
    shift_m : array_like
        (3,) where in the box the target is at time 0 [m].

    Returns
    -------
    numpy.ndarray
        (scan, ray) [m/s], positive away from the lidar, the resolved part of the turbulence only.
    """
    times = rays.times_s(scans)
    speed = np.empty(times.shape)
    step = max(1, _CHUNK_POINTS // (rays.count * sampling.probe_points * sampling.sweep_points))
    for start in range(0, scans, step):
        chunk = slice(start, start + step)
        errors = draws.scans(chunk)
        sight = _sight(rays, wind, errors, np.arange(scans)[chunk], sampling)
        mean = sight.beam[..., None, 0] * mean_speed_mps(sight.points_m, wind)
        mean += sight.beam[..., None, 2] * wind.vertical_mps
        if field is not None:
            when = (times[chunk] + errors.delay_s)[..., None] + sight.delay_s
            carried = sight.points_m - when[..., None, None] * carried_mps(wind) + np.asarray(shift_m)
            mean += std_mps * np.einsum("srkpi,srki->srkp", field.at(carried), sight.beam)
        speed[chunk] = np.einsum("srkp,rkp->sr", mean, sight.weight)
    return speed


def reference_mps(
    wind: WindState, times_s: FloatArray, *, field: Field, std_mps: float, shift_m: ArrayLike
) -> FloatArray:
    """Wind (time, 3) that a point instrument at the target meets [m/s], its resolved turbulence only."""
    places = np.asarray(shift_m) - times_s[:, None] * carried_mps(wind)
    return np.asarray(carried_mps(wind) + std_mps * field.at(places))


def reach_m(rays: Rays, wind: WindState, duration_s: float) -> FloatArray:
    """(3,) extent of all the air that scans and target meet in a duration [m]."""
    sight = _sight(rays, wind, Draws.none(rays), np.arange(2), Sampling(probe_points=2, sweep_points=2))
    places = np.vstack([sight.points_m.reshape(-1, 3), np.zeros(3)])
    return np.asarray(np.ptp(places, axis=0) + np.abs(carried_mps(wind)) * duration_s)


def subgrid_root(rays: Rays, wind: WindState, turbulence: Turbulence, cut_per_m: float) -> FloatArray:
    """Matrix (ray, ray) that makes of independent normal numbers what small eddies add to the rays.

    Parameters
    ----------
    rays : Rays
        The scan as planned.
    wind : WindState
        Mean wind.
    turbulence : Turbulence
        Model and length.
    cut_per_m : float
        Largest wavenumber that the field has [rad/m].

    Returns
    -------
    numpy.ndarray
        Root of their covariance in the radial speeds, for a longitudinal variance of 1.

    Notes
    -----
    The average over the probe leaves of a wave what `Probe.transfer` says of its wavenumber along the beam;
    the ray's way through the air (its own sweep, and the wind that passes meanwhile) leaves sin(x)/x, with x
    half the phase that the wave turns on that way. Rays of different lidars that cross share small eddies;
    those of one lidar, which follow each other in place and time, are taken as independent.
    """
    beam = beams(rays.azimuth_deg, rays.elevation_deg, wind.from_deg)
    way = _way_m(rays, wind, beam)
    place = to_wind_frame(rays.centre_m, wind.from_deg) - rays.time_s[:, None] * carried_mps(wind)
    covariance = np.zeros((rays.count, rays.count))

    def left(ray: int, wavevector: FloatArray) -> FloatArray:
        along, passing = (np.tensordot(vector[ray], wavevector, axes=1) for vector in (beam, way))
        return np.asarray(rays.probes[int(rays.lidar[ray])].transfer(along) * np.sinc(passing / (2 * np.pi)))

    for one, other in combinations_with_replacement(range(rays.count), 2):
        if one != other and not _meet(rays, place, one, other):
            continue
        gap = place[one] - place[other]

        def shared(k: FloatArray, one: int = one, other: int = other, gap: FloatArray = gap) -> FloatArray:
            return np.asarray(left(one, k) * left(other, k) * np.cos(np.tensordot(gap, k, axes=1)))

        small = subgrid_covariance(turbulence, cut_per_m, response=shared, axis=beam[one])
        covariance[one, other] = covariance[other, one] = beam[one] @ small @ beam[other]
    values, vectors = np.linalg.eigh(covariance)
    return np.asarray(vectors * np.sqrt(np.maximum(values, 0.0)))


def _meet(rays: Rays, place_m: FloatArray, one: int, other: int) -> bool:
    """Whether rays of different lidars may share small eddies: gates within a probe in the moving air."""
    lidars = int(rays.lidar[one]), int(rays.lidar[other])
    reach = max(rays.probes[lidar].length_m for lidar in lidars)
    return lidars[0] != lidars[1] and float(np.linalg.norm(place_m[one] - place_m[other])) < reach


def _way_m(rays: Rays, wind: WindState, beam: FloatArray) -> FloatArray:
    """(ray, 3) way of each gate through the moving air during its ray [m]."""
    turn = np.radians(rays.swept_azimuth_deg)[:, None]
    sideways = np.stack([beam[:, 1], -beam[:, 0], np.zeros(rays.count)], axis=-1)  # clockwise
    return np.asarray(rays.range_m[:, None] * turn * sideways - rays.duration_s[:, None] * carried_mps(wind))


class _Sight(NamedTuple):
    """Where the points of each ray are, relative to the target, and how they count."""

    points_m: FloatArray  # (scan, ray, sweep, probe, 3)
    beam: FloatArray  # (scan, ray, sweep, 3) unit vectors
    delay_s: FloatArray  # (ray, sweep) after the middle of the ray
    weight: FloatArray  # (ray, sweep, probe)


def _sight(rays: Rays, wind: WindState, draws: Draws, scan: IntArray, sampling: Sampling) -> _Sight:
    node, node_weight = np.polynomial.legendre.leggauss(sampling.sweep_points)
    rules = [probe.nodes(sampling.probe_points) for probe in rays.probes]
    offset = np.stack([rule[0] for rule in rules])[rays.lidar]
    probe_weight = np.stack([rule[1] for rule in rules])[rays.lidar]
    sense = np.where((scan % 2 == 1) & rays.back_and_forth, -1.0, 1.0)  # a reverse pass turns the other way
    turn = sense[:, None, None] * rays.swept_azimuth_deg[:, None] * (node / 2)
    azimuth = (rays.azimuth_deg + draws.azimuth_deg)[..., None] + turn
    elevation = np.broadcast_to((rays.elevation_deg + draws.elevation_deg)[..., None], azimuth.shape)
    beam = beams(azimuth, elevation, wind.from_deg)
    distance = (rays.range_m + draws.range_m)[..., None, None] + offset[:, None, :]
    head = to_wind_frame(rays.head_m + draws.head_m, wind.from_deg)
    return _Sight(
        points_m=head[..., None, None, :] + distance[..., None] * beam[..., None, :],
        beam=beam,
        delay_s=rays.duration_s[:, None] * (node / 2),
        weight=(node_weight / 2)[:, None] * probe_weight[:, None, :],
    )
