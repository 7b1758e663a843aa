"""The report: one page that loads nothing, runs only its own scripts, and is written whole or not at all."""

import base64
import csv
import hashlib
import re
from html.parser import HTMLParser
from importlib.metadata import PackageNotFoundError
from pathlib import Path

import pytest

from geometry.errors import InputError
from planner.error_entry import error_entries
from planner.files.yaml_site import load_site
from planner.plan import Plan
from planner.plan_scene import plan_scene
from planner.report import report_html, write_report
from planner.report_numbers import MISSES, key_numbers
from planner.report_site import made_line, position_table, wind_table
from planner.report_tables import pointing_table, unknown_numbers, wake_table
from planner.report_values import Column, csv_text
from planner.site import Site
from planner.templates import site_text

EVIL = "</title></script><script>alert(1)</script><img src=x onerror=alert(2)> \" ' & $x$ {{7*7}} Ærø 風"
TABLES = {"pointing.csv", "findings.csv", "wakes.csv", "crossings.csv", "errors.csv"}
VOID = {"meta", "img", "br", "input", "link"}


@pytest.fixture(autouse=True)
def without_opengl(monkeypatch: pytest.MonkeyPatch) -> None:
    """A machine that cannot draw: reports are quick, and say why there is no picture."""
    monkeypatch.setattr("planner.scene.opengl.off_screen_window", lambda: None)


def small(name: str = "Moor", mark: str = "", **more: object) -> Site:
    """A site with one of everything, each name with the mark."""
    return Site.model_validate(
        {
            "name": name + mark,
            "crs": "EPSG:32632",
            "lidars": [
                {
                    "name": "A" + mark,
                    "position": [448000.0, 6256000.0, 5.0],
                    "instrument": "windscanner-200s",
                },
                {
                    "name": "B" + mark,
                    "position": [449000.0, 6256000.0, 5.0],
                    "instrument": "windscanner-200s",
                },
            ],
            "masts": [{"name": "M" + mark, "position": [448400.0, 6256700.0, 5.0], "height_m": 80.0}],
            "turbines": [
                {
                    "name": "T" + mark,
                    "position": [448400.0, 6257300.0, 5.0],
                    "hub_height_m": 90.0,
                    "rotor_diameter_m": 110.0,
                }
            ],
            "obstacles": [
                {
                    "name": "O" + mark,
                    "position": [448100.0, 6256300.0, 5.0],
                    "width_m": 20.0,
                    "length_m": 30.0,
                    "height_m": 9.0,
                }
            ],
            "targets": [{"name": "P" + mark, "mast": "M" + mark, "height_m": 90.0}],
            "scans": [
                {
                    "name": "S" + mark,
                    "lidar": "A" + mark,
                    "target": "P" + mark,
                    "type": "sector",
                    "sector_deg": 30.0,
                    "step_deg": 2.0,
                    "accumulation_s": 0.5,
                },
                {
                    "name": "K" + mark,
                    "lidar": "B" + mark,
                    "target": "P" + mark,
                    "type": "stare",
                    "accumulation_s": 0.5,
                },
            ],
            "pairs": [{"name": "D" + mark, "scans": ["S" + mark, "K" + mark], "target": "P" + mark}],
            "wind": {"directions_deg": [[150, 300]]},
            **more,
        }
    )


class Page(HTMLParser):
    """Tags with their attributes, texts outside scripts, and the scripts themselves."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.texts: list[str] = []
        self.scripts: list[str] = []
        self.open: list[str] = []
        self.feed(text)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)
        if tag == "script":
            self.scripts.append("")

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if self.open[-1:] == ["script"]:
            self.scripts[-1] += data
        elif self.open[-1:] != ["style"]:
            self.texts.append(data.strip())

    def all(self, tag: str) -> list[dict[str, str | None]]:
        return [attributes for name, attributes in self.tags if name == tag]

    @property
    def policy(self) -> str:
        (content,) = [
            a["content"] for a in self.all("meta") if a.get("http-equiv") == "Content-Security-Policy"
        ]
        return str(content)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One report of one plain site and one with evil names."""
    place = tmp_path_factory.mktemp("report") / "out"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("planner.scene.opengl.off_screen_window", lambda: None)
        write_report([Plan(small()), Plan(small("Evil", EVIL))], place)
    return place


