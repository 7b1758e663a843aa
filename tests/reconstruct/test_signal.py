"""CNR, noise and what accumulation buys, against the integral of the Cramér-Rao bound and simple limits."""

import math

import numpy as np
import pytest

from geometry.errors import InputError
from reconstruct.signal import bought_noise, bought_range, cnr_db, noise_mps, valid_share


def cramer_rao_mps(snr, *, pulses, points, bandwidth, width):
    """Rye & Hardesty (1997): the bound of a Gaussian echo in white noise, integrated over the spectrum."""
    f = width / bandwidth
    alpha = snr / (math.sqrt(2 * math.pi) * f)
    x = np.linspace(-0.5, 0.5, 20001)
    share = 1.0 / (1.0 + 1.0 / (alpha * np.exp(-(x**2) / (2 * f**2))))
    information = np.trapezoid((x / f) ** 2 * share**2, x)
    return bandwidth * f / math.sqrt(pulses * points * information)


@pytest.mark.parametrize("decibel", [-30.0, -25.0, -20.0, -15.0, -10.0, -5.0, 0.0])
def test_approximation_is_near_the_cramer_rao_bound(decibel):
    settings = {"pulses": 8000, "bandwidth": 60.0, "width": 2.0}
    bound = cramer_rao_mps(10 ** (decibel / 10), points=64, **settings)
    ours = noise_mps(decibel, pulses=8000, points_per_gate=64, bandwidth_mps=60.0, width_mps=2.0)
    assert float(ours) == pytest.approx(bound, rel=0.13)  # 13 % at 0 dB, 1 % at -25 dB


def test_weak_signal_noise_falls_with_signal_and_with_the_root_of_pulses():
    weak = noise_mps([-30.0, -27.0], pulses=1e6, points_per_gate=64, bandwidth_mps=60.0)
    assert weak[0] / weak[1] == pytest.approx(10**0.3, rel=0.02)
    twice = noise_mps(-30.0, pulses=2e6, points_per_gate=64, bandwidth_mps=60.0)
    assert float(weak[0] / twice) == pytest.approx(math.sqrt(2))


def test_no_signal_is_a_speed_from_anywhere_in_the_band():
    blind = noise_mps(-80.0, pulses=100, points_per_gate=64, bandwidth_mps=60.0)
    assert float(blind) == pytest.approx(60 / math.sqrt(12))


def test_cnr_falls_by_six_decibel_when_the_range_doubles_and_by_the_air_between():
    dry, hazy = (
        cnr_db(2000.0, reference_db=-10, reference_range_m=1000.0, extinction_per_m=alpha)
        for alpha in (0.0, 1e-3)
    )
    assert float(dry) == pytest.approx(-16.0206, abs=1e-4)
    assert float(dry - hazy) == pytest.approx(2 * 4.342945, abs=1e-5)


def test_half_of_the_rays_are_valid_at_the_limit():
    assert valid_share([-25.0, -1e3, 1e3], least_db=-25.0).tolist() == [0.5, 0.0, 1.0]


@pytest.mark.parametrize("ratio", [0.25, 1.0, 2.0, 10.0])
def test_range_bought_has_the_same_noise_as_before(ratio):
    farther = bought_range(ratio, 1500.0, extinction_per_m=2e-4)
    levels = cnr_db([1500.0, farther], reference_db=-40.0, reference_range_m=1500.0, extinction_per_m=2e-4)
    before = noise_mps(levels[0], pulses=1e7, points_per_gate=64, bandwidth_mps=60.0)
    after = noise_mps(levels[1], pulses=1e7 * ratio, points_per_gate=64, bandwidth_mps=60.0)
    assert float(after / before) == pytest.approx(1.0, rel=5e-3)
    assert bought_noise(ratio) == pytest.approx(ratio**-0.5)


@pytest.mark.parametrize(
    "call",
    [
        lambda: cnr_db(0.0, reference_db=-10, reference_range_m=1000.0),
        lambda: noise_mps(-10, pulses=0, points_per_gate=64, bandwidth_mps=60.0),
        lambda: valid_share(-10, least_db=-20, spread_db=0.0),
        lambda: bought_noise(0.0),
    ],
)
def test_nonsense_is_refused(call):
    with pytest.raises(InputError, match="above 0"):
        call()
