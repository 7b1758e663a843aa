"""The strongest return of a CNR map: its range gate, and how much of it each ray got."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from geometry.arrays import FloatArray, IntArray
from geometry.errors import InputError
from geometry.gates import Probe
from reconstruct.cnr_map import CnrMap

MAD_PER_STD = 0.6745  # median absolute deviation of a normal distribution over its standard deviation

BRIGHT_NOISES = 8.0  # a ray hits something when it stands so many standard deviations above the others
BRIGHT_RAYS = 3  # and so many do

SOME_RAYS = 2000  # give a median to 3 % of the scatter
GOLDEN = 0.5 * (5.0**0.5 - 1.0)

# Noise is 1e-2 of a return: single precision, 1e-7, is as good and takes half the time.
ImageArray = NDArray[np.float32]


class Image(NamedTuple):
    """The map at the range of the strongest return."""

    power: FloatArray  # (ray,) peak above the background, linear
    noise: float  # standard deviation of rays that miss
    gate: int
    excess: ImageArray  # (ray, gate) above each gate's background
    filtered: ImageArray  # (ray, gate) peak of probe shape that fits best at each gate


def image_of(cnr_map: CnrMap, probe: Probe) -> Image:
    """The strongest return of the map, and the rays at its range.

    Raises
    ------
    InputError
        If nothing stands out.
    """
    excess = _excess(cnr_map)
    shape = probe.weight(cnr_map.range_m[:, None] - cnr_map.range_m[None, :])
    shape /= (shape**2).sum(axis=0) / shape.max(axis=0)  # a peak of height 1 gives 1
    filtered = excess @ shape.astype(np.float32)
    noise = _noise(filtered[_some(len(filtered))])
    above = np.where(filtered > BRIGHT_NOISES * noise, filtered, 0.0)
    gate = int(np.einsum("rg,rg->g", above, above).argmax())
    bright = int((above[:, gate] > 0).sum())
    if bright < BRIGHT_RAYS:
        strongest = float((filtered.astype(np.float64) / noise).max())
        raise InputError(
            f"no hard target in the map: the strongest return stands {strongest:.1f} standard deviations above "
            f"the rays around it and {bright} rays hit; needed: {BRIGHT_NOISES:g} and {BRIGHT_RAYS}. "
            "Widen the window, or look at the range gates"
        )
    return Image(filtered[:, gate].astype(np.float64), float(noise[gate]), gate, excess, filtered)


def _excess(cnr_map: CnrMap) -> ImageArray:
    """Linear power (ray, gate) above the median of its gate; 0 where it is missing."""
    with np.errstate(over="ignore"):  # 385 dB and more are no measurement: missing
        power = np.exp(np.float32(0.1 * np.log(10.0)) * cnr_map.cnr_db.astype(np.float32))
    missing = ~np.isfinite(power)
    some = power[_some(len(power))]
    if not missing.any():
        return np.asarray(power - np.median(some, axis=0))
    some[~np.isfinite(some)] = np.nan
    known = np.isfinite(some).any(axis=0)
    background = np.zeros(power.shape[1], dtype=np.float32)
    background[known] = np.nanmedian(some[:, known], axis=0)
    return np.asarray(np.where(missing, np.float32(0.0), power - background))


def _some(rays: int) -> IntArray:
    """Enough rays for a median, spread over the map without the beat of its rows and columns."""
    if rays <= SOME_RAYS:
        return np.arange(rays)
    return np.asarray((np.arange(SOME_RAYS) * GOLDEN % 1.0 * rays).astype(np.intp))


def _noise(filtered: ImageArray) -> ImageArray:
    """Standard deviation (gate,) of rays that miss: from below the median, where no target is."""
    quarter, half = len(filtered) // 4, len(filtered) // 2
    ordered = np.partition(filtered, (quarter, half), axis=0)
    return np.asarray((ordered[half] - ordered[quarter]) / np.float32(MAD_PER_STD) + np.float32(1e-12))
