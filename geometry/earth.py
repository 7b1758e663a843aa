"""The shape of the Earth under a beam: radius, curvature, refraction, and the turn to local axes."""

import numpy as np

from geometry.arrays import ArrayLike, FloatArray

# Mean radius (2a + b)/3 of GRS 80: Moritz (2000), Geodetic Reference System 1980, J. Geodesy 74, 128-133.
EARTH_RADIUS_M = 6_371_008.8

# Share of the Earth's curvature by which light near the ground bends down: the classical surveyor's value for
# optical and near-infrared beams: Torge & Müller (2012), Geodesy, on refraction. (The radar "4/3 Earth", 0.25,
# is for radio waves.) It varies with the temperature profile near the ground.
REFRACTION_COEFFICIENT = 0.13


def curvature_drop_m(distance_m: ArrayLike, radius_m: ArrayLike = EARTH_RADIUS_M) -> FloatArray:
    r"""Depth of the Earth's surface under a straight line that starts level.

    Parameters
    ----------
    distance_m
        Horizontal distance from where the line starts [m], any shape.
    radius_m
        Radius of the Earth [m].

    Returns
    -------
    FloatArray
        Drop [m], positive downward, same shape.

    Notes
    -----
    :math:`d^2/2R`: the first term of :math:`R(\sec(d/R)-1)`; the next, :math:`5d^4/24R^3`, is 0.02 mm at
    12 km and 0.7 mm at 30 km.

    Examples
    --------
    >>> curvature_drop_m([1000.0, 3000.0, 6000.0, 12000.0]).round(2).tolist()
    [0.08, 0.71, 2.83, 11.3]
    """
    distance = np.asarray(distance_m, dtype=np.float64)
    return np.asarray(0.5 * distance * (distance / np.asarray(radius_m, dtype=np.float64)))


def refraction_lift_m(
    distance_m: ArrayLike,
    radius_m: ArrayLike = EARTH_RADIUS_M,
    *,
    coefficient: float = REFRACTION_COEFFICIENT,
) -> FloatArray:
    r"""Height by which a point seems raised, because the beam to it bends down with the Earth.

    Parameters
    ----------
    distance_m
        Horizontal distance [m], any shape.
    radius_m
        Radius of the Earth [m].
    coefficient
        Ratio of the beam's curvature to the Earth's, without unit.

    Returns
    -------
    FloatArray
        Lift [m], positive upward, same shape. A beam sags by this much below its straight line, so it is aimed that
        much above the point to hit it; over the curved ground its net drop is
        ``curvature_drop_m - refraction_lift_m``.

    Notes
    -----
    :math:`k\,d^2/2R`, so that the net drop is :math:`d^2 (1-k)/2R`.

    Examples
    --------
    >>> round(float(curvature_drop_m(6000.0) - refraction_lift_m(6000.0)), 2)
    2.46
    """
    return np.asarray(coefficient * curvature_drop_m(distance_m, radius_m))


def gaussian_radius_m(
    latitude_deg: ArrayLike, *, semi_major_m: float, eccentricity_squared: float
) -> FloatArray:
    r"""Radius of the sphere that fits the ellipsoid best at a latitude.

    Parameters
    ----------
    latitude_deg
        Geodetic latitude [deg], any shape.
    semi_major_m
        Semi-major axis of the ellipsoid [m].
    eccentricity_squared
        First eccentricity squared, without unit.

    Returns
    -------
    FloatArray
        Geometric mean of the two principal radii of curvature [m], same shape.

    Notes
    -----
    :math:`\sqrt{MN} = a\sqrt{1-e^2}/(1-e^2\sin^2\varphi)`: the Gaussian radius of curvature; Torge &
    Müller (2012), Geodesy, on the curvature of the ellipsoid.

    Examples
    --------
    >>> round(float(gaussian_radius_m(56.44, semi_major_m=6378137.0, eccentricity_squared=0.00669438)))
    6386440
    """
    sine = np.sin(np.deg2rad(np.asarray(latitude_deg, dtype=np.float64)))
    flattening = 1.0 - eccentricity_squared
    return np.asarray(semi_major_m * np.sqrt(flattening) / (1.0 - eccentricity_squared * sine * sine))


def ecef_to_enu_rotation(longitude_deg: ArrayLike, latitude_deg: ArrayLike) -> FloatArray:
    r"""Rotation from earth-centred axes to local east, north, up.

    Parameters
    ----------
    longitude_deg, latitude_deg
        Where the local frame stands [deg], geodetic; the shapes broadcast.

    Returns
    -------
    FloatArray
        Rotation matrices, shape (..., 3, 3): rows are the east, north and up directions in earth-centred
        axes. Up is the ellipsoid's normal.

    Notes
    -----
    Rows :math:`(-\sin\lambda, \cos\lambda, 0)`,
    :math:`(-\sin\varphi\cos\lambda, -\sin\varphi\sin\lambda, \cos\varphi)` and
    :math:`(\cos\varphi\cos\lambda, \cos\varphi\sin\lambda, \sin\varphi)`: EPSG Guidance Note 7-2
    (IOGP 373-07-02), method 9836, geocentric/topocentric conversions; its example is a test.

    Examples
    --------
    >>> ecef_to_enu_rotation(0.0, 0.0) @ [1.0, 0.0, 0.0]  # up, over the Gulf of Guinea
    array([0., 0., 1.])
    """
    longitude, latitude = np.broadcast_arrays(
        np.deg2rad(np.asarray(longitude_deg, dtype=np.float64)),
        np.deg2rad(np.asarray(latitude_deg, dtype=np.float64)),
    )
    sin_lon, cos_lon = np.sin(longitude), np.cos(longitude)
    sin_lat, cos_lat = np.sin(latitude), np.cos(latitude)
    east = np.stack([-sin_lon, cos_lon, np.zeros_like(sin_lon)], axis=-1)
    north = np.stack([-sin_lat * cos_lon, -sin_lat * sin_lon, cos_lat], axis=-1)
    up = np.stack([cos_lat * cos_lon, cos_lat * sin_lon, sin_lat], axis=-1)
    return np.stack([east, north, up], axis=-2)
