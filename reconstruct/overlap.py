"""The correlation averaged over two patches that overlap, where it has its cusp.

Along the first beam, nodes crowd where the second place is nearest; along the second, they part where the two beams
are nearest. Sweeps that pass many eddies are averaged over what one place is ahead of the other.
"""

from collections.abc import Callable
from functools import lru_cache

import numpy as np

from geometry.arrays import FloatArray
from geometry.gates import Probe
from reconstruct.correlation import Correlation
from reconstruct.footprints import Footprint, graded, legendre

SHALLOW = 0.05  # sine squared of the crossing angle under which two beams are as near all along a probe
PULSE_REACH = 3.5  # standard deviations of the pulse beyond the window, where the probe ends
LONG_NODES = 5  # either side of where two sweeps that are long against eddies are nearest
TABLE_STEPS = 2**12  # of the weighting of a probe, from its middle to its end

Between = Callable[[Footprint, Footprint, FloatArray, bool], tuple[FloatArray, FloatArray]]


def overlapping(
    nodes: tuple[int, int],
    between: Between,
    tensor: Correlation,
    first: Footprint,
    second: Footprint,
    apart_m: FloatArray,
    to_point: bool,
) -> FloatArray:
    """Average over two patches that overlap: along the first beam, nodes crowd where the second place is
    nearest; along the second, they part where the two beams are nearest.
    """
    swept, share = between(first, second, apart_m, to_point)
    if to_point:
        beside, weight = swept[:, None], share[None]
    else:
        nearest = _nearest_of_second(first, second, swept)
        along, beside_weight = _split(nearest, second.probe, graded(nodes[1], 1))
        beside, weight = swept[:, None] - along * second.beam[:, None, None], beside_weight * share
    nearest = -np.einsum("cotp,cp->otp", beside, first.beam)
    along, inner = _split(nearest, first.probe, graded(nodes[0], 2))
    places = beside[:, None] + along * first.beam[:, None, None, None]
    values = tensor(places, first.beam[:, None, None, None], second.beam[:, None, None, None])
    inner *= weight
    total = np.einsum("iotp,iotp->p", values, inner) / np.einsum("iotp->p", inner)
    return np.asarray(total * np.sum(share, axis=0))


def between_sweeps(
    first: Footprint, second: Footprint, apart_m: FloatArray, to_point: bool
) -> tuple[FloatArray, FloatArray]:
    """Separations (3, times, pair) of the gates at two times in each sweep, and weights (times, 1)."""
    turn, share = legendre(2)
    early = apart_m[:, None] + 0.5 * turn[:, None] * first.sweep_m[:, None]
    if to_point:
        return early, 0.5 * share[:, None]
    late = 0.5 * turn[:, None] * second.sweep_m[:, None]
    both = early[:, :, None] - late[:, None]
    return both.reshape(3, -1, apart_m.shape[1]), np.outer(share, share).reshape(-1, 1) / 4


def between_long_sweeps(
    reach_m: float, first: Footprint, second: Footprint, apart_m: FloatArray, to_point: bool
) -> tuple[FloatArray, FloatArray]:
    """The same where a sweep passes many eddies: only times at which the gates are within reach of each other.

    The longer sweep is taken as the direction of both. What one place is ahead of another in it has the density of two
    uniform variables of widths a and b: min(a, b)/(a b) in the middle, falling to 0 at (a + b)/2.
    """
    mine = np.linalg.norm(first.sweep_m, axis=0)
    theirs = np.zeros_like(mine) if to_point else np.linalg.norm(second.sweep_m, axis=0)
    longer = np.maximum(mine, theirs)
    shorter = np.maximum(np.minimum(mine, theirs), 1e-9 * longer)
    along = np.where(mine >= theirs, first.sweep_m, second.sweep_m) / longer
    half = 0.5 * (longer + shorter)
    nearest = np.clip(-np.einsum("cp,cp->p", apart_m, along), -half, half)
    node, share = (part[:, None] for part in graded(LONG_NODES, 2))
    below, above = np.minimum(reach_m, half + nearest), np.minimum(reach_m, half - nearest)
    ahead = nearest + np.concatenate([-below * node, above * node])
    density = np.clip(half - np.abs(ahead), 0.0, shorter) / (longer * shorter)
    weight = np.concatenate([below * share, above * share]) * density
    return apart_m[:, None] + ahead * along[:, None], weight


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
