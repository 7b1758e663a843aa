"""Angles on the circle: against complex numbers, exact fractions and membership counted degree by degree."""

import math
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from geometry.angles import Sector, SectorSet, circular_mean_deg, difference_deg, wrap_180_deg, wrap_360_deg
from geometry.errors import InputError

few = settings(derandomize=True, max_examples=80, deadline=None)
angles = st.floats(-1e6, 1e6)
bearings = st.integers(0, 359).map(float)
sectors = st.builds(Sector, bearings, st.integers(1, 360).map(float))
sector_sets = st.lists(sectors, max_size=5).map(SectorSet.of)

# Half-degree marks lie inside or outside of sectors with whole-degree ends, never on an end.
MARKS_DEG = np.arange(0.5, 360.0, 1.0)


def marks(directions: SectorSet) -> set[float]:
    """The half-degree marks of a set: set algebra that owes nothing to sectors."""
    return set(MARKS_DEG[directions.contains(MARKS_DEG)].tolist())


@few
@given(angles)
def test_wraps_are_exact_remainders(angle: float) -> None:
    """Both wraps equal the remainder in exact fractions to the last bit or two of a full circle."""
    exact = Fraction(angle) % 360
    assert abs(float(Fraction(float(wrap_360_deg(angle))) - exact)) % 360 < 1e-13
    exact_signed = exact if exact < 180 else exact - 360
    assert float(wrap_180_deg(angle)) == float(exact_signed)


@pytest.mark.parametrize("angle", [-1e-300, -1e-17, 360.0, -360.0, 720.0, -0.0, math.nextafter(-180.0, -1e9)])
def test_wraps_stay_in_their_half_open_intervals(angle: float) -> None:
    """No rounding reaches the open end."""
    assert 0.0 <= float(wrap_360_deg(angle)) < 360.0
    assert -180.0 <= float(wrap_180_deg(angle)) < 180.0


def test_wraps_keep_shape_and_nan() -> None:
    """Any leading shape passes; NaN stays NaN."""
    angle = np.array([[np.nan, 370.0, -10.0]])
    assert wrap_360_deg(angle).shape == (1, 3)
    assert np.isnan(wrap_180_deg(angle)[0, 0])
    np.testing.assert_array_equal(wrap_360_deg(angle)[0, 1:], [10.0, 350.0])


@few
@given(st.integers(-720, 720), st.integers(-720, 720))
def test_difference_is_the_angle_between_complex_numbers(a: int, b: int) -> None:
    """The signed turn is the argument of a quotient of unit phasors, clockwise positive."""
    phasor = complex(math.cos(math.radians(a - b)), math.sin(math.radians(a - b)))
    expected = math.degrees(math.atan2(phasor.imag, phasor.real))
    turn = float(difference_deg(a, b))
    assert abs((turn - expected + 180.0) % 360.0 - 180.0) < 1e-9
    assert turn == -float(difference_deg(b, a)) or turn == -180.0


def test_circular_mean_crosses_north() -> None:
    """The mean of 359 and 3 is 1, of 270 (thrice) and 0 leans to 270."""
    assert float(circular_mean_deg([359.0, 3.0])) == pytest.approx(1.0)
    assert float(circular_mean_deg([270.0, 0.0], weights=[3.0, 1.0])) == pytest.approx(
        270.0 + math.degrees(math.atan(1 / 3))
    )


def test_circular_mean_of_opposite_directions_is_missing() -> None:
    """Where unit vectors cancel there is no mean direction, and an angle that is missing leaves none."""
    assert np.isnan(circular_mean_deg([10.0, 190.0]))
    assert np.isnan(circular_mean_deg([10.0, np.nan]))


@few
@given(st.lists(st.floats(0.0, 360.0), min_size=1, max_size=6), st.floats(-720.0, 720.0))
def test_circular_mean_turns_with_its_angles(directions: list[float], turn: float) -> None:
    """Turning every direction turns the mean as much."""
    resultant = abs(sum(complex(math.cos(math.radians(d)), math.sin(math.radians(d))) for d in directions))
    if resultant < 1e-3:
        return
    before, after = circular_mean_deg(directions), circular_mean_deg(np.array(directions) + turn)
    assert abs(float(difference_deg(after, before + turn))) < 1e-6


def test_circular_mean_along_an_axis() -> None:
    """Each row has its own mean."""
    rows = circular_mean_deg([[350.0, 20.0], [80.0, 100.0]], axis=1)
    np.testing.assert_allclose(rows, [5.0, 90.0])


def test_sector_of_the_reference_study() -> None:
    """118-270 is 152 degrees wide about 194, both ends inside."""
    sector = Sector.between(118.0, 270.0)
    assert (sector.width_deg, sector.middle_deg, sector.to_deg) == (152.0, 194.0, 270.0)
    assert sector.contains([118.0, 270.0, 117.9, 270.1]).tolist() == [True, True, False, False]


