"""The field sheet: one printable page for each lidar, for whoever stands at the tripod.

Names in a site file are untrusted text; every one reaches the page through the template's escaping, and the
page's content security policy lets nothing load or run.
"""

import math
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from geometry.angles import wrap_180_deg, wrap_360_deg
from geometry.beams import beam_to
from geometry.errors import InputError
from planner import palette
from planner.ground import ground_under_m
from planner.handover.head_path import head_path
from planner.places import Places
from planner.plan import Plan
from planner.report_values import DASH, Column, Table, Value, fixed, sensible
from planner.scan_layout import ScanLayout
from planner.site import Lidar, Site

# Declination drifts and the needle bends near iron: a compass is good for a first turn only.
COMPASS_DEG = 1.0

SIGHTS = (  # angles in degrees
    Column("name", "name"),
    Column("what", "what"),
    Column("azimuth_true_deg", "azimuth true", "", 3),
    Column("azimuth_grid_deg", "azimuth grid", "", 3),
    Column("azimuth_magnetic_deg", "azimuth magn.", "", 1),
    Column("azimuth_head_deg", "azimuth head", "", 3),
    Column("elevation_deg", "elev. true", "", 3),
    Column("elevation_head_deg", "elev. head", "", 3),
    Column("range_m", "range", "m", 1),
    Column("gate_index", "gate", "", 0),
    Column("gate_centre_m", "centre", "m", 1),
)
SCANS = (
    Column("scan", "scan"),
    Column("type", "type"),
    Column("azimuth", "head azimuth", "°"),
    Column("elevation", "head elevation", "°"),
    Column("rays", "rays", "", 0),
    Column("step", "step", "°"),
    Column("accumulation_s", "a ray", "s", 3),
    Column("period_s", "period", "s", 2),
    Column("pulse_ns", "pulse", "ns", 0),
    Column("fft_points", "FFT", "", 0),
    Column("gates", "gates: first, spacing, last", "m"),
    Column("count", "number", "", 0),
)


class Sight(NamedTuple):
    """Something that a lidar can be pointed at, by the exact ellipsoid."""

    name: str
    what: str
    azimuth_true_deg: float
    azimuth_grid_deg: float
    azimuth_magnetic_deg: float | None
    azimuth_head_deg: float
    elevation_deg: float
    elevation_head_deg: float
    range_m: float
    gate_index: int | None
    gate_centre_m: float | None


