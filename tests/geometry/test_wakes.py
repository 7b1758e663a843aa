"""Wakes: published speeds and diameters, the IEC sectors, deficits and outlines."""

import numpy as np
import pytest
import shapely

from geometry import wakes
from geometry.errors import InputError

THRUST = 0.8


def test_jensen_speeds_behind_the_first_turbine_of_the_paper() -> None:
    """Jensen (1983): D 40 m, 8.1 m/s, k 0.1, a third of the wind behind the rotor: 4.35 and 5.7 m/s."""
    speed = 8.1 * wakes.jensen_speed_ratio(40.0, np.array([0.0, 40.0, 100.0]), 8.0 / 9.0, decay=0.1)
    assert np.abs(speed - [2.70, 4.35, 5.70]).max() < 0.005


@pytest.mark.parametrize(
    ("diameter_m", "downwind_m", "wake_m"), [(110.0, 1131.0, 280.0), (113.0, 185.0, 140.0)]
)
def test_wake_diameters_of_the_thesis(diameter_m: float, downwind_m: float, wake_m: float) -> None:
    """The reference study gives about 280 m and about 140 m."""
    assert abs(float(wakes.jensen_diameter_m(diameter_m, downwind_m, decay=0.075)) - wake_m) < 1.0


@pytest.mark.parametrize(
    ("ratio", "width_deg"),
    [(2, 80.801), (2.5, 73.688), (3, 67.874), (5, 52.931), (10, 38.342), (20, 29.989), (185 / 113, 86.95)],
)
def test_iec_sector_widths(ratio: float, width_deg: float) -> None:
    """Widths that were computed apart from this project, the last under the range of the standard."""
    assert abs(float(wakes.iec_sector_width_deg(ratio)) - width_deg) < 0.005


def test_iec_width_at_the_neighbour_itself_is_finite() -> None:
    """At no distance the arctangent is 90°: 1.3 · 90 + 10 = 127°."""
    assert float(wakes.iec_sector_width_deg(0.0)) == pytest.approx(127.0)


def test_iec_range_includes_its_ends() -> None:
    """2 and 20 diameters are in, 1.64 and 20.01 out."""
    assert wakes.iec_in_range([1.64, 2.0, 20.0, 20.01]).tolist() == [False, True, True, False]


def test_equivalent_diameter_of_a_square_obstacle_is_its_side() -> None:
    """The harmonic mean of equal lengths; and it is below twice the shorter side."""
    assert float(wakes.equivalent_diameter_m(12.0, 12.0)) == 12.0
    assert float(wakes.equivalent_diameter_m(5.0, 1e9)) == pytest.approx(10.0)


def test_deficit_by_the_cone_in_plan() -> None:
    """A point is slowed exactly where the drawn outline, cut at its height, covers it."""
    rng = np.random.default_rng(5)
    rotor = wakes.Rotors([[30.0, -20.0, 90.0]], 100.0, THRUST)
    points = np.column_stack([rng.uniform(-1500, 1500, (400, 2)), np.full(400, 90.0)])
    for wind_from in (0.0, 33.0, 181.0, 275.0):
        outline = wakes.wake_outline_m(rotor.hub_m[0], 100.0, wind_from, decay=0.075, length_m=1000.0)
        drawn = shapely.contains_xy(shapely.Polygon(outline.polygon_m), points[:, 0], points[:, 1])
        slowed = wakes.deficits(rotor, points, [wind_from], decay=0.075, max_diameters=10.0)[:, 0, 0] > 0.0
        assert drawn.any() and np.array_equal(drawn, slowed)


@pytest.mark.parametrize(("wind_from", "east", "north"), [(0, 0, -1), (90, -1, 0), (180, 0, 1), (270, 1, 0)])
def test_outline_goes_downwind(wind_from: float, east: float, north: float) -> None:
    """Wind from the north makes a wake to the south."""
    outline = wakes.wake_outline_m([5.0, 6.0, 80.0], 80.0, wind_from, decay=0.05, length_m=200.0, stations=3)
    assert np.allclose(outline.axis_m[-1], [5.0 + 200.0 * east, 6.0 + 200.0 * north, 80.0])
    assert np.allclose(outline.radius_m, [40.0, 45.0, 50.0])
    assert np.array_equal(outline.polygon_m[0], outline.polygon_m[-1]) and outline.polygon_m.shape == (7, 2)
    assert shapely.Polygon(outline.polygon_m).area == pytest.approx(200.0 * 90.0)


def test_deficit_is_cut_in_height() -> None:
    """At X 500 m the wake of D 100 m, k 0.075 has a radius of 87.5 m: 87 m above the hub is in, 88 m out."""
    rotor = wakes.Rotors([[0.0, 0.0, 100.0]], 100.0, THRUST)
    loss = wakes.deficit(rotor, [[0.0, -500.0, 187.0], [0.0, -500.0, 188.0]], [0.0], decay=0.075)
    assert loss[0, 0] > 0.0 and loss[1, 0] == 0.0


def test_two_equal_wakes_add_by_root_of_sum_of_squares() -> None:
    """Two rotors in one place slow the wind by the square root of 2 as much; nothing is slowed upwind."""
    point, wind = [0.0, -400.0, 80.0], np.array([0.0, 180.0])
    one = wakes.deficit(wakes.Rotors([[0.0, 0.0, 80.0]], 90.0, THRUST), point, wind)
    two = wakes.deficit(wakes.Rotors([[0.0, 0.0, 80.0]] * 2, 90.0, THRUST), point, wind)
    assert two[0] == pytest.approx(np.sqrt(2.0) * one[0])
    assert one[1] == 0.0 and two[1] == 0.0


def test_no_rotor_no_deficit() -> None:
    """A site without turbines has shapes, and no loss."""
    none = wakes.Rotors(np.empty((0, 3)), [], [])
    assert len(none) == 0 and wakes.deficit(none, np.zeros((7, 3)), [0.0, 90.0]).tolist() == [[0.0, 0.0]] * 7


@pytest.mark.parametrize(
    ("diameter_m", "thrust", "text"),
    [(0.0, 0.8, "positive diameters"), (90.0, 1.2, "from 0 to 1"), ([90.0, 80.0], 0.8, "one for all")],
)
def test_bad_rotors_are_refused(diameter_m: float, thrust: float, text: str) -> None:
    """What is allowed stands in the message."""
    with pytest.raises(InputError, match=text):
        wakes.Rotors([[0.0, 0.0, 80.0]], diameter_m, thrust)


def test_rotors_cannot_be_written_to() -> None:
    """A frozen thing keeps its arrays, and does not share the caller's."""
    hub = np.array([[0.0, 0.0, 80.0]])
    rotors = wakes.Rotors(hub, 90.0, 0.8)
    hub[0, 0] = 5.0
    assert rotors.hub_m[0, 0] == 0.0
    with pytest.raises(ValueError, match="read-only"):
        rotors.hub_m[0, 0] = 1.0


def test_outline_needs_a_length() -> None:
    """An outline of no or endless length is refused."""
    with pytest.raises(InputError, match="positive length"):
        wakes.wake_outline_m([0.0, 0.0, 80.0], 80.0, 0.0, decay=0.05, length_m=np.inf)


def test_hubs_are_not_reshaped_in_silence() -> None:
    """Three plan positions are not two hubs."""
    with pytest.raises(InputError, match="first axis"):
        wakes.Rotors(np.zeros((3, 2)), 80.0, 0.8)
