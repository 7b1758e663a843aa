"""The rays of one retrieval at a target, as the reconstruction wants them: seen from the target."""

from typing import Literal

import numpy as np

from geometry.arrays import FloatArray
from geometry.beams import beam_to, unit_vector
from geometry.errors import InputError
from geometry.scan import Scan, subset_rays
from planner.places import Places
from planner.scan_layout import ScanLayout
from planner.scan_making import head_limits, make_sector
from planner.scan_plans import SectorScan
from reconstruct.rays import Rays


def sector_rays(places: Places, layout: ScanLayout, scan: Scan, target: str) -> Rays:
    """Rays of one sector scan at the gate nearest to a target.

    Parameters
    ----------
    places
        Where the site's things stand.
    layout
        The scan as declared: its lidar, gates and probe.
    scan
        The rays: those of the layout, or of another size of it.
    target
        One of the scan's targets.

    Returns
    -------
    Rays
        In the east-north-up frame of the target.
    """
    range_m = layout.measured_range_m(layout.range_to_m(target))
    azimuth_deg, elevation_deg, ranges_m, head = _seen_from(
        places, layout, scan.azimuth_deg, scan.elevation_deg, range_m, target
    )
    count = scan.count
    return Rays(
        azimuth_deg=azimuth_deg,
        elevation_deg=elevation_deg,
        range_m=ranges_m,
        head_m=np.tile(head, (count, 1)),
        lidar=np.zeros(count, dtype=np.intp),
        time_s=scan.time_s,
        duration_s=np.full(count, scan.accumulation_s),
        swept_azimuth_deg=scan.swept_azimuth_deg,
        probes=(layout.probe,),
        period_s=scan.period_s,
        back_and_forth=scan.back_and_forth,
        sweep_s=scan.sweep_s,
    )


def pair_rays(
    places: Places, layouts: tuple[ScanLayout, ...], target: str, *, columns: Literal[2, 3] = 2
) -> Rays:
    """One ray of each scan of a pair, at the same time, at the gate nearest to their common target.

    One retrieval lasts as long as the slowest of the scans.

    Parameters
    ----------
    places
        Where the site's things stand.
    layouts
        The scans of the pair, two or more.
    target
        Their common target.
    columns
        Of the fit: 2 for u and v, 3 for w too.

    Returns
    -------
    Rays
        In the east-north-up frame of the target.
    """
    parts = [_pair_ray(places, layout, target) for layout in layouts]
    count = len(layouts)
    durations = np.array([layout.spec.accumulation_s for layout in layouts])
    return Rays(
        azimuth_deg=np.concatenate([part[0] for part in parts]),
        elevation_deg=np.concatenate([part[1] for part in parts]),
        range_m=np.concatenate([part[2] for part in parts]),
        head_m=np.stack([part[3] for part in parts]),
        lidar=np.arange(count),
        time_s=durations / 2,
        duration_s=durations,
        swept_azimuth_deg=np.zeros(count),
        probes=tuple(layout.probe for layout in layouts),
        period_s=max(layout.scan.period_s for layout in layouts),
        columns=columns,
    )


def own_scan(layout: ScanLayout, size_deg: float) -> Scan:
    """A sector scan of another size about the same axis, with its own period from head and accumulation.

    The declared size itself keeps its declared period.

    Raises
    ------
    InputError
        If the size is no whole number of steps, or not between one step and 360 degrees.
    """
    head = head_limits(layout.lidar)
    axis = (layout.axis_azimuth_deg, layout.axis_elevation_deg)
    return make_sector(_sector_spec(layout), axis, head, layout.mounting, size_deg=size_deg)


def subset_of(layout: ScanLayout, size_deg: float) -> slice:
    """The middle rays of the declared scan that stand for a smaller sector.

    Raises
    ------
    InputError
        If the size is larger than the declared sector or no whole number of steps.
    """
    spec = _sector_spec(layout)
    return subset_rays(layout.scan.count, spec.step_deg, size_deg, motion=spec.motion)


def _sector_spec(layout: ScanLayout) -> SectorScan:
    if not isinstance(layout.spec, SectorScan):
        raise InputError(
            f"scan '{layout.name}' is of type {layout.spec.type}, and sizes are asked for; "
            "only a scan of type sector has them"
        )
    return layout.spec


def _pair_ray(
    places: Places, layout: ScanLayout, target: str
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """The one ray with which a scan looks at a target: as `_seen_from`, each angle and range (1,)."""
    azimuth_deg, elevation_deg = layout.beam_at(target)
    straight = places.frame.enu_m(layout.lidar.position, places.site.target_position_m(target))
    range_m = layout.measured_range_m(float(np.linalg.norm(straight)))
    return _seen_from(places, layout, np.array([azimuth_deg]), np.array([elevation_deg]), range_m, target)


def _seen_from(
    places: Places,
    layout: ScanLayout,
    azimuth_deg: FloatArray,
    elevation_deg: FloatArray,
    range_m: float,
    target: str,
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Azimuth, elevation, range of beams and their head, in the target's own east-north-up frame.

    North at the target is not north at the lidar: 0.013° per kilometre of easting at 55° latitude.
    """
    origin = places.site.target_position_m(target)
    ends = places.frame.projected_m(layout.lidar.position, range_m * unit_vector(azimuth_deg, elevation_deg))
    head = places.frame.enu_m(origin, layout.lidar.position)
    beam = beam_to(places.frame.enu_m(origin, ends) - head)
    return beam.azimuth_deg, beam.elevation_deg, beam.range_m, head
