"""What each place allows: every criterion for very many candidate places at once, with how much of it is left over."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from geometry.angles import Sector, SectorSet
from geometry.arrays import ArrayLike, BoolArray, FloatArray
from geometry.beams import beam_to, point_at
from geometry.errors import InputError
from geometry.segments import passing
from geometry.solids import Boxes, Cylinders, Solids, Spheres
from geometry.viewshed import Horizon, horizon
from geometry.wake_bins import BINS, WakeModel, disturbed_bins
from planner.exclusion import wanted_directions
from planner.obstruction import margin_m
from planner.placement.areas import allowed_bounds_m, area_slack_m
from planner.placement.echo import echo
from planner.placement.task import Task
from planner.site import Lidar, Site
from planner.wind_climate import error_sources
from planner.wind_rose import share_within
from reconstruct.beam_table import BeamTable, beam_table
from reconstruct.sector_map import sector_variance

GRID = 100  # candidates along each side
REACH_SHARE = 1.5  # of the farthest declared lidar's distance: half the side of the default grid
DEFAULT_REACH_M = 3000.0
FAR_M = 10_000.0  # the pointing part of a beam's margin grows with the range and is taken from here
PROBE_STEP_DEG = (
    2.0  # beams this near to each other see the same wakes: the end of a 43 m probe moves by 0.4 m
)
ARC_PLACES = 1000  # places that are worked on at once
ARC_STEP_M = 30.0  # samples of an arc for wakes; their sectors, 30 degrees wide and more, overlap

CRITERIA: Mapping[str, tuple[str, str]] = {
    "area": ("m", "allowed and forbidden ground"),
    "range-min": ("m", "the blind zone"),
    "range-max": ("m", "the farthest range"),
    "elevation-min": ("deg", "the lowest elevation"),
    "elevation-max": ("deg", "the steepest elevation"),
    "sight": ("m", "rotors, towers, masts and obstacles in the way"),
    "terrain": ("m", "the terrain in the way"),
    "signal": ("share", "rays lost to a weak echo"),
    "wakes": ("share", "wind lost to wakes, beyond what the target itself loses"),
    "opening": ("deg", "the opening angle"),
}
"""Unit and meaning of every criterion."""


class Grid(NamedTuple):
    """Candidate places in rows from north to south."""

    east_m: FloatArray  # (column,)
    north_m: FloatArray  # (row,) descending

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        return len(self.north_m), len(self.east_m)

    @property
    def spacing_m(self) -> float:
        """Distance of neighbours, the larger of both ways [m]."""
        sides = [abs(float(axis[1] - axis[0])) for axis in (self.east_m, self.north_m) if len(axis) > 1]
        return max(sides, default=1.0)

    @property
    def places_m(self) -> FloatArray:
        """(candidate, 2) easting, northing [m]."""
        east, north = np.meshgrid(self.east_m, self.north_m)
        return np.stack([east.ravel(), north.ravel()], axis=-1)


@dataclass(frozen=True, eq=False)
class Look:
    """Every criterion at some places."""

    positions_m: FloatArray  # (place, 3) easting, northing, height of the head
    local_m: FloatArray  # (place, 3) east, north, up from the site's origin
    range_m: FloatArray  # (target, place)
    azimuth_deg: FloatArray  # (target, place)
    elevation_deg: FloatArray  # (target, place)
    lost_share: FloatArray  # (target, place) of the wanted wind, to wakes
    slack: Mapping[
        str, FloatArray
    ]  # criterion to (target, place): how much is left over; negative: not allowed

    @property
    def allowed(self) -> BoolArray:
        """(target, place) where every criterion is kept; what is not known is not kept."""
        return np.asarray(np.logical_and.reduce([values >= 0.0 for values in self.slack.values()]))


def default_grid(task: Task, *, count: int = GRID, reach_m: float | None = None) -> Grid:
    """A grid over the allowed ground, else over a square around the targets.

    Half its side is 1.5 times the distance to the farthest declared lidar of the task, 3 km where there is none, and no
    more than the farthest range; `reach_m` wins over all that. What lies outside the terrain is left out.
    """
    bounds = allowed_bounds_m(task.site)
    if bounds is None:
        low, high = task.targets_m[:, :2].min(axis=0), task.targets_m[:, :2].max(axis=0)
        declared = np.array([lidar.position[:2] for lidar in (*task.fixed, *task.replaced)]).reshape(-1, 2)
        away = np.hypot(*(declared[:, None] - task.targets_m[:, :2]).reshape(-1, 2).T)
        reach = REACH_SHARE * float(away.max()) if away.size else DEFAULT_REACH_M
        reach = min(reach, task.limits.most_range_m) if reach_m is None else reach_m
        bounds = (*(low - reach), *(high + reach))
    west, south, east, north = bounds
    if task.terrain is not None:
        edges = task.terrain.ground.bounds_m
        west, south = max(west, edges[0]), max(south, edges[1])
        east, north = min(east, edges[2]), min(north, edges[3])
    return Grid(np.linspace(west, east, count), np.linspace(north, south, count))


def standing_m(task: Task, places_m: ArrayLike) -> FloatArray:
    """Heads (place, 3) over places (place, 2): on the terrain, NaN where it is not known, else on the site's ground [m]."""
    places = np.asarray(places_m, dtype=np.float64).reshape(-1, 2)
    if task.terrain is None:
        ground = np.full(len(places), task.site.ground_m)
    else:
        ground = task.terrain.ground.heights_m(places[:, 0], places[:, 1])
    return np.column_stack([places, ground + task.head_height_m])


