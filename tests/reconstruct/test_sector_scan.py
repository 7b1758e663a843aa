"""Sector scans: the whole cone, and what a fit of two columns makes of the rest of the wind."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from reconstruct.radial_speed import (
    radial_speed_mps,
    wind_at_mps,
)
from reconstruct.sector_scan import sector_wind
from reconstruct.wind import WindState


@settings(derandomize=True, max_examples=30, deadline=None)
@given(st.floats(-15, 15), st.floats(-15, 15), st.floats(-2, 2), st.floats(1, 80))
def test_wind_comes_back_from_a_full_cone(u: float, v: float, w: float, elevation: float) -> None:
    """Forward model and three-column fit are inverse."""
    azimuth = np.arange(0.0, 360.0, 15.0)
    fit = sector_wind(azimuth, elevation, radial_speed_mps(azimuth, elevation, u, v, w), columns=3)
    np.testing.assert_allclose(fit.wind_mps, [u, v, w], atol=1e-11)


def test_vertical_wind_leans_on_the_axis() -> None:
    """w = 0.5 m/s at 10 degrees: w tan φ times 1.045 along the axis of a 60 degree sector, nothing across."""
    azimuth = np.arange(-30.0, 30.01, 0.1)
    along = sector_wind(azimuth, 10.0, radial_speed_mps(azimuth, 10.0, 0.0, 0.0, 0.5)).wind_mps
    assert along[1] / (0.5 * np.tan(np.radians(10))) == pytest.approx(1.045, abs=1e-3)
    assert abs(along[0]) < 1e-14


@pytest.mark.parametrize(("width", "factor"), [(30, 0.9796), (90, 0.8259), (360, 0.0)])
def test_lateral_gradient_leans_across(width: float, factor: float) -> None:
    """The along-axis wind growing by a across: bias a R (4/3) sin³(Φ/2)/(Φ - sin Φ)."""
    azimuth = (np.arange(4000) + 0.5) / 4000 * width - width / 2
    state = WindState(speed_mps=10.0, from_deg=180.0, lateral_gradient_per_s=0.001)
    place = 1000 * np.stack([np.sin(np.radians(azimuth)), np.cos(np.radians(azimuth)), 0 * azimuth], -1)
    seen = np.einsum("rk,rk->r", wind_at_mps(state, place), place / 1000)
    across = sector_wind(azimuth, 0.0, seen).wind_mps[0]
    assert across == pytest.approx(0.001 * 1000 * factor, abs=1e-4)
