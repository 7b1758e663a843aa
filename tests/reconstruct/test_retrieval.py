"""The least-squares core against second formulas, high precision and its limits."""

import mpmath
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from geometry.errors import InputError
from reconstruct.retrieval import REASONS, cofactor, condition, gain, rows, solve

AZIMUTH = np.arange(75.0, 106.0, 5.0)
SPEEDS = np.array([8.6603, 8.1915, 7.6604, 7.0711, 6.4279, 5.7358, 5.0])


def ivap(azimuth_deg: np.ndarray, speed: np.ndarray) -> tuple[float, float]:
    """Liang (2007): u and v from sums over sines, cosines and radial speeds."""
    s, c = np.sin(np.radians(azimuth_deg)), np.cos(np.radians(azimuth_deg))
    a, b, cc, e, f = s @ s, c @ c, s @ c, speed @ c, speed @ s
    d = a * b - cc**2
    return (f * b - e * cc) / d, (e * a - f * cc) / d


def exact(matrix: np.ndarray, speed: np.ndarray, weights: np.ndarray | None = None) -> np.ndarray:
    """Least squares of exactly these doubles with 50 digits."""
    with mpmath.workdps(50):
        a, b = mpmath.matrix(matrix.tolist()), mpmath.matrix(speed.tolist())
        w = mpmath.diag([mpmath.mpf(float(x)) for x in (np.ones(len(speed)) if weights is None else weights)])
        found = mpmath.lu_solve(a.T * w * a, a.T * w * b)
        return np.array([float(x) for x in found])


def test_ivap_check_numbers() -> None:
    """10 m/s from 225 degrees: A, B, E, F and u = v = 7.0710678 of the published example."""
    s, c = np.sin(np.radians(AZIMUTH)), np.cos(np.radians(AZIMUTH))
    speed = np.sqrt(50) * (s + c)
    np.testing.assert_allclose(speed, SPEEDS, atol=5e-5)
    np.testing.assert_allclose(
        [s @ s, c @ c, speed @ c, speed @ s], [6.790526, 0.209474, 1.481206, 48.016268], atol=1e-6
    )
    np.testing.assert_allclose(solve(rows(AZIMUTH, 0.0), speed).wind_mps, 7.0710678, atol=5e-8)


@settings(derandomize=True, max_examples=40, deadline=None)
@given(st.floats(0, 360), st.floats(5, 360), st.integers(3, 60), st.integers(0, 2**31))
def test_two_columns_at_zero_elevation_are_ivap(axis: float, width: float, count: int, seed: int) -> None:
    """Liang's closed form gives the same wind."""
    azimuth = axis + np.linspace(0, width, count, endpoint=False)
    speed = np.random.default_rng(seed).normal(size=count)
    np.testing.assert_allclose(solve(rows(azimuth, 0.0), speed).wind_mps, ivap(azimuth, speed), atol=1e-9)


@settings(derandomize=True, max_examples=40, deadline=None)
@given(st.floats(0, 360), st.floats(3, 177), st.floats(-20, 60), st.floats(-20, 60), st.integers(0, 2**31))
def test_two_beams_are_the_closed_form_of_dual_doppler(
    first: float, angle: float, low: float, high: float, seed: int
) -> None:
    """Newsom et al. (2015): u and v by Cramer's rule on v_r / cos φ."""
    v1, v2 = np.random.default_rng(seed).normal(size=2)
    second = first + angle
    a1, a2 = np.radians(first), np.radians(second)
    s1, s2 = v1 / np.cos(np.radians(low)), v2 / np.cos(np.radians(high))
    sine = np.sin(a1 - a2)
    u, v = (s1 * np.cos(a2) - s2 * np.cos(a1)) / sine, (s2 * np.sin(a1) - s1 * np.sin(a2)) / sine
    fit = solve(rows([first, second], [low, high]), [v1, v2])
    np.testing.assert_allclose(fit.wind_mps, [u, v], rtol=1e-9, atol=1e-9)
    assert np.isnan(fit.residual_std_mps)


