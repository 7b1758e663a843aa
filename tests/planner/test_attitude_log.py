"""A lidar that turns while it measures: its log gives the true wind back, and the drift is reported."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from geometry.beams import unit_vector
from geometry.errors import InputError
from planner import cli
from planner.analysis import retrieve
from planner.analysis_files import Retrieved
from planner.files.yaml_campaign import load_campaign
from planner.files.yaml_site import parse_site
from planner.plan import Plan
from reconstruct.record_tables import write_parquet
from reconstruct.records import Records

SITE = """\
name: Moor
crs: EPSG:32632
ground_height_m: 4.8
lidars:
  - name: S
    position: [447893.983, 6256558.133, 5.078]
    instrument: windscanner-200s
    azimuth_offset_deg: 12.31
    elevation_offset_deg: 0.6
    mounting: {heading_deg: 30, pitch_deg: 0.5, roll_deg: -0.4}
masts:
  - {name: mast, position: [447647.39, 6255435.76, 4.836], height_m: 116.5}
targets:
  - {name: cup, mast: mast, height_m: 120.0}
scans:
  - {name: sector, lidar: S, target: cup, type: sector, sector_deg: 60, step_deg: 2, accumulation_s: 0.4, period_s: 12}
"""
CAMPAIGN = """\
name: drifting
site: site.yaml
inputs:
  - {scan: sector, path: "rays-*.parquet", MORE}
filters: {automatic: off, cnr_db: [-25, -5], radial_speed_mps: [-25, 25], ray_share: 0.8}
sizes_deg: [60]
averaging: {periods_s: [600]}
"""
DAYS, PER_DAY = 3, 1.0  # the heading turns by a degree a day
SPEED, FROM = 8.0, 200.0
COMPASS = 321.4  # what the compass says of the heading at the beginning: a number of its own


def drifting(folder: Path, *, scatter_deg: float = 0.0, pitch_deg: float = 0.0, log: bool = True) -> Path:
    """Rays of a steady wind, three scans an hour over three days, in three files; the campaign file."""
    layout = Plan(parse_site(SITE)).layout["sector"]
    scans = DAYS * 72
    seconds = np.add.outer(np.arange(scans) * 1200.0, 0.4 * np.arange(30) + 0.2).ravel()
    turned = PER_DAY * seconds / 86_400.0
    true = np.tile(layout.scan.azimuth_deg, scans), np.tile(layout.scan.elevation_deg, scans)
    wind = -SPEED * unit_vector(FROM, 0.0)
    head = np.array(
        [
            replace(
                layout.mounting,
                heading_deg=layout.mounting.heading_deg + turn,
                pitch_deg=layout.mounting.pitch_deg + pitch_deg,
            ).to_head(azimuth, elevation)
            for turn, azimuth, elevation in zip(turned, *true, strict=True)
        ]
    )
    rng = np.random.default_rng(2)
    compass = (COMPASS + turned + rng.normal(0, scatter_deg, len(turned))) % 360.0
    records = Records(
        time_utc=np.datetime64("2024-01-01", "ns") + (seconds * 1e9).astype("timedelta64[ns]"),
        duration_s=np.full(len(seconds), 0.4),
        azimuth_deg=head[:, 0],
        elevation_deg=head[:, 1],
        scan_id=np.zeros(len(seconds)),
        sweep_id=np.repeat(np.arange(scans), 30),
        range_m=np.array([layout.range_to_m("cup")]),
        radial_speed_mps=(unit_vector(*true) @ wind)[:, None],
        cnr_db=np.full((len(seconds), 1), -12.0),
        heading_deg=compass if log else None,
        pitch_deg=np.full(len(seconds), pitch_deg) if log else None,
    )
    for day in range(DAYS):
        part = records.at_rays((seconds >= day * 86_400.0) & (seconds < (day + 1) * 86_400.0))
        write_parquet(part, folder / f"rays-{day}.parquet")
    table = pd.DataFrame(
        {"when": records.time_utc, "Yaw": compass, "Tilt": -0.5 - pitch_deg, "North": 30.0 + turned}
    )
    table.iloc[::30].to_csv(folder / "log.csv", index=False)
    (folder / "site.yaml").write_text(SITE, encoding="utf-8")
    return folder / "campaign.yaml"


def run(path: Path, more: str) -> tuple[Retrieved, np.ndarray]:
    """The result, and the errors of the ten-minute directions in the order of time [deg]."""
    path.write_text(CAMPAIGN.replace("MORE", more), encoding="utf-8")
    found = retrieve(load_campaign(path))
    means = pd.read_csv(path.parent / "results" / "means_600s.csv")
    assert len(means) == DAYS * 72
    return found, (means["from_deg"].to_numpy() - FROM + 180.0) % 360.0 - 180.0


@pytest.fixture(scope="module")
def clean(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return drifting(tmp_path_factory.mktemp("drifting"))


def test_a_heading_that_drifts_gives_the_true_wind_with_its_log_alone(clean: Path) -> None:
    """By default the log of the rays' own files is followed; without it the wind turns back by a degree a day."""
    found, error = run(clean, "kind: parquet")
    assert np.max(np.abs(error)) < 0.02
    assert any(
        "pointing follows the log's changes of heading and pitch from heading 321.4" in n
        for n in found.notes["sector"]
    )
    found, error = run(clean, "attitude: {use: 'off'}")
    assert error[0] == pytest.approx(0.0, abs=0.02)
    assert error[-1] == pytest.approx(-PER_DAY * DAYS, abs=0.02)
    assert any("heading and pitch are logged and not used" in note for note in found.notes["sector"])


