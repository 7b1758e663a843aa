"""What `compare` writes: levels of the mast, the profile, verdicts, tables in two formats, every figure."""

import json
from pathlib import Path

import duckdb
import numpy as np
import pandas as pd
import pytest
from PIL import Image

from planner import cli
from planner.analysis import retrieve
from planner.comparing import Comparison, Row, compare
from planner.comparing_files import KINDS, write_comparison
from planner.comparison_table import table_rows, verdicts
from planner.error_nouns import SizeError
from planner.figures.canvas import canvas
from planner.figures.comparison import title
from planner.files.yaml_campaign import load_campaign
from planner.wind_profile import wind_profile

SITE = """\
name: Field
crs: EPSG:32632
ground_height_m: 5
lidars:
  - {name: V, position: [500000, 6250500, 6], instrument: windscanner-200s}
targets:
  - {name: top, position: [500100, 6250500, 105]}
scans:
  - {name: circle, lidar: V, type: ppi, elevation_head_deg: 60, step_deg: 20, accumulation_s: 1, period_s: 20}
  - {name: arc, lidar: V, target: top, type: sector, sector_deg: 60, step_deg: 4, accumulation_s: 1, period_s: 20}
wind: {speeds_mps: [8]}
"""
CAMPAIGN = """\
name: Field
site: site.yaml
inputs:
  - {scan: circle, kind: csv, path: circle.csv, columns: {names: {cnr_db: cnr_db}}, gates_m: [57, 115, 230]}
  - {scan: arc, kind: csv, path: arc.csv, columns: {names: {cnr_db: cnr_db}}}
sizes_deg: [60, 36, 20]
filters: {automatic: 'off', cnr_db: [-30, 0], radial_speed_mps: [-30, 30]}
selection: {directions_deg: all, every_speed: true}
mast:
  path: mast.csv
  levels:
    - {height_m: 50, speed: U50, direction: D50}
    - {height_m: 100, speed: U100, direction: D100}
"""
PERIODS, START = 6, np.datetime64("2024-01-01T00:00:00", "ns")
ARC_M = 139.7  # the head is 99 m under the target, 100 m from below it


def speed_at(height_m: np.ndarray, period: np.ndarray) -> np.ndarray:
    return (6.0 + period) * (height_m / 100.0) ** 0.2


def from_at(height_m: np.ndarray) -> np.ndarray:
    """Across north: 357.5 degrees at 50 m, 0 at 100, 5 at 200."""
    return (355.0 + 0.05 * height_m) % 360.0


