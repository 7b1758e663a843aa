"""Pairing of rays in time, and dual Doppler made of the pairs."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from geometry.errors import InputError
from reconstruct.pairing import RaySeries, compare_gaps, dual_wind, pair_within
from reconstruct.wind import uv_mps

START = np.datetime64("2014-05-01T00:00:00", "ns")
TIMES = st.lists(st.integers(0, 2000), min_size=1, max_size=30)


def times(seconds: object) -> np.ndarray:
    return START + (np.asarray(seconds, dtype=float) * 1e9).astype("timedelta64[ns]")


def series(seconds: object, azimuth_deg: float, wind_uv: np.ndarray, elevation_deg: float = 5.0) -> RaySeries:
    """Rays of a wind (time, 2), without a vertical part."""
    count = len(np.asarray(seconds))
    angle, level = np.radians(azimuth_deg), np.cos(np.radians(elevation_deg))
    speed = (wind_uv[:, 0] * np.sin(angle) + wind_uv[:, 1] * np.cos(angle)) * level
    return RaySeries(times(seconds), np.full(count, azimuth_deg), np.full(count, elevation_deg), speed)


@given(TIMES, TIMES, st.floats(0.0, 30.0))
@settings(max_examples=100, deadline=None, derandomize=True)
def test_each_ray_stands_in_one_pair_at_the_most_and_each_pair_is_near(
    first: list[int], second: list[int], gap_s: float
) -> None:
    one, other = np.sort(first) / 10, np.sort(second) / 10
    pairs = pair_within(times(one), times(other), gap_s=gap_s)
    assert len(set(pairs.first.tolist())) == len(pairs.first)
    assert len(set(pairs.second.tolist())) == len(pairs.second)
    np.testing.assert_allclose(other[pairs.second] - one[pairs.first], pairs.gap_s, atol=1e-6)
    assert np.all(np.abs(pairs.gap_s) <= gap_s + 1e-6)


def test_synchronised_rays_are_all_paired_with_no_gap() -> None:
    when = np.arange(0.0, 60.0, 0.5)
    pairs = pair_within(times(when), times(when), gap_s=0.25)
    assert np.array_equal(pairs.first, pairs.second)
    assert len(pairs.first) == 120


def test_dual_wind_is_the_closed_form_of_newsom() -> None:
    """u = (v1 cosθ2 - v2 cosθ1)/(cosφ sin(θ1 - θ2)), Newsom et al. (2015); the same for v with sines."""
    wind = np.stack(uv_mps(np.array([8.0, 9.0]), np.array([200.0, 240.0])), axis=-1)
    first, second = series([0, 10], 169.0, wind), series([0, 10], 232.0, wind)
    found = dual_wind(first, second, gap_s=0.5).fit.wind_mps
    one, two, level = np.radians(169.0), np.radians(232.0), np.cos(np.radians(5.0))
    v1, v2 = first.radial_speed_mps, second.radial_speed_mps
    u = (v1 * np.cos(two) - v2 * np.cos(one)) / (level * np.sin(one - two))
    v = (v2 * np.sin(one) - v1 * np.sin(two)) / (level * np.sin(one - two))
    np.testing.assert_allclose(found, np.stack([u, v], axis=-1), atol=1e-12)
    np.testing.assert_allclose(found, wind, atol=1e-12)


def test_missing_rays_find_no_partner_and_do_not_block_another() -> None:
    wind = np.tile([3.0, 4.0], (3, 1))
    first, second = series([0, 4, 8], 170.0, wind), series([1, 5, 9], 230.0, wind)
    second.radial_speed_mps[1] = np.nan
    assert dual_wind(first, second, gap_s=2.0).gap_s.tolist() == [1.0, 1.0]


def test_the_time_of_a_pair_is_the_middle() -> None:
    wind = np.tile([3.0, 4.0], (1, 1))
    pair = dual_wind(series([0.0], 170.0, wind), series([3.0], 230.0, wind), gap_s=5.0)
    assert pair.time_utc[0] == times(1.5)


def test_a_larger_gap_gives_more_pairs_and_more_wind_that_has_changed() -> None:
    """Two sector scans of 12 and 13 s that meet at the crossing, in a wind that swings by 2 m/s in a minute."""
    when = [np.arange(0.0, 7200.0, period) for period in (12.0, 13.0)]

    def wind(seconds: np.ndarray) -> np.ndarray:
        return np.stack(uv_mps(9.0 + np.sin(2 * np.pi * seconds / 60.0), 200.0), axis=-1)

    first, second = (series(t, a, wind(t)) for t, a in zip(when, (169.0, 232.0), strict=True))
    results = compare_gaps(first, second)
    assert [result.gap_s for result in results] == [0.5, 2.0, 5.0, 8.0]
    counts = [result.pairs for result in results]
    assert counts == sorted(counts)
    assert counts[0] < counts[1] < counts[2]
    assert results[-1].share > 0.9
    errors = []
    for result in results:
        pairs = dual_wind(first, second, gap_s=result.gap_s)
        seconds = (pairs.time_utc - START) / np.timedelta64(1, "s")
        errors.append(np.sqrt(np.mean((pairs.fit.wind_mps - wind(seconds)) ** 2)))
        assert result.mean_gap_s == pytest.approx(np.mean(np.abs(pairs.gap_s)))
    assert errors == sorted(errors)
    parts = (
        compare_gaps(first.at(slice(0, 50)), second)[2],
        compare_gaps(first.at(slice(50, None)), second)[2],
    )
    assert (parts[0] + parts[1]).pairs >= results[2].pairs


def test_the_spread_of_paired_winds_is_that_of_their_speeds_within_ten_minutes() -> None:
    """Two periods, each steady but for +-1 m/s; the step of 4 m/s between them does not count."""
    seconds = np.arange(0.0, 1200.0, 10.0)
    speed = np.where(seconds < 600, 6.0, 10.0) + np.where(np.arange(len(seconds)) % 2, 1.0, -1.0)
    wind = np.stack([np.zeros(len(seconds)), speed], axis=1)
    result = compare_gaps(series(seconds, 30.0, wind), series(seconds, 300.0, wind), gaps_s=[0.5])[0]
    assert result.spread_mps == pytest.approx(np.sqrt(60 / 59), abs=1e-3)


def test_nothing_to_pair_and_bad_input_are_told() -> None:
    empty = times([])
    assert len(pair_within(empty, times([1.0]), gap_s=1.0).first) == 0
    with pytest.raises(InputError, match="0 or more"):
        pair_within(empty, empty, gap_s=-1.0)
    with pytest.raises(InputError, match="backwards"):
        pair_within(times([2.0, 1.0]), times([1.0]), gap_s=1.0)
