"""Time lag and orientation: what was shifted and turned comes back."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from geometry.beams import unit_vector
from geometry.errors import InputError
from reconstruct.alignment import orientation_trim, time_lag, two_sonics_trim


def gusty(count: int, seed: int = 1) -> np.ndarray:
    """A wind with a memory of some ten samples."""
    noise = np.random.default_rng(seed).standard_normal(count + 60)
    return np.convolve(noise, np.exp(-np.arange(60) / 10.0), mode="valid")[:count]


@given(st.integers(-30, 30))
@settings(max_examples=20, deadline=None, derandomize=True)
def test_a_whole_lag_comes_back(lag: int) -> None:
    wind = gusty(700)
    one, other = wind[50:650], wind[50 - lag : 650 - lag]
    found = time_lag(one, other, interval_s=1.0, longest_s=40.0)
    assert found.lag_s == pytest.approx(lag, abs=0.1)


def test_a_fraction_of_a_sample_comes_back() -> None:
    """A smooth wave, sampled again 2.3 samples later."""
    at = np.arange(600.0)
    wave = np.sin(at / 9.0) + 0.5 * np.sin(at / 23.0)
    later = np.sin((at - 2.3) / 9.0) + 0.5 * np.sin((at - 2.3) / 23.0)
    assert time_lag(wave, later, interval_s=1.0, longest_s=10.0).lag_s == pytest.approx(2.3, abs=0.05)


def test_gaps_noise_and_another_offset_do_not_move_the_lag() -> None:
    wind = gusty(1000)
    rng = np.random.default_rng(2)
    one, other = wind[20:900].copy(), 5.0 + 0.7 * wind[13:893] + 0.3 * rng.standard_normal(880)
    one[rng.uniform(size=880) < 0.2] = np.nan
    other[100:200] = np.nan
    assert time_lag(one, other, interval_s=0.5, longest_s=15.0).lag_s == pytest.approx(3.5, abs=0.2)


def test_strangers_have_no_lag() -> None:
    one, other = (np.random.default_rng(seed).standard_normal(2000) for seed in (3, 4))
    assert np.isnan(time_lag(one, other, interval_s=1.0, longest_s=20.0).lag_s)


def test_series_too_short_for_the_lag_are_refused() -> None:
    with pytest.raises(InputError, match="samples or more"):
        time_lag(np.zeros(12), np.zeros(12), interval_s=1.0, longest_s=10.0)


@given(st.floats(-179.0, 179.0))
@settings(max_examples=40, deadline=None, derandomize=True)
def test_any_turn_of_a_sonic_comes_back(trim_deg: float) -> None:
    """The truth is the sonic's wind turned clockwise, by a rotation matrix of its own."""
    rng = np.random.default_rng(5)
    sonic = rng.normal((3.0, 7.0, 0.0), 1.0, (400, 3))
    c, s = np.cos(np.radians(trim_deg)), np.sin(np.radians(trim_deg))
    true = sonic @ np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    beams = unit_vector(np.array([-30.0, 30.0]), np.array([4.0, 4.0]))
    measured = true @ beams.T + 0.05 * rng.standard_normal((400, 2))
    found = orientation_trim([-30.0, 30.0], 4.0, measured, *(part[:, None] for part in sonic.T))
    assert (found.trim_deg - trim_deg + 180.0) % 360.0 - 180.0 == pytest.approx(0.0, abs=0.2)
    assert found.after_mps == pytest.approx(0.05, abs=0.01)
    assert found.after_mps <= found.before_mps + 1e-12


def test_missing_samples_are_left_out_and_nothing_gives_nothing() -> None:
    u, v = np.array([0.0, np.nan]), np.array([8.0, 8.0])
    assert orientation_trim([0.0, 0.0], 0.0, [8.0, 3.0], u, v).trim_deg == pytest.approx(0.0, abs=1e-6)
    assert np.isnan(orientation_trim([0.0], 0.0, [np.nan], [1.0], [1.0]).trim_deg)


def test_two_sonics_share_the_lidars_heading_and_keep_their_difference() -> None:
    """The WindEye test trimmed each sonic on its own beam: across north too."""
    trims = tuple(
        orientation_trim([0.0, 90.0], 0.0, [0.0, 8.0], 8 * np.cos(a), 8 * np.sin(a))
        for a in np.radians([3.0, -1.0])
    )
    assert two_sonics_trim(trims) == pytest.approx((1.0, 4.0), abs=1e-6)  # type: ignore[arg-type]
