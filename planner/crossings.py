"""How the beams of a pair meet, from where they really point."""

from itertools import combinations
from typing import NamedTuple

import numpy as np

from geometry.arrays import FloatArray
from geometry.crossing import cross, shared_probe_length_m
from planner.places import Places
from planner.ray_sets import pair_rays
from planner.scan_layout import NO_TARGET_REACH_M, ScanLayout
from planner.site import Pair
from reconstruct.ray_fit import ray_rows
from reconstruct.retrieval import cofactor, condition


class PairCrossing(NamedTuple):
    """Two beams of a pair at their target; of three scans every two."""

    pair: str
    target: str
    scan1: str
    scan2: str
    lidar1: str
    lidar2: str
    opening_angle_deg: float  # in plan, unfolded, 0 to 180; NaN where a beam is vertical
    folded_angle_deg: float  # in plan, 0 to 90
    angle_deg: float  # in three dimensions, 0 to 180
    gap_m: float
    height_difference_m: float  # second beam less first, where they come closest; NaN for parallel beams
    range1_m: float  # from each head to where they come closest; NaN for parallel beams
    range2_m: float
    miss1_m: float  # how far each beam passes the target
    miss2_m: float
    probe1_m: float
    probe2_m: float
    shared_probe_m: float
    point_m: FloatArray  # (3,) half way between the beams, east, north, up from the site's origin
    off_target_m: float  # from there to the target; NaN for parallel beams
    period1_s: float  # from one ray, or scan, to the next
    period2_s: float

    @property
    def shorter_probe_m(self) -> float:
        """The shorter of the two probes [m]."""
        return min(self.probe1_m, self.probe2_m)

    @property
    def worst_aimed(self) -> tuple[str, float]:
        """Lidar whose beam passes the target farther away, and how far [m]."""
        return max((self.lidar1, self.miss1_m), (self.lidar2, self.miss2_m), key=lambda beam: beam[1])


class JointFit(NamedTuple):
    """How well the beams of a pair together tell all three components of the wind apart."""

    pair: str
    target: str
    condition: float  # of the rows; inf where they cannot
    vertical_gain: float  # standard deviation of w for one of each radial speed; NaN where it cannot be told


def joint_fits(places: Places, layouts: tuple[ScanLayout, ...]) -> tuple[JointFit, ...]:
    """Fits of the pairs whose vertical wind is retrieved too."""
    by_name = {layout.name: layout for layout in layouts}
    found = []
    for pair in places.site.pairs:
        if pair.fit_columns == 3:
            rays = pair_rays(places, tuple(by_name[name] for name in pair.scans), pair.target, columns=3)
            matrix = ray_rows(rays)
            gain = float(np.sqrt(cofactor(matrix)[2, 2]))
            found.append(JointFit(pair.name, pair.target, float(condition(matrix)), gain))
    return tuple(found)


def crossings(places: Places, layouts: tuple[ScanLayout, ...]) -> tuple[PairCrossing, ...]:
    """Cross the beams of every pair of the site, in its order."""
    by_name = {layout.name: layout for layout in layouts}
    return tuple(
        cross_scans(places, pair, by_name[first], by_name[second])
        for pair in places.site.pairs
        for first, second in combinations(pair.scans, 2)
    )


def cross_scans(places: Places, pair: Pair, first: ScanLayout, second: ScanLayout) -> PairCrossing:
    """Cross two scans' beams at the pair's target.

    Parameters
    ----------
    places
        Where the site's things stand.
    pair
        Names the target.
    first, second
        Two of its scans; of a scan with several rays the axis counts, of a list of points the target's own.

    Returns
    -------
    PairCrossing
        Where they come closest and at what angle.
    """
    target = places.local_m(places.site.target_position_m(pair.target))
    head1, beam1 = beam_line(places, first, pair.target)
    head2, beam2 = beam_line(places, second, pair.target)
    met = cross(head1, beam1, head2, beam2)
    shared = shared_probe_length_m(met.angle_deg, met.gap_m, first.probe.length_m, second.probe.length_m)
    middle = (met.point1_m + met.point2_m) / 2
    return PairCrossing(
        pair=pair.name,
        target=pair.target,
        scan1=first.name,
        scan2=second.name,
        lidar1=first.lidar.name,
        lidar2=second.lidar.name,
        opening_angle_deg=float(met.opening_angle_deg),
        folded_angle_deg=float(met.folded_angle_deg),
        angle_deg=float(met.angle_deg),
        gap_m=float(met.gap_m),
        height_difference_m=float(met.height_difference_m),
        range1_m=float(met.range1_m),
        range2_m=float(met.range2_m),
        miss1_m=_miss_m(head1, beam1, target),
        miss2_m=_miss_m(head2, beam2, target),
        probe1_m=first.probe.length_m,
        probe2_m=second.probe.length_m,
        shared_probe_m=float(shared),
        point_m=middle,
        off_target_m=float(np.linalg.norm(middle - target)),
        period1_s=first.scan.period_s,
        period2_s=second.scan.period_s,
    )


def beam_line(places: Places, layout: ScanLayout, target: str) -> tuple[FloatArray, FloatArray]:
    """Head and direction of the beam with which a scan looks at a target.

    Returns
    -------
    tuple of FloatArray
        Head (3,) [m] and unit vector (3,), east, north, up from the site's origin.
    """
    azimuth_deg, elevation_deg = layout.beam_at(target)
    reach_m = layout.range_to_m(target) if target in layout.targets else NO_TARGET_REACH_M
    head, ahead = places.beam_local_m(layout.lidar, azimuth_deg, elevation_deg, np.array([0.0, reach_m]))
    return head, (ahead - head) / np.linalg.norm(ahead - head)


def _miss_m(head: FloatArray, beam: FloatArray, target: FloatArray) -> float:
    """Distance of a point from a beam [m]."""
    return float(np.linalg.norm(np.cross(target - head, beam)))
