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
from planner.handover.windscanner import motion_program, range_gate_table, windscanner_files

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


def run_pmac(text):
    """Walk through a motion program: top speeds and accelerations of every move, and where triggers begin."""
    lines = [line for line in text.split("\r\n") if line and not line.startswith(";")]
    assert lines[:4] == ["CLOSE", "OPEN PROG 1983 CLEAR", "LINEAR", "ABS"]
    assert lines[-3:] == ["ENDWHILE", 'CMD"#3j/"', "CLOSE"]
    rate = float(next(line for line in lines if line.startswith("I322=")).removeprefix("I322="))
    start = lines.index("WHILE(P1001!=-78)")
    here = np.array([float(v) for v in re.findall(r"[XY]\(([-.\d]+)\)", lines[start - 2])])
    moves, triggers, ramp = [], [], None
    for line in lines[start + 1 : -3]:
        if timed := re.fullmatch(r"TA\((\d+)\)TM\((\d+)\)", line):
            ramp, move = (int(part) / 1e3 for part in timed.groups())
            assert move >= ramp
        elif line.startswith("X("):
            to = np.array([float(v) for v in re.findall(r"[XY]\(([-.\d]+)\)", line)])
            moves.append((here, to, np.abs(to - here) / move, np.abs(to - here) / move / ramp, ramp, move))
            here = to
        elif jog := re.fullmatch(r'CMD"#3j\^(\d+)"', line):
            triggers.append(int(jog.group(1)) / rate / 1e3)
    return moves, triggers


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
        ({"gates": {"first_m": 300, "spacing_m": 30, "count": 5000}}, "5000 gates"),
        ({"gates": {"first_m": 300, "spacing_m": 300, "count": 40}}, "10000 m at most"),
        ({"sweep": "forward"}, "back_and_forth"),
    ],
)
def test_halo_limits_are_told_before_anything_is_written(moor, scan, says):
    """The message says what came and what to do."""
    with pytest.raises(InputError, match=re.escape(says)):
        halo_files(halo_plan(moor, **sector(**scan)))


def test_head_elevation_limit(moor):
    """The StreamLine's head does not go under the horizon."""
    lidar = {"name": "A", "position": [500000, 6250000, 300], "instrument": "halo-streamline"}
    scan = {"name": "s", "lidar": "A", "target": "T", "type": "stare", "accumulation_s": 0.4}
    with pytest.raises(InputError, match=r"goes from 0 to 180"):
        halo_files(moor(lidars=[lidar], scans=[scan], pairs=[]).layouts)


# WindScanner


def test_range_gate_table_of_hovsore(hovsore):
    """Pulse mode, farthest gate, FFT size, then a row a ray with 41 gates 25 m apart, the 21st at 1166 m."""
    lines = [line.split("\t") for line in range_gate_table(hovsore.layout["sector"]).split("\r\n")[:-1]]
    assert lines[:3] == [["LidarMode", "Middle"], ["MaxDistance", "1666"], ["FFTSize", "64"]]
    assert [line[0] for line in lines[3:]] == [str(n) for n in range(1, 61)]  # there and back
    assert all(line[1] == "400" and len(line) == 43 and line[22] == "1166" for line in lines[3:])


def test_motion_program_of_hovsore_stays_within_the_head(hovsore):
    """No move is faster than 50 deg/s or 100 deg/s²; triggers last as long as the rays."""
    for layout in hovsore.layouts:
        moves, triggers = run_pmac(motion_program(layout))
        assert max(m[2].max() for m in moves) <= 50 + 1e-9
        assert max(m[3].max() for m in moves) <= 100 + 1e-6
        assert triggers[0] == pytest.approx(layout.scan.count * layout.spec.accumulation_s)


def test_motion_program_sweeps_at_constant_speed_through_the_sector(hovsore):
    """While it measures, the head goes from 149.38 to 209.38 at 5 deg/s: between the ramps."""
    moves, triggers = run_pmac(motion_program(hovsore.layout["sector"]))
    sweep = [move for move in moves if abs(move[1][0] - move[0][0]) > 30]
    assert len(sweep) == len(triggers) == 2
    for (start, end, speed, _, ramp, move), way in zip(sweep, (1, -1), strict=True):
        assert speed[0] == pytest.approx(5, abs=1e-4)
        first = start[0] + way * speed[0] * ramp / 2
        assert first == pytest.approx(149.3769 if way > 0 else 209.3769, abs=2e-4)
        assert abs(end[0] - start[0]) - speed[0] * ramp == pytest.approx(60, abs=1e-3)
        assert move - ramp == pytest.approx(12)


def test_points_program_visits_every_point(moor):
    """A list of targets: each ray at rest, in order, with its own triggers."""
    targets = [{"name": f"T{n}", "position": [500000 + 100 * n, 6251000, 110]} for n in range(4)]
    lidar = {"name": "A", "position": [500000, 6250000, 10], "instrument": "windscanner-200s"}
    scan = {"name": "p", "lidar": "A", "type": "points", "targets": [t["name"] for t in targets]}
    plan = moor(
        lidars=[lidar], targets=targets, pairs=[], scans=[{**scan, "accumulation_s": 0.5, "gates": GATES}]
    )
    moves, triggers = run_pmac(motion_program(plan.layouts[0]))
    assert triggers == [0.5] * 4
    there = np.array([move[1] for move in moves])
    assert np.abs(np.mod(there[:, 0], 360) - plan.layouts[0].scan.azimuth_deg).max() < 1e-4


@pytest.mark.parametrize(
    ("scan", "says"),
    [
        ({"accumulation_s": 0.25}, "0.2 or 0.3"),
        ({"gates": None}, "no gates are declared"),
        ({"gates": {"first_m": 300, "spacing_m": 10, "count": 101}}, "100 at most"),
        ({"gates": {"first_m": 300.5, "spacing_m": 10, "count": 11}}, "whole metres"),
        ({"fft_points": 100}, "64, 128, 256"),
        ({"pulse_ns": 300}, "100 (Short)"),
        ({"sweep": "forward"}, "back_and_forth"),
    ],
)
def test_windscanner_limits_are_told_before_anything_is_written(moor, scan, says):
    """The message says what came and what to do."""
    lidar = {"name": "A", "position": [500000, 6250000, 10], "instrument": "windscanner-200s"}
    spec = {"name": "s", "lidar": "A", "target": "T", "accumulation_s": 0.5, "gates": GATES, **sector(**scan)}
    with pytest.raises(InputError, match=re.escape(says)):
        windscanner_files(moor(lidars=[lidar], scans=[spec], pairs=[]).layouts)


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