def field_sheet_html(plan: Plan, *, declination_deg: float | None = None) -> str:
    """Write the sheets of all lidars as one HTML page, a printed page each.

    Parameters
    ----------
    plan
        What is planned.
    declination_deg
        Magnetic declination at the site, east positive [deg]; without it there are no magnetic bearings.

    Raises
    ------
    InputError
        If the site has no lidar.
    """
    from importlib.resources import files

    from jinja2 import Environment, StrictUndefined

    if not plan.site.lidars:
        raise InputError(
            "the site has no lidar: there is no field sheet to write; add lidars to the site file"
        )
    environment = Environment(
        autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    source = files("planner.templates").joinpath("field_sheet.html.j2").read_text(encoding="utf-8")
    sheets = [sheet(plan, lidar, declination_deg=declination_deg) for lidar in plan.site.lidars]
    return environment.from_string(source).render(site=plan.site, sheets=sheets, palette=palette)


def sheet(plan: Plan, lidar: Lidar, *, declination_deg: float | None = None) -> dict[str, Any]:
    """Everything that one lidar's page says, ready for the template."""
    places, site = plan.exact_places, plan.site
    scans = [layout for layout in plan.layouts if layout.lidar.name == lidar.name]
    targets = _targets(places, lidar, scans, declination_deg)
    hard, declared = _hard_targets(places, lidar, scans, declination_deg)
    return {
        "lidar": lidar,
        "instrument": lidar.device.name,
        "colour": palette.lidar_colour(site.lidars.index(lidar)),
        "position": position_rows(places, lidar),
        "north": north_rows(places, lidar, declination_deg),
        "level": level_rows(site, lidar, [sight.range_m for sight in targets]),
        "steps": list(steps(places, lidar, scans, declination_deg)),
        "targets": _sight_table("Pointing: targets", targets),
        "hard": _sight_table("Hard targets", hard),
        "hard_declared": declared,
        "scans": Table("scans", "Scan settings", SCANS, tuple(scan_row(layout) for layout in scans)),
    }


def sight(
    places: Places,
    lidar: Lidar,
    name: str,
    what: str,
    position_m: Sequence[float],
    *,
    scans: Sequence[ScanLayout] = (),
    declination_deg: float | None = None,
) -> Sight:
    """Point a lidar at a position.

    Parameters
    ----------
    places
        The site's frame.
    lidar
        Which one points.
    name, what
        What stands there.
    position_m
        Easting, northing, height [m].
    scans
        The first of them that has a gate there says which one it is.
    declination_deg
        Magnetic declination, east positive [deg].
    """
    beam = beam_to(places.frame.enu_m(lidar.position, position_m))
    azimuth_deg, elevation_deg, range_m = (float(value) for value in beam)
    head_azimuth, head_elevation = places.mounting(lidar).to_head(azimuth_deg, elevation_deg)
    gate = next((found for layout in scans if (found := _gate(layout, range_m))), None)
    return Sight(
        name=name,
        what=what,
        azimuth_true_deg=azimuth_deg,
        azimuth_grid_deg=float(wrap_360_deg(azimuth_deg - places.convergence_deg(lidar))),
        azimuth_magnetic_deg=magnetic_deg(azimuth_deg, declination_deg),
        azimuth_head_deg=float(wrap_360_deg(head_azimuth)),
        elevation_deg=elevation_deg,
        elevation_head_deg=float(head_elevation),
        range_m=range_m,
        gate_index=None if gate is None else gate[0],
        gate_centre_m=None if gate is None else gate[1],
    )


def magnetic_deg(azimuth_true_deg: float, declination_deg: float | None) -> float | None:
    """Bearing that a compass shows: true less declination, which is positive where the needle points east of north.

    Examples
    --------
    >>> magnetic_deg(2.0, 3.5), magnetic_deg(192.0, None)
    (358.5, None)
    """
    return None if declination_deg is None else float(wrap_360_deg(azimuth_true_deg - declination_deg))


def level_limit_deg(tolerance_m: float, range_m: float) -> float:
    """Tilt that moves a beam by a tolerance at a range [deg].

    Examples
    --------
    >>> round(level_limit_deg(0.5, 1123.0), 4)
    0.0255
    """
    return math.degrees(math.atan2(tolerance_m, range_m))


def degrees_minutes(value_deg: float, letters: str) -> str:
    """Write a latitude or longitude in degrees, minutes and seconds.

    Examples
    --------
    >>> degrees_minutes(56.450450094, "NS"), degrees_minutes(-3.5, "EW"), degrees_minutes(7.99999999, "EW")
    ('56° 27′ 01.620″ N', '3° 30′ 00.000″ W', '8° 00′ 00.000″ E')
    """
    total = round(abs(value_deg) * 3_600_000)  # thousandths of a second: 3 cm
    seconds, thousandths = divmod(total, 1000)
    minutes, second = divmod(seconds, 60)
    degree, minute = divmod(minutes, 60)
    return f"{degree}° {minute:02d}′ {second:02d}.{thousandths:03d}″ {letters[value_deg < 0]}"


def position_rows(places: Places, lidar: Lidar) -> list[tuple[str, str]]:
    """Where the head has to be."""
    site = places.site
    easting, northing, height = lidar.position
    longitude, latitude, _ = (float(value) for value in places.frame.geographic(lidar.position))
    above = "sea level" if site.height_datum == "above_sea_level" else "the ellipsoid"
    ground_m = float(ground_under_m(site, lidar.position))
    ground = f"{_above(height - ground_m)} the ground ({ground_m:.6g} m)"
    return [
        ("east, north", f"{easting:.3f} m, {northing:.3f} m ({site.crs})"),
        (
            "height",
            f"{height:.3f} m above {above}, {ground if math.isfinite(ground_m) else 'outside the terrain'}",
        ),
        ("lat., lon.", f"{degrees_minutes(latitude, 'NS')}, {degrees_minutes(longitude, 'EW')}"),
        ("", f"{latitude:.7f}, {longitude:.7f}"),
        ("to be within", f"{lidar.uncertainty.position_m:g} m (k = 1)"),
    ]


def north_rows(places: Places, lidar: Lidar, declination_deg: float | None) -> list[tuple[str, str]]:
    """Where the head's zero points, and how the norths differ here."""
    convergence_deg = places.convergence_deg(lidar)
    zero_true, _ = places.mounting(lidar).to_true(0.0, 0.0)
    zero_deg = float(zero_true)
    compass = magnetic_deg(zero_deg, declination_deg)
    rows = [
        (
            "head's zero",
            f"{zero_deg:.3f}° from true, {wrap_360_deg(zero_deg - convergence_deg):.3f}° from grid north",
        ),
        ("", f"{compass:.1f}° by compass" if compass is not None else "by compass: give --declination"),
        ("planned as", f"{lidar.north} north, heading {lidar.mounting.heading_deg:g}°"),
        (
            "offsets",
            f"azimuth {fixed(lidar.azimuth_offset_deg, 3, signed=True)}°, elevation "
            f"{fixed(lidar.elevation_offset_deg, 3, signed=True)}° (pointing = head + offset)",
        ),
        ("grid north", f"{_side(convergence_deg, 3)} of true north"),
    ]
    if declination_deg is not None:
        rows.append(("magnetic north", f"{_side(float(wrap_180_deg(declination_deg)), 2)} of true north"))
    return rows


def level_rows(site: Site, lidar: Lidar, ranges_m: Sequence[float]) -> list[tuple[str, str]]:
    """How level the head has to stand for the beam to be where it is wanted."""
    limit_m = site.tolerance.position_m
    rows = [
        (
            "level within",
            f"{lidar.uncertainty.levelling_deg:g}° = {_slope(lidar.uncertainty.levelling_deg)} (k = 1)",
        )
    ]
    if ranges_m:
        farthest = max(ranges_m)
        tilt = level_limit_deg(limit_m, farthest)
        rows.append((f"for {limit_m:g} m at {farthest:.0f} m", f"{sensible(tilt)}° = {_slope(tilt)}"))
    rows.append(
        (
            "planned pitch, roll",
            f"{lidar.mounting.pitch_deg:g}° nose up, {lidar.mounting.roll_deg:g}° right down",
        )
    )
    return rows


def steps(
    places: Places, lidar: Lidar, scans: Sequence[ScanLayout], declination_deg: float | None
) -> Iterator[str]:
    """What to do, in order."""
    unsure = lidar.uncertainty
    tilt = f"{unsure.levelling_deg:g}° ({_slope(unsure.levelling_deg)})"
    zero, _ = places.mounting(lidar).to_true(0.0, 0.0)
    compass = magnetic_deg(float(zero), declination_deg)
    turn = f"Turn its zero to {float(zero):.1f}° true"
    if compass is not None:
        turn += f" ({compass:.1f}° by compass, good for {COMPASS_DEG:g}° at best, away from iron)"
    yield "Stand the lidar on firm ground over its mark; measure the head by GNSS and write it down."
    yield f"Level to {tilt} with the warm instrument, doors closed; read pitch and roll at four headings 90° apart."
    yield f"{turn}. Hard targets give the rest: {unsure.heading_deg:g}° are planned."
    yield "Set the clock to UTC by GNSS or NTP; write down its offset."
    yield "Map the hard targets below around the expected angles, 1 m gates; write what was found."
    yield "Offset = expected pointing less found head angle. Put it into the site file and export anew; check the level again."
    names = ", ".join(f"“{layout.name}”" for layout in scans)
    yield f"Start {names or 'the scans'}; look at the first file: angles, gates, CNR at the measured gate."
    yield "Photograph the lidar from four sides, the levels, and the horizon along the beams."


def scan_row(layout: ScanLayout) -> tuple[Value, ...]:
    """One scan's settings, in head angles."""
    path, gates, pulse, spec = head_path(layout), layout.gates, layout.pulse, layout.spec
    ends = np.vstack([path.begin_deg, path.end_deg])
    return (
        layout.name,
        spec.type,
        _from_to(path.begin_deg[0, 0], path.end_deg[-1, 0], ends[:, 0]),
        _from_to(path.begin_deg[0, 1], path.end_deg[-1, 1], ends[:, 1]),
        layout.scan.count,
        sensible(getattr(spec, "step_deg", None)),
        spec.accumulation_s,
        layout.scan.period_s,
        spec.pulse_ns or (pulse.pulse_ns if pulse else None),
        spec.fft_points or (pulse.fft_points if pulse else None),
        DASH if gates is None else f"{gates.first_m:g}, {gates.spacing_m:g}, {gates.last_m:g}",
        None if gates is None else gates.count,
    )


def _targets(
    places: Places, lidar: Lidar, scans: Sequence[ScanLayout], declination_deg: float | None
) -> list[Sight]:
    """The targets that the lidar's scans look at; of a lidar without scans all targets."""
    site = places.site
    looked_at = [name for layout in scans for name in layout.targets]
    names = list(dict.fromkeys(looked_at)) or [target.name for target in site.targets]
    found = []
    for name in names:
        at = [layout for layout in scans if name in layout.targets]
        what = ", ".join(layout.name for layout in at)
        position = site.target_position_m(name)
        found.append(sight(places, lidar, name, what, position, scans=at, declination_deg=declination_deg))
    return found


def _hard_targets(
    places: Places, lidar: Lidar, scans: Sequence[ScanLayout], declination_deg: float | None
) -> tuple[list[Sight], bool]:
    """The declared hard targets; where there is none, the tops of masts and the hubs of turbines. And which it is."""
    site = places.site
    declared = bool(site.hard_targets)
    things: list[tuple[str, str, Sequence[float]]] = [
        (item.name, f"{item.shape}, {item.size_m:g} m", site.target_position_m(item))
        for item in site.hard_targets
    ]
    if not declared:
        things = [
            (mast.name, "top", (*mast.position[:2], mast.position[2] + mast.height_m)) for mast in site.masts
        ]
        things += [
            (item.name, "hub", (*item.position[:2], item.position[2] + item.hub_height_m))
            for item in site.turbines
        ]
    return [
        sight(places, lidar, name, what, position, scans=scans, declination_deg=declination_deg)
        for name, what, position in things
    ], declared


def _sight_table(caption: str, sights: Sequence[Sight]) -> Table:
    """A table without the columns of which nothing is known."""
    known = [
        number
        for number, column in enumerate(SIGHTS)
        if any(getattr(item, column.key) not in (None, "") for item in sights)
    ]
    rows = tuple(tuple(item[number] for number in known) for item in sights)
    return Table("sights", caption, tuple(SIGHTS[number] for number in known), rows)


def _gate(layout: ScanLayout, range_m: float) -> tuple[int, float] | None:
    """The gate at a range, if the scan has one there."""
    gate = layout.gate_at(range_m)
    if gate is None or layout.gates is None or abs(gate[2]) > layout.gates.spacing_m / 2:
        return None
    return gate[0], gate[1]


def _from_to(first: float, last: float, ends: Any) -> str:
    """An angle, or the two between which a scan goes."""
    first, last = float(first), float(last)
    if max(ends) - min(ends) < 5e-4:
        return fixed(first, 3)
    if abs(last - first) < 5e-4:  # a raster or list that comes back
        first, last = float(min(ends)), float(max(ends))
    return f"{fixed(first, 3)} to {fixed(last, 3)}"


def _above(height_m: float) -> str:
    return f"{abs(height_m):.2f} m {'above' if height_m >= 0 else 'below'}"


def _side(angle_deg: float, digits: int) -> str:
    return f"{abs(angle_deg):.{digits}f}° {'east' if angle_deg >= 0 else 'west'}"


def _slope(tilt_deg: float) -> str:
    """A tilt as a level shows it."""
    return f"{sensible(1000 * math.tan(math.radians(tilt_deg)))} mm/m"
