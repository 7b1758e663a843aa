"""Scans of similar names keep their rays and results apart."""

import json
from pathlib import Path

import pandas as pd
import pytest

from geometry.errors import InputError
from planner import cli
from planner.analysis import retrieve
from planner.analysis_files import require_own_files
from planner.files.yaml_campaign import load_campaign
from planner.files.yaml_site import parse_site
from planner.plan import Plan
from planner.simulation import Options
from planner.virtual_files import Format, write_virtual

SITE = """\
name: Moor
crs: EPSG:32632
ground_height_m: 10
lidars:
  - {name: A, position: [500000, 6250000, 12], instrument: windscanner-200s}
masts:
  - {name: mast, position: [500800, 6250000, 10], height_m: 100}
targets:
  - {name: cup, mast: mast, height_m: 100}
scans:
  - {name: FIRST, lidar: A, target: cup, type: sector, sector_deg: 60, step_deg: 10, accumulation_s: 2}
  - {name: SECOND, lidar: A, target: cup, type: sector, sector_deg: 30, step_deg: 10, accumulation_s: 2}
"""


def flown(folder: Path, first: str, second: str, kind: Format = "csv") -> Path:
    text = SITE.replace("FIRST", first).replace("SECOND", second)
    return write_virtual(Plan(parse_site(text)), text, folder, options=Options(days=1 / 144), kind=kind)[0]


@pytest.mark.parametrize("second", ["s_t", "S T"])
def test_scans_whose_files_would_be_the_same_are_refused_and_nothing_is_written(
    tmp_path: Path, second: str
) -> None:
    """Of capitals too: two common file systems take both for one."""
    with pytest.raises(InputError, match=f"'s t' and '{second}' would share the file .*: rename one of them"):
        flown(tmp_path / "out", "s t", second)
    assert not (tmp_path / "out").exists()


def test_results_that_would_share_a_file_are_refused(tmp_path: Path) -> None:
    path = flown(tmp_path, "one", "two")
    for name, old, new in (("site.yaml", "two", "o_e"), ("campaign.yaml", '"two"', '"o_e"')):
        text = (tmp_path / name).read_text(encoding="utf-8").replace(old, new)
        (tmp_path / name).write_text(
            text.replace("name: one", "name: o e").replace('"one"', '"o e"'), encoding="utf-8"
        )
    with pytest.raises(InputError, match="'o e' and 'o_e' would share the file o_e"):
        retrieve(load_campaign(path))
    assert not (tmp_path / "results").exists() or not list((tmp_path / "results").glob("*.csv"))


@pytest.mark.parametrize("names", [("dual", "dual"), ("tour, a b", "tour__a_b")])
def test_a_pair_and_a_point_count_too(names: tuple[str, str]) -> None:
    with pytest.raises(InputError, match="would share the file"):
        require_own_files(names)


@pytest.mark.parametrize(("kind", "second"), [("csv", "s-2"), ("csv", "s-0000"), ("windscanner", "s_2")])
def test_a_scan_reads_no_file_of_a_scan_whose_name_goes_on(tmp_path: Path, kind: Format, second: str) -> None:
    """As many rays as the first rays' own file has lines, in whatever format and under whatever name."""
    flown(tmp_path / "plain", "one", "two")
    lines = {name: len(pd.read_csv(tmp_path / "plain" / f"{name}-0000.csv")) for name in ("one", "two")}
    found = retrieve(load_campaign(flown(tmp_path / "named", "s", second, kind)))
    assert {name: steps[0].before for name, steps in found.steps.items()} == {
        "s": lines["one"],
        second: lines["two"],
    }


MORE = (
    SITE.replace("FIRST", "s").replace("SECOND", "t")
    + """\
  - {name: tour, lidar: A, targets: [cup, low], type: points, accumulation_s: 2}
  - {name: around, lidar: A, type: ppi, elevation_head_deg: 5, step_deg: 10, accumulation_s: 2}
"""
)
MORE = MORE.replace("scans:", "  - {name: low, position: [501500, 6250000, 60]}\nscans:")


def test_what_is_not_flown_is_said_with_its_reason(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """On the terminal, for machines, and in the campaign file, which holds the scans that were flown."""
    (tmp_path / "site.yaml").write_text(MORE, encoding="utf-8")
    arguments = ["simulate", str(tmp_path / "site.yaml"), "--days", "0.007", "--out", str(tmp_path / "out")]
    assert cli.run(arguments) == 0
    told = " ".join(capsys.readouterr().err.split())
    assert "around: left out, as it has no target" in told
    assert "tour: every ray is flown at the gate of cup" in told
    assert cli.run([*arguments, "--json", "--quiet"]) == 0
    notes = json.loads(capsys.readouterr().out)["notes"]
    assert [note.split(":")[0] for note in notes] == ["tour", "around"]
    text = (tmp_path / "out" / "campaign.yaml").read_text(encoding="utf-8")
    assert "# around: left out" in text
    assert [item.scan for item in load_campaign(tmp_path / "out" / "campaign.yaml").campaign.inputs] == [
        "s",
        "t",
        "tour",
    ]
