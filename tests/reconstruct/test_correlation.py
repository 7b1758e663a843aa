"""Correlation functions against 50-digit arithmetic, integrals of their spectra and limits."""

import mpmath
import numpy as np
import pytest
from scipy.integrate import quad

from reconstruct.correlation import correlation, isotropic, karman_excess, karman_longitudinal
from reconstruct.spectra import Turbulence, mann_std_ratio, sheared_tensor

AXES = np.eye(3)


def exact(x):
    """f and g of von Kármán turbulence at a distance in units of l, with 50 digits."""
    with mpmath.workdps(50):
        x = mpmath.mpf(x)
        c = mpmath.mpf(2) ** (mpmath.mpf(2) / 3) / mpmath.gamma(mpmath.mpf(1) / 3)
        f = c * x ** (mpmath.mpf(1) / 3) * mpmath.besselk(mpmath.mpf(1) / 3, x)
        g = f - c / 2 * x ** (mpmath.mpf(4) / 3) * mpmath.besselk(mpmath.mpf(2) / 3, x)
        return float(f), float(g)


def along_x(distances):
    out = np.zeros((3, len(distances)))
    out[0] = distances
    return out


@pytest.mark.parametrize("x", [1e-9, 1e-3, 0.1, 1.0, 5.0, 20.0])
def test_f_and_g_agree_with_mpmath(x):
    f, g = exact(x)
    ours = karman_longitudinal(np.array([x]))[0]
    assert ours == pytest.approx(f, rel=1e-12)
    assert ours - karman_excess(np.array([x]))[0] == pytest.approx(g, rel=1e-11)


@pytest.mark.parametrize("length_m", [10.0, 170.0, 10_000.0])
def test_table_agrees_with_mpmath_for_lengths_from_10_m_to_10_km(length_m):
    tensor = correlation(Turbulence(0.1, length_m))
    l = 1.3389852790652803 * length_m
    distances = l * np.array([1e-8, 1e-4, 0.01, 0.3, 1.0, 2.0, 7.0, 30.0, 100.0])
    for component, kind in ((0, 0), (1, 1), (2, 1)):
        axis = AXES[component][:, None]
        ours = tensor(along_x(distances), axis, axis)
        theirs = [exact(distance / l)[kind] for distance in distances]
        np.testing.assert_allclose(ours, theirs, atol=1e-5)


def test_correlation_at_a_point_is_one_and_far_away_nothing():
    tensor = correlation(Turbulence(0.1, 170.0))
    x = AXES[0]
    assert float(tensor(np.zeros(3), x, x)) == pytest.approx(1.0, abs=1e-12)
    assert float(tensor(np.array([1e9, 0.0, 0.0]), x, x)) < 1e-15


def test_longitudinal_correlation_integrates_to_the_integral_length_and_lateral_to_half():
    tensor = correlation(Turbulence(0.1, 170.0))
    r = np.linspace(0, 6000, 200_001)
    for axis, length in ((AXES[0], 170.0), (AXES[1], 85.0)):
        values = tensor(along_x(r), axis[:, None], axis[:, None])
        assert np.trapezoid(values, r) == pytest.approx(length, rel=2e-4)


def test_isotropic_covariance_of_many_places_is_positive():
    rng = np.random.default_rng(5)
    places, beams = rng.normal(size=(3, 60)) * 200, rng.normal(size=(3, 60))
    apart = places[:, :, None] - places[:, None, :]
    matrix = isotropic(200.0)(apart, beams[:, :, None], beams[:, None, :])
    assert np.min(np.linalg.eigvalsh(matrix)) > -1e-5


@pytest.mark.parametrize("distance_m", [5.0, 50.0, 400.0])
def test_kaimal_correlation_along_the_wind_is_the_cosine_transform_of_its_spectrum(distance_m):
    air = Turbulence(0.1, 146.0, model="kaimal")
    length = air.kaimal_length_m
    ours = float(correlation(air)(np.array([distance_m, 0, 0]), AXES[0], AXES[0]))
    scaled = 2 * np.pi * distance_m / length
    theirs = quad(lambda k: 4 / (1 + 6 * k) ** (5 / 3), 0, np.inf, weight="cos", wvar=scaled, limlst=500)[0]
    assert ours == pytest.approx(theirs, abs=1e-3)


