"""Speed, direction and components of the wind."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from geometry.errors import InputError
from reconstruct.wind import WindState, from_deg, scalar_mean, speed_mps, uv_mps, vector_mean


@pytest.mark.parametrize(
    ("origin", "u", "v"), [(0, 0, -1), (90, -1, 0), (180, 0, 1), (270, 1, 0)], ids=["N", "E", "S", "W"]
)
def test_a_wind_from_a_quarter_blows_to_the_opposite_one(origin: float, u: float, v: float) -> None:
    """A wind from the north blows to the south, and so on."""
    np.testing.assert_allclose(uv_mps(1.0, origin), (u, v), atol=1e-15)
    assert float(from_deg(u, v)) == origin


@settings(derandomize=True, max_examples=60, deadline=None)
@given(st.floats(1e-3, 100), st.floats(0, 359.999999))
def test_there_and_back_again(speed: float, origin: float) -> None:
    """Speed and direction survive the way through components."""
    u, v = uv_mps(speed, origin)
    assert float(speed_mps(u, v)) == pytest.approx(speed, rel=1e-14)
    assert abs((float(from_deg(u, v)) - origin + 180) % 360 - 180) < 1e-12


def test_a_direction_a_hair_west_of_north_is_not_360() -> None:
    """Rounding never gives 360 degrees."""
    assert 0 <= float(from_deg(1e-20, -10.0)) < 360


def test_a_calm_comes_from_nowhere() -> None:
    """A calm has no direction."""
    assert np.isnan(from_deg(0.0, 0.0))


def test_scalar_mean_exceeds_vector_mean_by_lateral_variance_over_twice_the_speed() -> None:
    """The excess is σ_v²/2V for small σ_v."""
    side = 0.1 * np.sqrt(2) * np.sin(np.arange(360) * np.pi / 180)  # variance 0.01
    u = np.full(360, 10.0)
    mean_u, mean_v = vector_mean(u, side)
    assert float(scalar_mean(u, side) - speed_mps(mean_u, mean_v)) == pytest.approx(0.01 / 20, rel=1e-3)


def test_means_leave_out_missing_samples_and_nothing_gives_nothing() -> None:
    """NaN samples do not count; without samples the mean is NaN."""
    assert float(scalar_mean([5.0, np.nan], [0.0, 1.0])) == 5.0
    assert np.all(np.isnan(vector_mean([np.nan], [1.0])))


@pytest.mark.parametrize("bad", [{"speed_mps": -1.0}, {"from_deg": np.nan}, {"height_m": 0.0}])
def test_a_wind_that_cannot_be_is_refused(bad: dict[str, float]) -> None:
    """Negative speeds, NaN and targets in the ground are input errors."""
    with pytest.raises(InputError):
        WindState(**{"speed_mps": 10.0, "from_deg": 0.0, **bad})
