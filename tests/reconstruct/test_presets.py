"""Turbulence from stability against the formulas it is built from, read from the other end."""

import math

import numpy as np
import pytest

from geometry.errors import InputError
from reconstruct.presets import INVERSE_OBUKHOV_PER_M, stability_turbulence
from reconstruct.spectra import longitudinal_spectrum


def test_neutral_intensity_is_that_of_the_logarithmic_profile():
    air = stability_turbulence("neutral", 8.0, height_m=100.0, roughness_m=0.03)
    assert air.intensity == pytest.approx(12 ** (1 / 3) * 0.4 / math.log(100 / 0.03))


def test_spectrum_has_the_inertial_subrange_of_its_dissipation():
    """S(n) n^(5/3) = 0.55 dissipation^(2/3) (V/2 pi)^(2/3): Kolmogorov by Taylor's hypothesis."""
    speed, height = 9.0, 80.0
    air = stability_turbulence("neutral", speed, height_m=height, roughness_m=0.05)
    friction = 0.4 * speed / math.log(height / 0.05)
    dissipation = friction**3 / (0.4 * height)
    n = 1e3
    ours = float(longitudinal_spectrum(air, n, speed_mps=speed))
    theirs = 0.55 * dissipation ** (2 / 3) * (speed / (2 * math.pi)) ** (2 / 3) * n ** (-5 / 3)
    assert ours == pytest.approx(theirs, rel=1e-3)


def test_stable_air_is_calmer_with_smaller_eddies():
    airs = [
        stability_turbulence(name, 8.0, height_m=60.0, roughness_m=0.03) for name in INVERSE_OBUKHOV_PER_M
    ]
    assert np.all(np.diff([air.intensity for air in airs]) < 0)
    assert airs[-1].length_m < airs[3].length_m < airs[2].length_m


def test_impossible_presets_are_refused():
    with pytest.raises(InputError, match="allowed are"):
        stability_turbulence("windy", 8.0, height_m=60.0, roughness_m=0.03)
    with pytest.raises(InputError, match="roughness"):
        stability_turbulence("neutral", 8.0, height_m=60.0, roughness_m=70.0)