@pytest.fixture(scope="module")
def page(folder: Path) -> Page:
    return Page((folder / "report.html").read_text(encoding="utf-8"))


def rows(path: Path) -> list[dict[str, str]]:
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def test_the_page_and_its_tables_are_written_together(folder: Path) -> None:
    assert {path.name for path in folder.iterdir()} == {"report.html", *TABLES}


def test_the_page_is_well_formed_and_loads_nothing(page: Page) -> None:
    assert page.open == []
    for _, attributes in page.tags:
        for key in ("src", "href", "data", "action", "srcset", "poster"):
            assert str(attributes.get(key) or "#").startswith(("#", "data:image/png;base64,"))
    assert page.policy.startswith("default-src 'none'; script-src 'sha256-")
    assert (
        "http" not in page.policy and "unsafe-inline" not in page.policy.split("script-src")[1].split(";")[0]
    )


def test_only_the_pages_own_scripts_may_run(page: Page) -> None:
    """The digests of the policy are those of the scripts that a browser would find, no more and no fewer."""
    found = {base64.b64encode(hashlib.sha256(script.encode()).digest()).decode() for script in page.scripts}
    assert set(re.findall(r"'sha256-([^']+)'", page.policy)) == found


def test_names_from_the_site_file_stay_text(page: Page) -> None:
    assert not [key for _, attributes in page.tags for key in attributes if key.startswith("on")]
    assert not [a for a in page.all("img") if not str(a["src"]).startswith("data:image/png")]
    assert "Evil" + EVIL in page.texts, "the name stands on the page as it was written, never as 49"
    assert not any("alert(1)</" in script or "<img src=x" in script for script in page.scripts)
    assert not any("alert" in script and len(script) < 100 for script in page.scripts)


def test_everyone_can_read_it(page: Page) -> None:
    """Pictures have words, headings say what they head, links and labels have their places."""
    assert all(a.get("alt") for a in page.all("img"))
    assert all(a.get("scope") in ("col", "row") for a in page.all("th"))
    assert len(page.all("caption")) == len(page.all("table"))
    ids = [a["id"] for _, a in page.tags if "id" in a]
    assert len(ids) == len(set(ids))
    named = [str(a["href"])[1:] for a in page.all("a")] + [
        str(a["aria-labelledby"]) for _, a in page.tags if "aria-labelledby" in a
    ]
    assert set(named) <= set(ids)
    assert page.all("html")[0]["lang"] == "en"


def test_two_sites_stand_side_by_side_at_the_top(page: Page, folder: Path) -> None:
    start = page.texts.index("Key numbers of both sites")
    heads = [text for text in page.texts[start : start + 12] if text]
    assert heads[1:4] == ["number", "Moor", "Evil" + EVIL]
    assert {row["site"] for row in rows(folder / "pointing.csv")} == {"Moor", "Evil" + EVIL}


def test_without_opengl_the_page_says_why_there_is_no_picture(page: Page) -> None:
    assert sum("left out" in text and "libgl1" in text for text in page.texts) == 2
    assert not any("close view" in str(a["alt"]) for a in page.all("img"))


def test_a_report_that_fails_leaves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(_: Plan) -> bytes:
        raise InputError("no map today")

    monkeypatch.setattr("planner.report.site_map", broken)
    with pytest.raises(InputError, match="no map today"):
        write_report([Plan(small())], tmp_path / "out")
    assert list(tmp_path.iterdir()) == []


