"""The search for places against brute force through the retrieval core, and what it says when nothing is allowed."""

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest

from geometry.errors import InputError
from planner.files.yaml_site import load_site, parse_site
from planner.placement import search
from planner.placement.areas import area_slack_m
from planner.placement.maps import Grid, default_grid, look, of_lidar, standing_m, table_of
from planner.placement.numbers import numbers_of, turbulent_numbers
from planner.placement.ranking import place
from planner.placement.task import task_of
from reconstruct.beam_table import beam_table, pair_variance, set_variance
from reconstruct.climate import Climate
from reconstruct.lidar_map import pair_map
from reconstruct.sector_map import sector_variance
from reconstruct.uncertainty import ErrorSources
from reconstruct.wind import WindState

SITE = """
name: three points
crs: EPSG:32632
ground_height_m: 10
lidars:
  - {name: one, position: [447000, 6255000, 12], instrument: windscanner-200s}
  - {name: two, position: [449000, 6255000, 12], instrument: windscanner-200s}
targets:
  - {name: a, position: [448000, 6256000, 110]}
  - {name: b, position: [448300, 6256400, 90]}
  - {name: c, position: [447700, 6255700, 130]}
wind: {weibull: {scale_mps: 9, shape: 2}, directions_deg: [[200, 300]]}
"""

SOURCES = ErrorSources(
    radial_speed_mps=0.1,
    azimuth_deg=0.05,
    elevation_deg=0.05,
    range_m=5.0,
    heading_deg=0.05,
    levelling_deg=0.03,
)


def small_grid(task, count=9):
    east, north = task.targets_m[:, :2].mean(axis=0)
    return Grid(np.linspace(east - 1500, east + 1500, count), np.linspace(north + 1500, north - 1500, count))


def judged(task, heads_m):
    """Value of a set of heads through the retrieval core."""
    return valued(task, [look(task, head[None]) for head in heads_m])


def valued(task, looks):
    return numbers_of(task, [*(of_lidar(task, lidar) for lidar in task.fixed), *looks]).value(
        task.criterion, task.aggregate
    )


@pytest.mark.parametrize("criterion", ["vector", "speed", "direction"])
@pytest.mark.parametrize("vertical_mps", [0.0, 0.4])
def test_the_table_of_beams_is_the_map_of_two_lidars(criterion, vertical_mps):
    """Averaged over the climate state by state, `pair_map` gives what the table gives at once."""
    rng = np.random.default_rng(1)
    heads, target = rng.uniform(-2000, 2000, (5, 3)) * [1, 1, 0.002], np.array([100.0, 50.0, 120.0])
    climate = Climate(
        np.array([5.0, 8.0, 12.0, 6.0]),
        np.array([200.0, 200.0, 280.0, 280.0]),
        np.array([1.0, 2.0, 1.0, 3.0]),
    )
    like = WindState(
        speed_mps=1.0, from_deg=0.0, shear_exponent=0.14, height_m=120.0, vertical_mps=vertical_mps
    )
    table = beam_table(heads, [target], [climate], [like], SOURCES, criterion=criterion)
    found = pair_variance(table, table, 0)[0]
    for first, second in combinations(range(5), 2):
        each = []
        for state in climate.states(like):
            error = pair_map(heads[[first, second]], *target, state, SOURCES)
            speed, turn = float(error.speed_std_mps) ** 2, float(error.direction_std_deg) ** 2
            side = turn * np.radians(state.speed_mps) ** 2
            each.append({"speed": speed, "direction": turn, "vector": speed + side}[criterion])
        assert found[first, second] == pytest.approx(climate.mean(each), rel=1e-9)
        pair = set_variance([table.take([first]), table.take([second])])
        assert float(pair[0, 0]) == pytest.approx(climate.mean(each), rel=1e-9)


def test_a_lidar_alone_is_judged_like_its_sector_scan_in_the_core():
    site = load_site("examples/hovsore/site.yaml")
    task = replace(task_of(site, count=1), criterion="speed")
    seen = of_lidar(task, site.lidar("WS_S"))
    fast = sector_variance(
        seen.local_m,
        task.local_targets_m[0],
        task.offsets_deg,
        task.climates[0],
        task.states[0],
        task.sources,
        criterion="speed",
    )
    assert float(fast[0]) ** 0.5 == pytest.approx(float(numbers_of(task, [seen]).speed_std_mps[0]), rel=1e-3)


