"""What is to be placed, for which targets, and what any place has to keep to."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal, NamedTuple

import numpy as np

from geometry.angles import SectorSet
from geometry.arrays import FloatArray
from geometry.disturbed import any_of, iec_excluded, jensen_excluded
from geometry.errors import InputError
from geometry.gates import Probe, unambiguous_range_m, window_ns
from planner.ground import Heights, ground_under_m, heights_of, refuse_unknown
from planner.places import Places
from planner.scan_layout import DEFAULT_FFT_POINTS, DEFAULT_PULSE_NS
from planner.scan_plans import ScanPlan, SectorScan
from planner.site import Lidar, Site
from planner.wind_climate import climate_at, error_sources, state_like
from reconstruct.beam_table import Criterion, condensed
from reconstruct.climate import Climate
from reconstruct.uncertainty import ErrorSources
from reconstruct.wind import WindState

Aggregate = Literal["worst", "mean"]

# Beams that cross at less make an error that small pointing errors double: Vasiljević et al. (2020), Wind Energ. Sci. 5,
# 73-87, doi:10.5194/wes-5-73-2020; 30 degrees is the least of their campaign-planning-tool.
LEAST_OPENING_DEG = 30.0

# The steepest beam for a horizontal wind: at 30 degrees a vertical wind enters with tan 30° = 0.58 of itself.
STEEPEST_DEG = 30.0

# The share of the wanted wind that wakes may take from what is measured beyond what they take from the target itself.
MOST_LOST_SHARE = 0.25

# Rays of which so few are valid make few complete scans.
LEAST_VALID_SHARE = 0.8

# Where a lidar's own height above the ground is not known or not above it.
HEAD_HEIGHT_M = 2.0

# The farthest range of a lidar of which neither gates nor limits are known: what pulsed scanning lidars ordinarily reach.
ORDINARY_RANGE_M = 6000.0


class Limits(NamedTuple):
    """What every place has to keep to."""

    least_range_m: float
    most_range_m: float
    least_elevation_deg: float = -10.0
    most_elevation_deg: float = STEEPEST_DEG
    least_opening_deg: float = LEAST_OPENING_DEG  # of the two beams of a set that cross best, in plan
    most_lost_share: float = MOST_LOST_SHARE  # of the wanted wind, to wakes, beyond the target's own
    least_valid_share: float = (
        LEAST_VALID_SHARE  # of rays whose echo is strong enough, where `signal` is declared
    )


@dataclass(frozen=True, eq=False)
class Task:
    """Lidars to be placed.

    With lidars that stand, or with more than one to place, the wind at a target is made from one beam of each; a single
    lidar makes it from its sector scan.
    """

    site: Site
    targets: tuple[str, ...]
    pattern: Lidar  # what is placed: its instrument and uncertainty; its position is the declared one
    count: int = 1
    fixed: tuple[Lidar, ...] = ()
    scan: ScanPlan | None = None  # the pattern's scan: its probe, gates and sector
    replaced: tuple[Lidar, ...] = ()  # as declared on the site, to compare with
    limits: Limits = field(default_factory=lambda: Limits(0.0, ORDINARY_RANGE_M))
    criterion: Criterion = "vector"
    aggregate: Aggregate = "worst"
    terrain: Heights | None = None
    head_height_m: float = HEAD_HEIGHT_M  # above the ground

    def __post_init__(self) -> None:
        if not self.targets:
            raise InputError("no target is given: a place is good or bad for a target")
        if self.count < 1 or self.count + len(self.fixed) > 4:
            raise InputError(
                f"{self.count} lidars to place and {len(self.fixed)} that stand came; allowed are 1 to 4 in all"
            )
        if self.single and not isinstance(self.scan, SectorScan):
            raise InputError(
                "one lidar alone needs a scan of type sector to measure the wind, and none is declared; declare one, "
                "name a lidar that already stands (--lidar), or place two (--count 2)"
            )
        if self.terrain is not None:
            refuse_unknown(self.terrain.ground, dict(zip(self.targets, self.targets_m, strict=True)))

    @property
    def single(self) -> bool:
        """Whether one lidar alone measures, with its sector scan."""
        return self.count == 1 and not self.fixed

    @cached_property
    def places(self) -> Places:
        """The site's frame and things."""
        return Places(self.site)

    @cached_property
    def targets_m(self) -> FloatArray:
        """(target, 3) in the site's coordinates."""
        return np.array([self.site.target_position_m(name) for name in self.targets], dtype=np.float64)

    @cached_property
    def local_targets_m(self) -> FloatArray:
        """(target, 3) east, north, up from the site's origin [m]."""
        return self.places.local_m(self.targets_m)

    @cached_property
    def climates(self) -> tuple[Climate, ...]:
        """The wind at each target: declared directions, else those free of wakes at the target itself."""
        return tuple(
            climate_at(self.site, name, self._excluded(number)) for number, name in enumerate(self.targets)
        )

    def _excluded(self, number: int) -> SectorSet:
        wakes, point = self.site.wakes, self.local_targets_m[number].reshape(1, 3)
        sets = []
        if wakes.model in ("jensen", "union"):
            sets += jensen_excluded(
                self.places.rotors, point, decay=wakes.decay, max_diameters=wakes.max_diameters
            )
        if wakes.model in ("iec", "union"):
            sets += iec_excluded(self.places.rotors, point, max_diameters=wakes.max_diameters)
        return any_of(sets)

    @cached_property
    def states(self) -> tuple[WindState, ...]:
        """Everything of the wind at each target but speed and direction."""
        return tuple(state_like(self.site, name) for name in self.targets)

    @cached_property
    def lean_climates(self) -> tuple[Climate, ...]:
        """The same wind in as few states as give the same linear-tier mean of the criterion."""
        pairs = zip(self.climates, self.states, strict=True)
        return tuple(condensed(climate, like, self.criterion) for climate, like in pairs)

    @cached_property
    def sources(self) -> ErrorSources:
        """What can be wrong with a lidar that is placed."""
        return error_sources(self.pattern, self.pattern.radial_speed_noise_mps)

    def scan_of(self, lidar: Lidar) -> ScanPlan | None:
        """The scan of a lidar: of the pattern the task's, of another the first that the site declares."""
        if lidar is self.pattern:
            return self.scan
        return next((scan for scan in self.site.scans if scan.lidar == lidar.name), None)

    @cached_property
    def probe(self) -> Probe:
        """The probe of a lidar that is placed."""
        pulse = self.pattern.device.pulse(self.scan.pulse_ns if self.scan else None)
        pulse_ns = (self.scan.pulse_ns if self.scan else None) or (pulse.pulse_ns if pulse else None)
        points = (self.scan.fft_points if self.scan else None) or (pulse.fft_points if pulse else None)
        sample_ns = self.pattern.device.sample_ns
        return Probe(
            pulse_ns=pulse_ns or DEFAULT_PULSE_NS,
            window_ns=window_ns(points or DEFAULT_FFT_POINTS, sample_ns),
        )

    @cached_property
    def offsets_deg(self) -> FloatArray:
        """(ray,) azimuths of a sector's rays less that of its axis [deg]; empty without a sector."""
        if not isinstance(self.scan, SectorScan):
            return np.empty(0)
        steps = round(self.scan.sector_deg / self.scan.step_deg)
        rays = steps if self.scan.motion == "continuous" else steps + 1
        return np.asarray((np.arange(rays) - 0.5 * (rays - 1)) * self.scan.step_deg)


