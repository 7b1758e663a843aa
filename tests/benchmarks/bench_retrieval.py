"""Speed of the retrieval core and of the two-lidar map, as ratios to plain numpy operations in the same run.

Run: python -m tests.benchmarks.bench_retrieval, or python tests/benchmarks/bench_retrieval.py from the root.
"""

import sys
import time
import tracemalloc
from collections.abc import Callable
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2]))

from reconstruct.lidar_map import pair_map
from reconstruct.retrieval import rows, solve
from reconstruct.uncertainty import ErrorSources
from reconstruct.wind import WindState

SCANS, RAYS, GATES = 50_000, 30, 41
MAP_LIMIT_S = 1.4 / 15  # fifteen times faster than an existing tool, which takes 1.4 s and 1.15 GB


def best_s(work: Callable[[], object], repeats: int = 3) -> float:
    """Shortest of several runs [s]."""
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        work()
        times.append(time.perf_counter() - start)
    return min(times)


def bench_week() -> None:
    """Seven days of one lidar: complete, and with a tenth of the rays missing."""
    rng = np.random.default_rng(1)
    azimuth = np.arange(RAYS) * 2.0
    matrix = rows(azimuth, 5.0)
    speed = rng.standard_normal((SCANS, GATES, RAYS))
    copy_s = best_s(speed.copy)
    print(f"copy of {speed.nbytes / 1e6:.0f} MB: {copy_s:.3f} s")
    complete_s = best_s(lambda: solve(matrix, speed))
    print(f"complete: {complete_s:.3f} s, {complete_s / copy_s:.1f} x copy (limit 4)")
    for gate in range(GATES):
        speed[:, gate][rng.random((SCANS, RAYS)) < 0.1] = np.nan
    missing_s = best_s(lambda: solve(matrix, speed), 2)
    print(f"a tenth of the rays missing: {missing_s:.3f} s, {missing_s / copy_s:.1f} x copy (limit 20)")
    tracemalloc.start()
    solve(matrix, speed)
    print(f"memory beyond the input: {tracemalloc.get_traced_memory()[1] / 1e6:.0f} MB")
    tracemalloc.stop()


def bench_map() -> None:
    """Linear tier for two lidars on a map of 1001 x 1001 targets."""
    angle = np.random.default_rng(1).uniform(0, 2 * np.pi, 1001 * 1001)
    sine_s = best_s(lambda: np.sin(angle), 5)
    root_s = best_s(lambda: np.sqrt(angle), 5)
    heads = np.array([[0.0, 0.0, 0.0], [1000.0, 1000.0, 0.0]])
    east, north = np.linspace(-3000, 3000, 1001)[:, None], np.linspace(-3000, 3000, 1001)
    wind = WindState(speed_mps=10.0, from_deg=0.0, shear_exponent=0.2, height_m=100.0)
    errors = ErrorSources(radial_speed_mps=0.1, azimuth_deg=0.1, elevation_deg=0.1, range_m=1.0)
    map_s = best_s(lambda: pair_map(heads, east, north, 100.0, wind, errors), 5)
    print(
        f"map of 1001 x 1001: {map_s:.3f} s (limit {MAP_LIMIT_S:.3f}), {map_s / sine_s:.1f} x numpy.sin "
        f"({sine_s * 1e3:.1f} ms), {map_s / root_s:.0f} x numpy.sqrt ({root_s * 1e3:.1f} ms) of as many numbers"
    )
    tracemalloc.start()
    pair_map(heads, east, north, 100.0, wind, errors)
    print(f"memory (limit 200 MB): {tracemalloc.get_traced_memory()[1] / 1e6:.0f} MB")
    tracemalloc.stop()


if __name__ == "__main__":
    bench_week()
    bench_map()
