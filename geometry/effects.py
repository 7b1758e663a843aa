"""How much each geometric effect matters in a scene: metres at the target if it were left out."""

from typing import NamedTuple

import numpy as np

from geometry.arrays import ArrayLike, FloatArray
from geometry.earth import EARTH_RADIUS_M, curvature_drop_m, refraction_lift_m
from geometry.frames import EarthModel, SiteFrame

# A fair guess where a site does not state its undulation: Europe has 25 to 55 m (EGM2008), the Earth at most
# 107 m.
UNKNOWN_UNDULATION_M = 40.0

# Rough upper bound of the deflection of the vertical in mountains; over plains and sea 5 arc seconds is
# usual. A round number, not measured at any site.
DEFLECTION_ARCSEC = 30.0


class EffectSizes(NamedTuple):
    """Distance [m] by which each effect alone moves a target, seen from a head; all of shape (...)."""

    convergence_m: FloatArray  # grid north taken for true north
    scale_m: FloatArray  # grid distance taken for ground distance (point scale and height factor at the head)
    change_along_beam_m: FloatArray  # convergence and scale taken from the head for the whole beam
    curvature_m: FloatArray
    refraction_m: FloatArray
    geoid_m: FloatArray  # heights above sea level taken for ellipsoidal ones
    deflection_of_vertical_m: FloatArray  # no earth model has it: a bound


def effect_sizes_m(frame: SiteFrame, origin_m: ArrayLike, points_m: ArrayLike) -> EffectSizes:
    r"""Measure what leaving out each effect would cost at points seen from a head.

    Parameters
    ----------
    frame
        The site's frame. Where it states no undulation, `UNKNOWN_UNDULATION_M` stands in.
    origin_m
        Easting, northing, height of the head [m], shape (3,).
    points_m
        Easting, northing, height [m], shape (..., 3).

    Returns
    -------
    EffectSizes
        Sizes [m], not negative, each of shape (...).

    Raises
    ------
    InputError
        As `SiteFrame.enu_m`.

    Notes
    -----
    With the grid distance d, convergence γ, scale k, ellipsoidal height h and undulation N:
    :math:`2d\sin(|\gamma|/2)`, :math:`d\,|(1+h/R)/k-1|`, :math:`d^2/2R`, :math:`k_r d^2/2R`, :math:`d|N|/R`
    and :math:`d\,\delta`; the change along the beam is the error of the ``curved`` model, which has all the
    rest but refraction.

    Examples
    --------
    >>> frame = SiteFrame("EPSG:32632")
    >>> sizes = effect_sizes_m(frame, [448937.717, 6256404.894, 5.409], [447647.39, 6255435.76, 121.336])
    >>> {name: round(float(size), 3) for name, size in sizes._asdict().items()}  # doctest: +ELLIPSIS
    {'convergence_m': 19.445, 'scale_m': 0.595, ...}
    """
    offset = frame.enu_m(origin_m, points_m, model="flat-grid")
    distance = np.asarray(np.hypot(offset[..., 0], offset[..., 1]))
    head_height = frame.geographic(origin_m)[2]
    ground_per_grid = (1.0 + head_height / EARTH_RADIUS_M) / frame.scale_factor(origin_m)
    half_turn = 0.5 * np.abs(np.deg2rad(frame.convergence_deg(origin_m)))
    return EffectSizes(
        convergence_m=np.asarray(2.0 * distance * np.sin(half_turn)),
        scale_m=np.asarray(distance * np.abs(ground_per_grid - 1.0)),
        change_along_beam_m=model_error_m(frame, origin_m, points_m, "curved"),
        curvature_m=curvature_drop_m(distance),
        refraction_m=refraction_lift_m(distance),
        geoid_m=np.asarray(distance * abs(_undulation_m(frame)) / EARTH_RADIUS_M),
        deflection_of_vertical_m=np.asarray(distance * np.deg2rad(DEFLECTION_ARCSEC / 3600.0)),
    )


def _undulation_m(frame: SiteFrame) -> float:
    """Undulation that heights would lack: none if they are ellipsoidal, the usual one if it is not stated."""
    if frame.height_datum == "ellipsoidal":
        return 0.0
    return UNKNOWN_UNDULATION_M if frame.geoid_undulation_m is None else frame.geoid_undulation_m


def model_error_m(
    frame: SiteFrame, origin_m: ArrayLike, points_m: ArrayLike, model: EarthModel
) -> FloatArray:
    """Distance by which an earth model misses the exact position of points.

    Parameters
    ----------
    frame
        The site's frame.
    origin_m
        Easting, northing, height of the head [m], shape (3,).
    points_m
        Easting, northing, height [m], shape (..., 3).
    model
        One of the five earth models.

    Returns
    -------
    FloatArray
        Distance between the model's and the exact east-north-up position [m], shape (...). For ``refracted``
        it contains the lift itself, which is not an error but where the bent beam is to be aimed.

    Examples
    --------
    >>> frame, head = SiteFrame("EPSG:32632"), [448937.717, 6256404.894, 5.409]
    >>> mast = [447647.39, 6255435.76, 121.336]
    >>> for model in ("flat-grid", "flat", "curved"):
    ...     print(model, round(float(model_error_m(frame, head, mast, model)), 3))
    flat-grid 19.458
    flat 0.204
    curved 0.002
    """
    exact = frame.enu_m(origin_m, points_m)
    return np.asarray(np.linalg.norm(frame.enu_m(origin_m, points_m, model=model) - exact, axis=-1))