@settings(derandomize=True, max_examples=25, deadline=None)
@given(st.floats(-180, 180), st.integers(0, 2**31))
def test_turning_the_compass_turns_the_wind(turn: float, seed: int) -> None:
    """Rays and wind turned together fit the same radial speeds."""
    speed = np.random.default_rng(seed).normal(size=7)
    u, v = solve(rows(AZIMUTH, 10.0), speed).wind_mps
    c, s = np.cos(np.radians(turn)), np.sin(np.radians(turn))
    np.testing.assert_allclose(
        solve(rows(AZIMUTH + turn, 10.0), speed).wind_mps, [u * c + v * s, v * c - u * s], atol=1e-10
    )


@pytest.mark.parametrize(
    ("width", "number", "along", "across"),
    [
        (10, 18.107, 0.30197, 5.46788),
        (30, 6.375, 0.18180, 1.15896),
        (60, 3.195, 0.13416, 0.42864),
        (180, 1.006, 0.10541, 0.10483),
    ],
)
def test_sector_noise_table(width: int, number: float, along: float, across: float) -> None:
    """Condition and noise of sectors with 1 degree steps, both ends included."""
    matrix = rows(np.arange(width + 1) - width / 2, 0.0)  # axis to the north
    assert float(condition(matrix)) == pytest.approx(number, abs=6e-4)
    noise = np.sqrt(np.diagonal(cofactor(matrix)))
    np.testing.assert_allclose(noise, [across, along], atol=6e-6)


@pytest.mark.parametrize("width", [1e-3, 1e-2, 1.0, 60.0, 360.0])
@pytest.mark.parametrize("count", [3, 30])
def test_digits_of_narrow_sectors_are_those_of_the_problem(width: float, count: int) -> None:
    """Against 50 digits the error stays within a few units of rounding times the condition number."""
    azimuth = 217.3 + np.linspace(0, width, count, endpoint=False)
    matrix = rows(azimuth, 3.0)
    speed = matrix @ [3.0, -9.0] + 0.1 * np.cos(np.arange(count) * 2.1)
    fit = solve(matrix, speed)
    truth = exact(matrix, speed)
    # Wedin: the residual enters with the square of the condition number
    number, size = float(fit.condition), np.hypot(*truth)
    allowed = 4 * np.finfo(float).eps * (number * size + number**2 * 0.1)
    assert np.max(np.abs(fit.wind_mps - truth)) < allowed
    values = np.linalg.svd(matrix, compute_uv=False)
    assert number == pytest.approx(values[0] / values[1], rel=number * 1e-15 + 1e-14)
    assert width > 1e-3 or number > 1e5


def test_a_sector_of_a_thousandth_of_a_degree_keeps_ten_digits_of_a_wind_it_can_see() -> None:
    """Radial speeds that fit exactly come back to 1e-9 m/s, though the condition is above 1e5."""
    azimuth = 45.0 + np.linspace(-0.0005, 0.0005, 31)
    with mpmath.workdps(50):
        angles = [mpmath.mpf(float(a)) * mpmath.pi / 180 for a in azimuth]
        speed = np.array([float(3 * mpmath.sin(a) - 9 * mpmath.cos(a)) for a in angles])
    np.testing.assert_allclose(solve(rows(azimuth, 0.0), speed).wind_mps, [3, -9], atol=1e-9)


@pytest.mark.parametrize("angle", [1e-9, 1e-6, 1e-3, 179.999])
def test_beams_that_hardly_cross(angle: float) -> None:
    """Two beams at a tiny angle still give the wind of their own doubles, as far as the condition allows."""
    matrix = rows([0.0, angle], 0.0)
    speed = matrix @ [5.0, 5.0]
    fit = solve(matrix, speed)
    assert np.max(np.abs(fit.wind_mps - exact(matrix, speed))) < 40 * np.finfo(float).eps * float(
        fit.condition
    )


