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
from planner.cli import run
from planner.files.yaml_site import load_site
from planner.handover.export import export, with_gates
from planner.handover.halo import halo_files, schedule_text, ssm_text
from planner.handover.names import file_stem, file_stems
from planner.handover.scan_table import scan_table, scan_table_csv
from planner.handover.windscanner import motion_program, range_gate_table, windscanner_files
from planner.plan import Plan
from planner.scan_plans import GatePlan

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


class Replay:
    """A motion program played through: where the head is at every moment, and when the laser is triggered.

    What is known of the controller's language: a move of TM + TA milliseconds rises to its speed in TA and falls in TA;
    lines are read on while it runs, but not past a DWELL, and a timer (I5111) is waited for; an angle is absolute.
    """

    def __init__(self, text):
        lines = [line for line in text.split("\r\n") if line and not line.startswith(";")]
        self.now_ms, self.moves, self.triggers = 0.0, [], []
        self.end_ms = 0.0
        self.rate_per_ms = float(next(line for line in lines if line.startswith("I322="))[5:])
        start = lines.index("WHILE(P1001!=-78)")
        self.here = self.angles(lines[start - 2])
        self.begin = self.here
        timer_ms = 0.0
        for line in lines[start + 1 : -3]:
            if timed := re.fullmatch(r"TA\((\d+)\)TM\((\d+)\)", line):
                self.ramp_ms, self.move_ms = (float(part) for part in timed.groups())
            elif line.startswith("X("):
                self.move(self.angles(line))
            elif dwell := re.fullmatch(r"DWELL([\d.]+)", line):
                self.now_ms = max(self.now_ms, self.end_ms) + float(dwell.group(1))
            elif waited := re.fullmatch(r"I5111=([\d.]+)\*8388608/I10", line):
                timer_ms = float(waited.group(1))
            elif line == "WHILE(I5111>0)":
                self.now_ms += timer_ms
            elif jog := re.fullmatch(r'CMD"#3j\^(\d+)"', line):
                self.triggers.append((self.now_ms, int(jog.group(1)) / self.rate_per_ms))
            else:
                assert line == "ENDWHILE"

    @staticmethod
    def angles(line):
        return np.array(
            [float(value) for value in re.fullmatch(r"X\(([-.\d]+)\)Y\(([-.\d]+)\)", line).groups()]
        )

    def move(self, to):
        start = max(self.now_ms, self.end_ms)
        self.moves.append((start, self.ramp_ms, self.move_ms, self.here, to))
        self.here, self.end_ms = to, start + self.ramp_ms + self.move_ms

    def at(self, time_ms):
        """Head angles at a moment: the way of a trapezium of speed."""
        place = self.begin
        for start, ramp, move, before, to in self.moves:
            t = min(max(time_ms - start, 0.0), ramp + move)
            if time_ms <= start:
                break
            rise = min(t, ramp) ** 2 / (2 * ramp)
            level = min(max(t - ramp, 0.0), move - ramp)
            late = max(t - move, 0.0)
            place = before + (to - before) * (rise + level + late - late**2 / (2 * ramp)) / move
        return place


def direction(angles_deg):
    """East, north, up of head azimuth and elevation, by hand."""
    azimuth, elevation = np.deg2rad(angles_deg).T
    level = np.cos(elevation)
    return np.stack([np.sin(azimuth) * level, np.cos(azimuth) * level, np.sin(elevation)], axis=1)


def require_replayed(layout):
    """Every ray of a round, at the middle of its triggers, is where the plan has it, there and back."""
    played = Replay(motion_program(layout))
    scan, acc_ms = layout.scan, 1e3 * layout.spec.accumulation_s
    azimuth, elevation = layout.mounting.to_head(scan.azimuth_deg, scan.elevation_deg)
    planned = np.stack([np.asarray(azimuth) % 360, elevation], axis=1)
    if scan.back_and_forth and scan.count > 1:
        planned = np.concatenate([planned, planned[::-1]])
    middles = [
        start + (number + 0.5) * acc_ms
        for start, length in played.triggers
        for number in range(round(length / acc_ms))
    ]
    assert len(middles) == len(planned)
    found = np.array([played.at(middle) for middle in middles])
    apart = np.linalg.norm(
        direction(found) - direction(planned), axis=1
    )  # over the top an angle has two names
    assert np.rad2deg(apart).max() < 0.001
    for start, length in played.triggers:  # at rest, or at an even speed, from the first pulse to the last
        inside = np.array([played.at(start + share * length) for share in np.linspace(0, 1, 9)])
        assert np.abs(np.diff(inside, 2, axis=0)).max() < 1e-3


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


def test_replayed_programs_are_where_the_plan_has_them_at_every_ray(hovsore, moor):
    """The reference sector and stares, an RHI over the top, a raster in steps and a full circle, played through."""
    for layout in hovsore.layouts:
        require_replayed(layout)
    lidar = {
        "name": "A",
        "position": [500000, 6250000, 10],
        "instrument": "windscanner-200s",
        "azimuth_offset_deg": 12.3,
    }
    spec = {"lidar": "A", "target": "T", "accumulation_s": 0.2, "gates": GATES}
    scans = [
        {
            **spec,
            "name": "slice",
            "type": "rhi",
            "elevation_from_deg": 20,
            "elevation_to_deg": 160,
            "step_deg": 4,
        },
        {**spec, "name": "raster", "type": "raster", "width_deg": 2, "height_deg": 1, "step_deg": 0.5},
        {
            **spec,
            "name": "circle",
            "type": "ppi",
            "step_deg": 6,
            "elevation_head_deg": 4,
            "sweep": "back_and_forth",
        },
        {**spec, "name": "steps", **sector(motion="step")},
    ]
    for layout in moor(lidars=[lidar], scans=scans, pairs=[]).layouts:
        require_replayed(layout)


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
    require_replayed(plan.layouts[0])


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


def test_files_of_kassel_read_back_with_the_gates_that_the_command_gives(tmp_path, capsys):
    """`export --gates` fills in what the example cannot say: every program plays through, every table has its gates."""
    site = Path(__file__).resolve().parents[2] / "examples" / "kassel" / "site.yaml"
    out = tmp_path / "out"
    assert (
        run(
            [
                "export",
                str(site),
                "--as",
                "windscanner",
                "--gates",
                "200,50,100",
                "--out",
                str(out),
                "--json",
                "-q",
            ]
        )
        == 0
    )
    files = [Path(name) for name in json.loads(capsys.readouterr().out)["files"]]
    assert len(files) == 16
    for path in files:
        if path.name.endswith("_range_gates.txt"):
            lines = [line.split("\t") for line in path.read_text(encoding="utf-8").splitlines()]
            assert lines[:3] == [["LidarMode", "Long"], ["MaxDistance", "5150"], ["FFTSize", "128"]]
            assert lines[3] == ["1", "2000", *(str(200 + 50 * gate) for gate in range(100))]
    plan = Plan(with_gates(load_site(site), GatePlan(first_m=200.0, spacing_m=50.0, count=100)))
    for layout in plan.layouts:
        require_replayed(layout)
    assert run(["export", str(site), "--gates", "200,50", "--out", str(tmp_path / "no")]) == 2
    assert "three positive numbers" in capsys.readouterr().err


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
