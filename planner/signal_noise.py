"""How noisy a scan's radial speeds are at a target: as declared, or from the strength of the echo."""

from typing import NamedTuple

import numpy as np

from geometry.arrays import FloatArray
from geometry.errors import InputError
from planner.scan_layout import ScanLayout
from planner.site import Site
from reconstruct.signal import cnr_db, valid_share
from reconstruct.signal import noise_mps as expected_noise_mps

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
    noise = expected_noise_mps(
        level,
        pulses=pulse.pulse_repetition_hz * layout.spec.accumulation_s,
        points_per_gate=layout.probe.window_ns / lidar.device.sample_ns,
        bandwidth_mps=2 * limit,
    )
    return RayNoise(float(noise), float(level), share, "from the strength of the echo")


def cnr_weights(cnr_db: FloatArray, layout: ScanLayout, *, noise_mps: float) -> FloatArray:
    """Weights of rays in a fit by the noise that their CNR lets expect: noise_mps² over its variance.

    Parameters
    ----------
    cnr_db
        CNR of one pulse of each ray [dB], any shape; NaN: weight 0.
    layout
        The scan: its pulse and accumulation.
    noise_mps
        Noise of a ray of weight one [m/s].

    Returns
    -------
    FloatArray
        Same shape.

    Raises
    ------
    InputError
        If the pulse of the instrument is not known.
    """
    pulse, device = layout.pulse, layout.lidar.device
    if pulse is None:
        raise InputError(
            f"weights: cnr needs the pulse of lidar '{layout.lidar.name}' for scan '{layout.name}': give the instrument's "
            "pulses, or take weights: equal"
        )
    expected = expected_noise_mps(
        np.nan_to_num(cnr_db),
        pulses=pulse.pulse_repetition_hz * layout.spec.accumulation_s,
        points_per_gate=layout.probe.window_ns / device.sample_ns,
        bandwidth_mps=2 * (device.radial_speed_limit_mps or ORDINARY_SPEED_LIMIT_MPS),
    )
    return np.where(np.isfinite(cnr_db), np.square(noise_mps / expected), 0.0)


def _range_m(site: Site, layout: ScanLayout, target: str) -> float:
    """Slant range from the head to a target [m]; of a target that is not the scan's own, on the grid (0.04 %)."""
    if target in layout.targets:
        return float(layout.aim.range_m[layout.targets.index(target)])
    return float(np.linalg.norm(np.subtract(site.target_position_m(target), layout.lidar.position)))
