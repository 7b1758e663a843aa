"""Files for instruments, read back by parsers of their own that know the formats and nothing of the writer."""

import csv
import io
import json
import math
import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from geometry.errors import InputError
from planner.handover.export import export
from planner.handover.halo import halo_files, schedule_text, ssm_text
from planner.handover.names import file_stem, file_stems
from planner.handover.scan_table import scan_table, scan_table_csv

SHARED = Path(__file__).resolve().parents[3] / "shared" / "data" / "halo"
GATES = {"first_m": 300, "spacing_m": 30, "count": 40}
HALO = {"instrument": "halo-streamline-xr", "azimuth_offset_deg": 18.4, "elevation_offset_deg": -0.3}


def halo_plan(moor, **scan):
    spec = {"name": "s", "lidar": "A", "target": "T", "accumulation_s": 0.5, "pulse_ns": 350, **scan}
    return moor(
        lidars=[{"name": "A", "position": [500000, 6250000, 10], **HALO}], scans=[spec], pairs=[]
    ).layouts


def sector(**changes):
    return {"type": "sector", "sector_deg": 30, "step_deg": 3, **changes}


# Parsers


def read_ssm(text):
    """Two numbers of seven characters a line."""
    lines = text.split("\r\n")
    assert lines.pop() == ""
    assert all(len(line) == 14 for line in lines)
    return np.array([[float(line[:7]), float(line[7:])] for line in lines])


MOVE = re.compile(r"A\.1=(\d+),S\.1=(\d+),P\.1=(-?\d+)\*A\.2=(\d+),S\.2=(\d+),P\.2=(-?\d+)")


def read_csm(text):
    """Azimuth [deg], elevation [deg], azimuth speed, elevation speed [deg/s], accelerations of each movement."""
    lines = text.split("\r\n")
    assert lines.pop() == ""
    assert all(re.fullmatch(r"W\d+", line) for line in lines[1::2])
    found = []
    for line in lines[::2]:
        a1, s1, p1, a2, s2, p2 = (int(part) for part in MOVE.fullmatch(line).groups())
        per1, per2 = 500000 / 360, 250000 / 360
        found.append(
            (-p1 / per1, -p2 / per2, 10 * s1 / per1, 10 * s2 / per2, 1000 * a1 / per1, 1000 * a2 / per2)
        )
    return np.array(found)


# HALO


def test_step_stare_file_holds_the_head_angles(moor):
    """Azimuth and elevation less the offsets, in the order of measurement, pass after pass, back and forth."""
    layouts = halo_plan(moor, **sector(motion="step", gates=GATES))
    files = halo_files(layouts)
    rays = read_ssm(files["ssm_s.txt"])
    scan = layouts[0].scan
    expected = (scan.azimuth_deg - 18.4) % 360
    assert np.abs(rays[: scan.count, 0] - expected).max() <= 0.0005
    assert np.abs(rays[scan.count : 2 * scan.count, 0] - expected[::-1]).max() <= 0.0005
    assert np.abs(rays[:, 1] - (scan.elevation_deg[0] + 0.3)).max() <= 0.0005
    assert len(rays) == scan.count * math.floor(590 / scan.period_s)


def test_real_step_stare_file_is_written_again_as_it_is():
    """What drove a real lidar comes out of the writer letter by letter, but for the ends of lines."""
    path = SHARED / "S_windycities_24pt_repeat22.txt"
    if not path.exists():
        pytest.skip("the measured sample ../shared/data/halo is not here")
    lines = path.read_text(encoding="ascii").split()
    angles = np.array([[float(line[:7]), float(line[7:])] for line in lines])
    assert ssm_text(angles).split() == lines


@given(st.lists(st.tuples(st.floats(-720, 720), st.floats(-90, 180)), min_size=1, max_size=20))
@settings(derandomize=True, max_examples=40, deadline=None)
def test_step_stare_lines_always_read_back(angles):
    """Every azimuth comes back in [0, 360) and every angle within half a thousandth of a degree."""
    given_deg = np.array(angles)
    read = read_ssm(ssm_text(given_deg))
    assert ((read[:, 0] >= 0) & (read[:, 0] < 360)).all()
    assert np.abs((read[:, 0] - given_deg[:, 0] + 180) % 360 - 180).max() <= 0.00051
    assert np.abs(read[:, 1] - given_deg[:, 1]).max() <= 0.00051


