"""Where rays measure in the air that moves with the wind, and the correlation of a model averaged over that.

A ray covers a small patch: its probe along the beam, and across it the arc that the head sweeps during the
accumulation less the way the air went. The average over two patches is an integral over two probes and two
sweeps, of a correlation that has a cusp, 1 - C r^(2/3), where two places coincide. How finely it is done
depends on how far the patches are from each other: patches that overlap need nodes that crowd at the cusp.
"""

from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from geometry.arrays import FloatArray, IntArray
from geometry.gates import Probe
from reconstruct.correlation import Correlation, correlation
from reconstruct.spectra import Turbulence

# Beyond that many integral lengths one place a patch is enough: the difference is under 1e-4 of the variance.
DISTANT_LENGTHS = {"von-karman": 4.0, "kaimal": 8.0, "mann": 8.0}
# Patches closer than this many standard deviations of their offset get the fine quadrature: with it the
# covariance of the retrieved wind is right to 4e-4 (sectors of 60, 16 and 6 degrees, 30 rays of 43 m and 2
# degrees).
NEAR_SPREADS = 3.0
# Its nodes over probe and sweep, of either side: unequal, so that no two places coincide.
FIRST_NODES, SECOND_NODES = (2, 2), (3, 2)
# Patches of one lidar closer than this, and all near patches of two lidars, get nodes that crowd at the cusp:
# crossing beams retrieve differences of their covariances, enlarged by one over the sine of the crossing
# angle squared.
OVERLAP_SPREADS = 1.0
OVERLAP_NODES = (10, 8)  # on each side, along the first and the second beam: right to 7e-5 of the variance
SHALLOW = 0.05  # sine squared of the crossing angle under which two beams are as near all along a probe
PULSE_REACH = 3.5  # standard deviations of the pulse beyond the window, where the probe ends
# Probe and sweep of a ray with itself, graded towards no offset: to 1e-3 of the variance, and 1e-4 for
# lidars that cross; to 5e-3 of what is left where eddies are small against the patch.
SELF_NODES, CROSSING_SELF_NODES = (8, 5), (16, 8)
# In a larger patch the nodes end that many integral lengths off, where two places know nothing of each other
# (von Karman: exp(-9)): what a patch of size A leaves then falls like length over A, as it has to.
SELF_LENGTHS = {"von-karman": 12.0, "kaimal": 25.0, "mann": 30.0}
OVERLAP_REACH = 4.0  # standard deviations beyond the windows, where the offset of two places in a probe ends
CHUNK_PLACES = 2**13  # correlations evaluated at once: their arrays stay in the processor's cache
_FINE_PLACES = FIRST_NODES[0] * FIRST_NODES[1] * SECOND_NODES[0] * SECOND_NODES[1]
_POINT_PLACES = 2 * OVERLAP_NODES[0] * 2
_OVERLAP_PLACES = 2 * OVERLAP_NODES[1] * 2 * _POINT_PLACES
_UNIT_STD = np.sqrt(1.0 / 12.0)  # of a uniform variable of width 1
# Two places for each of four offsets (two probes, two sweeps) from the middle: eight of the sixteen corners,
# exact to third degree; and four for a probe and a sweep against a point.
_SIDES = (-1.0, 1.0)
_CORNERS = np.array([[1.0, a, b, c, a * b * c] for a in _SIDES for b in _SIDES for c in _SIDES])
_POINT_CORNERS = np.array([[1.0, a, b] for a in _SIDES for b in _SIDES])


class Footprint(NamedTuple):
    """What a ray covers around the middle of its patch; components first."""

    beam: FloatArray  # (3, ray) unit vector of the beam
    sweep_m: FloatArray  # (3, ray) from the start of the ray to its end
    lidar: IntArray  # (ray,)

    def take(self, index: IntArray) -> "Footprint":
        """Footprints of some rays, in that order."""
        return Footprint(
            self.beam.take(index, axis=1), self.sweep_m.take(index, axis=1), self.lidar.take(index)
        )