def test_the_poorest_site_gets_a_report_too() -> None:
    """Two lidars, nothing to look at: every section says so in words."""
    bare = Site.model_validate(
        {
            "name": "bare",
            "crs": "EPSG:32632",
            "lidars": [
                {"name": "A", "position": [448000.0, 6256000.0, 5.0], "instrument": "windscanner-200s"}
            ],
        }
    )
    page = Page(report_html([Plan(bare)]))
    for sentence in (
        "No pair of scans is declared.",
        "No scan is declared.",
        "No lidar or no target is declared: there is nothing to point.",
    ):
        assert sentence in page.texts


def test_no_turbine_no_rose() -> None:
    page = Page(report_html([Plan(small(turbines=[], obstacles=[]))]))
    assert any(text.startswith("No turbine or obstacle stands on this site") for text in page.texts)
    assert not any("rose" in str(a["alt"]) for a in page.all("img"))


def test_pointing_table_of_hovsore_against_the_geodesic(hovsore: Plan) -> None:
    """WS_W looks along 233.091° of the grid, 232.400° by the geodesic inverse (PROJ)."""
    table = pointing_table(hovsore)
    keys = [column.key for column in table.columns]
    row = dict(zip(keys, next(row for row in table.rows if row[0] == "WS_W"), strict=True))
    assert (round(row["azimuth_grid_deg"], 3), round(row["azimuth_true_deg"], 3)) == (233.091, 232.400)
    keys = [column.key for column in table.columns if column.on_page]
    cells = dict(zip(keys, next(cells for cells in table.page_rows if cells[0] == "WS_W"), strict=True))
    assert (cells["azimuth_true_deg"], cells["convergence_deg"]) == ("232.400", "−0.690")


def test_wake_table_of_hovsore_beside_the_study(hovsore: Plan) -> None:
    """The study found 118-270° free; declared and found stand in one row, and only the arc loses some."""
    table = wake_table(hovsore)
    rows = [dict(zip([column.key for column in table.columns], row, strict=True)) for row in table.rows]
    assert {row["wanted_deg"] for row in rows} == {"118–270°"}
    assert next(row for row in rows if row["scan"] == "sector")["lost_share"] > 0.1
    assert all(row["lost_share"] == 0 for row in rows if row["scan"] != "sector")


def test_key_numbers_are_the_same_rows_for_every_site() -> None:
    plans = [Plan(small()), Plan(small(turbines=[], pairs=[]))]
    first, second = ([number.label for number in key_numbers(plan, [], [])] for plan in plans)
    assert first == second


def test_what_no_size_knows_is_said_once_with_its_reason() -> None:
    size = {
        "sector_deg": 60.0,
        "speed_bias_mps": 0.1,
        "slope": None,
        "reasons": {"slope": "needs turbulence"},
    }
    told = {reason: names for names, reason in unknown_numbers([{"sizes": [size, size]}])}
    assert told["needs turbulence"] == "slope"


def test_a_spreadsheet_takes_no_name_for_a_formula() -> None:
    text = csv_text(
        [Column("name", "name"), Column("x_m", "x", "m", 1)], [("=HYPERLINK(1)", -1.5), ("@b", None)]
    )
    assert text == "name,x_m\n'=HYPERLINK(1),-1.5\n'@b,\n"


def test_scans_whose_long_names_begin_alike_stay_apart_in_the_scene() -> None:
    """The scene shortens names, and every layer needs its own."""
    alike = [
        {"name": "x" * 90 + end, "lidar": "A", "target": "P", "type": "stare", "accumulation_s": 0.5}
        for end in "12"
    ]
    names = [layer.name for layer in plan_scene(Plan(small(scans=alike, pairs=[]))).layers]
    assert len(names) == len(set(names))
    assert max(map(len, names)) < 70


