"""Every kind of scan that a site can hold goes through `retrieve`: what can be known comes back, the rest says why not."""

import json
from pathlib import Path

import duckdb
import numpy as np
import pandas as pd
import pytest

from geometry.errors import InputError
from planner.analysis import retrieve
from planner.analysis_files import Retrieved
from planner.files.yaml_campaign import load_campaign
from planner.files.yaml_site import parse_site
from planner.plan import Plan

# Three lidars around a field, 120 degrees apart; the fourth is at the field's middle.
SITE = """\
name: Field
crs: EPSG:32632
ground_height_m: 5
lidars:
  - {name: A, position: [500000, 6250000, 6], instrument: windscanner-200s}
  - {name: B, position: [499567, 6250750, 6], instrument: windscanner-200s}
  - {name: C, position: [500433, 6250750, 6], instrument: windscanner-200s}
  - {name: V, position: [500000, 6250500, 6], instrument: windscanner-200s}
targets:
  - {name: low, position: [500000, 6250500, 105]}
  - {name: high, position: [500000, 6250500, 305]}
  - {name: aside, position: [500100, 6250500, 205]}
scans:
  - {name: stare A, lidar: A, target: high, type: stare, accumulation_s: 1}
  - {name: stare B, lidar: B, target: high, type: stare, accumulation_s: 1}
  - {name: stare C, lidar: C, target: high, type: stare, accumulation_s: 1}
  - {name: tour A, lidar: A, type: points, targets: [low, high, aside], accumulation_s: 1}
  - {name: tour B, lidar: B, type: points, targets: [low, high, aside], accumulation_s: 1}
  - {name: tour C, lidar: C, type: points, targets: [low, high, aside], accumulation_s: 1}
  - {name: sector, lidar: A, target: low, type: sector, sector_deg: 60, step_deg: 4, accumulation_s: 1}
  - {name: circle, lidar: V, type: ppi, elevation_head_deg: 60, step_deg: 20, accumulation_s: 1}
  - {name: slice, lidar: A, target: low, type: rhi, elevation_from_deg: 0, elevation_to_deg: 150, step_deg: 10, accumulation_s: 1}
  - {name: window, lidar: A, target: low, type: raster, width_deg: 4, height_deg: 4, step_deg: 2, accumulation_s: 1}
  - {name: beams, lidar: A, type: sector, sector_deg: 60, step_deg: 60, motion: step, accumulation_s: 0.5,
     azimuth_head_deg: 20, elevation_head_deg: 0}
pairs:
  - {name: triple, scans: [stare A, stare B, stare C], target: high, synchronised: true}
  - {name: triple level, scans: [stare A, stare B, stare C], target: high, synchronised: true, columns: 2}
  - {name: low, scans: [tour A, tour B], target: low, synchronised: true}
  - {name: high, scans: [tour A, tour B, tour C], target: high, synchronised: true}
wind: {speeds_mps: [8]}
"""
U, V, W = 6.0, -3.0, 0.4
GATES = (200.0, 450.0, 500.0, 510.0, 580.0, 600.0)
START = np.datetime64("2024-01-01T00:00:00", "ns")
PASSES = 40


@pytest.fixture(scope="module")
def plan() -> Plan:
    return Plan(parse_site(SITE))


def radial(azimuth_deg: np.ndarray, elevation_deg: np.ndarray) -> np.ndarray:
    """The wind on beams: the forward model, written out."""
    azimuth, elevation = np.radians(azimuth_deg), np.radians(elevation_deg)
    return (U * np.sin(azimuth) + V * np.cos(azimuth)) * np.cos(elevation) + W * np.sin(elevation)


