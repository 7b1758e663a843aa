"""Range, gates, elevation and aim of each scan against its instrument and its target."""

from collections.abc import Iterator

from planner.aiming import outside_sweep
from planner.finding import Finding, Severity
from planner.plan import Plan
from planner.scan_layout import DEFAULT_PULSE_NS, ScanLayout

# What air over flat land moves up or down in a ten-minute mean; used where less is declared.
VERTICAL_WIND_MPS = 0.1
# Declared head angles against the target: 5 m at 3 km.
AIM_TOLERANCE_DEG = 0.1
# A gate that is farther than this share of the spacing from the target could be moved closer.
OFFSET_SHARE = 0.25
# The nearest of enough gates is never farther than half the spacing.
MISSING_SHARE = 0.5
# Scans whose retrieval takes a vertical wind for a horizontal one; around a full circle it cancels.
TILTED_BY_VERTICAL_WIND = ("sector", "stare", "points")


def find(plan: Plan) -> Iterator[Finding]:
    """Findings about range, gates, elevation and aim."""
    for layout in plan.layouts:
        for target in layout.targets:
            yield from _range(layout, target)
            yield from _gate(layout, target)
        yield from _ambiguous(layout)
        yield from _gate_count(layout)
        yield from _elevation(layout)
        yield from _vertical_wind(plan, layout)
        yield from _aim(layout)
    yield from _unknown_pulses(plan)


def _range(layout: ScanLayout, target: str) -> Iterator[Finding]:
    """Range of the target against the blind zone and the instrument's maximum."""
    device, range_m, subject = layout.lidar.device, layout.range_to_m(target), f"{layout.name} → {target}"
    least_m, most_m = device.min_range_m, device.max_range_m
    if least_m is not None and range_m < least_m:
        text = (
            f"the target is {range_m:.0f} m away, inside the blind zone of {least_m:.0f} m of {device.name}: "
            "move the lidar away"
        )
        yield Finding("error", "range-blind", subject, range_m, "m", least_m, text)
    if most_m is not None and range_m > most_m:
        text = (
            f"the target is {range_m:.0f} m away, beyond the {most_m:.0f} m that {device.name} reaches at "
            "best: move the lidar closer"
        )
        yield Finding("error", "range-max", subject, range_m, "m", most_m, text)


def _ambiguous(layout: ScanLayout) -> Iterator[Finding]:
    """Farthest target or gate against the unambiguous range of the pulse."""
    if layout.pulse is None:  # `pulse-unknown`
        return
    limit_m, kilohertz = layout.unambiguous_range_m, layout.pulse.pulse_repetition_hz / 1000
    if limit_m is not None and layout.farthest_m > limit_m:
        text = (
            f"the farthest target or gate is at {layout.farthest_m:.0f} m, beyond the {limit_m:.0f} m up to "
            f"which {kilohertz:g} kHz is unambiguous: echoes of two pulses mix; take a longer pulse or fewer "
            "gates"
        )
        yield Finding("error", "range-ambiguous", layout.name, layout.farthest_m, "m", limit_m, text)


def _unknown_pulses(plan: Plan) -> Iterator[Finding]:
    """Pulses of which the instrument's numbers say nothing, once for each instrument and pulse."""
    unknown = [layout for layout in plan.layouts if layout.pulse is None]
    for name, pulse_ns in dict.fromkeys((each.lidar.device.name, each.spec.pulse_ns) for each in unknown):
        alike = [each for each in unknown if (each.lidar.device.name, each.spec.pulse_ns) == (name, pulse_ns)]
        modes = {mode.pulse_ns for each in alike for mode in each.lidar.device.pulses if mode.pulse_ns}
        known = ", ".join(f"{mode:g}" for mode in sorted(modes)) or "none known"
        scans = ", ".join(each.name for each in alike)
        said = (
            f"{DEFAULT_PULSE_NS:g} ns are taken for the pulse, because neither the scan ({scans}) nor {name} "
            "names one; its unambiguous range is not checked: give pulse_ns"
            if pulse_ns is None
            else f"{name} has no pulse of {pulse_ns:g} ns in the catalogue (it has: {known}), so the unambiguous "
            f"range of {scans} is not checked: correct pulse_ns"
        )
        text = f"{said}, or give the instrument's pulses in the site file"
        yield Finding("warning", "pulse-unknown", name, alike[0].probe.pulse_ns, "ns", None, text)


