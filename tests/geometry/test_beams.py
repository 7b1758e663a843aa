"""Beams: against 50-digit arithmetic, complex numbers, published pointings and their own inverse."""

import mpmath
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from geometry.beams import beam_to, point_at, unit_vector
from geometry.blocks import BLOCK_POINTS
from geometry.errors import InputError

few = settings(derandomize=True, max_examples=100, deadline=None)
metres = st.floats(-3e4, 3e4).filter(lambda value: value == 0.0 or abs(value) > 1e-6)

ULP = float(np.finfo(np.float64).eps)


def many_digits(east: float, north: float, up: float) -> tuple[float, float, float]:
    """Azimuth, elevation and range with 50 digits, by complex arguments."""
    with mpmath.workdps(50):
        horizontal = mpmath.hypot(east, north)
        azimuth = mpmath.degrees(mpmath.arg(mpmath.mpc(north, east))) % 360 if horizontal else mpmath.mpf(0)
        elevation = (
            mpmath.degrees(mpmath.arg(mpmath.mpc(horizontal, up))) if horizontal or up else mpmath.mpf(0)
        )
        return float(azimuth), float(elevation), float(mpmath.hypot(horizontal, up))


@few
@given(metres, metres, metres)
def test_beam_has_sixteen_digits(east: float, north: float, up: float) -> None:
    """Angles are right to 4 units in the last place of a full circle, ranges to 2 of their own."""
    beam = beam_to([east, north, up])
    azimuth, elevation, slant = many_digits(east, north, up)
    turn = abs(float(beam.azimuth_deg) - azimuth)
    assert min(turn, 360.0 - turn) <= 4 * ULP * 360.0
    assert abs(float(beam.elevation_deg) - elevation) <= 4 * ULP * 90.0
    assert abs(float(beam.range_m) - slant) <= 2 * ULP * slant


@pytest.mark.parametrize("lean_m", [1e-9, 1e-6, 1e-3])
@pytest.mark.parametrize("up", [30000.0, -30000.0, 1.0, -1.0])
def test_near_the_vertical_no_digit_is_lost(lean_m: float, up: float) -> None:
    """A beam that leans a nanometre still has its azimuth and its small zenith angle."""
    beam = beam_to([-lean_m, lean_m, up])
    azimuth, elevation, _ = many_digits(-lean_m, lean_m, up)
    assert float(beam.azimuth_deg) == pytest.approx(315.0, abs=1e-9) == pytest.approx(azimuth)
    assert float(beam.elevation_deg) == pytest.approx(elevation, abs=4 * ULP * 90)


@pytest.mark.parametrize("east", [0.0, -0.0])
@pytest.mark.parametrize("north", [0.0, -0.0])
@pytest.mark.parametrize(("up", "elevation"), [(5.0, 90.0), (-5.0, -90.0), (0.0, 0.0), (-0.0, 0.0)])
def test_exactly_vertical_has_azimuth_zero(east: float, north: float, up: float, elevation: float) -> None:
    """Straight up, straight down and at the head itself the azimuth is 0, whatever the signs of the zeros."""
    beam = beam_to([east, north, up])
    assert (float(beam.azimuth_deg), float(beam.elevation_deg)) == (0.0, elevation)
    assert float(beam.range_m) == abs(up)


@pytest.mark.parametrize(
    ("enu", "azimuth"),
    [((0, 1, 0), 0), ((1, 0, 0), 90), ((-0.0, -1, 0), 180), ((-1, 0, 0), 270), ((1, 1, 0), 45)],
)
def test_azimuth_runs_clockwise_from_north(enu: tuple[float, float, float], azimuth: float) -> None:
    """North 0, east 90, south 180, west 270."""
    assert float(beam_to(enu).azimuth_deg) == azimuth


def test_azimuth_never_reaches_360() -> None:
    """A hair west of north rounds to 0, not to 360."""
    assert float(beam_to([-1e-20, 1.0, 0.0]).azimuth_deg) == 0.0


@few
@given(st.floats(0.0, 360.0, exclude_max=True), st.floats(-89.999, 89.999), st.floats(1.0, 30000.0))
def test_round_trip_from_angles(azimuth: float, elevation: float, slant: float) -> None:
    """Angles to point and back, from 1 m to 30 km: 1e-9 degrees (half a micrometre) or better."""
    beam = beam_to(point_at(azimuth, elevation, slant))
    turn = abs(float(beam.azimuth_deg) - azimuth)
    assert min(turn, 360.0 - turn) < 1e-9
    assert abs(float(beam.elevation_deg) - elevation) < 1e-12
    assert float(beam.range_m) == pytest.approx(slant, rel=4 * ULP)


@few
@given(metres, metres, metres)
def test_round_trip_from_points(east: float, north: float, up: float) -> None:
    """Point to angles and back stays within a hundredth of a micrometre at up to 50 km."""
    point = np.array([east, north, up])
    assert np.linalg.norm(point_at(*beam_to(point)) - point) < 1e-10