def written(folder: Path, plan: Plan, scan: str, *, missing: int = 0) -> str:
    """Rays of a scan in the uniform wind, as a CSV with a row for each ray and gate; the line of the campaign file."""
    rays = plan.layout[scan].scan
    number, angles = rays.count, (np.mod(rays.azimuth_deg, 360.0), rays.elevation_deg)
    seconds = (rays.time_s + rays.period_s * np.arange(PASSES)[:, None]).ravel()
    azimuth, elevation = (np.tile(angle, PASSES) for angle in angles)
    speed = radial(azimuth, elevation)
    speed[: missing * number] = np.nan
    ranges = np.unique([*GATES, *plan.layout[scan].aim.range_m])
    frame = pd.DataFrame(
        {
            "time_utc": np.repeat(START + (seconds * 1e9).astype("timedelta64[ns]"), len(ranges)),
            "azimuth_deg": np.repeat(azimuth, len(ranges)),
            "elevation_deg": np.repeat(elevation, len(ranges)),
            "range_m": np.tile(ranges, PASSES * number),
            "radial_speed_mps": np.repeat(speed, len(ranges)),
            "cnr_db": -10.0,
        }
    )
    name = f"{scan.replace(' ', '_')}.csv"
    frame.to_csv(folder / name, index=False, float_format="%.8f")
    return f"{{scan: {scan}, path: {name}, kind: csv, columns: {{names: {{cnr_db: cnr_db}}}}"


def run(folder: Path, plan: Plan, *inputs: str, more: str = "") -> Retrieved:
    (folder / "site.yaml").write_text(SITE, encoding="utf-8")
    listed = "\n".join(f"  - {line}}}" for line in inputs)
    filters = "filters: {automatic: 'off', cnr_db: [-30, 0], radial_speed_mps: [-30, 30]}"
    text = f"name: kinds\nsite: site.yaml\ninputs:\n{listed}\n{filters}\n"
    (folder / "campaign.yaml").write_text(text + more, encoding="utf-8")
    return retrieve(load_campaign(folder / "campaign.yaml"))


def table(folder: Path, name: str) -> pd.DataFrame:
    """A result as Parquet, which has to hold what the CSV holds."""
    with duckdb.connect() as connection:
        read = connection.execute(f"SELECT * FROM '{folder / 'results' / name}.parquet'").df()
    csv = pd.read_csv(folder / "results" / f"{name}.csv")
    assert list(read.columns) == list(csv.columns)
    assert len(read) == len(csv)
    return read


def test_three_stares_give_the_vertical_wind_too(tmp_path: Path, plan: Plan) -> None:
    lines = [written(tmp_path, plan, f"stare {name}") for name in "ABC"]
    run(tmp_path, plan, *lines, more="pairs: [triple, triple level]\n")
    fast = table(tmp_path, "fast_triple")
    assert len(fast) == PASSES
    assert fast[["u_mps", "v_mps", "w_mps"]].to_numpy() == pytest.approx(
        np.tile([U, V, W], (PASSES, 1)), abs=1e-3
    )
    assert (fast["rays"] == 3).all()
    means = table(tmp_path, "means_60s").set_index("scan")
    assert means.loc[["triple"], "w_mps"].to_numpy() == pytest.approx(W, abs=1e-3)
    level = means.loc[["triple level"]]
    assert level["w_mps"].isna().all()
    assert np.abs(level["speed_mps"].to_numpy() - np.hypot(U, V)).max() < 0.05  # w leans on three sides alike
    residual = table(tmp_path, "fast_triple_level")["residual_std_mps"].to_numpy()
    assert np.all(residual > 0.1)  # two columns cannot hold what rises


def test_points_of_three_lidars_meet_target_by_target(tmp_path: Path, plan: Plan) -> None:
    """Two tours make a dual at the low point, three a triple at the high one; each at its own gate."""
    lines = [written(tmp_path, plan, f"tour {name}") for name in "ABC"]
    found = run(tmp_path, plan, *lines, more="pairs: [low, high]\n")
    high, low = table(tmp_path, "fast_high"), table(tmp_path, "fast_low")
    assert high[["u_mps", "v_mps", "w_mps"]].mean().to_numpy() == pytest.approx([U, V, W], abs=1e-3)
    assert "w_mps" not in low
    assert low["u_mps"].mean() == pytest.approx(U, abs=0.15)  # w tan φ of two beams at 11°
    assert set(found.alone) == {"tour A, aside", "tour B, aside", "tour C, low", "tour C, aside"}
    means = table(tmp_path, "means_600s").set_index("scan")
    assert means.loc["low", "height_m"] == pytest.approx(100.0)
    assert means.loc["high", "height_m"] == pytest.approx(300.0)


