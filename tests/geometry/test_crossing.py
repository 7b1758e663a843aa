"""Two beams: published crossings, brute force, symmetry and fifty digits where beams are nearly parallel."""

import math

import mpmath
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy import optimize

from geometry.beams import beam_to, unit_vector
from geometry.crossing import cross, shared_probe_length_m
from geometry.errors import InputError

quick = settings(derandomize=True, deadline=None, max_examples=60, database=None)
azimuths = st.floats(0, 360)
elevations = st.floats(-80, 80)
metres = st.floats(-5000, 5000)


def exact_crossing(origin1, direction1, origin2, direction2):
    """Common perpendicular of the very same floats with 60 digits: range 1, range 2, gap, angle [deg]."""
    with mpmath.workdps(60):
        o1, b1, o2, b2 = (
            [mpmath.mpf(float(x)) for x in v] for v in (origin1, direction1, origin2, direction2)
        )

        def dot(a, b):
            return sum(x * y for x, y in zip(a, b, strict=True))

        def product(a, b):
            return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]

        n = product(b1, b2)
        w = [q - p for p, q in zip(o1, o2, strict=True)]
        square = dot(n, n)
        range1 = dot(product(w, b2), n) / square * mpmath.sqrt(dot(b1, b1))
        range2 = dot(product(w, b1), n) / square * mpmath.sqrt(dot(b2, b2))
        gap = abs(dot(w, n)) / mpmath.sqrt(square)
        return range1, range2, gap, mpmath.degrees(mpmath.atan2(mpmath.sqrt(square), dot(b1, b2)))


def test_kassel_ws4_and_ws5_cross_at_63_degrees():
    """NEWA Kassel 2016, flat grid geometry: the published angle; both beams meet at the target."""
    ws4, ws5 = np.array([510686.85, 5687916.63, 287.4]), np.array([511044.39, 5689538.29, 277.7])
    target = np.array([512086.2, 5688182.1, 362.1])
    beam4, beam5 = beam_to(target - ws4), beam_to(target - ws5)
    assert float(beam4.azimuth_deg) == pytest.approx(79.26, abs=0.005)
    assert float(beam5.range_m) == pytest.approx(1712.3, abs=0.1)  # the printed positions give 1712.23
    crossing = cross(
        ws4 - target,
        unit_vector(beam4.azimuth_deg, beam4.elevation_deg),
        ws5 - target,
        unit_vector(beam5.azimuth_deg, beam5.elevation_deg),
    )
    assert float(crossing.angle_deg) == pytest.approx(63.1, abs=0.05)
    assert float(crossing.gap_m) < 1e-9
    assert np.abs(crossing.point1_m).max() < 1e-9
    assert float(crossing.range1_m) == pytest.approx(1426.3, abs=0.05)
    assert float(crossing.opening_angle_deg) == pytest.approx(142.47 - 79.26, abs=0.01)


def test_the_last_kassel_target_of_ws7_and_ws8_is_near_their_baseline():
    """The beams open by 176 degrees, 4 from the baseline: folded 4, unfolded 176."""
    ws7, ws8 = np.array([513640.85, 5692217.07, 285.2]), np.array([517029.65, 5690931.40, 315.7])
    target = np.array([514761.5, 5691738.2, 319.9])
    crossing = cross(ws7, target - ws7, ws8, target - ws8)
    assert float(crossing.opening_angle_deg) == pytest.approx(176, abs=0.5)
    assert float(crossing.folded_angle_deg) == pytest.approx(4, abs=0.5)


def test_a_mispointed_pair_shows_its_gap():
    """Two level beams at right angles, one raised by 0.5 degrees: it passes 8.73 m away at 1000 m."""
    crossing = cross([0, 0, 0], unit_vector(90, 0), [1000, -1000, 0], unit_vector(0, 0.5))
    tilt = math.radians(0.5)  # the common perpendicular leans back by the tilt
    assert float(crossing.gap_m) == pytest.approx(1000 * math.sin(tilt), rel=1e-9)
    assert float(crossing.height_difference_m) == pytest.approx(
        1000 * math.sin(tilt) * math.cos(tilt), rel=1e-9
    )
    swapped = cross([1000, -1000, 0], unit_vector(0, 0.5), [0, 0, 0], unit_vector(90, 0))
    assert float(swapped.height_difference_m) == -float(crossing.height_difference_m)