@few
@given(metres, metres, metres, st.floats(-180.0, 180.0))
def test_turning_the_head_turns_the_azimuth_alone(east: float, north: float, up: float, turn: float) -> None:
    """Rotation about the vertical adds to the azimuth and leaves elevation and range."""
    if np.hypot(east, north) == 0.0:
        return
    sine, cosine = np.sin(np.deg2rad(turn)), np.cos(np.deg2rad(turn))
    before = beam_to([east, north, up])
    after = beam_to([east * cosine + north * sine, north * cosine - east * sine, up])
    change = (float(after.azimuth_deg - before.azimuth_deg) - turn + 180.0) % 360.0 - 180.0
    assert abs(change) < 1e-9
    assert float(after.elevation_deg) == pytest.approx(float(before.elevation_deg), abs=1e-9)
    assert float(after.range_m) == pytest.approx(float(before.range_m))


@few
@given(st.floats(-1080.0, 1080.0), st.floats(-90.0, 180.0))
def test_unit_vector_with_fifty_digits(azimuth: float, elevation: float) -> None:
    """Components agree with 50-digit arithmetic, over the top and after turns too; the length is 1."""
    with mpmath.workdps(50):
        turn, lift = mpmath.radians(mpmath.mpf(azimuth)), mpmath.radians(mpmath.mpf(elevation))
        expected = [
            mpmath.sin(turn) * mpmath.cos(lift),
            mpmath.cos(turn) * mpmath.cos(lift),
            mpmath.sin(lift),
        ]
    vector = unit_vector(azimuth, elevation)
    np.testing.assert_allclose(vector, [float(component) for component in expected], atol=4e-15, rtol=0)
    assert np.linalg.norm(vector) == pytest.approx(1.0, abs=4 * ULP)


def test_over_the_top_is_the_other_side() -> None:
    """Elevation 120 at azimuth 10 is elevation 60 at azimuth 190."""
    np.testing.assert_allclose(unit_vector(10.0, 120.0), unit_vector(190.0, 60.0), atol=1e-15)


@pytest.mark.parametrize(
    ("lidar", "point", "azimuth", "elevation", "slant"),
    [
        ((510686.85, 5687916.63, 287.4), (512086.2, 5688182.1, 362.1), 79.26, 3.00, 1426.3),
        ((511044.39, 5689538.29, 277.7), (512086.2, 5688182.1, 362.1), 142.47, 2.83, 1712.3),
        ((536062.0, 6182292.0, 350.0), (535465.0, 6183116.0, 352.0), 324.08, 0.11, None),
    ],
    ids=["Kassel WS4", "Kassel WS5", "Scotland ws1"],
)
def test_published_pointings_from_grid_north(
    lidar: tuple[float, ...], point: tuple[float, ...], azimuth: float, elevation: float, slant: float | None
) -> None:
    """NEWA Kassel 2016 and Scotland, grid north and flat geometry, to one unit of the last digit."""
    beam = beam_to(np.subtract(point, lidar))
    assert float(beam.azimuth_deg) == pytest.approx(azimuth, abs=0.005)
    assert float(beam.elevation_deg) == pytest.approx(elevation, abs=0.005)
    if slant is not None:
        assert float(beam.range_m) == pytest.approx(slant, abs=0.1)


def test_any_leading_shape() -> None:
    """Leading axes pass through, no axis at all and empty ones too."""
    for shape in [(), (0,), (5,), (2, 3), (2, 0, 4)]:
        beam = beam_to(np.ones((*shape, 3)))
        assert beam.azimuth_deg.shape == beam.elevation_deg.shape == beam.range_m.shape == shape
        assert unit_vector(*beam[:2]).shape == point_at(*beam).shape == (*shape, 3)
    assert point_at(np.zeros((4, 1)), np.zeros(3), 100.0).shape == (4, 3, 3)


def test_long_arrays_are_solved_like_single_points() -> None:
    """The seams between blocks show nowhere, in memory of any order."""
    points = np.random.default_rng(3).normal(size=(3, BLOCK_POINTS + 5)).T * 1000.0
    beam = beam_to(points)
    for index in (0, BLOCK_POINTS - 1, BLOCK_POINTS, BLOCK_POINTS + 4):
        single = beam_to(points[index])
        assert float(beam.azimuth_deg[index]) == pytest.approx(float(single.azimuth_deg), abs=1e-12)
        assert float(beam.elevation_deg[index]) == pytest.approx(float(single.elevation_deg), abs=1e-12)
        assert float(beam.range_m[index]) == pytest.approx(float(single.range_m), rel=1e-15)


def test_arguments_are_not_written_to_and_nan_passes() -> None:
    """The caller's array stays as it was; a missing coordinate gives a missing beam, and only that one."""
    points = np.array([[-0.0, 1.0, 2.0], [np.nan, 1.0, 2.0]])
    kept = points.copy()
    beam = beam_to(points)
    np.testing.assert_array_equal(points, kept)
    assert np.isnan(beam.azimuth_deg).tolist() == np.isnan(beam.range_m).tolist() == [False, True]


@pytest.mark.parametrize("positions", [1.0, [1.0, 2.0], np.ones((3, 4))])
def test_positions_without_three_coordinates_are_refused(positions: object) -> None:
    """The message says which shape came."""
    with pytest.raises(InputError, match=r"shape .* came; allowed is \(\.\.\., 3\)"):
        beam_to(positions)  # type: ignore[arg-type]