@pytest.mark.parametrize("use", ["'off'", "changes"])
def test_the_drift_is_reported_whether_it_is_followed_or_not(clean: Path, use: str) -> None:
    found, _ = run(clean, f"attitude: {{use: {use}}}")
    drift = found.drifts["sector"].drifts["heading_deg"]
    assert drift.per_day_deg == pytest.approx(PER_DAY, abs=1e-4)
    assert drift.significant
    assert not found.drifts["sector"].drifts["pitch_deg"].significant
    table = pd.read_csv(clean.parent / "results" / "attitude.csv")
    assert table["angle"].tolist() == ["heading_deg", "pitch_deg"]
    assert table["per_day_deg"][0] == pytest.approx(PER_DAY, abs=1e-4)
    log = (clean.parent / "results" / "retrieve.log").read_text(encoding="utf-8")
    assert "drift +1.000 ± 0.000° a day over 216 means of ten minutes (significant at 5 %)" in log


def test_a_separate_log_is_followed_by_its_columns_and_signs(clean: Path) -> None:
    """Its changes from a zero of its own, or its angles in place of the mounting's where they are true ones."""
    columns = f"path: {clean.parent / 'log.csv'}, time: when, pitch: Tilt, factors: {{pitch_deg: -1}}"
    _, error = run(clean, f"attitude: {{{columns}, heading: Yaw}}")
    assert np.max(np.abs(error)) < 0.02
    _, error = run(clean, f"attitude: {{{columns}, heading: North, use: absolute}}")
    assert np.max(np.abs(error)) < 0.02
    with pytest.raises(
        InputError, match="has the columns when, Yaw, Tilt, North; needed are time_utc and one of"
    ):
        run(clean, f"attitude: {{path: {clean.parent / 'log.csv'}}}")


def test_rows_of_a_log_that_say_nothing_are_counted(clean: Path) -> None:
    table = pd.read_csv(clean.parent / "log.csv", dtype=str)
    table.loc[[3, 5], "when"] = ["soon", None]
    table.loc[7, "Yaw"] = "north"
    table.to_csv(clean.parent / "damaged.csv", index=False)
    columns = f"path: {clean.parent / 'damaged.csv'}, time: when, heading: Yaw, pitch: Tilt"
    found, _ = run(clean, f"attitude: {{{columns}, factors: {{pitch_deg: -1}}}}")
    assert "lost: damaged.csv, rows without a time: 2, angles that are no number: 1" in found.notes["sector"]


def test_rays_in_a_gap_of_a_log_are_counted(clean: Path) -> None:
    """Forty entries, one a scan, are missing: the scans of them and what follows the entry before, 1200 + 29 rays."""
    table = pd.read_csv(clean.parent / "log.csv", dtype=str).drop(index=range(20, 60))
    table.to_csv(clean.parent / "gap.csv", index=False)
    columns = f"path: {clean.parent / 'gap.csv'}, time: when, heading: Yaw, pitch: Tilt"
    found, _ = run(clean, f"attitude: {{{columns}, factors: {{pitch_deg: -1}}}}")
    assert found.drifts["sector"].unlogged == 1229 + 29  # and the rays after the last entry


def test_the_reference_of_the_log_may_be_given(clean: Path) -> None:
    """A compass that showed half a degree less while targets were mapped: all rays turn by as much."""
    _, error = run(clean, f"attitude: {{reference: {{heading_deg: {COMPASS - 0.5}}}}}")
    assert np.mean(error) == pytest.approx(0.5, abs=0.02)


def test_the_scatter_of_a_compass_is_not_given_to_the_rays(tmp_path: Path) -> None:
    """A third of a degree from sample to sample, 30 samples in twenty minutes here, so 360 in four hours."""
    path = drifting(tmp_path, scatter_deg=0.3)
    _, smooth = run(path, "attitude: {smooth_s: 14400}")
    _, raw = run(path, "attitude: {smooth_s: 0}")
    assert np.std(smooth) < 0.5 * np.std(raw)


def test_a_tilted_head_is_righted_by_its_inclinometer(tmp_path: Path) -> None:
    """Half a degree of pitch since the mapping: the log's change from its reference lifts every ray to its place."""
    path = drifting(tmp_path, pitch_deg=0.5)
    _, error = run(path, f"attitude: {{reference: {{heading_deg: {COMPASS}}}}}")
    assert np.max(np.abs(error)) < 0.02


def test_without_a_log_nothing_is_said_of_one(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = drifting(tmp_path, log=False)
    found, _ = run(path, "kind: parquet")
    assert not found.drifts
    assert not (tmp_path / "results" / "attitude.csv").exists()
    assert cli.run(["retrieve", str(path)]) == 0
    assert "logged" not in capsys.readouterr().err
