"""Where rays measure in the air that moves with the wind: the nouns and rules that all averages over patches share."""

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from geometry.arrays import FloatArray, IntArray
from geometry.gates import Probe
from reconstruct.correlation import Correlation, correlation
from reconstruct.spectra import Turbulence

# Beyond that many integral lengths one place a patch is enough: the difference is under 1e-4 of the variance.
DISTANT_LENGTHS = {"von-karman": 4.0, "kaimal": 8.0, "mann": 8.0}
# Two places that far apart know nothing of each other (von Karman: exp(-9)): nodes over a larger patch end there, and
# what it leaves of the variance falls like length over size, as it has to.
REACH_LENGTHS = {"von-karman": 12.0, "kaimal": 25.0, "mann": 30.0}
# Patches that overlap and sweep more integral lengths than that are averaged over what one place is ahead of another;
# shorter sweeps take two times each.
LONG_LENGTHS = 0.5


class Footprint(NamedTuple):
    """What rays of one probe cover around the middles of their patches; components first."""

    beam: FloatArray  # (3, ray) unit vector of the beam
    sweep_m: FloatArray  # (3, ray) from the start of the ray to its end
    probe: Probe


class Patches(NamedTuple):
    """Where rays measure in the air that moves with the wind; components first."""

    centre_m: FloatArray  # (3, ray)
    beam: FloatArray  # (3, ray) unit vector of the beam
    sweep_m: FloatArray  # (3, ray) from the start of the ray to its end
    lidar: IntArray  # (ray,)

    def take(self, index: IntArray) -> "Patches":
        """Patches of some rays, in that order."""
        return Patches(
            self.centre_m.take(index, axis=1),
            self.beam.take(index, axis=1),
            self.sweep_m.take(index, axis=1),
            self.lidar.take(index),
        )

    def footprint(self, index: IntArray, probe: Probe) -> Footprint:
        """Footprints of some rays, in that order, which have one probe."""
        return Footprint(self.beam.take(index, axis=1), self.sweep_m.take(index, axis=1), probe)


class Air(NamedTuple):
    """What every average over patches needs."""

    tensor: Correlation
    probes: tuple[Probe, ...]
    distant_m: float
    reach_m: float
    long_m: float

    @classmethod
    def of(cls, turbulence: Turbulence, probes: tuple[Probe, ...]) -> "Air":
        """The air of a turbulence model as these probes average it."""
        length_m, model = turbulence.length_m, turbulence.model
        return cls(
            correlation(turbulence),
            probes,
            DISTANT_LENGTHS[model] * length_m,
            REACH_LENGTHS[model] * length_m,
            LONG_LENGTHS * length_m,
        )


@lru_cache(maxsize=16)
def legendre(count: int) -> tuple[FloatArray, FloatArray]:
    return np.polynomial.legendre.leggauss(count)


@lru_cache(maxsize=16)
def graded(count: int, power: int) -> tuple[FloatArray, FloatArray]:
    """Nodes and weights on 0 to 1: powers of Gauss-Legendre nodes, which crowd near 0 from the square on."""
    node, weight = np.polynomial.legendre.leggauss(count)
    half = 0.5 * (node + 1)
    return half**power, 0.5 * power * weight * half ** (power - 1)
