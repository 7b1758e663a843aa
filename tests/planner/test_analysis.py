"""Simulate, retrieve, compare: what went in comes back, in every format, after every interruption."""

import io
import json
import math
import os
import shutil
import sqlite3
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from geometry.errors import InputError
from planner import analysis, cli
from planner.analysis import retrieve
from planner.campaign import MastInput
from planner.comparing import Comparison, compare, mast_means
from planner.files.yaml_campaign import load_campaign
from planner.files.yaml_site import parse_site
from planner.plan import Plan
from planner.ray_sets import subset_of
from planner.simulation import Options, virtual
from planner.virtual_files import FORMATS, write_virtual
from planner.wind_climate import turbulence
from reconstruct.sector_scan import sector_wind
from reconstruct.virtual import VirtualSettings, fly

# One sector scan and two stares above a mast; a lidar zeroed to grid north on a tilted head.
SITE = """\
name: Moor
crs: EPSG:32632
ground_height_m: 4.8
lidars:
  - name: S
    position: [447893.983, 6256558.133, 5.078]
    instrument: windscanner-200s
    north: grid
    azimuth_offset_deg: 12.31
    elevation_offset_deg: 0.6
    mounting: {heading_deg: 30, pitch_deg: 0.5, roll_deg: -0.4, range_offset_m: 7}
    uncertainty: UNSURE
  - {name: K, position: [447450.548, 6256541.135, 4.054], instrument: windscanner-200s, uncertainty: UNSURE}
  - {name: W, position: [448937.717, 6256404.894, 5.409], instrument: windscanner-200s, uncertainty: UNSURE}
masts:
  - {name: mast, position: [447647.39, 6255435.76, 4.836], height_m: 116.5}
targets:
  - {name: cup, mast: mast, height_m: 120.0}
scans:
  - {name: sector, lidar: S, target: cup, type: sector, sector_deg: 60, step_deg: 2, accumulation_s: 0.4, period_s: 12,
     pulse_ns: 200, fft_points: 64, gates: {first_m: 666, spacing_m: 25, count: 41}}
  - {name: stare K, lidar: K, target: cup, type: stare, accumulation_s: 2, gates: {first_m: 635, spacing_m: 25, count: 41}}
  - {name: stare W, lidar: W, target: cup, type: stare, accumulation_s: 2, gates: {first_m: 1125, spacing_m: 25, count: 41}}
pairs:
  - {name: dual, scans: [stare K, stare W], target: cup, synchronised: true}
wind:
  weibull: {scale_mps: 8.9, shape: 2.75}
  directions_deg: [[118, 270]]
  shear_exponent: 0
"""
NOTHING = "heading_deg: 0, levelling_deg: 0, azimuth_deg: 0, elevation_deg: 0, position_m: 0, range_m: 0"
EXACT = f"{{radial_speed_mps: 1.0e-6, {NOTHING}}}"
STEADY = SITE.replace("UNSURE", EXACT)
TURBULENT = (
    SITE.replace("UNSURE", "{radial_speed_mps: 0.1}") + "  turbulence: {intensity: 0.09, length_m: 170}\n"
)
ALONE = (
    TURBULENT[: TURBULENT.index("  - {name: K")]
    + TURBULENT[TURBULENT.index("masts:") : TURBULENT.index("  - {name: stare K")]
    + TURBULENT[TURBULENT.index("wind:") :]
)

HOUR = 6 / 144


def made(
    folder: Path, text: str = STEADY, *, days: float = HOUR, lost: float = 0.0, seed: int = 1, **more: object
) -> Path:
    """A virtual campaign in a folder; the path of its campaign file."""
    options = Options(days=days, seed=seed, lost_share=lost, settings=VirtualSettings(spacing_m=34.0))
    return write_virtual(Plan(parse_site(text)), text, folder, options=options, **more)[0]  # type: ignore[arg-type]


