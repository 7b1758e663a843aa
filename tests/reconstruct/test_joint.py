"""Covariances of speeds against closed forms and random draws."""

import numpy as np
import pytest
from scipy.special import hyp2f1

from reconstruct.joint import expand, speed_covariance


@pytest.mark.parametrize("correlation", [0.0, 0.3, 0.7, 0.9])
def test_correlated_rayleigh_speeds_have_the_closed_form(correlation):
    """E[r1 r2] = (pi/2) 2F1(-1/2, -1/2; 1; rho²) for circular vectors of variance 1 (Papoulis 1965)."""
    calm = expand(np.zeros(2), np.eye(2))
    ours = float(speed_covariance(calm, calm, correlation * np.eye(2)))
    theirs = np.pi / 2 * (hyp2f1(-0.5, -0.5, 1, correlation**2) - 1)
    assert ours == pytest.approx(theirs, abs=0.006)


def test_small_errors_are_linear_in_the_component_along_the_wind():
    speed = expand(np.array([6.0, 8.0]), 1e-6 * np.eye(2))
    cross = 1e-7 * np.array([[3.0, 1.0], [2.0, 5.0]])
    along = np.array([0.6, 0.8])
    assert float(speed_covariance(speed, speed, cross)) == pytest.approx(
        float(along @ cross @ along), rel=1e-4
    )


def test_covariance_of_a_speed_with_itself_is_its_variance():
    covariance = np.array([[0.4, 0.1], [0.1, 3.0]])
    speed = expand(np.array([9.0, 0.0]), covariance)
    assert float(speed_covariance(speed, speed, covariance)) == pytest.approx(
        float(speed.variance_m2s2), rel=2e-3
    )


@pytest.mark.parametrize("across", [4.0, 40.0])
def test_wide_scatter_across_the_wind_agrees_with_draws(across):
    mean, first = np.array([8.0, 0.0]), np.array([[0.5, 0.3], [0.3, across]])
    second = np.array([[0.6, -0.2], [-0.2, 0.8]])
    cross = np.array([[0.3, 0.05], [0.1, 0.9]])
    joint = np.block([[first, cross], [cross.T, second]])
    draws = np.random.default_rng(4).multivariate_normal(np.zeros(4), joint, 400_000)
    one, two = (np.hypot(*(mean + draws[:, part]).T) for part in (slice(0, 2), slice(2, 4)))
    product = (one - one.mean()) * (two - two.mean())
    left, right = expand(mean, first), expand(mean, second)
    assert float(left.mean_mps) == pytest.approx(one.mean(), abs=5 * one.std() / 632)
    assert float(left.variance_m2s2) == pytest.approx(one.var(), rel=0.02)
    error = product.std() / np.sqrt(len(product))
    assert abs(float(speed_covariance(left, right, cross)) - product.mean()) < 4 * error


def test_vector_without_spread_has_its_own_speed():
    still = expand(np.array([3.0, 4.0]), np.zeros((2, 2)))
    assert float(still.mean_mps) == pytest.approx(5.0)
    assert float(still.variance_m2s2) == pytest.approx(0.0, abs=1e-9)
    assert float(speed_covariance(still, still, np.zeros((2, 2)))) == 0.0


def test_one_axis_without_spread_is_exact():
    line = expand(np.array([10.0, 0.0]), np.diag([1.0, 0.0]))
    assert float(line.mean_mps) == pytest.approx(10.0)
    assert float(speed_covariance(line, line, np.diag([0.5, 0.0]))) == pytest.approx(0.5, rel=1e-6)
