"""The silhouette of a hard target laid over a CNR map: how likely each place of its centre is."""

from typing import NamedTuple

import numpy as np

from geometry.arrays import BoolArray, FloatArray
from reconstruct.cnr_map import CnrMap
from reconstruct.silhouette import Look, Shape, shares
from reconstruct.target_image import BRIGHT_NOISES, BRIGHT_RAYS, MAD_PER_STD, Image

# Rays point a little aside of what the encoder says: the resolution of the WindScanner's head.
JITTER_DEG = 0.001

# Nodes and weights of means over a normal distribution (Gauss-Hermite, Abramowitz & Stegun 25.4.46).
HERMITE_NODES = np.array([-2.856970013872806, -1.355626179974266, 0.0, 1.355626179974266, 2.856970013872806])
HERMITE_WEIGHTS = np.array(
    [0.01125741132772069, 0.2220759220056126, 8 / 15, 0.2220759220056126, 0.01125741132772069]
)
SHORT_NODES, SHORT_WEIGHTS = (-(3.0**0.5), 0.0, 3.0**0.5), (1 / 6, 2 / 3, 1 / 6)

# A target may look wider or narrower than stated (a lattice, a flange): what fits best is taken.
WIDTHS = 9  # and as many more of up to a step's difference, weighed by their likelihood
LEAST_WIDTH_SHARE = 0.3
WIDTH_SHARES = (0.6, 0.7, 0.8, 0.9, 1.0, 1.1, 1.25, 1.4, 1.6)

# How well the width of the beam is taken to be known (k = 1): type B, ASSUMED.
BEAM_SHARE = 0.3

TAIL = 6.0  # standard deviations of the beam beyond which it is dark: 1e-9

CANDIDATES = 25  # centres tried side by side in each direction: half a standard deviation apart at the end
REFINEMENTS = 3
WIDE_STDS = 6.0  # half width of the next look, in standard deviations of the last one


class Fit(NamedTuple):
    """Centres tried, and how likely each is."""

    across_deg: FloatArray  # (a,) from the middle of the map
    up_deg: FloatArray  # (e,)
    likelihood: FloatArray  # (a, e) sums to 1
    height: float  # power of a full hit, at the best centre
    hit: FloatArray  # (ray,) at the best centre
    gain: float  # fall of the weighted squares below those of no target, at the best centre
    widened: float  # how much more the edges scatter than the weights say


def blurred(look: Look, azimuth_deg: float, elevation_deg: float) -> Look:
    """A wider beam: what a beam sees on average that points here and there by so much."""
    wide, high = np.hypot(look[1:], (azimuth_deg, elevation_deg))
    return Look(look.width_deg, float(wide), float(high))


def best_centre(
    cnr_map: CnrMap, image: Image, shape: Shape, look: Look, fit: Fit, weight: FloatArray
) -> tuple[tuple[float, float], tuple[float, float]]:
    """Centre and standard deviation across and up, with what target and beam may really be."""
    places = [_roomy(fit, axis, cnr_map.step_deg[axis]) for axis in (0, 1)]
    step = cnr_map.step_deg[1 if shape == "boom" else 0]
    least = LEAST_WIDTH_SHARE * look.width_deg
    widths = np.maximum(look.width_deg + step * np.linspace(-1.0, 1.0, WIDTHS), least)
    looks = [look._replace(width_deg=float(width)) for width in widths]
    mixed = _mixed(
        [_likelihood(image.power, weight, shape, tried, *cnr_map.aside_deg, places) for tried in looks]
    )
    beams = [
        Look(look.width_deg, *(beam * (1.0 + wider) for beam in look[1:]))
        for wider in (BEAM_SHARE, -BEAM_SHARE)
    ]
    others = [_likelihood(image.power, weight, shape, beam, *cnr_map.aside_deg, places) for beam in beams]
    found = []
    for axis in (0, 1):
        mean, std = _moments(mixed, axis)
        moved = 0.5 * (_moments(others[0], axis)[0] - _moments(others[1], axis)[0])
        found.append((mean, float(np.hypot(std, moved))))
    return found[0], found[1]


