"""`point`, `check` and `wakes`: what they print, their JSON, their exit codes."""

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from planner.cli import run
from planner.commands.errors import shown_value
from planner.commands.table import print_table
from planner.error_nouns import SizeError

ROOT = Path(__file__).resolve().parents[2]
HOVSORE = str(ROOT / "examples" / "hovsore" / "site.yaml")
KASSEL = str(ROOT / "examples" / "kassel" / "site.yaml")
PROGRAM = "import sys; from planner.cli import main; main()"

POINT_KEYS = {
    *("lidar", "target", "azimuth_true_deg", "azimuth_grid_deg", "azimuth_head_deg", "elevation_deg"),
    *("elevation_head_deg", "range_m", "gate_index", "gate_centre_m", "convergence_deg"),
}
CHECK_KEYS = {"severity", "code", "subject", "value", "unit", "limit", "text"}
WAKES_KEYS = {"lidar", "scan", "target", "model", "excluded_deg", "free_deg", "lost_share"}


def printed(capsys: pytest.CaptureFixture[str], *arguments: str, code: int = 0) -> str:
    assert run(list(arguments)) == code
    return capsys.readouterr().out


def document(capsys: pytest.CaptureFixture[str], *arguments: str, code: int = 0) -> Any:
    def refuse(constant: str) -> None:
        raise AssertionError(f"{constant} is no JSON")

    return json.loads(printed(capsys, *arguments, "--json", code=code), parse_constant=refuse)


def test_point_gives_every_lidar_at_every_target(capsys: pytest.CaptureFixture[str]) -> None:
    rows = document(capsys, "point", HOVSORE)
    assert [(row["lidar"], row["target"]) for row in rows] == [(f"WS_{name}", "cup") for name in "KSW"]
    assert all(set(row) >= POINT_KEYS for row in rows)
    assert round(rows[2]["azimuth_true_deg"], 2) == 232.40
    assert len(document(capsys, "point", KASSEL)) == 16


def test_point_without_gates_names_none(capsys: pytest.CaptureFixture[str]) -> None:
    assert {row["gate_index"] for row in document(capsys, "point", KASSEL)} == {None}


def test_check_exits_1_where_a_finding_is_an_error(capsys: pytest.CaptureFixture[str]) -> None:
    """Kassel has one, Høvsøre none; the document is complete all the same."""
    kassel = document(capsys, "check", KASSEL, code=1)
    hovsore = document(capsys, "check", HOVSORE, code=0)
    assert [row["code"] for row in kassel if row["severity"] == "error"] == ["opening-angle"]
    assert all(set(row) == CHECK_KEYS for row in kassel + hovsore)
    assert {row["severity"] for row in hovsore} == {"warning", "info"}


def test_crossings_shows_healthy_pairs_too(capsys: pytest.CaptureFixture[str]) -> None:
    """The published opening angle of Høvsøre is 63°; at Kassel WS7 and WS8 look at each other."""
    (dual,) = document(capsys, "crossings", HOVSORE)
    assert round(dual["opening_angle_deg"]) == 63
    assert len(dual["point_m"]) == 3
    assert [row["pair"] for row in document(capsys, "crossings", KASSEL) if row["folded_angle_deg"] < 10] == [
        "WS7+WS8 at P4"
    ]


def test_wakes_gives_sectors_as_pairs(capsys: pytest.CaptureFixture[str]) -> None:
    rows = document(capsys, "wakes", HOVSORE)
    assert all(set(row) >= WAKES_KEYS for row in rows)
    sector = next(row for row in rows if row["scan"] == "sector")
    assert sector["model"] == "union"
    ((begin, end),) = sector["free_deg"]
    assert 118 < begin < 130  # IEC takes more of the arc than the study's 118 to 270
    assert 250 < end < 270
    assert sector["excluded_deg"] == [[end, begin]]
    assert 0 < sector["lost_share"] < 0.2


def test_wakes_of_a_site_without_turbines_loses_nothing(capsys: pytest.CaptureFixture[str]) -> None:
    rows = document(capsys, "wakes", KASSEL)
    assert {(row["lost_share"], str(row["free_deg"])) for row in rows} == {(0.0, "[[0.0, 360.0]]")}


@pytest.mark.parametrize("command", ["point", "check", "crossings", "wakes"])
def test_tables_fit_on_a_page_and_remarks_go_to_stderr(
    capsys: pytest.CaptureFixture[str], command: str
) -> None:
    assert run([command, HOVSORE]) == 0
    told = capsys.readouterr()
    assert "WS_S" in told.out or "sector" in told.out or "stare K" in told.out
    assert max(map(len, told.out.splitlines())) <= 220
    assert told.err.strip()
    assert run([command, HOVSORE, "--quiet"]) == 0
    assert capsys.readouterr().err == ""