def test_continuous_file_sweeps_the_sector_at_its_speed(moor):
    """To the start at full speed, then end to end at step over accumulation, with the head's accelerations."""
    layouts = halo_plan(moor, **sector(gates=GATES))
    moves = read_csm(halo_files(layouts)["csm_s.txt"])
    middle = float(layouts[0].axis_azimuth_deg) - 18.4
    ends = sorted({(round(a % 360, 2)) for a in moves[:, 0]})
    assert np.abs(np.array(ends) - np.sort([(middle - 15) % 360, (middle + 15) % 360])).max() < 0.01
    assert moves[0, 2] == pytest.approx(36, abs=0.01)
    assert np.abs(moves[1:, 2] - 6).max() < 0.004
    assert np.abs(np.abs(np.diff(moves[:, 0])) - 30).max() < 0.002
    assert moves[0, 4:] == pytest.approx([36, 72], abs=0.5)
    assert np.abs(moves[:, 1] - (layouts[0].axis_elevation_deg + 0.3)).max() < 0.001


def test_full_circle_goes_round_on(moor):
    """Pass after pass a turn farther, never back."""
    layouts = halo_plan(moor, type="ppi", step_deg=6, elevation_head_deg=4)
    moves = read_csm(halo_files(layouts)["csm_s.txt"])
    assert np.abs(np.diff(moves[:, 0]) - 360).max() < 0.001
    assert np.abs(moves[:, 1] - 4).max() < 0.001


def test_vertical_slice_goes_over_the_top(moor):
    """An RHI from 20 to 160 degrees above the horizon is one movement of the elevation axis."""
    layouts = halo_plan(moor, type="rhi", elevation_from_deg=20, elevation_to_deg=160, step_deg=4)
    moves = read_csm(halo_files(layouts)["csm_s.txt"])
    assert np.ptp(moves[:, 0]) < 0.002
    assert sorted({round(e, 1) for e in moves[:, 1]}) == [20.3, 160.3]
    assert moves[1, 3] == pytest.approx(8, abs=0.01)


def test_schedule_fills_the_day_in_turns(moor):
    """Tab-separated HHMMSS, name, thousands of pulses, C or S, focus; the files that it names are there."""
    files = halo_files(halo_plan(moor, **sector(motion="step", gates=GATES)))
    lines = [line.split("\t") for line in files["schedule.dss"].split("\r\n")[:-1]]
    assert len(lines) == 144
    assert [line[0] for line in lines[:3]] == ["000000", "001000", "002000"]
    assert all(line[1:] == ["ssm_s", "5", "S", "7"] for line in lines)  # 0.5 s at 10 kHz
    assert {f"{line[1]}.txt" for line in lines} <= set(files)


def test_schedule_never_runs_past_midnight():
    """A turn that does not fit before midnight is left out."""
    starts = schedule_text([("a", 5, "S", 50_000)]).split("\r\n")[:-1]
    assert [line[:6] for line in starts] == ["000000"]


@pytest.mark.parametrize(
    ("scan", "says"),
    [
        ({"accumulation_s": 0.55}, "0.5 or 0.6"),
        ({"pulse_ns": 200}, "no pulse of 200"),
        ({"step_deg": 30}, "60 °/s"),
        ({"gates": {"first_m": 300, "spacing_m": 300, "count": 40}}, "10000 m at most"),
        ({"sweep": "forward"}, "back_and_forth"),
    ],
)
def test_halo_limits_are_told_before_anything_is_written(moor, scan, says):
    """The message says what came and what to do."""
    with pytest.raises(InputError, match=re.escape(says)):
        halo_files(halo_plan(moor, **sector(**scan)))


def test_gates_are_limited_by_the_instrument_that_states_how_many_it_has(moor):
    """No maker's number is known for the StreamLine: 320 gates pass; one that states 100 is held to them."""
    gates = {"first_m": 300, "spacing_m": 30, "count": 320}
    assert halo_files(halo_plan(moor, **sector(gates=gates)))
    own = {
        "name": "halo of ours",
        "max_gates": 100,
        "pulses": [{"pulse_ns": 350, "pulse_repetition_hz": 10000}],
    }
    lidar = {"name": "A", "position": [500000, 6250000, 10], "instrument": own}
    scan = {
        "name": "s",
        "lidar": "A",
        "target": "T",
        "type": "stare",
        "accumulation_s": 0.5,
        "pulse_ns": 350,
        "gates": gates,
    }
    with pytest.raises(InputError, match="320 gates came; halo of ours takes 100 at most"):
        halo_files(moor(lidars=[lidar], scans=[scan], pairs=[]).layouts)


