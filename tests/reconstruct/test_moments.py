"""Moments of speed and direction against closed forms, another integral and draws."""

import mpmath
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.special import ive

from geometry.errors import InputError
from reconstruct.moments import NARROW, wind_moments


def rice_mean(speed: float, std: float) -> float:
    """Mean of |V| for an isotropic error: Rice (1945), σ sqrt(π/2) L_{1/2}(-V²/2σ²)."""
    x = speed**2 / (2 * std**2)
    return float(std * np.sqrt(np.pi / 2) * ((1 + x) * ive(0, x / 2) + x * ive(1, x / 2)))


def mean_speed(mean: tuple[float, float], stds: tuple[float, float]) -> float:
    """E sqrt(Q) = 1/(2 sqrt(π)) ∫ (1 - E exp(-tQ)) t^(-3/2) dt, Q a sum of two scaled noncentral chi
    squares.
    """
    x = np.arange(-80, 80, 0.02)
    t = np.exp(x)
    log = sum(
        -0.5 * np.log1p(2 * t * s**2) - t * m**2 / (1 + 2 * t * s**2) for m, s in zip(mean, stds, strict=True)
    )
    return float(np.sum(-np.expm1(log) * np.exp(-x / 2)) * 0.02 / (2 * np.sqrt(np.pi)))


@pytest.mark.parametrize("std", [1e-3, 0.1, 0.499, 0.501, 1.0, 3.0, 10.0, 100.0, 1e5])
def test_isotropic_error_is_rice(std: float) -> None:
    """Mean and spread of the speed of 10 m/s with an isotropic error, from tiny to enormous."""
    got = wind_moments([6.0, 8.0], std**2 * np.eye(2))
    mean = rice_mean(10.0, std)
    assert float(got.speed_bias_mps) == pytest.approx(mean - 10, abs=1e-9 * max(1, std))
    if std > 0.05:
        assert float(got.speed_std_mps) == pytest.approx(np.sqrt(2 * std**2 + 100 - mean**2), rel=1e-6)
    else:
        assert float(got.speed_std_mps) == pytest.approx(std, rel=1e-4)


@pytest.mark.parametrize(
    ("mean", "stds"),
    [
        ((10, 0), (5, 0.05)),
        ((0, 10), (5, 0.05)),
        ((0, 10), (3, 0)),
        ((3, 4), (1e4, 0.1)),
        ((3, 4), (1e3, 1e-3)),
        ((6, 8), (20, 0.3)),
        ((0, 0), (1, 0)),
        ((1e-3, 0), (2, 1)),
        ((10, 0), (10, 0.1)),
        ((6, 8), (0.6, 0.3)),
    ],
)
def test_mean_speed_by_another_integral(mean: tuple[float, float], stds: tuple[float, float]) -> None:
    """Flat, wide and calm errors: the mean speed to six digits."""
    got = wind_moments(mean, np.diag(np.square(stds)))
    want = mean_speed(mean, stds)
    assert float(got.speed_bias_mps) + np.hypot(*mean) == pytest.approx(want, rel=1e-6)


@pytest.mark.parametrize(
    ("mean", "stds"), [((0, 10), (3, 0.5)), ((3, 4), (8, 2)), ((10, 1), (12, 0.1)), ((6, 8), (0.3, 0.2))]
)
def test_direction_against_draws(mean: tuple[float, float], stds: tuple[float, float]) -> None:
    """Bias and spread of the direction agree with two million draws."""
    z = np.random.default_rng(11).standard_normal((2, 2_000_000))
    wind = np.add(mean, np.array(stds) * z.T).T
    turn = np.arctan2(wind[0], wind[1]) - np.arctan2(*mean)
    bias = np.angle(np.mean(np.exp(1j * turn)))
    spread = np.sqrt(np.mean(((turn - bias + np.pi) % (2 * np.pi) - np.pi) ** 2))
    got = wind_moments(mean, np.diag(np.square(stds)))
    error = np.degrees(spread) / np.sqrt(2e6)
    assert abs(float(got.direction_bias_deg) - np.degrees(bias)) < 6 * error
    assert float(got.direction_std_deg) == pytest.approx(np.degrees(spread), abs=10 * error)


