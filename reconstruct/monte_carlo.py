"""The judge of every closed form: draw winds, beams and noise, and run the real retrieval and the real
averaging.

Nothing here or below it knows a covariance function. A realisation is one averaging period of one campaign:
the errors that are common to the rays of a lidar are drawn once for it, the field is carried past once, every
ray is averaged over its probe and over its own sweep at its own time along its true (perturbed) beam, and the
fit uses the planned beams.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from geometry.arrays import FloatArray, IntArray
from geometry.errors import InputError
from reconstruct import retrieval
from reconstruct.error_draws import Draws, Sources, draw_pointing, draw_speed_errors
from reconstruct.field import Field, synthesise
from reconstruct.flight import (
    ComplexArray,
    Sampling,
    WaveSight,
    is_uniform,
    met_waves,
    passing,
    radial_speed_mps,
    reach_m,
    reference_mps,
    uniform_radial_speed_mps,
)
from reconstruct.periods import TEN_MINUTES_S
from reconstruct.ray_fit import ray_rows
from reconstruct.rays import Rays
from reconstruct.spectra import Turbulence
from reconstruct.uncertainty import ErrorSources
from reconstruct.verdict import Simulation
from reconstruct.waves import Waves
from reconstruct.wind import WindState, uv_mps

Progress = Callable[[float], None]

# Of the samples at the target: eddies that pass between two samples would be taken for slow ones (with one sample a
# second the scatter of dual Doppler over ten minutes came out 5 % larger in the same fields).
REFERENCE_INTERVAL_S = 0.5
_CHUNK_RAYS = 1 << 16
_BLOCKS = 20  # of realisations without turbulence, which share nothing


class Scene(NamedTuple):
    """Scans in one mean wind."""

    rays: Rays
    wind: WindState


class Settings(NamedTuple):
    """How a simulation is run."""

    realisations: int = 64
    flights_per_field: int = 4
    averaging_s: float = TEN_MINUTES_S
    sampling: Sampling = Sampling()
    spacing_m: float | None = None


DEFAULT = Settings()


def simulate(
    rays: Rays,
    wind: WindState,
    *,
    rng: np.random.Generator,
    sources: Sources | None = None,
    turbulence: Turbulence | None = None,
    settings: Settings = DEFAULT,
    progress: Progress | None = None,
) -> Simulation:
    """Simulate averaging periods of one scene: `simulate_scenes` for a single one.

    Examples
    --------
    >>> from geometry.gates import Probe
    >>> still = np.zeros(3)
    >>> rays = Rays(azimuth_deg=np.array([60.0, 90.0, 120.0]), elevation_deg=still, range_m=still + 1000.0,
    ...             head_m=np.tile([-1000.0, 0.0, 0.0], (3, 1)), lidar=np.zeros(3, dtype=int), time_s=still,
    ...             duration_s=still + 0.4, swept_azimuth_deg=still, probes=(Probe(200, 256),), period_s=10.0)
    >>> wind = WindState(speed_mps=10.0, from_deg=225.0)
    >>> simulate(rays, wind, rng=np.random.default_rng(1)).scan_mps.mean(axis=(0, 1)).round(4)
    array([7.0711, 7.0711])
    """
    scene = Scene(rays, wind)
    return simulate_scenes(
        [scene], rng=rng, sources=sources, turbulence=turbulence, settings=settings, progress=progress
    )[0]


def simulate_scenes(
    scenes: Sequence[Scene],
    *,
    rng: np.random.Generator,
    sources: Sources | None = None,
    turbulence: Turbulence | None = None,
    settings: Settings = DEFAULT,
    progress: Progress | None = None,
) -> list[Simulation]:
    """Simulate averaging periods of several scenes: sector sizes, wind directions, speeds.

    Parameters
    ----------
    scenes : sequence of Scene
        Scans and mean winds. With turbulence all scenes fly through the same fields, so that their
        differences are known better than their values.
    rng : numpy.random.Generator
        Source of all numbers: the same state gives the same result.
    sources : ErrorSources or sequence of ErrorSources, optional
        Standard deviations of the errors of all lidars, or of each; none without.
    turbulence : Turbulence, optional
        Model of the air; a uniform frozen flow without.
    settings : Settings
        Realisations (averaging periods) in each scene; how many of them fly through one field, at heights
        spread over the box; averaging time [s]; points a ray; side of a cell [m].
    progress : callable, optional
        Gets the share of the work that is done, 0 to 1.

    Returns
    -------
    list of Simulation
        One for each scene; `verdict.judge` makes numbers with standard errors of it.

    Raises
    ------
    InputError
        If no scan fits into the averaging time, there are too few realisations, or the field does not fit in
        memory.

    Notes
    -----
    The field passes at the speed of the wind at the target, whatever the shear (Taylor's hypothesis). Flights
    through one field have the same wavevectors beside the box, each with amplitudes of its own.
    """
    sources = ErrorSources() if sources is None else sources
    _check(scenes, settings)
    if turbulence is None or turbulence.intensity == 0:
        done = []
        for index, scene in enumerate(scenes):
            done.append(_without_turbulence(scene, sources, settings, rng))
            _tell(progress, (index + 1) / len(scenes))
        return done
    return _with_turbulence(scenes, sources, turbulence, settings, rng, progress)


def scans_in(rays: Rays, duration_s: float) -> int:
    """Return the number of whole scans in a duration."""
    return int(np.floor(duration_s / rays.period_s + 1e-9))


def _check(scenes: Sequence[Scene], settings: Settings) -> None:
    if settings.realisations < 2 or settings.flights_per_field < 1:
        raise InputError(
            f"{settings.realisations} realisations, {settings.flights_per_field} a field: at least 2 "
            "realisations are needed for a standard error, and at least 1 a field"
        )
    for scene in scenes:
        if scans_in(scene.rays, settings.averaging_s) < 1:
            raise InputError(
                f"a scan takes {scene.rays.period_s:g} s and the averaging time is "
                f"{settings.averaging_s:g} s: average for at least one scan"
            )


def _without_turbulence(
    scene: Scene, sources: Sources, settings: Settings, rng: np.random.Generator
) -> Simulation:
    rays, wind = scene
    scans = scans_in(rays, settings.averaging_s)
    step = max(1, _CHUNK_RAYS // (scans * rays.count))
    rows = ray_rows(rays)
    found = np.empty((settings.realisations, scans, 2))
    for start in range(0, settings.realisations, step):
        shape = (min(step, settings.realisations - start), scans)
        draws = draw_pointing(sources, rays, shape, rng)
        if is_uniform(wind):
            clean = uniform_radial_speed_mps(rays, wind, draws)
        else:
            flights = [draws.realisation(index) for index in range(shape[0])]
            clean = np.stack(
                [
                    radial_speed_mps(rays, wind, one, scans=scans, sampling=settings.sampling)
                    for one in flights
                ]
            )
        fit = retrieval.solve(rows, _measured(clean, sources, rays, shape, rng))
        found[start : start + step] = fit.wind_mps[..., :2]
    reference = np.broadcast_to(wind.uv_mps, (settings.realisations, 1, 2))
    block = np.arange(settings.realisations) * _BLOCKS // max(_BLOCKS, settings.realisations)
    return Simulation(wind, found, reference, block, float(retrieval.condition(rows)))


def _measured(
    clean_mps: FloatArray, sources: Sources, rays: Rays, shape: tuple[int, int], rng: np.random.Generator
) -> FloatArray:
    """Radial speeds (realisation, scan, ray) as the lidars give them."""
    noise, factor = draw_speed_errors(sources, rays, shape, rng)
    return np.asarray(np.broadcast_to(clean_mps * factor + noise, (*shape, rays.count)))


def _with_turbulence(
    scenes: Sequence[Scene],
    sources: Sources,
    turbulence: Turbulence,
    settings: Settings,
    rng: np.random.Generator,
    progress: Progress | None,
) -> list[Simulation]:
    block = np.arange(settings.realisations) // settings.flights_per_field
    fields = int(block[-1]) + 1
    extent = np.max([reach_m(rays, wind, settings.averaging_s) for rays, wind in scenes], axis=0)
    flown: list[list[Simulation]] = [[] for _ in scenes]
    for number in range(fields):
        field = synthesise(turbulence, extent, rng=rng, spacing_m=settings.spacing_m)
        shifts = spread_shifts_m(field, int(np.count_nonzero(block == number)), rng)
        for index, scene in enumerate(scenes):
            air = Air(field, turbulence.std_mps(scene.wind.speed_mps))
            flown[index].append(fly_through(air, scene, shifts, rng=rng, sources=sources, settings=settings))
            _tell(progress, (number + (index + 1) / len(scenes)) / fields)
        del field, air  # before the next one is made
    return [_together(parts, block) for parts in flown]


def _together(parts: Sequence[Simulation], block: IntArray) -> Simulation:
    """One simulation of the flights through several fields."""
    return replace(
        parts[0],
        scan_mps=np.concatenate([part.scan_mps for part in parts]),
        reference_mps=np.concatenate([part.reference_mps for part in parts]),
        block=block,
    )


class Air(NamedTuple):
    """A field as one scene meets it."""

    field: Field
    std_mps: float  # of the downwind component


def spread_shifts_m(field: Field, flights: int, rng: np.random.Generator) -> FloatArray:
    """Random places in the box (flight, 3) [m], their heights spread so that flights share little air."""
    place = rng.uniform(size=(flights, 3))
    place[:, 2] = (np.arange(flights) + place[0, 2]) / flights
    return np.asarray(place * field.size_m)


def fly_through(
    air: Air,
    scene: Scene,
    shifts_m: FloatArray,
    *,
    rng: np.random.Generator,
    sources: Sources,
    settings: Settings = DEFAULT,
) -> Simulation:
    """Fly a scene through one field several times, each time from another place.

    Parameters
    ----------
    air : Air
        The field and how strong it is.
    scene : Scene
        Scans and mean wind.
    shifts_m : numpy.ndarray
        (flight, 3) where in the box the target is when the averaging starts [m].
    rng : numpy.random.Generator
        Source of noise and pointing errors.
    sources : ErrorSources or sequence of ErrorSources
        Standard deviations of the lidars' errors.
    settings : Settings
        Averaging time and sampling.

    Returns
    -------
    Simulation
        All in one block.
    """
    rays, wind = scene
    scans = scans_in(rays, settings.averaging_s)
    rows = ray_rows(rays)
    found, met = [], []
    waves = air.field.waves
    planned = WaveSight.of(rays, wind, waves, Draws.none(rays), scans=scans)
    phase = reference_phase(wind, waves, settings.averaging_s)
    for shift in shifts_m:
        draws = draw_pointing(sources, rays, (1, scans), rng).realisation(0)
        clean = radial_speed_mps(
            rays,
            wind,
            draws,
            scans=scans,
            sampling=settings.sampling,
            field=air.field,
            std_mps=air.std_mps,
            shift_m=shift,
        )
        amplitudes = waves.amplitudes(rng)
        sight = WaveSight.of(rays, wind, waves, draws, scans=scans) if draws.any else planned
        clean += air.std_mps * sight.radial_speed(amplitudes)
        fit = retrieval.solve(rows, _measured(clean, sources, rays, (1, scans), rng)[0])
        found.append(fit.wind_mps[..., :2])
        met.append(reference_uv_mps(wind, air, shift, amplitudes, phase))
    return Simulation(
        wind,
        np.stack(found),
        np.stack(met),
        block=np.zeros(len(shifts_m), dtype=np.intp),
        condition=float(retrieval.condition(rows)),
    )


def reference_phase(wind: WindState, waves: Waves, averaging_s: float) -> ComplexArray:
    """Phase (sample, wave) of the waves at the target, `REFERENCE_INTERVAL_S` apart."""
    count = int(averaging_s / REFERENCE_INTERVAL_S)
    return passing(wind, waves, 0.5 * REFERENCE_INTERVAL_S, REFERENCE_INTERVAL_S, count)


def reference_uv_mps(
    wind: WindState, air: Air, shift_m: FloatArray, amplitudes: ComplexArray, phase: ComplexArray
) -> FloatArray:
    """Eastward and northward wind (sample, 2) of an instrument at the target [m/s]; `phase` from `reference_phase`."""
    times = np.asarray(REFERENCE_INTERVAL_S * (np.arange(len(phase)) + 0.5), dtype=float)
    met = reference_mps(wind, times, field=air.field, std_mps=air.std_mps, shift_m=shift_m)
    met = met + air.std_mps * met_waves(air.field.waves, amplitudes, phase)
    downwind = np.stack(uv_mps(1.0, wind.from_deg))
    left = np.array([-downwind[1], downwind[0]])
    return np.asarray(met[:, :1] * downwind + met[:, 1:2] * left)


def _tell(progress: Progress | None, share: float) -> None:
    if progress is not None:
        progress(share)