@pytest.mark.parametrize("aggregate", ["worst", "mean"])
def test_the_best_pair_is_the_best_of_all_pairs(aggregate):
    task = replace(task_of(parse_site(SITE), count=2), aggregate=aggregate)
    grid = small_grid(task, 4)
    seen = look(task, standing_m(task, grid.places_m))
    kept = np.flatnonzero(seen.allowed.all(axis=0))
    looks, best = {index: look(task, seen.positions_m[[index]]) for index in kept}, np.inf
    for pair in combinations(kept, 2):
        angles = seen.azimuth_deg[:, pair[0]] - seen.azimuth_deg[:, pair[1]]
        if np.all(np.abs(np.sin(np.radians(angles))) >= 0.5):
            best = min(best, valued(task, [looks[index] for index in pair]))
    table = table_of(task, seen).take(kept)
    tables = search.PairTables(table, np.zeros(kept.size), 0.25, task.aggregate)
    value, partner = search.best_partners(tables)
    assert value.min() == pytest.approx(best, rel=1e-6)
    assert value[partner[int(np.argmin(value))]] == value.min()
    assert place(task, grid, most=1).ranked[0].value <= best * (1 + 1e-9)


def test_the_best_three_are_the_best_of_all_triples():
    task = task_of(parse_site(SITE), count=3)
    grid = small_grid(task, 5)
    seen = look(task, standing_m(task, grid.places_m))
    table = table_of(task, seen)
    kept = np.flatnonzero(seen.allowed.all(axis=0))
    best = np.inf
    for first, second in combinations(kept, 2):
        values = search.added_value(
            [table.take([first]), table.take([second])], table, least_opening_deg=30.0, aggregate="worst"
        )
        best = min(best, float(values.min()))
    found = place(task, grid, most=2)
    heads = found.ranked[0].positions_m
    assert found.ranked[0].value <= best * (1 + 1e-9)
    assert judged(task, heads) == pytest.approx(found.ranked[0].value, rel=1e-6)


def test_exchange_reaches_the_best_set_of_the_grid():
    task = task_of(parse_site(SITE), count=3)
    seen = look(task, standing_m(task, small_grid(task, 5).places_m))
    table = table_of(task, seen)
    options = {"least_opening_deg": 30.0, "aggregate": "worst"}
    every = [
        float(search.added_value([table.take([i]), table.take([j])], table, **options).min())
        for i, j in combinations(range(table.candidates), 2)
    ]
    starts = np.array(list(combinations(range(0, table.candidates, 5), 2)))
    tables = search.SetTables(table, (), starts, 3, np.zeros(table.candidates), 30.0, "worst")
    found = search.best_sets(tables)
    assert found.value[0] <= min(every) * 1.01


def test_the_second_lidar_at_hovsore_is_better_than_the_real_one_and_says_why():
    task = task_of(load_site("examples/hovsore/site.yaml"))
    assert [lidar.name for lidar in task.fixed] == ["WS_K"] and task.pattern.name == "WS_W"
    found = place(task, default_grid(task, count=30))
    assert found.declared is not None
    best = found.ranked[0]
    assert best.value <= found.declared.value
    assert best.numbers.speed_std_mps[0] <= found.declared.numbers.speed_std_mps[0]
    assert found.declared.numbers.opening_deg[0] == pytest.approx(63.0, abs=0.5)
    assert "instead of 63°" in found.why
    assert [item.rank for item in found.ranked] == list(range(1, len(found.ranked) + 1))
    assert sorted(item.value for item in found.ranked) == [item.value for item in found.ranked]


def test_the_same_task_gives_the_same_places():
    task = task_of(parse_site(SITE), count=2)
    first, second = (place(task, small_grid(task), most=2) for _ in range(2))
    assert [item.positions_m.tolist() for item in first.ranked] == [
        item.positions_m.tolist() for item in second.ranked
    ]


def test_the_range_that_is_too_short_is_named_with_what_it_must_give():
    task = task_of(parse_site(SITE), count=2)
    short = replace(task, limits=task.limits._replace(most_range_m=200.0, most_elevation_deg=60.0))
    with pytest.raises(InputError, match=r"range-max .* must give (\d+) m .*--max-range") as caught:
        place(short, small_grid(short))
    seen = look(short, standing_m(short, small_grid(short).places_m))
    others = np.logical_and.reduce(
        [slack >= 0 for name, slack in seen.slack.items() if name != "range-max"]
    ).all(axis=0)
    needed = -seen.slack["range-max"].min(axis=0)[others].max()
    assert f"{needed:.3g} m" in str(caught.value)


