"""What is left of the variance of a point in a ray that averages over its own patch."""

from functools import lru_cache

import numpy as np

from geometry.arrays import FloatArray
from geometry.gates import Probe
from reconstruct.footprints import Air, Patches, graded

# Probe and sweep of a ray with itself, graded towards no offset: to 1e-3 of the variance, and 1e-4 for
# lidars that cross; and to 1.5 % of what is left where eddies are small against the patch.
SELF_NODES, CROSSING_SELF_NODES = (8, 5), (16, 8)
OVERLAP_REACH = 4.0  # standard deviations beyond the windows, where the offset of two places in a probe ends


def self_correlations(air: Air, patches: Patches) -> FloatArray:
    """Share (ray,) that probe and sweep leave of the variance of a point.

    The offset of two independent places has the autocorrelation of the weighting along the beam; of two times
    in the sweep, a triangle. The correlation falls like r^(2/3) at first, so the nodes crowd near 0. Positive
    offsets along the beam stand for both signs, since turning both signs changes nothing.
    """
    counts = SELF_NODES if len(air.probes) == 1 else CROSSING_SELF_NODES
    beside, part, weight = _across_self(air, patches, counts[1])
    out = np.empty(len(patches.lidar))
    for lidar, probe in enumerate(air.probes):
        mine = np.flatnonzero(patches.lidar == lidar)
        along, along_weight = _along_self(probe, counts[0], air.reach_m, beside[mine])
        beam, sweep = patches.beam[:, None, None, mine], patches.sweep_m[:, None, None, mine]
        places = along[:, None] * beam + part[:, mine] * sweep
        values = air.tensor(places, beam, beam)
        out[mine] = np.einsum("ap,ap->p", along_weight, np.einsum("bp,abp->ap", weight[:, mine], values))
    return out


def _across_self(air: Air, patches: Patches, count: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Largest offset (ray,) along the beam that comes with a sweep [m]; parts (node, ray) of the sweep
    between two times in it, either sign, and their weights.
    """
    along = np.abs(np.einsum("cr,cr->r", patches.sweep_m, patches.beam))
    across = np.sqrt(np.clip(np.einsum("cr,cr->r", patches.sweep_m, patches.sweep_m) - along**2, 0.0, None))
    end = np.minimum(1.0, air.reach_m / np.maximum(across, air.reach_m))
    node, share = graded(count, 2)
    part = end * node[:, None]
    weight = end * share[:, None] * (1 - part)
    return end * along, np.concatenate([-part[::-1], part]), np.concatenate([weight[::-1], weight])


def _along_self(
    probe: Probe, count: int, reach_m: float, beside_m: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Offsets (node, ray) along the beam [m] between two places of one probe, and their weights, both signs."""
    offset, density, mass = _overlap(probe)
    end = np.minimum(offset[-1], reach_m + beside_m)
    node, share = graded(count, 2)
    along = end * node[:, None]
    weight = share[:, None] * np.interp(along, offset, density)
    return along, weight * (np.interp(end, offset, mass) / np.sum(weight, axis=0))


@lru_cache(maxsize=64)
def _overlap(probe: Probe) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Offsets from 0 up [m], the autocorrelation of the weighting there, and the share of pairs of places closer."""
    reach = probe.window_m + OVERLAP_REACH * np.sqrt(2) * probe.pulse_std_m
    fine = np.linspace(-reach, reach, 4001)
    weight = probe.weight(fine)
    density = np.convolve(weight, weight, mode="same")[2000:]
    mass = np.concatenate([[0.0], np.cumsum(0.5 * (density[1:] + density[:-1]))])
    return fine[2000:], density, mass / mass[-1]