def _mixed(fits: list[Fit]) -> Fit:
    """Centres whatever the width, each width as likely as its squares say: the best, with the mixture."""
    best = max(fits, key=lambda fit: fit.gain)
    shares_of = [np.exp(0.5 * (fit.gain - best.gain) / best.widened) / fit.likelihood.max() for fit in fits]
    total = sum(share * fit.likelihood for share, fit in zip(shares_of, fits, strict=True))
    return best._replace(likelihood=total / np.sum(total))


def _roomy(fit: Fit, axis: int, step: float) -> FloatArray:
    """Centres to try where the target may look a little different: a step to each side at least."""
    mean, std = _moments(fit, axis)
    half = max(WIDE_STDS * std, step)
    return np.linspace(mean - half, mean + half, CANDIDATES)


def fit_silhouette(cnr_map: CnrMap, image: Image, shape: Shape, look: Look) -> tuple[Fit, FloatArray, Look]:
    """Lay the silhouette over the image at ever finer centres, as wide as fits best; with the weights used."""
    across, up = cnr_map.aside_deg
    steps = [max(step, 1e-6) for step in cnr_map.step_deg]
    bright = image.power > max(BRIGHT_NOISES * image.noise, 0.3 * float(np.quantile(image.power, 0.999)))
    bright |= image.power >= np.sort(image.power)[-BRIGHT_RAYS]
    centres = [
        np.linspace(angle[bright].min() - step, angle[bright].max() + step, CANDIDATES)
        for angle, step in ((across, steps[0]), (up, steps[1]))
    ]
    weight = np.ones_like(image.power)
    fit = _likelihood(image.power, weight, shape, look, across, up, centres)
    centres = [_closer(fit, axis, steps[axis]) for axis in (0, 1)]
    looks = [look._replace(width_deg=look.width_deg * share) for share in WIDTH_SHARES]
    fits = [_likelihood(image.power, weight, shape, tried, across, up, centres) for tried in looks]
    best = max(range(len(fits)), key=lambda number: fits[number].gain)
    look, fit = looks[best], fits[best]
    for _ in range(REFINEMENTS):
        weight = _weights(image, fit, shape, look, across, up, steps)
        centres = [_closer(fit, axis, steps[axis]) for axis in (0, 1)]
        fit = _likelihood(image.power, weight, shape, look, across, up, centres)
    return fit, weight, look


def _likelihood(
    power: FloatArray,
    weight: FloatArray,
    shape: Shape,
    look: Look,
    across: FloatArray,
    up: FloatArray,
    centres: list[FloatArray],
) -> Fit:
    """Likelihood of every centre; the scatter of the edges decides how sharp it is."""
    near = _near(shape, look, across, up, centres)  # the others are missed whatever the centre
    kept, weights = power[near], weight[near]
    a = shares(shape, look, across[None, near] - centres[0][:, None], np.zeros((1, 1)))[0]
    e = shares(shape, look, np.zeros((1, 1)), up[None, near] - centres[1][:, None])[1]
    a, e = (np.broadcast_to(part, (CANDIDATES, kept.size)) for part in (a, e))
    # without BLAS: products as small as these are not worth its threads, which wait for each other on a busy machine
    met = np.einsum("ar,er->ae", a * (weights * kept), e)
    own = np.maximum(np.einsum("ar,er->ae", a**2 * weights, e**2), 1e-300)
    gain = np.where(met > 0, met**2 / own, 0.0)  # fall of the weighted squares below those of no target
    best = np.unravel_index(int(gain.argmax()), gain.shape)
    height = float(met[best] / own[best])
    hit = np.zeros_like(power)
    hit[near] = a[best[0]] * e[best[1]]
    widened = _widening(kept - height * hit[near], weights, a, e, best)
    likelihood = np.exp(0.5 * (gain - gain[best]) / widened)
    return Fit(centres[0], centres[1], likelihood / likelihood.sum(), height, hit, float(gain[best]), widened)


def _near(
    shape: Shape, look: Look, across: FloatArray, up: FloatArray, centres: list[FloatArray]
) -> BoolArray:
    """Rays (ray,) that some centre's silhouette reaches."""
    half = 0.5 * look.width_deg
    wide, high = (half + TAIL * beam for beam in look[1:])
    beside = (across > centres[0].min() - wide) & (across < centres[0].max() + wide)
    if shape == "boom":
        return np.asarray((up > centres[1].min() - high) & (up < centres[1].max() + high))
    return np.asarray(beside if shape == "mast" else beside & (up < centres[1].max() + TAIL * look[2]))


