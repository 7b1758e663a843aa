"""Levelling over the sea: the published ranges, the published formula, and a tilt that comes back."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from geometry.errors import InputError
from geometry.head import Mounting
from reconstruct.sea_level import level_from_sea, sea_range_m


def test_the_published_ranges_to_the_sea_are_met() -> None:
    """Pitch .1° nose down, height 25 m, elevation -3°: 462.29, 477.68, 494.14 m at 0, 90, 180°."""
    found = sea_range_m([0, 90, 180], -3.0, height_m=25.0, mounting=Mounting(pitch_deg=-0.1))
    assert np.abs(found - [462.29, 477.68, 494.14]).max() < 0.006


@settings(max_examples=20, derandomize=True, deadline=None)
@given(st.floats(-2, 2), st.floats(-2, 2), st.floats(0, 360), st.floats(-8, -4))
def test_ranges_to_a_flat_sea_are_those_of_the_published_formula(
    pitch: float, roll: float, azimuth: float, elevation: float
) -> None:
    """Rott et al. (2022): there nose-down pitch and the other roll are positive."""
    p, q, g, e = np.deg2rad([-pitch, -roll, azimuth, elevation])
    below = np.cos(e) * (np.cos(g) * np.sin(p) - np.cos(p) * np.sin(q) * np.sin(g)) - np.cos(p) * np.cos(
        q
    ) * np.sin(e)
    found = sea_range_m(azimuth, elevation, height_m=20.0, mounting=Mounting(pitch_deg=pitch, roll_deg=roll))
    assert float(found) == pytest.approx(20.0 / below, rel=1e-9)


def test_a_tilt_is_found_over_the_sea_with_an_honest_uncertainty() -> None:
    azimuth = np.tile(np.arange(0.0, 360.0, 5.0), 2)
    elevation = np.repeat([-3.0, -4.0], 72)
    mounting = Mounting(pitch_deg=0.12, roll_deg=-0.07, elevation_offset_deg=0.05)
    met = sea_range_m(azimuth, elevation, height_m=25.0, mounting=mounting, radius_m=7.3e6)
    inside = []
    for seed in range(30):
        noisy = met + np.random.default_rng(seed).normal(0, 2.0, met.size)
        level = level_from_sea(
            azimuth, elevation, noisy, range_std_m=2.0, height_m=25.0, solve_offset=True, radius_m=7.3e6
        )
        inside += [
            abs(level.pitch_deg - 0.12) < 2 * level.pitch_std_deg,
            abs(level.roll_deg + 0.07) < 2 * level.roll_std_deg,
            abs(level.elevation_offset_deg - 0.05) < 2 * level.elevation_offset_std_deg,
        ]
    assert np.mean(inside) > 0.88
    assert level.pitch_std_deg < 0.005


def test_one_bearing_over_the_sea_tells_no_tilt() -> None:
    met = sea_range_m(np.full(20, 30.0), -3.0, height_m=25.0, mounting=Mounting())
    with pytest.raises(InputError, match="do not determine the tilt"):
        level_from_sea(np.full(20, 30.0), np.full(20, -3.0), met, height_m=25.0)
