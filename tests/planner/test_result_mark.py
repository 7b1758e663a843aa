"""Results of another campaign, or of settings that have changed since, are not compared as one's own."""

from collections.abc import Callable
from pathlib import Path

import pytest

from geometry.errors import InputError
from planner.analysis import retrieve
from planner.comparing import compare
from planner.files.yaml_campaign import load_campaign
from planner.files.yaml_site import parse_site
from planner.plan import Plan
from planner.result_mark import MARK
from planner.simulation import Options
from planner.virtual_files import write_virtual

SITE = """\
name: Moor
crs: EPSG:32632
ground_height_m: 10
lidars:
  - {name: A, position: [500000, 6250000, 12], instrument: windscanner-200s, azimuth_offset_deg: 0}
masts:
  - {name: mast, position: [500800, 6250000, 10], height_m: 100}
targets:
  - {name: cup, mast: mast, height_m: 100}
scans:
  - {name: s, lidar: A, target: cup, type: sector, sector_deg: 60, step_deg: 10, accumulation_s: 2}
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A campaign whose winds are retrieved."""
    path = write_virtual(Plan(parse_site(SITE)), SITE, tmp_path / "run", options=Options(days=3 / 144))[0]
    retrieve(load_campaign(path))
    return path.parent


def edited(path: Path, old: str, new: str) -> Path:
    text = path.read_text(encoding="utf-8")
    assert old in text
    path.write_text(text.replace(old, new), encoding="utf-8")
    return path


def test_the_winds_of_another_campaign_in_the_same_folder_are_refused(folder: Path) -> None:
    other = folder / "other.yaml"
    other.write_text((folder / "campaign.yaml").read_text(encoding="utf-8"), encoding="utf-8")
    retrieve(load_campaign(edited(other, "filters: {automatic: on}", "filters: {automatic: off}")))
    with pytest.raises(
        InputError,
        match=r"retrieved from other.yaml with other settings than .*campaign.yaml has \(filters\)",
    ):
        compare(load_campaign(folder / "campaign.yaml"), predict=False)
    retrieve(load_campaign(folder / "campaign.yaml"))
    assert compare(load_campaign(folder / "campaign.yaml"), predict=False).rows


@pytest.mark.parametrize(
    ("file", "old", "new", "named"),
    [
        ("campaign.yaml", 's-????.csv"', 's-????.csv", offsets: {azimuth_deg: 1}', "inputs"),
        ("campaign.yaml", "periods_s: [60, 600]", "periods_s: [600]", "averaging"),
        ("site.yaml", "azimuth_offset_deg: 0", "azimuth_offset_deg: 1", "site"),
    ],
)
def test_winds_of_settings_that_have_changed_since_are_refused(
    folder: Path, file: str, old: str, new: str, named: str
) -> None:
    edited(folder / file, old, new)
    with pytest.raises(InputError, match=rf"\({named}\): run `lidarplan retrieve .*campaign.yaml` first"):
        compare(load_campaign(folder / "campaign.yaml"), predict=False)


@pytest.mark.parametrize(
    "change",
    [
        lambda at: edited(
            at / "campaign.yaml", "every_speed: true", "every_speed: true\n  availability: 0.5"
        ),
        lambda at: edited(
            at / "site.yaml",
            "azimuth_offset_deg: 0",
            "azimuth_offset_deg: 0, uncertainty: {azimuth_deg: 0.1}",
        ),
        lambda at: edited(
            at / "site.yaml", "name: Moor", "name: Moor\nwind: {weibull: {scale_mps: 8, shape: 2}}"
        ),
    ],
)
def test_what_concerns_the_comparison_alone_may_change(folder: Path, change: Callable[[Path], Path]) -> None:
    change(folder)
    assert compare(load_campaign(folder / "campaign.yaml"), predict=False).rows


def test_a_campaign_may_be_moved_and_read_from_anywhere(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    moved = folder.rename(folder.parent / "moved")
    monkeypatch.chdir(moved)
    assert compare(load_campaign("campaign.yaml"), predict=False).rows


@pytest.mark.parametrize("text", [None, "", "[]", "{}", '{"campaign": "a", "settings": 1}'])
def test_results_without_a_mark_are_refused(folder: Path, text: str | None) -> None:
    mark = folder / "results" / MARK
    mark.unlink() if text is None else mark.write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match="does not say what its winds were retrieved from: run"):
        compare(load_campaign(folder / "campaign.yaml"), predict=False)
