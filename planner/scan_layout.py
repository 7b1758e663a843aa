"""A scan of the site file laid out in space: where it points, its rays and times, its gates and its probe."""

from dataclasses import dataclass

import numpy as np

from geometry.arrays import FloatArray
from geometry.beams import Beam, beam_to, unit_vector
from geometry.errors import InputError
from geometry.gates import Gates, Probe, unambiguous_range_m, window_ns
from geometry.head import Mounting
from geometry.scans import Scan
from geometry.volumes import arc_volume_m
from planner.instruments import Pulse
from planner.places import Places
from planner.scan_making import head_limits, make_scan
from planner.scan_plans import PointsScan, RasterScan, RhiScan, ScanPlan
from planner.site import Lidar

# Where neither scan nor instrument says: the pulse and FFT of the reference study's scanners.
DEFAULT_PULSE_NS = 200.0
DEFAULT_FFT_POINTS = 64

# A beam to a target nearer than this has no direction worth the name.
LEAST_RANGE_M = 1.0

# How far a scan without gates and target is taken to look.
NO_TARGET_REACH_M = 1000.0


@dataclass(frozen=True)
class ScanLayout:
    """A scan as it will be measured; angles are true, at the lidar's own horizontal."""

    spec: ScanPlan
    lidar: Lidar
    lidar_index: int
    mounting: Mounting  # against true north
    targets: tuple[str, ...]  # in the order of a `points` scan, else one or none
    aim: Beam  # (target,) straight line from the head to each target
    axis_azimuth_deg: float  # where the scan is centred: its target, unless head angles are declared
    axis_elevation_deg: float
    scan: Scan
    gates: Gates | None
    pulse: Pulse | None  # None where the instrument has no such pulse
    probe: Probe

    @property
    def name(self) -> str:
        """The scan's name in the site file."""
        return self.spec.name

    @property
    def measures_wind(self) -> bool:
        """Whether it looks for wind; a raster around a hard target looks for the target."""
        return not (isinstance(self.spec, RasterScan) and self.spec.hard_target is not None)

    def range_to_m(self, target: str) -> float:
        """Straight range from the head to one of the scan's targets [m]."""
        return float(self.aim.range_m[self.targets.index(target)])

    def gate_at(self, range_m: float) -> tuple[int, float, float] | None:
        """Find the gate nearest to a true range.

        Returns
        -------
        tuple of int, float, float, or None
            Its index, true centre [m] and offset, centre less range [m]; None without gates.
        """
        if self.gates is None:
            return None
        offset_m = self.lidar.mounting.range_offset_m
        index, gap_m = self.gates.nearest(range_m - offset_m)
        return int(index), float(self.gates.centres_m[int(index)]) + offset_m, float(gap_m)

    def measured_range_m(self, range_m: float) -> float:
        """True centre of the gate nearest to a range, or the range itself where no gates are declared [m]."""
        gate = self.gate_at(range_m)
        return range_m if gate is None else gate[1]

    @property
    def target_range_m(self) -> float | None:
        """Measured range of the gate at the (first) target [m]; None where the scan has no target."""
        return self.measured_range_m(float(self.aim.range_m[0])) if self.targets else None

    @property
    def farthest_m(self) -> float:
        """Range of the farthest target or gate [m]; 0 where there is neither."""
        last_m = self.gates.last_m if self.gates else 0.0
        return max([last_m, *(float(value) for value in self.aim.range_m)])

    @property
    def drawn_reach_m(self) -> float:
        """How far the scan is drawn: to the measured gate of its farthest target, else to its last gate [m]."""
        ranges = [self.measured_range_m(float(value)) for value in self.aim.range_m]
        return max(ranges, default=self.gates.last_m if self.gates else NO_TARGET_REACH_M)

    @property
    def unambiguous_range_m(self) -> float | None:
        """Range beyond which echoes of two pulses mix [m]; None where the pulse is not known."""
        return None if self.pulse is None else unambiguous_range_m(self.pulse.pulse_repetition_hz)

    @property
    def rays_s(self) -> float:
        """Time that the rays of one pass take without any turning [s]."""
        return self.scan.count * self.spec.accumulation_s

    @property
    def aim_error_deg(self) -> float | None:
        """Angle between the declared head angles and the target [deg]; None where none are declared."""
        declared = self.spec.azimuth_head_deg is not None or self.spec.elevation_head_deg is not None
        if not (declared and self.targets) or isinstance(self.spec, PointsScan):
            return None
        axis = unit_vector(self.axis_azimuth_deg, self.axis_elevation_deg)
        wanted = unit_vector(self.aim.azimuth_deg[0], self.aim.elevation_deg[0])
        return float(np.rad2deg(np.arctan2(np.linalg.norm(np.cross(axis, wanted)), axis @ wanted)))

    @property
    def aim_miss_m(self) -> float | None:
        """How far that angle is beside the target [m]; None where no head angles are declared."""
        off_deg = self.aim_error_deg
        return None if off_deg is None else float(np.deg2rad(off_deg) * self.aim.range_m[0])

    @property
    def head_elevation_deg(self) -> tuple[float, float]:
        """Lowest and highest elevation that the head shows, over the top included [deg]."""
        if isinstance(self.spec, RhiScan):  # true elevations of rays end at the zenith, the head's do not
            ends = (self.spec.elevation_from_deg, self.spec.elevation_to_deg)
            return min(ends) - self.lidar.elevation_offset_deg, max(ends) - self.lidar.elevation_offset_deg
        _, elevation_deg = self.mounting.to_head(self.scan.azimuth_deg, self.scan.elevation_deg)
        return float(elevation_deg.min()), float(elevation_deg.max())

    def vertical_bias_mps(self, vertical_mps: float) -> float:
        """How much a vertical wind looks like a horizontal one, w·tan φ [m/s], at the steepest target."""
        alone = isinstance(self.spec, PointsScan)
        steepest_deg = float(np.abs(self.aim.elevation_deg if alone else self.axis_elevation_deg).max())
        return float(abs(vertical_mps) * np.tan(np.deg2rad(steepest_deg)))

    def edges_deg(self) -> tuple[FloatArray, FloatArray]:
        """Azimuths and elevations (ray + 2,) that the beam passes through, its motion's ends included."""
        scan = self.scan
        first = scan.azimuth_deg[0] - scan.swept_azimuth_deg[0] / 2
        last = scan.azimuth_deg[-1] + scan.swept_azimuth_deg[-1] / 2
        low = scan.elevation_deg[0] - scan.swept_elevation_deg[0] / 2
        high = scan.elevation_deg[-1] + scan.swept_elevation_deg[-1] / 2
        return np.array([first, *scan.azimuth_deg, last]), np.array([low, *scan.elevation_deg, high])

    def beam_at(self, target: str) -> tuple[float, float]:
        """True azimuth and elevation at a target [deg]: in a `points` scan its own ray, else the axis."""
        if not isinstance(self.spec, PointsScan) or target not in self.targets:
            return self.axis_azimuth_deg, self.axis_elevation_deg
        ray = self.targets.index(target)
        return float(self.scan.azimuth_deg[ray]), float(self.scan.elevation_deg[ray])


