"""The numbers that a reader looks for first, the same rows for every site."""

from collections import Counter
from collections.abc import Iterator, Sequence
from typing import NamedTuple

from planner.error_entry import Entry, rays_lost
from planner.finding import SEVERITIES, Finding
from planner.plan import Plan
from planner.report_errors import recommended_size
from planner.report_tables import directions
from planner.report_values import DASH, fixed, percent
from reconstruct.periods import TEN_MINUTES_S

WORDS = {"error": ("error", "errors"), "warning": ("warning", "warnings"), "info": ("remark", "remarks")}

MISSES = "beams of pairs that pass their target"


class KeyNumber(NamedTuple):
    """One row."""

    label: str
    text: str


def counted(count: int, one: str, many: str) -> str:
    """A number with its noun.

    Examples
    --------
    >>> counted(1, "lidar", "lidars"), counted(0, "lidar", "lidars")
    ('1 lidar', 'no lidars')
    """
    return f"{count or 'no'} {one if count == 1 else many}"


def finding_counts(findings: Sequence[Finding]) -> str:
    """How many findings of each severity, in words.

    Examples
    --------
    >>> finding_counts([])
    'no errors, no warnings, no remarks'
    """
    counts = Counter(finding.severity for finding in findings)
    return ", ".join(counted(counts[severity], *WORDS[severity]) for severity in SEVERITIES)


def key_numbers(plan: Plan, findings: Sequence[Finding], entries: Sequence[Entry]) -> list[KeyNumber]:
    """The rows of one site, always the same ones in the same order."""
    return [
        KeyNumber("findings", finding_counts(findings)),
        *_layout(plan),
        *_scanning(plan),
        *_wind(plan),
        *_errors(entries),
    ]


def _layout(plan: Plan) -> Iterator[KeyNumber]:
    site, met = plan.site, plan.crossings
    things = (
        counted(len(site.lidars), "lidar", "lidars"),
        counted(len(site.scans), "scan", "scans"),
        counted(len(site.targets), "target", "targets"),
        counted(len(site.turbines), "turbine", "turbines"),
    )
    yield KeyNumber("on the site", ", ".join(things))
    ranges = [float(value) for layout in plan.layouts for value in layout.aim.range_m]
    yield KeyNumber("range to the targets scanned [m]", _between(ranges, 0))
    yield KeyNumber("opening angle of pairs [°]", _between([item.opening_angle_deg for item in met], 0))
    yield KeyNumber("gap between the beams of pairs [m]", _between([item.gap_m for item in met], 2))
    yield KeyNumber(MISSES, _misses(plan))


def _misses(plan: Plan) -> str:
    """How far the worse beam of each pair passes its target, where that is more than the position tolerance."""
    tolerance_m = plan.site.tolerance.position_m
    far = [(met, *met.worst_aimed) for met in plan.crossings if met.worst_aimed[1] > tolerance_m]
    if not far:
        return f"none by more than {tolerance_m:g} m" if plan.crossings else DASH
    return ", ".join(f"{fixed(miss_m, 1)} m ({lidar}, {met.pair})" for met, lidar, miss_m in far)


def _scanning(plan: Plan) -> Iterator[KeyNumber]:
    counts = [float(layout.scan.scans_in(TEN_MINUTES_S)) for layout in plan.layouts]
    yield KeyNumber("scans in ten minutes", _between(counts, 0))
    rays = sum(layout.scan.count for layout in plan.layouts)
    lost = sum(rays_lost(plan, layout.name) for layout in plan.layouts)
    yield KeyNumber("rays lost to rotors, towers, masts, obstacles", f"{lost} of {rays}" if rays else DASH)


def _wind(plan: Plan) -> Iterator[KeyNumber]:
    yield KeyNumber("wind directions that count", directions(plan.wanted))
    worst = max(plan.exclusions, key=lambda item: item.lost_share, default=None)
    yield KeyNumber(
        "of that wind lost to wakes, worst scan",
        "none"
        if worst is None or worst.lost_share == 0
        else f"{percent(worst.lost_share)} ({worst.scan} → {worst.target})",
    )
    yield KeyNumber(
        "counts and free of wakes, worst scan",
        DASH if worst is None else directions(worst.wanted.intersection(worst.free)),
    )


def _errors(entries: Sequence[Entry]) -> Iterator[KeyNumber]:
    sectors = [entry for entry in entries if entry["recommended_sector_deg"] is not None]
    advice = [
        f"{_size(entry['recommended_sector_deg'])} ({entry['scan']} → {entry['target']})" for entry in sectors
    ]
    yield KeyNumber("recommended sector", ", ".join(advice) or DASH)
    for label, key, digits in (
        ("speed error of one scan, std [m/s]", "speed_std_mps", 2),
        ("speed error of ten minutes, std [m/s]", "mean10_speed_std_mps", 2),
        ("direction error of one scan, std [°]", "direction_std_deg", 1),
    ):
        texts = [_of_entry(entry, key, digits) for entry in entries]
        yield KeyNumber(label, ", ".join(text for text in texts if not text.startswith(DASH)) or DASH)


def _of_entry(entry: Entry, key: str, digits: int) -> str:
    size = recommended_size(entry)
    value = None if size is None else size.get(key)
    angle = None if size is None else size.get("sector_deg")
    where = entry["scan"] if angle is None else f"{entry['scan']}, {_size(angle)}"
    return f"{DASH if value is None else fixed(value, digits)} ({where})"


def _size(sector_deg: float | None) -> str:
    return "none" if sector_deg is None else f"{sector_deg:g}°"


def _between(values: Sequence[float], digits: int) -> str:
    """One number, or the smallest and the largest."""
    if not values:
        return DASH
    low, high = fixed(min(values), digits), fixed(max(values), digits)
    return low if low == high else f"{low} to {high}"
