"""The shape of the Earth: against the exact circle, published drops, PROJ and the ellipsoid's own normals."""

import mpmath
import numpy as np
import pytest
from pyproj import Geod, Transformer

from geometry.earth import (
    EARTH_RADIUS_M,
    REFRACTION_COEFFICIENT,
    curvature_drop_m,
    ecef_to_enu_rotation,
    gaussian_radius_m,
    refraction_lift_m,
)

WGS84 = Geod(ellps="WGS84")


@pytest.mark.parametrize(
    ("distance", "drop"), [(1000.0, 0.08), (3000.0, 0.71), (6000.0, 2.83), (12000.0, 11.3)]
)
def test_published_curvature_drops(distance: float, drop: float) -> None:
    """0.08, 0.71, 2.83 and 11.3 m at 1, 3, 6 and 12 km, to the digits published."""
    digits = 2 if drop < 10.0 else 1
    assert round(float(curvature_drop_m(distance)), digits) == drop


def test_published_drop_with_refraction() -> None:
    """At 6 km the drop less the lift is 2.46 m; the coefficient is the optical one."""
    assert REFRACTION_COEFFICIENT == 0.13
    assert round(float(curvature_drop_m(6000.0) - refraction_lift_m(6000.0)), 2) == 2.46


@pytest.mark.parametrize("distance", [1.0, 1000.0, 12000.0, 30000.0])
def test_drop_against_the_circle_with_fifty_digits(distance: float) -> None:
    """The parabola leaves the circle by less than 0.02 mm at 12 km and half a millimetre at 30 km."""
    with mpmath.workdps(50):
        radius = mpmath.mpf(EARTH_RADIUS_M)
        circle = float(radius - mpmath.sqrt(radius**2 - mpmath.mpf(distance) ** 2))
    assert float(curvature_drop_m(distance)) == pytest.approx(circle, abs=2e-5 if distance < 2e4 else 5e-4)


def test_refraction_is_the_effective_radius() -> None:
    """Drop less lift is the drop on a sphere of radius R/(1-k)."""
    distance = np.array([10.0, 3000.0, 30000.0])
    net = curvature_drop_m(distance) - refraction_lift_m(distance, coefficient=0.2)
    np.testing.assert_allclose(net, curvature_drop_m(distance, EARTH_RADIUS_M / 0.8), rtol=1e-14)


@pytest.mark.parametrize("latitude", [-84.0, -30.0, 0.0, 56.44, 90.0])
def test_gaussian_radius_is_the_mean_of_the_principal_radii(latitude: float) -> None:
    """A short geodesic along the meridian and PROJ's parallel circle give the two principal radii."""
    step = 1e-3
    _, _, north = WGS84.inv(0.0, latitude - step, 0.0, latitude + step) if latitude < 90.0 else (0, 0, np.nan)
    meridian = north / np.deg2rad(2 * step)
    # radius of the parallel circle, over cos(latitude), is the radius of the prime vertical
    x, y, _ = Transformer.from_pipeline("+proj=cart +ellps=WGS84").transform(0.0, latitude, 0.0)
    expected = np.sqrt(meridian * np.hypot(x, y) / np.cos(np.deg2rad(latitude)))
    if latitude == 90.0:
        expected = WGS84.a**2 / WGS84.b  # polar radius of curvature, both ways
    measured = gaussian_radius_m(latitude, semi_major_m=WGS84.a, eccentricity_squared=WGS84.es)
    assert float(measured) == pytest.approx(expected, rel=1e-7)


@pytest.mark.parametrize("latitude", [-90.0, -41.0, 0.0, 56.4, 90.0])
@pytest.mark.parametrize("longitude", [-180.0, -70.0, 0.0, 8.1, 179.9])
def test_rotation_rows_are_the_ellipsoids_own_directions(longitude: float, latitude: float) -> None:
    """Up is the way PROJ's own height grows, it is a rotation, east is level, north looks north."""
    rotation = ecef_to_enu_rotation(longitude, latitude)
    cart = Transformer.from_pipeline("+proj=cart +ellps=WGS84")
    low, high = (np.array(cart.transform(longitude, latitude, height)) for height in (0.0, 1e6))
    np.testing.assert_allclose(rotation[2], (high - low) / 1e6, atol=1e-12)
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-15)
    assert np.linalg.det(rotation) == pytest.approx(1.0)
    assert rotation[0, 2] == 0.0
    assert rotation[1, 2] >= 0.0


def test_published_example_of_the_topocentric_conversion() -> None:
    """EPSG Guidance Note 7-2, example of method 9836: seen from 55 N, 5 E, to the millimetre it is printed with."""
    origin, point = [3652755.3058, 319574.6799, 5201547.3536], [3771793.968, 140253.342, 5124304.349]
    seen = ecef_to_enu_rotation(5.0, 55.0) @ (np.array(point) - origin)
    np.testing.assert_allclose(seen, [-189013.869, -128642.040, -4220.171], rtol=0.0, atol=5e-4)


def test_rotations_keep_leading_axes() -> None:
    """One matrix for each position."""
    assert ecef_to_enu_rotation(np.zeros((4, 1)), np.zeros(3)).shape == (4, 3, 3, 3)
