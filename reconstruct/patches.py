"""Where rays measure in the air that moves with the wind, and the correlation of a model averaged over that.

A ray covers a small patch: its probe along the beam, and across it the arc that the head sweeps during the
accumulation less the way the air went. The average over two patches is an integral over two probes and two
sweeps, of a correlation that has a cusp, 1 - C r^(2/3), where two places coincide. How finely it is done
depends on how far the patches are from each other: patches that overlap need nodes that crowd at the cusp.
"""

from collections.abc import Iterator, Sequence
from functools import lru_cache, partial
from itertools import product
from typing import NamedTuple

import numpy as np

from geometry.arrays import BoolArray, FloatArray, IntArray
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
# Their number on each side, along the first and the second beam: right to 1e-4 of the variance, and 7e-5 for
# lidars that cross.
OVERLAP_NODES, CROSSING_OVERLAP_NODES = (8, 6), (10, 8)
SHALLOW = 0.05  # sine squared of the crossing angle under which two beams are as near all along a probe
PULSE_REACH = 3.5  # standard deviations of the pulse beyond the window, where the probe ends
# Probe and sweep of a ray with itself, graded towards no offset: to 1e-3 of the variance, and 1e-4 for
# lidars that cross; to 5e-3 of what is left where eddies are small against the patch.
SELF_NODES, CROSSING_SELF_NODES = (8, 5), (16, 8)
# In a larger patch the nodes end that many integral lengths off, where two places know nothing of each other
# (von Karman: exp(-9)): what a patch of size A leaves then falls like length over A, as it has to.
SELF_LENGTHS = {"von-karman": 12.0, "kaimal": 25.0, "mann": 30.0}
OVERLAP_REACH = 4.0  # standard deviations beyond the windows, where the offset of two places in a probe ends
TABLE_STEPS = 2**12  # of the weighting of a probe, from its middle to its end
CHUNK_PLACES = 2**13  # correlations evaluated at once: their arrays stay in the processor's cache
_FINE_PLACES = FIRST_NODES[0] * FIRST_NODES[1] * SECOND_NODES[0] * SECOND_NODES[1]
_UNIT_STD = np.sqrt(1.0 / 12.0)  # of a uniform variable of width 1
# Two places for each of four offsets (two probes, two sweeps) from the middle: eight of the sixteen corners,
# exact to third degree; and four for a probe and a sweep against a point.
_SIDES = (-1.0, 1.0)
_CORNERS = np.array([[1.0, a, b, c, a * b * c] for a in _SIDES for b in _SIDES for c in _SIDES])
_POINT_CORNERS = np.array([[1.0, a, b] for a in _SIDES for b in _SIDES])


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
    flat, whole = apart.reshape(3, -1), out.reshape(-1)
    nodes = OVERLAP_NODES if len(air.probes) == 1 else CROSSING_OVERLAP_NODES
    for mask, rule, places in (
        (overlapping, partial(_overlapping, nodes), 4 * nodes[0] * (1 if to_point else 4 * nodes[1])),
        (near & ~overlapping, _fine, _FINE_PLACES),
        (~(near | distant), _coarse, len(_CORNERS)),
        (distant, _single, 1),
    ):
        for part, (one, other) in _parts(air.probes, first, second, mask, CHUNK_PLACES // places):
            pair = part % mask.shape[1]
            ours, theirs = first.footprint(pair, one), second.footprint(pair, other)
            whole[part] = rule(air.tensor, ours, theirs, flat.take(part, axis=1), to_point)
    return out


def _parts(
    probes: tuple[Probe, ...], first: Patches, second: Patches, mask: BoolArray, most: int
) -> Iterator[tuple[IntArray, tuple[Probe, Probe]]]:
    """Places in a mask (lag, pair), counted through, that share both probes, at most so many; and these."""
    where = np.flatnonzero(mask)
    kinds = [where]
    if len(probes) > 1:
        pair = where % mask.shape[1]
        kind = len(probes) * first.lidar[pair] + second.lidar[pair]
        kinds = [where[kind == number] for number in range(len(probes) ** 2)]
    for both, places in zip(product(probes, probes), kinds, strict=True):
        for start in range(0, len(places), max(1, most)):
            yield places[start : start + max(1, most)], both


def _single(
    tensor: Correlation, first: Footprint, second: Footprint, apart_m: FloatArray, to_point: bool
) -> FloatArray:
    """Correlation of the middles of two patches."""
    del to_point  # a point has no other middle
    return tensor(apart_m, first.beam, second.beam)


def _spread(probes: Sequence[Probe], first: Patches, second: Patches, to_point: bool) -> FloatArray:
    """(pair,) standard deviation of the offset between two places, one in each patch [m]."""
    std = np.array([probe.std_m for probe in probes])
    square = std[first.lidar] ** 2 + np.sum(first.sweep_m**2, axis=0) / 12
    if not to_point:
        square = square + std[second.lidar] ** 2 + np.sum(second.sweep_m**2, axis=0) / 12
    return np.asarray(np.sqrt(square))


def _coarse(
    tensor: Correlation, first: Footprint, second: Footprint, apart_m: FloatArray, to_point: bool
) -> FloatArray:
    """Average over two patches that are far from each other: right to the third degree in the offsets."""
    sides = [apart_m, first.beam * first.probe.std_m, first.sweep_m * _UNIT_STD]
    if not to_point:
        sides += [second.beam * second.probe.std_m, second.sweep_m * _UNIT_STD]
    corners = _POINT_CORNERS if to_point else _CORNERS
    places = corners @ np.stack(sides, axis=1)  # (3, corner, pair)
    values = tensor(places, first.beam[:, None], second.beam[:, None])
    return np.asarray(np.add.reduce(values, axis=0) / len(corners))


def _fine(
    tensor: Correlation, first: Footprint, second: Footprint, apart_m: FloatArray, to_point: bool
) -> FloatArray:
    """Average over two patches that are near each other or overlap, by unequal Gauss rules."""
    one, weight = _patch_rule(first.probe, FIRST_NODES)
    places = apart_m[:, None] + one @ np.stack([first.beam, first.sweep_m], axis=1)
    if to_point:
        return np.asarray(weight @ tensor(places, first.beam[:, None], second.beam[:, None]))
    two, weight_two = _patch_rule(second.probe, SECOND_NODES)
    late = two @ np.stack([second.beam, second.sweep_m], axis=1)
    both = places[:, :, None] - late[:, None]
    values = tensor(both, first.beam[:, None, None], second.beam[:, None, None])
    return np.asarray(np.outer(weight, weight_two).ravel() @ values.reshape(-1, apart_m.shape[1]))


@lru_cache(maxsize=64)
def _patch_rule(probe: Probe, counts: tuple[int, int]) -> tuple[FloatArray, FloatArray]:
    """Gauss rule over a patch: (node, 2) offsets along the beam [m] and parts of the sweep, weights (node,)."""
    offset, weight = probe.nodes(counts[0])
    turn, share = _legendre(counts[1])
    along, across = (part.ravel() for part in np.meshgrid(offset, 0.5 * turn, indexing="ij"))
    return np.stack([along, across], axis=1), np.outer(weight, 0.5 * share).ravel()


def _overlapping(
    nodes: tuple[int, int],
    tensor: Correlation,
    first: Footprint,
    second: Footprint,
    apart_m: FloatArray,
    to_point: bool,
) -> FloatArray:
    """Average over two patches that overlap: along the first beam, nodes crowd where the second place is
    nearest; along the second, they part where the two beams are nearest.
    """
    swept, share = _between_sweeps(first, second, apart_m, to_point)
    if to_point:
        beside, weight = swept[:, None], share[None]
    else:
        nearest = _nearest_of_second(first, second, swept)
        along, beside_weight = _split(nearest, second.probe, _graded(nodes[1], 1))
        beside, weight = swept[:, None] - along * second.beam[:, None, None], beside_weight * share
    nearest = -np.einsum("cotp,cp->otp", beside, first.beam)
    along, inner = _split(nearest, first.probe, _graded(nodes[0], 2))
    places = beside[:, None] + along * first.beam[:, None, None, None]
    values = tensor(places, first.beam[:, None, None, None], second.beam[:, None, None, None])
    inner *= weight
    return np.asarray(np.einsum("iotp,iotp->p", values, inner) / np.einsum("iotp->p", inner))


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
    return offset, np.concatenate([below * weight, above * weight]) * _probe_weight(probe, offset)


def _probe_weight(probe: Probe, offset_m: FloatArray) -> FloatArray:
    """Weight of the air at places in the probe [1/m], from a table: right to 1e-6 of that in the middle."""
    per_m, weight, step = _probe_table(probe)
    place = np.minimum(np.abs(offset_m) * per_m, len(weight) - 1e-6)
    index = place.astype(np.intp)
    return np.asarray(weight.take(index) + (place - index) * step.take(index))


@lru_cache(maxsize=64)
def _probe_table(probe: Probe) -> tuple[float, FloatArray, FloatArray]:
    """Steps per metre, the weight at each, and what it grows by to the next."""
    reach = 0.5 * probe.window_m + (PULSE_REACH + 1) * probe.pulse_std_m
    weight = probe.weight(np.linspace(0.0, reach, TABLE_STEPS + 1))
    return TABLE_STEPS / reach, weight[:-1], np.diff(weight)


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