def test_three_columns_and_weights_match_high_precision() -> None:
    """u, v, w with weights, from a cone at 30 degrees."""
    azimuth, rng = np.arange(0.0, 200.0, 20.0), np.random.default_rng(5)
    matrix, speed, weights = rows(azimuth, 30.0, columns=3), rng.normal(size=10), rng.uniform(0.1, 3, size=10)
    fit = solve(matrix, speed, weights=weights)
    np.testing.assert_allclose(fit.wind_mps, exact(matrix, speed, weights), rtol=1e-12)
    values = np.linalg.svd(np.sqrt(weights)[:, None] * matrix, compute_uv=False)
    assert float(fit.condition) == pytest.approx(values[0] / values[-1], rel=1e-12)
    np.testing.assert_allclose(gain(matrix, weights) @ speed, fit.wind_mps, rtol=1e-11)
    np.testing.assert_allclose(gain(matrix, weights) @ matrix, np.eye(3), atol=1e-13)


def test_gain_propagates_noise_as_the_cofactor_says() -> None:
    """G Gᵀ is the covariance of the wind at unit noise."""
    matrix = rows(AZIMUTH, 20.0)
    np.testing.assert_allclose(gain(matrix) @ gain(matrix).T, cofactor(matrix), rtol=1e-12, atol=1e-15)


@pytest.mark.parametrize(
    ("azimuth", "elevation", "speed", "reason"),
    [
        ([10.0, 20.0, 30.0], 0.0, [np.nan] * 3, REASONS[1]),
        ([10.0, 20.0, 30.0], 0.0, [np.nan, 1.0, np.inf], REASONS[2]),
        ([10.0, 10.0, 10.0], 0.0, [1.0, 2.0, 3.0], REASONS[3]),
        ([10.0, 190.0, 370.0], 3.0, [1.0, 2.0, 3.0], REASONS[3]),
        ([10.0, 100.0, 190.0], 90.0, [1.0, 2.0, 3.0], REASONS[3]),
    ],
    ids=["all missing", "one ray", "one azimuth", "one line", "zenith"],
)
def test_what_cannot_be_known_is_nan_with_its_reason(
    azimuth: list[float], elevation: float, speed: list[float], reason: str
) -> None:
    """Rank-short scans give NaN in every number but the count, and say why."""
    fit = solve(rows(azimuth, elevation), speed)
    assert np.all(np.isnan(fit.wind_mps))
    assert np.all(np.isnan(fit.cofactor))
    assert np.isnan(fit.residual_std_mps)
    assert not np.isfinite(fit.condition)
    assert fit.lost == {reason: 1}


def test_repeated_azimuths_are_fine_while_two_differ() -> None:
    """Many rays at two azimuths are two rays with their means."""
    fit = solve(rows([0.0, 0.0, 90.0, 90.0], 0.0), [1.0, 3.0, 4.0, 6.0])
    np.testing.assert_allclose(fit.wind_mps, [5.0, 2.0], atol=1e-14)
    assert float(fit.residual_std_mps) == pytest.approx(np.sqrt(4 / 2))


@pytest.mark.parametrize("columns", [2, 3])
def test_many_scans_with_holes_are_each_the_fit_of_what_is_left(columns: int) -> None:
    """A stack of scans with missing rays equals each scan alone, by numpy's SVD least squares."""
    rng = np.random.default_rng(3)
    azimuth, elevation = np.linspace(-40, 50, 12), 25.0 + 3 * np.cos(np.arange(12.0))
    matrix = rows(azimuth, elevation, columns=columns)  # type: ignore[arg-type]
    speed = rng.normal(size=(4, 50, 12))
    speed[rng.random(speed.shape) < 0.3] = np.nan
    fit = solve(matrix, speed)
    for index in np.ndindex(4, 50):
        known = np.isfinite(speed[index])
        assert fit.rays[index] == known.sum()
        if known.sum() > columns:
            wind, squares, _, values = np.linalg.lstsq(matrix[known], speed[index][known], rcond=None)
            np.testing.assert_allclose(fit.wind_mps[index], wind, rtol=1e-8, atol=1e-10)
            assert float(fit.condition[index]) == pytest.approx(values[0] / values[-1], rel=1e-9)
            spare = known.sum() - columns
            assert float(fit.residual_std_mps[index]) == pytest.approx(np.sqrt(squares[0] / spare), rel=1e-7)