def default_limits(lidar: Lidar, scan: ScanPlan | None) -> Limits:
    """The limits of a lidar, from its instrument and its scan.

    The blind zone is the instrument's, its farthest range the last gate of the scan, else what the instrument reaches
    without ambiguity; elevations are those of the head, and no steeper than 30 degrees.
    """
    device = lidar.device
    pulse = device.pulse(scan.pulse_ns if scan else None)
    known = [device.max_range_m, None if pulse is None else unambiguous_range_m(pulse.pulse_repetition_hz)]
    if scan is not None and scan.gates is not None:
        known.append(scan.gates.first_m + scan.gates.spacing_m * (scan.gates.count - 1))
    reached = [value for value in known if value is not None] or [ORDINARY_RANGE_M]
    low, high = (
        (device.head.elevation_min_deg, device.head.elevation_max_deg) if device.head else (None, None)
    )
    return Limits(
        least_range_m=device.min_range_m or 0.0,
        most_range_m=min(reached),
        least_elevation_deg=-10.0 if low is None else max(low, -10.0),
        most_elevation_deg=STEEPEST_DEG if high is None else min(high, STEEPEST_DEG),
    )


def refuse_twice(kind: str, names: Sequence[str]) -> None:
    """Refuse a name that is given twice: it would count twice.

    Raises
    ------
    InputError
        Naming them.
    """
    twice = sorted({name for name in names if list(names).count(name) > 1})
    if twice:
        raise InputError(f"{kind} {', '.join(twice)} came more than once; give every {kind} once")


def task_of(
    site: Site,
    *,
    fixed: tuple[str, ...] | None = None,
    count: int | None = None,
    targets: tuple[str, ...] = (),
) -> Task:
    """The task that a site suggests.

    Parameters
    ----------
    site
        With targets and lidars.
    fixed
        Names of lidars that already stand. Default: of the site's first pair all but the last lidar; none where there
        is no pair or `count` is given.
    count
        How many to place. Default: one, or two where nothing stands and no sector scan is declared.
    targets
        Names; default: that of the pair, else all.

    Raises
    ------
    InputError
        If the site has no lidar to take as a pattern, or a name is unknown or given twice.
    """
    refuse_twice("lidar", fixed or ())
    if not site.lidars:
        raise InputError("the site has no lidar: one is needed to say which instrument is placed")
    pair = site.pairs[0] if site.pairs else None
    in_pair = [site.scan(name).lidar for name in pair.scans] if pair else []
    if fixed is None:
        fixed = tuple(in_pair[:-1]) if pair and count is None else ()
    sector = next((scan for scan in site.scans if isinstance(scan, SectorScan)), None)
    alone = not fixed and (count == 1 or (count is None and sector is not None))
    number = count or (1 if fixed or alone else 2)
    free = [name for name in in_pair or [lidar.name for lidar in site.lidars] if name not in fixed]
    scan: ScanPlan | None
    if alone and sector is not None:
        pattern, scan = site.lidar(sector.lidar), sector
    else:
        pattern = site.lidar(free[-1] if free else site.lidars[-1].name)
        scan = next((item for item in site.scans if item.lidar == pattern.name), None)
    names = targets or ((pair.target,) if pair and not alone else tuple(item.name for item in site.targets))
    refuse_twice("target", names)
    for name in names:
        site.target(name)
    height_m = pattern.position[2] - float(ground_under_m(site, pattern.position))
    replaced = (pattern,) if number == 1 else tuple(site.lidar(name) for name in free[:number])
    return Task(
        site=site,
        targets=names,
        pattern=pattern,
        count=number,
        fixed=tuple(site.lidar(name) for name in fixed),
        scan=scan,
        replaced=replaced if len(replaced) == number else (),
        limits=default_limits(pattern, scan),
        terrain=heights_of(site),
        head_height_m=height_m if height_m > 0 else HEAD_HEIGHT_M,
    )