def test_a_point_that_no_other_lidar_sees_gives_its_radial_speed_and_says_why(
    tmp_path: Path, plan: Plan
) -> None:
    found = run(tmp_path, plan, written(tmp_path, plan, "tour A"))
    assert found.means == {}
    assert found.lost["tour A, aside"] == {"fewer rays than unknowns": PASSES}
    assert found.offsets_deg["tour A, aside"] == pytest.approx(0.0, abs=1e-3)
    fast = table(tmp_path, "fast_tour_A__aside")
    assert fast["u_mps"].isna().all()
    assert (fast["reason"] == "fewer rays than unknowns").all()
    beam = plan.layout["tour A"].scan
    wanted = radial(beam.azimuth_deg[2:], beam.elevation_deg[2:])[0]
    assert fast["radial_speed_mps"].to_numpy() == pytest.approx(wanted, abs=1e-4)
    means = table(tmp_path, "beams_tour_A__aside_600s")
    assert means["radial_speed_mps"].to_numpy() == pytest.approx(wanted, abs=1e-4)
    assert means["height_m"].to_numpy() == pytest.approx(200.0, abs=0.05)
    assert means["along_beam_mps"].to_numpy() == pytest.approx(
        wanted / np.cos(np.radians(beam.elevation_deg[2])), abs=1e-4
    )
    log = (tmp_path / "results" / "retrieve.log").read_text(encoding="utf-8")
    assert "need the beam of another lidar" in log
    assert f"no wind: {PASSES} scans: fewer rays than unknowns" in log


def test_a_circle_gives_a_profile_with_the_vertical_wind(tmp_path: Path, plan: Plan) -> None:
    """Without a target, at the gates that are wanted, each a result with its height: r sin 60° and the head's 1 m."""
    line = f"{written(tmp_path, plan, 'circle')}, gates_m: [200, 450], fit_columns: 3"
    run(tmp_path, plan, line)
    means = table(tmp_path, "means_600s").set_index("scan")
    means = means[~means.index.duplicated()]  # of the first ten minutes
    assert list(means.index) == ["circle, 200 m", "circle, 450 m"]
    assert means["w_mps"].to_numpy() == pytest.approx(W, abs=1e-4)
    assert means["speed_mps"].to_numpy() == pytest.approx(np.hypot(U, V), abs=1e-4)
    assert means["height_m"].to_numpy() == pytest.approx(
        [200 * np.sin(np.pi / 3) + 1, 450 * np.sin(np.pi / 3) + 1], abs=0.1
    )
    assert means["sector_deg"].to_list() == [360.0, 360.0]


def test_a_circle_without_target_or_gate_says_what_to_give(tmp_path: Path, plan: Plan) -> None:
    with pytest.raises(InputError, match="gate_m or gates_m"):
        run(tmp_path, plan, written(tmp_path, plan, "circle"))


def test_a_slice_gives_radial_speeds_on_a_grid_over_the_top(tmp_path: Path, plan: Plan) -> None:
    """0 to 150 degrees in steps of 10: fifteen rays by all gates; steep rays have no horizontal part."""
    found = run(tmp_path, plan, written(tmp_path, plan, "slice"))
    grid = table(tmp_path, "beams_slice_600s")
    grid = grid[grid["time_utc"] == grid["time_utc"].min()].reset_index()
    layout = plan.layout["slice"]
    gates = np.unique([*GATES, *layout.aim.range_m])
    assert len(grid) == 15 * len(gates)
    wanted = radial(grid["azimuth_deg"].to_numpy(), grid["elevation_deg"].to_numpy())
    assert grid["radial_speed_mps"].to_numpy() == pytest.approx(wanted, abs=1e-4)
    steep = grid["elevation_deg"].abs() > 60
    assert grid["along_beam_mps"].isna().equals(steep)
    behind = grid["azimuth_deg"].sub(layout.axis_azimuth_deg + 180).mod(360).round(3).isin([0.0, 360.0])
    assert behind.sum() == 6 * len(gates)  # 95 to 145 degrees
    up = grid["range_m"] * np.sin(np.radians(grid["elevation_deg"])) + 1
    assert grid["height_m"].to_numpy() == pytest.approx(up.to_numpy(), abs=0.1)
    assert found.alone == ("slice",)
    assert table(tmp_path, "fast_slice")["reason"].unique().tolist() == ["fewer rays than unknowns"]


