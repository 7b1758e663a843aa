"""The scan table: what to type into, or load with, the software of a WindCube-like lidar.

One line a sweep in CSV; in JSON the same by scan, with every ray beside it. Angles are those that the head
shows; ranges are those that the instrument states.
"""

import numpy as np

from planner.handover.head_path import Sweep, head_path, sweeps
from planner.plan import Plan
from planner.report_values import Column, Value, csv_text
from planner.scan_layout import ScanLayout

COLUMNS = (
    Column("lidar", "lidar"),
    Column("scan", "scan"),
    Column("type", "type"),
    Column("sweep", "sweep"),
    Column("azimuth_from_deg", "azimuth from"),
    Column("azimuth_to_deg", "azimuth to"),
    Column("elevation_from_deg", "elevation from"),
    Column("elevation_to_deg", "elevation to"),
    Column("speed_deg_per_s", "speed"),
    Column("rays", "rays"),
    Column("accumulation_ms", "accumulation"),
    Column("period_s", "period"),
    Column("back_and_forth", "back and forth"),
    Column("pulse_ns", "pulse"),
    Column("fft_points", "FFT points"),
    Column("first_gate_m", "first gate"),
    Column("gate_spacing_m", "spacing"),
    Column("gates", "gates"),
    Column("last_gate_m", "last gate"),
)
ANGLE_DIGITS = 4


def scan_table_csv(plan: Plan) -> str:
    """Write the table of all sweeps as CSV."""
    rows = [
        tuple(record[column.key] for column in COLUMNS)
        for layout in plan.layouts
        for record in _sweep_records(layout)
    ]
    return csv_text(COLUMNS, rows)


def scan_table(plan: Plan) -> list[dict[str, object]]:
    """Give every scan with its sweeps and rays, for a JSON file."""
    return [_scan_record(layout) for layout in plan.layouts]


def _scan_record(layout: ScanLayout) -> dict[str, object]:
    records = _sweep_records(layout)
    shared = (
        "lidar",
        "scan",
        "type",
        "accumulation_ms",
        "period_s",
        "back_and_forth",
        *(c.key for c in COLUMNS[-6:]),
    )
    middle = head_path(layout).middle_deg
    rays = [
        {
            "azimuth_deg": _angle(azimuth % 360.0),
            "elevation_deg": _angle(elevation),
            "time_s": round(float(time_s), 6),
        }
        for (azimuth, elevation), time_s in zip(middle, layout.scan.time_s, strict=True)
    ]
    sweep_keys = [column.key for column in COLUMNS if column.key not in shared]
    return {
        **{key: records[0][key] for key in shared},
        "sweeps": [{key: record[key] for key in sweep_keys} for record in records],
        "rays": rays,
    }


def _sweep_records(layout: ScanLayout) -> list[dict[str, Value]]:
    """One record a sweep of the first pass."""
    return [
        _sweep_record(layout, number, sweep)
        for number, sweep in enumerate(sweeps(head_path(layout)), start=1)
    ]


def _sweep_record(layout: ScanLayout, number: int, sweep: Sweep) -> dict[str, Value]:
    pulse, gates = layout.pulse, layout.gates
    speed = float(np.abs(sweep.turn_deg).max()) / (sweep.rays * layout.spec.accumulation_s)
    return {
        "lidar": layout.lidar.name,
        "scan": layout.name,
        "type": layout.spec.type,
        "sweep": number,
        "azimuth_from_deg": _angle(sweep.begin_deg[0]),
        "azimuth_to_deg": _angle(sweep.end_deg[0]),
        "elevation_from_deg": _angle(sweep.begin_deg[1]),
        "elevation_to_deg": _angle(sweep.end_deg[1]),
        "speed_deg_per_s": round(speed, 6),
        "rays": sweep.rays,
        "accumulation_ms": round(1e3 * layout.spec.accumulation_s, 6),
        "period_s": round(layout.scan.period_s, 6),
        "back_and_forth": layout.scan.back_and_forth,
        "pulse_ns": layout.spec.pulse_ns or (pulse.pulse_ns if pulse else None),
        "fft_points": layout.spec.fft_points or (pulse.fft_points if pulse else None),
        "first_gate_m": gates.first_m if gates else None,
        "gate_spacing_m": gates.spacing_m if gates else None,
        "gates": gates.count if gates else None,
        "last_gate_m": gates.last_m if gates else None,
    }


def _angle(value: float) -> float:
    return round(float(value), ANGLE_DIGITS) + 0.0