def lay_out(places: Places, spec: ScanPlan) -> ScanLayout:
    """Lay out one scan of the site.

    Parameters
    ----------
    places
        Where the site's things stand; pointing is exact whatever its model of the Earth.
    spec
        The scan.

    Returns
    -------
    ScanLayout
        The scan with its rays.

    Raises
    ------
    InputError
        If the scan's numbers do not make a scan (a sector that is no whole number of steps, a raster past the
        zenith), or a target is at the scanner head.
    """
    site = places.site
    index = next(i for i, lidar in enumerate(site.lidars) if lidar.name == spec.lidar)
    lidar, mounting = site.lidars[index], places.mounting(site.lidars[index])
    targets = target_names(spec)
    positions = np.array([site.target_position_m(name) for name in targets], dtype=np.float64)
    aim = beam_to(places.frame.enu_m(lidar.position, positions.reshape(-1, 3)))
    if (at_head := aim.range_m < LEAST_RANGE_M).any():
        raise InputError(
            f"scan '{spec.name}': target '{targets[int(np.argmax(at_head))]}' came at "
            f"{aim.range_m.min():.2f} m from the head of {lidar.name}; allowed are {LEAST_RANGE_M:g} m or "
            "more. Check both positions."
        )
    axis = _axis(spec, aim, mounting)
    try:
        scan = make_scan(spec, aim, axis, head_limits(lidar), mounting)
    except InputError as error:
        raise InputError(f"scan '{spec.name}': {error}") from error
    gates = spec.gates
    return ScanLayout(
        spec=spec,
        lidar=lidar,
        lidar_index=index,
        mounting=mounting,
        targets=targets,
        aim=aim,
        axis_azimuth_deg=axis[0],
        axis_elevation_deg=axis[1],
        scan=scan,
        gates=None if gates is None else Gates(gates.first_m, gates.spacing_m, gates.count),
        pulse=site.pulse_of(spec),
        probe=_probe(spec, lidar, site.pulse_of(spec)),
    )