def test_a_raster_gives_radial_speeds_on_its_window(tmp_path: Path, plan: Plan) -> None:
    run(tmp_path, plan, written(tmp_path, plan, "window"))
    grid = table(tmp_path, "beams_window_600s")
    scan = plan.layout["window"].scan
    assert len(grid.groupby(["azimuth_deg", "elevation_deg"])) == scan.count == 9
    assert grid["radial_speed_mps"].to_numpy() == pytest.approx(
        radial(grid["azimuth_deg"].to_numpy(), grid["elevation_deg"].to_numpy()), abs=1e-4
    )


def test_two_beams_are_a_sector_of_two_rays(tmp_path: Path, plan: Plan) -> None:
    """No ray to spare: a wind, but no residual and no covariance from it."""
    run(tmp_path, plan, f"{written(tmp_path, plan, 'beams')}, gate_m: 200")
    fast = table(tmp_path, "fast_beams")
    assert fast[["u_mps", "v_mps"]].to_numpy() == pytest.approx(np.tile([U, V], (PASSES, 1)), abs=1e-4)
    assert fast["residual_std_mps"].isna().all()
    assert (fast["rays"] == 2).all()


def test_scans_without_a_wind_stay_in_the_table_with_their_reason(tmp_path: Path, plan: Plan) -> None:
    """Of a sector that lost all but its ends, the narrow sizes have one ray or none."""
    line = written(tmp_path, plan, "sector")
    path = tmp_path / "sector.csv"
    frame = pd.read_csv(path)
    middle = plan.layout["sector"].scan.azimuth_deg[4:13]
    inside = frame["azimuth_deg"].sub(middle[0] - 1).mod(360) < np.mod(middle[-1] - middle[0], 360) + 2
    frame.loc[inside, "radial_speed_mps"] = np.nan
    frame.to_csv(path, index=False)
    more = "sizes_deg: [60, 36, 28]\n"
    found = run(tmp_path, plan, f"{line}, filters: {{automatic: 'off', ray_share: 0.4}}", more=more)
    fast = table(tmp_path, "fast_sector")
    assert found.lost["sector"] == {"fewer rays than unknowns, 36°": PASSES}
    assert fast.query("sector_deg == 60")["reason"].isna().all()
    assert (fast.query("sector_deg == 36")["reason"] == "fewer rays than unknowns").all()
    assert sorted(fast["sector_deg"].unique()) == [36, 60]  # of 28 degrees no ray is left: counted before
    assert fast.query("sector_deg == 60")["u_mps"].notna().all()
    counts = json.loads((tmp_path / "results" / "filters.json").read_text(encoding="utf-8"))
    assert {"no wind": "fewer rays than unknowns, 36°", "scans": PASSES} in counts["sector"]


def test_a_nacelle_file_gives_means_along_and_across_by_the_rules(tmp_path: Path, plan: Plan) -> None:
    """Beams at 350 and 50 degrees, 2 Hz in turn: five whole periods, of which one lost a fifth of its right beam."""
    seconds = np.arange(1200) / 2
    line = np.arange(1200) % 2
    toward = -radial(np.where(line == 0, -10.0, 50.0), np.zeros(1200))
    toward[(seconds >= 240) & (seconds < 264.5) & (line == 1)] = 9998.0  # the file's way to say nothing
    frame = pd.DataFrame(
        {
            "Timestamp": START + (seconds * 1e9).astype("timedelta64[ns]"),
            "LOSindex": line,
            "Distance": 200.0,
            "RWS": toward,
            "CNR": -10.0,
            "RWSStatus": 1,
        }
    )
    frame.to_csv(tmp_path / "nacelle.csv", index=False)
    beams = "beam_azimuth_deg: {0: 350, 1: 50}, gate_m: 200, two_beam: {largest_angle_deg: 85}"
    found = run(tmp_path, plan, f"{{scan: beams, kind: nacelle, path: nacelle.csv, {beams}")
    means = table(tmp_path, "two_beam_beams_120s")
    axis = np.radians(20.0)
    along, across = -(U * np.sin(axis) + V * np.cos(axis)), U * np.cos(axis) - V * np.sin(axis)
    assert len(means) == 4
    assert means["along_mps"].to_numpy() == pytest.approx(along, abs=1e-4)
    assert means["across_mps"].to_numpy() == pytest.approx(across, abs=1e-4)
    assert means["angle_deg"].to_numpy() == pytest.approx(np.degrees(np.arctan2(across, along)), abs=1e-3)
    assert means["samples_left"].tolist() == [120] * 4
    rules = {step.name: (step.before, step.after) for step in found.steps["beams"]}
    assert rules["samples on both beams"] == (5, 4)
    fast = table(tmp_path, "fast_beams").dropna(subset="u_mps")
    assert len(fast) == 600 - 24
    assert fast["u_mps"].to_numpy() == pytest.approx(U, abs=1e-4)


