"""Speed against accuracy, measured on this machine and this scene: what each cheaper way costs and saves.

Every row is one way of doing one thing: how long it took here, and how far it is from the reference of its kind, which is the
exact ellipsoid for geometry, the largest Monte Carlo run for error tiers, the finest probe for probe points and
double precision for number formats.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from time import perf_counter
from typing import Literal, TypeVar

import numpy as np
from numpy.typing import NDArray

from geometry.arrays import FloatArray
from geometry.beams import Beam, beam_to
from geometry.effects import model_error_m
from geometry.errors import InputError
from geometry.frames import EarthModel
from planner.fidelity_wind import Air
from planner.places import Places
from reconstruct.flight import Sampling
from reconstruct.monte_carlo import Settings, simulate
from reconstruct.prediction import ScanPrediction, predict_linear, predict_noise
from reconstruct.spectra import Turbulence
from reconstruct.turbulent import predict_turbulent
from reconstruct.verdict import Verdict, judge

Topic = Literal["geometry", "error tier", "probe points", "number format"]
TOPICS: tuple[Topic, ...] = ("geometry", "error tier", "probe points", "number format")

MODELS: tuple[EarthModel, ...] = ("flat-grid", "flat", "curved", "refracted", "exact")
BEAMS = 100_000  # enough that a call's overhead does not count
REPEATS = 5  # the fastest is quoted: what the machine can do when nothing disturbs it
REALISATIONS = (8, 32, 128)  # the last is the judge
PROBE_POINTS = (1, 3, 5, 9)
SCATTER_STEP_M = 5_000.0


@dataclass(frozen=True)
class Trade:
    """One way of doing one thing."""

    topic: Topic
    method: str
    time_s: float
    error: float | None  # against the reference; None for the reference itself
    unit: str
    standard_error: float | None = None  # of the reference, where it is drawn by chance
    note: str = ""


Progress = Callable[[float], None]
Real = TypeVar("Real", np.float32, np.float64)


def trades(
    places: Places, air: Air | None, *, rng: np.random.Generator, progress: Progress | None = None
) -> tuple[Trade, ...]:
    """Measure every trade on a site.

    Parameters
    ----------
    places
        The site with its exact frame.
    air
        Rays, wind and air of the scan to judge error tiers with; without it or its turbulence, tiers and probe points are
        left out: every tier is the linear one then.
    rng
        Source of the Monte Carlo's numbers.
    progress
        Gets the share of the work that is done.
    """
    found: list[Trade] = [*geometry_trades(places), *format_trades(places)]
    if air is not None and air.turbulence is not None:
        found += tier_trades(air, air.turbulence, rng=rng, progress=progress)
    return tuple(sorted(found, key=lambda trade: TOPICS.index(trade.topic)))


def geometry_trades(places: Places) -> Iterator[Trade]:
    """Time and error of each model of the Earth: beams from the first lidar to points around the targets."""
    head, points = _points(places)
    targets = np.asarray([places.site.target_position_m(target) for target in places.site.targets])
    for model in MODELS:
        time_s = _fastest(partial(_solve, places, head, points, model))
        # "refracted" is "curved" and the lift of a bent beam, and the lift is no error: the rest is left
        unbent: EarthModel = "curved" if model == "refracted" else model
        worst_m = float(np.max(model_error_m(places.frame, head, targets, unbent)))
        yield Trade(
            "geometry",
            model,
            time_s / BEAMS,
            None if model == "exact" else worst_m,
            "m",
            note="time of one beam; error at the worst target",
        )


def format_trades(places: Places) -> Iterator[Trade]:
    """Single against double precision: with coordinates as they come, and reduced to the site first."""
    head, points = _points(places)
    exact = points - head
    single_points, single_head = points.astype(np.float32), head.astype(np.float32)
    reduced = exact.astype(np.float32)
    ways: dict[str, tuple[Callable[[], object], FloatArray]] = {
        "float32, coordinates as they come": (
            lambda: _beams(single_points - single_head),
            (single_points - single_head).astype(np.float64),
        ),
        "float32, reduced to the site": (lambda: _beams(reduced), reduced.astype(np.float64)),
        "float64": (lambda: _beams(exact), exact),
    }
    for method, (work, kept) in ways.items():
        worst_m = float(np.max(np.linalg.norm(kept - exact, axis=-1)))
        error = None if method == "float64" else worst_m
        yield Trade("number format", method, _fastest(work) / BEAMS, error, "m", note="time of one flat beam")


def tier_trades(
    air: Air, eddies: Turbulence, *, rng: np.random.Generator, progress: Progress | None = None
) -> Iterator[Trade]:
    """Time of each error tier and its distance from the judge: the spread of one scan's speed, and its probe points."""
    periods = sum(REALISATIONS) + REALISATIONS[0] * len(PROBE_POINTS)
    done = 0
    runs = []
    for count in REALISATIONS:
        runs.append(
            _run(air, Settings(realisations=count), rng, _part(progress, done / periods, count / periods))
        )
        done += count
    truth = runs[-1][1].speed_std_mps
    for name, work in _closed_forms(air, eddies).items():
        spread = work().speed_std_mps
        error = None if spread is None else abs(spread - truth.value)
        yield Trade("error tier", name, _fastest(work), error, "m/s", truth.standard_error)
    for count, (time_s, verdict) in zip(REALISATIONS, runs, strict=True):
        error = None if count == REALISATIONS[-1] else abs(verdict.speed_std_mps.value - truth.value)
        method = f"monte-carlo, {count} periods"
        yield Trade("error tier", method, time_s, error, "m/s", verdict.speed_std_mps.standard_error)
    yield from _probe_trades(air, rng, _part(progress, done / periods, 1 - done / periods))


