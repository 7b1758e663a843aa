"""The forward model: what a beam sees of a wind."""

import numpy as np
import pytest

from geometry.errors import InputError
from geometry.gates import Probe
from reconstruct.radial_speed import (
    gradient_per_s,
    power_law_mps,
    probe_average_mps,
    radial_speed_mps,
    wind_at_mps,
    with_noise_mps,
)
from reconstruct.wind import WindState


def test_radial_speed_is_positive_away() -> None:
    """A westerly seen by a beam to the east is positive, by one to the west negative."""
    np.testing.assert_allclose(radial_speed_mps([90.0, 270.0], 0.0, 10.0, 0.0), [10.0, -10.0], rtol=1e-12)


def test_leaving_out_the_cosine_loses_half_a_percent() -> None:
    """At 5.74 degrees of elevation cos φ is 0.50 % under one."""
    assert 1 - float(radial_speed_mps(0.0, 5.74, 0.0, 1.0)) == pytest.approx(0.0050, abs=5e-5)


def test_the_gradient_is_the_slope_of_the_wind() -> None:
    """Central differences of the wind give its gradient."""
    state = WindState(
        10.0, 200.0, shear_exponent=0.2, height_m=90.0, vertical_mps=0.3, lateral_gradient_per_s=0.002
    )
    place, step = np.array([30.0, -50.0, 20.0]), 1e-3
    slope = [
        (wind_at_mps(state, place + step * e) - wind_at_mps(state, place - step * e)) / (2 * step)
        for e in np.eye(3)
    ]
    np.testing.assert_allclose(gradient_per_s(state, place), np.transpose(slope), atol=1e-9)


def test_the_power_law_stands_on_the_ground() -> None:
    """Twice the height gives 2^α; under ground there is nothing; without shear there is no ground."""
    assert float(
        power_law_mps(200.0, speed_mps=10.0, reference_height_m=100.0, exponent=1 / 7)
    ) == pytest.approx(10 * 2 ** (1 / 7))
    assert np.isnan(power_law_mps(-5.0, speed_mps=10.0, reference_height_m=100.0, exponent=0.2))
    assert float(power_law_mps(-5.0, speed_mps=10.0, reference_height_m=100.0, exponent=0.0)) == 10.0
    with pytest.raises(InputError):
        power_law_mps(10.0, speed_mps=10.0, reference_height_m=0.0, exponent=0.2)


def test_the_probe_averages_a_parabola_to_its_variance() -> None:
    """A wind that grows with the square of the distance from the gate is seen as the variance of the
    weighting.
    """
    probe = Probe(pulse_ns=200, window_ns=256)

    def parabola(place: np.ndarray) -> np.ndarray:
        return np.stack([0 * place[..., 0], (place[..., 1] - 700) ** 2, 0 * place[..., 0]], -1)

    seen = probe_average_mps(parabola, np.zeros(3), 0.0, 0.0, 700.0, probe=probe)
    assert float(seen) == pytest.approx(probe.std_m**2, rel=1e-3)


def test_noise_has_its_standard_deviation() -> None:
    """Seeded noise of 0.3 m/s."""
    noisy = with_noise_mps(np.zeros(100_000), 0.3, rng=np.random.default_rng(2))
    assert np.std(noisy) == pytest.approx(0.3, rel=0.01)
