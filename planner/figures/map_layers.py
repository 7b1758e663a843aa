"""The layers of the plan map: scans, lost rays, wakes, excluded directions, things and opening angles."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from geometry.angles import SectorSet, difference_deg
from geometry.arrays import FloatArray
from geometry.beams import beam_to
from geometry.wakes import wake_outline_m
from planner.crossings import beam_line
from planner.exclusion import Exclusion
from planner.figures.names import Name, shown
from planner.obstruction import lost_ranges_m
from planner.palette import (
    CROSSING,
    EXCLUDED,
    INK,
    INK_SOFT,
    MAST,
    OBSTACLE,
    PAPER,
    TURBINE,
    WAKE,
    WAKE_DIAMETERS,
    lidar_colour,
)
from planner.plan import Plan
from planner.scan_layout import ScanLayout
from planner.scan_plans import PointsScan

if TYPE_CHECKING:
    from matplotlib.axes import Axes

ARC_SHARE = 0.15  # of the shorter beam: radius of the opening angle's arc
RING_SHARE = (0.055, 0.075)  # of the map's side: inner and outer radius of the ring of excluded directions
SAMPLES = 60  # along a line that names had better not cover
FEW_RAYS = 120  # more are drawn as an area only

CIRCLE = np.linspace(0.0, 2 * np.pi, 73)


@dataclass
class Layer:
    """What a layer leaves for the map to finish: corners, names to place, lines to keep free, a legend."""

    corners: list[FloatArray] = field(default_factory=list)  # each (n, 2), metres east and north
    names: list[Name] = field(default_factory=list)
    busy: list[FloatArray] = field(default_factory=list)  # each (n, 2)
    legend: list[tuple[Any, str]] = field(default_factory=list)


def toward(azimuth_deg: FloatArray | float) -> FloatArray:
    """Unit vectors (..., 2) east and north toward an azimuth."""
    turn = np.deg2rad(np.asarray(azimuth_deg, dtype=np.float64))
    return np.stack([np.sin(turn), np.cos(turn)], axis=-1)


def along(start: FloatArray, end: FloatArray) -> FloatArray:
    """Samples (n, 2) along a line."""
    return np.asarray(start + np.linspace(0.0, 1.0, SAMPLES)[:, None] * (end - start), dtype=np.float64)


def scans(plan: Plan, axes: "Axes") -> Iterator[Layer]:
    """Every scan: its rays up to the measured gate, the gate's probe or arc, what is lost behind solids."""
    stares: dict[str, Any] = {}
    for layout in plan.layouts:
        if isinstance(layout.spec, PointsScan) or layout.scan.count > 1:
            yield (
                _points(plan, axes, layout)
                if isinstance(layout.spec, PointsScan)
                else _fan(plan, axes, layout)
            )
            continue
        layer = _stare(plan, axes, layout)
        lidar = layout.lidar.name
        stares.setdefault(lidar, (layer.legend[0][0], []))[1].append(
            layout.targets[0] if layout.targets else layout.name
        )
        layer.legend.clear()
        yield layer
    yield Layer(
        legend=[
            (line, f"stare of {shown(lidar)} at {shown(', '.join(to))}")
            for lidar, (line, to) in stares.items()
        ]
    )


def _fan(plan: Plan, axes: "Axes", layout: ScanLayout) -> Layer:
    colour, reach_m = lidar_colour(layout.lidar_index), layout.drawn_reach_m
    azimuth_deg, elevation_deg = layout.edges_deg()
    head = plan.places.local_m(layout.lidar.position)[:2]
    arc = plan.places.beam_local_m(
        layout.lidar, azimuth_deg, elevation_deg, np.full(len(azimuth_deg), reach_m)
    )[:, :2]
    ring = np.vstack([head, arc, head])
    (area,) = axes.fill(ring[:, 0], ring[:, 1], color=colour, alpha=0.10, linewidth=0, zorder=2)
    lost_m = lost_ranges_m(plan.obstructions, layout)
    for end, lost in zip(arc[1:-1], lost_m, strict=True):
        if layout.scan.count <= FEW_RAYS:
            stop = head + (end - head) * min(lost / reach_m, 1.0)
            axes.plot(
                [head[0], stop[0]], [head[1], stop[1]], color=colour, linewidth=0.5, alpha=0.45, zorder=3
            )
    axes.plot(arc[:, 0], arc[:, 1], color=colour, linewidth=2.2, zorder=4)
    lost = _lost(axes, head, arc[1:-1], lost_m / reach_m)
    edge = along(head, arc[0]), along(head, arc[-1])
    legend = [
        (
            area,
            f"{layout.spec.type} scan “{shown(layout.name)}” of {shown(layout.lidar.name)}; "
            f"arc: gate at {reach_m:.0f} m",
        ),
        *lost,
    ]
    return Layer([np.vstack([head, arc])], [], [*edge, arc], legend)


