"""A simulated CNR map of a hard target, for tests and for trying an evaluation before the field.

It knows nothing of how maps are evaluated: each ray is a bundle of thin beams, turned by the head's mounting,
that meet a solid bar in space or pass it.
"""

from dataclasses import dataclass

import numpy as np

from geometry.arrays import ArrayLike, FloatArray
from geometry.beams import unit_vector
from geometry.gates import Probe
from geometry.head import Mounting
from reconstruct.cnr_map import CnrMap
from reconstruct.silhouette import Shape

BUNDLE = 61  # thin beams across a beam, in either direction, to three standard deviations


@dataclass(frozen=True)
class Signal:
    """How strong and how noisy a simulated map is; the defaults are those of a clear day over flat land."""

    target_db: float = 0.0  # CNR of a beam that hits with all of itself
    air_db: float = -22.0  # of the air around it
    speckle: float = 0.15  # standard deviation of the target's power from ray to ray, as a share
    air_noise_db: float = 0.8  # of the air, shared by gates within one probe
    gate_noise_db: float = 0.3  # of every gate by itself
    jitter_deg: float = 0.001  # how far each ray points aside, both ways


def simulate_cnr_map(
    azimuth_head_deg: ArrayLike,
    elevation_head_deg: ArrayLike,
    range_m: ArrayLike,
    *,
    target_m: ArrayLike,
    shape: Shape,
    size_m: float,
    probe: Probe,
    rng: np.random.Generator,
    mounting: Mounting | None = None,
    beam_width_m: float = 0.1,
    signal: Signal | None = None,
) -> CnrMap:
    """Simulate the map that a scan of a hard target gives.

    Parameters
    ----------
    azimuth_head_deg, elevation_head_deg : array_like (ray,)
        Where the head is told to point [deg].
    range_m : array_like (gate,)
        Centres of the gates as the instrument states them [m].
    target_m : array_like (3,)
        East, north, up of the target from the head [m]: the axis of a mast at any height, the top of a tip,
        the middle of a boom, which lies across the line of sight and runs through the whole map.
    shape, size_m
        What it is, and its width or thickness [m].
    probe : Probe
        Pulse and window of the lidar.
    rng : numpy.random.Generator
        Source of the noise.
    mounting : Mounting
        How the head really stands; as it should by default.
    beam_width_m : float
        Diameter at 1/e² of the beam at the target [m].
    signal : Signal
        Strength and noise.

    Returns
    -------
    CnrMap
        In the head's own angles and ranges.

    Examples
    --------
    >>> azimuth_deg, elevation_deg = (each.ravel() for each in np.meshgrid(np.arange(-.1, .1, .01), np.arange(-.1, .1, .01)))
    >>> found = simulate_cnr_map(azimuth_deg, elevation_deg, np.arange(950.0, 1050.0), target_m=[0, 1000, 0],
    ...     shape="mast", size_m=1.0, probe=Probe(pulse_ns=200, window_ns=256), rng=np.random.default_rng(1))
    >>> found.cnr_db.shape, bool(found.cnr_db.max() > -2)
    ((400, 100), True)
    """
    signal, mounting = signal or Signal(), mounting or Mounting()
    azimuth, elevation, gates = (
        np.asarray(each, dtype=np.float64) for each in (azimuth_head_deg, elevation_head_deg, range_m)
    )
    target = np.asarray(target_m, dtype=np.float64)
    jitter = rng.normal(0.0, signal.jitter_deg, (2, azimuth.size))
    wider = 1.0 / np.cos(np.deg2rad(elevation))
    beams = unit_vector(*mounting.to_true(azimuth + jitter[0] * wider, elevation + jitter[1]))
    hit, reach_m = _met(beams, target, shape, size_m, beam_width_m)
    behind_m = mounting.true_range_m(gates) - reach_m[:, None]
    power = _power(hit, behind_m, probe, signal, rng)
    noise_db = rng.normal(0.0, signal.gate_noise_db, power.shape)
    return CnrMap(azimuth, elevation, gates, 10.0 * np.log10(power) + noise_db)


def _power(
    hit: FloatArray, behind_m: FloatArray, probe: Probe, signal: Signal, rng: np.random.Generator
) -> FloatArray:
    """Linear carrier-to-noise ratio (ray, gate): the air, dimmed behind the target, and the target."""
    gate_m = float(np.median(np.diff(behind_m[0])))
    within = max(1, round(probe.length_m / gate_m))
    white = rng.normal(0.0, 1.0, (hit.size, behind_m.shape[1] + within))
    sums = np.cumsum(white, axis=1)
    shared = (sums[:, within:] - sums[:, :-within]) / np.sqrt(within)
    air = 10.0 ** (0.1 * (signal.air_db + signal.air_noise_db * shared))
    fine_m = np.linspace(-3.0, 3.0, 601) * probe.length_m
    passed = np.cumsum(probe.weight(fine_m))
    dimmed = 1.0 - hit[:, None] * np.interp(behind_m, fine_m, passed / passed[-1])
    speckle = np.maximum(rng.normal(1.0, signal.speckle, hit.size), 0.0)
    shape = probe.weight(fine_m) / probe.weight(np.zeros(1))
    peak = np.interp(behind_m, fine_m, shape, left=0.0, right=0.0)
    return np.asarray(air * dimmed + 10.0 ** (0.1 * signal.target_db) * (hit * speckle)[:, None] * peak)


def _met(
    beams: FloatArray, target: FloatArray, shape: Shape, size_m: float, beam_width_m: float
) -> tuple[FloatArray, FloatArray]:
    """Share of each beam's bundle (ray,) that meets the bar, and the slant range (ray,) at which [m]."""
    level = np.array([target[0], target[1], 0.0]) / np.hypot(target[0], target[1])
    right = np.array([level[1], -level[0], 0.0])
    reach = float(np.hypot(target[0], target[1])) / (beams @ level)  # to the upright plane of the target
    met = beams * reach[:, None]
    nodes = np.linspace(-3.0, 3.0, BUNDLE)
    weights = np.exp(-0.5 * nodes**2)
    nodes, weights = 0.25 * beam_width_m * nodes, weights / weights.sum()
    across = (met @ right)[:, None] + nodes
    above = (met[:, 2] - target[2])[:, None] + nodes
    strip = np.abs(above if shape == "boom" else across) <= 0.5 * size_m
    below = above <= 0.0 if shape == "tip" else np.ones_like(above, dtype=bool)
    share = (strip * weights).sum(axis=1)
    if shape == "tip":
        share = share * (below * weights).sum(axis=1)
    return np.asarray(share), np.asarray(reach)