def test_sector_ends_that_do_not_round_are_inside() -> None:
    """An end that has no exact binary form still belongs to its sector, across north too."""
    assert Sector.between(0.1, 0.3).contains([0.1, 0.3]).all()
    assert Sector.between(350.1, 10.3).contains([350.1, 10.3, 0.0]).all()


def test_zero_to_360_is_the_full_circle() -> None:
    """0..360 is everything; equal ends are refused, since they could mean nothing or everything."""
    assert Sector.between(0.0, 360.0).width_deg == 360.0
    with pytest.raises(InputError, match="must differ"):
        Sector.between(90.0, 90.0)


@pytest.mark.parametrize(
    ("begin", "width"), [(0.0, 0.0), (0.0, -5.0), (0.0, 361.0), (np.nan, 5.0), (np.inf, 5.0), (0.0, np.nan)]
)
def test_impossible_sectors_are_refused(begin: float, width: float) -> None:
    """No empty, negative, over-full or missing sector."""
    with pytest.raises(InputError, match="sector"):
        Sector(begin, width)


def test_nan_is_in_no_sector() -> None:
    """A missing direction lies nowhere, not even in the full circle."""
    assert not SectorSet.full().contains(np.nan)


@few
@given(sector_sets, sector_sets)
def test_set_algebra_counted_mark_by_mark(a: SectorSet, b: SectorSet) -> None:
    """Union, intersection, difference and complement agree with Python sets of half-degree marks."""
    everything = {float(mark) for mark in MARKS_DEG}
    assert marks(a.union(b)) == marks(a) | marks(b)
    assert marks(a.intersection(b)) == marks(a) & marks(b)
    assert marks(a.difference(b)) == marks(a) - marks(b)
    assert marks(a.complement()) == everything - marks(a)


@few
@given(sector_sets)
def test_width_is_the_count_of_marks(directions: SectorSet) -> None:
    """With whole-degree ends the width is the number of half-degree marks inside."""
    assert directions.width_deg == pytest.approx(len(marks(directions)))
    assert directions.width_deg + directions.complement().width_deg == pytest.approx(360.0)


@few
@given(sector_sets, sector_sets)
def test_equal_sets_have_equal_form(a: SectorSet, b: SectorSet) -> None:
    """The normal form does not depend on the order, and is disjoint, sorted and without touching pieces."""
    together = a.union(b)
    assert together == b.union(a) == together.union(a)
    assert together.complement().complement() == together
    assert a.complement().union(b.complement()).complement() == a.intersection(b)
    starts = [sector.from_deg for sector in together.sectors]
    assert starts == sorted(starts)
    assert sum(sector.width_deg for sector in together.sectors) <= 360.0


@few
@given(st.lists(st.tuples(st.floats(0.0, 360.0), st.floats(1e-6, 360.0)), max_size=4), st.floats(0.0, 360.0))
def test_inclusion_and_exclusion_of_widths(ends: list[tuple[float, float]], turn: float) -> None:
    """|a or b| = |a| + |b| - |a and b| for ends of any digits, and turning a set keeps its width."""
    a = SectorSet.of([Sector(begin, width) for begin, width in ends[::2]])
    b = SectorSet.of([Sector(begin, width) for begin, width in ends[1::2]])
    expected = a.width_deg + b.width_deg - a.intersection(b).width_deg
    assert a.union(b).width_deg == pytest.approx(expected, abs=1e-6)
    turned = SectorSet.of([Sector(begin + turn, width) for begin, width in ends[::2]])
    assert turned.width_deg == pytest.approx(a.width_deg, abs=1e-6)


def test_full_and_empty_are_each_others_complement() -> None:
    """The two trivial sets."""
    assert SectorSet.full().complement() == SectorSet.empty()
    assert SectorSet.empty().complement() == SectorSet.full()
    assert SectorSet.full().pairs() == [(0.0, 360.0)]
    assert SectorSet.empty().pairs() == []


def test_touching_halves_make_the_full_circle() -> None:
    """Two half circles, wherever they begin, are all directions."""
    halves = SectorSet.of([Sector(37.25, 180.0), Sector(217.25, 180.0)])
    assert halves == SectorSet.full()


def test_rounding_slivers_do_not_survive() -> None:
    """Ends that differ by rounding alone leave no gap: thirds of a circle close."""
    thirds = SectorSet.of([Sector(k * 360.0 / 3.0 + 0.1, 360.0 / 3.0) for k in range(3)])
    assert thirds.complement() == SectorSet.empty()


def test_pieces_across_north_are_one() -> None:
    """317-43 and 20-60 merge across north into 317-60."""
    merged = SectorSet.of([Sector.between(0.0, 60.0), Sector.between(317.0, 0.0)])
    assert merged.pairs() == [(317.0, 60.0)]
