"""Where along the range a hard target stands: the peak of a thin one, the edge of a surface that ends the beam."""

from typing import NamedTuple

import numpy as np

from geometry.arrays import ArrayLike, FloatArray
from geometry.errors import InputError
from geometry.gates import Probe

PEAK_STEPS = 4  # Gauss-Newton steps from the nearest gate: the third changes micrometres
EDGE_STEPS = 30
EDGE_GATES = 6  # four numbers are fitted
LEAST_DAMPING = 1e-9  # of the steps: with less, numbers that do not tell on a ray make a singular matrix
# A fall within one gate tells no more than that: steeper [1/gate] is all the same, and its middle lies anywhere in the gate.
STEEPEST = 4.0
MIN_PEAK_RAYS = 2


class Range(NamedTuple):
    """A range [m] and its standard deviation [m]."""

    range_m: float
    std_m: float


def peak_range(range_m: FloatArray, excess: FloatArray, near_m: float, probe: Probe) -> Range:
    r"""Range of a thin target: the centre of a peak that has the shape of the probe.

    Parameters
    ----------
    range_m : FloatArray (gate,)
        Centres of the gates [m].
    excess : FloatArray (ray, gate)
        Power above the background, linear, of rays that hit the target.
    near_m : float
        Where the peak is, to a gate or so [m].
    probe : Probe
        Pulse and window: their convolution is the peak's shape.

    Returns
    -------
    Range
        Mean of the rays' own centres, weighted by their power squared; its standard deviation comes from how
        these scatter, so that noise which neighbouring gates share is counted as it is. NaN with fewer than
        two rays.

    Notes
    -----
    Each ray is fitted by :math:`a\,p(r - R) + b + c\int^r p`, linearised in :math:`R`: least squares for
    :math:`a, a\,\delta R, b, c`, all rays at once; :math:`b` is the air, :math:`c` what it loses behind the
    target.

    Examples
    --------
    >>> probe, gates = Probe(pulse_ns=200, window_ns=256), np.arange(1100.0, 1200.0)
    >>> rays = np.outer([1.0, 2.0, 3.0], probe.weight(gates - 1148.3))
    >>> round(peak_range(gates, rays, 1147.0, probe).range_m, 3)
    1148.3
    """
    found, spread = near_m, np.full(len(excess), np.nan)
    weight = np.ones(len(excess))
    for _ in range(PEAK_STEPS):
        height, shift = _shifts(range_m - found, excess, probe)
        weight = np.maximum(height, 0.0) ** 2
        if not weight.any():
            return Range(near_m, np.nan)
        step = float(np.clip(np.average(shift, weights=weight), -probe.length_m, probe.length_m))
        found, spread = found + step, shift - step
    share = weight / weight.sum()
    if len(excess) < MIN_PEAK_RAYS:
        return Range(found, np.nan)
    small_sample = 1.0 / (1.0 - float((share**2).sum()))
    return Range(found, float(np.sqrt(small_sample * (share**2 * spread**2).sum())))


def _shifts(offset_m: FloatArray, excess: FloatArray, probe: Probe) -> tuple[FloatArray, FloatArray]:
    """Height of each ray's peak and how far it stands from offset 0 [m], to first order."""
    small = 1e-3 * probe.length_m
    shape = probe.weight(offset_m)
    slope = (probe.weight(offset_m - small) - probe.weight(offset_m + small)) / (2.0 * small)
    behind = np.cumsum(shape)  # the air dims behind the target, as sharply as the probe allows
    columns = np.stack([shape, slope, np.ones_like(shape), behind], axis=1)
    fitted = np.linalg.lstsq(columns, excess.T, rcond=None)[0]
    with np.errstate(divide="ignore", invalid="ignore"):
        shift = np.where(fitted[0] > 0, fitted[1] / fitted[0], 0.0)
    limit = probe.length_m  # a ray of noise alone would throw the mean away; its weight is next to nothing
    return fitted[0], np.clip(shift, -limit, limit)


class Edge(NamedTuple):
    """Edges of one or many rays: low + (high - low)/(1 + exp(g(r - mid)))."""

    range_m: FloatArray  # (ray,) mid; NaN where there is no edge
    std_m: FloatArray  # (ray,)
    high_db: FloatArray  # (ray,) before the surface
    low_db: FloatArray  # (ray,) behind it
    steepness_per_m: FloatArray  # (ray,) g


