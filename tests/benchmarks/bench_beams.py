"""Time a million beam solutions in units of a million sines, and the memory they take.

Run from the project's root: ``python -m tests.benchmarks.bench_beams`` or ``python
tests/benchmarks/bench_beams.py``. Prints one line a case: the ratio to ``numpy.sin`` of as many float64,
uniform on 0 to 2π, timed in the same run, and the limit. The exit code is 1 where a limit is passed.
"""

import resource
import statistics
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from geometry.arrays import FloatArray
from geometry.beams import beam_to, point_at
from geometry.frames import EarthModel, SiteFrame

COUNT = 1_000_000
REPEATS = 7
HEAD_M = np.array([447450.548, 6256541.135, 4.054])
LIMITS: dict[EarthModel, float] = {"flat": 4.0, "exact": 30.0}
MEMORY_LIMIT_MB = 1000.0


def seconds_of(work: Callable[[], object]) -> float:
    """Wall time of one call [s]."""
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def ratio_to_sine(work: Callable[[], object], angle: FloatArray) -> float:
    """Time of a piece of work in sines, timed in turns: the median, so that a busy moment is left out."""
    ratios = [seconds_of(work) / seconds_of(lambda: np.sin(angle)) for _ in range(REPEATS)]
    return statistics.median(ratios)


def main() -> int:
    """Print the table of ratios; 1 if a limit is passed."""
    rng = np.random.default_rng(20140430)
    angle = rng.uniform(0.0, 2.0 * np.pi, COUNT)
    points = HEAD_M + rng.uniform([-6000.0, -6000.0, 0.0], [6000.0, 6000.0, 500.0], (COUNT, 3))
    frame = SiteFrame("EPSG:32632")
    np.sin(angle)
    print(f"numpy.sin of {COUNT} float64: {seconds_of(lambda: np.sin(angle)) * 1e3:.1f} ms")

    def solve(model: EarthModel) -> Callable[[], object]:
        return lambda: beam_to(frame.enu_m(HEAD_M, points, model=model))

    failed = False
    models: tuple[EarthModel, ...] = ("flat-grid", "flat", "curved", "refracted", "exact")
    for model in models:
        ratio = ratio_to_sine(solve(model), angle)
        limit = LIMITS.get(model)
        failed |= limit is not None and ratio > limit
        print(f"{model:>10}: {ratio:6.2f} sines" + (f" (limit {limit:g})" if limit else ""))
    local = points - HEAD_M
    beam = beam_to(local)
    print(f"   beam_to: {ratio_to_sine(lambda: beam_to(local), angle):6.2f} sines")
    print(f"  point_at: {ratio_to_sine(lambda: point_at(*beam), angle):6.2f} sines")
    peak_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
    print(f"peak memory of the process: {peak_mb:.0f} MB (limit {MEMORY_LIMIT_MB:g})")
    return int(failed or peak_mb > MEMORY_LIMIT_MB)


if __name__ == "__main__":
    sys.exit(main())
