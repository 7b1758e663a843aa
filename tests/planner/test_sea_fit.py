"""Levelling over the sea by command: low scans made from the published formulas come back as the tilt."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from planner.cli import run
from planner.files.yaml_site import load_site
from reconstruct.record_tables import to_wide
from reconstruct.records import Records

COAST = """\
name: pier
crs: EPSG:32632
lidars:
  - name: L
    position: [447893.983, 6256558.133, 25.4]
    instrument: windscanner-200s
    azimuth_offset_deg: 30
    elevation_offset_deg: 0.2
    mounting: {range_offset_m: 2}
    uncertainty: {position_m: 0.02}
targets:
  - {name: buoy, position: [446893.983, 6256558.133, 2]}
"""


def said(capsys, *arguments: object) -> Any:
    """The JSON of a command that goes well."""
    assert run([*map(str, arguments), "--json"]) == 0
    return json.loads(capsys.readouterr().out)


def low_scans(path: Path, *, pitch_deg: float, roll_deg: float, sea_m: float) -> None:
    """What a tilted head measures over water, by the published formulas for range and edge and nothing of ours.

    Rott et al. (2022) with nose-down pitch; a flat sea is 1 m off at 480 m, and counted by lowering it d²/2R (1 - k).
    """
    rng = np.random.default_rng(11)
    head_azimuth = np.tile(np.arange(150.0, 330.0, 3.0), 2)
    head_elevation = np.repeat([-3.2, -4.2], 60)
    p, q, g, e = np.deg2rad(
        [np.full(120, -pitch_deg), np.full(120, -roll_deg), head_azimuth + 30, head_elevation + 0.2]
    )
    down = np.cos(e) * (np.cos(g) * np.sin(p) - np.cos(p) * np.sin(q) * np.sin(g)) - np.cos(p) * np.cos(
        q
    ) * np.sin(e)
    met = (25.4 - sea_m) / down
    for _ in range(5):
        met = (25.4 - sea_m + met**2 * (1 - 0.13) / (2 * 6371e3)) / down
    gates = np.arange(200.0, 700.0, 10.0)
    cnr = (
        -30 + 22 / (1 + np.exp(0.2 * (gates - (met[:, None] - 2.0)))) + rng.normal(0, 0.8, (120, gates.size))
    )
    records = Records(
        time_utc=np.datetime64("2014-05-01T00:00:00", "ns") + np.arange(120) * np.timedelta64(500, "ms"),
        duration_s=np.full(120, 0.5),
        azimuth_deg=head_azimuth,
        elevation_deg=head_elevation,
        scan_id=np.zeros(120, int),
        sweep_id=np.zeros(120, int),
        range_m=gates,
        radial_speed_mps=np.zeros_like(cnr),
        cnr_db=cnr,
    )
    to_wide(records).to_csv(path, index=False)


def test_level_writes_the_tilt_that_the_sea_tells(tmp_path: Path, capsys) -> None:
    """Pitch .12°, roll -.07° at 0.6 m of tide: back within 3 stated standard deviations and .01°, and `point` turns."""
    site, scan = tmp_path / "site.yaml", tmp_path / "low.csv"
    site.write_text(COAST, encoding="utf-8")
    low_scans(scan, pitch_deg=0.12, roll_deg=-0.07, sea_m=0.6)
    before = said(capsys, "point", site)[0]["elevation_head_deg"]
    found = said(
        capsys, "cnr-map", "level", scan, "--site", site, "--lidar", "L", "--sea-height", 0.6, "--sea-std", 0.05, "--write"
    )  # fmt: skip
    for angle, true in zip(found["angles"], (0.12, -0.07), strict=True):
        assert abs(angle["value_deg"] - true) < max(3 * angle["std_deg"], 0.002)
        assert abs(angle["value_deg"] - true) < 0.01
    assert found["rays_on_sea"] == found["rays"] == 120
    assert load_site(site).lidar("L").mounting.pitch_deg == pytest.approx(0.12, abs=0.01)
    assert said(capsys, "point", site)[0]["elevation_head_deg"] != before


def test_level_says_what_it_found_in_words(tmp_path: Path, capsys) -> None:
    site, scan = tmp_path / "site.yaml", tmp_path / "low.csv"
    site.write_text(COAST, encoding="utf-8")
    low_scans(scan, pitch_deg=0.12, roll_deg=-0.07, sea_m=0.0)
    assert run(["cnr-map", "level", str(scan), "--site", str(site), "--lidar", "L", "--solve-offset"]) == 0
    text = capsys.readouterr().out
    assert "120 of 120 rays meet the sea; ranges" in text
    assert "above the sea: 25.40 m by the site file and --sea-height, 25." in text
    assert "elevation offset °" in text


@pytest.mark.parametrize(
    ("change", "options", "says"),
    [
        (("25.4]", "-1]"), (), "stands -1.00 m above the sea of the moment"),
        (("crs: EPSG:32632", "crs: EPSG:32632\nheight_datum: ellipsoidal"), (), "geoid_undulation_m"),
        (("name: pier", "name: pier"), ("--sea-std", "-1"), "--sea-std -1 came"),
    ],
)
def test_level_refuses_a_head_under_the_sea_and_heights_of_another_kind(
    tmp_path: Path, capsys, change, options, says
) -> None:
    site, scan = tmp_path / "site.yaml", tmp_path / "low.csv"
    site.write_text(COAST.replace(*change), encoding="utf-8")
    low_scans(scan, pitch_deg=0.0, roll_deg=0.0, sea_m=0.0)
    assert run(["cnr-map", "level", str(scan), "--site", str(site), "--lidar", "L", *options]) == 2
    assert says in capsys.readouterr().err


def odd_scan(path: Path, elevation_deg, gates_m, cnr_db) -> None:
    """Any rays as a file, one a second, at bearings around the lidar."""
    rays = len(cnr_db)
    records = Records(
        time_utc=np.datetime64("2014-05-01T00:00:00", "ns") + np.arange(rays) * np.timedelta64(1, "s"),
        duration_s=np.full(rays, 1.0),
        azimuth_deg=np.linspace(0.0, 350.0, rays),
        elevation_deg=np.broadcast_to(elevation_deg, rays),
        scan_id=np.zeros(rays, int),
        sweep_id=np.zeros(rays, int),
        range_m=gates_m,
        radial_speed_mps=np.zeros_like(cnr_db),
        cnr_db=cnr_db,
    )
    to_wide(records).to_csv(path, index=False)


GATES_M = np.arange(100.0, 700.0, 10.0)
STEP_DB = np.where(GATES_M < 400.0, -8.0, -30.0)


@pytest.mark.parametrize(
    ("elevation_deg", "gates_m", "cnr_db", "says"),
    [
        (4.0, GATES_M, np.tile(STEP_DB, (36, 1)), "odd.csv: no ray of a level head would meet the sea: the lowest looks 4.00"),
        (-3.0, GATES_M[:1], np.full((36, 1), -8.0), "odd.csv: rays of 1 range gate(s) came"),
        (-3.0, GATES_M, np.full((36, 60), np.nan), "odd.csv: these rays have no CNR"),
        (-3.0, GATES_M, np.full((36, 60), -20.0), "odd.csv: 0 ranges to the sea came"),
        (-3.0, GATES_M, STEP_DB[None, :], "odd.csv: 1 ranges to the sea came"),
        (-3.0, GATES_M, np.tile(np.where(GATES_M == 300.0, 1e4, -30.0), (36, 1)), "odd.csv: "),
    ],
)  # fmt: skip
def test_level_names_the_file_that_shows_no_sea(
    tmp_path: Path, capsys, monkeypatch, elevation_deg, gates_m, cnr_db, says
) -> None:
    """Looks up, one gate, nothing known, no edge, one ray, a spike: one sentence and exit 2."""
    monkeypatch.chdir(tmp_path)
    Path("site.yaml").write_text(COAST, encoding="utf-8")
    odd_scan(Path("odd.csv"), elevation_deg, gates_m, cnr_db)
    assert run(["cnr-map", "level", "odd.csv", "--site", "site.yaml", "--lidar", "L"]) == 2
    assert says in capsys.readouterr().err


def test_a_sea_that_ends_the_beam_within_a_gate_levels_to_a_gate(tmp_path: Path, capsys) -> None:
    """Steps from -8 to -30 dB without noise, one gate with a spike: no tilt found beyond its stated uncertainty."""
    site, scan = tmp_path / "site.yaml", tmp_path / "sharp.csv"
    site.write_text(
        COAST.replace("elevation_offset_deg: 0.2\n", "elevation_offset_deg: 0\n"), encoding="utf-8"
    )
    met_m = (25.4 + (480.0**2) * 0.87 / (2 * 6371e3)) / np.sin(np.deg2rad(3.0)) - 2.0
    cnr_db = np.where(met_m > GATES_M, -8.0, -30.0) * np.ones((36, 1))
    cnr_db[:, 7] += 6.0
    odd_scan(scan, -3.0, GATES_M, cnr_db)
    found = said(capsys, "cnr-map", "level", scan, "--site", site, "--lidar", "L")
    assert found["rays_on_sea"] == 36
    for angle in found["angles"]:
        assert abs(angle["value_deg"]) < 2.0 * angle["std_deg"]
        assert (
            0.002 < angle["std_deg"] < 0.02
        )  # 10 m/√12 in 485 m at 3°: .018° a ray, 36 rays at all bearings
