"""The turbulent tier against the Monte Carlo judge, which shares none of its mathematics: a small, seeded
version of tests/benchmarks/compare_judge.py, whose full table is in docs/tier_comparison.md.
"""

import importlib.util
from pathlib import Path

import numpy as np
import pytest

from reconstruct.spectra import Turbulence
from reconstruct.ten_minute import predict_ten_minute
from reconstruct.wind import WindState

BENCHMARKS = Path(__file__).parents[1] / "benchmarks"
FIELDS = 24
CELLS_PER_LENGTH = 5.0


def benchmark(name):
    """A script of tests/benchmarks as a module."""
    spec = importlib.util.spec_from_file_location(name, BENCHMARKS / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def rows():
    """Eight numbers of each of twelve scenes."""
    module = benchmark("compare_judge")
    airs = [module.AIRS[index] for index in (0, 2, 3)]
    return [
        row
        for air in airs
        for row in module.compare(air, fields=FIELDS, seed=1, cells_per_length=CELLS_PER_LENGTH)
    ]


def test_tier_is_within_three_standard_errors_or_two_per_cent_of_the_judge_on_twelve_scenes(rows):
    assert len({row.scene for row in rows}) == 12
    assert [row for row in rows if not row.agrees] == []


def test_standard_errors_of_the_judge_are_those_of_its_distance_to_the_tier(rows):
    """Root mean square of the distances 1 standard error: neither too wide to tell nor too narrow."""
    errors = np.array([row.errors for row in rows])
    assert 0.6 < np.sqrt(np.mean(errors**2)) < 1.4
    assert abs(np.mean(errors)) < 0.6  # numbers of one air hang together


def test_comparison_would_notice_turbulence_that_is_a_quarter_stronger(rows):
    """Variance of one scan half as large again: most scenes would fail."""
    noticed = [
        not row._replace(tier=1.5 * row.tier).agrees
        for row in rows
        if row.name in ("var across", "var along")
    ]
    assert np.mean(noticed) > 0.8


def test_box_of_the_judge_keeps_the_ten_minute_scatter_of_a_wide_scan():
    """Exact sum over the waves of a box seven lengths larger than what is met, against one of fourteen and
    against the closed form: the longest lateral waves are missing in lidar and target alike."""
    box, air, wind = benchmark("box_waves"), Turbulence(0.09, 170.0), WindState(8.0, 192.0)
    rays = box.hovsore()
    seven, fourteen = (box.scatter(rays, wind, air, margin) for margin in (7, 14))
    assert seven.difference == pytest.approx(fourteen.difference, rel=0.005)
    assert seven.difference == pytest.approx(
        float(predict_ten_minute(rays, wind, air).direction_std_deg), rel=0.01
    )
    assert 0.02 < 1 - seven.target / fourteen.target < 0.06  # the mean of the target alone does lose some
