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
    assert "120 of 120 rays meet the sea, 25." in text
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
