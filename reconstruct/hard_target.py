"""The centre of a hard target in a CNR map: azimuth, elevation and range, each with its uncertainty."""

from typing import NamedTuple

import numpy as np

from geometry.angles import wrap_360_deg
from geometry.arrays import BoolArray, FloatArray, IntArray
from geometry.errors import InputError
from geometry.gates import Probe
from reconstruct.cnr_map import CnrMap
from reconstruct.range_fit import peak_range
from reconstruct.silhouette import Look, Shape, look_of, shares

MAD_PER_STD = 0.6745  # median absolute deviation of a normal distribution over its standard deviation

# Diameter at 1/e² of the beam at the target where nothing is said: about the aperture of the long-range
# WindScanner, ASSUMED; it sets the sharpness of edges and hardly moves a centre.
BEAM_WIDTH_M = 0.1

# Rays point a little aside of what the encoder says: the resolution of the WindScanner's head.
JITTER_DEG = 0.001

# A target may look wider or narrower than stated (a lattice, a flange): what fits best is taken.
WIDTHS = 9  # and as many more of up to a step's difference, weighed by their likelihood
LEAST_WIDTH_SHARE = 0.3
WIDTH_SHARES = (0.6, 0.7, 0.8, 0.9, 1.0, 1.1, 1.25, 1.4, 1.6)

# How well the width of the beam is taken to be known (k = 1): type B, ASSUMED.
BEAM_SHARE = 0.3

BRIGHT_NOISES = 8.0  # a ray hits something when it stands so many standard deviations above the others
BRIGHT_RAYS = 3  # and so many do
SECOND_SHARE = 0.3  # another target counts from this share of the first one's power
CLEAR_STEPS = 2.0  # as far from the first one's silhouette [steps]

SOME_RAYS = 2000  # give a median to 3 % of the scatter
GOLDEN = 0.5 * (5.0**0.5 - 1.0)

TAIL = 6.0  # standard deviations of the beam beyond which it is dark: 1e-9

CANDIDATES = 41  # centres tried side by side in each direction
REFINEMENTS = 3
WIDE_STDS = 6.0  # half width of the next look, in standard deviations of the last one


class FoundTarget(NamedTuple):
    """A target in the head's angles and the instrument's range; NaN where its shape does not tell."""

    azimuth_deg: float
    elevation_deg: float
    range_m: float
    azimuth_std_deg: float  # NaN: a boom has no azimuth (`azimuth_deg` is then the middle of the map)
    elevation_std_deg: float  # NaN: a mast has no elevation (`elevation_deg` is the middle of what was hit)
    range_std_m: float
    shape: Shape
    contrast_db: float  # power of a full hit over the scatter of rays that miss
    rays: int  # hit by at least half of the beam
    power: FloatArray  # (ray,) above the background at the target's range, 1 for a full hit
    hit: FloatArray  # (ray,) what the fitted silhouette says of the same


class _Image(NamedTuple):
    """The map at the range of the strongest return."""

    power: FloatArray  # (ray,) peak above the background, linear
    noise: float  # standard deviation of rays that miss
    gate: int
    excess: FloatArray  # (ray, gate) above each gate's background
    filtered: FloatArray  # (ray, gate) peak of probe shape that fits best at each gate


class _Fit(NamedTuple):
    """Centres tried, and how likely each is."""

    across_deg: FloatArray  # (a,) from the middle of the map
    up_deg: FloatArray  # (e,)
    likelihood: FloatArray  # (a, e) sums to 1
    height: float  # power of a full hit, at the best centre
    hit: FloatArray  # (ray,) at the best centre
    gain: float  # fall of the weighted squares below those of no target, at the best centre
    widened: float  # how much more the edges scatter than the weights say


