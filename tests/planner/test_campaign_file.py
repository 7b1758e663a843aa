"""A campaign file: what is read, and how each fault is told."""

import re
from pathlib import Path
from typing import get_args

import pytest

from geometry.errors import InputError
from planner.campaign import Campaign
from planner.files.yaml_campaign import load_campaign
from planner.nouns import Noun

SITE = """\
name: Moor
crs: EPSG:32632
ground_height_m: 5
lidars:
  - {name: A, position: [447450.5, 6256541.1, 4.1], instrument: windscanner-200s}
  - {name: B, position: [448937.7, 6256404.9, 5.4], instrument: windscanner-200s}
masts:
  - {name: mast, position: [447647.4, 6255435.8, 4.8], height_m: 116.5}
targets:
  - {name: cup, mast: mast, height_m: 120}
scans:
  - {name: s, lidar: A, target: cup, type: sector, sector_deg: 60, step_deg: 2, accumulation_s: 0.4}
  - {name: k, lidar: B, target: cup, type: stare, accumulation_s: 0.5}
pairs:
  - {name: dual, scans: [s, k], target: cup}
"""

GOOD = """\
name: May
site: site.yaml
inputs:
  - {scan: s, path: rays.csv}
  - {scan: k, kind: database, url: "mysql+pymysql://user@host/base", scenarios: [3, 5]}
pairs: [dual]
filters: {cnr_db: [-25, null]}
mast: {path: mast.csv, stamp: start}
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "site.yaml").write_text(SITE, encoding="utf-8")
    for name in ("rays.csv", "mast.csv"):
        (tmp_path / name).write_text("x", encoding="utf-8")
    return tmp_path


def faults(folder: Path, text: str) -> list[str]:
    path = folder / "campaign.yaml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(InputError) as caught:
        load_campaign(path)
    return [line.replace(f"{path}:", "") for line in str(caught.value).splitlines()[1:]]


def test_a_good_file_is_read_with_the_studys_defaults(folder: Path) -> None:
    (folder / "campaign.yaml").write_text(GOOD, encoding="utf-8")
    loaded = load_campaign(folder / "campaign.yaml")
    campaign = loaded.campaign
    assert loaded.site.name == "Moor"
    assert campaign.inputs[0].path == str(folder / "rays.csv")
    assert campaign.inputs[1].scenarios == (3, 5)
    assert campaign.filters.cnr_db == (-25.0, None)
    assert campaign.pairs[0].pair == "dual"
    assert campaign.selection.availability == pytest.approx(19 / 50)
    assert campaign.averaging.periods_s == (60.0, 600.0)
    assert campaign.output == folder / "results"


@pytest.mark.parametrize(
    ("old", "new", "line", "key", "told"),
    [
        ("scan: s,", "scan: t,", 4, "inputs[0].scan", "'t' came; allowed: a scan of the site: s, k"),
        ("path: rays.csv", "path: gone.csv", 4, "inputs[0].path", "files that exist"),
        ("path: rays.csv", "path: gone/*.csv", 4, "inputs[0].path", "files that exist"),
        ("path: rays.csv", "kind: csv", 4, "inputs[0]", "either `path` (files) or `url`"),
        ("kind: database", "kind: databse", 5, "inputs[1].kind", "database"),
        ("scan: k", "scan: s", 5, "inputs[1].scan", "each scan once"),
        ("[dual]", "[duel]", 6, "pairs[0]", "a pair of the site: dual"),
        ("[-25, null]", "[-5, -25]", 7, "filters.cnr_db", "the lower limit comes first"),
        ("cnr_db", "cnr_dB", 7, "filters.cnr_dB", "Did you mean 'cnr_db'?"),
        ("mast.csv", "mats.csv", 8, "mast.path", "a file that exists"),
        ("stamp: start", "stamp: middle", 8, "mast.stamp", "start or end"),
        ("site.yaml", "sight.yaml", 2, "site", "a site file that exists"),
    ],
)
def test_each_fault_says_where_what_came_and_what_is_allowed(
    folder: Path, old: str, new: str, line: int, key: str, told: str
) -> None:
    found = [text for text in faults(folder, GOOD.replace(old, new)) if f"{line}: {key}: " in text]
    assert len(found) == 1
    assert told in found[0]


def test_all_faults_are_told_in_one_pass(folder: Path) -> None:
    text = (
        GOOD.replace("scan: s,", "scan: t,").replace("mast.csv", "gone.csv").replace("[-25, null]", "[a, b]")
    )
    assert {line.split(": ")[1] for line in faults(folder, text)} >= {
        "inputs[0].scan",
        "mast.path",
        "filters.cnr_db[0]",
    }


def test_a_fault_of_the_site_is_told_with_the_campaign(folder: Path) -> None:
    (folder / "site.yaml").write_text(SITE.replace("sector_deg: 60", "sector_deg: 700"), encoding="utf-8")
    path = folder / "campaign.yaml"
    path.write_text(GOOD, encoding="utf-8")
    with pytest.raises(InputError, match="sector_deg: 700 came"):
        load_campaign(path)


def test_a_pair_needs_the_rays_of_both_its_scans(folder: Path) -> None:
    text = "\n".join(line for line in GOOD.splitlines() if "scan: k" not in line)
    assert any("a pair whose scans are inputs; k is not" in line for line in faults(folder, text))


@pytest.mark.parametrize("text", ["", "5", "- a", "name: [", "name: x\nsite: 5\ninputs: []\n"])
def test_what_is_no_campaign_is_one_message(folder: Path, text: str) -> None:
    path = folder / "campaign.yaml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(InputError):
        load_campaign(path)
    with pytest.raises(InputError, match="no such file"):
        load_campaign(folder / "none.yaml")
    with pytest.raises(InputError, match="this is a folder"):
        load_campaign(folder)


def test_all_of_the_studys_configuration_has_its_place() -> None:
    """Every key that the table in docs/study_configuration.md names is one of the campaign file."""
    page = Path(__file__).parents[2] / "docs" / "study_configuration.md"
    rows = [
        line.split("|")[2] for line in page.read_text(encoding="utf-8").splitlines() if line.startswith("| ")
    ]
    keys = [key for row in rows for key in re.findall(r"`([a-z_.]+)`", row)]
    assert len(keys) > 20
    for key in keys:
        noun: object = Campaign
        for part in key.split("."):
            fields = next(each for each in nouns_in(noun) if part in each.model_fields).model_fields
            noun = fields[part].annotation


def nouns_in(annotation: object) -> list[type[Noun]]:
    """The nouns that an annotation is made of."""
    if isinstance(annotation, type) and issubclass(annotation, Noun):
        return [annotation]
    return [noun for part in get_args(annotation) for noun in nouns_in(part)]