def look(task: Task, positions_m: FloatArray) -> Look:
    """Work out every criterion of heads at (place, 3) easting, northing, height [m]."""
    known = np.isfinite(positions_m[:, 2])
    filled = np.where(
        known[:, None], positions_m, np.column_stack([positions_m[:, :2], 0.0 * positions_m[:, 0]])
    )
    local = task.places.local_m(filled)
    beam = beam_to(task.local_targets_m[:, None] - local)
    limits, shape = task.limits, beam.range_m.shape
    lost = _lost_share(task, local, beam.azimuth_deg, beam.elevation_deg, beam.range_m)
    slack = {
        "area": np.broadcast_to(area_slack_m(task.site, positions_m), shape),
        "range-min": beam.range_m - limits.least_range_m,
        "range-max": limits.most_range_m - beam.range_m,
        "elevation-min": beam.elevation_deg - limits.least_elevation_deg,
        "elevation-max": limits.most_elevation_deg - beam.elevation_deg,
        "sight": _sight_slack_m(task, local, beam.range_m),
        "terrain": _terrain_slack_m(task, positions_m),
        "signal": echo(task.pattern, task.scan, beam.range_m).valid_share - limits.least_valid_share,
        "wakes": limits.most_lost_share - (lost - _lost_at_targets(task)[:, None]),
    }
    slack = {name: np.where(known, values, np.nan) for name, values in slack.items()}
    return Look(positions_m, local, beam.range_m, beam.azimuth_deg, beam.elevation_deg, lost, slack)


def table_of(task: Task, seen: Look, *, lidar: Lidar | None = None) -> BeamTable:
    """What beams from the places looked at contribute to the error: of the lidar that is placed, or of another."""
    lidar = lidar or task.pattern
    return beam_table(
        seen.local_m,
        task.local_targets_m,
        task.lean_climates,
        task.states,
        error_sources(lidar, lidar.radial_speed_noise_mps),
        criterion=task.criterion,
        seen=seen.allowed,
        noise_mps=echo(lidar, task.scan_of(lidar), seen.range_m).noise_mps,
    )


def single_variance(task: Task, seen: Look) -> FloatArray:
    """(target, place) variance of the wind from the sector scan of a lidar there, in the criterion's unit."""
    strong = echo(task.pattern, task.scan, seen.range_m)
    out = [
        sector_variance(
            seen.local_m,
            target,
            task.offsets_deg,
            climate,
            state,
            task.sources,
            criterion=task.criterion,
            noise_mps=noise,
        )
        for target, climate, state, noise in zip(
            task.local_targets_m, task.climates, task.states, strong.noise_mps, strict=True
        )
    ]
    return np.where(seen.allowed, np.stack(out), np.inf)