def changed(path: Path, *pairs: tuple[str, str]) -> Path:
    """The campaign file with some of its text replaced."""
    text = path.read_text(encoding="utf-8")
    for old, new in pairs:
        assert old in text
        text = text.replace(old, new)
    path.write_text(text, encoding="utf-8")
    return path


def means(folder: Path, period_s: int = 600) -> pd.DataFrame:
    return pd.read_csv(
        folder / "results" / f"means_{period_s}s.csv", parse_dates=["time_utc"], date_format="ISO8601"
    )


def test_a_steady_wind_comes_back_in_every_size_and_from_every_pair(tmp_path: Path) -> None:
    """Head angles, mounting, grid north, gates, clock and the retrieval undo what the simulation did."""
    path = made(tmp_path)
    retrieve(load_campaign(path))
    truth = pd.read_csv(tmp_path / "truth.csv", parse_dates=["time_utc"])
    table = means(tmp_path).merge(truth, on="time_utc", suffixes=("", "_true"))
    assert len(table) == 10 * 6
    assert table["speed_mps"].to_numpy() == pytest.approx(table["speed_mps_true"].to_numpy(), rel=1e-4)
    assert table["from_deg"].to_numpy() == pytest.approx(table["from_deg_true"].to_numpy(), abs=0.005)
    assert (table["availability"] == 1.0).all()
    assert sorted(table["sector_deg"].dropna().unique()) == [4, 8, 14, 22, 30, 38, 44, 50, 60]


def test_the_wrong_offset_turns_the_wind_by_as_much(tmp_path: Path) -> None:
    path = changed(made(tmp_path), ('"sector-????.csv"', '"sector-????.csv", offsets: {azimuth_deg: 3.0}'))
    retrieve(load_campaign(path))
    truth = pd.read_csv(tmp_path / "truth.csv", parse_dates=["time_utc"])
    table = means(tmp_path).query("sector_deg == 60").merge(truth, on="time_utc", suffixes=("", "_true"))
    assert (table["from_deg"] - table["from_deg_true"]).to_numpy() == pytest.approx(np.full(6, 3.0), abs=0.05)


def test_every_format_gives_the_same_wind(tmp_path: Path) -> None:
    tables = {}
    for kind in FORMATS:
        folder = tmp_path / kind
        retrieve(load_campaign(made(folder, days=2 / 144, kind=kind)))
        tables[kind] = means(folder)
    for kind in FORMATS[1:]:
        for name in ("count", "speed_mps", "from_deg"):
            assert tables[kind][name].to_numpy() == pytest.approx(tables["csv"][name].to_numpy(), abs=5e-3), (
                kind
            )  # 1e-4° a ray in the coarsest


@pytest.mark.parametrize("cuts", [(1000,), (17, 500, 777)])
def test_files_may_end_anywhere(tmp_path: Path, cuts: tuple[int, ...]) -> None:
    """A pass that the end of a file cuts in two is one scan; nothing is counted twice."""
    path = made(tmp_path, days=2 / 144)
    retrieve(load_campaign(path))
    whole = means(tmp_path, 60)
    rays = pd.read_csv(tmp_path / "sector-0000.csv")
    (tmp_path / "sector-0000.csv").unlink()
    for number, part in enumerate(np.split(np.arange(len(rays)), cuts)):
        rays.iloc[part].to_csv(tmp_path / f"sector-{number:04d}.csv", index=False)
    retrieve(load_campaign(path))
    pd.testing.assert_frame_equal(means(tmp_path, 60), whole)


def test_a_store_is_read_in_small_chunks_with_the_same_result(tmp_path: Path) -> None:
    """Automatic windows see less of the neighbourhood in a small chunk; limits do not care."""
    path = changed(made(tmp_path, days=2 / 144, kind="store"), ("{automatic: on}", "{automatic: off}"))
    retrieve(load_campaign(path))
    whole = means(tmp_path)
    seen: list[int] = []
    original = analysis.retrieve_part

    def watched(records: object, *rest: object) -> object:
        seen.append(records.rays)  # type: ignore[attr-defined]
        return original(records, *rest)  # type: ignore[arg-type]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(analysis, "retrieve_part", watched)
        retrieve(load_campaign(changed(path, ("output: results", "output: results\nchunk_rays: 200"))))
    assert max(seen) <= 230
    pd.testing.assert_frame_equal(means(tmp_path), whole)