def find_target(
    cnr_map: CnrMap, *, shape: Shape, size_m: float, probe: Probe, beam_width_m: float = BEAM_WIDTH_M
) -> FoundTarget:
    """Find the one hard target of a map.

    Parameters
    ----------
    cnr_map : CnrMap
        Rays around the target, gates at least as fine as a fifth of the probe.
    shape : {"tip", "boom", "mast"}
        A mast crosses the map upright: it tells azimuth and range. A boom crosses it level: elevation and
        range. A tip is a mast that ends in the map: all three, elevation that of its top.
    size_m : float
        Width of the mast or thickness of the boom [m].
    probe : Probe
        Pulse and window of the lidar.
    beam_width_m : float
        Diameter at 1/e² of the beam at the target [m].

    Returns
    -------
    FoundTarget

    Raises
    ------
    InputError
        If nothing, or more than one thing, stands out, or the target touches the window's edge.

    Notes
    -----
    Above each gate's median the power of every ray is matched with the probe's shape; at the range where most
    comes back, the silhouette (strip, blurred by the beam) is laid over the image at many centres. The
    likelihood of each follows from weighted squares, the height of the plateau being fitted; centre and
    uncertainty are its mean and standard deviation over centres and widths (0.6 to 1.6 times the stated
    one), so that an edge between two columns of rays is as unsure
    as it is. Weights: the scatter of rays that miss, and of those that hit. What the edges scatter more than
    that widens the uncertainty (sandwich covariance: White 1980, doi:10.2307/1912934), and so does what the
    centre moves by if the beam is 30 % wider or narrower than stated.

    Examples
    --------
    >>> from reconstruct.cnr_simulation import simulate_cnr_map
    >>> probe = Probe(pulse_ns=200, window_ns=256)
    >>> azimuth_deg, elevation_deg = (each.ravel() for each in np.meshgrid(np.arange(-.2, .2, .01), np.arange(-.2, .2, .01)))
    >>> mast = simulate_cnr_map(azimuth_deg, elevation_deg, np.arange(1100.0, 1200.0), target_m=[1.0, 1150.0, 0.0],
    ...     shape="mast", size_m=1.0, probe=probe, rng=np.random.default_rng(1))
    >>> found = find_target(mast, shape="mast", size_m=1.0, probe=probe)
    >>> round(found.azimuth_deg, 2), round(found.range_m), bool(found.azimuth_std_deg < 0.003)
    (0.05, 1150, True)
    """
    image = _image(cnr_map, probe)
    azimuth, elevation = cnr_map.middle_deg
    near_m = float(cnr_map.range_m[image.gate])
    look = _blurred(look_of(shape, size_m, beam_width_m, near_m, elevation), JITTER_DEG, JITTER_DEG)
    fit, weight, look = _fitted(cnr_map, image, shape, look)
    across, up = _centres(cnr_map, image, shape, look, fit, weight)
    _refuse_edges(cnr_map, image, shape, look, probe, across[0], up[0])
    _refuse_second(cnr_map, image, fit, probe, shape, look, across[0], up[0])
    on_target = fit.hit >= 0.5 * fit.hit.max()
    found = peak_range(cnr_map.range_m, image.excess[on_target], near_m, probe)
    if shape == "mast":
        up = (float(np.average(cnr_map.aside_deg[1], weights=fit.hit)), np.nan)
    if shape == "boom":
        across = (0.0, np.nan)
    # an upright mast is met farther out, the steeper the ray: 0.1 m at 1 km between 4.7 and 4.8 degrees
    steepness = np.cos(np.deg2rad(cnr_map.elevation_deg[on_target]))
    nearer = 1.0 if shape == "boom" else float(steepness.mean() / np.cos(np.deg2rad(elevation + up[0])))
    return FoundTarget(
        azimuth_deg=float(wrap_360_deg(azimuth + across[0])),
        elevation_deg=elevation + up[0],
        range_m=found.range_m * nearer,
        azimuth_std_deg=across[1],
        elevation_std_deg=up[1],
        range_std_m=found.std_m,
        shape=shape,
        contrast_db=10.0 * float(np.log10(fit.height / image.noise)),
        rays=int(on_target.sum()),
        power=image.power / fit.height,
        hit=fit.hit,
    )


def _image(cnr_map: CnrMap, probe: Probe) -> _Image:
    """The strongest return of the map, and the rays at its range."""
    power = np.exp(np.log(10.0) * 0.1 * cnr_map.cnr_db)
    missing = ~np.isfinite(power)
    some = _some(len(power))
    if missing.any():
        background = np.nanmedian(np.where(missing, np.nan, power)[some], axis=0)
        excess = np.where(missing, 0.0, power - background)
    else:
        excess = power - np.median(power[some], axis=0)
    shape = probe.weight(cnr_map.range_m[:, None] - cnr_map.range_m[None, :])
    shape /= (shape**2).sum(axis=0) / shape.max(axis=0)  # a peak of height 1 gives 1
    filtered = excess @ shape
    noise = _noise(filtered[some])
    above = np.where(filtered > BRIGHT_NOISES * noise, filtered, 0.0)
    gate = int((above**2).sum(axis=0).argmax())
    bright = int((above[:, gate] > 0).sum())
    if bright < BRIGHT_RAYS:
        strongest = float((filtered / noise).max())
        raise InputError(
            f"no hard target in the map: the strongest return stands {strongest:.1f} standard deviations above "
            f"the rays around it and {bright} rays hit; needed: {BRIGHT_NOISES:g} and {BRIGHT_RAYS}. "
            "Widen the window, or look at the range gates"
        )
    return _Image(filtered[:, gate], float(noise[gate]), gate, excess, filtered)


