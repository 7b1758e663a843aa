"""Time tours and covers: the Scotland case, 88 and 150 random points.

Run from the project's root: ``python -m tests.benchmarks.bench_trajectory``. Prints one line a case with its
limit, which was set for an idle machine; the exit code is 1 where one is passed.
"""

import sys
import time
from collections.abc import Callable
from pathlib import Path
from resource import RUSAGE_SELF, getrusage

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from planner.cover import fewest_discs
from planner.files.yaml_site import load_site
from planner.places import Places
from planner.scan_making import head_limits
from planner.site_tour import SiteTour, Stops, site_tour
from planner.trajectory import Tour, plan_tour

ROOT = Path(__file__).resolve().parents[2]
REPEATS = 5


def fastest_s(work: Callable[[], object], clock: Callable[[], float] = time.perf_counter) -> float:
    """Least time of several calls by a clock [s]."""
    times = []
    for _ in range(REPEATS):
        start = clock()
        work()
        times.append(clock() - start)
    return min(times)


def tour_of(found: SiteTour) -> Tour:
    """Order and timing from the head angles."""
    return plan_tour(*found.head_deg, [head_limits(lidar) for lidar in found.lidars])


def main() -> int:
    """Print the table; 1 if a limit is passed."""
    places = Places(load_site(ROOT / "examples" / "scotland" / "site.yaml"))
    scotland = site_tour(places)
    rng = np.random.default_rng(1)
    many = rng.uniform([535000, 6182700, 320], [536500, 6184700, 380], (88, 3))
    stops = Stops(tuple(f"{number}" for number in range(88)), tuple(map(tuple, many)))
    random = SiteTour(places, scotland.lidars, stops)
    points = np.array(scotland.stops.positions)
    wide = rng.uniform(0, 5000, (150, 2))
    cases: tuple[tuple[str, float, Callable[[], object]], ...] = (
        (f"tour, Scotland: {tour_of(scotland).cycle_ms} ms", 0.1, lambda: tour_of(scotland)),
        (f"tour, 88 points: {tour_of(random).cycle_ms} ms", 1.0, lambda: tour_of(random)),
        (
            f"cover, Scotland: {len(fewest_discs(points, 500).centre_m)} discs",
            1.0,
            lambda: fewest_discs(points, 500),
        ),
        (f"cover, 150 points: gap {fewest_discs(wide, 500).gap}", 1.0, lambda: fewest_discs(wide, 500)),
    )
    square = rng.standard_normal((1000, 1000))
    plain = fastest_s(lambda: square @ square, time.process_time)
    print(f"plain numpy: a product of two matrices of 1000 x 1000 takes {1000 * plain:.0f} ms of a core")
    failed = False
    for name, limit, work in cases:
        seconds, busy = fastest_s(work), fastest_s(work, time.process_time)
        failed |= seconds > limit
        print(
            f"{name:<32} {seconds:7.3f} s (limit {limit:g}), {busy:.3f} s of a core, {busy / plain:.1f} plain products"
        )
    print(f"peak memory of the process: {getrusage(RUSAGE_SELF).ru_maxrss / 1024:.0f} MB")
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