@quick
@given(azimuths, elevations, azimuths, elevations, st.tuples(metres, metres, st.floats(-300, 300)))
def test_no_other_pair_of_points_is_closer(azimuth1, elevation1, azimuth2, elevation2, offset):
    """Against numeric minimisation of the distance over both ranges."""
    b1, b2 = unit_vector(azimuth1, elevation1), unit_vector(azimuth2, elevation2)
    assume(np.linalg.norm(np.cross(b1, b2)) > 0.05)
    crossing = cross([0, 0, 0], b1, offset, b2)
    fit = optimize.lsq_linear(np.column_stack([b1, -b2]), np.asarray(offset), method="bvls", tol=1e-15)
    assert np.abs(fit.x - [crossing.range1_m, crossing.range2_m]).max() < 1e-6
    assert float(np.linalg.norm(fit.fun)) == pytest.approx(float(crossing.gap_m), abs=1e-6)
    joint = crossing.point2_m - crossing.point1_m
    assert abs(joint @ b1) < 1e-6 and abs(joint @ b2) < 1e-6
    assert joint[2] == pytest.approx(float(crossing.height_difference_m), abs=1e-6)


@quick
@given(azimuths, elevations, azimuths, elevations, st.floats(0, 360), st.floats(0.1, 1000))
def test_turning_the_scene_and_stretching_directions_change_nothing(az1, el1, az2, el2, turn, stretch):
    """Angles and gap depend neither on where north is nor on the length of the direction vectors."""
    b1, b2 = unit_vector(az1, el1), unit_vector(az2, el2)
    assume(np.linalg.norm(np.cross(b1, b2)) > 1e-3)
    near = cross([0, 0, 0], b1, [500, 300, 20], b2)
    c, s = math.cos(math.radians(turn)), math.sin(math.radians(turn))
    matrix = np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]])
    far = cross([0, 0, 0], stretch * matrix @ b1, matrix @ [500, 300, 20], matrix @ b2)
    for name in ("range1_m", "range2_m", "gap_m", "height_difference_m", "angle_deg", "opening_angle_deg"):
        size = 1000 / float(np.linalg.norm(np.cross(b1, b2))) ** 2
        assert float(getattr(far, name)) == pytest.approx(float(getattr(near, name)), abs=1e-12 * size)


@pytest.mark.parametrize("angle_deg", [1e-12, 1e-9, 1e-6, 1e-3, 0.1, 1, 30, 90, 150, 179, 179.999])
@pytest.mark.parametrize("sense", [1.0, -1.0])
def test_nearly_parallel_beams_keep_their_digits(angle_deg, sense):
    """Parallel or anti-parallel down to 1e-12 degrees: the angle of the given floats to 1e-14 of itself."""
    first = unit_vector(77.3, 3.1)
    second = sense * unit_vector(77.3 + angle_deg, 3.1)
    origin2 = np.array([650.25, -1210.5, 12.125])
    range1, range2, gap, angle = exact_crossing([0, 0, 0], first, origin2, second)
    crossing = cross([0, 0, 0], first, origin2, second)
    small = min(angle, 180 - angle)
    sine = mpmath.sin(mpmath.radians(small))
    assert abs(float(crossing.angle_deg) - angle) <= 1e-14 * max(small, 180 if angle > 90 else small)
    # an error of one rounding in the baseline moves the crossing by eps·1400 m/sin(angle)
    for got, exact in ((crossing.range1_m, range1), (crossing.range2_m, range2)):
        assert abs(float(got) - exact) < 2e-12 / sine + abs(exact) * 1e-14
    assert abs(float(crossing.gap_m) - gap) < 1e-11


def test_the_angle_from_an_arccosine_would_be_lost():
    """At 1e-9 degrees b1·b2 rounds to 1: arccos sees 0, atan2 sees the angle."""
    first, second = np.array([1.0, 0.0, 0.0]), np.array([1.0, math.radians(1e-9), 0.0])
    assert math.acos(min(1.0, float(first @ second))) == 0.0
    assert float(cross([0, 0, 0], first, [0, 1, 0], second).angle_deg) == pytest.approx(1e-9, rel=1e-14)


@pytest.mark.parametrize(("sense", "angle_deg"), [(1.0, 0.0), (-1.0, 180.0)])
def test_parallel_beams_meet_nowhere_at_an_exact_angle(sense, angle_deg):
    """Points, ranges and height difference are NaN; angle and distance stay numbers."""
    direction = unit_vector(33.3, 4.4)
    crossing = cross([0, 0, 0], direction, [0, 0, 7], sense * direction)
    assert float(crossing.angle_deg) == angle_deg == float(crossing.opening_angle_deg)
    assert float(crossing.folded_angle_deg) == 0.0
    assert np.isnan(crossing.point1_m).all() and np.isnan(crossing.range2_m)
    assert np.isnan(crossing.height_difference_m)
    assert float(crossing.gap_m) == pytest.approx(7 * math.cos(math.radians(4.4)), rel=1e-12)


