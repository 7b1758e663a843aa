"""The step-stare tour of a site: chosen lidars to chosen points, checked against their limits, timed."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from geometry.arrays import FloatArray
from geometry.beams import Beam, beam_to
from geometry.errors import InputError
from planner.cover import Cover, fewest_discs
from planner.nouns import Position
from planner.places import Places
from planner.scan_making import head_limits
from planner.site import Lidar
from planner.trajectory import Tour, plan_tour

SHOWN_POINTS = 6  # names in one message; the rest is a number


@dataclass(frozen=True)
class Stops:
    """Where a tour stops: named points, in the site's coordinates."""

    names: tuple[str, ...]
    positions: tuple[Position, ...]
    cover: Cover | None = None  # how the points came from the site's targets, if they are not these
    covered: tuple[str, ...] = ()  # the targets that the cover serves, in its order


@dataclass(frozen=True)
class SiteTour:
    """A tour of some lidars through some stops; they leave each together, and the slowest counts."""

    places: Places
    lidars: tuple[Lidar, ...]
    stops: Stops
    accumulation_s: float = 0.0

    @cached_property
    def beams(self) -> tuple[Beam, ...]:
        """For each lidar the true azimuth, elevation and range of every stop (stop,), by the exact model."""
        positions = np.asarray(self.stops.positions, dtype=np.float64)
        return tuple(beam_to(self.places.frame.enu_m(lidar.position, positions)) for lidar in self.lidars)

    @cached_property
    def head_deg(self) -> tuple[FloatArray, FloatArray]:
        """Head azimuth and elevation (lidar, stop) [deg]."""
        angles = [
            self.places.mounting(lidar).to_head(beam.azimuth_deg, beam.elevation_deg)
            for lidar, beam in zip(self.lidars, self.beams, strict=True)
        ]
        return np.array([azimuth for azimuth, _ in angles]), np.array([elevation for _, elevation in angles])

    @cached_property
    def tour(self) -> Tour:
        """The order and its timing.

        Raises
        ------
        InputError
            With every stop that a lidar cannot look at, and every lidar whose head is not described.
        """
        faults = [fault for number in range(len(self.lidars)) for fault in self._faults(number)]
        if faults:
            raise InputError("the tour asks for what its lidars cannot do:\n  " + "\n  ".join(faults))
        heads = [head_limits(lidar) for lidar in self.lidars]
        return plan_tour(*self.head_deg, heads, accumulation_s=self.accumulation_s)

    def _faults(self, number: int) -> list[str]:
        """What one lidar cannot do."""
        lidar, device = self.lidars[number], self.lidars[number].device
        if device.head is None:
            return [f"{lidar.name}: how fast its head ({device.name}) turns is not known; give `head` inline"]
        elevation, reach = self.head_deg[1][number], self.beams[number].range_m
        limits = (
            ("head elevation", elevation, "°", device.head.elevation_min_deg, device.head.elevation_max_deg),
            ("range", reach, " m", device.min_range_m, device.max_range_m),
        )
        found = [self._beyond(lidar, *limit) for limit in limits]
        least_s = device.min_accumulation_s
        if least_s is not None and 0 < self.accumulation_s < least_s:
            found.append(
                f"{lidar.name}: {self.accumulation_s:g} s at a point; allowed: {least_s:g} s or more"
            )
        return [text for text in found if text]

    def _beyond(
        self, lidar: Lidar, what: str, value: FloatArray, unit: str, low: float | None, high: float | None
    ) -> str:
        """Name the stops that are beyond a limit; nothing where none is."""
        least, most = -np.inf if low is None else low, np.inf if high is None else high
        outside = np.flatnonzero((value < least) | (value > most))
        if not outside.size:
            return ""
        named = ", ".join(
            f"{self.stops.names[stop]} ({value[stop]:.2f}{unit})" for stop in outside[:SHOWN_POINTS]
        )
        more = f" and {outside.size - SHOWN_POINTS} more" if outside.size > SHOWN_POINTS else ""
        allowed = f"{least:g} to {most:g}{unit}"
        return f"{lidar.name}: {what} of {named}{more}; allowed: {allowed}. Leave them out or move the lidar"


def site_tour(
    places: Places,
    *,
    lidars: Sequence[str] = (),
    targets: Sequence[str] = (),
    cover_m: float | None = None,
    accumulation_s: float = 0.0,
) -> SiteTour:
    """Plan the tour of a site.

    Parameters
    ----------
    places : Places
        The site in its frame.
    lidars, targets : sequence of str
        Names; none for all.
    cover_m : float, optional
        Stop at the middles of the fewest discs of this radius [m] that cover the targets, not at these.
    accumulation_s : float
        How long the beams stay at each point [s].

    Raises
    ------
    InputError
        If a name is unknown or given twice, there is no lidar or target, or two targets are one place.
    """
    site = places.site
    chosen = tuple(site.lidar(name) for name in lidars) or site.lidars
    wanted = tuple(site.target(name) for name in targets) or site.targets
    if not chosen or not wanted:
        raise InputError(
            f"a tour of {len(chosen)} lidars through {len(wanted)} targets: give at least one of each in the "
            "site file"
        )
    for option, names in (("--lidars", lidars), ("--targets", targets)):
        if len(set(names)) < len(names):
            raise InputError(f"{option} names something twice: {', '.join(names)}; give each once")
    stops = Stops(tuple(item.name for item in wanted), tuple(site.target_position_m(item) for item in wanted))
    return SiteTour(places, chosen, stops if cover_m is None else covered(stops, cover_m), accumulation_s)


def covered(stops: Stops, radius_m: float) -> Stops:
    """Put stops into the middles of the fewest discs of a radius that cover some stops.

    A middle has the mean height of the points that it serves.
    """
    cover = fewest_discs(stops.positions, radius_m)
    heights = np.array([height for _, _, height in stops.positions])
    counts = np.bincount(cover.disc)
    mean_m = np.bincount(cover.disc, weights=heights) / counts
    names = tuple(f"disc {number + 1}" for number in range(len(counts)))
    positions = tuple(
        (float(east), float(north), float(height))
        for (east, north), height in zip(cover.centre_m, mean_m, strict=True)
    )
    return Stops(names, positions, cover, stops.names)