def _gate(layout: ScanLayout, target: str) -> Iterator[Finding]:
    """Nearest gate against the target."""
    range_m = layout.range_to_m(target)
    gate = layout.gate_at(range_m)
    if gate is None or layout.gates is None:
        return
    index, centre_m, offset_m = gate
    spacing_m, subject = layout.gates.spacing_m, f"{layout.name} → {target}"
    if abs(offset_m) > MISSING_SHARE * spacing_m:
        text = (
            f"no gate is at the target, {range_m:.0f} m away: the nearest, gate {index} at {centre_m:.0f} m, "
            f"is {abs(offset_m):.0f} m off, more than half the spacing of {spacing_m:g} m; change first_m or "
            "count"
        )
        limit_m = MISSING_SHARE * spacing_m
        yield Finding("error", "gate-missing", subject, abs(offset_m), "m", limit_m, text)
    elif abs(offset_m) > OFFSET_SHARE * spacing_m:
        text = (
            f"gate {index} at {centre_m:.0f} m is {abs(offset_m):.1f} m "
            f"{'behind' if offset_m > 0 else 'before'} the target, more than a quarter of the spacing of "
            f"{spacing_m:g} m: a first_m of {layout.gates.first_m - offset_m:.1f} m would centre it"
        )
        yield Finding("info", "gate-offset", subject, abs(offset_m), "m", OFFSET_SHARE * spacing_m, text)


def _gate_count(layout: ScanLayout) -> Iterator[Finding]:
    """Number of gates against the instrument's."""
    gates, most = layout.gates, layout.lidar.device.max_gates
    if gates is not None and most is not None and gates.count > most:
        text = (
            f"{gates.count} gates are asked for, {layout.lidar.device.name} has {most}: take fewer, or space "
            "them wider"
        )
        yield Finding("error", "gate-count", layout.name, gates.count, "gates", most, text)


def _elevation(layout: ScanLayout) -> Iterator[Finding]:
    """Elevations as the head shows them against what it can reach."""
    head = layout.lidar.device.head
    if head is None:
        return
    (lowest, highest), least, most = layout.head_elevation_deg, head.elevation_min_deg, head.elevation_max_deg
    if least is not None and lowest < least:
        text = (
            f"the head has to go down to {lowest:.2f}°, but reaches only {least:g}°: stand lower or farther "
            "away, or choose a higher target"
        )
        yield Finding("error", "elevation-limit", layout.name, lowest, "deg", least, text)
    if most is not None and highest > most:
        text = (
            f"the head has to go up to {highest:.2f}°, but reaches only {most:g}°: stand farther from the "
            "target, or end the scan lower"
        )
        yield Finding("error", "elevation-limit", layout.name, highest, "deg", most, text)


def _vertical_wind(plan: Plan, layout: ScanLayout) -> Iterator[Finding]:
    """What a vertical wind adds along the beam, w·tan φ, against the tolerance."""
    if layout.spec.type not in TILTED_BY_VERTICAL_WIND or not layout.targets:
        return
    vertical_mps = max(abs(plan.site.assumed_wind.vertical_mps), VERTICAL_WIND_MPS)
    size_mps, limit_mps = layout.vertical_bias_mps(vertical_mps), plan.site.tolerance.speed_mps
    if size_mps > limit_mps:
        text = (
            f"a vertical wind of {vertical_mps:g} m/s looks like {size_mps:.2f} m/s of horizontal wind at "
            f"this elevation (w·tan φ), over the tolerance of {limit_mps:g} m/s: stand farther away, or "
            "retrieve w too"
        )
        yield Finding("warning", "vertical-wind", layout.name, size_mps, "m/s", limit_mps, text)


def _aim(layout: ScanLayout) -> Iterator[Finding]:
    """Declared head angles against the direction of the target."""
    off_deg, miss_m, outside = layout.aim_error_deg, layout.aim_miss_m, outside_sweep(layout)
    if off_deg is None or outside is None or off_deg <= AIM_TOLERANCE_DEG:
        return
    probe_m = layout.probe.length_m
    beside_sector = layout.spec.type == "sector" and outside.azimuth_deg > 0.0
    severity: Severity = "error" if beside_sector or outside.miss_m > probe_m else "warning"
    sweep = (
        f", and the scan passes it: {outside.miss_m:.0f} m at its nearest, with a probe of {probe_m:.0f} m"
        if severity == "error"
        else ""
    )
    text = (
        f"the declared head angles point {off_deg:.2f}° beside target {layout.targets[0]} ({miss_m:.0f} "
        f"m there), over {AIM_TOLERANCE_DEG:g}°{sweep}: check azimuth_head_deg, elevation_head_deg and the "
        "lidar's offsets, or leave the head angles out"
    )
    yield Finding(severity, "aim", layout.name, off_deg, "deg", AIM_TOLERANCE_DEG, text)
