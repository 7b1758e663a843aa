"""Clocks set by the mast, sonics trimmed by the lidars' beams: estimated, applied and said."""

import re
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from geometry.beams import unit_vector
from geometry.errors import InputError
from planner import cli
from planner.analysis import retrieve
from planner.campaign_logs import SonicInput
from planner.clocks import clock_lag, trim_sonic
from planner.files.yaml_campaign import load_campaign
from planner.files.yaml_site import parse_site
from planner.mast_file import WindSeries
from planner.plan import Plan
from planner.simulation import Options
from planner.virtual_files import write_virtual
from reconstruct.alignment import sample_lag
from reconstruct.pairing import RaySeries
from reconstruct.virtual import VirtualSettings

SITE = """\
name: Moor
crs: EPSG:32632
ground_height_m: 4.8
lidars:
  - {name: S, position: [447893.983, 6256558.133, 5.078], instrument: windscanner-200s}
masts:
  - {name: mast, position: [447647.39, 6255435.76, 4.836], height_m: 116.5}
targets:
  - {name: cup, mast: mast, height_m: 120.0}
scans:
  - {name: sector, lidar: S, target: cup, type: sector, sector_deg: 60, step_deg: 2, accumulation_s: 0.4, period_s: 12}
wind:
  weibull: {scale_mps: 8.9, shape: 2.75}
  directions_deg: [[150, 230]]
  shear_exponent: 0
  turbulence: {intensity: 0.09, length_m: 170}
"""
START = np.datetime64("2024-01-01", "ns")


def gusty(hours: float, step_s: float = 1.0) -> WindSeries:
    """A wind that changes over half a minute and more, turning through 60 degrees, with gaps."""
    rng = np.random.default_rng(4)
    seconds = np.arange(0.0, 3600.0 * hours, step_s)
    time = START + (seconds * 1e9).astype("timedelta64[ns]")
    slow = np.sum([np.sin(seconds / each + rng.uniform(0, 6)) for each in (31.0, 77.0, 190.0, 900.0)], axis=0)
    turn = np.radians(200.0 + 30.0 * np.sin(seconds / 1100.0))
    speed = 8.0 + slow
    u, v = -speed * np.sin(turn), -speed * np.cos(turn)
    u[2000:2600] = np.nan
    return WindSeries(time, u, v, step_s)


def rays_of(wind: WindSeries, azimuth_deg: float, *, late_s: float = 0.0, every_s: float = 7.3) -> RaySeries:
    """Rays that see a wind along a beam at times of their own, shown late."""
    seconds = np.arange(50.0, 3600.0 * 3 - 50.0, every_s)
    at = (wind.time_utc - START) / np.timedelta64(1, "s")
    known = np.isfinite(wind.u_mps)
    u, v = (np.interp(seconds, at[known], part[known]) for part in (wind.u_mps, wind.v_mps))
    beam = unit_vector(azimuth_deg, 5.0)
    count = len(seconds)
    noise = np.random.default_rng(9).normal(0, 0.1, count)
    time = START + ((seconds + late_s) * 1e9).astype("timedelta64[ns]")
    return RaySeries(
        time, np.full(count, azimuth_deg), np.full(count, 5.0), u * beam[0] + v * beam[1] + noise
    )


@pytest.mark.parametrize("late_s", [-18.4, 0.0, 12.3])
def test_the_lag_of_rays_at_times_of_their_own_is_found(late_s: float) -> None:
    """Cut into parts anywhere: the days are put together again."""
    wind = gusty(3.0)
    rays = rays_of(wind, 170.0, late_s=late_s)
    parts = (rays.at(slice(start, start + 100)) for start in range(0, len(rays.time_utc), 100))
    lag = clock_lag(parts, wind, longest_s=60.0)
    assert lag.lag_s == pytest.approx(late_s, abs=0.2)
    assert lag.correlation > 0.98
    assert lag.days == 1 + (late_s < -50.0)