def rays(
    folder: Path, name: str, azimuth: np.ndarray, elevation: float, gates: list[float], bump: float
) -> None:
    """An hour of a scan of one pass each 20 s; `bump` is what its speeds are high by."""
    passes = 30 * PERIODS
    seconds = (np.arange(len(azimuth)) + 0.5 + 20.0 * np.arange(passes)[:, None]).ravel()
    period = np.repeat(np.arange(passes) // 30, len(azimuth))
    frames = []
    for gate in gates:
        height = gate * np.sin(np.radians(elevation)) + 1.0
        wind = bump * speed_at(np.array(height), period)
        turn = np.radians(np.tile(azimuth, passes) - from_at(np.array(height)))
        speed = -wind * np.cos(turn) * np.cos(np.radians(elevation))
        frames.append(
            pd.DataFrame(
                {"time_utc": START + (seconds * 1e9).astype("timedelta64[ns]"), "azimuth_deg": np.tile(azimuth, passes) % 360,
                 "elevation_deg": elevation, "range_m": gate, "radial_speed_mps": speed, "cnr_db": -10.0}
            )
        )  # fmt: skip
    table = pd.concat(frames).sort_values(["time_utc", "range_m"], kind="stable")
    table.to_csv(folder / f"{name}.csv", index=False, float_format="%.8f")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("field")
    (folder / "site.yaml").write_text(SITE, encoding="utf-8")
    (folder / "campaign.yaml").write_text(CAMPAIGN, encoding="utf-8")
    rays(folder, "circle", np.arange(10.0, 360.0, 20.0), 60.0, [57.0, 115.0, 230.0], 1.0)
    rays(folder, "arc", 90.0 + np.arange(-28.0, 29.0, 4.0), np.degrees(np.arctan2(99.0, 100.0)), [ARC_M], 1.1)
    ends = START + np.arange(1, PERIODS + 1) * np.timedelta64(10, "m")
    period = np.arange(PERIODS)
    levels = {"time_utc": ends.astype("datetime64[s]").astype(str)}
    for height in (50, 100):
        levels[f"U{height}"] = speed_at(np.array(height), period)
        levels[f"D{height}"] = np.full(PERIODS, from_at(np.array(height)))
    pd.DataFrame(levels).to_csv(folder / "mast.csv", index=False)
    retrieve(load_campaign(folder / "campaign.yaml"))
    return folder


@pytest.fixture(scope="module")
def found(folder: Path) -> Comparison:
    return compare(load_campaign(folder / "campaign.yaml"), predict=False)


def row_of(comparison: Comparison, scan: str, sector_deg: float) -> Row:
    return next(
        row for row in comparison.rows if (row.matched.scan, row.matched.sector_deg) == (scan, sector_deg)
    )


def test_each_scan_is_set_beside_the_level_of_the_mast_nearest_to_it(found: Comparison) -> None:
    """Gates at 50.4, 100.6 and 200.2 m; at 200 m the mast's 100 m is 2^-.2 of it."""
    low, middle, high = (row_of(found, f"circle, {gate} m", 360.0) for gate in (57, 115, 230))
    assert [row.matched.mast_height_m for row in (low, middle, high)] == [50, 100, 100]
    assert low.speed.slope == pytest.approx(1.0, abs=2e-3)
    assert middle.speed.slope == pytest.approx(1.0, abs=2e-3)
    assert high.speed.slope == pytest.approx(2**-0.2, abs=2e-3)
    assert high.direction.bias_deg == pytest.approx(5.0, abs=0.05)
    assert row_of(found, "arc", 60.0).speed.slope == pytest.approx(1 / 1.1, abs=2e-3)


def test_the_profile_is_that_of_the_wind_across_north(found: Comparison) -> None:
    widest = [row.matched for row in found.rows if row.matched.sector_deg in (60, 360)]
    profile = wind_profile(widest, found.levels, {one.scan: one.scan.split(",")[0] for one in widest})
    assert profile is not None
    assert profile.periods == PERIODS
    mast, circle, arc = profile.levels
    assert (mast.name, circle.name, arc.name) == ("mast", "circle", "arc")
    for one in (mast, circle):
        wanted = speed_at(one.height_m, np.arange(PERIODS)[:, None]).mean(axis=0)
        assert one.speed_mps == pytest.approx(wanted, rel=1e-3)
        off = (one.from_deg - from_at(one.height_m) + 180) % 360 - 180
        assert np.abs(off).max() < 0.05
    assert arc.height_m == pytest.approx([100.0])
    assert wind_profile(widest[:1], {None: found.levels[50.0]}, {widest[0].scan: "x"}) is None


def test_the_table_is_the_same_in_both_formats_and_names_its_heights(folder: Path, found: Comparison) -> None:
    write_comparison(found, folder / "results", title="Field", kinds=())
    csv = pd.read_csv(folder / "results" / "comparison.csv")
    with duckdb.connect() as connection:
        parquet = connection.execute(f"SELECT * FROM '{folder / 'results' / 'comparison.parquet'}'").df()
    assert list(csv.columns) == list(parquet.columns)
    assert csv["slope"].to_numpy() == pytest.approx(parquet["slope"].to_numpy(), rel=1e-5)
    assert csv["height_m"].to_numpy() == pytest.approx([50.4, 100.6, 200.2, 100, 100, 100], abs=0.1)
    assert "mast at 50 m" in (folder / "results" / "compare.log").read_text(encoding="utf-8")


def predicted(row: Row, slope: float, lasting: float) -> Row:
    values = {"slope": slope, "slope_std": lasting, "residual_std_mps": row.speed.residual_std_mps}
    error = SizeError(
        sector_deg=row.matched.sector_deg, rays=15, scans_per_10min=30, period_s=20.0, range_m=140.0, condition=3.0,
        values=values,
    )  # fmt: skip
    return row._replace(predicted=error)


def test_agreement_is_judged_by_the_standard_errors_of_both(found: Comparison) -> None:
    """Apart by .01: with lasting errors of .004 that is 2.5 of them, with .006 it is 1.7; the scatter adds nothing here."""
    row = row_of(found, "arc", 60.0)
    near, far = (predicted(row, row.speed.slope - 0.01, lasting) for lasting in (0.006, 0.004))
    shown = found._replace(rows=(near, far))
    assert [one["slope_agrees"] for one in table_rows(shown)] == [True, False]
    assert table_rows(shown)[0]["slope_apart"] == pytest.approx(0.01)
    told = verdicts(shown)[0]
    assert told.startswith("slope: measured and predicted agree within 2 standard errors in 1 of 2 rows")
    assert "not in arc 60° (+2." in told
    assert "as few as 6 periods" in verdicts(shown)[-1]
    assert verdicts(found) == []


def test_every_figure_is_drawn(folder: Path, found: Comparison) -> None:
    """A PNG of each kind for the arc, of every size where that is asked for; the animation has a frame for each."""
    files = write_comparison(found, folder / "results", title="Field", kinds=KINDS, every_size=True)
    names = {path.name for path in files}
    own = {f"{kind}_arc.png" for kind in ("time", "direction", "wind", "rose", "sizes")}
    sizes = {f"{kind}_arc_{size}.png" for kind in ("scatter", "scatter_direction") for size in (60, 36, 20)}
    assert own | sizes | {"profile.png", "sizes_arc.gif"} <= names
    for path in files:
        if path.suffix == ".png":
            with Image.open(path) as picture:
                grey = np.asarray(picture.convert("L"))
            assert 500 < grey.shape[1] < 2000
            assert np.mean(grey < 250) > 0.01
    with Image.open(folder / "results" / "sizes_arc.gif") as film:
        assert film.n_frames == 3
    usual = write_comparison(found, folder / "results", title="Field")
    assert {path.name for path in usual} >= own | {"scatter_arc_60.png", "profile.png"}
    assert not {"scatter_arc_36.png", "scatter_arc_20.png"} & {path.name for path in usual}


def test_figures_are_chosen_by_name(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    campaign = folder / "campaign.yaml"
    arguments = ["compare", str(campaign), "--no-prediction", "--json", "--figures"]
    assert cli.run([*arguments, "rose,profile"]) == 0
    document = json.loads(capsys.readouterr().out)
    drawn = {Path(name).name for name in document["files"] if name.endswith(("png", "gif"))}
    circles = {f"rose_circle__{gate}_m.png" for gate in (57, 115, 230)}
    assert drawn == {"rose_arc.png", "profile.png"} | circles
    assert document["verdicts"] == []
    assert cli.run([*arguments, "rosé"]) == cli.BAD_INPUT
    assert "allowed: scatter, turn" in capsys.readouterr().err


def test_the_command_prints_both_tables(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.run(["compare", str(folder / "campaign.yaml"), "--no-prediction", "--no-figures"]) == 0
    said = capsys.readouterr()
    assert "Speed: means over 600 s against the mast" in said.out
    assert "plain slope" in said.out
    assert "as the reference study did" in said.err.replace("\n", " ")


def test_a_long_line_under_a_title_goes_on_in_the_next_and_nothing_of_it_is_cut() -> None:
    where = (
        "A campaign with a long name, one of many: sector to the south, means over 10 min, 60°, 144 periods"
    )
    with canvas(5.4, 5.8) as figure:
        title(figure, "Wind direction", where)
        drawn = figure.texts[1]
        box = drawn.get_window_extent(figure.canvas.get_renderer())  # type: ignore[attr-defined]
        assert " ".join(drawn.get_text().split()) == where
        assert "\n" in drawn.get_text()
        assert box.x1 < figure.bbox.x1