def test_blocked_rays_are_counted_and_said_beside_the_prediction(hovsore: Plan) -> None:
    """13 of the sector's 30 rays pass through rotors, 2 of these meet a tower, which stands in the way in every wind."""
    entry = next(entry for entry in error_entries(hovsore, hovsore.default_errors) if entry.get("lidar"))
    assert entry["blocked_rays"] == 13
    assert entry["blocked_remark"] == (
        "13 of 30 rays are blocked, 2 of them in every wind; the prediction counts them as measured"
    )
    clear = Plan(small(obstacles=[], turbines=[]))
    assert all(entry["blocked_remark"] is None for entry in error_entries(clear, clear.default_errors))


def test_positions_have_the_latitude_and_longitude_of_proj() -> None:
    """The central meridian of zone 32 is 9° east; 6256000 m north is 56.448° (Karney's series, as in PROJ)."""
    from pyproj import Transformer

    table = position_table(Plan(small()))
    assert [row[:2] for row in table.rows] == [
        ("lidar", "A"),
        ("lidar", "B"),
        ("mast", "M"),
        ("turbine", "T"),
        ("target", "P"),
    ]
    to_degrees = Transformer.from_crs("EPSG:32632", "EPSG:4326", always_xy=True)
    for row in table.rows:
        assert (row[6], row[5]) == pytest.approx(to_degrees.transform(row[2], row[3]), abs=1e-8)


def test_the_wind_that_was_taken_is_said(hovsore: Plan) -> None:
    taken = dict(wind_table(hovsore).page_rows)
    assert taken["directions that count"] == "118–270°"
    assert dict(wind_table(Plan(small(wind=None))).page_rows)["speeds"].startswith("10 m/s")


def test_only_one_line_of_the_page_tells_when_it_was_made(
    page: Page, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert any(re.search(r"Made \d{4}-\d\d-\d\d \d\d:\d\d UTC by lidarplan", text) for text in page.texts)
    assert any("CRS EPSG:32632" in text for text in page.texts)

    def absent(_: str) -> str:
        raise PackageNotFoundError

    monkeypatch.setattr("planner.report_site.version", absent)
    assert made_line().endswith("not installed)")


def test_a_pair_that_misses_its_target_says_by_how_far() -> None:
    """Ten degrees off at 800 m: the beam passes about 140 m beside the target."""
    plan = Plan(small())
    aimed = next(row for row in plan.pointings if row.lidar == "B")
    scans = [scan.model_dump(exclude_none=True) for scan in plan.site.scans]
    scans[1] |= {
        "azimuth_head_deg": aimed.azimuth_head_deg + 10.0,
        "elevation_head_deg": aimed.elevation_head_deg,
    }
    off = Plan(small(scans=scans))
    miss = aimed.range_m * 0.17365  # sine of 10 degrees
    told = {number.label: number.text for number in key_numbers(off, [], [])}[MISSES]
    assert float(told.split(" m")[0]) == pytest.approx(miss, rel=0.01)
    labels = [label.text for layer in plan_scene(off).layers for label in layer.labels]
    label = next(text for text in labels if "misses target by" in text)
    assert float(label.split()[-2]) == pytest.approx(miss, rel=0.01)
    assert {number.label: number.text for number in key_numbers(plan, [], [])}[MISSES].startswith("none")


def test_every_example_in_the_template_of_a_site_is_right(tmp_path: Path) -> None:
    """Commented-out scans, obstacles and hard targets load when their comment signs go."""
    text = re.sub(r"^# - \{", "  - {", site_text(), flags=re.MULTILINE)
    text = text.replace("obstacles: []", "obstacles:").replace("hard_targets: []", "hard_targets:")
    (tmp_path / "site.yaml").write_text(text, encoding="utf-8")
    site = load_site(tmp_path / "site.yaml")
    assert {scan.type for scan in site.scans} == {"sector", "ppi", "rhi", "stare", "raster", "points"}
    assert site.obstacles and len(site.hard_targets) == 2
