"""What `place` and `share` tell: angles as an instrument is pointed, the number that ranks, names on maps."""

import csv
import re
from pathlib import Path

import numpy as np
import pytest

from geometry.errors import InputError, UnavailableError
from planner.cli import run
from planner.files.yaml_site import load_site
from planner.placement.fan_out import How
from planner.placement.maps import default_grid, of_lidar
from planner.placement.numbers import numbers_of
from planner.placement.ranking import place
from planner.placement.sharing import shared_by
from planner.placement.task import task_of
from planner.plan import Plan

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
KASSEL = EXAMPLES / "kassel" / "site.yaml"


@pytest.fixture(scope="module")
def placed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What `place` writes and prints for Kassel, coarsely."""
    folder = tmp_path_factory.mktemp("kassel")
    assert run(["place", str(KASSEL), "--grid", "20", "--out", str(folder)]) == 0
    return folder


def test_angles_of_every_lidar_and_target_are_those_that_it_is_pointed_with() -> None:
    """`point` is exact, at the head; the axes of the site's middle are up to 0.04 degrees off here."""
    site = load_site(KASSEL)
    plan = Plan(site)
    names = tuple(lidar.name for lidar in site.lidars)
    task = task_of(site, fixed=names[:-1], count=1, targets=tuple(target.name for target in site.targets))
    looks = [of_lidar(task, lidar) for lidar in site.lidars]
    found = numbers_of(task, looks)
    assert len(plan.pointings) == 16
    for row in plan.pointings:
        at = task.targets.index(row.target), names.index(row.lidar)
        assert abs((found.azimuth_deg[at] - row.azimuth_true_deg + 180) % 360 - 180) < 1e-3
        assert found.elevation_deg[at] == pytest.approx(row.elevation_deg, abs=1e-3)
        assert found.range_m[at] == pytest.approx(row.range_m, abs=1e-3)
    middle = np.concatenate([look.elevation_deg for look in looks], axis=1)
    assert 0.02 < np.abs(middle - found.elevation_deg).max() < 0.06


def test_share_and_the_table_of_targets_tell_the_angles_of_point(placed: Path) -> None:
    plan = Plan(load_site(KASSEL))
    exact = {(row.lidar, row.target): row for row in plan.pointings}
    names, found = shared_by(plan.site)
    for item in found:
        for name, elevation_deg in zip(names, item.elevation_deg, strict=True):
            assert elevation_deg == pytest.approx(exact[name, item.target].elevation_deg, abs=1e-3)
    with (placed / "place-targets.csv").open(encoding="utf-8") as file:
        rows = [row for row in csv.DictReader(file) if row["lidar"] == "WS4"]
    assert rows
    for row in rows:
        assert float(row["azimuth_true_deg"]) == pytest.approx(exact["WS4", "P1"].azimuth_true_deg, abs=1e-3)
        assert float(row["elevation_deg"]) == pytest.approx(exact["WS4", "P1"].elevation_deg, abs=1e-3)


@pytest.mark.parametrize("criterion", ["vector", "speed", "direction"])
def test_the_number_that_ranks_is_printed_first(
    criterion: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    options = ["--grid", "20", "--criterion", criterion, "--out", str(tmp_path)]
    assert run(["place", str(KASSEL), *options]) == 0
    printed = capsys.readouterr()
    told = re.findall(r"^\d+\. [^:]*: wind " + criterion, printed.out, re.M)
    said = [float(text) for text in re.findall(r"^\d+\. [^:]*: (?:wind )+\w+ ([\d.]+)", printed.out, re.M)]
    with (tmp_path / "places.csv").open(encoding="utf-8") as file:
        values = [float(row["value"]) for row in csv.DictReader(file) if row["declared"] == "False"]
    assert len(told) == len(said) == len(values) > 0
    assert said == pytest.approx(values, abs=5e-5) and said == sorted(said)
    assert f"Ranked by the first number: the error of the wind {criterion}" in printed.err


def test_a_scheduler_where_nobody_is_fails_even_where_it_is_not_needed(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """One lidar beside one that stands is searched in this process."""
    task = task_of(load_site(KASSEL))
    monkeypatch.setattr("planner.placement.fan_out.CONNECT_S", 0.2)
    with pytest.raises(UnavailableError, match=r"no dask scheduler answers|dask, which is not installed"):
        place(task, default_grid(task, count=5), how=How(scheduler="tcp://127.0.0.1:1"))


def test_a_name_twice_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["share", str(KASSEL), "--targets", "P1,P2,P1"]) == 2
    assert "target P1 came more than once" in capsys.readouterr().err
    with pytest.raises(InputError, match="lidar WS4 came more than once"):
        shared_by(load_site(KASSEL), lidars=["WS4", "WS4"])
    with pytest.raises(InputError, match="target P2 came more than once"):
        task_of(load_site(KASSEL), targets=("P2", "P2"))


def test_no_two_names_on_the_map_cover_each_other() -> None:
    """Ten places within 200 m, on a map of 2 km."""
    from planner.figures.canvas import canvas
    from planner.figures.placement_map import _name

    with canvas(8.5, 8.5) as figure:
        axes = figure.add_subplot()
        axes.set_xlim(-1000, 1000)
        axes.set_ylim(-1000, 1000)
        for number, east in enumerate((0.0, 5.0, 10.0, 120.0)):
            _name(axes, f"L{number} as declared", np.array([east, 0.0]))
        boxes = [text.get_window_extent() for text in axes.texts]
        assert len(boxes) == 4
        assert not any(a.overlaps(b) for i, a in enumerate(boxes) for b in boxes[:i])


def test_the_map_of_the_opening_angle_is_plane_trigonometry() -> None:
    """With the lidar that stands: bearings on the map, folded to 90 degrees, over the 30 that are asked."""
    from planner.figures.placement_map import _opening_slack

    task = task_of(load_site(KASSEL))
    found = place(task, default_grid(task, count=8), most=1)
    (standing,) = task.fixed
    here, mark = np.array(standing.position[:2]), task.targets_m[0, :2]
    ways = np.arctan2(*(mark - found.grid.places_m).T), np.arctan2(*(mark - here))
    sine = np.abs(np.sin(ways[0] - ways[1]))
    expected_deg = np.degrees(np.arcsin(sine)) - task.limits.least_opening_deg
    assert _opening_slack(found)["opening"] == pytest.approx(expected_deg, abs=0.1)
    assert _opening_slack(found)["opening"].min() < 0.0
