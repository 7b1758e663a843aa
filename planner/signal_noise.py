"""How noisy a scan's radial speeds are at a target: as declared, or from the strength of the echo."""

from typing import NamedTuple

import numpy as np

from planner.scan_layout import ScanLayout
from planner.site import Site
from reconstruct.signal import cnr_db, noise_mps, valid_share

ORDINARY_SPEED_LIMIT_MPS = 30.0  # of pulsed coherent lidars; used where the instrument's is not known


class RayNoise(NamedTuple):
    """What one ray of a scan is worth at a target."""

    noise_mps: float  # standard deviation of its radial speed
    cnr_db: float | None  # of one pulse; None where the site does not say how strong the echo is
    valid_share: float | None  # of rays whose CNR is above the limit
    source: str


def ray_noise(site: Site, layout: ScanLayout, target: str) -> RayNoise:
    """Noise of a scan's radial speed at one of its targets.

    A declared `uncertainty.radial_speed_mps` wins; else it follows from `signal`, range, pulse and accumulation; else it is the
    instrument's.
    """
    lidar = layout.lidar
    signal, pulse = lidar.signal, site.pulse_of(layout.spec)
    if signal is None:
        return RayNoise(lidar.radial_speed_noise_mps, None, None, "declared, or the instrument's")
    level = cnr_db(
        layout.measured_range_m(_range_m(site, layout, target)),
        reference_db=signal.cnr_db,
        reference_range_m=signal.range_m,
        pulse_ratio=layout.probe.pulse_ns / (signal.pulse_ns or layout.probe.pulse_ns),
        extinction_per_m=signal.extinction_per_m,
    )
    share = float(valid_share(level, least_db=signal.least_cnr_db, spread_db=signal.spread_db))
    if lidar.uncertainty.radial_speed_mps is not None or pulse is None:
        return RayNoise(lidar.radial_speed_noise_mps, float(level), share, "declared, or the instrument's")
    limit = lidar.device.radial_speed_limit_mps or ORDINARY_SPEED_LIMIT_MPS
    noise = noise_mps(
        level,
        pulses=pulse.pulse_repetition_hz * layout.spec.accumulation_s,
        points_per_gate=layout.probe.window_ns / lidar.device.sample_ns,
        bandwidth_mps=2 * limit,
    )
    return RayNoise(float(noise), float(level), share, "from the strength of the echo")


def _range_m(site: Site, layout: ScanLayout, target: str) -> float:
    """Slant range from the head to a target [m]; of a target that is not the scan's own, on the grid (0.04 %)."""
    if target in layout.targets:
        return float(layout.aim.range_m[layout.targets.index(target)])
    return float(np.linalg.norm(np.subtract(site.target_position_m(target), layout.lidar.position)))