def test_no_lag_is_made_up_and_a_coarse_mast_is_told() -> None:
    wind = gusty(3.0)
    noise = rays_of(wind, 170.0)._replace(radial_speed_mps=np.random.default_rng(1).normal(size=1466))
    assert np.isnan(clock_lag([noise], wind, longest_s=60.0).lag_s)
    with pytest.raises(InputError, match="600 s apart"):
        clock_lag([noise], wind._replace(interval_s=600.0), longest_s=60.0)
    assert np.isnan(sample_lag([0.0, 1.0], [1.0, 2.0], [0.5], [1.5], longest_s=1.0).lag_s)


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a virtual campaign of an hour."""
    folder = tmp_path_factory.mktemp("flown")
    options = Options(days=6 / 144, seed=1, lost_share=0.0, settings=VirtualSettings(spacing_m=34.0))
    return write_virtual(Plan(parse_site(SITE)), SITE, folder, options=options)[0].parent


@pytest.fixture
def campaign(flown: Path, tmp_path: Path) -> Callable[..., Path]:
    """A copy of it, with some of its file's text replaced: gives the campaign file."""

    def changed(*pairs: tuple[str, str]) -> Path:
        shutil.copytree(flown, tmp_path, dirs_exist_ok=True)
        path = tmp_path / "campaign.yaml"
        text = path.read_text(encoding="utf-8")
        for old, new in pairs:
            assert old in text
            text = text.replace(old, new)
        path.write_text(text, encoding="utf-8")
        return path

    return changed


