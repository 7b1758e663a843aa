"""Motion programs and range-gate tables of a WindScanner, read back and played through by a parser of their own."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

from geometry.errors import InputError
from planner.cli import run
from planner.files.yaml_site import load_site
from planner.handover.export import with_gates
from planner.handover.windscanner import motion_program, range_gate_table, windscanner_files
from planner.plan import Plan
from planner.scan_plans import GatePlan

GATES = {"first_m": 300, "spacing_m": 30, "count": 40}


def sector(**changes):
    return {"type": "sector", "sector_deg": 30, "step_deg": 3, **changes}


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
