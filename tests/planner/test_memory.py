"""Memory of a retrieval from the store does not grow with the campaign: the small version of tests/benchmarks/bench_store.py."""

import importlib.util
import sys
from pathlib import Path
from types import ModuleType

import pytest

BENCHMARK = Path(__file__).parents[1] / "benchmarks" / "bench_store.py"
LIMIT_MB = 1000
RAYS, CHUNK = 20_000, 10_000
GROWTH_MB = 35  # measured: 9 and 13; where the stare is held whole, 51

pytestmark = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="reads /proc")


@pytest.fixture(scope="module")
def bench() -> ModuleType:
    spec = importlib.util.spec_from_file_location("bench_store", BENCHMARK)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules["bench_store"] = module
    spec.loader.exec_module(module)
    return module


def test_four_times_as_long_a_campaign_needs_no_more_memory(bench: ModuleType, tmp_path: Path) -> None:
    """A sector scan, and a stare, which is one sweep without an end; all in one process, the largest so far counts."""
    paths = [
        bench.write_campaign(tmp_path / f"{kind}{times}", kind, times * RAYS, gates=3, chunk_rays=CHUNK)
        for kind in ("sector", "stare")
        for times in (1, 4)
    ]
    sector, longer_sector, stare, longer_stare = (each.peak_mb for each in bench.retrievals(*paths))
    assert longer_stare < LIMIT_MB
    assert longer_sector - sector < GROWTH_MB
    assert longer_stare - stare < GROWTH_MB
