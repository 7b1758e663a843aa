"""Work handed out: the same answers here, in processes and on a cluster, whoever dies in the middle."""

import os
import signal
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from geometry.errors import UnavailableError
from planner.files.yaml_site import parse_site
from planner.placement import fan_out, search
from planner.placement.fan_out import How, run
from planner.placement.maps import Grid, look, standing_m, table_of
from planner.placement.ranking import place
from planner.placement.task import task_of

GUSTS = (
    "wind: {speeds_mps: [10], directions_deg: [[200, 260]], turbulence: {intensity: 0.1, length_m: 170}}\n"
)

SITE = """
name: two points
crs: EPSG:32632
ground_height_m: 10
lidars:
  - {name: one, position: [447000, 6255000, 12], instrument: windscanner-200s}
  - {name: two, position: [449000, 6255000, 12], instrument: windscanner-200s}
targets:
  - {name: a, position: [448000, 6256000, 110]}
  - {name: b, position: [448300, 6256400, 90]}
"""


def pair_tables(count=30):
    task = task_of(parse_site(SITE), count=2)
    grid = Grid(np.linspace(446500, 449500, count), np.linspace(6257500, 6254500, count))
    seen = look(task, standing_m(task, grid.places_m))
    kept = np.flatnonzero(seen.allowed.all(axis=0))
    return search.PairTables(table_of(task, seen).take(kept), np.zeros(kept.size), 0.25, "worst")


def one_row_batches(tables):
    rows = -(-tables.table.candidates // search.TILE)
    return [(row,) for row in range(rows)]


def die_once(shared, batch):
    """Square a number; the first worker that gets the third batch is killed."""
    folder, _ = shared
    marker = Path(folder) / "died"
    if batch == (3,) and not marker.exists():
        marker.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return batch[0] ** 2


def fails_after_two(shared, batch):
    if batch[0] >= 2 and not shared:
        raise RuntimeError("the machine went down")
    return batch[0] + 1


def assert_same(first, second):
    for one, other in zip(first, second, strict=True):
        assert all(np.array_equal(a, b) for a, b in zip(one, other, strict=True))


def test_processes_give_the_same_as_one():
    tables = pair_tables()
    batches = one_row_batches(tables)
    here = run(search.pair_batch, tables, batches)
    there = run(search.pair_batch, tables, batches, how=How(processes=2), expected_s=100.0)
    assert_same(here, there)


def test_a_killed_process_loses_nothing(tmp_path):
    found = run(
        die_once, (str(tmp_path), 0), [(i,) for i in range(8)], how=How(processes=2), expected_s=100.0
    )
    assert (tmp_path / "died").exists()
    assert found == [i**2 for i in range(8)]


def test_how_pairs_are_batched_changes_nothing():
    tables = pair_tables()
    whole = search.pair_batch(tables, (0, 1, 2, 3))
    value, partner = np.full_like(whole[0], np.inf), np.full_like(whole[1], -1)
    for found, index in run(search.pair_batch, tables, one_row_batches(tables)):
        search._keep_better(value, partner, found, index)
    assert np.array_equal(whole[0], value) and np.array_equal(whole[1], partner)


def test_a_run_that_breaks_off_goes_on_where_it_was(tmp_path, monkeypatch):
    monkeypatch.setattr(fan_out, "SAVE_EVERY", 1)
    monkeypatch.setattr(fan_out, "_key", lambda *_: "same")
    how, shares = How(checkpoint=tmp_path / "done", processes=1), []
    batches = [(i,) for i in range(4)]
    with pytest.raises(RuntimeError):
        run(fails_after_two, False, batches, how=how)
    found = run(fails_after_two, True, batches, how=how._replace(progress=shares.append))
    assert found == [1, 2, 3, 4]
    assert shares == [0.75, 1.0]  # two were done before


def test_the_progress_of_other_work_is_not_taken(tmp_path):
    how = How(checkpoint=tmp_path / "done", processes=1)
    assert run(fails_after_two, 1, [(0,), (1,)], how=how) == [1, 2]
    assert run(fails_after_two, 2, [(1,), (0,)], how=how) == [2, 1]


def test_a_scheduler_that_does_not_answer_is_said(monkeypatch):
    pytest.importorskip("distributed")
    monkeypatch.setattr(fan_out, "CONNECT_S", 0.5)
    with pytest.raises(UnavailableError, match="no dask scheduler answers"):
        run(fails_after_two, 1, [(0,)], how=How(scheduler="tcp://127.0.0.1:9"))


@pytest.mark.filterwarnings("ignore")
def test_a_cluster_whose_worker_is_killed_gives_the_same_ranking():
    """A worker dies while batches are worked on; the other takes them over."""
    distributed = pytest.importorskip("distributed")
    task = task_of(parse_site(SITE), count=3)  # pairs, and sets grown from them
    grid = Grid(np.linspace(446500, 449500, 17), np.linspace(6257500, 6254500, 17))
    here = place(task, grid, how=How(processes=1), most=2)
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None, silence_logs=50
    ) as cluster:
        victim = next(iter(cluster.workers.values())).process.process
        killed = []

        def kill(_share):
            if not killed:
                os.kill(victim.pid, signal.SIGKILL)
                killed.append(time.time())

        tables = pair_tables(40)
        batches = one_row_batches(tables)
        there = run(
            search.pair_batch, tables, batches, how=How(scheduler=cluster.scheduler_address, progress=kill)
        )
        assert killed
        assert_same(run(search.pair_batch, tables, batches), there)
        ranked = place(replace(task), grid, how=How(scheduler=cluster.scheduler_address), most=2)
    assert [item.positions_m.tolist() for item in ranked.ranked] == [
        item.positions_m.tolist() for item in here.ranked
    ]
    assert [item.text for item in ranked.ranked] == [item.text for item in here.ranked]


