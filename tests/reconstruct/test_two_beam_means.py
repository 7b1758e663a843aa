"""The quality rules of the WindEye test, one at a time, against its own equations."""

import numpy as np
import pytest

from geometry.errors import InputError
from reconstruct.two_beam_means import two_beam_means

START = np.datetime64("2014-10-01T00:00:00", "ns")


def beams(speed_mps: float, angle_deg: float, count: int = 120) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """V1 and V2 of the source's equations (positive toward), turned to positive away, one sample a second."""
    a, phi = np.radians(30.0), np.radians(angle_deg)
    across, along = speed_mps * np.sin(phi), speed_mps * np.cos(phi)
    first, second = along * np.cos(a) + across * np.sin(a), along * np.cos(a) - across * np.sin(a)
    return START + np.arange(count) * np.timedelta64(1, "s"), np.full(count, -first), np.full(count, -second)


@pytest.mark.parametrize(("speed", "angle"), [(8.0, 0.0), (12.0, 25.0), (5.0, -29.0)])
def test_the_sources_equations_come_back(speed: float, angle: float) -> None:
    found = two_beam_means(*beams(speed, angle), half_angle_deg=30.0)
    assert found.wind.speed_mps == pytest.approx([speed])
    assert found.wind.angle_deg == pytest.approx([angle])
    assert found.time_utc.tolist() == (START + np.array([120]) * np.timedelta64(1, "s")).tolist()


def test_99_of_120_samples_are_too_few_on_either_beam() -> None:
    time, left, right = beams(8.0, 10.0)
    right[:20] = np.nan
    assert len(two_beam_means(time, left, right, half_angle_deg=30.0).time_utc) == 1
    right[20] = np.nan
    found = two_beam_means(time, left, right, half_angle_deg=30.0)
    assert [(step.before, step.after) for step in found.steps] == [(1, 0), (0, 0), (0, 0)]


def test_a_beam_that_sees_hardly_any_wind_and_a_wind_from_aside_are_left_out() -> None:
    slow = two_beam_means(*beams(1.1, 0.0), half_angle_deg=30.0)
    assert [step.after for step in slow.steps] == [1, 0, 0]
    aside = two_beam_means(*beams(9.0, 31.0), half_angle_deg=30.0)
    assert [step.after for step in aside.steps] == [1, 1, 0]


def test_arrays_of_different_length_are_refused() -> None:
    time, left, right = beams(8.0, 0.0)
    with pytest.raises(InputError, match="equally many"):
        two_beam_means(time, left[1:], right, half_angle_deg=30.0)
