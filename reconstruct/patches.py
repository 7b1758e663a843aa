"""The correlation of a turbulence model averaged over the patches of air that two rays measure in.

A ray covers a small patch: its probe along the beam, and across it the arc that the head sweeps during the
accumulation less the way the air went. The average over two patches is an integral over two probes and two
sweeps, of a correlation that has a cusp, 1 - C r^(2/3), where two places coincide. How finely it is done
depends on how far the patches are from each other: patches that overlap need nodes that crowd at the cusp.
"""

from collections.abc import Iterator, Sequence
from functools import lru_cache, partial
from itertools import product

import numpy as np

from geometry.arrays import BoolArray, FloatArray, IntArray
from geometry.gates import Probe
from reconstruct.correlation import Correlation
from reconstruct.footprints import Air, Footprint, Patches, legendre
from reconstruct.overlap import LONG_NODES, between_long_sweeps, between_sweeps, overlapping

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
CHUNK_PLACES = 2**13  # correlations evaluated at once: their arrays stay in the processor's cache
_FINE_PLACES = FIRST_NODES[0] * FIRST_NODES[1] * SECOND_NODES[0] * SECOND_NODES[1]
_UNIT_STD = np.sqrt(1.0 / 12.0)  # of a uniform variable of width 1
# Two places for each of four offsets (two probes, two sweeps) from the middle: eight of the sixteen corners,
# exact to third degree; and four for a probe and a sweep against a point.
_SIDES = (-1.0, 1.0)
_CORNERS = np.array([[1.0, a, b, c, a * b * c] for a in _SIDES for b in _SIDES for c in _SIDES])
_POINT_CORNERS = np.array([[1.0, a, b] for a in _SIDES for b in _SIDES])


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
    touching = near if len(air.probes) > 1 else square < (OVERLAP_SPREADS * spread) ** 2
    long = near & _sweeps_longer(air.long_m, first, second)
    touching = touching & ~long
    distant = ~near & (square > air.distant_m**2)
    out = np.empty(near.shape)
    flat, whole = apart.reshape(3, -1), out.reshape(-1)
    nodes = OVERLAP_NODES if len(air.probes) == 1 else CROSSING_OVERLAP_NODES
    probes = 2 * nodes[0] * (1 if to_point else 2 * nodes[1])
    shared = partial(between_long_sweeps, air.reach_m)
    for mask, rule, places in (
        (touching, partial(overlapping, nodes, between_sweeps), (2 if to_point else 4) * probes),
        (long, partial(overlapping, nodes, shared), 2 * LONG_NODES * probes),
        (near & ~(touching | long), _fine, _FINE_PLACES),
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
    turn, share = legendre(counts[1])
    along, across = (part.ravel() for part in np.meshgrid(offset, 0.5 * turn, indexing="ij"))
    return np.stack([along, across], axis=1), np.outer(weight, 0.5 * share).ravel()


def _sweeps_longer(than_m: float, first: Patches, second: Patches) -> BoolArray:
    """(pair,) whether one of the two sweeps is longer."""
    one, other = (np.einsum("cp,cp->p", patches.sweep_m, patches.sweep_m) for patches in (first, second))
    return np.asarray(np.maximum(one, other) > than_m**2)
