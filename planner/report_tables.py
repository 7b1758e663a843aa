"""The tables of the report out of a Plan: what stands in them, in which unit and with how many digits."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from geometry.angles import SectorSet
from geometry.gates import unambiguous_range_m
from planner.budget import Budget
from planner.error_entry import rays_lost
from planner.exclusion import DEFICIT_STEP_DEG, Exclusion
from planner.fidelity import Effect
from planner.finding import Finding
from planner.over_terrain import OverTerrain
from planner.plan import Plan
from planner.report_values import Column, Table, Value, percent, quantity, spans
from planner.scan_layout import ScanLayout
from reconstruct.periods import TEN_MINUTES_S

PARALLEL_RANGE_M = 1e6  # beams that come closest farther off than this are as good as parallel

FINDINGS = (
    Column("severity", "severity"),
    Column("code", "code"),
    Column("subject", "subject"),
    Column("value", "value", "", 3),
    Column("unit", "unit"),
    Column("limit", "limit", "", 3),
    Column("text", "what was found, and what to do"),
)

POINTING = (
    Column("lidar", "lidar"),
    Column("target", "target"),
    Column("scan", "scan"),
    Column("azimuth_true_deg", "azimuth, true north", "°", 3),
    Column("azimuth_grid_deg", "azimuth, grid north", "°", 3),
    Column("azimuth_head_deg", "azimuth, head", "°", 3),
    Column("elevation_deg", "elevation", "°", 3),
    Column("elevation_head_deg", "elevation, head", "°", 3),
    Column("range_m", "range", "m", 2),
    Column("gate_index", "gate", "no.", 0),
    Column("gate_centre_m", "gate centre", "m", 1),
    Column("convergence_deg", "convergence", "°", 3, signed=True),
    Column("refraction_deg", "refraction", "°", 4, signed=True),
)

POINTING_TERRAIN = (
    Column("terrain", "terrain"),
    Column("terrain_clearance_m", "clear by", "m", 1),
    Column("terrain_distance_m", "at", "m", 0),
)

TERRAIN = (
    Column("scan", "scan"),
    Column("ray", "ray", "", 0),
    Column("azimuth_true_deg", "azimuth, true north", "°", 3),
    Column("elevation_deg", "elevation", "°", 3),
    Column("range_m", "range", "m", 1),
    Column("terrain", "terrain"),
    Column("clearance_m", "height above it where it passes nearest, as seen from the head", "m", 2),
)

CROSSINGS = (
    Column("pair", "pair"),
    Column("target", "target"),
    Column("scan1", "first scan"),
    Column("scan2", "second scan"),
    Column("opening_angle_deg", "opening angle in plan", "°", 1),
    Column("folded_angle_deg", "folded to 90°", "°", 1),
    Column("angle_deg", "angle in space", "°", 1),
    Column("gap_m", "gap between beams", "m", 2),
    Column("height_difference_m", "second above first", "m", 2, signed=True),
    Column("miss1_m", "first misses target by", "m", 2),
    Column("miss2_m", "second misses target by", "m", 2),
    Column("range1_m", "range of first", "m", 1),
    Column("range2_m", "range of second", "m", 1),
    Column("shared_probe_m", "shared probe", "m", 1),
)

WAKES = (
    Column("lidar", "lidar", on_page=False),
    Column("scan", "scan"),
    Column("target", "target"),
    Column("model", "model", on_page=False),
    Column("wanted_deg", "wind that counts"),
    Column("excluded_jensen_deg", "in a wake (Jensen)"),
    Column("excluded_iec_deg", "disturbed (IEC)"),
    Column("excluded_deg", "excluded (by the site's model)"),
    Column("free_deg", "free of wakes"),
    Column("wanted_and_free_deg", "counts and free"),
    Column("excluded_point_deg", "excluded at the target point alone"),
    Column("lost", "of the wind that counts, lost", in_file=False),
    Column("lost_share", "lost", on_page=False),
    Column("slowed", "target slowed most, in the wind that counts", in_file=False),
    Column("deficit_share", "largest loss of speed", on_page=False),
    Column("deficit_from_deg", "in wind from", on_page=False),
)

SCANS = (
    Column("scan", "scan"),
    Column("lidar", "lidar"),
    Column("type", "type"),
    Column("rays", "rays", "", 0),
    Column("accumulation_s", "a ray", "s", 2),
    Column("period_declared_s", "period declared", "s", 2),
    Column("period_needed_s", "period needed", "s", 2),
    Column("scans_per_10min", "scans in 10 min", "", 0),
    Column("rays_lost", "rays lost to solids", "", 0),
    Column("probe_length_m", "probe (FWHM)", "m", 1),
    Column("gates", "gates", "", 0),
    Column("first_gate_m", "first gate", "m", 0),
    Column("last_gate_m", "last gate", "m", 0),
    Column("unambiguous_range_m", "unambiguous range", "m", 0),
)

BUDGET = (
    Column("source", "source"),
    Column("speed_std_mps", "speed, k = 1", "m/s", 4),
    Column("speed_expanded_mps", "speed, k = 2", "m/s", 4),
    Column("speed_share", "share of speed"),
    Column("direction_std_deg", "direction, k = 1", "°", 3),
    Column("direction_expanded_deg", "direction, k = 2", "°", 3),
    Column("direction_share", "share of direction"),
    Column("reason", "not known, because"),
)

FIDELITY = (
    Column("effect", "effect"),
    Column("size", "size here"),
    Column("tolerance", "tolerance"),
    Column("modelled", "modelled"),
    Column("text", "what it is"),
)

_ERROR_NUMBERS = (
    Column("sector_deg", "sector", "°", 0),
    Column("rays", "rays", "", 0),
    Column("scans_per_10min", "scans in 10 min", "", 0),
    Column("condition", "condition", "", 2),
    Column("speed_bias_mps", "speed bias, one scan", "m/s", 3, signed=True),
    Column("speed_std_mps", "speed std, one scan", "m/s", 3),
    Column("direction_bias_deg", "direction bias, one scan", "°", 2, signed=True),
    Column("direction_std_deg", "direction std, one scan", "°", 2),
    Column("mean10_speed_bias_mps", "speed bias, 10 min", "m/s", 3, signed=True),
    Column("mean10_speed_std_mps", "speed std, 10 min", "m/s", 3),
    Column("mean10_direction_std_deg", "direction std, 10 min", "°", 2),
    Column("slope", "slope", "", 4),
    Column("residual_std_mps", "residual std", "m/s", 3),
    Column("direction_residual_std_deg", "direction residual std", "°", 2),
)

_FIRST_ERROR = 4  # the columns before say what is measured, not how well

ERRORS = (
    Column("lidar", "lidar"),
    Column("scan", "scan or pair"),
    Column("target", "target"),
    Column("tier", "tier"),
    Column("reference", "reference"),
    *_ERROR_NUMBERS,
    Column("recommended", "recommended"),
)


def pointing_table(plan: Plan) -> Table:
    """Where every lidar points for every target."""
    given = plan.pointings if plan.site.lidars and plan.site.targets else ()
    hilly = plan.site.terrain is not None
    columns = (*POINTING, *(column._replace(on_page=hilly) for column in POINTING_TERRAIN))
    rows = tuple(tuple(getattr(row, column.key) for column in columns) for row in given)
    return Table("pointing", "Where each lidar points for each target", columns, rows)


def terrain_table(plan: Plan) -> Table:
    """Every ray and gate over the terrain: blocked, clear or unknown, and its clearance; empty without a terrain.

    The clearance is that of `lidarplan point`, up to each gate: where the beam passes the ground at the smallest angle as
    seen from the head. Plain height would be that of the head above its own ground at nearly every gate.
    """
    rows = tuple(row for sight in plan.over_terrain for row in _terrain_rows(plan, sight))
    return Table("terrain", "Every ray and gate over the terrain", TERRAIN, rows)


def _terrain_rows(plan: Plan, sight: OverTerrain) -> Iterator[tuple[Value, ...]]:
    scan = plan.layout[sight.scan].scan
    for ray, gate in np.ndindex(*sight.blocked.shape):
        blocked, unknown = sight.blocked[ray, gate], sight.unknown[ray, gate]
        clearance_m = float(sight.pass_m[ray, gate])
        yield (
            *(sight.scan, int(ray) + 1, float(scan.azimuth_deg[ray]), float(scan.elevation_deg[ray])),
            float(sight.range_m[ray, gate]),
            "blocked" if blocked else "unknown" if unknown else "clear",
            clearance_m if np.isfinite(clearance_m) else None,
        )


def crossing_table(plan: Plan) -> Table:
    """How the beams of each pair meet."""
    rows = tuple(
        tuple(_near_enough(column, getattr(met, column.key)) for column in CROSSINGS)
        for met in plan.crossings
    )
    return Table(
        "crossings", "How the beams of each pair meet, from where they really point", CROSSINGS, rows
    )


def _near_enough(column: Column, value: Value) -> Value:
    """Leave out where beams meet that are as good as parallel."""
    far = column.key.startswith("range") and isinstance(value, float) and abs(value) > PARALLEL_RANGE_M
    return None if far else value


def findings_table(findings: Sequence[Finding]) -> Table:
    """All findings, errors first."""
    return Table(
        "findings", "Findings, errors first", FINDINGS, tuple(tuple(finding) for finding in findings)
    )


def wake_table(plan: Plan) -> Table:
    """Directions excluded and free, and the share of the wind lost, for each scan's measured volume."""
    rows = tuple(
        (
            item.lidar,
            item.scan,
            item.target,
            item.model,
            directions(item.wanted),
            directions(item.of_model("jensen")) if item.model != "iec" else None,
            directions(item.of_model("iec")) if item.model != "jensen" else None,
            directions(item.excluded),
            directions(item.free),
            directions(item.wanted.intersection(item.free)),
            directions(item.point),
            percent(item.lost_share),
            item.lost_share,
            *_slowed(item),
        )
        for item in plan.exclusions
    )
    return Table(
        "wakes", "Wind directions (from) with and without wakes in what each scan measures", WAKES, rows
    )


