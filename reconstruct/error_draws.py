"""Random pointing, ranging, position and calibration errors of lidars, as they would befall a campaign.

What is common to the rays of one lidar (heading, levelling, position, clock, calibration, and the correlated
part of every other source) is drawn once in a realisation and stays through all its scans; the rest is new in
every ray.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from geometry.arrays import FloatArray
from geometry.errors import InputError
from reconstruct.rays import Rays
from reconstruct.uncertainty import ErrorSources

Sources = ErrorSources | Sequence[ErrorSources]


class Draws(NamedTuple):
    """Errors of the true beams against the planned ones, (..., scan, ray); one scan where nothing varies."""

    azimuth_deg: FloatArray
    elevation_deg: FloatArray
    range_m: FloatArray
    delay_s: FloatArray  # the ray happens later than its lidar says
    head_m: FloatArray  # (..., 1, ray, 3) east, north, up

    @classmethod
    def none(cls, rays: Rays) -> "Draws":
        """No error, for one realisation."""
        still = np.zeros((1, rays.count))
        return cls(still, still, still, still, np.zeros((1, rays.count, 3)))

    @property
    def any(self) -> bool:
        """Whether there is any error."""
        return any(bool(np.any(values)) for values in self)

    def mean(self) -> "Draws":
        """The errors of arrays (scan, ray) on average over the scans: what lasts."""
        return Draws(*(np.mean(values, axis=0, keepdims=True) for values in self))

    def realisation(self, index: int) -> "Draws":
        """The errors of one realisation, of arrays (realisation, scan, ray)."""
        return Draws(*(values[index] for values in self))

    def scans(self, part: slice) -> "Draws":
        """The errors of some scans, of arrays (scan, ray)."""
        return Draws(*(values[part] if len(values) > 1 else values for values in self))


def draw_pointing(sources: Sources, rays: Rays, shape: tuple[int, int], rng: np.random.Generator) -> Draws:
    """Draw the errors of beams, heads and clocks.

    Parameters
    ----------
    sources : ErrorSources or sequence of ErrorSources
        Standard deviations, for all lidars or one for each.
    rays : Rays
        The scan as planned.
    shape : tuple of int
        Number of realisations and of scans in each.
    rng : numpy.random.Generator
        Source of the numbers.

    Returns
    -------
    Draws
        Arrays (realisation, scan, ray), with one scan where nothing differs from scan to scan.

    Raises
    ------
    InputError
        If the number of sources is not the number of lidars.

    Notes
    -----
    Levelling is a small turn of the head about a level axis (parts e about east and n about north, each of
    the given standard deviation): b + (e, n, 0) x b raises the beam by e cosθ - n sinθ and turns it by tanφ
    (e sinθ + n cosθ).
    """
    std = _Stds(sources, rays)
    heading = std("heading_deg") * _common(rays, shape, rng)
    east, north = (std("levelling_deg") * _common(rays, shape, rng) for _ in range(2))
    azimuth, elevation = np.radians(rays.azimuth_deg), np.radians(rays.elevation_deg)
    turned = np.tan(elevation) * (east * np.sin(azimuth) + north * np.cos(azimuth))
    raised = east * np.cos(azimuth) - north * np.sin(azimuth)
    return Draws(
        azimuth_deg=heading + turned + _drawn(std, "azimuth", "deg", rays, shape, rng),
        elevation_deg=raised + _drawn(std, "elevation", "deg", rays, shape, rng),
        range_m=_drawn(std, "range", "m", rays, shape, rng),
        delay_s=std("clock_s") * _common(rays, shape, rng),
        head_m=np.stack([std("position_m") * _common(rays, shape, rng) for _ in range(3)], axis=-1),
    )


def draw_speed_errors(
    sources: Sources, rays: Rays, shape: tuple[int, int], rng: np.random.Generator
) -> tuple[FloatArray, FloatArray]:
    """Noise of the radial speed [m/s] and its calibration factor, (realisation, scan, ray) or one scan."""
    std = _Stds(sources, rays)
    factor = 1.0 + std("radial_speed_relative") * _common(rays, shape, rng)
    return _drawn(std, "radial_speed", "mps", rays, shape, rng), factor


class _Stds:
    """Value of each source for every ray."""

    def __init__(self, sources: Sources, rays: Rays) -> None:
        self._each = [sources] * len(rays.probes) if isinstance(sources, ErrorSources) else list(sources)
        self._lidar = rays.lidar
        if len(self._each) != len(rays.probes):
            raise InputError(
                f"{len(self._each)} error sources came for {len(rays.probes)} lidars: give 1 for all or each"
            )

    def __call__(self, name: str) -> FloatArray:
        return np.array([getattr(sources, name) for sources in self._each], dtype=float)[self._lidar]


def _common(rays: Rays, shape: tuple[int, int], rng: np.random.Generator) -> FloatArray:
    """Standard normal numbers (realisation, 1, ray), one for each lidar in a realisation."""
    return np.asarray(rng.standard_normal((shape[0], 1, len(rays.probes)))[..., rays.lidar])


def _drawn(
    std_of: _Stds, name: str, unit: str, rays: Rays, shape: tuple[int, int], rng: np.random.Generator
) -> FloatArray:
    """Errors whose correlated share of the variance is common to a lidar's rays in a realisation."""
    std, correlation = std_of(f"{name}_{unit}"), std_of(f"{name}_correlation")
    common = std * np.sqrt(correlation) * _common(rays, shape, rng)
    own = std * np.sqrt(1 - correlation)
    if not np.any(own > 0):
        return np.asarray(common)
    fresh = rng.standard_normal((*shape, rays.count))
    fresh *= own
    return np.asarray(fresh + common if np.any(common) else fresh)