def of_lidar(task: Task, lidar: Lidar) -> Look:
    """The criteria of a lidar where it stands."""
    return look(task, np.array([lidar.position], dtype=np.float64))


def _sight_slack_m(task: Task, local: FloatArray, range_m: FloatArray) -> FloatArray:
    """(target, place) how far the beams pass everything solid, less how far they may be off [m].

    A mast is only not to be touched: targets stand on masts. A sector has to be free at every ray.
    """
    off = (
        margin_m(task.pattern, 0.0)
        + (margin_m(task.pattern, FAR_M) - margin_m(task.pattern, 0.0)) * range_m / FAR_M
    )
    ends = _ends(task, local)
    slack = np.full(range_m.shape, np.inf)
    for part, solids in _solids(task):
        clear = passing(local[:, None], ends, solids).clearance_m.min(axis=-1)
        slack = np.minimum(slack, clear - (0.0 if part == "mast" else off))
    return slack


def _ends(task: Task, local: FloatArray) -> FloatArray:
    """(target, place, ray, 3) far ends of the beams: the target and half a probe behind it."""
    away = task.local_targets_m[:, None] - local
    beam = beam_to(away)
    reach = (beam.range_m + task.probe.length_m / 2)[..., None]
    offsets = task.offsets_deg if task.single else np.zeros(1)
    rays = point_at(beam.azimuth_deg[..., None] + offsets, beam.elevation_deg[..., None], reach)
    return np.asarray(local[:, None] + rays)


@lru_cache(maxsize=4)
def _solids(task: Task) -> tuple[tuple[str, Solids], ...]:
    """Everything solid on the site, in the local frame."""
    site, places = task.site, task.places
    found: list[tuple[str, Solids]] = []
    if site.turbines:
        bases = places.local_m([turbine.position for turbine in site.turbines])
        rotor = [turbine.rotor_diameter_m / 2 for turbine in site.turbines]
        tower = [turbine.tower_diameter_m / 2 for turbine in site.turbines]
        found.append(("rotor", Spheres(places.hubs_m, rotor)))
        found.append(("tower", Cylinders(bases[:, :2], tower, bases[:, 2], places.hubs_m[:, 2])))
    if site.masts:
        bases = places.local_m([mast.position for mast in site.masts])
        tops = bases[:, 2] + [mast.height_m for mast in site.masts]
        found.append(
            ("mast", Cylinders(bases[:, :2], [m.width_m / 2 for m in site.masts], bases[:, 2], tops))
        )
    if site.obstacles:
        found.append(("obstacle", _boxes(task)))
    return tuple(found)


def _boxes(task: Task) -> Boxes:
    items = task.site.obstacles
    bases = task.places.local_m([item.position for item in items])
    turn = float(task.places.frame.convergence_deg(task.places.origin_m))
    return Boxes(
        bases[:, :2],
        [item.width_m for item in items],
        [item.length_m for item in items],
        [item.azimuth_deg + turn for item in items],
        bases[:, 2],
        bases[:, 2] + [item.height_m for item in items],
    )


def _terrain_slack_m(task: Task, positions_m: FloatArray) -> FloatArray:
    """(target, place) how far the head stands above what it needs to see the target over the ground [m]; NaN: unknown."""
    if task.terrain is None:
        return np.full((len(task.targets), len(positions_m)), np.inf)
    needed = np.stack([sweep.needed_height_m(*positions_m[:, :2].T) for sweep in _horizons(task)])
    with np.errstate(invalid="ignore"):
        slack = positions_m[:, 2] - needed
    return np.where(needed == np.inf, np.nan, slack)


@lru_cache(maxsize=4)
def _horizons(task: Task) -> tuple[Horizon, ...]:
    if task.terrain is None:
        return ()
    return tuple(horizon(task.terrain.top, target) for target in task.targets_m)


