"""Dual and triple Doppler."""

import numpy as np
import pytest

from geometry.errors import InputError
from reconstruct.multi_doppler import dual_doppler_wind, triple_doppler_wind
from reconstruct.radial_speed import (
    radial_speed_mps,
)


def test_dual_doppler_takes_an_assumed_vertical_wind() -> None:
    """With the true w the horizontal wind is exact; without, it leans."""
    beams = [20.0, 110.0], [10.0, 25.0]
    seen = radial_speed_mps(*beams, 6.0, -4.0, 0.7)
    np.testing.assert_allclose(
        dual_doppler_wind(*beams, seen, vertical_mps=0.7).wind_mps, [6, -4], atol=1e-13
    )
    assert np.max(np.abs(dual_doppler_wind(*beams, seen).wind_mps - [6, -4])) > 0.1


def test_triple_doppler_sees_all_three_components_and_needs_three_beams() -> None:
    """Three beams, three components; two are refused."""
    beams = [0.0, 120.0, 240.0], [20.0, 40.0, 30.0]
    fit = triple_doppler_wind(*beams, radial_speed_mps(*beams, 6.0, -4.0, 0.7))
    np.testing.assert_allclose(fit.wind_mps, [6, -4, 0.7], atol=1e-13)
    with pytest.raises(InputError):
        triple_doppler_wind([0.0, 90.0], 10.0, [1.0, 2.0])