@pytest.mark.parametrize("distance_m", [5.0, 50.0, 200.0])
def test_kaimal_correlation_across_the_wind_is_the_integral_of_its_coherence(distance_m):
    air = Turbulence(0.1, 146.0, model="kaimal")
    d = distance_m / air.kaimal_length_m
    ours = float(correlation(air)(np.array([0, distance_m, 0]), AXES[0], AXES[0]))
    theirs = quad(lambda k: 4 / (1 + 6 * k) ** (5 / 3) * np.exp(-12 * d * np.hypot(k, 0.12)), 0, np.inf)[0]
    assert ours == pytest.approx(theirs, abs=2e-3)


def test_kaimal_components_have_the_variances_of_the_standard():
    tensor = correlation(Turbulence(0.1, 146.0, model="kaimal"))
    assert [round(float(tensor(np.zeros(3), axis, axis)), 3) for axis in AXES] == [1.0, 0.64, 0.25]


def test_mann_with_little_shear_is_isotropic_to_one_per_cent():
    rng = np.random.default_rng(3)
    apart = rng.normal(size=(3, 2000)) * rng.choice([5.0, 50.0, 300.0], 2000)
    first, second = rng.normal(size=(2, 3, 2000))
    first, second = first / np.linalg.norm(first, axis=0), second / np.linalg.norm(second, axis=0)
    mann = correlation(Turbulence(0.1, 170.0, model="mann", gamma=1e-3))(apart, first, second)
    plain = correlation(Turbulence(0.1, 170.0))(apart, first, second)
    assert np.max(np.abs(mann - plain)) < 0.01


def test_mann_with_no_shear_is_isotropic():
    apart = np.array([30.0, 20.0, 10.0])
    mann = correlation(Turbulence(0.1, 170.0, model="mann", gamma=0.0))(apart, AXES[0], AXES[1])
    assert float(mann) == float(correlation(Turbulence(0.1, 170.0))(apart, AXES[0], AXES[1]))


def test_mann_correlation_along_the_wind_agrees_with_direct_integration_of_the_tensor():
    """One-dimensional spectra by summing over k2, k3; then a cosine sum over k1: no spherical harmonics."""
    air = Turbulence(0.1, 146.0, model="mann")
    k1, ring = np.geomspace(1e-4, 100, 160), np.geomspace(1e-4, 1e3, 120)
    turn = (np.arange(48) + 0.5) * 2 * np.pi / 48
    k = np.empty((3, 160, 120, 48))
    k[0] = k1[:, None, None]
    k[1], k[2] = ring[:, None] * np.cos(turn), ring[:, None] * np.sin(turn)
    tensor = sheared_tensor(3.9, k)
    area = ring[:, None] ** 2 * np.log(ring[1] / ring[0]) * 2 * np.pi / 48
    fine = np.linspace(0, 100, 400_001)
    apart = np.array([30.0, 100.0, 300.0])
    for component, ours in ((tensor.c11, (0, 0)), (tensor.c22, (1, 1)), (tensor.c13, (0, 2))):
        spectrum = np.interp(fine, k1, np.sum(component * area, axis=(1, 2)))
        theirs = [
            2
            * np.trapezoid(spectrum * np.cos(fine * r / air.mann_length_m), fine)
            / mann_std_ratio(3.9)[0] ** 2
            for r in apart
        ]
        first, second = AXES[ours[0]][:, None], AXES[ours[1]][:, None]
        np.testing.assert_allclose(correlation(air)(along_x(apart), first, second), theirs, atol=0.01)


def test_mann_shear_stress_is_downward_momentum():
    """With the wind growing upward, gusts come down: uw is negative at a point."""
    tensor = correlation(Turbulence(0.1, 146.0, model="mann"))
    assert float(tensor(np.zeros(3), AXES[0], AXES[2])) < -0.1


def test_mirror_and_reversal_of_the_mann_correlation():
    tensor = correlation(Turbulence(0.1, 146.0, model="mann"))
    apart, mirror = np.array([60.0, 40.0, 10.0]), np.array([1.0, -1.0, 1.0])
    first, second = np.array([1.0, 0.5, 0.2]), np.array([0.3, -1.0, 0.1])
    value = float(tensor(apart, first, second))
    assert float(tensor(-apart, first, second)) == pytest.approx(value)
    assert float(tensor(apart * mirror, first * mirror, second * mirror)) == pytest.approx(value)
