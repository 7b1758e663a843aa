"""The uncertainty budget of ten-minute means: noise against its closed form, shares that add up, what is unknown named."""

import math
from pathlib import Path

import numpy as np
import pytest

from planner.files.yaml_site import load_site
from planner.plan import Plan

HOVSORE = Path(__file__).parents[2] / "examples" / "hovsore" / "site.yaml"


@pytest.fixture(scope="module")
def budget():
    return Plan(load_site(HOVSORE)).budgets[0]


def entry(budget, source):
    return next(item for item in budget.entries if item.source == source)


def test_noise_of_fifty_scans_is_the_closed_form_of_a_sector_scan(budget):
    """30 rays of 2 degrees, 0.2 m/s: along and across the axis after physics' sector formula, turned to the wind."""
    count, step, elevation = 30, math.radians(2), math.radians(5.94)
    s = math.sin(count * step) / (count * math.sin(step))
    along, across = (0.2 / math.cos(elevation) * math.sqrt(2 / (count * (1 + sign * s))) for sign in (1, -1))
    off = math.radians(budget.wind.from_deg - 191.687)
    speed = math.hypot(along * math.cos(off), across * math.sin(off)) / math.sqrt(50)
    side = math.hypot(along * math.sin(off), across * math.cos(off)) / math.sqrt(50)
    noise = entry(budget, "noise of the radial speed")
    assert noise.speed_std_mps == pytest.approx(speed, rel=0.01)
    assert noise.direction_std_deg == pytest.approx(math.degrees(side / budget.wind.speed_mps), rel=0.01)


def test_heading_error_turns_the_direction_by_itself_and_no_scan_averages_it_away(budget):
    heading = entry(budget, "heading")
    assert heading.direction_std_deg == pytest.approx(0.05, rel=0.01)
    assert heading.speed_std_mps < 1e-4


def test_shares_add_up_and_k_two_is_twice_k_one(budget):
    known = [item for item in budget.entries[:-1] if item.speed_share is not None]
    assert sum(item.speed_share for item in known) == pytest.approx(1.0)
    assert all(item.speed_share >= 0 and item.direction_share >= -1e-12 for item in known)
    total = budget.entries[-1]
    assert total.source == "total"
    assert total.expanded() == (2 * total.speed_std_mps, 2 * total.direction_std_deg)
    assert total.speed_std_mps == pytest.approx(math.sqrt(sum(item.speed_std_mps**2 for item in known)))


def test_a_reference_that_is_not_declared_is_named_and_one_that_is_counts():
    site = load_site(HOVSORE)
    unknown = entry(Plan(site).budgets[0], "reference instrument")
    assert unknown.speed_std_mps is None
    assert "speed_uncertainty_mps" in unknown.reason
    mast = site.masts[0].model_copy(update={"speed_uncertainty_mps": 0.1, "direction_uncertainty_deg": 1.0})
    declared = Plan(site.model_copy(update={"masts": (mast,)})).budgets[0]
    assert entry(declared, "reference instrument").speed_std_mps == pytest.approx(0.1)
    assert np.isfinite(declared.entries[-1].speed_std_mps)


def test_clock_adds_what_the_air_changes_in_its_error():
    """A single lidar 5 s off: small beside the turbulence between scan and target, and more at 10 s."""
    site = load_site(HOVSORE)

    def off_s(seconds):
        lidars = [
            lidar.model_copy(
                update={"uncertainty": lidar.uncertainty.model_copy(update={"clock_s": seconds})}
            )
            for lidar in site.lidars
        ]
        return Plan(site.model_copy(update={"lidars": tuple(lidars)})).budgets[0]

    assert all("clock" not in item.source for item in off_s(0.0).entries)
    one, other = (entry(off_s(seconds), "clock of the lidar") for seconds in (5.0, 10.0))
    assert 0 < one.speed_share < other.speed_share < 0.2
