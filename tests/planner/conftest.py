"""The two examples planned once, and a small site to change one thing of."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from planner.files.yaml_site import load_site
from planner.plan import Plan
from planner.site import Site

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"

# Every limit is known, and none is near.
INSTRUMENT: dict[str, Any] = {
    "name": "test lidar",
    "pulses": [{"pulse_ns": 200, "pulse_repetition_hz": 20000, "fft_points": 64}],
    "head": {
        "azimuth_speed_deg_per_s": 50,
        "elevation_speed_deg_per_s": 50,
        "azimuth_acceleration_deg_per_s2": 100,
        "elevation_acceleration_deg_per_s2": 100,
        "elevation_min_deg": -10,
        "elevation_max_deg": 190,
    },
    "max_gates": 500,
    "min_range_m": 50,
    "max_range_m": 6000,
    "min_accumulation_s": 0.1,
    "radial_speed_limit_mps": 30,
}
LIDAR_A: dict[str, Any] = {"name": "A", "position": [500000, 6250000, 10], "instrument": INSTRUMENT}
LIDAR_B: dict[str, Any] = {"name": "B", "position": [501000, 6251000, 10], "instrument": INSTRUMENT}
STARE_A: dict[str, Any] = {"name": "a", "lidar": "A", "target": "T", "type": "stare", "accumulation_s": 0.5}
STARE_B: dict[str, Any] = {"name": "b", "lidar": "B", "target": "T", "type": "stare", "accumulation_s": 0.5}
SECTOR: dict[str, Any] = {
    **{"name": "s", "lidar": "A", "target": "T", "type": "sector"},
    **{"sector_deg": 60, "step_deg": 2, "accumulation_s": 0.4},
}

# On the central meridian, where grid north is true north: A 1 km south of the target, B 1 km east of it, both
# 100 m below it. On the ground 1 km of the grid is 1000.4 m, so the range is 1005.4 m.
SITE: dict[str, Any] = {
    "name": "Moor",
    "crs": "EPSG:32632",
    "ground_height_m": 10,
    "lidars": [LIDAR_A, LIDAR_B],
    "targets": [{"name": "T", "position": [500000, 6251000, 110]}],
    "scans": [STARE_A, STARE_B],
    "pairs": [{"name": "dual", "scans": ["a", "b"], "target": "T"}],
}


def plan_with(**changes: Any) -> Plan:
    return Plan(Site.model_validate({**SITE, **changes}))


@pytest.fixture
def moor() -> Callable[..., Plan]:
    """A plan of the small site with some of its keys replaced."""
    return plan_with


@pytest.fixture(scope="session")
def hovsore() -> Plan:
    return Plan(load_site(EXAMPLES / "hovsore" / "site.yaml"))


@pytest.fixture(scope="session")
def kassel() -> Plan:
    return Plan(load_site(EXAMPLES / "kassel" / "site.yaml"))