def test_the_two_methods_meet_at_their_border() -> None:
    """Just under and just over the ratio where the method changes the results differ by the step alone."""
    std = NARROW * 10
    low, high = (
        wind_moments([0.0, 10.0], np.diag([1.0, 0.3]) * (std * f) ** 2) for f in (1 - 1e-9, 1 + 1e-9)
    )
    for a, b in zip(low, high, strict=True):
        assert float(a) == pytest.approx(float(b), rel=1e-7, abs=1e-9)


def test_narrow_moments_to_high_precision() -> None:
    """Gauss-Hermite against mpmath's integral for an error across a wind of 10 m/s."""
    with mpmath.workdps(30):
        weight = [lambda x: mpmath.npdf(x) * (mpmath.sqrt(100 + (x * 0.4) ** 2) - 10)]
        weight.append(lambda x: mpmath.npdf(x) * mpmath.atan(x * 0.04) ** 2)
        bias, turn = (float(mpmath.quad(f, [-12, -4, 0, 4, 12])) for f in weight)
    got = wind_moments([0.0, 10.0], np.diag([0.16, 0.0]))
    assert float(got.speed_bias_mps) == pytest.approx(bias, rel=1e-12)
    assert float(got.direction_std_deg) == pytest.approx(np.degrees(np.sqrt(turn)), rel=1e-12)


def test_a_mean_error_across_the_wind_turns_it() -> None:
    """1 m/s to the east on a southward wind of 10 m/s: it then comes from 354.29 degrees."""
    got = wind_moments([0.0, -10.0], np.zeros((2, 2)), mean_error_mps=[1.0, 0.0])
    assert float(got.direction_bias_deg) == pytest.approx(-np.degrees(np.arctan(0.1)), rel=1e-12)
    assert float(got.speed_bias_mps) == pytest.approx(np.sqrt(101) - 10, rel=1e-12)
    assert float(got.speed_std_mps) == 0


def test_hopeless_directions_are_uniform() -> None:
    """An error far beyond the wind spreads the direction like a uniform one: 180/sqrt(3) degrees."""
    got = wind_moments([0.0, 1e-3], 1e6 * np.eye(2))
    assert float(got.direction_std_deg) == pytest.approx(180 / np.sqrt(3), abs=0.01)


def test_calm_and_missing() -> None:
    """A calm has a speed error but no direction; NaN stays NaN; a perfect calm has no error."""
    got = wind_moments([[0.0, 0.0], [np.nan, 1.0], [0.0, 0.0]], [np.eye(2), np.eye(2), np.zeros((2, 2))])
    np.testing.assert_allclose(got.speed_bias_mps, [np.sqrt(np.pi / 2), np.nan, 0.0], rtol=1e-9)
    assert np.all(np.isnan(got.direction_bias_deg))
    assert np.all(np.isnan(got.direction_std_deg))


@settings(derandomize=True, max_examples=30, deadline=None)
@given(st.floats(0, 360), st.floats(0.05, 30), st.floats(0.0, 5.0))
def test_turning_everything_changes_nothing(turn: float, long: float, short: float) -> None:
    """Speed and direction errors do not depend on where north is."""
    c, s = np.cos(np.radians(turn)), np.sin(np.radians(turn))
    rotation = np.array([[c, s], [-s, c]])
    wind, covariance = (
        np.array([3.0, 7.0]),
        np.array([[long**2, 0.2 * long * short], [0.2 * long * short, short**2]]),
    )
    a = wind_moments(wind, covariance)
    b = wind_moments(rotation @ wind, rotation @ covariance @ rotation.T)
    for x, y in zip(a, b, strict=True):
        assert float(x) == pytest.approx(float(y), rel=1e-5, abs=1e-6)


def test_shapes_that_are_no_winds_are_refused() -> None:
    """Three components are no horizontal wind."""
    with pytest.raises(InputError):
        wind_moments([1.0, 2.0, 3.0], np.eye(2))
