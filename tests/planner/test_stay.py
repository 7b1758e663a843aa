"""What a stay yields and what shared lidars give: against the published week, and against sums done by hand."""

import json
from pathlib import Path

import numpy as np
import pytest

from geometry.errors import InputError
from planner.cli import run
from planner.files.yaml_site import load_site, parse_site
from planner.placement.sharing import shared_by
from planner.plan import Plan
from planner.stay import stays

HOVSORE = "examples/hovsore/site.yaml"


def told(capsys, *arguments):
    assert run([*arguments, "--json", "--quiet"]) == 0
    return json.loads(capsys.readouterr().out)


def test_the_week_at_hovsore_has_381_values_in_its_wanted_wind_of_which_148_were_published(hovsore):
    """Pair, 118 to 270° of directions alike, 4 to 25 m/s of a Weibull distribution of 8.9 m/s and 2.75."""
    wanted = 1008 * 152 / 360 * (np.exp(-((4 / 8.9) ** 2.75)) - np.exp(-((25 / 8.9) ** 2.75)))
    dual, sector = stays(hovsore, 7.0, availability=148 / wanted)
    assert (dual.scan, sector.scan) == ("dual", "sector")
    assert dual.found.periods == 1008
    assert dual.values == pytest.approx(148, rel=1e-3)
    assert sector.values < dual.values  # its arc is wider than the probes, and meets more wakes
    assert dual.days_for(148.0) == pytest.approx(7.0, abs=0.05)


def test_stages_take_away_one_after_the_other_and_end_at_the_values(hovsore):
    for item in stays(hovsore, 10.0, availability=0.5):
        left = [item.found.periods, *(stage.kept for stage in item.stages)]
        assert left == sorted(left, reverse=True)
        assert left[1:] == pytest.approx(
            [before * stage.share for before, stage in zip(left, item.stages, strict=False)]
        )
        assert item.stages[-1].kept == pytest.approx(item.values, rel=1e-3)


def test_speeds_alone_leave_what_the_weibull_distribution_says(hovsore):
    stage = stays(hovsore, 1.0)[0].stages[0]
    cut = [np.exp(-((limit / 8.9) ** 2.75)) for limit in (4.0, 25.0)]
    assert stage.kept == pytest.approx(144 * (cut[0] - cut[1]))


def test_a_weak_echo_takes_its_share():
    """At the range where the echo is at its limit half of the rays are valid."""
    site = load_site(HOVSORE)
    weak = {"cnr_db": -24.0, "range_m": 1155.6, "least_cnr_db": -24.0}
    lidars = [item.model_dump(exclude_unset=True) for item in site.lidars]
    changed = site.model_validate(
        {**site.model_dump(exclude_unset=True), "lidars": [{**item, "signal": weak} for item in lidars]}
    )
    strong = next(item for item in stays(Plan(site), 7.0) if item.scan == "sector")
    found = next(item for item in stays(Plan(changed), 7.0) if item.scan == "sector")
    assert found.values / strong.values == pytest.approx(0.5, abs=0.02)
    assert "echo strong enough (signal)" in [stage.name for stage in found.stages]


def test_the_command_tells_counts_bins_and_days(capsys):
    dual, _ = told(capsys, "stay", HOVSORE, "--days", "7", "--availability", "0.39", "--want", "296")
    assert dual["values"] == pytest.approx(np.sum(dual["expected"]))
    assert dual["days_for_wanted"] == pytest.approx(14.0, abs=0.1)
    row = np.sum(dual["expected"], axis=1)
    assert dual["days_per_bin"][0] == pytest.approx(3 * 7 / row[0])
    assert run(["stay", HOVSORE, "--quiet"]) == 0
    assert "ten-minute values of 30 days" in capsys.readouterr().out


def test_a_site_that_measures_nothing_or_knows_no_wind_is_told(capsys):
    assert run(["stay", "examples/scotland/site.yaml"]) == 2
    assert "declare a scan" in capsys.readouterr().err
    assert run(["stay", HOVSORE, "--availability", "1.5"]) == 2
    assert "--availability 1.5 came" in capsys.readouterr().err
    with pytest.raises(InputError, match=r"wind\.weibull"):
        stays(Plan(load_site(HOVSORE).model_copy(update={"wind": None})), 7.0)


STACK = """
name: a stack of heights
crs: EPSG:32632
ground_height_m: 0
lidars:
  - {name: one, position: [447000, 6255000, 2], instrument: windscanner-200s}
  - {name: two, position: [449000, 6255000, 2], instrument: windscanner-200s}
targets: [{name: high, position: [448000, 6256000, 200]}, {name: low, position: [448000, 6256000, 50]}]
"""


def test_lidars_that_stand_share_their_time_among_all_targets(tmp_path, capsys):
    names, found = shared_by(parse_site(STACK))
    assert names == ("one", "two")
    assert [(item.target, item.time_share) for item in found] == [("low", 0.5), ("high", 0.5)]
    level = np.hypot(1000.4, 1000.4)
    assert found[1].elevation_deg[0] == pytest.approx(np.degrees(np.arctan(198 / level)), abs=0.02)
    for item in found:
        assert item.alone_speed_std_mps < item.speed_std_mps <= np.sqrt(2) * item.alone_speed_std_mps
    (tmp_path / "site.yaml").write_text(STACK, encoding="utf-8")
    document = told(capsys, "share", str(tmp_path / "site.yaml"), "--targets", "high")
    assert [item["time_share"] for item in document["targets"]] == [1.0]
    assert run(["share", str(tmp_path / "site.yaml"), "--lidars", "three"]) == 2
    assert "no lidar is called 'three'" in capsys.readouterr().err


def test_one_lidar_shares_by_its_sector_scan():
    names, (only,) = shared_by(load_site(HOVSORE), lidars=["WS_S"])
    assert names == ("WS_S",)
    assert only.speed_std_mps == only.alone_speed_std_mps


def test_no_row_goes_on_beyond_the_wanted_speeds(tmp_path, capsys):
    """Speeds that end at 20 m/s have no bin that does not: it would never fill."""
    text = (
        Path(HOVSORE)
        .read_text(encoding="utf-8")
        .replace("speed_range_mps: [4, 25]", "speed_range_mps: [4, 20]")
    )
    (tmp_path / "site.yaml").write_text(text, encoding="utf-8")
    assert run(["stay", str(tmp_path / "site.yaml"), "--days", "3000"]) == 0
    shown = capsys.readouterr().out
    assert "19–20" in shown
    assert (
        not any(f"{first}–2{last}" in shown for first in (20, 21) for last in (1, 2, 5))
        and "> 3650" not in shown
    )
