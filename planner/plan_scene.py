"""Plan -> Scene: what stands on the site, where beams go and what they measure, in its local metres."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import count

import numpy as np

from geometry.arrays import FloatArray
from geometry.beams import beam_to
from geometry.crossing import cross
from geometry.errors import InputError
from planner.crossings import PairCrossing, beam_line
from planner.ground import heights_of
from planner.obstruction import lost_ranges_m, reach_m
from planner.palette import EXCLUDED, OBSTACLE, WAKE_DIAMETERS, lidar_colour
from planner.plan import Plan
from planner.scan_layout import ScanLayout
from planner.scan_plans import PointsScan, RasterScan
from planner.scene import Label, Layer, Points, Scene, beam_layers, layers, views
from planner.scene.model import View, positions_m
from planner.scene.structures import obstacle

UP = np.array([0.0, 0.0, 1.0])
GROUND_M = 0.0  # the site's local frame has its origin at ground level
RING_SHARE = (0.8, 1.0)  # inner and outer radius of the excluded directions, of `ring_m`
RING_OF_RANGE = 0.2  # outer radius, as a share of the range to the target
CLOSE_UP_M = 150.0  # half of what is seen around the first target
ASPECT = 1.2  # width of the overview over its height
FIELD_DEG = 45.0  # vertical field of view: plotly's own, so that page and picture begin alike
LONGEST = 20  # characters of a name in the scene; the tables have it whole
SHORTEST = 8  # of a name beside a text that has to be read whole
ROOM = 0.09  # share of the overview left free on each side, for names at its border
RING_LIFT = 0.02  # of the ring's radius: nearer to the ground it flickers in a browser
WAKE_LIFT_M = 0.5  # wakes end above the ground: two surfaces in one place flicker
AWAY_NEAR = ("wakes", "excluded", "north and scale")  # layers that would cover the close-up
HILLS_CELLS = 161  # of the terrain along each side of what is drawn
HILLS_MARGIN = 0.1  # of the longer side, that is added all round
MOST_RAYS = 400  # a scan of more is drawn with every so manieth ray


def plan_scene(plan: Plan) -> Scene:
    """Build the 3-D scene of a plan; heights are above the site's ground.

    Raises
    ------
    InputError
        If the site has nothing that could be drawn.
    """
    standing = [
        *_scans(plan),
        *_targets(plan),
        *_structures(plan),
        *_wakes(plan),
        *_lost(plan),
        *_crossings(plan),
    ]
    if not standing:
        raise InputError("the site has nothing to draw: give at least one lidar, mast, turbine or target")
    hills = list(_hills(plan, standing))
    ground = _ground(standing, hills)
    named = np.stack([label.at_m for layer in standing for label in layer.labels])
    points = np.concatenate([positions_m(item) for layer in (*standing, ground[-1]) for item in layer.items])
    wind_deg = plan.prevailing_deg
    turned = bool(plan.site.turbines) and bool(np.isfinite(wind_deg))
    side_deg = views.azimuth_of_deg(views.overview(points, named, facing_deg=wind_deg if turned else None))
    overview = views.view_from(
        "overview",
        points,
        side_deg,
        views.OVERVIEW_ELEVATION_DEG,
        aspect=ASPECT,
        view_angle_deg=FIELD_DEG,
        margin=ROOM,
    )
    around = [*_excluded(plan)]
    drawn = _named_shortly([*ground, *hills, *around, *standing])
    hidden = tuple(layer.name for layer in drawn if layer.name.startswith(AWAY_NEAR))
    note = f"wakes and rotors in the prevailing wanted wind, from {wind_deg:.0f}°" if turned else ""
    return Scene(
        _short(plan.site.name, 2 * LONGEST), drawn, (overview, *_close_ups(plan, overview, hidden)), note=note
    )


def _ground(standing: Sequence[Layer], hills: Sequence[Layer]) -> tuple[Layer, ...]:
    """Plane, grid, arrow and scale bar; under a terrain the plane lies below it, and the marks above."""
    if not hills:
        return layers.ground_layers(standing, height_m=GROUND_M)
    up = np.concatenate([positions_m(item)[:, 2] for layer in hills for item in layer.items])
    _, _, marks = layers.ground_layers(standing, height_m=float(up.min()), mark_height_m=float(up.max()))
    return (marks,)


def _hills(plan: Plan, standing: Sequence[Layer]) -> Iterator[Layer]:
    """The terrain under what stands, with canopy and buildings, on a grid of the local frame."""
    heights = heights_of(plan.site)
    if heights is None:
        return
    points = np.concatenate([positions_m(item) for layer in standing for item in layer.items])[:, :2]
    low, high = points.min(axis=0), points.max(axis=0)
    border = HILLS_MARGIN * float((high - low).max())
    east, north = (np.linspace(low[i] - border, high[i] + border, HILLS_CELLS) for i in (0, 1))
    flat = np.stack([*np.meshgrid(east, north), np.zeros((HILLS_CELLS, HILLS_CELLS))], axis=-1)
    places = plan.exact_places
    spots = places.frame.projected_m(places.origin_m, flat)
    spots[..., 2] = heights.top.heights_m(spots[..., 0], spots[..., 1])
    known = np.isfinite(spots[..., 2])
    if known.any():
        up = places.local_m(np.where(known[..., None], spots, places.origin_m))[..., 2]
        yield layers.terrain_layer(east, north, np.where(known, up, np.nan))


def _named_shortly(drawn: Sequence[Layer]) -> tuple[Layer, ...]:
    """Names and labels that leave room for the scene, and no layer's name twice."""
    named: list[Layer] = []
    for layer in drawn:
        name = _short(layer.name, 2 * LONGEST)
        items = tuple(
            replace(item, text=_short(item.text, 2 * LONGEST)) if isinstance(item, Label) else item
            for item in layer.items
        )
        named.append(replace(layer, name=_other(name, {other.name for other in named}), items=items))
    return tuple(named)


