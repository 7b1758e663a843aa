"""What the rays of a scan see of a field that the wind carries past them.

Everything here is in the frame of the wind: downwind, left of it, up, with the origin at the target. A field
point that is at the target at time 0 is at U t at time t, so a ray at place x and time t meets the air of x -
U t.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from geometry.arrays import ArrayLike, FloatArray, IntArray
from reconstruct.error_draws import Draws
from reconstruct.field import Field
from reconstruct.radial_speed import power_law_mps
from reconstruct.rays import Rays
from reconstruct.waves import Waves
from reconstruct.wind import WindState

ComplexArray = NDArray[np.complex64]

_CHUNK_POINTS = 1 << 17
_BLOCK = 64  # times whose phases are a product of two shorter lists


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
        (scan, ray) [m/s], positive away from the lidar; of the turbulence the box alone: `WaveSight` has the rest.
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
    """Wind (time, 3) that a point instrument at the target meets [m/s]; of the turbulence the box alone."""
    places = np.asarray(shift_m) - times_s[:, None] * carried_mps(wind)
    return np.asarray(carried_mps(wind) + std_mps * field.at(places))


def reach_m(rays: Rays, wind: WindState, duration_s: float) -> FloatArray:
    """(3,) extent of all the air that scans and target meet in a duration [m]."""
    sight = _sight(rays, wind, Draws.none(rays), np.arange(2), Sampling(probe_points=2, sweep_points=2))
    places = np.vstack([sight.points_m.reshape(-1, 3), np.zeros(3)])
    return np.asarray(np.ptp(places, axis=0) + np.abs(carried_mps(wind)) * duration_s)


@dataclass(frozen=True)
class WaveSight:
    """What consecutive scans make of the waves that a box cannot carry."""

    seen: ComplexArray  # (pass, 2, wave, ray): by how much the two amplitudes of each wave count
    phase: tuple[
        ComplexArray, ...
    ]  # a pass: (scan, wave) turned on by the air that passed since the first scan

    @classmethod
    def of(
        cls,
        rays: Rays,
        wind: WindState,
        waves: Waves,
        draws: Draws,
        *,
        scans: int,
        offset_m: ArrayLike = (0.0, 0.0, 0.0),
    ) -> "WaveSight":
        """Work out what each ray of both directions of a scan leaves of each wave.

        Parameters
        ----------
        rays, wind : Rays, WindState
            The scan and the mean wind.
        waves : Waves
            From the field.
        draws : Draws
            What pointing and position do wrong, on average over the scans: a jitter is small beside the waves.
        scans : int
            Number of consecutive scans.
        offset_m : array_like
            (3,) place of the scan's target in the frame of the waves [m].

        Notes
        -----
        The average over the probe leaves of a wave what `Probe.transfer` says of its wavenumber along the beam;
        the ray's way through the air (its own sweep, and the wind that passes meanwhile) leaves sin(x)/x, with
        x half the phase that the wave turns on that way.
        """
        steady = draws.mean()
        sight = _sight(rays, wind, steady, np.arange(2), Sampling(probe_points=1, sweep_points=1))
        when = np.stack([rays.time_s, rays.reversed_time_s]) + steady.delay_s
        passes = 1 + rays.back_and_forth
        seen = np.empty((passes, 2, waves.vector.shape[1], rays.count), dtype=np.complex64)
        for index in range(passes):
            beam = sight.beam[index, :, 0]
            place = sight.points_m[index, :, 0, 0] + np.asarray(offset_m)
            place = place - when[index, :, None] * carried_mps(wind)
            way = _way_m(rays, wind, beam, reverse=index == 1)
            kept = _kept(rays, waves, beam, way) * np.exp(1j * (waves.vector.T @ place.T))
            seen[index] = waves.first.T @ beam.T * kept, waves.second.T @ beam.T * kept
        period_s = rays.period_s
        phase = [
            passing(wind, waves, period_s * index, period_s * passes, len(range(index, scans, passes)))
            for index in range(passes)
        ]
        return cls(seen, tuple(phase))

    def radial_speed(self, amplitudes: ComplexArray) -> FloatArray:
        """(scan, ray) sum of the waves, for a standard deviation of 1."""
        passes = len(self.seen)
        out = np.empty((sum(len(phase) for phase in self.phase), self.seen.shape[3]))
        for index in range(passes):
            each = np.einsum("aw,awr->wr", amplitudes, self.seen[index])
            out[index::passes] = (self.phase[index] @ each).real
        return out


def passing(wind: WindState, waves: Waves, first_s: float, step_s: float, count: int) -> ComplexArray:
    """Phase (time, wave) by which the air that passes turns each wave, at equal steps of time."""
    turning = carried_mps(wind) @ waves.vector
    late, early = np.arange(0, count, _BLOCK), np.arange(min(_BLOCK, count))
    starts = np.exp(-1j * np.outer(first_s + step_s * late, turning)).astype(np.complex64)
    steps = np.exp(-1j * np.outer(step_s * early, turning)).astype(np.complex64)
    return np.asarray((starts[:, None] * steps).reshape(-1, len(turning))[:count])


def met_waves(waves: Waves, amplitudes: ComplexArray, phase: ComplexArray) -> FloatArray:
    """Sum of the waves (time, 3) at the target, for a standard deviation of 1; `phase` from `passing`."""
    each = amplitudes[0] * waves.first + amplitudes[1] * waves.second
    return np.asarray((phase @ each.T.astype(np.complex64)).real)


def _kept(rays: Rays, waves: Waves, beam: FloatArray, way_m: FloatArray) -> FloatArray:
    """(wave, ray) share of each wave's amplitude that probe and way leave."""
    along = waves.vector.T @ beam.T
    kept = np.asarray(np.sinc(waves.vector.T @ way_m.T / (2 * np.pi)))
    for lidar, probe in enumerate(rays.probes):
        own = rays.lidar == lidar
        kept[:, own] *= probe.transfer(along[:, own])
    return kept


def _way_m(rays: Rays, wind: WindState, beam: FloatArray, *, reverse: bool) -> FloatArray:
    """(ray, 3) way of each gate through the moving air during its ray [m]."""
    turn = (-1 if reverse else 1) * np.radians(rays.swept_azimuth_deg)[:, None]
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
