"""Discs that cover wanted points: as few as possible, and really covering."""

import tracemalloc
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from geometry.errors import InputError
from planner.cover import fewest_discs
from planner.files.yaml_site import load_site

SCOTLAND = Path(__file__).resolve().parents[2] / "examples" / "scotland" / "site.yaml"


def one_disc_covers(points: np.ndarray, radius: float) -> bool:
    """Whether some disc covers all points: tried with every centre on a fine raster around them."""
    low, high = points.min(axis=0), points.max(axis=0)
    grid = np.stack(
        np.meshgrid(*(np.linspace(a, b, 161) for a, b in zip(low, high, strict=True))), axis=-1
    ).reshape(-1, 2)
    return bool(np.linalg.norm(grid[:, None] - points[None], axis=2).max(axis=1).min() <= radius)


def fewest_by_trial(points: np.ndarray, radius: float) -> int:
    """Fewest discs by trying every set of groups, biggest first: for a handful of points."""
    everything = range(len(points))
    groups = [
        frozenset(group)
        for size in range(1, len(points) + 1)
        for group in combinations(everything, size)
        if one_disc_covers(points[list(group)], radius)
    ]
    groups = [group for group in groups if not any(group < other for other in groups)]
    for count in range(1, len(points) + 1):
        if any(len(frozenset().union(*chosen)) == len(points) for chosen in combinations(groups, count)):
            return count
    raise AssertionError


@pytest.mark.parametrize("seed", range(1, 4))
def test_few_points_take_as_many_discs_as_trial_of_every_grouping_finds(seed: int) -> None:
    points = np.random.default_rng(seed).uniform(0, 1000, (6, 2))
    cover = fewest_discs(points, 260.0)
    assert (len(cover.centre_m), cover.gap) == (fewest_by_trial(points, 260.0), 0)


def test_scotland_is_covered_by_four_discs_of_500_m() -> None:
    """An earlier planner took 5 for the same points."""
    points = [target.position for target in load_site(SCOTLAND).targets]
    cover = fewest_discs(points, 500.0)
    assert (len(cover.centre_m), cover.gap) == (4, 0)


@settings(max_examples=25, derandomize=True, deadline=None)
@given(
    st.lists(st.tuples(st.integers(-50, 50), st.integers(-50, 50)), min_size=1, max_size=12),
    st.integers(1, 60),
)
def test_every_point_lies_in_its_disc_and_the_bound_holds(points: list[tuple[int, int]], radius: int) -> None:
    """Also for points in one place, in a line and exactly two radii apart, by either way of solving."""
    near = np.array(points, dtype=float)
    exact, improved = fewest_discs(near, radius), fewest_discs(near, radius, exact_points=0)
    assert exact.gap == 0
    for cover in (exact, improved):
        apart = np.linalg.norm(near - cover.centre_m[cover.disc], axis=1)
        assert np.all(apart <= cover.reach_m[cover.disc] * (1 + 1e-9) + 1e-9)
        assert np.all(cover.reach_m <= radius * (1 + 1e-8))
        assert set(cover.disc) == set(range(len(cover.centre_m)))
        assert cover.at_least <= len(exact.centre_m) <= len(cover.centre_m)


def test_a_cover_of_150_points_is_proven_or_nearly_so_in_little_memory() -> None:
    points = np.random.default_rng(3).uniform(0, 5000, (150, 2))
    fewest_discs(points[:3], 500.0)  # imports
    tracemalloc.start()
    cover = fewest_discs(points, 500.0)
    peak_mb = tracemalloc.get_traced_memory()[1] / 1e6
    tracemalloc.stop()
    assert cover.gap <= 1
    assert peak_mb < 100


def test_a_million_metres_of_easting_lose_nothing() -> None:
    """UTM coordinates: the smallest circle through three corners of a right-angled triangle."""
    corners = np.add([[0.0, 0.0], [30.0, 0.0], [0.0, 40.0]], [500_000.0, 6_250_000.0])
    cover = fewest_discs(corners, 25.0)
    assert cover.centre_m.tolist() == [[500_015.0, 6_250_020.0]]
    assert abs(cover.reach_m[0] - 25.0) < 1e-9


@pytest.mark.parametrize(
    ("points", "radius", "told"),
    [
        ([], 1.0, "allowed: 1 to 400"),
        ([[1.0, np.nan]], 1.0, "no finite number"),
        ([[1.0, 2.0]], 0.0, "positive number of metres"),
        ([[1.0, 2.0]], np.inf, "positive number of metres"),
    ],
)
def test_bad_input_is_told(points: list[list[float]], radius: float, told: str) -> None:
    with pytest.raises(InputError, match=told):
        fewest_discs(points, radius)
