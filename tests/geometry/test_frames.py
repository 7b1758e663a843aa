"""The site's frame: against PROJ's topocentric pipeline, geodesics, 50-digit arithmetic, other CRSs."""

import pickle
from pathlib import Path
from typing import get_args

import mpmath
import numpy as np
import pyproj
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from geometry.beams import beam_to, point_at
from geometry.earth import REFRACTION_COEFFICIENT, curvature_drop_m
from geometry.effects import model_error_m
from geometry.errors import InputError
from geometry.frames import LEFT_OUT, EarthModel, SiteFrame
from geometry.projection import projection_of

few = settings(derandomize=True, max_examples=60, deadline=None)
MODELS: tuple[EarthModel, ...] = get_args(EarthModel)
WGS84 = pyproj.Geod(ellps="WGS84")
UTM32 = SiteFrame("EPSG:32632")

AUTHORITY = Path(__file__).parents[1] / "authorities" / "proj_hovsore.txt"
HEADS_M = {
    "WS_K": (447450.548, 6256541.135, 4.054),
    "WS_S": (447893.983, 6256558.133, 5.078),
    "WS_W": (448937.717, 6256404.894, 5.409),
}
CUP_M = (447647.39, 6255435.76, 121.336)

# CRSs on WGS 84 and a place where they are strained: zone edges, the equator, both poles, the antimeridian.
PLACES = {
    "Høvsøre": ("EPSG:32632", 8.151, 56.44),
    "central meridian": ("EPSG:32632", 9.0, 50.0),
    "west edge": ("EPSG:32632", 6.0, 60.0),
    "two zones beyond the edge": ("EPSG:32632", 20.0, 60.0),
    "equator": ("EPSG:32632", 6.5, 0.0),
    "southern hemisphere": ("EPSG:32760", 176.1, -38.2),
    "antimeridian": ("EPSG:32760", 180.0, -17.0),
    "antimeridian from the east": ("EPSG:32601", -180.0, 65.0),
    "UTM at 84": ("EPSG:32633", 12.2, 83.99),
    "UPS north at 84": ("EPSG:5041", 12.2, 84.01),
    "UPS north with northing first": ("EPSG:32661", -130.0, 84.5),
    "UPS south": ("EPSG:32761", 166.7, -77.8),
    "beside the pole": ("EPSG:5041", 100.0, 89.99),
    "Antarctic polar": ("EPSG:3031", -110.0, -80.0),
    "not conformal": ("EPSG:3857", 8.151, 56.44),
}


def authority() -> dict[str, list[float]]:
    """Rows of PROJ's own output for Høvsøre."""
    lines = AUTHORITY.read_text(encoding="utf-8").splitlines()
    rows = [line.split() for line in lines if not line.startswith(("#", "PROJ"))]
    return {name: [float(number) for number in numbers] for name, *numbers in rows}


def fifty_digit_enu(head: tuple[float, float, float], point: tuple[float, float, float]) -> list[float]:
    """East, north, up between two longitudes, latitudes [deg], heights [m] on WGS 84, with 50 digits."""
    with mpmath.workdps(50):
        a = mpmath.mpf(6378137)
        f = 1 / mpmath.mpf("298.257223563")
        e2 = f * (2 - f)

        def ecef(longitude: float, latitude: float, height: float) -> mpmath.matrix:
            lam, phi = mpmath.radians(mpmath.mpf(longitude)), mpmath.radians(mpmath.mpf(latitude))
            prime = a / mpmath.sqrt(1 - e2 * mpmath.sin(phi) ** 2)
            level = (prime + height) * mpmath.cos(phi)
            return mpmath.matrix(
                [
                    level * mpmath.cos(lam),
                    level * mpmath.sin(lam),
                    (prime * (1 - e2) + height) * mpmath.sin(phi),
                ]
            )

        x, y, z = ecef(*point) - ecef(*head)
        lam, phi = mpmath.radians(mpmath.mpf(head[0])), mpmath.radians(mpmath.mpf(head[1]))
        outward = mpmath.cos(lam) * x + mpmath.sin(lam) * y
        east = -mpmath.sin(lam) * x + mpmath.cos(lam) * y
        north = -mpmath.sin(phi) * outward + mpmath.cos(phi) * z
        up = mpmath.cos(phi) * outward + mpmath.sin(phi) * z
        return [float(east), float(north), float(up)]


