"""Period means: stamps, scalar and vector, directions on the circle, counts, sums that add up."""

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from geometry.errors import InputError
from reconstruct.averaging import (
    add_sums,
    common_periods,
    expected_count,
    means_of,
    period_means,
    period_sums,
)
from reconstruct.wind import uv_mps

START = np.datetime64("2014-05-01T00:00:00", "ns")


def times(seconds: object) -> np.ndarray:
    return START + (np.asarray(seconds) * 1e9).astype("timedelta64[ns]")


def test_a_mean_is_stamped_at_the_end_of_its_period() -> None:
    means = period_means(times([0.0, 599.9, 600.0]), np.ones(3), np.zeros(3))
    assert means.time_utc.tolist() == times([600.0, 1200.0]).tolist()
    assert means.count.tolist() == [2, 1]


def test_means_are_those_of_pandas() -> None:
    """pandas' resample with the label on the right is a second way to the scalar means and counts."""
    rng = np.random.default_rng(1)
    seconds = np.sort(rng.uniform(0.0, 7200.0, 500))
    u, v = rng.normal(5.0, 1.0, 500), rng.normal(-3.0, 1.0, 500)
    means = period_means(times(seconds), u, v, period_s=600.0)
    series = pd.DataFrame({"u": u, "v": v, "speed": np.hypot(u, v)}, index=times(seconds))
    grouped = series.resample("600s", label="right", closed="left")
    np.testing.assert_array_equal(means.count, grouped["u"].count())
    np.testing.assert_allclose(means.speed_mps, grouped["speed"].mean())
    np.testing.assert_allclose(means.speed_std_mps, grouped["speed"].std())
    np.testing.assert_allclose(means.vector_speed_mps, np.hypot(grouped["u"].mean(), grouped["v"].mean()))
    np.testing.assert_array_equal(means.time_utc, grouped["u"].mean().index.to_numpy())


def test_directions_around_north_average_to_north() -> None:
    u, v = uv_mps(8.0, np.array([350.0, 10.0]))
    means = period_means(times([1.0, 2.0]), u, v)
    assert (means.from_deg + 180.0) % 360.0 == pytest.approx(180.0)
    assert means.speed_mps[0] == pytest.approx(8.0)
    assert means.vector_speed_mps[0] == pytest.approx(8.0 * np.cos(np.radians(10.0)))


def test_a_vane_weighs_every_sample_alike_and_the_mean_vector_by_its_speed() -> None:
    u, v = uv_mps(np.array([10.0, 1.0]), np.array([180.0, 270.0]))
    means = period_means(times([1.0, 2.0]), u, v)
    assert means.vane_deg[0] == pytest.approx(225.0)
    assert means.from_deg[0] == pytest.approx(180.0 + np.degrees(np.arctan2(1.0, 10.0)))


def test_a_calm_has_no_direction_and_missing_samples_do_not_count() -> None:
    means = period_means(times([1.0, 2.0, 3.0]), np.array([0.0, np.nan, 0.0]), np.zeros(3))
    assert means.count.tolist() == [2]
    assert np.isnan(means.from_deg[0])
    assert means.speed_mps[0] == 0.0


def test_a_shift_moves_samples_into_the_next_period() -> None:
    late = period_means(times([595.0]), np.ones(1), np.ones(1), shift_s=5.0)
    assert late.time_utc[0] == times(1200.0)


def test_availability_is_the_share_of_what_a_full_period_has() -> None:
    """The study: 50 scans of 12 s in ten minutes; 19 are 38 %."""
    means = period_means(times(np.arange(19) * 12.0), np.ones(19), np.ones(19))
    assert means.availability(12.0).tolist() == [19 / 50]
    assert expected_count(600.0, 7000.0) == 1


@given(
    st.lists(st.tuples(st.floats(0, 5000), st.floats(-20, 20), st.floats(-20, 20)), min_size=2, max_size=40),
    st.integers(1, 39),
)
@settings(max_examples=50, deadline=None, derandomize=True)
def test_sums_of_parts_are_the_sums_of_the_whole(samples: list[tuple[float, float, float]], cut: int) -> None:
    seconds, u, v = (np.array(part) for part in zip(*samples, strict=True))
    whole = period_means(times(seconds), u, v)
    parts = [period_sums(times(seconds)[part], u[part], v[part]) for part in (slice(cut), slice(cut, None))]
    again = means_of(add_sums(parts))
    np.testing.assert_array_equal(again.count, whole.count)
    np.testing.assert_allclose(again.speed_mps, whole.speed_mps, atol=1e-9)
    np.testing.assert_allclose(again.vector_speed_mps, whole.vector_speed_mps, atol=1e-9)


def test_only_shared_periods_are_compared_in_order() -> None:
    one = period_means(times([1.0, 601.0, 1801.0]), np.ones(3), np.ones(3))
    other = period_means(times([1801.0, 700.0]), np.ones(2), np.ones(2))
    first, second = common_periods(one, other)
    assert first.time_utc.tolist() == second.time_utc.tolist() == times([1200.0, 2400.0]).tolist()


def test_periods_of_different_length_are_not_mixed() -> None:
    one, other = (period_means(times([1.0]), np.ones(1), np.ones(1), period_s=s) for s in (60.0, 600.0))
    with pytest.raises(InputError, match="only equal ones"):
        common_periods(one, other)
    with pytest.raises(InputError, match="one length"):
        add_sums([])
    with pytest.raises(InputError, match="above 0"):
        period_means(times([1.0]), np.ones(1), np.ones(1), period_s=0.0)
