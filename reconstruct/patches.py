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
from reconstruct.correlation import Correlation

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
# lidars that cross.
SELF_NODES, CROSSING_SELF_NODES = (8, 5), (16, 8)
OVERLAP_REACH = 4.0  # standard deviations beyond the windows, where the offset of two places in a probe ends
CHUNK_PLACES = 2**13  # correlations evaluated at once: their arrays stay in the processor's cache
_FINE_PLACES = FIRST_NODES[0] * FIRST_NODES[1] * SECOND_NODES[0] * SECOND_NODES[1]
_POINT_PLACES = 2 * OVERLAP_NODES[0] * 2
_OVERLAP_PLACES = 2 * OVERLAP_NODES[1] * 2 * _POINT_PLACES
_UNIT_STD = np.sqrt(1.0 / 12.0)  # of a uniform variable of width 1
# Two places for each of four offsets (two probes, two sweeps): eight of the sixteen corners, exact to third
# degree.
_CORNERS = np.array([[a, b, c, a * b * c] for a in (-1.0, 1.0) for b in (-1.0, 1.0) for c in (-1.0, 1.0)])


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


class Air(NamedTuple):
    """What every average over patches needs."""

    tensor: Correlation
    probes: tuple[Probe, ...]
    distant_m: float


def pair_correlations(
    air: Air, first: Patches, second: Patches, moved_m: FloatArray, *, to_point: bool = False
) -> FloatArray:
    """Correlations (lag, pair) of pairs of patches, the second of which has moved upwind by (3, lag, 1)
    metres.

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
    for mask, rule, places in (
        (overlapping, _overlapping, _POINT_PLACES if to_point else _OVERLAP_PLACES),
        (near & ~overlapping, _fine, _FINE_PLACES),
        (~(near | distant), _coarse, len(_CORNERS)),
        (distant, _single, 1),
    ):
        lag, pair = np.nonzero(mask)
        step = max(1, CHUNK_PLACES // places)
        for start in range(0, len(pair), step):
            part = slice(start, start + step)
            one, two = first.take(pair[part]), second.take(pair[part])
            distance = apart[:, lag[part], pair[part]]
            out[lag[part], pair[part]] = rule(air, one, two, distance, to_point)
    return out


def _single(air: Air, first: Patches, second: Patches, apart_m: FloatArray, to_point: bool) -> FloatArray:
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


def _coarse(air: Air, first: Patches, second: Patches, apart_m: FloatArray, to_point: bool) -> FloatArray:
    """Average over two patches that are far from each other: right to the third degree in the offsets."""
    std = np.array([probe.std_m for probe in air.probes])
    corners = _CORNERS.T[:, :, None]
    shift = (
        corners[0] * (first.beam * std[first.lidar])[:, None]
        + corners[1] * (first.sweep_m * _UNIT_STD)[:, None]
    )
    if to_point:
        shift, corners = shift[:, ::2], corners[:, ::2]
    else:
        shift = shift - corners[2] * (second.beam * std[second.lidar])[:, None]
        shift -= corners[3] * (second.sweep_m * _UNIT_STD)[:, None]
    values = air.tensor(apart_m[:, None] + shift, first.beam[:, None], second.beam[:, None])
    return np.asarray(np.mean(values, axis=0))


def _fine(air: Air, first: Patches, second: Patches, apart_m: FloatArray, to_point: bool) -> FloatArray:
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
    air: Air, first: Patches, second: Patches, apart_m: FloatArray, to_point: bool
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
    first: Patches, second: Patches, apart_m: FloatArray, to_point: bool
) -> tuple[FloatArray, FloatArray]:
    """Separations (3, times, pair) of the gates at two times in each sweep, and weights (times, 1)."""
    turn, share = _legendre(2)
    early = apart_m[:, None] + 0.5 * turn[:, None] * first.sweep_m[:, None]
    if to_point:
        return early, 0.5 * share[:, None]
    late = 0.5 * turn[:, None] * second.sweep_m[:, None]
    both = early[:, :, None] - late[:, None]
    return both.reshape(3, -1, apart_m.shape[1]), np.outer(share, share).reshape(-1, 1) / 4


def _nearest_of_second(first: Patches, second: Patches, apart_m: FloatArray) -> FloatArray:
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
    probes: Sequence[Probe], patches: Patches, counts: tuple[int, int]
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
    """Share (ray,) that probe and sweep leave of the variance of a point."""
    nodes = SELF_NODES if len(air.probes) == 1 else CROSSING_SELF_NODES
    rules = [_self_rule(probe, nodes) for probe in air.probes]
    offset = np.stack([rule[0] for rule in rules])[patches.lidar].T
    weight = np.stack([rule[1] for rule in rules])[patches.lidar].T
    turn, share = rules[0][2], rules[0][3]
    places = offset[:, None] * patches.beam[:, None, None] + turn[:, None] * patches.sweep_m[:, None, None]
    values = air.tensor(places, patches.beam[:, None, None], patches.beam[:, None, None])
    return np.asarray(np.einsum("ap,b,abp->p", weight, share, values))


@lru_cache(maxsize=64)
def _self_rule(probe: Probe, nodes: tuple[int, int]) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Offsets along the beam and shares of the sweep between two places of one patch, with their weights.

    The offset of two independent places has the autocorrelation of the weighting; of two times in the sweep,
    a triangle. The correlation falls like r^(2/3) at first, so the nodes crowd near 0 (squared Gauss nodes).
    Positive offsets stand for both signs, since turning both signs changes nothing.
    """
    reach = probe.window_m + OVERLAP_REACH * np.sqrt(2) * probe.pulse_std_m
    fine = np.linspace(-1.1 * reach, 1.1 * reach, 4001)
    weight = probe.weight(fine)
    overlap = np.convolve(weight, weight, mode="same") * (fine[1] - fine[0])
    along, along_weight = _graded(nodes[0], 2)
    density = np.interp(reach * along, fine, overlap)
    along_weight = along_weight * density / np.sum(along_weight * density)
    across, across_weight = _graded(nodes[1], 2)
    triangle = across_weight * (1 - across)
    triangle = 0.5 * triangle / np.sum(triangle)
    return (
        reach * along,
        along_weight,
        np.concatenate([-across[::-1], across]),
        np.concatenate([triangle[::-1], triangle]),
    )


@lru_cache(maxsize=16)
def _legendre(count: int) -> tuple[FloatArray, FloatArray]:
    return np.polynomial.legendre.leggauss(count)


@lru_cache(maxsize=16)
def _graded(count: int, power: int) -> tuple[FloatArray, FloatArray]:
    """Nodes and weights on 0 to 1: powers of Gauss-Legendre nodes, which crowd near 0 from the square on."""
    node, weight = np.polynomial.legendre.leggauss(count)
    half = 0.5 * (node + 1)
    return half**power, 0.5 * power * weight * half ** (power - 1)