@pytest.mark.parametrize(
    ("azimuth", "opening", "folded"), [(60, 60, 60), (120, 120, 60), (270, 90, 90), (185, 175, 5)]
)
def test_opening_angle_is_kept_unfolded_and_folded(azimuth, opening, folded):
    """60 and 120 degrees are different geometries with the same conditioning."""
    crossing = cross([0, 0, 0], unit_vector(0, 20), [10, 0, 0], unit_vector(azimuth, 10))
    assert float(crossing.opening_angle_deg) == pytest.approx(opening)
    assert float(crossing.folded_angle_deg) == pytest.approx(folded)


def test_a_vertical_beam_has_no_opening_angle_in_plan():
    """NaN in plan, while the angle in space is exact."""
    crossing = cross([0, 0, 0], [0, 0, 1], [100, 0, 0], unit_vector(270, 30))
    assert np.isnan(crossing.opening_angle_deg) and np.isnan(crossing.folded_angle_deg)
    assert float(crossing.angle_deg) == pytest.approx(60)


def test_beams_that_diverge_come_closest_behind_a_lidar():
    """A negative range says so."""
    crossing = cross([0, 0, 0], unit_vector(350, 0), [100, 0, 0], unit_vector(10, 0))
    assert float(crossing.range1_m) < 0 and float(crossing.range2_m) < 0


def test_shapes_broadcast():
    """Two lidars against many directions, some parallel, some missing."""
    directions = unit_vector(np.array([[0.0, 90.0, np.nan]]), 0.0)
    crossing = cross([0, 0, 0], unit_vector(0, 0), [[[5, 0, 0]], [[9, 0, 0]]], directions)
    assert crossing.point1_m.shape == (2, 3, 3) and crossing.gap_m.shape == (2, 3)
    assert np.isnan(crossing.range1_m).tolist() == [[True, False, True]] * 2


def brute_shared_m(angle_deg, gap, length1, length2, separation):
    """Sampling: points of the shorter probe whose nearest sampled point of the longer one is close."""
    short, long = sorted((length1, length2))
    at = (np.arange(4000) + 0.5) / 4000 - 0.5
    angle = math.radians(angle_deg)
    points = short * at[:, None] * [1, 0, 0]
    direction = np.array([math.cos(angle), math.sin(angle), 0])
    foot = np.clip(points @ direction, -long / 2, long / 2)  # nearest point of a segment
    distance = np.linalg.norm(points - (foot[:, None] * direction + [0, 0, gap]), axis=1)
    return short * float(np.mean(distance <= separation))


@quick
@given(st.floats(0, 180), st.floats(0, 30), st.floats(1, 100), st.floats(1, 100), st.floats(0.1, 60))
def test_shared_probe_length_is_what_sampling_finds(angle, gap, length1, length2, separation):
    """4000 points on the shorter probe, to one point at each end."""
    got = float(shared_probe_length_m(angle, gap, length1, length2, separation_m=separation))
    expected = brute_shared_m(angle, gap, length1, length2, separation)
    assert abs(got - expected) <= 2.1 * min(length1, length2) / 4000


def test_shared_probe_length_at_its_limits():
    """All of it when parallel and close, nothing beyond the separation, symmetric in the beams."""
    assert shared_probe_length_m([0, 180, 1e-12], 5.0, 40.0, 60.0).tolist() == [40.0, 40.0, 40.0]
    assert shared_probe_length_m([0, 90, 180], 10.1, 40.0, 60.0).tolist() == [0.0, 0.0, 0.0]
    assert float(shared_probe_length_m(70, 3, 40, 60)) == float(shared_probe_length_m(110, 3, 60, 40))


@pytest.mark.parametrize(
    "wrong",
    [
        lambda: cross([0, 0, 0], [0, 0, 0], [1, 0, 0], [0, 1, 0]),
        lambda: cross([0, 0], [0, 1], [1, 0], [0, 1]),
        lambda: cross([0, 0, 0], [0, 1, 0], np.zeros((2, 3)), np.ones((3, 3))),
        lambda: shared_probe_length_m(181, 0, 40, 40),
        lambda: shared_probe_length_m(90, -1, 40, 40),
        lambda: shared_probe_length_m(90, 1, -40, 40),
    ],
)
def test_impossible_beams_are_refused_in_words(wrong):
    """Every error says what to give."""
    with pytest.raises(InputError, match="give"):
        wrong()