def test_rules_for_two_beams_belong_to_a_scan_of_two(tmp_path: Path, plan: Plan) -> None:
    line = f"{written(tmp_path, plan, 'sector')}, two_beam: {{}}"
    with pytest.raises(InputError, match="sector of 15 rays"):
        run(tmp_path, plan, line)


def test_the_means_of_a_run_are_those_of_pandas_from_its_single_scans(tmp_path: Path, plan: Plan) -> None:
    """A second computation of period ends, counts, scalar and vector means and w, with the times shifted by 37 s."""
    lines = [written(tmp_path, plan, f"stare {name}", missing=3) for name in "ABC"]
    averaging = "averaging: {periods_s: [7, 60], time_shift_s: 37}\n"
    run(tmp_path, plan, *lines, more=f"pairs: [triple]\n{averaging}")
    fast = table(tmp_path, "fast_triple")
    shifted = pd.to_datetime(fast["time_utc"]) + pd.Timedelta(seconds=37)
    for period_s in (7, 60, 600):
        ends = shifted.dt.floor(f"{period_s}s") + pd.Timedelta(seconds=period_s)
        grouped = fast.groupby(ends.to_numpy())
        means = table(tmp_path, f"means_{period_s}s")
        assert means["time_utc"].tolist() == list(grouped.groups)
        assert means["count"].tolist() == grouped.size().tolist()
        assert means["speed_mps"].to_numpy() == pytest.approx(
            grouped["speed_mps"].mean().to_numpy(), abs=1e-4
        )
        vector = np.hypot(grouped["u_mps"].mean(), grouped["v_mps"].mean())
        assert means["vector_speed_mps"].to_numpy() == pytest.approx(vector.to_numpy(), abs=1e-4)
        assert means["w_mps"].to_numpy() == pytest.approx(grouped["w_mps"].mean().to_numpy(), abs=1e-4)
        turn = np.degrees(np.arctan2(-grouped["u_mps"].mean(), -grouped["v_mps"].mean())) % 360
        assert means["from_deg"].to_numpy() == pytest.approx(turn.to_numpy(), abs=1e-3)
        whole = period_s // plan.layout["stare A"].scan.period_s
        assert means["availability"].to_numpy() == pytest.approx(
            np.minimum(means["count"] / whole, 1), abs=1e-5
        )


def test_faint_rays_weigh_less_where_that_is_asked_for(tmp_path: Path, plan: Plan) -> None:
    """At -25 dB the noise is more than ten times that at -10 (photons go as the signal): a wrong ray hardly counts."""
    winds = {}
    for weights in ("equal", "cnr"):
        folder = tmp_path / weights
        folder.mkdir()
        line = written(folder, plan, "sector")
        frame = pd.read_csv(folder / "sector.csv")
        faint = (frame.index // len(frame["range_m"].unique())) % 5 == 0
        frame["radial_speed_mps"] += np.where(faint, 1.0, 0.0)
        frame["cnr_db"] = np.where(faint, -25.0, -10.0)
        frame.to_csv(folder / "sector.csv", index=False)
        run(folder, plan, line, more=f"sizes_deg: [60]\nweights: {weights}\n")
        winds[weights] = table(folder, "fast_sector")
    level = -W * np.tan(np.radians(plan.layout["sector"].axis_elevation_deg))
    error = {name: np.abs(found["v_mps"] - (V - level)).mean() for name, found in winds.items()}
    assert error["cnr"] < 0.2 * error["equal"]
    assert (winds["cnr"]["r_squared"] > 0.98).all()
    counts = json.loads((tmp_path / "cnr" / "results" / "filters.json").read_text(encoding="utf-8"))["sector"]
    assert "CNR for its weight" in [step.get("name") for step in counts]