def set_tables(count=20):
    """Sets of three, from every tenth place."""
    task = task_of(parse_site(SITE), count=3)
    grid = Grid(np.linspace(446500, 449500, count), np.linspace(6257500, 6254500, count))
    table = table_of(task, look(task, standing_m(task, grid.places_m)))
    starts = np.arange(0, table.candidates, 40)[:, None]
    return search.SetTables(table, (), starts, 3, np.zeros(table.candidates), 30.0, "worst")


def test_sets_are_the_same_from_processes_and_go_on_after_a_break(tmp_path, monkeypatch):
    tables = set_tables()
    batches = [(number,) for number in range(len(tables.starts))]
    here = run(search.set_batch, tables, batches)
    assert run(search.set_batch, tables, batches, how=How(processes=2), expected_s=100.0) == here
    monkeypatch.setattr(search, "LEAST_BATCH_S", 1e-6)
    how, shares = How(checkpoint=tmp_path / "done", processes=1), []
    whole = search.best_sets(tables, how=how)
    again = search.best_sets(tables, how=how._replace(progress=shares.append))
    assert not shares  # nothing was left to do
    assert np.array_equal(whole.members, again.members) and np.array_equal(whole.value, again.value)


def test_the_steps_of_a_search_share_one_progress_file(tmp_path):
    """Pairs first, then sets: the second does not drive out what the first has done."""
    how, shares = How(checkpoint=tmp_path / "done", processes=1), []
    for work in (1, 2):
        run(fails_after_two, work, [(0,), (1,)], how=how)
    run(fails_after_two, 1, [(0,), (1,)], how=how._replace(progress=shares.append))
    assert not shares


def test_a_search_that_is_resumed_gives_the_same_ranking(tmp_path):
    task = replace(task_of(parse_site(SITE + GUSTS), fixed=("one",)))
    grid = Grid(np.linspace(446500, 449500, 9), np.linspace(6257500, 6254500, 9))
    how = How(checkpoint=tmp_path / "done", processes=1)
    first, second = (place(task, grid, how=how, most=2, tier="turbulent") for _ in range(2))
    other = place(task, grid, how=How(processes=2), most=2, tier="turbulent")
    assert [item.text for item in first.ranked] == [item.text for item in second.ranked]
    assert [item.text for item in first.ranked] == [item.text for item in other.ranked]