def test_head_elevation_limit(moor):
    """The StreamLine's head does not go under the horizon."""
    lidar = {"name": "A", "position": [500000, 6250000, 300], "instrument": "halo-streamline"}
    scan = {"name": "s", "lidar": "A", "target": "T", "type": "stare", "accumulation_s": 0.4}
    with pytest.raises(InputError, match=r"goes from 0 to 180"):
        halo_files(moor(lidars=[lidar], scans=[scan], pairs=[]).layouts)


# Scan table


def test_scan_table_of_hovsore(hovsore):
    """One line a sweep: Sterenn's 60° at 5 °/s around the published head azimuths 150 to 208 (middles of rays)."""
    rows = list(csv.DictReader(io.StringIO(scan_table_csv(hovsore))))
    assert [row["scan"] for row in rows] == ["sector", "stare K", "stare W"]
    assert float(rows[0]["azimuth_from_deg"]) == pytest.approx(149, abs=0.5)
    assert float(rows[0]["azimuth_to_deg"]) == pytest.approx(209, abs=0.5)
    assert float(rows[0]["elevation_from_deg"]) == pytest.approx(5.36, abs=0.05)
    assert [rows[0][key] for key in ("speed_deg_per_s", "rays", "accumulation_ms", "gates")] == [
        "5",
        "30",
        "400",
        "41",
    ]


def test_scan_table_as_json_has_every_ray(hovsore):
    """The rays of the JSON lie on the line of its sweep."""
    entry = json.loads(json.dumps(scan_table(hovsore), allow_nan=False))[0]
    azimuths = [ray["azimuth_deg"] for ray in entry["rays"]]
    assert len(azimuths) == entry["sweeps"][0]["rays"] == 30
    assert azimuths[0] == pytest.approx(entry["sweeps"][0]["azimuth_from_deg"] + 1, abs=2e-4)


# Names and folders


def test_names_cannot_leave_the_folder(moor, tmp_path):
    """A lidar called ../../x writes inside DIR only."""
    lidar = {"name": "../../../x", "position": [500000, 6250000, 10], "instrument": "windscanner-200s"}
    scan = {
        "name": "/etc/s",
        "lidar": "../../../x",
        "target": "T",
        "type": "stare",
        "accumulation_s": 0.5,
        "gates": GATES,
    }
    files = export(moor(lidars=[lidar], scans=[scan], pairs=[]), tmp_path / "out", ("windscanner",))
    assert [path.relative_to(tmp_path / "out").as_posix() for path in files] == [
        "windscanner/x/etc_s_motion.pmc",
        "windscanner/x/etc_s_range_gates.txt",
    ]
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


@given(st.lists(st.text(max_size=60), unique=True, max_size=8))
@settings(derandomize=True, max_examples=60, deadline=None)
def test_file_stems_are_safe_and_different(names):
    """Only letters, digits, hyphen and underscore; different also where case does not count."""
    stems = file_stems(names)
    assert all(re.fullmatch(r"[A-Za-z0-9_-]{1,52}", stem) for stem in stems.values())
    assert len({stem.lower() for stem in stems.values()}) == len(names)
    assert file_stem("CON") != "CON"


def test_one_bad_scan_leaves_no_file(moor, tmp_path):
    """Whole files or none."""
    lidar = {"name": "A", "position": [500000, 6250000, 10], "instrument": "windscanner-200s"}
    good = {"name": "a", "lidar": "A", "target": "T", "type": "stare", "accumulation_s": 0.5, "gates": GATES}
    plan = moor(lidars=[lidar], scans=[good, {**good, "name": "b", "accumulation_s": 0.25}], pairs=[])
    with pytest.raises(InputError, match="scan 'b'"):
        export(plan, tmp_path / "out", ("scan-table", "windscanner"))
    assert list(tmp_path.iterdir()) == []


def test_no_lidar_of_that_make(moor, tmp_path):
    """The message names the instruments that there are."""
    with pytest.raises(InputError, match=r"no lidar with a scan is a halo: A \(test lidar\)"):
        export(moor(), tmp_path / "out", ("halo",))