def _widening(
    left: FloatArray, weight: FloatArray, a: FloatArray, e: FloatArray, best: tuple[np.intp, ...]
) -> float:
    """How much larger the variance of the centre is than the weights say, at least 1: sandwich over bread."""
    row, column = int(best[0]), int(best[1])
    ahead, back = (min(row + 1, len(a) - 1), max(row - 1, 0))
    higher, lower = (min(column + 1, len(e) - 1), max(column - 1, 0))
    slopes = ((a[ahead] - a[back]) * e[column], a[row] * (e[higher] - e[lower]))
    ratios = [1.0]
    for slope in slopes:
        bread = float((weight * slope**2).sum())
        if bread > 0:
            ratios.append(float((weight**2 * slope**2 * left**2).sum()) / bread)
    return max(ratios)


def _weights(
    image: Image,
    fit: Fit,
    shape: Shape,
    look: Look,
    across: FloatArray,
    up: FloatArray,
    steps: list[float],
) -> FloatArray:
    """One over the variance of each ray: of those that miss, and more where the target scatters."""
    soft = blurred(look, 0.5 * steps[0], 0.5 * steps[1])
    centre, stds = zip(_moments(fit, 0), _moments(fit, 1), strict=True)
    near = _near(shape, soft, across, up, [fit.across_deg, fit.up_deg])
    aside, above = across[near] - centre[0], up[near] - centre[1]
    wide, high = shares(shape, soft, aside, above)
    full = fit.hit > 0.9 * fit.hit.max()
    left = image.power[full] - fit.height * fit.hit[full]
    scatter = float(np.median(np.abs(left))) / MAD_PER_STD
    variance = np.full_like(across, image.noise**2)
    variance[near] += (scatter * wide * high) ** 2 + fit.height**2 * _shaken(shape, look, aside, above, stds)
    return np.asarray(1.0 / variance)


def _shaken(
    shape: Shape, look: Look, aside: FloatArray, above: FloatArray, stds: tuple[float, float]
) -> FloatArray:
    """Variance of a ray's share of the target because it points a little aside of where it says.

    By Gauss-Hermite quadrature over the jitter: a few beam widths from an edge the slope alone would call a ray sure
    that now and then hits. Averaged over where the centre may be (`stds`): else a ray that is taken for clear of the
    edge, and is not, would decide alone.
    """
    beams = np.sqrt(np.maximum(np.square(look[1:]) - JITTER_DEG**2, (0.1 * JITTER_DEG) ** 2))
    sharp = Look(look.width_deg, float(beams[0]), float(beams[1]))
    total = np.zeros_like(aside)
    for off, share in zip(SHORT_NODES, SHORT_WEIGHTS, strict=True):
        mean, square = np.ones_like(aside), np.ones_like(aside)
        for axis in (0, 1):
            moved = ((aside, above)[axis] + off * stds[axis]) + JITTER_DEG * HERMITE_NODES[:, None]
            pair = (moved, np.zeros((1, 1))) if axis == 0 else (np.zeros((1, 1)), moved)
            part = np.broadcast_to(shares(shape, sharp, *pair)[axis], moved.shape)
            mean, square = mean * (HERMITE_WEIGHTS @ part), square * (HERMITE_WEIGHTS @ part**2)
        total += share * np.maximum(square - mean**2, 0.0)
    return total


def _closer(fit: Fit, axis: int, step: float) -> FloatArray:
    """The next centres to try: as wide as the last ones are likely, or half a step where they are sharp."""
    mean, std = _moments(fit, axis)
    old = (fit.across_deg, fit.up_deg)[axis]
    cell = float(old[1] - old[0])
    half = min(max(WIDE_STDS * std, 2.0 * cell, 1e-3 * step), 0.5 * float(old[-1] - old[0]))
    return np.linspace(mean - half, mean + half, CANDIDATES)


def _moments(fit: Fit, axis: int) -> tuple[float, float]:
    """Mean and standard deviation of the centre [deg]; a cell of the candidates counts with its own width."""
    centres = (fit.across_deg, fit.up_deg)[axis]
    weight = fit.likelihood.sum(axis=1 - axis)
    mean = float((weight * centres).sum())
    cell = float(centres[1] - centres[0])
    return mean, float(np.sqrt((weight * (centres - mean) ** 2).sum() + cell**2 / 12.0))