@pytest.mark.parametrize("name", HEADS_M)
def test_hovsore_against_proj_topocentric(name: str) -> None:
    """The cup in each head's frame, to a micrometre of PROJ's own topocentric pipeline."""
    np.testing.assert_allclose(UTM32.enu_m(HEADS_M[name], CUP_M), authority()[name][:3], atol=1e-6)


@pytest.mark.parametrize("name", HEADS_M)
def test_hovsore_against_the_geodesic(name: str) -> None:
    """Azimuth within 0.001 degrees and range within 1 cm of the geodesic inverse."""
    _, _, _, azimuth, distance, convergence, scale = authority()[name]
    beam = beam_to(UTM32.enu_m(HEADS_M[name], CUP_M))
    height1, height2 = HEADS_M[name][2], CUP_M[2]
    radius = 6386440.0  # Gaussian radius at 56.44° N
    chord = 2.0 * radius * np.sin(distance / (2.0 * radius))
    slant = np.sqrt(chord**2 * (1 + height1 / radius) * (1 + height2 / radius) + (height2 - height1) ** 2)
    assert float(beam.azimuth_deg) == pytest.approx(azimuth, abs=0.001)
    assert float(beam.range_m) == pytest.approx(slant, abs=0.01)
    assert float(UTM32.convergence_deg(HEADS_M[name])) == pytest.approx(convergence, abs=1e-6)
    assert float(UTM32.scale_factor(HEADS_M[name])) == pytest.approx(scale, abs=1e-9)


def test_published_norths_at_hovsore() -> None:
    """Convergence -0.690, grid azimuth 233.091 and geodesic azimuth 232.400 degrees from WS_W to the mast."""
    head, mast = HEADS_M["WS_W"], (447647.39, 6255435.76, 4.836)
    grid = float(beam_to(UTM32.enu_m(head, mast, model="flat-grid")).azimuth_deg)
    assert float(UTM32.convergence_deg(head)) == pytest.approx(-0.690, abs=5e-4)
    assert grid == pytest.approx(233.091, abs=5e-4)
    assert float(beam_to(UTM32.enu_m(head, mast)).azimuth_deg) == pytest.approx(232.400, abs=5e-4)


@pytest.mark.parametrize(
    ("name", "grid_m", "ground_m"),
    [("WS_K", 1122.76, 1123.18), ("WS_S", 1149.14, 1149.56), ("WS_W", 1613.74, 1614.34)],
)
def test_published_distances_at_hovsore(name: str, grid_m: float, ground_m: float) -> None:
    """Distances from lidar to mast in the grid and on the ground, to the centimetre published."""
    base = (*CUP_M[:2], HEADS_M[name][2])
    assert float(beam_to(UTM32.enu_m(HEADS_M[name], base, model="flat-grid")).range_m) == pytest.approx(
        grid_m, abs=0.006
    )
    assert float(beam_to(UTM32.enu_m(HEADS_M[name], base, model="flat")).range_m) == pytest.approx(
        ground_m, abs=0.006
    )


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("distance", [1.0, 3000.0, 30000.0])
def test_exact_against_fifty_digits(place: str, distance: float) -> None:
    """East, north, up from projected coordinates within 20 nm of 50-digit arithmetic."""
    crs, longitude, latitude = PLACES[place]
    frame, head = SiteFrame(crs), (longitude, latitude, 120.0)
    for azimuth in (0.0, 77.0, 200.0):
        far_longitude, far_latitude, _ = WGS84.fwd(longitude, latitude, azimuth, distance)
        point = (far_longitude, far_latitude, 450.0)
        enu = frame.enu_m(frame.from_geographic(*head), frame.from_geographic(*point))
        np.testing.assert_allclose(enu, fifty_digit_enu(head, point), atol=2e-8, rtol=0)


@pytest.mark.parametrize("place", PLACES)
def test_azimuth_and_range_against_the_geodesic(place: str) -> None:
    """At 3 km azimuths are within 0.001 degrees and ranges within 1 cm of a geodesic everywhere."""
    crs, longitude, latitude = PLACES[place]
    frame = SiteFrame(crs)
    azimuths = np.arange(0.0, 360.0, 30.0)
    far = WGS84.fwd(np.full(12, longitude), np.full(12, latitude), azimuths, np.full(12, 3000.0))
    beam = beam_to(
        frame.enu_m(frame.from_geographic(longitude, latitude, 0.0), frame.from_geographic(*far[:2], 0.0))
    )
    assert np.abs((beam.azimuth_deg - azimuths + 180.0) % 360.0 - 180.0).max() < 0.001
    assert np.abs(beam.range_m - 3000.0).max() < 0.01


