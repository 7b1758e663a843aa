"""The turbulent tier against the Monte Carlo judge, which shares none of its mathematics: a small, seeded
version of tests/benchmarks/compare_judge.py, whose full table is in docs/tier_comparison.md.
"""

import importlib.util
from pathlib import Path

import numpy as np
import pytest

from reconstruct.field import MARGIN_LENGTHS
from reconstruct.spectra import Turbulence
from reconstruct.ten_minute import predict_ten_minute
from reconstruct.wind import WindState

BENCHMARKS = Path(__file__).parents[1] / "benchmarks"
FIELDS = 24
CELLS_PER_LENGTH = 5.0
AVERAGING_S = 300.0  # instead of ten minutes: half the box


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
        for row in module.compare(
            air, fields=FIELDS, seed=1, cells_per_length=CELLS_PER_LENGTH, averaging_s=AVERAGING_S
        )
    ]


def distance(row):
    """In standard errors: that of a scatter is proportional to it, so a low one by chance looks too sure of itself."""
    scatter = row.name.startswith("var") or "std" in row.name
    return row.errors * min(1.0, row.judge / row.tier) if scatter else row.errors


def test_tier_is_within_three_standard_errors_or_two_per_cent_of_the_judge_on_twelve_scenes(rows):
    """Of 96 numbers 0.6 are expected outside by chance alone: with 24 fields the distance in standard errors is
    a Student t of 23 degrees of freedom. Three or more outside (2 %), or one beyond 5, would be no chance."""
    assert len({row.scene for row in rows}) == 12
    outside = [row for row in rows if not row.agrees]
    assert len(outside) < 3, outside
    assert all(abs(distance(row)) < 5 for row in outside), outside


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


@pytest.mark.parametrize("model", ["von-karman", "mann"])
def test_box_and_waves_of_the_judge_keep_what_a_wide_scan_and_ten_minutes_average(model):
    """Exact sums over the waves of the box, and integrals over the rest of the spectrum."""
    box, air, wind = benchmark("box_waves"), Turbulence(0.09, 170.0, model), WindState(8.0, 192.0)
    box.DRAWN = 40_000
    rays = box.hovsore()
    assert box.along_axis(rays, wind, air, MARGIN_LENGTHS).share == pytest.approx(1.0, abs=0.015)
    ten = box.ten_minutes(rays, wind, air, MARGIN_LENGTHS)
    assert ten.share == pytest.approx(1.0, abs=0.015)
    predicted = float(predict_ten_minute(rays, wind, air).direction_std_deg)
    assert np.degrees(air.intensity * np.sqrt(ten.whole)) == pytest.approx(predicted, rel=0.02)