class Patches(NamedTuple):
    """Where rays measure in the air that moves with the wind; components first."""

    centre_m: FloatArray  # (3, ray)
    beam: FloatArray  # (3, ray) unit vector of the beam
    sweep_m: FloatArray  # (3, ray) from the start of the ray to its end
    lidar: IntArray  # (ray,)

    @property
    def footprint(self) -> Footprint:
        """The patches without their places."""
        return Footprint(self.beam, self.sweep_m, self.lidar)

    def take(self, index: IntArray) -> "Patches":
        """Patches of some rays, in that order."""
        return Patches(self.centre_m.take(index, axis=1), *self.footprint.take(index))


class Air(NamedTuple):
    """What every average over patches needs."""

    tensor: Correlation
    probes: tuple[Probe, ...]
    distant_m: float
    self_m: float

    @classmethod
    def of(cls, turbulence: Turbulence, probes: tuple[Probe, ...]) -> "Air":
        """The air of a turbulence model as these probes average it."""
        length_m, model = turbulence.length_m, turbulence.model
        return cls(
            correlation(turbulence), probes, DISTANT_LENGTHS[model] * length_m, SELF_LENGTHS[model] * length_m
        )


def pair_correlations(
    air: Air, first: Patches, second: Patches, moved_m: FloatArray, *, to_point: bool = False
) -> FloatArray:
    """Correlations (lag, pair) of pairs of patches, the second of which has moved upwind by (3, lag, pair)
    metres, or by (3, lag, 1).

    Overlapping pairs get nodes that crowd where they touch, near ones a fine rule, far ones two places for
    each offset, distant ones one place.
    """
    apart = (first.centre_m - second.centre_m)[:, None, :] + moved_m
    square = np.einsum("clp,clp->lp", apart, apart)
    spread = _spread(air.probes, first, second, to_point)
    near = square < (NEAR_SPREADS * spread) ** 2
    overlapping = near if len(air.probes) > 1 else square < (OVERLAP_SPREADS * spread) ** 2
    distant = ~near & (square > air.distant_m**2)
    out = np.empty(near.shape)
    ours, theirs = first.footprint, second.footprint
    flat, whole = apart.reshape(3, -1), out.reshape(-1)
    for mask, rule, places in (
        (overlapping, _overlapping, _POINT_PLACES if to_point else _OVERLAP_PLACES),
        (near & ~overlapping, _fine, _FINE_PLACES),
        (~(near | distant), _coarse, len(_CORNERS)),
        (distant, _single, 1),
    ):
        where = np.flatnonzero(mask)
        step = max(1, CHUNK_PLACES // places)
        for start in range(0, len(where), step):
            part = where[start : start + step]
            pair = part % mask.shape[1]
            distance = flat.take(part, axis=1)
            whole[part] = rule(air, ours.take(pair), theirs.take(pair), distance, to_point)
    return out


def _single(air: Air, first: Footprint, second: Footprint, apart_m: FloatArray, to_point: bool) -> FloatArray:
    """Correlation of the middles of two patches."""
    del to_point  # a point has no other middle
    return air.tensor(apart_m, first.beam, second.beam)


def _spread(probes: Sequence[Probe], first: Patches, second: Patches, to_point: bool) -> FloatArray:
    """(pair,) standard deviation of the offset between two places, one in each patch [m]."""
    std = np.array([probe.std_m for probe in probes])
    square = std[first.lidar] ** 2 + np.sum(first.sweep_m**2, axis=0) / 12
    if not to_point:
        square = square + std[second.lidar] ** 2 + np.sum(second.sweep_m**2, axis=0) / 12
    return np.asarray(np.sqrt(square))


def _coarse(air: Air, first: Footprint, second: Footprint, apart_m: FloatArray, to_point: bool) -> FloatArray:
    """Average over two patches that are far from each other: right to the third degree in the offsets."""
    std = np.array([probe.std_m for probe in air.probes])
    sides = [apart_m, first.beam * std[first.lidar], first.sweep_m * _UNIT_STD]
    if not to_point:
        sides += [second.beam * std[second.lidar], second.sweep_m * _UNIT_STD]
    corners = _POINT_CORNERS if to_point else _CORNERS
    places = corners @ np.stack(sides, axis=1)  # (3, corner, pair)
    values = air.tensor(places, first.beam[:, None], second.beam[:, None])
    return np.asarray(np.add.reduce(values, axis=0) / len(corners))


def _fine(air: Air, first: Footprint, second: Footprint, apart_m: FloatArray, to_point: bool) -> FloatArray:
    """Average over two patches that are near each other or overlap, by unequal Gauss rules."""
    one, weight_one = _places(air.probes, first, FIRST_NODES)
    if to_point:
        values = air.tensor(apart_m[:, None] + one, first.beam[:, None], second.beam[:, None])
        return np.asarray(np.einsum("ap,ap->p", weight_one, values))
    two, weight_two = _places(air.probes, second, SECOND_NODES)
    places = apart_m[:, None, None] + one[:, :, None] - two[:, None]
    values = air.tensor(places, first.beam[:, None, None], second.beam[:, None, None])
    return np.asarray(np.einsum("ap,bp,abp->p", weight_one, weight_two, values))


def _overlapping(
    air: Air, first: Footprint, second: Footprint, apart_m: FloatArray, to_point: bool
) -> FloatArray:
    """Average over two patches that overlap: along the first beam, nodes crowd where the second place is
    nearest; along the second, they part where the two beams are nearest.
    """
    out = np.empty(apart_m.shape[1])
    kinds = len(air.probes) * first.lidar + second.lidar
    for kind in np.unique(kinds):
        where = np.flatnonzero(kinds == kind)
        probes = [air.probes[lidar] for lidar in divmod(int(kind), len(air.probes))]
        one, two = first.take(where), second.take(where)
        swept, share = _between_sweeps(one, two, apart_m[:, where], to_point)
        if to_point:
            beside, weight = swept[:, None], share[None]
        else:
            along, beside_weight = _split(
                _nearest_of_second(one, two, swept), probes[1], _graded(OVERLAP_NODES[1], 1)
            )
            beside, weight = swept[:, None] - along * two.beam[:, None, None], beside_weight * share
        nearest = -np.einsum("cotp,cp->otp", beside, one.beam)
        along, inner = _split(nearest, probes[0], _graded(OVERLAP_NODES[0], 2))
        places = beside[:, None] + along * one.beam[:, None, None, None]
        values = air.tensor(places, one.beam[:, None, None, None], two.beam[:, None, None, None])
        weight = inner * weight
        out[where] = np.einsum("iotp,iotp->p", values, weight) / np.einsum("iotp->p", weight)
    return out


def _between_sweeps(
    first: Footprint, second: Footprint, apart_m: FloatArray, to_point: bool
) -> tuple[FloatArray, FloatArray]:
    """Separations (3, times, pair) of the gates at two times in each sweep, and weights (times, 1)."""
    turn, share = _legendre(2)
    early = apart_m[:, None] + 0.5 * turn[:, None] * first.sweep_m[:, None]
    if to_point:
        return early, 0.5 * share[:, None]
    late = 0.5 * turn[:, None] * second.sweep_m[:, None]
    both = early[:, :, None] - late[:, None]
    return both.reshape(3, -1, apart_m.shape[1]), np.outer(share, share).reshape(-1, 1) / 4


def _nearest_of_second(first: Footprint, second: Footprint, apart_m: FloatArray) -> FloatArray:
    """Offset (times, pair) along the second beam where the first one passes nearest [m].

    It is 0 for beams so nearly parallel that it makes no difference within a probe.
    """
    cosine = np.einsum("cp,cp->p", first.beam, second.beam)
    along = np.einsum("ctp,cp->tp", apart_m, second.beam) - cosine * np.einsum(
        "ctp,cp->tp", apart_m, first.beam
    )
    slant = 1 - cosine**2  # of a small crossing angle its square
    return np.asarray(np.where(slant > SHALLOW, along / np.maximum(slant, SHALLOW), 0.0))


def _split(
    at_m: FloatArray, probe: Probe, rule: tuple[FloatArray, FloatArray]
) -> tuple[FloatArray, FloatArray]:
    """Offsets along a probe (node, ...) and weights on both sides of a place (...), its middle where that is
    outside.
    """
    reach = 0.5 * probe.window_m + PULSE_REACH * probe.pulse_std_m
    part = np.where(np.abs(at_m) < reach, at_m, 0.0)
    node, weight = (values.reshape(-1, *(1,) * part.ndim) for values in rule)
    below, above = part + reach, reach - part
    offset = np.concatenate([part - below * node, part + above * node])
    return offset, np.concatenate([below * weight, above * weight]) * probe.weight(offset)


def _places(
    probes: Sequence[Probe], patches: Footprint, counts: tuple[int, int]
) -> tuple[FloatArray, FloatArray]:
    """Offsets (3, node, ray) and weights (node, ray) of a Gauss rule over each patch."""
    rules = [probe.nodes(counts[0]) for probe in probes]
    offset = np.stack([rule[0] for rule in rules])[patches.lidar].T
    weight = np.stack([rule[1] for rule in rules])[patches.lidar].T
    turn, share = _legendre(counts[1])
    along = np.repeat(offset, counts[1], axis=0)
    across = np.tile(0.5 * turn, counts[0])[:, None]
    places = along * patches.beam[:, None] + across * patches.sweep_m[:, None]
    return places, np.repeat(weight, counts[1], axis=0) * np.tile(0.5 * share, counts[0])[:, None]


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
        along, along_weight = _along_self(probe, counts[0], air.self_m, beside[mine])
        beam, sweep = patches.beam[:, mine], patches.sweep_m[:, mine]
        places = (along * beam[:, None])[:, :, None] + (part[:, mine] * sweep[:, None])[:, None]
        values = air.tensor(places, beam[:, None, None], beam[:, None, None])
        out[mine] = np.einsum("ap,bp,abp->p", along_weight, weight[:, mine], values)
    return out


def _across_self(air: Air, patches: Patches, count: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Largest offset (ray,) along the beam that comes with a sweep [m]; parts (node, ray) of the sweep
    between two times in it, either sign, and their weights.
    """
    along = np.abs(np.einsum("cr,cr->r", patches.sweep_m, patches.beam))
    across = np.sqrt(np.clip(np.einsum("cr,cr->r", patches.sweep_m, patches.sweep_m) - along**2, 0.0, None))
    end = np.minimum(1.0, air.self_m / np.maximum(across, air.self_m))
    node, share = _graded(count, 2)
    part = end * node[:, None]
    weight = end * share[:, None] * (1 - part)
    return end * along, np.concatenate([-part[::-1], part]), np.concatenate([weight[::-1], weight])


def _along_self(
    probe: Probe, count: int, reach_m: float, beside_m: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Offsets (node, ray) along the beam [m] between two places of one probe, and their weights, both signs."""
    offset, density, mass = _overlap(probe)
    end = np.minimum(offset[-1], reach_m + beside_m)
    node, share = _graded(count, 2)
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


@lru_cache(maxsize=16)
def _legendre(count: int) -> tuple[FloatArray, FloatArray]:
    return np.polynomial.legendre.leggauss(count)


@lru_cache(maxsize=16)
def _graded(count: int, power: int) -> tuple[FloatArray, FloatArray]:
    """Nodes and weights on 0 to 1: powers of Gauss-Legendre nodes, which crowd near 0 from the square on."""
    node, weight = np.polynomial.legendre.leggauss(count)
    half = 0.5 * (node + 1)
    return half**power, 0.5 * power * weight * half ** (power - 1)