@pytest.mark.parametrize("place", [place for place in PLACES if place != "not conformal"])
def test_true_azimuth_is_grid_azimuth_plus_convergence(place: str) -> None:
    """The sign and the size of the convergence, seen on 100 m lines: near a pole it can be anything."""
    crs, longitude, latitude = PLACES[place]
    frame = SiteFrame(crs)
    head = frame.from_geographic(longitude, latitude, 0.0)
    for azimuth in (3.0, 140.0):
        far = WGS84.fwd(longitude, latitude, azimuth, 100.0)
        offset = frame.from_geographic(*far[:2], 0.0) - head
        turn = float(beam_to(offset).azimuth_deg + frame.convergence_deg(head)) - azimuth
        assert abs((turn + 180.0) % 360.0 - 180.0) < 0.001
        assert np.hypot(*offset[:2]) / 100.0 == pytest.approx(float(frame.scale_factor(head)), rel=2e-5)


@pytest.mark.parametrize(
    ("one", "other", "longitude", "latitude"),
    [
        ("EPSG:32632", "EPSG:32633", 12.0, 55.0),
        ("EPSG:32760", "EPSG:32701", 180.0, -17.0),
        ("EPSG:32633", "EPSG:5041", 15.0, 84.0),
        ("EPSG:32633", "EPSG:32661", 15.0, 84.0),
        ("EPSG:32732", "EPSG:3031", 9.0, -79.5),
        ("EPSG:32632", "EPSG:3857", 8.0, 56.0),
        ("EPSG:25832", "EPSG:3035", 8.0, 56.0),
    ],
)
def test_neighbouring_projections_give_the_same_beams(
    one: str, other: str, longitude: float, latitude: float
) -> None:
    """A beam is a fact of the ground: two CRSs of one datum agree within 1 mm at 10 km."""
    directions = np.arange(0.0, 360.0, 45.0)
    far = WGS84.fwd(np.full(8, longitude), np.full(8, latitude), directions, np.full(8, 10000.0))
    local = []
    for frame in (SiteFrame(one), SiteFrame(other)):
        points = frame.from_geographic(*far[:2], 300.0)
        local.append(frame.enu_m(frame.from_geographic(longitude, latitude, 20.0), points))
    np.testing.assert_allclose(local[0], local[1], atol=1e-3, rtol=0)


@pytest.mark.parametrize(
    ("crs", "ellipsoid"),
    [
        ("EPSG:27700", "airy"),
        ("EPSG:31467", "bessel"),
        ("EPSG:25832", "GRS80"),
        ("EPSG:21781", "bessel"),
        ("EPSG:27572", "clrk80ign"),
    ],
)
def test_each_datum_keeps_its_own_ellipsoid(crs: str, ellipsoid: str) -> None:
    """On Airy, Bessel, Clarke and GRS 80 the geodesic of that very ellipsoid is met."""
    frame, geod = SiteFrame(crs), pyproj.Geod(ellps=ellipsoid)
    west, south, east, north = frame.area_of_use or (0.0, 0.0, 0.0, 0.0)
    longitude, latitude = (west + east) / 2, (south + north) / 2
    far = geod.fwd(longitude, latitude, 50.0, 6000.0)
    beam = beam_to(
        frame.enu_m(frame.from_geographic(longitude, latitude, 0.0), frame.from_geographic(*far[:2], 0.0))
    )
    assert float(beam.azimuth_deg) == pytest.approx(50.0, abs=1e-5)
    assert float(beam.range_m) == pytest.approx(6000.0, abs=0.001)


def test_longitudes_are_counted_from_greenwich() -> None:
    """On the Paris meridian the easting is 600 km and the longitude 2.33722917 degrees."""
    frame = SiteFrame("EPSG:27572")
    longitude, latitude, _ = frame.geographic([600000.0, 2200000.0, 0.0])
    assert float(longitude) == pytest.approx(2.33722917, abs=1e-8)
    assert float(latitude) == pytest.approx(46.8, abs=1e-9)
    assert frame.central_meridian_deg == pytest.approx(2.33722917)
    assert float(frame.convergence_deg([600000.0, 2300000.0, 0.0])) == pytest.approx(0.0, abs=1e-9)