def _other(name: str, taken: set[str]) -> str:
    """The name, with a number where it is taken already."""
    numbered = (name if number == 1 else f"{name} ({number})" for number in count(1))
    return next(text for text in numbered if text not in taken)


def _short(text: str, longest: int = LONGEST) -> str:
    return text if len(text) <= longest else text[: longest - 1].rstrip() + "…"


def _local_directions(
    plan: Plan, layout: ScanLayout, rays: slice
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Head (3,), azimuths and elevations (ray,) of a scan in the site's frame; its up is not the lidar's."""
    scan = layout.scan
    ends = plan.places.beam_local_m(
        layout.lidar,
        scan.azimuth_deg[rays],
        scan.elevation_deg[rays],
        np.full(len(scan.azimuth_deg[rays]), 1000.0),
    )
    head = plan.places.local_m(layout.lidar.position)
    beam = beam_to(ends - head)
    return head, beam.azimuth_deg, beam.elevation_deg


def _scans(plan: Plan) -> Iterator[Layer]:
    named: set[str] = set()
    for layout in plan.layouts:
        layer = _scan(plan, layout)
        if layout.lidar.name in named:  # a lidar with two scans has one name and one dot
            kept = tuple(
                item
                for item in layer.items
                if not isinstance(item, Label) and not (isinstance(item, Points) and item.is_symbol)
            )
            layer = replace(layer, items=kept)
        named.add(layout.lidar.name)
        yield layer


def _scan(plan: Plan, layout: ScanLayout) -> Layer:
    colour = lidar_colour(layout.lidar_index)
    step = -(-layout.scan.count // MOST_RAYS)
    head, azimuth_deg, elevation_deg = _local_directions(plan, layout, slice(None, None, step))
    seen_m = float(reach_m(layout).max())
    last_m = max(layout.gates.last_m, seen_m) if layout.gates else seen_m
    measured_m, probe_m = layout.target_range_m or last_m, layout.probe.length_m
    if layout.scan.count == 1:
        return beam_layers.stare_layer(
            _short(layout.lidar.name),
            colour,
            head,
            float(azimuth_deg[0]),
            float(elevation_deg[0]),
            gate_ranges_m=layout.gates.centres_m if layout.gates else [measured_m],
            measured_range_m=measured_m,
            probe_length_m=probe_m,
            ground_m=GROUND_M,
            scan=_short(layout.name),
        )
    if isinstance(layout.spec, PointsScan | RasterScan):
        return beam_layers.spokes_layer(
            _short(layout.lidar.name),
            colour,
            head,
            azimuth_deg,
            elevation_deg,
            measured_range_m=reach_m(layout)[::step] - probe_m / 2,
            probe_length_m=probe_m,
            scan=_short(layout.name),
        )
    return beam_layers.fan_layer(
        _short(layout.lidar.name),
        colour,
        head,
        azimuth_deg,
        elevation_deg,
        reach_m=last_m,
        measured_range_m=measured_m,
        probe_length_m=probe_m,
        closed=layout.spec.type == "ppi",
        scan=_short(layout.name),
    )


def _lost(plan: Plan) -> Iterator[Layer]:
    """What the rays of all scans do not see behind something solid, in one layer."""
    ends = [_lost_ends_m(plan, layout) for layout in plan.layouts]
    lost = np.concatenate([np.empty((0, 2, 3)), *ends])
    if len(lost):
        yield beam_layers.lost_layer(lost[:, 0], lost[:, 1], hover="lost behind something solid")


def _lost_ends_m(plan: Plan, layout: ScanLayout) -> FloatArray:
    """(lost ray, 2, 3) where each lost ray meets something solid, and where it should have measured [m]."""
    step = -(-layout.scan.count // MOST_RAYS)
    met_m, wanted_m = lost_ranges_m(plan.obstructions, layout)[::step], reach_m(layout)[::step]
    lost = met_m < wanted_m
    ends = [
        plan.places.beam_local_m(
            layout.lidar,
            layout.scan.azimuth_deg[::step][lost],
            layout.scan.elevation_deg[::step][lost],
            range_m[lost],
        )
        for range_m in (met_m, wanted_m)
    ]
    return np.stack(ends, axis=1)


def _targets(plan: Plan) -> Iterator[Layer]:
    """Targets that no mast carries, with their names: a mast's name says enough."""
    free = [target for target in plan.site.targets if target.mast is None]
    idle = [lidar for lidar in plan.site.lidars if all(spec.lidar != lidar.name for spec in plan.site.scans)]
    for name, colour, things in (
        ("targets", "#111111", [(target.name, plan.site.target_position_m(target)) for target in free]),
        ("lidars without a scan", "#52606d", [(lidar.name, lidar.position) for lidar in idle]),
    ):
        spots = [plan.places.local_m(position) for _, position in things]
        if spots:
            dots = Points(np.stack(spots), size_px=12.0, hover=tuple(text for text, _ in things))
            yield Layer(
                name,
                colour,
                (dots, *(Label(_short(text), at) for (text, _), at in zip(things, spots, strict=True))),
            )


def _structures(plan: Plan) -> Iterator[Layer]:
    site, local = plan.site, plan.places.local_m
    if site.masts:
        bases = local([mast.position for mast in site.masts])
        yield layers.mast_layer(
            [_short(mast.name) for mast in site.masts],
            bases,
            [mast.height_m for mast in site.masts],
            [mast.width_m for mast in site.masts],
        )
    if site.turbines:
        yield layers.turbine_layer(
            [_short(turbine.name) for turbine in site.turbines],
            local([turbine.position for turbine in site.turbines]),
            [turbine.hub_height_m for turbine in site.turbines],
            [turbine.rotor_diameter_m for turbine in site.turbines],
            [turbine.tower_diameter_m for turbine in site.turbines],
            wind_from_deg=plan.prevailing_deg if np.isfinite(plan.prevailing_deg) else 0.0,
        )
    if site.obstacles:
        boxes = [
            obstacle(
                local(item.position),
                width_m=item.width_m,
                length_m=item.length_m,
                height_m=item.height_m,
                azimuth_deg=item.azimuth_deg + plan.convergence_deg,
            )
            for item in site.obstacles
        ]
        names = [
            Label(_short(item.name), local(item.position) + item.height_m * UP, rank=2)
            for item in site.obstacles
        ]
        yield Layer("obstacles", OBSTACLE, (*boxes, *names))


def _wakes(plan: Plan) -> Iterator[Layer]:
    """Wakes in the prevailing wind; of what blows from everywhere alike none is drawn."""
    turbines, wind_deg = plan.site.turbines, plan.prevailing_deg
    if turbines and np.isfinite(wind_deg):
        diameters = [turbine.rotor_diameter_m for turbine in turbines]
        yield layers.wake_layer(
            [_short(turbine.name) for turbine in turbines],
            plan.places.hubs_m,
            diameters,
            wind_from_deg=round(wind_deg),
            decay=plan.site.wakes.decay,
            length_m=WAKE_DIAMETERS * max(diameters),
            ground_m=GROUND_M + WAKE_LIFT_M,
        )


def _excluded(plan: Plan) -> Iterator[Layer]:
    """Around the target of the scan that wakes take most from, the directions in which they do."""
    items = [item for item in plan.exclusions if item.excluded.sectors]
    if items:
        worst = max(items, key=lambda item: item.excluded.width_deg)
        target = plan.places.local_m(plan.site.target_position_m(worst.target))
        radius_m = RING_OF_RANGE * worst.range_m
        yield layers.direction_layer(
            "excluded",
            EXCLUDED,
            [target[0], target[1], GROUND_M + RING_LIFT * radius_m],
            RING_SHARE[1] * radius_m,
            [(sector.from_deg, sector.width_deg) for sector in worst.excluded.sectors],
            inner_m=RING_SHARE[0] * radius_m,
            about="winds with a wake in what is measured",
        )


def _crossings(plan: Plan) -> Iterator[Layer]:
    """Where the beams of each pair come closest, all in one layer; parallel beams nowhere."""
    met = [layer for crossing in plan.crossings for layer in _crossing(plan, crossing)]
    if met:
        yield replace(met[0], name="crossings", items=tuple(item for layer in met for item in layer.items))


def _crossing(plan: Plan, met: PairCrossing) -> Iterator[Layer]:
    lines = [beam_line(plan.places, plan.layout[name], met.target) for name in (met.scan1, met.scan2)]
    points = cross(*lines[0], *lines[1])
    if np.all(np.isfinite([points.point1_m, points.point2_m])):
        yield beam_layers.crossing_layer(
            "crossing", _met(plan, met), points.point1_m, points.point2_m, ground_m=GROUND_M
        )


def _met(plan: Plan, met: PairCrossing) -> str:
    """What is written where two beams meet: the gap, or how far they pass the target where that matters more."""
    miss_m = met.worst_aimed[1]
    if miss_m <= plan.site.tolerance.position_m:
        return f"{_short(met.pair)}: {met.opening_angle_deg:.0f}°, gap {met.gap_m:.1f} m"
    return f"{_short(met.pair, SHORTEST)}: {met.opening_angle_deg:.0f}°, misses target by {miss_m:.0f} m"


def _close_ups(plan: Plan, overview: View, hidden: tuple[str, ...]) -> Iterator[View]:
    """A second view, of the first target."""
    if plan.site.targets:
        target = plan.places.local_m(plan.site.target_position_m(plan.site.targets[0]))
        yield views.close_up(
            target,
            CLOSE_UP_M,
            views.azimuth_of_deg(overview),
            name=f"at {_short(plan.site.targets[0].name)}",
            without=hidden,
        )