def test_any_layout_of_scans_gives_the_same_winds() -> None:
    """Gates in the middle, chunks, and rows of their own for each scan change nothing."""
    rng = np.random.default_rng(4)
    matrix, speed = rows(AZIMUTH, 5.0), rng.normal(size=(6000, 3, 7))
    whole = solve(matrix, speed).wind_mps
    strided = np.moveaxis(np.ascontiguousarray(np.moveaxis(speed, -1, 1)), 1, -1)
    own = np.broadcast_to(matrix, (6000, 1, 7, 2))
    np.testing.assert_allclose(solve(matrix, strided).wind_mps, whole, atol=1e-12)
    np.testing.assert_allclose(solve(own, speed).wind_mps, whole, atol=1e-11)
    np.testing.assert_allclose(solve(matrix, speed[17, 1]).wind_mps, whole[17, 1], atol=1e-12)


def test_a_ray_without_weight_or_direction_takes_no_part() -> None:
    """Weight 0, a NaN azimuth and a NaN speed leave the same fit."""
    want = solve(rows(AZIMUTH[1:], 0.0), SPEEDS[1:]).wind_mps
    no_weight = solve(rows(AZIMUTH, 0.0), SPEEDS, weights=[0, 1, 1, 1, 1, 1, 1])
    no_azimuth = solve(rows(np.r_[np.nan, AZIMUTH[1:]], 0.0), SPEEDS)
    no_speed = solve(rows(AZIMUTH, 0.0), np.r_[np.nan, SPEEDS[1:]])
    for fit in (no_weight, no_azimuth, no_speed):
        np.testing.assert_allclose(fit.wind_mps, want, rtol=1e-12)
        assert int(fit.rays) == 6


def test_residual_and_covariance_of_noise() -> None:
    """White noise of 0.2 m/s gives that residual, and the scatter of the winds is what the covariance
    says.
    """
    rng, matrix = np.random.default_rng(7), rows(np.arange(30.0), 0.0)
    fit = solve(matrix, 0.2 * rng.normal(size=(20000, 30)))
    assert np.sqrt(np.mean(fit.residual_std_mps**2)) == pytest.approx(0.2, rel=0.005)
    np.testing.assert_allclose(np.cov(fit.wind_mps.T), np.mean(fit.covariance_m2s2, axis=0), rtol=0.05)


def test_no_scan_at_all_is_an_empty_answer() -> None:
    """Zero scans give arrays of length zero."""
    assert solve(rows(AZIMUTH, 0.0), np.empty((0, 7))).wind_mps.shape == (0, 2)


@pytest.mark.parametrize(
    ("speed", "weights"),
    [
        (np.zeros(6), None),
        (np.zeros(7), np.full(7, -1.0)),
        (np.zeros(7), np.full(7, np.nan)),
        (np.zeros(7), np.ones(3)),
    ],
)
def test_what_does_not_belong_together_is_refused(speed: np.ndarray, weights: np.ndarray | None) -> None:
    """Wrong shapes and negative weights are input errors."""
    with pytest.raises(InputError):
        solve(rows(AZIMUTH, 0.0), speed, weights=weights)


def test_scans_that_differ_in_number_are_refused() -> None:
    """Rows for two scans and speeds for three do not fit."""
    with pytest.raises(InputError):
        solve(np.zeros((2, 7, 2)), np.zeros((3, 7)))
    with pytest.raises(InputError):
        rows([0.0], [0.0], columns=4)  # type: ignore[arg-type]