def _some(rays: int) -> IntArray:
    """Enough rays for a median, spread over the map without the beat of its rows and columns."""
    if rays <= SOME_RAYS:
        return np.arange(rays)
    return np.asarray((np.arange(SOME_RAYS) * GOLDEN % 1.0 * rays).astype(np.intp))


def _noise(filtered: FloatArray) -> FloatArray:
    """Standard deviation (gate,) of rays that miss: from below the median, where no target is."""
    quarter, half = len(filtered) // 4, len(filtered) // 2
    ordered = np.partition(filtered, (quarter, half), axis=0)
    return np.asarray((ordered[half] - ordered[quarter]) / MAD_PER_STD) + 1e-12


def _blurred(look: Look, azimuth_deg: float, elevation_deg: float) -> Look:
    """A wider beam: what a beam sees on average that points here and there by so much."""
    wide, high = np.hypot(look[1:], (azimuth_deg, elevation_deg))
    return Look(look.width_deg, float(wide), float(high))


def _centres(
    cnr_map: CnrMap, image: _Image, shape: Shape, look: Look, fit: _Fit, weight: FloatArray
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


def _mixed(fits: list[_Fit]) -> _Fit:
    """Centres whatever the width, each width as likely as its squares say: the best, with the mixture."""
    best = max(fits, key=lambda fit: fit.gain)
    shares_of = [np.exp(0.5 * (fit.gain - best.gain) / best.widened) / fit.likelihood.max() for fit in fits]
    total = sum(share * fit.likelihood for share, fit in zip(shares_of, fits, strict=True))
    return best._replace(likelihood=total / np.sum(total))


def _roomy(fit: _Fit, axis: int, step: float) -> FloatArray:
    """Centres to try where the target may look a little different: a step to each side at least."""
    mean, std = _moments(fit, axis)
    half = max(WIDE_STDS * std, step)
    return np.linspace(mean - half, mean + half, CANDIDATES)


def _fitted(cnr_map: CnrMap, image: _Image, shape: Shape, look: Look) -> tuple[_Fit, FloatArray, Look]:
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
) -> _Fit:
    """Likelihood of every centre; the scatter of the edges decides how sharp it is."""
    near = _near(shape, look, across, up, centres)  # the others are missed whatever the centre
    kept, weights = power[near], weight[near]
    a = shares(shape, look, across[None, near] - centres[0][:, None], np.zeros((1, 1)))[0]
    e = shares(shape, look, np.zeros((1, 1)), up[None, near] - centres[1][:, None])[1]
    a, e = (np.broadcast_to(part, (CANDIDATES, kept.size)) for part in (a, e))
    met = (a * (weights * kept)) @ e.T
    own = np.maximum((a**2 * weights) @ (e**2).T, 1e-300)
    gain = np.where(met > 0, met**2 / own, 0.0)  # fall of the weighted squares below those of no target
    best = np.unravel_index(int(gain.argmax()), gain.shape)
    height = float(met[best] / own[best])
    hit = np.zeros_like(power)
    hit[near] = a[best[0]] * e[best[1]]
    widened = _widening(kept - height * hit[near], weights, a, e, best)
    likelihood = np.exp(0.5 * (gain - gain[best]) / widened)
    return _Fit(
        centres[0], centres[1], likelihood / likelihood.sum(), height, hit, float(gain[best]), widened
    )


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
    image: _Image,
    fit: _Fit,
    shape: Shape,
    look: Look,
    across: FloatArray,
    up: FloatArray,
    steps: list[float],
) -> FloatArray:
    """One over the variance of each ray: of those that miss, and more where the target scatters."""
    blurred = _blurred(look, 0.5 * steps[0], 0.5 * steps[1])
    centre = (_moments(fit, 0)[0], _moments(fit, 1)[0])
    wide, high = shares(shape, blurred, across - centre[0], up - centre[1])
    full = fit.hit > 0.9 * fit.hit.max()
    left = image.power[full] - fit.height * fit.hit[full]
    scatter = float(np.median(np.abs(left))) / MAD_PER_STD
    shaken = _shaken(shape, look, across - centre[0], up - centre[1])
    return np.asarray(1.0 / (image.noise**2 + (scatter * wide * high) ** 2 + (fit.height * shaken) ** 2))