def _slowed(item: Exclusion) -> tuple[str, float, float | None]:
    """By how much wakes slow the wanted wind at the target at most, and where that wind comes from."""
    from_deg = np.arange(len(item.deficit)) * DEFICIT_STEP_DEG
    counts = np.where(item.wanted.contains(from_deg), item.deficit, 0.0)
    worst = int(np.argmax(counts))
    if counts[worst] <= 0:
        return "not at all", 0.0, None
    return (
        f"{percent(float(counts[worst]))} in wind from {from_deg[worst]:.0f}°",
        float(counts[worst]),
        float(from_deg[worst]),
    )


def scan_table(plan: Plan) -> Table:
    """Rays, times, probes and gates of every scan."""
    return Table(
        "scans",
        "Rays, times, probes and gates",
        SCANS,
        tuple(_scan_row(plan, layout) for layout in plan.layouts),
    )


def _scan_row(plan: Plan, layout: ScanLayout) -> tuple[Value, ...]:
    pulse, gates = plan.site.pulse_of(layout.spec), layout.gates
    return (
        layout.name,
        layout.lidar.name,
        layout.spec.type,
        layout.scan.count,
        layout.spec.accumulation_s,
        layout.spec.period_s,
        layout.scan.measured_period_s,
        layout.scan.scans_in(TEN_MINUTES_S),
        rays_lost(plan, layout.name),
        layout.probe.length_m,
        None if gates is None else gates.count,
        None if gates is None else gates.first_m,
        None if gates is None else gates.last_m,
        None if pulse is None else float(unambiguous_range_m(pulse.pulse_repetition_hz)),
    )