def test_what_is_lost_in_several_chunks_is_counted_together(tmp_path: Path) -> None:
    """Two rays without an azimuth, some hundred apart, in chunks of 200."""
    pytest.importorskip("sqlalchemy", reason="the extra 'db' is not installed")
    path = changed(
        made(tmp_path, days=1 / 144, kind="database"), ("output: results", "output: results\nchunk_rays: 200")
    )
    with sqlite3.connect(tmp_path / "rays.sqlite") as connection:
        first = "(SELECT min(gw_id) FROM control WHERE scn_id = 1)"
        connection.execute(f"UPDATE control SET azim = NULL WHERE gw_id IN ({first} + 50, {first} + 650)")
    connection.close()
    notes = [note for told in retrieve(load_campaign(path)).notes.values() for note in told]
    lost = [note for note in notes if note.startswith("lost: ")]
    assert lost == ["lost: control: a ray without time, angles or measurement (2 times)"]


def test_an_unfinished_run_leaves_no_result_and_goes_on_where_it_was(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = made(tmp_path, days=2 / 144)
    original = analysis.retrieve_part
    done: list[int] = []

    def fails(*arguments: object) -> object:
        if len(done) == 2:
            raise KeyboardInterrupt
        done.append(1)
        return original(*arguments)  # type: ignore[arg-type]

    monkeypatch.setattr(analysis, "retrieve_part", fails)
    with pytest.raises(KeyboardInterrupt):
        retrieve(load_campaign(path))
    results = tmp_path / "results"
    assert [item.name for item in results.iterdir()] == [analysis.WORK]
    monkeypatch.setattr(analysis, "retrieve_part", original)
    found = retrieve(load_campaign(path))
    assert found.resumed == 2
    resumed = means(tmp_path)
    assert not (results / analysis.WORK).exists()
    again = retrieve(load_campaign(path))
    assert again.resumed == 0
    pd.testing.assert_frame_equal(means(tmp_path), resumed)


def test_a_run_that_is_killed_leaves_no_result_and_the_next_one_makes_the_same(tmp_path: Path) -> None:
    """SIGKILL, which no program can catch, while parts are worked on; the parts that were done are not done again."""
    path = made(tmp_path, ALONE, days=1 / 144)
    rays = pd.read_csv(tmp_path / "sector-0000.csv")
    for number, part in enumerate(np.array_split(np.arange(len(rays)), 8)):
        rays.iloc[part].to_csv(tmp_path / f"sector-{number:04d}.csv", index=False)
    retrieve(load_campaign(path))
    whole = {item.name: item.read_bytes() for item in (tmp_path / "results").glob("*.csv")}
    shutil.rmtree(tmp_path / "results")
    root = str(Path(analysis.__file__).parents[1])
    halting = (  # so that the kill comes in the middle, however busy the machine is: the third part never ends
        "from planner import analysis; work = analysis._work; done = []\n"
        "def slowly(*given, **more):\n"
        "    done.append(1)\n"
        "    if len(done) > 2: time.sleep(600)\n"
        "    return work(*given, **more)\n"
        "analysis._work = slowly\n"
    )
    code = (
        f"import sys, time; sys.path.insert(0, {root!r})\n{halting}"
        f"from planner.cli import run; run(['retrieve', {str(path)!r}])"
    )
    process = subprocess.Popen([sys.executable, "-c", code], stderr=subprocess.DEVNULL)
    while process.poll() is None and len(list(tmp_path.glob("results/.parts/*/*.npz"))) < 2:
        time.sleep(0.01)
    process.kill()
    process.wait()
    assert [item.name for item in (tmp_path / "results").iterdir()] == [analysis.WORK]
    assert not list(tmp_path.glob(".results-*"))
    assert retrieve(load_campaign(path)).resumed == 2
    assert {item.name: item.read_bytes() for item in (tmp_path / "results").glob("*.csv")} == whole
    assert not (tmp_path / "results" / analysis.WORK).exists()


def test_results_that_cannot_be_written_are_told_before_any_work(tmp_path: Path) -> None:
    path = made(tmp_path, ALONE, days=1 / 144)
    (tmp_path / "results").write_text("in the way", encoding="utf-8")
    with pytest.raises(InputError, match="is a file; a folder is needed"):
        retrieve(load_campaign(path))


def test_what_an_unfinished_run_did_is_worth_nothing_with_other_settings_or_data(tmp_path: Path) -> None:
    path = made(tmp_path, days=1 / 144)
    loaded = load_campaign(path)
    key = analysis.key_of(loaded)
    assert analysis.key_of(load_campaign(changed(path, ("automatic: on", "automatic: off")))) != key
    assert analysis.key_of(loaded) == key


def test_a_bad_file_among_others_is_told_and_the_others_are_read(tmp_path: Path) -> None:
    path = made(tmp_path, days=2 / 144)
    (tmp_path / "sector-0001.csv").write_text("not,rays\n1,2\n", encoding="utf-8")
    found = retrieve(load_campaign(path))
    assert any(note.startswith("lost: ") and "sector-0001.csv" in note for note in found.notes["sector"])
    assert len(means(tmp_path).query("sector_deg == 60")) == 2
    assert "sector-0001.csv" in (tmp_path / "results" / "retrieve.log").read_text(encoding="utf-8")


def test_every_ray_that_is_lost_is_counted(tmp_path: Path) -> None:
    """Of 3 % noise rays each makes its scan partial: (1 - .03)^30 of the scans are whole."""
    path = made(tmp_path, lost=0.03, seed=5)
    strict = retrieve(load_campaign(path)).steps["sector"]
    assert [step.name for step in strict] == ["in the scan", "automatic", "partial scans"]
    noise = int((pd.read_csv(tmp_path / "sector-0000.csv")["cnr_db"] < -20).sum())
    assert strict[1].lost == pytest.approx(noise, abs=3)
    assert strict[2].before == 300
    assert strict[2].after == pytest.approx(300 * 0.97**30, abs=3 * math.sqrt(300 * 0.4 * 0.6))
    lenient = changed(path, ("{automatic: on}", "{automatic: on, ray_share: 0.8}"))
    assert retrieve(load_campaign(lenient)).steps["sector"][2].after == 300


def test_limits_take_the_automatic_filters_place_and_fits_can_be_judged(tmp_path: Path) -> None:
    path = made(tmp_path, days=2 / 144, lost=0.01)
    filters = "{cnr_db: [-25, -5], radial_speed_mps: [-25, 25], residual_std_mps: 0.5, r_squared: 0.5}"
    steps = retrieve(load_campaign(changed(path, ("{automatic: on}", filters)))).steps["sector"]
    names = [step.name for step in steps]
    assert names[:4] == ["in the scan", "CNR", "radial speed", "partial scans"]
    assert "goodness of fit, 60°" in names


def test_scans_that_are_not_synchronised_are_paired_within_a_gap(tmp_path: Path) -> None:
    path = made(
        tmp_path,
        STEADY.replace(
            "accumulation_s: 2, gates: {first_m: 635", "accumulation_s: 2.3, gates: {first_m: 635"
        ),
    )
    changed(path, ('pairs: ["dual"]', "pairs: [{pair: dual, gap_s: 5, compare_gaps_s: [0.5, 2, 5, 8]}]"))
    gaps = retrieve(load_campaign(path)).gaps["dual"]
    assert [gap.gap_s for gap in gaps] == [0.5, 2, 5, 8]
    assert gaps[0].pairs < gaps[1].pairs <= gaps[2].pairs
    truth = pd.read_csv(tmp_path / "truth.csv", parse_dates=["time_utc"])
    table = means(tmp_path).query("scan == 'dual'").merge(truth, on="time_utc", suffixes=("", "_true"))
    assert table["speed_mps"].to_numpy() == pytest.approx(table["speed_mps_true"].to_numpy(), rel=1e-3)


# Against the mast


def test_a_mast_file_is_averaged_by_where_its_stamps_stand(tmp_path: Path) -> None:
    stamps = pd.date_range("2014-05-01T00:10", periods=2, freq="10min")
    frame = pd.DataFrame({"when": stamps, "U": [8.0, 9999.0], "dir": [350.0, 200.0]})
    frame.to_csv(tmp_path / "mast.csv", index=False)
    asked = {
        "path": str(tmp_path / "mast.csv"),
        "time": "when",
        "speed": "U",
        "direction": "dir",
        "direction_offset_deg": 20.0,
    }
    end = mast_means(MastInput.model_validate({**asked, "stamp": "end"}), 600.0)
    start = mast_means(MastInput.model_validate({**asked, "stamp": "start"}), 600.0)
    assert end.time_utc.tolist() == [np.datetime64("2014-05-01T00:10", "ns").astype(int)]
    assert (start.time_utc - end.time_utc).tolist() == [600_000_000_000]
    assert end.from_deg == pytest.approx(10.0)
    with pytest.raises(InputError, match="longer than"):
        mast_means(MastInput.model_validate(asked), 60.0)
    with pytest.raises(InputError, match="no column wind"):
        mast_means(MastInput.model_validate({**asked, "speed": "wind"}), 600.0)


def test_periods_that_do_not_count_are_counted(tmp_path: Path) -> None:
    path = made(tmp_path)
    retrieve(load_campaign(path))
    truth = pd.read_csv(tmp_path / "truth.csv")
    selection = "selection: {directions_deg: [[118, 200]], speed_mps: [6, 25]}\nnothing:"
    text = path.read_text(encoding="utf-8")
    start, stop = text.index("selection:"), text.index("averaging:")
    path.write_text(text[:start] + selection.replace("\nnothing:", "\n") + text[stop:], encoding="utf-8")
    matched = compare(load_campaign(path), predict=False).rows[0].matched
    wanted = ((truth["from_deg"] >= 118) & (truth["from_deg"] <= 200) & (truth["speed_mps"] >= 6)).sum()
    assert len(matched.time_utc) == wanted
    assert [step.name for step in matched.steps] == ["with the mast", "availability", "direction", "speed"]
    assert matched.steps[2].after == ((truth["from_deg"] >= 118) & (truth["from_deg"] <= 200)).sum()


def test_without_mast_or_results_the_comparison_says_what_to_do(tmp_path: Path) -> None:
    path = made(tmp_path, days=1 / 144)
    with pytest.raises(InputError, match="run `lidarplan retrieve` first"):
        compare(load_campaign(path), predict=False)
    with pytest.raises(InputError, match="has no mast"):
        compare(load_campaign(changed(path, ("mast: {path: mast.csv}\n", ""))), predict=False)


@pytest.fixture(scope="module")
def turbulent(tmp_path_factory: pytest.TempPathFactory) -> Comparison:
    """Ten hours of a sector scan through turbulence, four sizes, against the mast."""
    folder = tmp_path_factory.mktemp("turbulent")
    path = changed(
        made(folder, ALONE, days=60 / 144, lost=0.003, seed=2),
        ("averaging:", "sizes_deg: [60, 30, 14, 8]\naveraging:"),
    )
    retrieve(load_campaign(path))
    return compare(load_campaign(path))


def test_the_predicted_slopes_come_back(turbulent: Comparison) -> None:
    """Each within three of its own standard errors, the chance of the campaign's lasting errors included."""
    assert [row.matched.sector_deg for row in turbulent.rows] == [60, 30, 14, 8]
    for row in turbulent.rows:
        predicted, lasting = row.foreseen("slope"), row.foreseen("slope_std")
        assert predicted is not None
        assert abs(row.speed.slope - predicted) < 3 * math.hypot(
            row.speed.slope_standard_error, lasting or 0.0
        )
    slopes = [row.speed.slope for row in turbulent.rows]
    assert slopes == sorted(slopes, reverse=True)
    assert slopes[-1] < 0.9  # an error of ten per cent comes back, not a slope of one


def test_the_predicted_scatter_comes_back(turbulent: Comparison) -> None:
    """Within three standard errors of the scatter, from its own fourth moment, and the 3 % that lost scans add.

    Three rays in a thousand are lost and with each its scan of 30: a mean has 46 scans, the prediction 50."""
    for row in turbulent.rows:
        matched = row.matched
        off = matched.mast_mps - row.speed.slope * matched.lidar_mps
        turned = (matched.lidar_deg - matched.mast_deg + 180.0) % 360.0 - 180.0
        for found, residual, foreseen in (
            (row.speed.residual_std_mps, off, row.foreseen("residual_std_mps")),
            (row.direction.residual_std_deg, turned, row.foreseen("direction_residual_std_deg")),
        ):
            square = (residual - residual.mean()) ** 2
            error = square.std() / math.sqrt(len(square)) / 2 / square.mean()
            assert error < 0.15  # or the comparison would say nothing
            assert found == pytest.approx(foreseen, rel=3 * error + 0.03)


def test_retrieval_adds_nothing_to_what_was_flown(tmp_path: Path) -> None:
    """The radial speeds of the same seed, fitted here in their own frame: the same ten-minute means."""
    retrieve(load_campaign(made(tmp_path, TURBULENT, days=3 / 144)))
    table = means(tmp_path)
    plan = Plan(parse_site(TURBULENT))
    options = Options(days=3 / 144, lost_share=0.0, settings=VirtualSettings(spacing_m=34.0))
    campaign = virtual(plan, options)
    for number, period in enumerate(
        fly(
            campaign.scans,
            campaign.states,
            turbulence=turbulence(plan.site),
            seed=1,
            settings=options.settings,
        )
    ):
        sector, *stares = (scan.rays for scan in campaign.scans)
        measured, *stared = period.radial_speed_mps
        for size in (60.0, 14.0, 4.0):
            part = subset_of(campaign.layouts[0], size)
            wanted = sector_wind(
                sector.azimuth_deg[part], sector.elevation_deg[part], measured[:, part]
            ).wind_mps
            found = table.query("sector_deg == @size").iloc[number]
            assert found["speed_mps"] == pytest.approx(np.hypot(*wanted.T).mean(), rel=1e-4)
        azimuth, elevation = (
            np.array([getattr(rays, name)[0] for rays in stares]) for name in ("azimuth_deg", "elevation_deg")
        )
        wanted = sector_wind(azimuth, elevation, np.concatenate(stared, axis=1)).wind_mps
        found = table[table["sector_deg"].isna()].iloc[number]
        assert found["speed_mps"] == pytest.approx(np.hypot(*wanted.T).mean(), rel=1e-4)


# The commands


def run(*arguments: object) -> int:
    return cli.run([str(argument) for argument in arguments])


@pytest.fixture
def site(tmp_path: Path) -> Path:
    path = tmp_path / "site.yaml"
    path.write_text(TURBULENT, encoding="utf-8")
    return path


def test_the_three_commands_make_a_table_and_figures(
    site: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "campaign"
    assert run("simulate", site, "--days", 4 / 144, "--out", out, "--cell-m", 34, "--quiet") == 0
    changed(out / "campaign.yaml", ("averaging:", "sizes_deg: [60, 30, 8]\naveraging:"))
    assert run("retrieve", out / "campaign.yaml", "--quiet") == 0
    capsys.readouterr()
    assert run("compare", out / "campaign.yaml", "--json", "--no-prediction") == 0
    document = json.loads(capsys.readouterr().out)
    assert [row["sector_deg"] for row in document["rows"]] == [60, 30, 8, None]
    assert [row["rays"] for row in document["rows"]] == [30, 16, 5, 2]  # the thesis; one of each stare
    assert document["rows"][0]["slope"] == pytest.approx(1.0, abs=0.1)
    written = {Path(name).name for name in document["files"]}
    assert {
        "comparison.csv",
        "compare.log",
        "sizes_sector.png",
        "scatter_dual.png",
        "direction_sector.png",
    } <= written
    for name in written:
        if name.endswith(".png"):
            assert (out / "results" / name).read_bytes()[:4] == b"\x89PNG"
    assert run("compare", out / "campaign.yaml", "--no-figures", "--no-prediction") == 0
    assert "0.99" in capsys.readouterr().out


def answering(monkeypatch: pytest.MonkeyPatch, *lines: str) -> None:
    monkeypatch.setattr("sys.stdin", io.StringIO("".join(f"{line}\n" for line in lines)))


def test_limits_are_asked_for_until_they_are_approved(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    path = made(tmp_path, ALONE, days=1 / 144, lost=0.02)
    answering(monkeypatch, "-11 -5", "", "n", "-5 -25", "-25 -5", "-28 28", "maybe", "y")
    assert run("retrieve", path, "--interactive", "--quiet") == 0
    said = capsys.readouterr().out
    assert "the lower one first" in said
    assert "answer y or n" in said
    results = tmp_path / "results"
    assert {item.name for item in results.glob("rays_*.png")} == {
        "rays_sector_filtered.png",
        "rays_sector_unfiltered.png",
    }
    counts = json.loads((results / "filters.json").read_text(encoding="utf-8"))["sector"]
    assert [step["name"] for step in counts][1:3] == ["CNR", "radial speed"]
    noise = int((pd.read_csv(tmp_path / "sector-0000.csv")["cnr_db"] < -25).sum())
    assert counts[1]["before"] - counts[1]["after"] == noise


def test_answers_that_end_too_early_retrieve_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    path = made(tmp_path, ALONE, days=1 / 144)
    answering(monkeypatch, "-25 -5")
    assert run("retrieve", path, "--interactive", "--quiet") == cli.BAD_INPUT
    assert "before limits were approved" in capsys.readouterr().err
    assert not list((tmp_path / "results").glob("means*"))


@pytest.mark.parametrize(
    ("option", "told"),
    [
        (("--days", "0"), "more than 0"),
        (("--lost", "2"), "share"),
        (("--format", "xls"), "allowed: csv"),
        (("--url", "x"), "--format database"),
    ],
)
def test_a_campaign_that_cannot_be_is_refused_and_leaves_nothing(
    site: Path, tmp_path: Path, option: tuple[str, str], told: str, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "campaign"
    assert run("simulate", site, "--out", out, *option) == cli.BAD_INPUT
    assert told in capsys.readouterr().err
    assert not out.exists()


# A database server


@pytest.mark.skipif(
    "LIDARPLAN_TEST_MARIADB" not in os.environ, reason="no server: set LIDARPLAN_TEST_MARIADB to its url"
)
def test_a_campaign_goes_into_mariadb_and_comes_back(tmp_path: Path) -> None:
    """The url stands in the campaign file as a variable of the environment: no password is written."""
    path = made(tmp_path, days=2 / 144, kind="database", url="${LIDARPLAN_TEST_MARIADB}")
    assert os.environ["LIDARPLAN_TEST_MARIADB"] not in path.read_text(encoding="utf-8")
    retrieve(load_campaign(path))
    truth = pd.read_csv(tmp_path / "truth.csv", parse_dates=["time_utc"])
    table = means(tmp_path).query("sector_deg == 60").merge(truth, on="time_utc", suffixes=("", "_true"))
    assert table["speed_mps"].to_numpy() == pytest.approx(table["speed_mps_true"].to_numpy(), rel=1e-4)
    assert len(table) == 2