def test_longitudes_stay_within_a_half_turn() -> None:
    """West of the antimeridian is positive and east of it negative, from either zone."""
    frame = SiteFrame("EPSG:32760")
    points = frame.from_geographic([179.9, -179.9], -17.0, 0.0)
    np.testing.assert_allclose(frame.geographic(points)[0], [179.9, -179.9], atol=1e-9)
    assert np.ptp(points[:, 0]) < 25000.0


@pytest.mark.parametrize("model", MODELS)
@few
@given(azimuth=st.floats(0.0, 360.0), elevation=st.floats(-90.0, 90.0), slant=st.floats(1.0, 30000.0))
def test_every_model_is_its_own_inverse(
    model: EarthModel, azimuth: float, elevation: float, slant: float
) -> None:
    """From local to projected and back, straight up and down, from 1 m to 30 km, within 10 micrometres.

    The micrometres belong to PROJ's height of a point 30 km up; below 3 km it is 0.1.
    """
    enu = point_at(azimuth, elevation, slant)
    head = HEADS_M["WS_K"]
    back = UTM32.enu_m(head, UTM32.projected_m(head, enu, model=model), model=model)
    np.testing.assert_allclose(back, enu, atol=1e-7 if abs(enu[2]) < 3000.0 else 1e-5, rtol=0)


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("up", [1.0, 30000.0, -1.0, -300.0])
def test_straight_up_is_straight_up(model: EarthModel, up: float) -> None:
    """A point on the head's vertical has no horizontal part in any model."""
    enu = UTM32.enu_m(HEADS_M["WS_K"], np.add(HEADS_M["WS_K"], [0.0, 0.0, up]), model=model)
    np.testing.assert_allclose(enu, [0.0, 0.0, up], atol=2e-8)


# crs place, distance -> upper limits of the errors that `SiteFrame.enu_m` states [m]
STATED_ERRORS_M = {
    ("Høvsøre", 1000.0): {"flat-grid": 12.4, "flat": 0.08, "curved": 0.0008, "refracted": 0.0104},
    ("Høvsøre", 3000.0): {"flat-grid": 37.1, "flat": 0.71, "curved": 0.0064, "refracted": 0.093},
    ("Høvsøre", 6000.0): {"flat-grid": 74.2, "flat": 2.83, "curved": 0.026, "refracted": 0.371},
    ("Høvsøre", 30000.0): {"flat-grid": 377.9, "flat": 70.6, "curved": 0.81, "refracted": 9.26},
    ("west edge at 50", 1000.0): {"flat-grid": 40.2, "flat": 0.08, "curved": 0.0029, "refracted": 0.0107},
    ("west edge at 50", 3000.0): {"flat-grid": 120.5, "flat": 0.71, "curved": 0.025, "refracted": 0.096},
    ("west edge at 50", 6000.0): {"flat-grid": 240.9, "flat": 2.83, "curved": 0.098, "refracted": 0.383},
    ("west edge at 50", 30000.0): {"flat-grid": 1208.3, "flat": 70.7, "curved": 2.61, "refracted": 9.57},
}


@pytest.mark.parametrize(("place", "distance"), STATED_ERRORS_M)
def test_each_model_states_its_error(place: str, distance: float) -> None:
    """The docstring's sizes: the worst of 24 directions at two heights is the stated error."""
    longitude, latitude = (8.151, 56.44) if place == "Høvsøre" else (6.0, 50.0)
    head = UTM32.from_geographic(longitude, latitude, 5.0)
    arcs = [
        point_at(np.arange(0.0, 360.0, 15.0), 0.0, distance) + np.array([0.0, 0.0, up]) for up in (0.0, 500.0)
    ]
    points = UTM32.projected_m(head, np.concatenate(arcs))
    assert model_error_m(UTM32, head, points, "exact").max() < 1e-8
    for model, limit in STATED_ERRORS_M[place, distance].items():
        error = float(model_error_m(UTM32, head, points, model).max())  # type: ignore[arg-type]
        assert 0.9 * limit < error <= limit


def test_models_grow_better_in_their_order() -> None:
    """At 6 km off the central meridian each effect that is added brings the point nearer to the exact one."""
    head = UTM32.from_geographic(8.151, 56.44, 5.0)
    point = UTM32.projected_m(head, [4000.0, -4400.0, 100.0])
    grid, flat, curved = (
        float(model_error_m(UTM32, head, point, m)) for m in ("flat-grid", "flat", "curved")
    )
    assert grid > 10 * flat > 100 * curved