def _lost(axes: "Axes", head: FloatArray, ends: FloatArray, share: FloatArray) -> list[tuple[Any, str]]:
    """Draw what rays do not see behind something solid; share (ray,) of the way to it."""
    shown_lines: list[Any] = []
    for end, part in zip(ends, share, strict=True):
        if part < 1:
            start = head + part * (end - head)
            shown_lines += axes.plot(
                [start[0], end[0]],
                [start[1], end[1]],
                color=EXCLUDED,
                linewidth=1.1,
                linestyle=(0, (3, 2)),
                zorder=5,
            )
    return [(shown_lines[0], "lost behind something solid or the ground")] if shown_lines else []


def _stare(plan: Plan, axes: "Axes", layout: ScanLayout) -> Layer:
    """One ray, and the probe of its measured gate."""
    return _ray(plan, axes, layout, 0, layout.drawn_reach_m, 1.8)


def _points(plan: Plan, axes: "Axes", layout: ScanLayout) -> Layer:
    """A ray to each of the scan's targets with its gate: nothing is measured between them."""
    rays = [
        _ray(plan, axes, layout, ray, layout.measured_range_m(float(range_m)), 0.9)
        for ray, range_m in enumerate(layout.aim.range_m)
    ]
    text = f"points “{shown(layout.name)}” of {shown(layout.lidar.name)}; thick: the gate at each"
    lost = [entry for ray in rays for entry in ray.legend[1:]]
    return Layer(
        [corner for ray in rays for corner in ray.corners],
        [],
        [line for ray in rays for line in ray.busy],
        [(rays[0].legend[0][0], text), *lost],
    )


def _ray(plan: Plan, axes: "Axes", layout: ScanLayout, ray: int, reach_m: float, linewidth: float) -> Layer:
    """One ray of a scan, and the probe of its measured gate as a thick piece of it."""
    colour, half_m = lidar_colour(layout.lidar_index), layout.probe.length_m / 2
    ranges_m = np.array([0.0, reach_m - half_m, reach_m + half_m, reach_m])
    azimuth_deg, elevation_deg = layout.scan.azimuth_deg[ray], layout.scan.elevation_deg[ray]
    points = plan.places.beam_local_m(layout.lidar, azimuth_deg, elevation_deg, ranges_m)[:, :2]
    lost = lost_ranges_m(plan.obstructions, layout)[ray]
    stop = points[0] + (points[3] - points[0]) * min(lost / reach_m, 1.0)
    (line,) = axes.plot(*np.stack([points[0], stop]).T, color=colour, linewidth=linewidth, zorder=4)
    axes.plot(*points[1:3].T, color=colour, linewidth=6, alpha=0.6, solid_capstyle="butt", zorder=5)
    legend = [(line, layout.name), *_lost(axes, points[0], points[3:], np.array([lost / reach_m]))]
    return Layer([points], [], [along(points[0], points[3])], legend)


def wakes(plan: Plan, axes: "Axes") -> Iterator[Layer]:
    """Wakes in the prevailing wind, for their size; which directions they take say ring and rose."""
    wind_deg = plan.prevailing_deg
    if not plan.site.turbines or np.isnan(wind_deg):
        return
    drawn = []
    for hub, turbine in zip(plan.places.hubs_m, plan.site.turbines, strict=True):
        outline = wake_outline_m(
            hub,
            turbine.rotor_diameter_m,
            wind_deg,
            decay=plan.site.wakes.decay,
            length_m=WAKE_DIAMETERS * turbine.rotor_diameter_m,
        )
        drawn += axes.fill(*outline.polygon_m[:, :2].T, color=WAKE, alpha=0.13, linewidth=0, zorder=1)
    text = f"wakes in the prevailing wanted wind, from {wind_deg:.0f}°, {WAKE_DIAMETERS} diameters long"
    yield Layer(legend=[(drawn[0], text)])


