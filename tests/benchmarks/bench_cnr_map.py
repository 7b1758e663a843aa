"""Time CNR maps: a plan of a window, and the evaluation of 100 x 100 rays with 200 gates.

Run from the project's root: ``python -m tests.benchmarks.bench_cnr_map``. Prints wall and processor time of each case
and, beside it, how many times the yardstick that is: the exponential of every sample and one product with a matrix of
gates, which no evaluation can do without. The yardstick runs in between, so that the ratio holds on a busy machine too.
The exit code is 1 where a ratio or, on an idle machine, a time is passed.
"""

import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from geometry.beams import point_at
from geometry.gates import Probe
from planner.cnr_map import plan_map
from planner.files.yaml_site import load_site
from planner.places import Places
from reconstruct.cnr_simulation import simulate_cnr_map
from reconstruct.hard_target import find_target

ROOT = Path(__file__).resolve().parents[2]
REPEATS = 5


def fastest_s(work: Callable[[], object]) -> tuple[float, float]:
    """Least wall time and least processor time of several calls [s]."""
    times = []
    for _ in range(REPEATS):
        wall, processor = time.perf_counter(), time.process_time()
        work()
        times.append((time.perf_counter() - wall, time.process_time() - processor))
    walls, processors = zip(*times, strict=True)
    return min(walls), min(processors)


def main() -> int:
    """Print the table; 1 if a limit is passed."""
    places = Places(load_site(ROOT / "examples" / "hovsore" / "site.yaml"))
    probe = Probe(pulse_ns=200, window_ns=256)
    aside = np.linspace(-0.2, 0.2, 100)
    azimuth, elevation = (each.ravel() for each in np.meshgrid(192 + aside, 6 + aside))
    cnr_map = simulate_cnr_map(
        azimuth,
        elevation,
        np.arange(1050.0, 1250.0),
        target_m=point_at(192.01, 6.02, 1150.0),
        shape="tip",
        size_m=1.0,
        probe=probe,
        rng=np.random.default_rng(1),
    )
    filters = probe.weight(cnr_map.range_m[:, None] - cnr_map.range_m[None, :])
    cases: tuple[tuple[str, float, float, Callable[[], object]], ...] = (
        ("window planned", 0.2, 0.5, lambda: plan_map(places, "WS_S", "mast")),
        (
            "100 x 100 x 200 evaluated",
            0.5,
            8.0,
            lambda: find_target(cnr_map, shape="tip", size_m=1.0, probe=probe),
        ),
    )
    failed = False
    for name, limit_s, most, work in cases:
        wall, processor = fastest_s(work)
        _, yardstick = fastest_s(lambda: np.exp(0.23 * cnr_map.cnr_db) @ filters)
        ratio = processor / yardstick
        failed |= wall > limit_s or ratio > most
        print(
            f"{name:<28} {wall:7.3f} s, processor {processor:.3f} s (limit {limit_s:g}); {ratio:5.2f} yardsticks of "
            f"{yardstick:.3f} s (limit {most:g})"
        )
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