def _closed_forms(air: Air, eddies: Turbulence) -> dict[str, Callable[[], ScanPrediction]]:
    """The tiers that need no chance, by name."""
    state, sources = air.states[len(air.states) // 2], air.sources
    noise = np.array([each.radial_speed_mps for each in sources])[air.rays.lidar]
    return {
        "noise": partial(predict_noise, air.rays, state, noise),
        "linear": partial(predict_linear, air.rays, state, sources),
        "turbulent": partial(predict_turbulent, air.rays, state, eddies, sources),
    }


def _probe_trades(air: Air, rng: np.random.Generator, progress: Progress | None) -> Iterator[Trade]:
    """The same air with ever more points along each probe: one seed, so that only the probe differs."""
    seed = int(rng.integers(2**32))
    found = []
    for number, count in enumerate(PROBE_POINTS):
        settings = Settings(realisations=REALISATIONS[0], sampling=Sampling(probe_points=count))
        told = _part(progress, number / len(PROBE_POINTS), 1 / len(PROBE_POINTS))
        found.append(_run(air, settings, np.random.default_rng(seed), told))
    finest = found[-1][1].speed_std_mps.value
    for count, (time_s, verdict) in zip(PROBE_POINTS, found, strict=True):
        error = None if count == PROBE_POINTS[-1] else abs(verdict.speed_std_mps.value - finest)
        yield Trade("probe points", f"{count} a ray", time_s, error, "m/s")


def _run(
    air: Air, settings: Settings, rng: np.random.Generator, progress: Progress | None
) -> tuple[float, Verdict]:
    state = air.states[len(air.states) // 2]
    start = perf_counter()
    simulation = simulate(
        air.rays,
        state,
        rng=rng,
        sources=tuple(air.sources),
        turbulence=air.turbulence,
        settings=settings,
        progress=progress,
    )
    return perf_counter() - start, judge(simulation)


def _part(progress: Progress | None, start: float, share: float) -> Progress | None:
    """Progress of a part of the work, as the whole's."""
    return None if progress is None else lambda done: progress(min(start + share * done, 1.0))


def _solve(places: Places, head: FloatArray, points: FloatArray, model: EarthModel) -> Beam:
    return beam_to(places.frame.enu_m(head, points, model=model))


def _points(places: Places) -> tuple[FloatArray, FloatArray]:
    """The first lidar's head, and points in a box around the targets."""
    site = places.site
    if not site.lidars or not site.targets:
        raise InputError("the trade of geometry models needs at least one lidar and one target")
    rng = np.random.default_rng(1)
    middle = np.asarray(site.target_position_m(site.targets[0]))
    spread = rng.uniform(-1.0, 1.0, (BEAMS, 3)) * [SCATTER_STEP_M, SCATTER_STEP_M, 100.0]
    return np.asarray(site.lidars[0].position, dtype=np.float64), middle + spread


def _beams(offset: NDArray[Real]) -> tuple[NDArray[Real], ...]:
    """Azimuth, elevation and range [rad, m] in whatever precision comes."""
    east, north, up = offset.T
    level = np.sqrt(east * east + north * north)
    return np.arctan2(east, north), np.arctan2(up, level), np.sqrt(level * level + up * up)


def _fastest(work: Callable[[], object]) -> float:
    times = []
    for _ in range(REPEATS):
        start = perf_counter()
        work()
        times.append(perf_counter() - start)
    return min(times)