def most_lost(plan: Plan) -> list[Exclusion]:
    """Of each target the exclusion of the scan that wakes take most from; without wakes none."""
    most: dict[str, Exclusion] = {}
    for item in plan.exclusions:
        if item.excluded.sectors and (
            item.target not in most or item.excluded.width_deg > most[item.target].excluded.width_deg
        ):
            most[item.target] = item
    return list(most.values())


def excluded_rings(plan: Plan, axes: "Axes", side_m: float) -> Iterator[Layer]:
    """Around each target the directions from which a wake reaches what its worst-off scan measures."""
    from matplotlib.patches import Wedge

    inner_m, outer_m = (share * side_m for share in RING_SHARE)
    for number, item in enumerate(most_lost(plan)):
        centre = plan.places.local_m(plan.site.target_position_m(item.target))[:2]
        patch: Any = None
        for sectors, colour, alpha in ((SectorSet.full(), INK_SOFT, 0.10), (item.excluded, EXCLUDED, 0.45)):
            for sector in sectors.sectors:
                start = (
                    90.0 - sector.from_deg - sector.width_deg
                )  # matplotlib counts counter-clockwise from east
                patch = Wedge(
                    tuple(centre),
                    outer_m,
                    start,
                    start + sector.width_deg,
                    width=outer_m - inner_m,
                    color=colour,
                    alpha=alpha,
                    linewidth=0,
                    zorder=3,
                )
                axes.add_patch(patch)
        circle = centre + outer_m * toward(np.arange(0.0, 360.0, 6.0))
        text = "ring: wind from here brings a wake into what is measured (the scan that loses most)"
        yield Layer(busy=[circle], legend=[(patch, text)] if number == 0 else [])


def things(plan: Plan, axes: "Axes") -> Layer:
    """Lidars, masts, turbines, obstacles and targets with their names."""
    layer, site, places = Layer(), plan.site, plan.places

    def mark(
        name: str, position: tuple[float, float, float], marker: str, colour: str, size: float, rank: int
    ) -> None:
        here = places.local_m(position)[:2]
        axes.plot(
            *here,
            marker=marker,
            color=colour,
            markersize=size,
            markeredgecolor=PAPER,
            markeredgewidth=0.8,
            zorder=7,
            linestyle="none",
        )
        layer.corners.append(here[None])
        layer.names.append(Name(shown(name), here, colour, rank))

    for hub, turbine in zip(places.hubs_m, site.turbines, strict=True):
        circle = hub[:2] + turbine.rotor_diameter_m / 2 * np.stack([np.sin(CIRCLE), np.cos(CIRCLE)], axis=-1)
        layer.legend = [
            (axes.plot(*circle.T, color=TURBINE, linewidth=1.0, zorder=5)[0], "rotors, turned to any wind")
        ]
        layer.corners.append(circle)
        mark(turbine.name, turbine.position, "o", INK_SOFT, 5, 2)
    for obstacle in site.obstacles:
        mark(obstacle.name, obstacle.position, "s", OBSTACLE, 6, 2)
    for mast in site.masts:
        mark(mast.name, mast.position, "^", MAST, 8, 1)
    for number, lidar in enumerate(site.lidars):
        mark(lidar.name, lidar.position, "D", lidar_colour(number), 8, 0)
    for target in site.targets:
        mark(target.name, site.target_position_m(target), "*", CROSSING, 10, 1)
    return layer


def opening_angles(plan: Plan, axes: "Axes") -> Iterator[Layer]:
    """The opening angle of each pair, as an arc between its beams."""
    for met in plan.crossings:
        target = plan.places.local_m(plan.site.target_position_m(met.target))
        heads = [beam_line(plan.places, plan.layout[name], met.target)[0] for name in (met.scan1, met.scan2)]
        first, second = (beam_to(head - target) for head in heads)
        start, turn = (
            float(first.azimuth_deg),
            float(difference_deg(float(second.azimuth_deg), float(first.azimuth_deg))),
        )
        radius_m = ARC_SHARE * min(float(first.range_m), float(second.range_m))
        arc = target[:2] + radius_m * toward(start + np.linspace(0.0, turn, 40))
        axes.plot(*arc.T, color=INK, linewidth=1.2, zorder=6)
        yield Layer([], [Name(f"{met.opening_angle_deg:.0f}°", arc[20], INK, 0, 10.0)], [arc])
