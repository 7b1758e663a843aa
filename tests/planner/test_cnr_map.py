"""CNR maps from plan to site file: the window holds the target, and planted offsets come back."""

import json
import shlex
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from geometry.angles import difference_deg
from geometry.beams import unit_vector
from geometry.errors import InputError
from geometry.gates import Probe
from geometry.head import Mounting
from planner.cli import run
from planner.cnr_fit import Drift, Mapped, drifts, fit_head, site_keys
from planner.cnr_map import choose_targets, plan_map
from planner.cnr_simulate import rehearse
from planner.cnr_window import staggered
from planner.figures.cnr_map import cnr_map_figure
from planner.files.yaml_edit import write_lidar
from planner.files.yaml_site import load_site, parse_site
from planner.hard_targets import sought
from planner.places import Places
from reconstruct.cnr_map import CnrMap
from reconstruct.hard_target import find_target
from reconstruct.sightings import Sighting
from reconstruct.target_choice import best_targets

ROOT = Path(__file__).resolve().parents[2]
PROBE = Probe(pulse_ns=200, window_ns=256)
GATES = 81
SITE = """\
name: three masts  # for maps
crs: EPSG:32632
ground_height_m: 4.8
lidars:
  # the one in the middle
  - name: L
    position: [447893.983, 6256558.133, 5.078]
    instrument: windscanner-200s
    azimuth_offset_deg: 12.3   # first guess
    elevation_offset_deg: 0.6
    uncertainty: {position_m: 0.02, heading_deg: 0.05, levelling_deg: 0.03, azimuth_deg: 0.02, elevation_deg: 0.02}
  - {name: other, position: [448893.983, 6256558.133, 5.078], instrument: windscanner-200s, azimuth_offset_deg: 1.5}
masts:
  - {name: north, position: [447950, 6257500, 5], height_m: 90, width_m: 1}
  - {name: east, position: [448700, 6256200, 5], height_m: 80, width_m: 1}
  - {name: south, position: [447647.39, 6255635.76, 4.836], height_m: 100, width_m: 1}
  - {name: west, position: [447000, 6256700, 5], height_m: 70, width_m: 1}
hard_targets:
  - {name: tip N, on: north, shape: tip, size_m: 1, uncertainty_m: 0.02}
  - {name: tip E, on: east, shape: tip, size_m: 1, uncertainty_m: 0.02}
  - {name: tip S, on: south, shape: tip, size_m: 1, uncertainty_m: 0.02}
  - {name: tip W, on: west, shape: tip, size_m: 1, uncertainty_m: 0.02}
targets:
  - {name: cup, mast: south, height_m: 103}
"""
TIPS = ("tip N", "tip E", "tip S", "tip W")
PLANTED = {"azimuth_offset_deg": 12.35, "pitch_deg": 0.03, "roll_deg": -0.03}
OFF = {
    "azimuth_offset_deg": 0.05,
    "pitch_deg": 0.03,
    "roll_deg": -0.03,
}  # the same less what the site file says