def test_refracted_is_curved_with_the_lift() -> None:
    """The two differ by k times the drop, in height alone."""
    head, point = HEADS_M["WS_K"], (453450.0, 6256541.0, 100.0)
    curved, refracted = (UTM32.enu_m(head, point, model=model) for model in ("curved", "refracted"))
    lift = REFRACTION_COEFFICIENT * float(curvature_drop_m(np.hypot(*curved[:2])))
    np.testing.assert_allclose(refracted - curved, [0.0, 0.0, lift], atol=0.002)


def test_flat_grid_is_the_difference_of_coordinates() -> None:
    """The cheapest model is a subtraction."""
    np.testing.assert_array_equal(
        UTM32.enu_m((500.0, 600.0, 7.0), (501.0, 604.0, 9.0), model="flat-grid"), [1, 4, 2]
    )


def test_what_models_leave_out_is_listed_for_each() -> None:
    """Every model has its list; what a better model has, a cheaper one lists as left out."""
    assert set(LEFT_OUT) == set(MODELS)
    assert "curvature" in LEFT_OUT["flat"]
    assert "curvature" not in LEFT_OUT["curved"]
    assert {"convergence", "scale"} <= set(LEFT_OUT["flat-grid"])


def test_geoid_undulation_changes_distances_by_six_ppm() -> None:
    """40 m of undulation lengthen a level line by 6 parts in a million; ellipsoidal heights ignore it."""
    head, point = (500000.0, 6256000.0, 0.0), (510000.0, 6256000.0, 0.0)
    plain = float(beam_to(UTM32.enu_m(head, point)).range_m)
    raised = SiteFrame("EPSG:32632", geoid_undulation_m=40.0)
    assert float(beam_to(raised.enu_m(head, point)).range_m) / plain - 1.0 == pytest.approx(6.3e-6, abs=1e-7)
    assert float(raised.geographic(head)[2]) == 40.0
    np.testing.assert_allclose(raised.from_geographic(*raised.geographic(head)), head, atol=1e-7)
    np.testing.assert_allclose(raised.projected_m(head, raised.enu_m(head, point)), point, atol=1e-7)
    ellipsoidal = SiteFrame("EPSG:32632", height_datum="ellipsoidal", geoid_undulation_m=40.0)
    np.testing.assert_array_equal(ellipsoidal.enu_m(head, point), UTM32.enu_m(head, point))


def test_large_false_origins_cost_no_digits() -> None:
    """A grid shifted by 1e7 m, where a float64 step is 2 nm, gives the same positions within 0.1 µm."""
    projection = "+proj=tmerc +lat_0=56 +lon_0=9 +k=0.9996 +ellps=WGS84 +units=m"
    near, far = SiteFrame(projection), SiteFrame(f"{projection} +x_0=1e7 +y_0=1e7")
    head, points = np.array([1000.0, 2000.0, 5.0]), np.array([[1001.0, 2000.0, 5.0], [7000.0, -400.0, 90.0]])
    shift = np.array([1e7, 1e7, 0.0])
    for model in MODELS:
        expected = near.enu_m(head, points, model=model)
        np.testing.assert_allclose(
            far.enu_m(head + shift, points + shift, model=model), expected, atol=1e-7, rtol=0
        )


@pytest.mark.parametrize("model", MODELS)
def test_float32_is_widened_before_it_is_subtracted(model: EarthModel) -> None:
    """Coordinates that float32 can hold give exactly what float64 gives."""
    points = np.array([[447650.0, 6255435.5, 121.25], [453650.0, 6255436.0, 21.5]])
    narrow = UTM32.enu_m(HEADS_M["WS_K"], points.astype(np.float32), model=model)
    np.testing.assert_array_equal(narrow, UTM32.enu_m(HEADS_M["WS_K"], points, model=model))


@pytest.mark.parametrize("model", MODELS)
def test_any_leading_shape_and_missing_points(model: EarthModel) -> None:
    """Leading axes pass, empty ones too; a NaN point is missing and leaves the others alone."""
    points = np.broadcast_to(CUP_M, (2, 3, 3)).copy()
    points[1, 1, 2] = np.nan
    enu = UTM32.enu_m(HEADS_M["WS_K"], points, model=model)
    expected = UTM32.enu_m(HEADS_M["WS_K"], CUP_M, model=model)
    np.testing.assert_allclose(enu[0], np.broadcast_to(expected, (3, 3)), atol=1e-9)
    assert np.isnan(enu[1, 1]).any()
    assert model != "exact" or np.isnan(enu[1, 1]).all()
    assert np.isfinite(enu[1, [0, 2]]).all()
    assert UTM32.enu_m(HEADS_M["WS_K"], np.empty((0, 3)), model=model).shape == (0, 3)
    assert UTM32.projected_m(HEADS_M["WS_K"], enu, model=model).shape == (2, 3, 3)


