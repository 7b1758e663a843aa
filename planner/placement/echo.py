"""How noisy a lidar's radial speed would be at any range: as declared, or from the strength of its echo."""

from typing import NamedTuple

import numpy as np

from geometry.arrays import FloatArray
from geometry.gates import window_ns
from planner.scan_layout import DEFAULT_FFT_POINTS
from planner.scan_plans import ScanPlan
from planner.signal_noise import ORDINARY_SPEED_LIMIT_MPS
from planner.site import Lidar
from reconstruct.signal import cnr_db, noise_mps, valid_share


class Echo(NamedTuple):
    """What one ray is worth at each range."""

    noise_mps: FloatArray  # standard deviation of its radial speed
    valid_share: (
        FloatArray  # of rays that are strong enough; inf where the site does not say how strong the echo is
    )


def echo(lidar: Lidar, scan: ScanPlan | None, range_m: FloatArray) -> Echo:
    """Work out noise and validity of a lidar's rays at many ranges, as `planner.signal_noise` does for one.

    Parameters
    ----------
    lidar
        With its `signal`, where that is declared.
    scan
        Its scan: pulse and accumulation.
    range_m
        Ranges [m], any shape.
    """
    signal, declared = lidar.signal, np.full(range_m.shape, lidar.radial_speed_noise_mps)
    if signal is None:
        return Echo(declared, np.full(range_m.shape, np.inf))
    pulse = lidar.device.pulse(scan.pulse_ns if scan else None)
    pulse_ns = (scan.pulse_ns if scan else None) or (pulse.pulse_ns if pulse else None)
    ratio = pulse_ns / signal.pulse_ns if pulse_ns and signal.pulse_ns else 1.0
    level = cnr_db(
        np.maximum(range_m, 1.0),
        reference_db=signal.cnr_db,
        reference_range_m=signal.range_m,
        pulse_ratio=ratio,
        extinction_per_m=signal.extinction_per_m,
    )
    share = valid_share(level, least_db=signal.least_cnr_db, spread_db=signal.spread_db)
    if lidar.uncertainty.radial_speed_mps is not None or pulse is None or scan is None:
        return Echo(declared, share)
    points = scan.fft_points or pulse.fft_points or DEFAULT_FFT_POINTS
    noise = noise_mps(
        level,
        pulses=pulse.pulse_repetition_hz * scan.accumulation_s,
        points_per_gate=window_ns(points, lidar.device.sample_ns) / lidar.device.sample_ns,
        bandwidth_mps=2 * (lidar.device.radial_speed_limit_mps or ORDINARY_SPEED_LIMIT_MPS),
    )
    return Echo(np.asarray(noise), share)
