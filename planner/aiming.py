"""Whether a scan with declared head angles sweeps over its target, and by how much it passes it."""

from typing import NamedTuple

import numpy as np

from geometry.angles import difference_deg
from geometry.beams import beam_to, unit_vector
from planner.scan_layout import ScanLayout
from planner.scan_plans import PpiScan, RasterScan, RhiScan, SectorScan


class Outside(NamedTuple):
    """How far a target lies outside what a scan sweeps; 0 inside."""

    azimuth_deg: float
    elevation_deg: float
    miss_m: float  # across the beam, at the target's range


def outside_sweep(layout: ScanLayout) -> Outside | None:
    """Measure how far the (first) target lies outside what a scan sweeps.

    Parameters
    ----------
    layout
        A scan with declared head angles and a target.

    Returns
    -------
    Outside or None
        None without declared head angles or without a target, and for a list of points.
    """
    if layout.aim_error_deg is None or layout.aim_miss_m is None:
        return None
    axis = beam_to(unit_vector(layout.axis_azimuth_deg, layout.axis_elevation_deg))  # over the top: turned
    target_azimuth, target_elevation = float(layout.aim.azimuth_deg[0]), float(layout.aim.elevation_deg[0])
    off_azimuth = abs(float(difference_deg(target_azimuth, axis.azimuth_deg)))
    off_elevation = abs(target_elevation - float(axis.elevation_deg))
    if isinstance(layout.spec, RhiScan):
        off_azimuth, off_elevation = _beside_rhi(layout.spec, off_azimuth, target_elevation)
    half_width, half_height = _half_sweep_deg(layout)
    azimuth, elevation = max(off_azimuth - half_width, 0.0), max(off_elevation - half_height, 0.0)
    across = np.hypot(azimuth * np.cos(np.deg2rad(target_elevation)), elevation)
    swept_m = float(np.deg2rad(across) * layout.aim.range_m[0])
    return Outside(azimuth, elevation, min(swept_m, layout.aim_miss_m) if half_width == 0 else swept_m)


def _half_sweep_deg(layout: ScanLayout) -> tuple[float, float]:
    """Half of what a scan sweeps around its axis, in azimuth and in elevation [deg]."""
    match layout.spec:
        case SectorScan():
            return layout.spec.sector_deg / 2, 0.0
        case PpiScan():
            return 180.0, 0.0
        case RasterScan():
            return layout.spec.width_deg / 2, layout.spec.height_deg / 2
        case _:
            return 0.0, 0.0


def _beside_rhi(spec: RhiScan, off_azimuth: float, elevation_deg: float) -> tuple[float, float]:
    """How far a target is beside the upright plane of an RHI, and above or below its ends [deg]."""
    low, high = sorted((spec.elevation_from_deg, spec.elevation_to_deg))
    behind = off_azimuth > 90.0 and high > 90.0
    height = 180.0 - elevation_deg if behind else elevation_deg
    return (180.0 - off_azimuth if behind else off_azimuth), max(low - height, height - high, 0.0)
