"""What a beam sees of a hard target: the share of it that a mast, a boom or the tip of a mast takes away."""

from typing import Literal, NamedTuple

import numpy as np

from geometry.arrays import FloatArray

Shape = Literal["tip", "boom", "mast"]


class Look(NamedTuple):
    """Sizes as the map sees them [deg]."""

    width_deg: float  # of the mast in azimuth, or the thickness of the boom in elevation
    beam_azimuth_deg: float  # standard deviation of the beam in azimuth: wider in degrees at high elevation
    beam_elevation_deg: float


def look_of(shape: Shape, size_m: float, beam_width_m: float, range_m: float, elevation_deg: float) -> Look:
    """Turn sizes at a target into angles.

    Parameters
    ----------
    shape : {"tip", "boom", "mast"}
        What the target is.
    size_m : float
        Width of the mast or thickness of the boom [m].
    beam_width_m : float
        Diameter at 1/e² of the beam at the target [m]: four standard deviations.
    range_m, elevation_deg : float
        Where it is, by the instrument.

    Examples
    --------
    >>> look = look_of("mast", 1.0, 0.1, 1150.0, 6.0)
    >>> round(look.width_deg, 4), round(look.beam_elevation_deg, 5)
    (0.0501, 0.00125)
    """
    per_m = float(np.rad2deg(1.0 / range_m))
    wider = 1.0 / float(np.cos(np.deg2rad(elevation_deg)))
    width = size_m * per_m * (1.0 if shape == "boom" else wider)
    return Look(width, 0.25 * beam_width_m * per_m * wider, 0.25 * beam_width_m * per_m)


def shares(
    shape: Shape, look: Look, aside_deg: FloatArray, above_deg: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Share of the beam that hits, as the product of a part across and a part upward.

    Parameters
    ----------
    shape, look
        The target as the map sees it.
    aside_deg, above_deg : FloatArray, any shape
        Azimuth and elevation of rays less those of the target's centre [deg]: of the axis of a mast, the
        axis of a boom, the axis and the top of a tip.

    Returns
    -------
    tuple of FloatArray
        The two parts, each 0 to 1: ones where the shape has no end in that direction.
    """
    if shape == "boom":
        return np.ones_like(aside_deg), _strip(above_deg, look.width_deg, look.beam_elevation_deg)
    across = _strip(aside_deg, look.width_deg, look.beam_azimuth_deg)
    if shape == "mast":
        return across, np.ones_like(above_deg)
    from scipy.special import ndtr

    return across, np.asarray(ndtr(-above_deg / look.beam_elevation_deg))


def _strip(aside_deg: FloatArray, width_deg: float, beam_deg: float) -> FloatArray:
    """Share of a Gaussian beam within a strip."""
    from scipy.special import ndtr

    inner, outer = (aside_deg + side * 0.5 * width_deg for side in (1.0, -1.0))
    return np.asarray(ndtr(inner / beam_deg) - ndtr(outer / beam_deg))
