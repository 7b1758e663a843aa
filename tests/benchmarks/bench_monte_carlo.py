"""Speed and memory of the judge, as ratios to plain numpy operations in the same run.

Run: python tests/benchmarks/bench_monte_carlo.py from the root. With the argument `full` it also runs the
ten-minute means of a 60, 30 and 8 degree sector with many realisations and prints every number with its
standard error.
"""

import sys
import time
import tracemalloc
from collections.abc import Callable
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2]))

from geometry.beams import unit_vector
from geometry.gates import Probe
from reconstruct.field import synthesise
from reconstruct.flight import Sampling, reach_m
from reconstruct.monte_carlo import (
    Air,
    Scene,
    Settings,
    fly_through,
    simulate,
    simulate_scenes,
    spread_shifts_m,
)
from reconstruct.rays import Rays
from reconstruct.spectra import Turbulence
from reconstruct.uncertainty import ErrorSources
from reconstruct.verdict import Estimate, judge
from reconstruct.wind import WindState

AIR = Turbulence(intensity=0.09, length_m=170.0)
NOISE = ErrorSources(radial_speed_mps=0.1)
POINTING = ErrorSources(
    radial_speed_mps=0.1, azimuth_deg=0.1, elevation_deg=0.1, range_m=5.0, heading_deg=0.05
)


def best_s(work: Callable[[], object], repeats: int = 3) -> float:
    """Shortest of several runs [s]."""
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        work()
        times.append(time.perf_counter() - start)
    return min(times)


def sector(rays: int, of: int, *, axis_deg: float = 192.0, ray_s: float = 0.4, step_deg: float = 2.0) -> Rays:
    """Middle rays of a sector that sweeps to and fro every 12 s; its gates are 1155 m off and 120 m up."""
    index = np.arange(of)[(of - rays) // 2 :][:rays]
    elevation, distance = 5.96, 1155.0
    return Rays(
        azimuth_deg=axis_deg + (index - (of - 1) / 2) * step_deg,
        elevation_deg=np.full(rays, elevation),
        range_m=np.full(rays, distance),
        head_m=np.tile(-distance * unit_vector(axis_deg, elevation), (rays, 1)),
        lidar=np.zeros(rays, dtype=int),
        time_s=(index + 0.5) * ray_s,
        duration_s=np.full(rays, ray_s),
        swept_azimuth_deg=np.full(rays, step_deg),
        probes=(Probe(pulse_ns=200, window_ns=256),),
        period_s=12.0,
        back_and_forth=True,
    )


def bench_uniform() -> None:
    """10,000 scans of 60 rays in uniform flow; the limit is 100 ms."""
    rays, wind = sector(60, 60, ray_s=0.2, step_deg=1.0), WindState(speed_mps=8.0, from_deg=282.0)
    normal_s = best_s(lambda: np.random.default_rng(1).standard_normal(600_000), 5)
    print(f"600,000 normal numbers: {1e3 * normal_s:.1f} ms")
    for name, sources in (("noise", NOISE), ("noise and pointing", POINTING)):
        run = lambda sources=sources: simulate(  # noqa: E731
            rays, wind, rng=np.random.default_rng(1), sources=sources, settings=Settings(realisations=200)
        )
        found, took_s = run(), best_s(run, 5)
        judged_s = best_s(lambda found=found: judge(found))
        print(
            f"{name}, 10,000 scans: {1e3 * took_s:.0f} ms, {took_s / normal_s:.1f} x normal, "
            f"their statistics {1e3 * judged_s:.0f} ms"
        )


def bench_turbulent() -> None:
    """The field, then 10,000 scans of 60 rays of 5 points along the probe; the limit is 3 s after it."""
    scene = Scene(sector(60, 60, ray_s=0.2, step_deg=1.0), WindState(speed_mps=8.0, from_deg=282.0))
    extent = reach_m(scene.rays, scene.wind, 600.0)
    rng = np.random.default_rng(1)
    start = time.perf_counter()
    field = synthesise(AIR, extent, rng=rng)
    made_s = time.perf_counter() - start
    cells = field.cells[..., 0].copy()
    transform_s = best_s(lambda: np.fft.rfftn(cells), 1)
    print(
        f"field {field.cells.shape[:3]}, {field.cells.nbytes / 1e6:.0f} MB: {made_s:.2f} s, "
        f"{made_s / transform_s:.1f} x rfftn of one component"
    )
    tracemalloc.start()
    synthesise(AIR, extent, rng=rng)
    print(f"memory while it is made: {tracemalloc.get_traced_memory()[1] / 1e6:.0f} MB")
    tracemalloc.stop()
    air = Air(field, 0.72)
    sine_s = best_s(lambda: np.sin(np.linspace(0.0, 100.0, 3_000_000)), 3)
    settings = Settings(sampling=Sampling(probe_points=5, sweep_points=1))
    shifts = spread_shifts_m(field, 200, rng)
    took_s = best_s(lambda: fly_through(air, scene, shifts, rng=rng, sources=NOISE, settings=settings), 2)
    print(f"10,000 scans of 60 rays of 5 points: {took_s:.2f} s, {took_s / sine_s:.0f} x sine of 3 million")


def full_run(realisations: int = 256) -> None:
    """Ten-minute means of 60, 30 and 8 degrees, with wind along and across the sector's axis."""
    scenes = [
        Scene(sector(rays, 30), WindState(speed_mps=8.0, from_deg=direction))
        for direction in (192.0, 282.0)
        for rays in (30, 16, 5)
    ]
    start = time.perf_counter()
    found = simulate_scenes(
        scenes,
        rng=np.random.default_rng(2014),
        sources=NOISE,
        turbulence=AIR,
        settings=Settings(realisations=realisations),
    )
    print(f"{realisations} x 6 x ten minutes: {time.perf_counter() - start:.0f} s")
    for scene, simulation in zip(scenes, found, strict=True):
        print(f"{scene.rays.count} rays, wind {scene.wind.from_deg:g}")
        for name, value in vars(judge(simulation)).items():
            estimates = [value] if isinstance(value, Estimate) else value
            shown = [f"{estimate.value:9.4f} +- {estimate.standard_error:.4f}" for estimate in estimates]
            print(f"  {name:25}", *shown)


if __name__ == "__main__":
    bench_uniform()
    bench_turbulent()
    if "full" in sys.argv[1:]:
        full_run()
