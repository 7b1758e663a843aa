"""The centre of a hard target in a CNR map: azimuth, elevation and range, each with its uncertainty."""

from typing import NamedTuple

import numpy as np

from geometry.angles import wrap_360_deg
from geometry.arrays import BoolArray, FloatArray
from geometry.errors import InputError
from geometry.gates import Probe
from reconstruct.cnr_map import CnrMap
from reconstruct.range_fit import peak_range
from reconstruct.silhouette import Look, Shape, look_of
from reconstruct.target_fit import JITTER_DEG, Fit, best_centre, blurred, fit_silhouette
from reconstruct.target_image import BRIGHT_NOISES, BRIGHT_RAYS, Image, image_of

# Diameter at 1/e² of the beam at the target where nothing is said: about the aperture of the long-range
# WindScanner, ASSUMED; it sets the sharpness of edges and hardly moves a centre.
BEAM_WIDTH_M = 0.1

SECOND_SHARE = 0.3  # another target counts from this share of the first one's power
CLEAR_STEPS = 2.0  # as far from the first one's silhouette [steps]
CLEAR_BEAMS = 4.0  # and standard deviations of beam and jitter: of 40,000 rays some graze it 3 beside it


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
    image = image_of(cnr_map, probe)
    azimuth, elevation = cnr_map.middle_deg
    near_m = float(cnr_map.range_m[image.gate])
    _refuse_edges("range", near_m, 0.5 * probe.length_m, cnr_map.range_m, cnr_map.gate_m)
    look = blurred(look_of(shape, size_m, beam_width_m, near_m, elevation), JITTER_DEG, JITTER_DEG)
    fit, weight, look = fit_silhouette(cnr_map, image, shape, look)
    across, up = best_centre(cnr_map, image, shape, look, fit, weight)
    if shape != "boom":
        _refuse_edges("azimuth", across[0], look.width_deg, cnr_map.aside_deg[0], cnr_map.step_deg[0])
    if shape != "mast":
        thick_deg = look.width_deg if shape == "boom" else 0.0  # of a tip the top alone counts
        _refuse_edges("elevation", up[0], thick_deg, cnr_map.aside_deg[1], cnr_map.step_deg[1])
    _refuse_second(cnr_map, image, fit, probe, shape, look, across[0], up[0])
    on_target = fit.hit >= 0.5 * fit.hit.max()
    found = peak_range(cnr_map.range_m, image.excess[on_target].astype(np.float64), near_m, probe)
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


def _refuse_edges(name: str, middle: float, width: float, scanned: FloatArray, step: float) -> None:
    """A target that the window cuts off has no centre to be found."""
    cut = middle + 0.5 * width > scanned.max() - step
    if cut or middle - 0.5 * width < scanned.min() + step:
        raise InputError(
            f"the target lies at the edge of the map's {name}: its centre cannot be told. Move the window "
            f"towards the {'larger' if cut else 'smaller'} {name} and measure again"
        )


def _refuse_second(
    cnr_map: CnrMap,
    image: Image,
    fit: Fit,
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
    clear = [
        max(CLEAR_STEPS * step, CLEAR_BEAMS * beam)
        for step, beam in zip(cnr_map.step_deg, look[1:], strict=True)
    ]
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