def fidelity_table(effects: Sequence[Effect]) -> Table:
    """Every effect that could be left out, with its size in this scene and whether it is modelled."""
    rows = tuple(
        (
            effect.name,
            quantity(effect.size, effect.unit),
            quantity(effect.tolerance, effect.unit),
            "yes" if effect.modelled else "left out",
            effect.text,
        )
        for effect in effects
    )
    return Table(
        "fidelity",
        "Effects with their size in this scene against the tolerance of the site file",
        FIDELITY,
        rows,
    )


def errors_table(entries: Sequence[Mapping[str, Any]]) -> Table:
    """Predicted errors of every scan and pair, a row a size, out of what `lidarplan errors --json` gives."""
    return Table(
        "errors", "Predicted errors", ERRORS, tuple(row for entry in entries for row in _error_rows(entry))
    )


def size_table(entry: Mapping[str, Any]) -> Table:
    """One sector scan's predicted errors on the page, a row a size."""
    caption = f"{entry['scan']} → {entry['target']}: predicted error, tier {entry['tier']}"
    return _known_columns(caption, (), [((), size) for size in entry["sizes"]])


def budget_table(budget: Budget) -> Table:
    """What each source adds to the error of ten-minute means of one scan or pair; the total last."""
    rows = tuple(
        (
            entry.source,
            entry.speed_std_mps,
            entry.expanded()[0],
            None if entry.speed_share is None else percent(entry.speed_share),
            entry.direction_std_deg,
            entry.expanded()[1],
            None if entry.direction_share is None else percent(entry.direction_share),
            entry.reason or "",
        )
        for entry in budget.entries
    )
    wind = f"{budget.wind.speed_mps:.1f} m/s from {budget.wind.from_deg:.0f}°"
    caption = (
        f"{budget.scan} → {budget.target}: uncertainty of ten-minute means, for the declared size and one state of "
        f"the wind, {wind}; the scatter over the climate, above, is over all states and differs"
    )
    return Table("budget", caption, BUDGET, rows)


