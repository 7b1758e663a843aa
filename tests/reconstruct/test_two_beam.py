"""Two-beam lidar against the equations of its source."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from geometry.errors import InputError
from reconstruct.radial_speed import (
    radial_speed_mps,
)
from reconstruct.two_beam import two_beam_wind


@settings(derandomize=True, max_examples=40, deadline=None)
@given(st.floats(1, 20), st.floats(1, 20), st.floats(5, 60))
def test_two_beams_are_windeyes_equations(left: float, right: float, half: float) -> None:
    """WindEye equations 1 to 4, positive toward, V1 left and V2 right."""
    a = np.radians(half)
    across, along = (left - right) / (2 * np.sin(a)), (left + right) / (2 * np.cos(a))
    got = two_beam_wind(-left, -right, half_angle_deg=half)
    want = across, along, np.hypot(across, along), np.degrees(np.arctan(across / along))
    np.testing.assert_allclose(
        [got.across_mps, got.along_mps, got.speed_mps, got.angle_deg], want, atol=1e-10
    )


def test_a_wind_from_the_left_beam_has_a_positive_angle() -> None:
    """Looking north with beams at ±30, a wind from 330 degrees comes from the left: +30 degrees, 10 m/s."""
    u, v = -10 * np.sin(np.radians(330)), -10 * np.cos(np.radians(330))
    left, right = radial_speed_mps([-30.0, 30.0], 0.0, u, v)
    got = two_beam_wind(left, right, half_angle_deg=30.0)
    assert (round(float(got.angle_deg), 9), round(float(got.speed_mps), 9)) == (30.0, 10.0)


def test_two_beams_with_a_hole_or_a_wrong_angle() -> None:
    """A missing beam gives NaN, a half angle of 90 degrees an error."""
    assert np.isnan(two_beam_wind([1.0], [np.nan], half_angle_deg=30.0).speed_mps).all()
    with pytest.raises(InputError):
        two_beam_wind(1.0, 1.0, half_angle_deg=90.0)
