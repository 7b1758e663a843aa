"""Spectra, lengths and presets against integrals, published constants and incompressibility."""

import math

import numpy as np
import pytest
from scipy.integrate import quad

from geometry.errors import InputError
from reconstruct import spectra
from reconstruct.spectra import (
    Turbulence,
    from_kaimal_length_m,
    iec_turbulence,
    longitudinal_spectrum,
    spectral_tensor,
)


def test_eddy_length_is_the_70_8_of_the_von_karman_spectrum():
    assert pytest.approx(1.339, abs=2e-4) == spectra.EDDY_LENGTH_RATIO
    assert (2 * math.pi * spectra.EDDY_LENGTH_RATIO) ** 2 == pytest.approx(70.8, abs=0.05)


def test_iec_kaimal_length_of_340_m_is_a_von_karman_length_of_146_m():
    assert from_kaimal_length_m(8.1 * 42) == pytest.approx(146, abs=0.5)


@pytest.mark.parametrize("model", ["von-karman", "kaimal"])
def test_longitudinal_spectrum_integrates_to_the_variance(model):
    air = Turbulence(0.12, 150.0, model=model)

    def of_log(log_n):
        n = math.exp(log_n)
        return n * float(longitudinal_spectrum(air, n, speed_mps=10.0))

    assert quad(of_log, -18, 14, limit=400)[0] == pytest.approx(1.44, rel=1e-4)


def test_von_karman_spectrum_at_zero_is_the_integral_length():
    air = Turbulence(0.1, 123.0)
    assert float(longitudinal_spectrum(air, 0.0, speed_mps=8.0)) == pytest.approx(4 * 0.64 * 123 / 8)


def test_kaimal_and_von_karman_of_one_length_share_the_inertial_subrange():
    karman, kaimal = (Turbulence(0.1, 146.0, model=model) for model in ("von-karman", "kaimal"))
    high = [float(longitudinal_spectrum(air, 1e4, speed_mps=10.0)) for air in (karman, kaimal)]
    assert high[0] == pytest.approx(high[1], rel=1e-3)


def test_energy_spectrum_holds_three_halves_of_the_variance():
    total = quad(
        lambda x: math.exp(x) * float(spectra.energy_spectrum(np.array(math.exp(x)))), -14, 30, limit=400
    )[0]
    assert total == pytest.approx(1.5, rel=1e-6)


@pytest.mark.parametrize("air", [Turbulence(0.1, 100.0), Turbulence(0.1, 100.0, model="mann", gamma=3.9)])
def test_spectral_tensor_is_that_of_an_incompressible_flow(air):
    rng = np.random.default_rng(2)
    k = rng.normal(size=(3, 500)) * 10 ** rng.uniform(-4, 0, 500)
    t = spectral_tensor(air, k)
    divergence = np.stack(
        [
            k[0] * t.c11 + k[1] * t.c12 + k[2] * t.c13,
            k[0] * t.c12 + k[1] * t.c22 + k[2] * t.c23,
            k[0] * t.c13 + k[1] * t.c23 + k[2] * t.c33,
        ]
    )
    size = np.linalg.norm(k, axis=0) * (t.c11 + t.c22 + t.c33)
    assert np.max(np.abs(divergence) / size) < 1e-6


def test_mann_without_shear_is_the_isotropic_tensor():
    k = np.random.default_rng(1).normal(size=(3, 100)) * 0.02
    plain = spectral_tensor(Turbulence(0.1, 100.0), k)
    mann = spectral_tensor(Turbulence(0.1, 100.0, model="mann", gamma=0.0), k)
    square = np.sum(k * k, axis=0)
    scale = 133.898
    energy = spectra.energy_spectrum(np.sqrt(square) * scale) * scale
    np.testing.assert_allclose(plain.c13, mann.c13)
    np.testing.assert_allclose(plain.c11, energy / (4 * np.pi * square) * (1 - k[0] ** 2 / square), rtol=1e-3)


def test_mann_ratios_are_those_that_iec_derives_its_parameters_from():
    """IEC 61400-1 ed. 4, eq. C.12: sigma_iso = 0.55 sigma_1 at gamma 3.9, sigma_2 0.7, sigma_3 0.5 of it."""
    u, v, w = spectra.mann_std_ratio(3.9)
    assert 1 / u == pytest.approx(0.55, abs=0.01)
    assert v / u == pytest.approx(0.7, abs=0.03)
    assert w / u == pytest.approx(0.5, abs=0.03)


def test_mann_length_of_iec_air_is_0_8_of_the_scale_parameter():
    """IEC 61400-1 ed. 4, eq. C.12: l = 0.8 x 42 m = 33.6 m; ours comes from the equal inertial subrange."""
    air = Turbulence(0.1, from_kaimal_length_m(8.1 * 42), model="mann")
    assert air.mann_length_m == pytest.approx(33.6, rel=0.02)


def test_shear_dies_out_at_large_wavenumbers():
    k = np.array([[300.0], [200.0], [100.0]])
    sheared, plain = spectra.sheared_tensor(3.9, k), spectra.sheared_tensor(0.0, k)
    assert float(sheared.c22[0]) == pytest.approx(float(plain.c22[0]), rel=0.15)


@pytest.mark.parametrize(("iec_class", "std_mps"), [("A", 2.696), ("B", 2.359), ("C", 2.022)])
def test_iec_class_gives_the_standard_deviation_of_the_standard_at_15_mps(iec_class, std_mps):
    air = iec_turbulence(iec_class, 15.0, height_m=90.0)
    assert air.std_mps(15.0) == pytest.approx(std_mps, abs=1e-3)


@pytest.mark.parametrize(
    "values",
    [
        (-0.1, 100.0),
        (1.1, 100.0),
        (0.1, 0.0),
        (0.1, float("nan")),
        (0.1, 100.0, "foo"),
        (0.1, 100.0, "mann", 9.0),
    ],
)
def test_impossible_turbulence_is_refused(values):
    with pytest.raises(InputError):
        Turbulence(*values)


def test_what_a_model_does_not_have_is_refused():
    with pytest.raises(InputError, match="no spectral tensor"):
        spectral_tensor(Turbulence(0.1, 100.0, model="kaimal"), np.ones((3, 1)))
    with pytest.raises(InputError, match="integrate"):
        longitudinal_spectrum(Turbulence(0.1, 100.0, model="mann"), 0.1, speed_mps=10.0)
    with pytest.raises(InputError, match="class"):
        iec_turbulence("D", 10.0, height_m=100.0)
    with pytest.raises(InputError, match="above 0"):
        iec_turbulence("A", 0.0, height_m=100.0)
