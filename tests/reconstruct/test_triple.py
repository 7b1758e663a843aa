"""Three lidars at one place: prediction through the fit's own three columns, pairing in time, means of single beams."""

import numpy as np
import pandas as pd
import pytest

from geometry.errors import InputError
from geometry.gates import Probe
from reconstruct.beam_means import add_beam_sums, along_beam_mps, beam_means, beam_sums
from reconstruct.monte_carlo import Settings, simulate
from reconstruct.multi_doppler import triple_doppler_wind
from reconstruct.pairing import RaySeries, compare_gaps, joint_wind
from reconstruct.prediction import predict_noise
from reconstruct.rays import Rays
from reconstruct.scan_grid import alternating_passes
from reconstruct.uncertainty import ErrorSources
from reconstruct.wind import WindState

START = np.datetime64("2024-01-01T00:00:00", "ns")
AZIMUTH, ELEVATION = np.array([10.0, 130.0, 250.0]), np.array([15.0, 30.0, 20.0])
WIND = WindState(speed_mps=9.0, from_deg=230.0)


def beams(columns: int) -> Rays:
    return Rays(
        azimuth_deg=AZIMUTH, elevation_deg=ELEVATION, range_m=np.full(3, 800.0), head_m=np.zeros((3, 3)),
        lidar=np.arange(3), time_s=np.full(3, 0.5), duration_s=np.ones(3), swept_azimuth_deg=np.zeros(3),
        probes=(Probe(200, 256),) * 3, period_s=1.0, columns=columns,  # type: ignore[arg-type]
    )  # fmt: skip


def test_predicted_noise_of_three_columns_is_that_of_drawn_winds() -> None:
    """200,000 draws through the real retrieval; fitting w costs u and v something that two columns do not show."""
    rng = np.random.default_rng(1)
    drawn = triple_doppler_wind(AZIMUTH, ELEVATION, rng.normal(0.0, 0.2, (200_000, 3))).wind_mps
    three, two = (predict_noise(beams(columns), WIND, 0.2) for columns in (3, 2))
    assert three.covariance_m2s2 == pytest.approx(np.cov(drawn[:, :2].T), rel=0.02, abs=1e-3)
    assert np.all(np.diag(three.covariance_m2s2) > np.diag(two.covariance_m2s2))
    assert three.condition > two.condition


def test_a_vertical_wind_leans_on_two_columns_and_not_on_three() -> None:
    """The judge flies both through a rising air: the bias along the wind is gone with w."""
    rising = WindState(speed_mps=9.0, from_deg=230.0, vertical_mps=1.0)
    settings = Settings(realisations=4)
    bias = []
    for columns in (2, 3):
        found = simulate(
            beams(columns),
            rising,
            rng=np.random.default_rng(1),
            sources=ErrorSources(),
            settings=settings,
        )
        assert found.scan_mps.shape[-1] == 2
        bias.append(np.abs(np.mean(found.scan_mps, axis=(0, 1)) - rising.uv_mps).max())
    assert bias[1] < 1e-9 < 0.1 < bias[0]


def series(seconds: list[float], number: int) -> RaySeries:
    count = len(seconds)
    time = START + (np.array(seconds) * 1e9).astype("timedelta64[ns]")
    return RaySeries(
        time, np.full(count, AZIMUTH[number]), np.full(count, ELEVATION[number]), np.arange(count) + 1.0
    )


def test_three_rays_meet_where_all_of_them_are_near_each_other() -> None:
    """At 0 s all three; at 10 s the third is 3 s from the first and 5 from the second; at 20 s the second is missing."""
    first, second, third = series([0, 10, 20], 0), series([1, 8, 40], 1), series([2, 13, 20], 2)
    strict, wide = (joint_wind((first, second, third), gap_s=gap) for gap in (4.0, 5.0))
    assert strict.gap_s.tolist() == [2.0]
    assert wide.gap_s.tolist() == [2.0, 5.0]
    assert ((strict.time_utc - START) / np.timedelta64(1, "s")).tolist() == [1.0]
    wanted = triple_doppler_wind(AZIMUTH, ELEVATION, [2.0, 2.0, 2.0]).wind_mps
    np.testing.assert_allclose(wide.fit.wind_mps[1], wanted, atol=1e-12)
    assert joint_wind((first, second, third), gap_s=5.0, columns=2).fit.wind_mps.shape == (2, 2)
    with pytest.raises(InputError, match="two or more"):
        joint_wind((first,), gap_s=1.0)