def test_beams_that_cannot_cross_steeply_enough_are_said():
    task = task_of(parse_site(SITE), count=2)
    strict = replace(task, limits=task.limits._replace(least_opening_deg=89.9))
    with pytest.raises(InputError, match=r"cross at 89\.9° or more at every target: it must give ") as caught:
        place(strict, small_grid(strict))
    reached = float(str(caught.value).split("some cross at ")[1].split("°")[0])
    eased = replace(task, limits=task.limits._replace(least_opening_deg=reached))
    assert place(eased, small_grid(eased), most=1).ranked
    for extra, allowed in (
        (0.0, True),
        (1.0, False),
    ):  # no pair of the grid does better: by trial of all of them
        azimuth = np.radians(look(task, standing_m(task, small_grid(task).places_m)).azimuth_deg)
        sines = np.abs(np.sin(azimuth[:, :, None] - azimuth[:, None, :])).min(axis=0)
        assert (sines.max() >= np.sin(np.radians(reached + extra))) == allowed


def test_one_lidar_without_a_sector_scan_cannot_measure_alone():
    with pytest.raises(InputError, match="scan of type sector"):
        task_of(parse_site(SITE), count=1)


def test_forbidden_ground_is_kept_free_and_distance_to_its_edge_counts():
    areas = "areas: {forbidden: [{polygon: [[447000, 6255000], [448000, 6255000], [448000, 6256000], [447000, 6256000]]}]}"
    site = parse_site(SITE + areas)
    slack = area_slack_m(site, np.array([[447500.0, 6255400.0], [448100.0, 6255500.0]]))
    assert slack.tolist() == pytest.approx([-400.0, 100.0])
    task = task_of(site, count=2)
    for item in place(task, small_grid(task), most=2).ranked:
        assert np.all(area_slack_m(site, item.positions_m) >= 0)


def test_allowed_ground_comes_from_a_file_in_another_crs(tmp_path):
    geopandas = pytest.importorskip("geopandas")
    shapely = pytest.importorskip("shapely")
    square = shapely.box(447000, 6255000, 448000, 6256000)
    geopandas.GeoDataFrame(geometry=[square], crs="EPSG:32632").to_crs("EPSG:25833").to_file(
        tmp_path / "land.gpkg"
    )
    site = parse_site(SITE + "areas: {allowed: [land.gpkg]}", folder=tmp_path)
    slack = area_slack_m(site, np.array([[447500.0, 6255400.0], [448100.0, 6255500.0]]))
    assert slack == pytest.approx([400.0, -100.0], abs=0.5)


def test_a_soft_cost_moves_the_lidar_towards_what_is_wanted_near():
    task = task_of(parse_site(SITE), fixed=("one",))
    grid = small_grid(task)
    corner = np.array([449500.0, 6257500.0])
    free = place(task, grid, most=1).ranked[0].positions_m[0, :2]
    near = (
        place(task, grid, cost=lambda spots: 1e-3 * np.hypot(*(spots - corner).T))
        .ranked[0]
        .positions_m[0, :2]
    )
    assert np.hypot(*(near - corner)) <= np.hypot(*(free - corner))


GUSTY = SITE.replace("directions_deg", "turbulence: {intensity: 0.1, length_m: 170}, directions_deg").replace(
    "  - {name: c, position: [447700, 6255700, 130]}\n", ""
)


def test_with_turbulence_the_search_ranks_and_moves_by_it():
    """No place around the best one, judged by the turbulent tier in the core, is better by more than a per mille."""
    task = task_of(parse_site(GUSTY), fixed=("one",))
    grid = small_grid(task, 13)
    linear, gusty = (place(task, grid, most=3, tier=tier) for tier in ("linear", "turbulent"))
    values = [item.value for item in gusty.ranked]
    assert values == sorted(values)
    best = gusty.ranked[0]
    assert best.turbulent is not None and "with turbulence" in best.text

    def with_turbulence(east_north):
        looks = [of_lidar(task, task.fixed[0]), look(task, standing_m(task, east_north))]
        allowed = looks[1].allowed.all()
        return turbulent_numbers(task, looks).value("vector", "worst") if allowed else np.inf

    here = best.positions_m[0, :2]
    assert best.value == pytest.approx(with_turbulence(here), rel=1e-9)
    assert best.value <= with_turbulence(linear.ranked[0].positions_m[0, :2]) * (1 + 1e-9)
    around = [with_turbulence(here + step) for step in 60.0 * np.array([[1, 0], [-1, 0], [0, 1], [0, -1]])]
    assert best.value <= min(around) * 1.001


def test_turbulence_that_is_not_given_is_asked_for():
    task = task_of(parse_site(SITE), fixed=("one",))
    with pytest.raises(InputError, match=r"wind\.turbulence"):
        place(task, small_grid(task), tier="turbulent")