@pytest.fixture
def site_file(tmp_path: Path) -> Path:
    path = tmp_path / "site.yaml"
    path.write_text(SITE, encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def places() -> Places:
    return Places(parse_site(SITE))


def planted(places: Places) -> Mounting:
    return replace(places.mounting(places.site.lidar("L")), **PLANTED)


def maps_of(places: Places, seed: int, names=TIPS, **planted_too: float) -> list[tuple[str, CnrMap]]:
    """What the planned scans measure with the head that is planted; gates in the middle of the planned ones."""
    off = {**OFF, **planted_too}
    done = rehearse(places, "L", names, rng=np.random.default_rng(seed), planted=off)
    middles = [round(plan.expected.range_head_m) for plan in done.plans]
    return [
        (name, found.between_m(middle - GATES // 2, middle + GATES // 2))
        for (name, found), middle in zip(done.maps, middles, strict=True)
    ]


def test_planted_offsets_come_back_within_a_hundredth_of_a_degree_and_inside_their_uncertainty(
    places: Places,
) -> None:
    """0.05° of heading, 0.03° of pitch and roll, 1 m gates, head and masts off their survey; 6 seeded runs.

    200 runs of the Høvsøre rehearsal: `python -m tests.benchmarks.bench_cnr_offsets`.
    """
    inside = []
    for seed in range(6):
        fit = fit_head(places, "L", maps_of(places, seed), probe=PROBE).fit
        for angle in fit.solved:
            error = getattr(fit.mounting, angle) - getattr(planted(places), angle)
            assert abs(error) < 0.01
            inside.append(abs(error) < 2 * fit.std_deg(angle))
    assert np.mean(inside) >= 0.8  # of 24: 95.4 % expected, less is under 0.5 % likely


def test_a_staggered_map_is_met_at_every_phase_of_an_edge() -> None:
    """Any 8 neighbouring rows have columns within 1/4 of a step of any place, and any 8 columns rows."""
    azimuth, elevation = staggered(np.arange(30.0), np.arange(40.0), "rows")
    place = np.stack([azimuth, elevation], axis=1).reshape(40, 30, 2)
    place[1::2] = place[1::2, ::-1]
    assert np.abs(place[..., 0] - np.arange(30.0)).max() <= 0.5
    assert np.abs(place[..., 1] - np.arange(40.0)[:, None]).max() <= 0.5
    for phases in (place[5:13, 0, 0] % 1.0, place[0, 5:13, 1] % 1.0):
        ordered = np.sort(phases)
        assert np.diff(np.append(ordered, ordered[0] + 1.0)).max() < 0.25


def test_the_window_is_three_sigma_and_centred_on_where_the_head_must_point(places: Places) -> None:
    plan = plan_map(places, "L", "tip S")
    azimuth, elevation = plan.windows[-1].rays
    head = places.mounting(places.site.lidar("L")).to_head(
        plan.expected.true.azimuth_deg, plan.expected.true.elevation_deg
    )
    step = np.diff(plan.windows[-1].azimuth_deg[:2])[0]
    assert abs(float(np.mean([azimuth.min(), azimuth.max()])) - float(head[0])) < step / 2
    assert abs(float(np.mean([elevation.min(), elevation.max()])) - float(head[1])) < step / 2
    assert azimuth.max() - azimuth.min() > 6 * 0.05
    assert np.hypot(0.05, 0.02) < plan.expected.azimuth_std_deg < 0.06


def test_every_step_of_a_serpentine_is_one_step_long_and_its_time_adds_up(places: Places) -> None:
    """Rays of 100 ms and moves of 2 sqrt(step/acceleration), by hand."""
    for order in ("rows", "columns"):
        window = plan_map(places, "L", "tip S", order=order).windows[-1]
        azimuth, elevation = window.rays
        moves = np.maximum(np.abs(np.diff(azimuth)), np.abs(np.diff(elevation)))
        assert moves.max() < 0.02
        assert window.time_s == pytest.approx(0.1 * azimuth.size + (2 * np.sqrt(moves / 100)).sum(), rel=1e-6)


def test_an_unknown_heading_is_found_by_one_row_around_the_circle(places: Places) -> None:
    coarse, fine = plan_map(places, "L", "tip S", heading_std_deg=180.0).windows
    assert coarse.elevation_deg.size == 1
    assert np.ptp(coarse.azimuth_deg) >= 359.9
    assert coarse.elevation_deg[0] < fine.elevation_deg.mean()
    assert np.ptp(fine.azimuth_deg) < 1.0


def test_targets_around_are_chosen_and_targets_in_one_direction_are_warned_of(places: Places) -> None:
    choice = choose_targets(places, "L")
    assert choice is not None
    assert len(choice.names) == 3
    assert choice.undetermined == ()
    few = Places(
        places.site.model_copy(
            update={"hard_targets": places.site.hard_targets[:1], "masts": places.site.masts[:1]}
        )
    )
    warned = choose_targets(few, "L")
    assert warned is not None
    assert {"pitch_deg", "roll_deg"} <= set(warned.undetermined)


def test_a_weak_set_of_targets_is_planned_and_fitted_with_the_angles_that_it_tells(
    tmp_path: Path, capsys
) -> None:
    """Two targets: `plan` prints the --solve, `simulate` prints the fit, as it stands it works; without it, it is said."""
    site, out = tmp_path / "site.yaml", tmp_path / "maps"
    site.write_text(SITE, encoding="utf-8")
    assert run(["cnr-map", "plan", str(site), "--lidar", "L", "--target", "tip N", "--quiet"]) == 0
    assert "--solve" not in capsys.readouterr().out  # the four tips tell everything
    few = [
        *("cnr-map", "simulate", str(site), "--lidar", "L", "--out", str(out)),
        "--target",
        "tip N",
        "--target",
        "tip E",
    ]
    assert run([*few, "--plant", "azimuth_offset_deg=0.05"]) == 0
    following = capsys.readouterr().err.split("Next: lidarplan ")[1].strip()
    solve = following.split("--solve ")[1].split(",")
    assert solve == ["azimuth_offset_deg", "elevation_offset_deg", "pitch_deg"]
    assert run([*shlex.split(following), "--json"]) == 0
    found = {item["name"]: item for item in json.loads(capsys.readouterr().out)["angles"]}
    assert list(found) == solve
    moved = found["azimuth_offset_deg"]["value_deg"] - found["azimuth_offset_deg"]["before_deg"]
    assert abs(moved - 0.05) < 3.5 * found["azimuth_offset_deg"]["std_deg"]
    assert run(shlex.split(following.split(" --solve")[0])) == 2
    assert f"--solve {','.join(solve)}" in capsys.readouterr().err


def test_a_plan_of_targets_in_one_direction_says_what_they_tell(tmp_path: Path, capsys) -> None:
    """One tip alone: both offsets, with pitch and roll as declared."""
    others = ("name: east", "name: south", "name: west", "name: tip E", "name: tip S", "name: tip W")
    lines = [line for line in SITE.splitlines() if not any(other in line for other in others)]
    site = tmp_path / "one.yaml"
    site.write_text("\n".join(lines).replace("mast: south", "mast: north"), encoding="utf-8")
    assert run(["cnr-map", "plan", str(site), "--lidar", "L"]) == 0
    text = capsys.readouterr().out
    assert (
        "with pitch_deg, roll_deg as the site file has them: --solve azimuth_offset_deg,elevation_offset_deg."
        in text
    )


def test_a_long_map_says_why_it_is_long(places: Places) -> None:
    """A tip of 0.1 m, the heading known to 0.2°: more than half an hour, and that is said; one of 1 m: not."""
    site = places.site
    thin = [item.model_copy(update={"size_m": 0.1}) for item in site.hard_targets]
    slow = plan_map(
        Places(site.model_copy(update={"hard_targets": tuple(thin)})), "L", "tip N", heading_std_deg=0.2
    )
    assert slow.time_s > 1800.0
    assert any(f"{slow.time_s / 60:.0f} min for " in note for note in slow.notes)
    assert plan_map(places, "L", "tip N").notes == ()


def test_of_many_targets_those_of_every_bearing_are_compared() -> None:
    """Twenty near ones in the north, two far ones to the south-east and south-west: the far ones are among the best three."""
    seen = [
        Sighting(
            f"{number}",
            800.0 * unit_vector(float(number), 5.0),
            float(number),
            5.0,
            800.0,
            0.003,
            0.003,
            0.1,
            0.02,
        )
        for number in range(20)
    ]
    seen += [
        Sighting(
            f"{azimuth}", 1500.0 * unit_vector(azimuth, 5.0), azimuth, 5.0, 1500.0, 0.003, 0.003, 0.1, 0.05
        )
        for azimuth in (120.0, 240.0)
    ]
    choice = best_targets(seen)
    assert {"120.0", "240.0"} <= set(choice.names)
    assert (choice.compared, choice.candidates) == (12, 22)
    assert choice.undetermined == ()


def test_a_rotor_before_the_mast_at_hovsore_is_named() -> None:
    plan = plan_map(Places(load_site(ROOT / "examples" / "hovsore" / "site.yaml")), "WS_S", "mast")
    assert [(item.name, item.part, inside) for item, inside in plan.others] == [("stand 5", "rotor", False)]
    assert plan.hidden_by == ("stand 5",)


def test_one_map_gives_no_offsets_and_says_why(places: Places) -> None:
    with pytest.raises(InputError, match=r"tip N.* do not determine"):
        fit_head(places, "L", maps_of(places, 1, TIPS[:1]), probe=PROBE)


def test_every_map_without_a_target_is_named(places: Places) -> None:
    good = maps_of(places, 1)
    dark = [
        (name, CnrMap(m.azimuth_deg, m.elevation_deg, m.range_m, np.minimum(m.cnr_db, -20.0)))
        for name, m in good[:2]
    ]
    with pytest.raises(InputError, match=r"map 1 \(tip N\).*\n.*map 2 \(tip E\)"):
        fit_head(places, "L", [*dark, *good[2:]], probe=PROBE)


def test_a_head_that_moved_between_two_tests_has_drifted(places: Places) -> None:
    """Repeated maps of a head that stands: no drift. One turned by 0.02° in between: named, with its size, not fitted."""
    names = (*TIPS, "tip W")
    *first, again = maps_of(places, 3, names)
    (still,) = fit_head(places, "L", [*first, again], probe=PROBE).drifts
    assert (still.target, still.maps, still.is_significant) == ("tip W", 2, False)
    assert still.chance > 0.05
    turned = maps_of(places, 3, names, azimuth_offset_deg=0.03)
    pair = [
        Mapped(
            name, sought(places.site, name)[0], m, find_target(m, shape="tip", size_m=1.0, probe=PROBE), None
        )
        for name, m in (first[2], turned[2])
    ]
    (moved,) = drifts(pair)
    assert moved.is_significant
    assert moved.chance < 1e-6
    assert moved.azimuth_deg == pytest.approx(0.02, abs=0.004)
    with pytest.raises(
        InputError, match="Between its first and last map tip N, tip E, tip S, tip W has moved"
    ):
        fit_head(places, "L", [*first, *turned[:4]], probe=PROBE)


def test_drift_is_called_significant_as_often_as_it_says(places: Places) -> None:
    """Three numbers without drift: 5 % of draws are called one."""
    rng = np.random.default_rng(1)
    called = [Drift("t", 2, *rng.normal(0, 1, 3), 1.0, 1.0, 1.0).is_significant for _ in range(2000)]
    assert np.mean(called) == pytest.approx(0.05, abs=0.015)


def test_offsets_go_into_the_site_file_and_leave_the_rest_as_it_is(site_file: Path) -> None:
    before = SITE.splitlines()
    after = write_lidar(site_file, "L", {"azimuth_offset_deg": 12.3512, "mounting.pitch_deg": 0.0301})
    text = site_file.read_text(encoding="utf-8").splitlines()
    changed = [line for line in text if line not in before]
    assert [line.split()[0] for line in changed] == ["azimuth_offset_deg:", "mounting:"]
    assert "# first guess" in changed[0]
    assert [line for line in before if line not in text] == ["    azimuth_offset_deg: 12.3   # first guess"]
    assert after.lidar("L").mounting.pitch_deg == 0.0301


def test_what_would_make_no_valid_site_leaves_the_file_alone(site_file: Path) -> None:
    with pytest.raises(InputError):
        write_lidar(site_file, "L", {"azimuth_ofset_deg": 1.0})
    assert site_file.read_text(encoding="utf-8") == SITE
    assert [path.name for path in site_file.parent.iterdir()] == ["site.yaml"]


def test_a_zero_at_grid_north_stays_out_of_the_heading_that_is_written() -> None:
    grid = Places(
        parse_site(
            SITE.replace(
                "instrument: windscanner-200s\n    azimuth",
                "instrument: windscanner-200s\n    north: grid\n    azimuth",
            )
        )
    )
    result = fit_head(
        grid,
        "L",
        maps_of(grid, 2),
        probe=PROBE,
        solve=("heading_deg", "elevation_offset_deg", "pitch_deg", "roll_deg"),
    )
    assert site_keys(result)["mounting.heading_deg"] == pytest.approx(0.05, abs=0.01)


def test_the_figure_of_a_map_is_a_picture(places: Places) -> None:
    result = fit_head(places, "L", maps_of(places, 1), probe=PROBE)
    assert cnr_map_figure(result.maps[0], PROBE.length_m).startswith(b"\x89PNG")


# The commands


def said(capsys, *arguments: object) -> Any:
    """The JSON of a command that goes well."""
    assert run([*map(str, arguments), "--json"]) == 0
    return json.loads(capsys.readouterr().out)


def test_the_walk_of_the_example_from_plan_to_pointing_recovers_what_was_planted(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Høvsøre: plan, simulate with .05° of heading, .03° of pitch and roll, fit --write, point: each within .01°."""
    site = tmp_path / "site.yaml"
    site.write_bytes((ROOT / "examples" / "hovsore" / "hard_target_test.yaml").read_bytes())
    plan = said(capsys, "cnr-map", "plan", site, "--lidar", "WS_S", "--out", tmp_path / "rays")
    best = plan["best_targets"]
    assert len(best["targets"]) == 3
    assert best["undetermined"] == []
    rays = (tmp_path / "rays" / "tip_of_tower_N_rays.csv").read_text(encoding="utf-8").splitlines()
    (tower,) = [item for item in plan["maps"] if item["target"] == "tip of tower N"]
    assert len(rays) - 1 == tower["windows"][0]["rows"] * tower["windows"][0]["columns"]
    truth = said(
        capsys, "cnr-map", "simulate", site, "--lidar", "WS_S", "--out", tmp_path / "maps", "--seed", 3,
        "--plant", "azimuth_offset_deg=0.05,pitch_deg=0.03,roll_deg=-0.03",
    )  # fmt: skip
    assert list(truth["maps"]) == best["targets"]
    maps = [tmp_path / "maps" / name for name in truth["maps"].values()]
    refused = run(["cnr-map", "fit", str(maps[0]), "--site", str(site), "--lidar", "WS_S", "--write"])
    assert refused == 2
    assert "do not determine" in capsys.readouterr().err
    assert "12.31" in site.read_text(encoding="utf-8")
    fit = said(capsys, "cnr-map", "fit", *maps, "--site", site, "--lidar", "WS_S", "--write")
    assert fit["written"]
    found = {angle["name"]: angle for angle in fit["angles"]}
    for name, value in truth["mounting"].items():
        if name in found:
            assert abs(found[name]["value_deg"] - value) < 0.01
    assert fit["range_offset_m"] == pytest.approx(0.0, abs=0.2)
    (row,) = said(capsys, "point", site)
    wanted = Mounting(**truth["mounting"]).to_head(row["azimuth_true_deg"], row["elevation_deg"])
    assert abs(float(difference_deg(row["azimuth_head_deg"], wanted[0]))) < 0.01
    assert abs(row["elevation_head_deg"] - float(wanted[1])) < 0.01


def test_a_rehearsal_without_planting_draws_from_the_stated_uncertainty(places: Places) -> None:
    """300 draws of heading and tilt scatter as the site file says; the same seed gives the same."""
    drawn = [rehearse(places, "L", (), rng=np.random.default_rng(seed)).planted for seed in range(300)]
    for name, std in (("azimuth_offset_deg", 0.05), ("pitch_deg", 0.03), ("elevation_offset_deg", 0.02)):
        assert np.std([item[name] for item in drawn]) == pytest.approx(std, rel=0.15)
    assert drawn[7] == rehearse(places, "L", (), rng=np.random.default_rng(7)).planted


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("--plant", "yaw=1"), "--plant yaw came; allowed: heading_deg, pitch_deg"),
        (("--plant", "pitch_deg=up"), "allowed: pitch_deg=NUMBER"),
        (("--target", "tree"), "no hard target, mast or turbine is called 'tree'; allowed: tip N"),
    ],
)
def test_what_cannot_be_rehearsed_is_told(site_file: Path, capsys, arguments, says) -> None:
    out = site_file.parent / "maps"
    assert run(["cnr-map", "simulate", str(site_file), "--lidar", "L", "--out", str(out), *arguments]) == 2
    assert says in capsys.readouterr().err
    assert not out.exists()


def test_ground_in_the_window_is_told(site_file: Path) -> None:
    """A stake of 0.5 m: what passes under it meets the plain before the gates end, and nothing above the horizon does."""
    low = SITE.replace("height_m: 100, width_m: 1", "height_m: 0.5, width_m: 1")
    plan = plan_map(Places(parse_site(low)), "L", "tip S")
    assert plan.ground is not None
    assert 0.2 < plan.ground.share < 0.6
    assert -0.7 < plan.ground.up_to_deg < -0.6  # head elevation; the offset is 0.6
    assert plan_map(Places(parse_site(SITE)), "L", "tip S").ground is None


def test_a_hill_hides_a_target_and_it_is_not_chosen(tmp_path: Path, capsys) -> None:
    """A ridge of 200 m before the southern mast: said with its name, and three others are taken."""
    rasterio = pytest.importorskip("rasterio")
    heights = np.full((40, 40), 4.8, dtype=np.float32)
    heights[22:24] = 200.0  # northings 6255900 to 6256000, between the lidar and the southern mast
    with rasterio.open(
        tmp_path / "dem.tif", "w", driver="GTiff", width=40, height=40, count=1, dtype="float32", crs="EPSG:32632",
        transform=rasterio.Affine(100, 0, 446000, 0, -100, 6258150),
    ) as raster:  # fmt: skip
        raster.write(heights, 1)
    text = SITE.replace("ground_height_m: 4.8", "terrain: {file: dem.tif, height_datum: above_sea_level}")
    path = tmp_path / "site.yaml"
    path.write_text(text, encoding="utf-8")
    plan = said(capsys, "cnr-map", "plan", path, "--lidar", "L", "--target", "tip S")
    (planned,) = plan["maps"]
    assert planned["hidden_by"] == ["the terrain"]
    assert planned["ground"]["share"] == 1.0
    assert "tip S" not in plan["best_targets"]["targets"]