def _lost_share(
    task: Task, local: FloatArray, azimuth_deg: FloatArray, elevation_deg: FloatArray, range_m: FloatArray
) -> FloatArray:
    """(target, place) share of the wanted wind in which a wake touches what a lidar there measures."""
    if not task.site.turbines:
        return np.zeros(azimuth_deg.shape)
    if task.single:
        return np.stack(
            [
                _lost_to_arcs(task, local, *beam)
                for beam in zip(azimuth_deg, elevation_deg, range_m, strict=True)
            ]
        )
    ways = _lost_by_way(task)
    which = np.round(azimuth_deg / PROBE_STEP_DEG).astype(np.intp) % ways.shape[1]
    return np.asarray(np.take_along_axis(ways, which, axis=1))


@lru_cache(maxsize=4)
def _lost_at_targets(task: Task) -> FloatArray:
    """(target,) share lost at the target itself, whoever looks at it."""
    if not task.site.turbines:
        return np.zeros(len(task.targets))
    return np.asarray(_touched(task, task.local_targets_m[:, None]) @ _direction_weight(task.site))


@lru_cache(maxsize=4)
def _lost_by_way(task: Task) -> FloatArray:
    """(target, way) share lost by the probe of a beam that looks at a target from one of the ways round, taken as level."""
    azimuth = np.arange(0.0, 360.0, PROBE_STEP_DEG)
    half = task.probe.length_m / 2 * np.array([-1.0, 0.0, 1.0])
    samples = task.local_targets_m[:, None, None] + point_at(azimuth[:, None], 0.0, half)
    weight = _direction_weight(task.site)
    return np.stack([_touched(task, of_target) @ weight for of_target in samples])


def _lost_to_arcs(
    task: Task, local: FloatArray, azimuth_deg: FloatArray, elevation_deg: FloatArray, range_m: FloatArray
) -> FloatArray:
    """(place,) share lost by the arc of a sector scan through a target."""
    half = task.probe.length_m / 2 * np.array([-1.0, 1.0])
    turns = _arc_deg(task, float(range_m.max(initial=1.0)))
    out = np.empty(len(local))
    for start in range(0, len(local), ARC_PLACES):
        part = slice(start, start + ARC_PLACES)
        ranges = np.maximum(range_m[part, None] + half, 0.0)
        points = point_at(
            azimuth_deg[part, None, None] + turns[:, None], elevation_deg[part, None, None], ranges[:, None]
        )
        samples = (local[part, None, None] + points).reshape(len(ranges), -1, 3)
        out[part] = _touched(task, samples) @ _direction_weight(task.site)
    return out


def _arc_deg(task: Task, range_m: float) -> FloatArray:
    """Azimuths of the samples of an arc less that of its axis [deg]."""
    size = float(np.ptp(task.offsets_deg)) + float(getattr(task.scan, "step_deg", 0.0))
    count = max(int(np.ceil(np.radians(size) * range_m / ARC_STEP_M)), 2) + 1
    return np.linspace(-size / 2, size / 2, min(count, 61))


def _touched(task: Task, samples: FloatArray) -> FloatArray:
    wakes = task.site.wakes
    models: tuple[WakeModel, ...] = ("jensen", "iec") if wakes.model == "union" else (wakes.model,)
    found = [
        disturbed_bins(
            task.places.rotors, samples, model=model, decay=wakes.decay, max_diameters=wakes.max_diameters
        )
        for model in models
    ]
    return np.asarray(np.logical_or.reduce(found), dtype=np.float64)


@lru_cache(maxsize=4)
def _direction_weight(site: Site) -> FloatArray:
    """(360,) share of the wanted wind in each degree, the first centred on north; they add up to 1."""
    wanted = wanted_directions(site)
    cells = [SectorSet.of([Sector((angle - 0.5) % 360.0, 1.0)]).intersection(wanted) for angle in range(BINS)]
    weight = np.array([share_within(site, cell) for cell in cells])
    if not weight.sum() > 0:
        raise InputError(
            "no wind comes from the wanted directions; give wind.directions_deg from which it blows"
        )
    return np.asarray(weight / weight.sum())