def edge_range(range_m: ArrayLike, cnr_db: ArrayLike, *, steepness_per_m: float = 0.2) -> Edge:
    r"""Range of a surface that ends the beam (sea, wall): the middle of a fall in CNR.

    Parameters
    ----------
    range_m : array_like (gate,)
        Centres of the gates [m].
    cnr_db : array_like (ray, gate)
        Carrier-to-noise ratio [dB], NaN where missing.
    steepness_per_m : float
        Where the fit of g begins [1/m].

    Returns
    -------
    Edge
        One for each ray; NaN where the fall is no larger than what scatters around it, or where its middle
        is not between the first and last gate.

    Raises
    ------
    InputError
        If the shapes do not fit or there are fewer than six gates.

    Notes
    -----
    :math:`\mathrm{CNR}(r) = l + (h - l)/(1 + e^{g(r - m)})`; typical h -8 dB, l -30 dB, g 0.2/m: Rott et al.
    (2022), Wind Energ. Sci. 7, 283, doi:10.5194/wes-7-283-2022. Damped Gauss-Newton for all rays together.
    The standard deviation takes the gates' noise as independent; where the fall lies within a gate, it is
    that of a place anywhere in it (gate/√12) at least.

    Examples
    --------
    >>> gates = np.arange(400.0, 560.0)
    >>> edge = edge_range(gates, [-30 + 22 / (1 + np.exp(0.2 * (gates - 477.68)))])
    >>> edge.range_m.round(2).tolist(), edge.high_db.round(2).tolist()
    ([477.68], [-8.0])
    """
    ranges, cnr = np.asarray(range_m, dtype=np.float64), np.asarray(cnr_db, dtype=np.float64)
    if cnr.ndim != 2 or ranges.shape != cnr.shape[1:] or ranges.size < EDGE_GATES:
        raise InputError(
            f"ranges of shape {ranges.shape} and CNR of {cnr.shape} came; allowed: (gate,) and (ray, gate), "
            "six gates or more"
        )
    known = np.isfinite(cnr)
    data = np.where(known, cnr, 0.0)
    fitted = _edge_start(ranges, data, known, steepness_per_m)
    error = _edge_error(ranges, data, known, fitted)
    damping = np.full(len(cnr), 1e-3)
    steepest = STEEPEST / float(np.median(np.diff(ranges)))
    for _ in range(EDGE_STEPS):
        tried = fitted + _edge_step(ranges, data, known, fitted, damping)
        tried[:, 3] = np.clip(tried[:, 3], -steepest, steepest)
        tried_error = _edge_error(ranges, data, known, tried)
        better = tried_error <= error
        fitted, error = np.where(better[:, None], tried, fitted), np.where(better, tried_error, error)
        damping = np.clip(damping * np.where(better, 0.2, 10.0), LEAST_DAMPING, 1e9)
    return _edges(ranges, known, fitted, error, steepest)


def _edge_start(ranges: FloatArray, data: FloatArray, known: FloatArray, steepness: float) -> FloatArray:
    """High, low, mid and g (ray, 4) to begin with: the middle is where a step fits best."""
    count = np.cumsum(known, axis=1)
    total = np.cumsum(data, axis=1)
    behind = np.maximum(count[:, -1:] - count, 1)
    high, low = total / np.maximum(count, 1), (total[:, -1:] - total) / behind
    split = ((high - low) ** 2 * count * behind)[:, :-1].argmax(axis=1)
    rows = np.arange(len(data))
    start = np.stack([high[rows, split], low[rows, split], ranges[split], np.zeros(len(data))], axis=1)
    start[:, 3] = steepness
    return start


def _edge_parts(ranges: FloatArray, fitted: FloatArray) -> tuple[FloatArray, FloatArray]:
    """How much of the beam is still there (ray, gate), and the distance from the middle [m]."""
    aside = ranges[None, :] - fitted[:, 2:3]
    return 0.5 * (1.0 - np.tanh(0.5 * fitted[:, 3:4] * aside)), aside


def _edge_error(ranges: FloatArray, data: FloatArray, known: FloatArray, fitted: FloatArray) -> FloatArray:
    share, _ = _edge_parts(ranges, fitted)
    model = fitted[:, 1:2] + (fitted[:, :1] - fitted[:, 1:2]) * share
    return np.asarray((known * (data - model) ** 2).sum(axis=1))


def _edge_slopes(ranges: FloatArray, fitted: FloatArray) -> FloatArray:
    """Derivatives (ray, gate, 4) of the curve to high, low, mid and g."""
    share, aside = _edge_parts(ranges, fitted)
    fall = (fitted[:, :1] - fitted[:, 1:2]) * share * (1.0 - share)
    return np.stack([share, 1.0 - share, fall * fitted[:, 3:4], -fall * aside], axis=2)


def _edge_step(
    ranges: FloatArray, data: FloatArray, known: FloatArray, fitted: FloatArray, damping: FloatArray
) -> FloatArray:
    slopes = _edge_slopes(ranges, fitted) * known[:, :, None]
    share, _ = _edge_parts(ranges, fitted)
    left = known * (data - fitted[:, 1:2] - (fitted[:, :1] - fitted[:, 1:2]) * share)
    normal = np.einsum("rgi,rgj->rij", slopes, slopes)
    scale = np.einsum("rii->ri", normal) + 1e-12
    damped = normal + (damping[:, None] * scale)[:, :, None] * np.eye(4)
    right = np.einsum("rgi,rg->ri", slopes, left)
    return np.asarray(np.linalg.solve(damped, right[:, :, None])[:, :, 0])


def _edges(
    ranges: FloatArray, known: FloatArray, fitted: FloatArray, error: FloatArray, steepest: float
) -> Edge:
    """What is an edge, with its uncertainty; NaN for what is not."""
    slopes = _edge_slopes(ranges, fitted) * known[:, :, None]
    normal = np.einsum("rgi,rgj->rij", slopes, slopes)
    noise = error / np.maximum(known.sum(axis=1) - 4, 1)
    covariance = np.linalg.pinv(normal) * noise[:, None, None]
    within_gate_m = STEEPEST / steepest / np.sqrt(12.0) * (fitted[:, 3] >= steepest)
    std = np.hypot(np.sqrt(np.maximum(covariance[:, 2, 2], 0.0)), within_gate_m)
    fall = fitted[:, 0] - fitted[:, 1]
    sound = (fall > 3.0 * np.sqrt(noise)) & (fitted[:, 3] > 0)
    sound &= (fitted[:, 2] > ranges[0]) & (fitted[:, 2] < ranges[-1])
    kept = np.where(sound[:, None], fitted, np.nan)
    return Edge(kept[:, 2], np.where(sound, std, np.nan), kept[:, 0], kept[:, 1], kept[:, 3])
