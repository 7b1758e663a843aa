"""How a lidar stood: the rotation of each ray, the smoothing of a log, its drift."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from geometry.head import Mounting
from reconstruct.attitude import (
    add_log_means,
    changes_from,
    drift,
    drifts,
    log_means,
    pointing_angles,
    running_mean,
)

START = np.datetime64("2014-05-01T00:00:00", "ns")
TILT = st.floats(-60, 60)
ANGLES = st.tuples(st.floats(-400, 400), TILT, TILT, st.floats(0, 360), st.floats(-80, 80))


def times(seconds: object) -> np.ndarray:
    return START + (np.asarray(seconds, dtype=float) * 1e9).astype("timedelta64[ns]")


@settings(derandomize=True, max_examples=50, deadline=None)
@given(rays=st.lists(ANGLES, min_size=1, max_size=5), azimuth_offset=TILT, elevation_offset=st.floats(-5, 5))
def test_each_ray_is_turned_as_a_mounting_of_its_own_would(
    rays: list[tuple[float, ...]], azimuth_offset: float, elevation_offset: float
) -> None:
    """The matrices of `geometry.head.Mounting` are the second formula."""
    heading, pitch, roll, azimuth, elevation = np.array(rays).T
    offsets = {"azimuth_offset_deg": azimuth_offset, "elevation_offset_deg": elevation_offset}
    found = pointing_angles(
        azimuth,
        elevation,
        Mounting(77.0, 3.0, 2.0, **offsets),
        heading_deg=heading,
        pitch_deg=pitch,
        roll_deg=roll,
    )
    for number, (own_heading, own_pitch, own_roll, own_azimuth, own_elevation) in enumerate(rays):
        stands = Mounting(own_heading, own_pitch, own_roll, **offsets)
        wanted = stands.to_true(own_azimuth, own_elevation)
        off = (found[0][number] - wanted[0] + 180.0) % 360.0 - 180.0
        assert abs(off) * np.cos(np.radians(wanted[1])) < 1e-6
        assert abs(found[1][number] - wanted[1]) < 1e-6


def test_a_running_mean_follows_a_ramp_and_takes_the_scatter_of_a_compass_away() -> None:
    rng = np.random.default_rng(1)
    seconds = np.arange(0.0, 6000.0, 1.0)
    smooth = running_mean(times(seconds), 1e-3 * seconds + rng.normal(0, 1.3, len(seconds)), window_s=600.0)
    inside = slice(300, -300)
    assert np.max(np.abs(smooth[inside] - 1e-3 * seconds[inside])) < 4 * 1.3 / np.sqrt(600)
    ramp = running_mean(times(seconds), 1e-3 * seconds, window_s=600.0)
    np.testing.assert_allclose(ramp[inside], 1e-3 * seconds[inside], atol=1e-9)


def test_changes_go_the_shorter_way_round_north() -> None:
    changes = changes_from(np.array([[359.0, 0.1, np.nan], [2.0, 0.0, np.nan]]), np.array([1.0, 0.0, np.nan]))
    np.testing.assert_allclose(changes[:, :2], [[-2.0, 0.1], [1.0, 0.0]])
    assert np.all(np.isnan(changes[:, 2]))


def test_the_drift_of_a_log_does_not_depend_on_how_it_is_cut() -> None:
    """A heading that turns by 1 degree a day, in parts that end within a ten-minute period."""
    seconds = np.arange(0.0, 3 * 86_400.0, 30.0)
    changes = np.stack(
        [seconds / 86_400.0, np.full(len(seconds), 0.1), np.full(len(seconds), np.nan)], axis=1
    )
    whole = drifts(log_means(times(seconds), changes))
    cuts = np.split(np.arange(len(seconds)), [777, 778, 5000])
    parts = drifts(add_log_means([log_means(times(seconds[cut]), changes[cut]) for cut in cuts]))
    assert list(whole) == ["heading_deg", "pitch_deg"]
    assert whole["heading_deg"].per_day_deg == pytest.approx(1.0, abs=1e-6)
    assert whole["pitch_deg"].per_day_deg == pytest.approx(0.0, abs=1e-9)
    for name in whole:
        assert parts[name] == pytest.approx(whole[name], abs=1e-9, nan_ok=True)


@pytest.mark.parametrize("memory", [0.0, 0.8])
def test_the_standard_error_is_the_scatter_of_slopes_of_alike_means(memory: float) -> None:
    """Over 300 made logs of red noise; and a drift that is not there is found significant in about one of twenty."""
    rng, days, slopes, errors, wrong = np.random.default_rng(5), np.arange(432) / 144, [], [], 0
    for _ in range(300):
        noise = rng.normal(size=len(days))
        for index in range(1, len(days)):
            noise[index] += memory * noise[index - 1]
        found = drift(days, noise)
        slopes.append(found.per_day_deg)
        errors.append(found.standard_error_deg)
        wrong += found.significant
    assert np.mean(errors) == pytest.approx(np.std(slopes), rel=0.15)
    assert 0.02 < wrong / 300 < 0.1


def test_too_short_a_log_has_no_standard_error() -> None:
    assert not drift([0.0], [1.0]).significant
    assert np.isnan(drift([0.0], [1.0]).per_day_deg)
    assert np.isnan(drift([0.0, 1.0], [1.0, 2.0]).standard_error_deg)