def test_the_means_of_beams_are_those_of_pandas_also_from_parts() -> None:
    rng = np.random.default_rng(2)
    frame = pd.DataFrame(
        {
            "time": START + (rng.uniform(0, 3600, 2000) * 1e9).astype("timedelta64[ns]"),
            "cell": rng.integers(0, 7, 2000),
            "speed": np.where(rng.uniform(size=2000) < 0.1, np.nan, rng.normal(5.0, 2.0, 2000)),
        }
    )
    parts = [
        beam_sums(
            part["time"].to_numpy(),
            part["cell"].to_numpy(),
            part["speed"].to_numpy(),
            period_s=600.0,
            shift_s=90.0,
        )
        for part in (frame[:700], frame[700:])
    ]
    means = beam_means(add_beam_sums(parts))
    ends = (frame["time"] + pd.Timedelta(seconds=90)).dt.floor("600s") + pd.Timedelta(seconds=600)
    grouped = frame.dropna().groupby([ends.to_numpy()[frame["speed"].notna()], "cell"])["speed"]
    wanted = grouped.agg(["count", "mean", "std"])
    assert (
        means.time_utc.tolist()
        == wanted.index.get_level_values(0).to_numpy().astype("datetime64[ns]").tolist()
    )
    assert means.cell.tolist() == wanted.index.get_level_values(1).tolist()
    assert means.count.tolist() == wanted["count"].tolist()
    np.testing.assert_allclose(means.radial_speed_mps, wanted["mean"])
    np.testing.assert_allclose(means.radial_speed_std_mps, wanted["std"], rtol=1e-9)
    with pytest.raises(InputError, match="one length"):
        add_beam_sums([parts[0], beam_sums(np.array([START]), np.array([0]), np.array([1.0]), period_s=60.0)])


def test_the_wind_along_a_beam_is_exact_in_level_air_and_off_by_w_tan_otherwise() -> None:
    elevation = np.radians(40.0)
    level, rising = 7.0 * np.cos(elevation), 7.0 * np.cos(elevation) + 0.5 * np.sin(elevation)
    assert along_beam_mps(level, 40.0) == pytest.approx(7.0)
    assert along_beam_mps(rising, 40.0) == pytest.approx(7.0 + 0.5 * np.tan(elevation))


def test_every_ray_of_two_beams_stands_in_one_pass_whatever_is_missing() -> None:
    rng = np.random.default_rng(3)
    azimuth = np.tile([330.0, 30.0], 500)
    there = rng.uniform(size=1000) > 0.2
    time = START + (np.arange(1000) * 1e9).astype("timedelta64[ns]")
    passes = alternating_passes(azimuth[there], time[there], longest_s=1.5)
    frame = pd.DataFrame({"pass": passes, "azimuth": azimuth[there], "second": np.flatnonzero(there)})
    grouped = frame.groupby("pass")
    assert grouped["azimuth"].nunique().eq(grouped.size()).all()
    assert grouped.size().max() == 2
    assert (grouped["second"].max() - grouped["second"].min()).max() <= 1


def test_gaps_are_compared_with_the_columns_of_the_pair() -> None:
    """Three level beams know nothing of w: two columns give the spread of 8 and 10 m/s from the south in turns, 1 m/s."""
    time = START + np.arange(600) * np.timedelta64(1, "s")
    north = np.where(np.arange(600) % 2, 8.0, 10.0)
    level = [
        RaySeries(time, np.full(600, azimuth), np.zeros(600), north * np.cos(np.radians(azimuth)))
        for azimuth in (0.0, 120.0, 240.0)
    ]
    (found,) = compare_gaps(*level, gaps_s=[0.5], columns=2)
    assert found.pairs == 600
    assert found.spread_mps == pytest.approx(1.0, rel=2e-3)
