"""Time of the search for places: the viewshed, and the best pair of 100 x 100 candidates for 20 targets; and how near the
best of the search comes to that of every pair.

Run: python -m tests.benchmarks.bench_placement, or python tests/benchmarks/bench_placement.py from the root.
"""

import sys
import time
from collections.abc import Callable
from itertools import combinations
from pathlib import Path
from resource import RUSAGE_CHILDREN, RUSAGE_SELF, getrusage
from typing import TypeVar

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2]))

from geometry.terrain import HeightRaster
from geometry.viewshed import viewshed
from planner.files.yaml_site import parse_site
from planner.placement.maps import default_grid, look, standing_m
from planner.placement.numbers import numbers_of
from planner.placement.ranking import place
from planner.placement.task import Task, task_of

TARGETS = 20
T = TypeVar("T")

SITE = """
name: twenty points
crs: EPSG:32632
ground_height_m: 10
lidars:
  - {name: one, position: [448000, 6255000, 12], instrument: windscanner-200s}
  - {name: two, position: [449000, 6256000, 12], instrument: windscanner-200s}
"""

ROTORS = """turbines:
  - {name: A, position: [447600, 6255600, 10], hub_height_m: 90, rotor_diameter_m: 110}
  - {name: B, position: [448300, 6255900, 10], hub_height_m: 90, rotor_diameter_m: 110}
"""


def site_text(targets: int = TARGETS, *, turbines: bool = True) -> str:
    """A site with points spread over 2 km; two turbines in the middle hide some of them from most places."""
    rng = np.random.default_rng(20)
    spots = rng.uniform([447000.0, 6255000.0], [449000.0, 6257000.0], (targets, 2)).round(1)
    lines = [f"  - {{name: p{i}, position: [{e}, {n}, 110.0]}}" for i, (e, n) in enumerate(spots.tolist())]
    return "\n".join([SITE + (ROTORS if turbines else "") + "targets:", *lines])


def pair_task(targets: int = TARGETS, *, turbines: bool = True) -> Task:
    """Two lidars to be placed for all points."""
    return task_of(parse_site(site_text(targets, turbines=turbines)), count=2, fixed=())


def plain_s(repeats: int = 5) -> float:
    """Least time of a plain numpy operation on this machine now: a product of two matrices of 1000 x 1000 [s]."""
    square = np.random.default_rng(0).standard_normal((1000, 1000))
    times = []
    for _ in range(repeats):
        start = time.process_time()
        square @ square
        times.append(time.process_time() - start)
    return min(times)


def timed(work: Callable[[], T]) -> tuple[T, float, float]:
    """A result, the wall time and the processors' time, that of child processes included, that it took [s]."""

    def spent() -> float:
        uses = [getrusage(who) for who in (RUSAGE_SELF, RUSAGE_CHILDREN)]
        return sum(use.ru_utime + use.ru_stime for use in uses)

    wall, busy = time.perf_counter(), spent()
    found = work()
    return found, time.perf_counter() - wall, spent() - busy


def told(name: str, wall_s: float, busy_s: float, limit_s: float, plain: float) -> bool:
    """Print a line; whether the limit is passed."""
    print(
        f"{name}: {wall_s:.2f} s (limit {limit_s:g}), {busy_s:.2f} s of a core, {busy_s / plain:.0f} plain products"
    )
    return wall_s > limit_s


def bench_viewshed(plain: float) -> bool:
    """1000 x 1000 cells from one target."""
    rows, columns = np.mgrid[:1000, :1000]
    hills = (
        300.0
        + 60.0 * np.sin(rows / 40.0) * np.cos(columns / 55.0)
        + 15.0 * np.sin(rows / 7.0 + columns / 9.0)
    )
    raster = HeightRaster(hills, 0.0, 20_000.0, 20.0, 20.0, "above_sea_level")
    seen, wall, busy = timed(lambda: viewshed(raster, [9000.0, 11_000.0, 480.0]))
    return told(f"viewshed 1000 x 1000, {np.mean(seen <= 3.0):.0%} seen", wall, busy, 1.0, plain)


def bench_pair(plain: float, *, turbines: bool) -> bool:
    """The whole search, criteria, table, every pair and refinement."""
    task = pair_task(turbines=turbines)
    grid = default_grid(task)
    found, wall, busy = timed(lambda: place(task, grid))
    allowed = int(found.seen.allowed.all(axis=0).sum())
    name = f"best pair, 100 x 100 candidates, {TARGETS} targets, {allowed} allowed at all of them"
    late = told(name, wall, busy, 20.0, plain)
    for item in found.ranked:
        print(f"  {item.rank}. {item.text}")
    return late


def bench_exhaustive(plain: float) -> bool:
    """A grid small enough for the retrieval core to judge every pair: how far the search's best is from theirs."""
    task = pair_task(targets=3, turbines=False)
    grid = default_grid(task, count=7)
    seen = look(task, standing_m(task, grid.places_m))
    kept = np.flatnonzero(seen.allowed.all(axis=0))
    looks = {index: look(task, seen.positions_m[[index]]) for index in kept}
    steep = np.sin(np.radians(task.limits.least_opening_deg))

    def value(first: int, second: int) -> float:
        crossing = np.abs(np.sin(np.radians(seen.azimuth_deg[:, first] - seen.azimuth_deg[:, second])))
        if crossing.min() < steep:
            return np.inf
        return numbers_of(task, [looks[first], looks[second]]).value(task.criterion, task.aggregate)

    least, wall, busy = timed(lambda: min(value(*pair) for pair in combinations(kept, 2)))
    found = place(task, grid, most=1).ranked[0].value
    pairs = len(kept) * (len(kept) - 1) // 2
    told(f"every one of {pairs} pairs through the retrieval core", wall, busy, np.inf, plain)
    print(
        f"  best of them {least:.6f} m/s, of the search {found:.6f} m/s: {found / least - 1:+.2%} (limit +1 %)"
    )
    return found > 1.01 * least


def main() -> int:
    """Print the table; 1 if a limit is passed."""
    plain = plain_s()
    print(
        f"plain numpy: a product of two matrices of 1000 x 1000 takes {plain * 1000:.0f} ms of this process"
    )
    late = [bench_viewshed(plain), bench_exhaustive(plain)]
    late += [bench_pair(plain, turbines=turbines) for turbines in (False, True)]
    return int(any(late))


if __name__ == "__main__":
    sys.exit(main())
