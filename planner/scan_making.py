"""From a scan of the site file to its rays and times: one small maker for each type of scan.

Sectors, circles and rasters are swept by a head that keeps its own elevation: where it does not stand level
they rise and fall above the horizon. RHIs and points are declared above the horizon and stay as they are.
"""

from dataclasses import replace

from geometry import scans
from geometry.angles import difference_deg
from geometry.beams import Beam
from geometry.head import HeadLimits, Mounting
from geometry.scans import Scan
from planner.scan_plans import PointsScan, PpiScan, RasterScan, RhiScan, ScanPlan, SectorScan
from planner.site import Lidar

# A head that is not described turns at once: only the accumulation counts, and the checks say so.
INSTANT_HEAD = HeadLimits(
    azimuth_speed_deg_per_s=1e6,
    elevation_speed_deg_per_s=1e6,
    azimuth_acceleration_deg_per_s2=1e9,
    elevation_acceleration_deg_per_s2=1e9,
)

Axis = tuple[float, float]  # true azimuth and elevation of a scan's middle [deg]


def head_limits(lidar: Lidar) -> HeadLimits:
    """How fast the lidar's head turns; a head that is not described turns at once."""
    head = lidar.device.head
    if head is None:
        return INSTANT_HEAD
    return HeadLimits(
        azimuth_speed_deg_per_s=head.azimuth_speed_deg_per_s,
        elevation_speed_deg_per_s=head.elevation_speed_deg_per_s,
        azimuth_acceleration_deg_per_s2=head.azimuth_acceleration_deg_per_s2,
        elevation_acceleration_deg_per_s2=head.elevation_acceleration_deg_per_s2,
    )


def make_scan(spec: ScanPlan, aim: Beam, axis: Axis, head: HeadLimits, mounting: Mounting) -> Scan:
    """Make the rays and times of a scan.

    Parameters
    ----------
    spec
        The scan of the site file.
    aim
        Beams to the scan's targets, each (target,), true; a `points` scan stares along them.
    axis
        True azimuth and elevation of the scan's middle [deg].
    head
        How fast the head turns.
    mounting
        How it stands against true north.

    Returns
    -------
    Scan
        True azimuths, elevations above the horizontal.

    Raises
    ------
    InputError
        If the numbers do not make a scan: a sector that is no whole number of steps, a raster past the
        zenith.
    """
    match spec:
        case SectorScan():
            return make_sector(spec, axis, head, mounting)
        case PpiScan():
            return _ppi(spec, axis, head, mounting)
        case RhiScan():
            return _rhi(spec, axis, head)
        case RasterScan():
            return _raster(spec, axis, head, mounting)
        case PointsScan():
            return scans.points(
                aim.azimuth_deg,
                aim.elevation_deg,
                accumulation_s=spec.accumulation_s,
                head=head,
                sweep=spec.sweep,
                period_s=spec.period_s,
            )
        case _:
            return scans.stare(*axis, accumulation_s=spec.accumulation_s, period_s=spec.period_s)


def make_sector(
    spec: SectorScan, axis: Axis, head: HeadLimits, mounting: Mounting, *, size_deg: float | None = None
) -> Scan:
    """Make a sector scan, of its declared size and period, or of another size with the period that it needs.

    Raises
    ------
    InputError
        If the size is no whole number of steps, or not between one step and 360 degrees.
    """
    declared = size_deg is None or abs(size_deg - spec.sector_deg) < 1e-9
    level = scans.sector(
        *_in_lidar_axes(axis, mounting),
        sector_deg=spec.sector_deg if size_deg is None else size_deg,
        step_deg=spec.step_deg,
        accumulation_s=spec.accumulation_s,
        head=head,
        motion=spec.motion,
        sweep=spec.sweep,
        period_s=spec.period_s if declared else None,
    )
    return _tilted(level, mounting)


def _ppi(spec: PpiScan, axis: Axis, head: HeadLimits, mounting: Mounting) -> Scan:
    level = scans.ppi(
        _in_lidar_axes(axis, mounting)[1],
        step_deg=spec.step_deg,
        accumulation_s=spec.accumulation_s,
        head=head,
        motion=spec.motion,
        sweep=spec.sweep,
        period_s=spec.period_s,
    )
    return _tilted(level, mounting)


def _rhi(spec: RhiScan, axis: Axis, head: HeadLimits) -> Scan:
    return scans.rhi(
        axis[0],
        from_deg=spec.elevation_from_deg,
        to_deg=spec.elevation_to_deg,
        step_deg=spec.step_deg,
        accumulation_s=spec.accumulation_s,
        head=head,
        motion=spec.motion,
        sweep=spec.sweep,
        period_s=spec.period_s,
    )


def _raster(spec: RasterScan, axis: Axis, head: HeadLimits, mounting: Mounting) -> Scan:
    level = scans.raster(
        *_in_lidar_axes(axis, mounting),
        width_deg=spec.width_deg,
        height_deg=spec.height_deg,
        step_deg=spec.step_deg,
        elevation_step_deg=spec.elevation_step_deg,
        accumulation_s=spec.accumulation_s,
        head=head,
        motion=spec.motion,
        sweep=spec.sweep,
        period_s=spec.period_s,
    )
    return _tilted(level, mounting)


def _is_level(mounting: Mounting) -> bool:
    return mounting.pitch_deg == 0.0 and mounting.roll_deg == 0.0


def _in_lidar_axes(axis: Axis, mounting: Mounting) -> Axis:
    """The axis as it stands in the axes of a tilted lidar; a level one keeps the true angles."""
    if _is_level(mounting):
        return axis
    azimuth_deg, elevation_deg = mounting.to_head(*axis)
    return (
        float(azimuth_deg) + mounting.azimuth_offset_deg,
        float(elevation_deg) + mounting.elevation_offset_deg,
    )


def _tilted(scan: Scan, mounting: Mounting) -> Scan:
    """Turn a scan from the axes of a tilted lidar to true azimuths and elevations above the horizontal."""
    if _is_level(mounting):
        return scan
    stand = replace(mounting, azimuth_offset_deg=0.0, elevation_offset_deg=0.0)
    half_azimuth, half_elevation = scan.swept_azimuth_deg / 2, scan.swept_elevation_deg / 2
    begin = stand.to_true(scan.azimuth_deg - half_azimuth, scan.elevation_deg - half_elevation)
    middle = stand.to_true(scan.azimuth_deg, scan.elevation_deg)
    end = stand.to_true(scan.azimuth_deg + half_azimuth, scan.elevation_deg + half_elevation)
    return replace(
        scan,
        azimuth_deg=middle[0],
        elevation_deg=middle[1],
        swept_azimuth_deg=difference_deg(end[0], begin[0]),
        swept_elevation_deg=end[1] - begin[1],
    )