def pair_table(entries: Sequence[Mapping[str, Any]]) -> Table:
    """All pairs' predicted errors on the page, a row a pair."""
    names = (Column("pair", "pair"), Column("target", "target"), Column("tier", "tier"))
    rows = [
        ((entry["scan"], entry["target"], entry["tier"]), size)
        for entry in entries
        for size in entry["sizes"]
    ]
    return _known_columns("Pairs: predicted error", names, rows)


def _known_columns(
    caption: str, names: tuple[Column, ...], rows: Sequence[tuple[tuple[Value, ...], Mapping[str, Any]]]
) -> Table:
    """Table of errors without the columns of which nothing is known."""
    columns = tuple(
        column for column in _ERROR_NUMBERS if any(size.get(column.key) is not None for _, size in rows)
    )
    values = tuple((*given, *(size.get(column.key) for column in columns)) for given, size in rows)
    return Table("sizes", caption, (*names, *columns), values)


def unknown_numbers(entries: Sequence[Mapping[str, Any]]) -> list[tuple[str, str]]:
    """What no size of some entries knows, as (names, reason): the reasons that the tier gives, each once."""
    sizes = [size for entry in entries for size in entry["sizes"]]
    by_reason: dict[str, list[str]] = {}
    for column in _ERROR_NUMBERS[_FIRST_ERROR:]:
        if sizes and all(size.get(column.key) is None for size in sizes):
            reason = sizes[0].get("reasons", {}).get(column.key)
            by_reason.setdefault(str(reason or "this tier does not know it"), []).append(column.heading)
    return [("; ".join(names), reason) for reason, names in by_reason.items()]


def _error_rows(entry: Mapping[str, Any]) -> Iterator[tuple[Value, ...]]:
    best = entry.get("recommended_sector_deg")
    for size in entry["sizes"]:
        known = {
            **size,
            "lidar": entry.get("lidar"),
            **{key: entry.get(key) for key in ("scan", "target", "tier", "reference")},
        }
        known["recommended"] = "yes" if best is not None and size.get("sector_deg") == best else "no"
        yield tuple(known.get(column.key) for column in ERRORS)


def directions(sectors: SectorSet) -> str:
    """Wind directions as spans."""
    return spans(sectors.pairs())