def test_rays_of_a_late_clock_are_moved_back_to_the_masts(
    campaign: Callable[..., Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Forty seconds late: the means are those of the right clock again, and the log says by how much it was set."""
    path = campaign(
        ('"sector-????.csv"', '"sector-????.csv", offsets: {clock_s: 40}'),
        ("mast:", "time_lag: {against: mast, longest_s: 120}\nsizes_deg: [60]\nmast:"),
    )
    found = retrieve(load_campaign(path))
    assert found.clocks["sector"].lag_s == pytest.approx(40.0, abs=4.0)
    means = pd.read_csv(tmp_path / "results" / "means_600s.csv")
    truth = pd.read_csv(tmp_path / "truth.csv")
    assert len(means) == len(truth)
    assert (
        np.max(np.abs(means["speed_mps"] - truth["speed_mps"])) < 1.0
    )  # a minute of the wrong state: 0.5 m/s more
    log = (tmp_path / "results" / "retrieve.log").read_text(encoding="utf-8")
    assert "clock set by the mast: rays were" in log
    assert f"clock moved by {40.0 - found.clocks['sector'].lag_s:+.4g} s" in log
    assert cli.run(["retrieve", str(path), "--json"]) == 0
    assert '"clocks"' in capsys.readouterr().out


def test_a_lag_against_a_mast_that_is_not_there_is_told(campaign: Callable[..., Path]) -> None:
    path = campaign(("mast: {path: mast.csv}", "time_lag: {against: mast}"))
    with pytest.raises(InputError, match=r"time_lag\.against"):
        load_campaign(path)


def sonic_file(folder: Path, name: str, wind: WindSeries, turned_deg: float) -> SonicInput:
    """A sonic that shows the wind turned, as a file of speed and direction."""
    angle = np.degrees(np.arctan2(-wind.u_mps, -wind.v_mps)) + turned_deg
    speed = np.hypot(wind.u_mps, wind.v_mps)
    frame = pd.DataFrame({"time_utc": wind.time_utc, "speed_mps": speed, "from_deg": angle % 360.0})
    frame.to_csv(folder / f"{name}.csv", index=False)
    return SonicInput(name=name, scan=f"beam {name}", path=str(folder / f"{name}.csv"))


def test_two_sonics_are_trimmed_each_by_its_beam(tmp_path: Path) -> None:
    """Turned by -7 and -5 degrees, three seconds early: six are common, they disagree by two."""
    from planner.clocks import told_trims

    wind = gusty(3.0)
    trims = {}
    for name, azimuth, off in (("right", 150.0, -7.0), ("left", 250.0, -5.0)):
        rays = rays_of(wind, azimuth, late_s=3.0)
        trim, turned = trim_sonic(sonic_file(tmp_path, name, wind, off), lambda rays=rays: iter([rays]))
        trims[name] = trim
        assert trim.trim.trim_deg == pytest.approx(-off, abs=0.1)
        assert trim.trim.after_mps < 0.1 < trim.trim.before_mps
        assert trim.lag.lag_s == pytest.approx(3.0, abs=0.3)
        known = np.isfinite(wind.u_mps)
        np.testing.assert_allclose(turned.u_mps[known], wind.u_mps[known], atol=0.03)
    told = told_trims(trims)
    assert "both sonics: +6.0" in told[-1]
    assert "disagree by +2.0" in told[-1] or "disagree by +1.9" in told[-1]


def test_sonics_of_a_campaign_are_trimmed_and_written_as_a_mast_file(
    campaign: Callable[..., Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The mast's own wind, turned by eight degrees, as a sonic at the target of the sector scan."""
    path = campaign(
        ("mast:", "sonics: [{name: top, scan: sector, path: sonic.csv, longest_lag_s: 0}]\nmast:")
    )
    frame = pd.read_csv(tmp_path / "mast.csv")
    frame["from_deg"] = (frame["from_deg"] - 8.0) % 360.0
    frame["time_utc"] = pd.to_datetime(frame["time_utc"]) - pd.Timedelta(
        seconds=30
    )  # the middle of its minutes
    frame.to_csv(tmp_path / "sonic.csv", index=False)
    assert cli.run(["retrieve", str(path)]) == 0
    said = capsys.readouterr().err.replace("\n", " ")
    assert (
        "sonic top against sector: turned by +8." in said or "sonic top against sector: turned by +7." in said
    )
    written = pd.read_csv(tmp_path / "results" / "sonic_top_600s.csv")
    assert {"time_utc", "speed_mps", "from_deg"} <= set(written.columns)
    mast = pd.read_csv(tmp_path / "truth.csv")
    off = (written["from_deg"] - mast["from_deg"] + 180.0) % 360.0 - 180.0
    assert np.max(np.abs(off)) < 1.5


@pytest.mark.parametrize("asked", ["estimate", "1.2"])
def test_azimuths_that_lead_their_rays_are_turned_back(
    campaign: Callable[..., Path], tmp_path: Path, asked: str
) -> None:
    """Stamped 1.2 degrees ahead in the direction of each sweep: found within three of its standard deviations, and said."""
    path = campaign(('"sector-????.csv"', f'"sector-????.csv", azimuth_lead_deg: {asked}'))
    for place in tmp_path.glob("sector-*.csv"):
        rays = pd.read_csv(place)
        ways = rays.groupby("sweep_id")["azimuth_deg"].transform(
            lambda angle: np.sign(angle.iloc[-1] - angle.iloc[0])
        )
        rays.assign(azimuth_deg=rays["azimuth_deg"] + 1.2 * ways).to_csv(place, index=False)
    notes = " ".join(retrieve(load_campaign(path)).notes["sector"])
    found = re.search(r"azimuths turned back by ([0-9.]+)(?: ± ([0-9.]+))?°", notes)
    assert found
    assert float(found[1]) == pytest.approx(1.2, abs=1e-9 if found[2] is None else 3 * float(found[2]))
    fast = pd.read_csv(tmp_path / "results" / "fast_sector.csv")
    whole = fast[fast["sector_deg"] == 60]["from_deg"].to_numpy()
    up, down = whole[::2], whole[1::2]  # one sweep to, one fro: as stamped they differ by twice the lead
    off = (up[: len(down)] - down + 180.0) % 360.0 - 180.0
    assert abs(np.median(off)) < 1.5
