"""Time of the turbulent tier, beside a plain numpy operation of the same size in the same run.

Run from the root of the project: python tests/benchmarks/bench_turbulent.py
"""

import importlib.util
import sys
import time
from collections.abc import Callable
from itertools import count
from pathlib import Path

import numpy as np

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT))

from reconstruct.spectra import Turbulence  # noqa: E402
from reconstruct.turbulent import predict_turbulent, turbulence_covariance  # noqa: E402
from reconstruct.wind import WindState  # noqa: E402


def comparison():
    """The script of the Høvsøre example."""
    path = ROOT / "examples" / "hovsore" / "compare_published.py"
    spec = importlib.util.spec_from_file_location("compare_published", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def best_s(task: Callable[[], object], repeats: int) -> float:
    """Least processor time of some runs [s]."""
    times = []
    for _ in range(repeats):
        start = time.process_time()
        task()
        times.append(time.process_time() - start)
    return min(times)


def main() -> None:
    """Print one line for each size of problem."""
    hovsore = comparison()
    rays, wind, air = hovsore.scan(), WindState(8.0, 190.0), Turbulence(0.09, 170.0)
    start = time.process_time()
    turbulence_covariance(rays, wind, air)
    print(f"tables of the von Kármán correlation and first use: {1e3 * (time.process_time() - start):.0f} ms")
    # what a speed knows is kept, so that each run gets a new one
    speeds = (8.0 + 1e-6 * number for number in count())
    plain = np.random.default_rng(1).random(2**20)
    power = best_s(lambda: np.exp(plain), 10)
    print(f"numpy exp of 2^20 numbers: {1e3 * power:.2f} ms")
    for name, task, repeats, limit_s in (
        ("one sector, one state, covariance", lambda: turbulence_covariance(rays, wind, air), 200, 2e-3),
        (
            "one sector, one state, whole prediction",
            lambda: predict_turbulent(rays, WindState(next(speeds), 190.0), air),
            200,
            2e-3,
        ),
        ("Høvsøre: 9 sizes, 10 minutes, 40 states", hovsore.curve, 3, 3.0),
    ):
        used = best_s(task, repeats)
        print(f"{name}: {1e3 * used:.2f} ms, {used / power:.2f} of that exp; limit {1e3 * limit_s:.0f} ms")


if __name__ == "__main__":
    main()
