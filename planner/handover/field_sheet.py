"""The field sheet: one printable page for each lidar, for whoever stands at the tripod.

Names in a site file are untrusted text; every one reaches the page through the template's escaping, and the
page's content security policy lets nothing load or run.
"""

from collections.abc import Sequence
from typing import Any, Literal, NamedTuple

import numpy as np

from geometry.angles import wrap_360_deg
from geometry.beams import beam_to
from geometry.errors import InputError
from planner import palette
from planner.cnr_window import WINDOW_STDS
from planner.handover.head_path import head_path
from planner.handover.sheet_words import level_rows, magnetic_deg, north_rows, position_rows, steps
from planner.hard_targets import expected, sought
from planner.places import Places
from planner.plan import Plan
from planner.report_values import DASH, Column, Table, Value, fixed, sensible
from planner.scan_layout import ScanLayout
from planner.site import Lidar

AIRY_ROWS = 14  # more are set closer, so that 30 or so still fit one page of A4

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
    Column("window_azimuth_deg", "search ± az.", "", 2),
    Column("window_elevation_deg", "search ± el.", "", 2),
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
    window_azimuth_deg: float | None = None  # of a hard target: how far to search to each side
    window_elevation_deg: float | None = None


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
    from markupsafe import Markup

    sheets = sheet_html(plan, declination_deg=declination_deg)
    # both are made by templates that escape every name
    return _render("field_sheet.html.j2", site=plan.site, style=Markup(sheet_style()), sheets=Markup(sheets))


def sheet_style() -> str:
    """The style of sheets; it touches nothing else on a page that they are part of."""
    return _render("sheet_style.css.j2", palette=palette)


def sheet_html(
    plan: Plan, *, declination_deg: float | None = None, heading: Literal["h1", "h4"] = "h1"
) -> str:
    """Write the sheets of all lidars by themselves, for a page of its own or as part of another.

    Parameters
    ----------
    plan, declination_deg
        As in `field_sheet_html`.
    heading
        Tag of the lidars' names.

    Raises
    ------
    InputError
        If the site has no lidar.
    """
    if not plan.site.lidars:
        raise InputError(
            "the site has no lidar: there is no field sheet to write; add lidars to the site file"
        )
    sheets = [sheet(plan, lidar, declination_deg=declination_deg) for lidar in plan.site.lidars]
    return _render("sheet.html.j2", site=plan.site, sheets=sheets, heading=heading)


def _render(name: str, **values: object) -> str:
    """A template of ours, which refuses what is not given and escapes what is."""
    from importlib.resources import files

    from jinja2 import Environment, StrictUndefined

    environment = Environment(
        autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    source = files("planner.templates").joinpath(name).read_text(encoding="utf-8")
    return environment.from_string(source).render(**values)


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
        "dense": len(targets) + len(hard) + len(scans) > AIRY_ROWS,
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
    if declared:
        things = [(item.name, f"{item.shape}, {item.size_m:g} m") for item in site.hard_targets]
    else:
        things = [(mast.name, "top") for mast in site.masts] + [(item.name, "hub") for item in site.turbines]
    found = []
    for name, what in things:
        target, position = sought(site, name)
        seen = expected(places, lidar, position, target.uncertainty_m)
        there = sight(places, lidar, name, what, position, scans=scans, declination_deg=declination_deg)
        found.append(
            there._replace(
                gate_centre_m=None,
                window_azimuth_deg=WINDOW_STDS * seen.azimuth_std_deg,
                window_elevation_deg=WINDOW_STDS * seen.elevation_std_deg,
            )
        )
    return found, declared


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
