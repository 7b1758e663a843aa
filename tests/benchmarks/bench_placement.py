"""Time of the search for places: the viewshed, and the best pair of 100 x 100 candidates for 20 targets.

Run: python -m tests.benchmarks.bench_placement, or python tests/benchmarks/bench_placement.py from the root.
"""

import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2]))

from geometry.terrain import HeightRaster
from geometry.viewshed import viewshed
from planner.files.yaml_site import parse_site
from planner.placement.maps import default_grid
from planner.placement.ranking import place
from planner.placement.task import Task, task_of

TARGETS = 20

SITE = """
name: twenty points
crs: EPSG:32632
ground_height_m: 10
lidars:
  - {name: one, position: [448000, 6255000, 12], instrument: windscanner-200s}
  - {name: two, position: [449000, 6256000, 12], instrument: windscanner-200s}
turbines:
  - {name: A, position: [447600, 6255600, 10], hub_height_m: 90, rotor_diameter_m: 110}
  - {name: B, position: [448300, 6255900, 10], hub_height_m: 90, rotor_diameter_m: 110}
targets:
"""


def site_text(targets: int = TARGETS) -> str:
    """A site with points spread over 2 km."""
    rng = np.random.default_rng(20)
    spots = rng.uniform([447000.0, 6255000.0], [449000.0, 6257000.0], (targets, 2)).round(1)
    lines = [f"  - {{name: p{i}, position: [{e}, {n}, 110.0]}}" for i, (e, n) in enumerate(spots.tolist())]
    return SITE + "\n".join(lines)


def pair_task(targets: int = TARGETS) -> Task:
    """Two lidars to be placed for all points."""
    return task_of(parse_site(site_text(targets)), count=2, fixed=())


def bench_viewshed() -> None:
    """1000 x 1000 cells from one target."""
    rows, columns = np.mgrid[:1000, :1000]
    hills = (
        300.0
        + 60.0 * np.sin(rows / 40.0) * np.cos(columns / 55.0)
        + 15.0 * np.sin(rows / 7.0 + columns / 9.0)
    )
    raster = HeightRaster(hills, 0.0, 20_000.0, 20.0, 20.0, "above_sea_level")
    wall, busy = time.perf_counter(), time.process_time()
    seen = viewshed(raster, [9000.0, 11_000.0, 480.0])
    wall, busy = time.perf_counter() - wall, time.process_time() - busy
    print(
        f"viewshed 1000 x 1000: {wall:.2f} s (limit 1), {busy:.2f} s of a core, {np.mean(seen <= 3.0):.0%} seen"
    )


def bench_pair() -> None:
    """The whole search, criteria, table, every pair and refinement."""
    task = pair_task()
    wall, busy = time.perf_counter(), time.process_time()
    found = place(task, default_grid(task))
    wall, busy = time.perf_counter() - wall, time.process_time() - busy
    print(
        f"best pair, 100 x 100 candidates, {TARGETS} targets: {wall:.1f} s (limit 20), {busy:.1f} s of this process"
    )
    for item in found.ranked:
        print(f"  {item.rank}. {item.text}")


if __name__ == "__main__":
    bench_viewshed()
    bench_pair()
