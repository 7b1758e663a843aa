"""How the radial speed of a beam answers to each thing that can be wrong, to first order.

The *true* beam is off while the retrieval uses the nominal one, so a beam turned by δb and a gate moved by δx
see e = δb · V + b · (∂V/∂x) δx; the errors are propagated as in the guide to the expression of uncertainty in
measurement (JCGM 100:2008, section 5). For azimuth and elevation with a wind that changes with height only
this is e = δθ (u cos θ - v sin θ) cos φ + δφ [-(u sin θ + v cos θ) sin φ + w cos φ] + (∂V/∂z · b)(r cos φ δφ
+ sin φ δr + δz).
"""

from typing import NamedTuple

import numpy as np

from geometry.arrays import FloatArray


class View(NamedTuple):
    """Beams and the air in their gates, each of one shape (...,)."""

    sin_azimuth: FloatArray
    cos_azimuth: FloatArray
    sin_elevation: FloatArray
    cos_elevation: FloatArray
    east: FloatArray  # parts of the beam's unit vector
    north: FloatArray
    range_m: FloatArray
    u_mps: FloatArray  # wind in the gate
    v_mps: FloatArray
    w_mps: FloatArray | float
    shear_per_s: FloatArray  # ∂V/∂z · b: what the beam sees of the shear
    lateral_per_s: float = 0.0  # growth of the speed to the right, looking downwind
    downwind: tuple[float, float] = (0.0, 0.0)  # (east, north) unit vector along the wind


def _drifted(view: View, east: FloatArray | float, north: FloatArray | float) -> FloatArray:
    """b · (∂V/∂x) δx for a gate moved over ground by (east, north): the lateral gradient alone answers."""
    along_east, along_north = view.downwind
    right = along_north * east - along_east * north
    along = view.east * along_east + view.north * along_north
    return np.asarray(view.lateral_per_s * along * right)


def relative(view: View) -> tuple[FloatArray]:
    """Radial speed [m/s]: the answer to a calibration wrong by the factor 1 + 1."""
    return (view.east * view.u_mps + view.north * view.v_mps + view.sin_elevation * view.w_mps,)


def azimuth(view: View) -> tuple[FloatArray]:
    """Answer to a beam that looks too far clockwise [m/s per rad]; also to a heading."""
    turned = view.u_mps * view.north - view.v_mps * view.east
    if view.lateral_per_s == 0:
        return (turned,)
    return (turned + _drifted(view, view.range_m * view.north, -view.range_m * view.east),)


def elevation(view: View) -> tuple[FloatArray]:
    """Answer to a beam that looks too high [m/s per rad]."""
    lowered = view.u_mps * view.sin_azimuth + view.v_mps * view.cos_azimuth
    turned = (
        view.w_mps + view.shear_per_s * view.range_m
    ) * view.cos_elevation - lowered * view.sin_elevation
    if view.lateral_per_s == 0:
        return (turned,)
    back = -view.range_m * view.sin_elevation
    return (turned + _drifted(view, back * view.sin_azimuth, back * view.cos_azimuth),)


def ranging(view: View) -> tuple[FloatArray]:
    """Answer to a gate that lies too far out [m/s per m]."""
    lifted = view.shear_per_s * view.sin_elevation
    return (lifted if view.lateral_per_s == 0 else lifted + _drifted(view, view.east, view.north),)


def tilt(view: View) -> tuple[FloatArray, FloatArray]:
    """Answers to a head turned about the axis that points east, and about the one that points north [m/s per
    rad].

    A head that is off level by pitch and roll of equal standard deviation is so about any two level axes. A
    turn by the small vector ω moves the beam by ω x b.
    """
    rise = view.w_mps + view.shear_per_s * view.range_m
    nod = rise * view.north - view.v_mps * view.sin_elevation
    lean = view.u_mps * view.sin_elevation - rise * view.east
    if view.lateral_per_s == 0:
        return nod, lean
    up = view.range_m * view.sin_elevation
    return nod + _drifted(view, 0.0, -up), lean + _drifted(view, up, 0.0)


def position(view: View) -> tuple[FloatArray, ...]:
    """Answers to a head that stands too high, and where the wind changes over ground too far east and north
    [1/s].
    """
    if view.lateral_per_s == 0:
        return (view.shear_per_s,)
    return view.shear_per_s, _drifted(view, 1.0, 0.0), _drifted(view, 0.0, 1.0)