def test_geographic_round_trip_and_shapes() -> None:
    """Longitude, latitude, height of shape (...) and back within 1e-8 m."""
    points = np.array([[CUP_M, HEADS_M["WS_K"]]])
    degrees = UTM32.geographic(points)
    assert [part.shape for part in degrees] == [(1, 2)] * 3
    np.testing.assert_allclose(UTM32.from_geographic(*degrees), points, atol=1e-8, rtol=0)
    assert UTM32.convergence_deg(points).shape == UTM32.scale_factor(points).shape == (1, 2)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_missing_coordinate_leaves_no_half_position(axis: int) -> None:
    """Longitude, latitude and height are all missing where one coordinate is; the other points are not."""
    points = np.array([CUP_M, CUP_M])
    points[0, axis] = np.nan
    degrees = np.array(UTM32.geographic(points))
    assert np.isnan(degrees[:, 0]).all()
    assert np.isfinite(degrees[:, 1]).all()


def test_area_of_use_and_central_meridian() -> None:
    """UTM 32N: 6 to 12 degrees east about 9; PROJ strings state no area, oblique projections no meridian."""
    assert UTM32.area_of_use == (6.0, 0.0, 12.0, 84.0)
    assert UTM32.central_meridian_deg == 9.0
    assert SiteFrame("+proj=utm +zone=32 +ellps=WGS84").area_of_use is None
    assert SiteFrame("EPSG:2056").central_meridian_deg is None


@pytest.mark.parametrize("crs", ["EPSG:25832+7837", "+proj=utm +zone=32 +ellps=GRS80 +towgs84=600,-200,300"])
def test_horizontal_part_of_compound_and_bound_crs(crs: str) -> None:
    """Heights and shifts of datum that a CRS carries along change no beam."""
    np.testing.assert_allclose(
        SiteFrame(crs).enu_m(HEADS_M["WS_K"], CUP_M),
        SiteFrame("EPSG:25832").enu_m(HEADS_M["WS_K"], CUP_M),
        atol=1e-8,
    )


@pytest.mark.parametrize(
    ("crs", "said"),
    [
        ("EPSG:4326", "geographic"),
        ("EPSG:4978", "not projected"),
        ("EPSG:5773", "not projected"),
        ("EPSG:2263", "US survey foot"),
        ("EPSG:2053", "do not run east and north"),
        ("EPSG:5513", "do not run east and north"),
        ("EPSG:1", "does not know"),
        ("", "does not know"),
        ("<script>", "does not know"),
    ],
)
def test_unusable_crs_are_refused_in_words(crs: str, said: str) -> None:
    """Degrees, feet, axes to the west or south, and nonsense: each refusal says what came."""
    with pytest.raises(InputError, match=said) as refusal:
        SiteFrame(crs)
    assert repr(crs) in str(refusal.value)


def test_impossible_arguments_are_refused_in_words() -> None:
    """Datum, undulation, model, shapes, heads with NaN and points off the map."""
    with pytest.raises(InputError, match="height datum"):
        SiteFrame("EPSG:32632", height_datum="sea")  # type: ignore[arg-type]
    for undulation in (400.0, np.nan):
        with pytest.raises(InputError, match="undulation"):
            SiteFrame("EPSG:32632", geoid_undulation_m=undulation)
    for call in (UTM32.enu_m, UTM32.projected_m):
        with pytest.raises(InputError, match="earth model 'round'"):
            call(CUP_M, CUP_M, model="round")  # type: ignore[arg-type]
        with pytest.raises(InputError, match="head position"):
            call([CUP_M], CUP_M)
        with pytest.raises(InputError, match="head position"):
            call([np.nan, 0.0, 0.0], CUP_M)
        with pytest.raises(InputError, match="positions of shape"):
            call(CUP_M, [1.0, 2.0])
    with pytest.raises(InputError, match=r"1 position\(s\) came"):
        UTM32.enu_m(CUP_M, [CUP_M, (1e12, 0.0, 0.0)])


def test_a_crs_is_built_once_and_frames_travel() -> None:
    """Transformers are kept by the text of the CRS; a frame is a value that other processes can receive."""
    assert projection_of("EPSG:32632") is projection_of("EPSG:32632")
    assert pickle.loads(pickle.dumps(UTM32)) == UTM32