def target_names(spec: ScanPlan) -> tuple[str, ...]:
    """The targets of a scan, in its order; of a raster its hard target."""
    if isinstance(spec, PointsScan):
        return spec.targets
    named = spec.target or (spec.hard_target if isinstance(spec, RasterScan) else None)
    return () if named is None else (named,)


def volume_m(places: Places, layout: ScanLayout, target: str) -> FloatArray:
    """Sample what a scan measures at one of its targets: the arc of a gate, the probe of a stare.

    Returns
    -------
    FloatArray
        Sheet (ray, along, 3), east, north, up from the site's origin [m]. A `points` scan measures only the
        probe at that target: nothing is measured on the way from one point to the next.
    """
    range_m = layout.measured_range_m(layout.range_to_m(target))
    alone = isinstance(layout.spec, PointsScan)
    azimuth_deg, elevation_deg = layout.beam_at(target) if alone else layout.edges_deg()
    probe_m = min(layout.probe.length_m, 2 * range_m)  # a target in the blind zone is the checks' affair
    sheet = arc_volume_m(np.zeros(3), azimuth_deg, elevation_deg, range_m, probe_m=probe_m)
    return places.from_lidar_m(layout.lidar, sheet)


def _axis(spec: ScanPlan, aim: Beam, mounting: Mounting) -> tuple[float, float]:
    """True azimuth and elevation of the scan's middle: declared head angles win over the target."""
    aimed = len(aim.azimuth_deg) > 0
    azimuth_deg = float(aim.azimuth_deg[0]) if aimed else 0.0
    elevation_deg = float(aim.elevation_deg[0]) if aimed else 0.0
    if spec.azimuth_head_deg is None and spec.elevation_head_deg is None:
        return azimuth_deg, elevation_deg
    head_azimuth, head_elevation = mounting.to_head(azimuth_deg, elevation_deg)
    true_azimuth, true_elevation = mounting.to_true(
        head_azimuth if spec.azimuth_head_deg is None else spec.azimuth_head_deg,
        head_elevation if spec.elevation_head_deg is None else spec.elevation_head_deg,
    )
    return float(true_azimuth), float(true_elevation)


def _probe(spec: ScanPlan, lidar: Lidar, pulse: Pulse | None) -> Probe:
    """The scan's probe: its own pulse and FFT, else those of the instrument, else the reference study's."""
    pulse_ns = spec.pulse_ns or (pulse.pulse_ns if pulse else None) or DEFAULT_PULSE_NS
    fft_points = spec.fft_points or (pulse.fft_points if pulse else None) or DEFAULT_FFT_POINTS
    return Probe(pulse_ns=pulse_ns, window_ns=window_ns(fft_points, lidar.device.sample_ns))