def test_names_are_text_and_not_markup(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    """A lidar called [red]A[/red] keeps its brackets on the terminal."""
    text = Path(KASSEL).read_text(encoding="utf-8").replace("name: WS4,", "name: '[red]A[/red]',")
    site = tmp_path / "site.yaml"
    site.write_text(text.replace("lidar: WS4", "lidar: '[red]A[/red]'"), encoding="utf-8")
    assert "[red]A[/red]" in printed(capsys, "point", str(site))


@pytest.mark.parametrize("command", ["point", "check", "wakes"])
def test_a_site_file_with_faults_exits_2_with_all_of_them(command: str, tmp_path: Path) -> None:
    """As a whole process: one message, line and key, no traceback, nothing on standard output."""
    site = tmp_path / "site.yaml"
    text = Path(KASSEL).read_text(encoding="utf-8")
    site.write_text(text.replace("lidar: WS4", "lidar: WS9").replace("northing", "n"), encoding="utf-8")
    command_line = [sys.executable, "-c", PROGRAM, command, str(site), "--json"]
    done = subprocess.run(
        command_line, cwd=ROOT, capture_output=True, text=True, encoding="utf-8", check=False
    )
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.count("WS9") == 2
    assert "Traceback" not in done.stderr


def test_a_site_comes_from_standard_input_too() -> None:
    text = Path(HOVSORE).read_text(encoding="utf-8")
    command_line = [sys.executable, "-c", PROGRAM, "point", "-", "--json", "--quiet"]
    done = subprocess.run(
        command_line, cwd=ROOT, input=text, capture_output=True, text=True, encoding="utf-8", check=True
    )
    assert len(json.loads(done.stdout)) == 3
    assert done.stderr == ""


def test_a_site_without_scans_says_so(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    site = tmp_path / "site.yaml"
    lidar = "{name: A, position: [500000, 6250000, 10], instrument: windscanner-200s}"
    site.write_text(f"name: Moor\ncrs: EPSG:32632\nlidars: [{lidar}]\n", encoding="utf-8")
    assert "no measured volume" in printed(capsys, "wakes", str(site))
    assert "Nothing found, but there are no scans to check" in printed(capsys, "check", str(site))
    assert document(capsys, "check", str(site)) == []
    assert run(["point", str(site)]) == 2
    assert "0 targets" in capsys.readouterr().err


def test_tables_cut_nothing_where_the_terminal_is_narrow(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """80 columns: every number of `point` in full, each heading once, and no line ends in blanks."""
    rows = document(capsys, "point", HOVSORE)
    monkeypatch.setenv("COLUMNS", "80")
    text = printed(capsys, "point", HOVSORE)
    assert "…" not in text
    for row in rows:
        assert f"{row['azimuth_true_deg']:.3f}" in text
        assert f"{row['convergence_deg']:+.3f}" in text
    assert (text.count("azimuth head °"), text.count("elevation head °")) == (1, 1)
    assert all(line == line.rstrip() for line in text.splitlines())


def test_only_the_folding_column_folds_and_to_no_less_than_forty(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    finding = "word " * 60
    for columns, longest in (("120", range(110, 121)), ("30", range(55, 75))):
        monkeypatch.setenv("COLUMNS", columns)
        print_table("", ("name", "finding"), [("n" * 25, finding)], fold="finding")
        text = capsys.readouterr().out
        assert text.count("n" * 25) == 1
        assert text.count("word") == 60
        assert max(map(len, text.splitlines())) in longest


def test_errors_says_what_it_passes_over_and_what_cures_the_linear_tier(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    lidar = "{name: A, position: [500000, 6250000, 10], instrument: windscanner-200s}"
    target = "{name: T, position: [500000, 6251000, 110]}"
    scans = (
        "  - {name: s, lidar: A, target: T, type: sector, sector_deg: 60, step_deg: 2, accumulation_s: 0.4}\n"
        "  - {name: lone, lidar: A, target: T, type: stare, accumulation_s: 0.5}\n"
    )
    site = tmp_path / "site.yaml"
    text = f"name: Moor\ncrs: EPSG:32632\nlidars: [{lidar}]\ntargets: [{target}]\nscans:\n{scans}"
    site.write_text(text, encoding="utf-8")
    assert run(["errors", str(site), "--sizes", "60"]) == 0
    told = capsys.readouterr()
    assert "Passed over: lone (stare)" in told.err
    assert "no wind.turbulence" in told.err
    assert run(["errors", str(site), "--sizes", "60", "--tier", "noise", "--quiet"]) == 0
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize("kind", ["own", "subset"])
def test_a_size_that_does_not_fit_is_told_with_its_option(
    capsys: pytest.CaptureFixture[str], kind: str
) -> None:
    assert run(["errors", HOVSORE, "--sizes", "60,61", "--sizes-from", kind]) == 2
    assert "--sizes 61 does not fit scan 'sector'" in capsys.readouterr().err


def test_errors_drawn_by_chance_stand_with_their_standard_error(capsys: pytest.CaptureFixture[str]) -> None:
    size = SizeError(
        sector_deg=60, rays=31, scans_per_10min=20, period_s=30, range_m=1000, condition=4,
        values={"slope": 1.0012, "bias": -0.12, "unknown": None}, standard_errors={"slope": 0.0021},
    )  # fmt: skip
    assert shown_value(size, "slope", ".4f") == "1.0012±0.0021"
    assert shown_value(size, "bias", "+.3f") == "-0.120"
    assert shown_value(size, "unknown", "+.3f") == "–"
    print_table("", ("slope of the regression",), [("1.0012±0.0021",)])
    assert f"\n {'1.0012±0.0021':>23}\n" in capsys.readouterr().out


@pytest.mark.parametrize("model", ["jensen", "iec"])
def test_a_wake_model_that_is_not_asked_is_not_said_to_exclude_nothing(
    model: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Whether the columns of Jensen and IEC hold a dash, by the model of the site."""
    text = (ROOT / "examples" / "hovsore" / "site.yaml").read_text(encoding="utf-8")
    site = tmp_path / "site.yaml"
    site.write_text(text.replace("{model: union,", f"{{model: {model},"), encoding="utf-8")
    rows = [line.split() for line in printed(capsys, "wakes", str(site)).splitlines() if "WS_K" in line]
    assert rows
    for row in rows:
        after = row[row.index("cup") + 1 :]
        jensen, iec = after[0] == "–", "–" in after[1:]
        assert (jensen, iec) == (model == "iec", model == "jensen")