def _shaken(shape: Shape, look: Look, aside: FloatArray, above: FloatArray) -> FloatArray:
    """How much a ray's share of the target varies because it points a little aside of where it says."""
    pairs = ((JITTER_DEG, 0.0), (-JITTER_DEG, 0.0), (0.0, JITTER_DEG), (0.0, -JITTER_DEG))
    right, left, higher, lower = (
        np.multiply(*shares(shape, look, aside + across, above + up)) for across, up in pairs
    )
    return np.asarray(0.5 * np.hypot(right - left, higher - lower))


def _closer(fit: _Fit, axis: int, step: float) -> FloatArray:
    """The next centres to try: as wide as the last ones are likely, or half a step where they are sharp."""
    mean, std = _moments(fit, axis)
    old = (fit.across_deg, fit.up_deg)[axis]
    cell = float(old[1] - old[0])
    half = min(max(WIDE_STDS * std, 2.0 * cell, 1e-3 * step), 0.5 * float(old[-1] - old[0]))
    return np.linspace(mean - half, mean + half, CANDIDATES)


def _moments(fit: _Fit, axis: int) -> tuple[float, float]:
    """Mean and standard deviation of the centre [deg]; a cell of the candidates counts with its own width."""
    centres = (fit.across_deg, fit.up_deg)[axis]
    weight = fit.likelihood.sum(axis=1 - axis)
    mean = float((weight * centres).sum())
    cell = float(centres[1] - centres[0])
    return mean, float(np.sqrt((weight * (centres - mean) ** 2).sum() + cell**2 / 12.0))


def _refuse_edges(
    cnr_map: CnrMap, image: _Image, shape: Shape, look: Look, probe: Probe, across: float, up: float
) -> None:
    """A target that the window cuts off has no centre to be found."""
    sides = []
    half = 0.5 * look.width_deg
    if shape != "boom":
        sides.append(("azimuth", across - half, across + half, cnr_map.aside_deg[0], cnr_map.step_deg[0]))
    if shape != "mast":
        low = up - half if shape == "boom" else up
        high = up + half if shape == "boom" else up
        sides.append(("elevation", low, high, cnr_map.aside_deg[1], cnr_map.step_deg[1]))
    middle = cnr_map.range_m[image.gate]
    quarter = 0.25 * probe.length_m
    sides.append(("range", middle - quarter, middle + quarter, cnr_map.range_m, cnr_map.gate_m))
    for name, low, high, scanned, step in sides:
        if low < scanned.min() + step or high > scanned.max() - step:
            raise InputError(
                f"the target lies at the edge of the map's {name}: its centre cannot be told. Move the window "
                f"towards the {'larger' if high > scanned.max() - step else 'smaller'} {name} and measure again"
            )


def _refuse_second(
    cnr_map: CnrMap,
    image: _Image,
    fit: _Fit,
    probe: Probe,
    shape: Shape,
    look: Look,
    across: float,
    up: float,
) -> None:
    """Something else that shines in the map: which of them was meant is not for a program to guess."""
    enough = max(BRIGHT_NOISES * image.noise, SECOND_SHARE * fit.height)
    away = np.abs(cnr_map.range_m - cnr_map.range_m[image.gate]) > 1.5 * probe.length_m
    aside, above = (np.abs(each) for each in (cnr_map.aside_deg[0] - across, cnr_map.aside_deg[1] - up))
    clear = [CLEAR_STEPS * step for step in cnr_map.step_deg]
    off = np.zeros(aside.size, dtype=bool)
    if shape != "boom":
        off |= aside > 0.5 * look.width_deg + clear[0]
    if shape == "boom":
        off |= above > 0.5 * look.width_deg + clear[1]
    if shape == "tip":
        off |= cnr_map.aside_deg[1] - up > clear[1]
    _say_second(cnr_map, off & (image.power > enough), np.full(aside.size, image.gate))
    if away.any():
        peaks = np.where(away, image.filtered, -np.inf)
        _say_second(cnr_map, peaks.max(axis=1) > enough, peaks.argmax(axis=1))


def _say_second(cnr_map: CnrMap, bright: BoolArray, gate: FloatArray) -> None:
    if int(bright.sum()) < BRIGHT_RAYS:
        return
    middle = cnr_map.middle_deg
    azimuth, elevation = (
        float(np.median(each[bright])) + centre
        for each, centre in zip(cnr_map.aside_deg, middle, strict=True)
    )
    range_m = float(np.median(cnr_map.range_m[np.asarray(gate)[bright].astype(np.intp)]))
    raise InputError(
        f"two targets in one map: {int(bright.sum())} more rays hit something near azimuth {azimuth % 360:.2f}°, "
        f"elevation {elevation:.2f}°, range {range_m:.0f} m. Narrow the window or the ranges to one of them"
    )
