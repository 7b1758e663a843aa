"""How a head stands and turns, against rotations by another library, published times and mpmath."""

import math

import mpmath
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from geometry.beams import unit_vector
from geometry.errors import InputError
from geometry.head import HeadLimits, Mounting, move_time_s, turn_time_s

quick = settings(derandomize=True, deadline=None, max_examples=80, database=None)
WINDSCANNER = {"speed_deg_per_s": 50.0, "acceleration_deg_per_s2": 100.0}
azimuths = st.floats(0, 360, exclude_max=True)
elevations = st.floats(-90, 90)
mountings = st.builds(
    Mounting,
    heading_deg=st.floats(-400, 400),
    pitch_deg=st.floats(-90, 90),
    roll_deg=st.floats(-180, 180),
    azimuth_offset_deg=st.floats(-20, 20),
    elevation_offset_deg=st.floats(-2, 2),
)


@pytest.mark.parametrize(("angle_deg", "time_ms"), [(18.07, 850.2), (54.37, 1587.4), (90, 2300), (10, 632)])
def test_turn_times_of_the_windscanner(angle_deg, time_ms):
    """Published times of a head of 50 deg/s and 100 deg/s²."""
    assert float(turn_time_s(angle_deg, **WINDSCANNER)) * 1000 == pytest.approx(time_ms, abs=0.5)
    assert float(turn_time_s(-angle_deg, **WINDSCANNER)) == float(turn_time_s(angle_deg, **WINDSCANNER))


def test_the_two_branches_of_the_turn_time_meet():
    """At V²/A both formulas give the same time, 2V/A; no turn takes no time."""
    below, at, above = turn_time_s([25 * (1 - 1e-12), 25.0, 25 * (1 + 1e-12)], **WINDSCANNER)
    assert below <= at <= above
    assert at == 1.0 and above - below < 1e-9
    assert float(turn_time_s(0.0, **WINDSCANNER)) == 0.0


@pytest.mark.parametrize("angle", [5e-324, 1e-12, 1e-3, 24.999999, 25.000001, 40.0, 720.0, 1e15])
@pytest.mark.parametrize(("speed", "acceleration"), [(50, 100), (1e-6, 1e6), (1e6, 1e-6)])
def test_turn_times_at_extremes_agree_with_fifty_digits(angle, speed, acceleration):
    """From the smallest float to 1e15 degrees, slow and fast heads, to 1e-15 of the time."""
    with mpmath.workdps(50):
        d, v, a = mpmath.mpf(angle), mpmath.mpf(speed), mpmath.mpf(acceleration)
        exact = 2 * mpmath.sqrt(d / a) if d <= v * v / a else d / v + v / a
        got = float(turn_time_s(angle, speed_deg_per_s=speed, acceleration_deg_per_s2=acceleration))
        if angle > 5e-324:  # the quotient of the smallest float has no digits left
            assert abs(got - exact) / exact < 1e-15
        assert math.isfinite(got) and got >= 0


def test_turn_time_is_what_a_stepped_head_takes():
    """A head that is accelerated and braked step by step covers the angle in the same time."""
    step_s, angle, turned, speed, elapsed = 1e-5, 54.37, 0.0, 0.0, 0.0
    while turned < angle and elapsed < 5:
        must_brake = speed**2 / (2 * 100.0) >= angle - turned
        speed = max(speed - 100 * step_s, 0.0) if must_brake else min(speed + 100 * step_s, 50.0)
        if speed == 0.0:
            break
        turned, elapsed = turned + speed * step_s, elapsed + step_s
    assert elapsed == pytest.approx(float(turn_time_s(angle, **WINDSCANNER)), abs=2e-3)


def test_the_slower_axis_counts():
    """HALO: elevation is twice as fast as azimuth, so equal turns wait for the azimuth."""
    halo = HeadLimits(36, 72, 36, 72)
    alone = turn_time_s(30, speed_deg_per_s=36, acceleration_deg_per_s2=36)
    assert float(move_time_s(30, -30, halo)) == float(alone)
    assert move_time_s(np.zeros((2, 1)), [10.0, 20.0, 30.0], halo).shape == (2, 3)


@quick
@given(mountings)
def test_rotation_is_that_of_intrinsic_turns(mounting):
    """Second formula: scipy's intrinsic rotation about z (clockwise), the new x, the new y."""
    turns = [-mounting.heading_deg, mounting.pitch_deg, mounting.roll_deg]
    expected = Rotation.from_euler("ZXY", turns, degrees=True).as_matrix()
    assert np.abs(mounting.rotation - expected).max() < 1e-14


@quick
@given(mountings)
def test_rotation_is_orthogonal_and_keeps_handedness(mounting):
    """R Rᵀ = 1 and det R = 1 to rounding."""
    assert np.abs(mounting.rotation @ mounting.rotation.T - np.eye(3)).max() < 1e-15
    assert np.linalg.det(mounting.rotation) == pytest.approx(1.0, abs=1e-14)


@quick
@given(mountings, azimuths, elevations)
def test_head_and_true_angles_go_both_ways(mounting, azimuth_deg, elevation_deg):
    """There and back the beam moves less than 1e-11 of its length, at the zenith too."""
    back = mounting.to_true(*mounting.to_head(azimuth_deg, elevation_deg))
    assert np.abs(unit_vector(*back) - unit_vector(azimuth_deg, elevation_deg)).max() < 1e-11
    assert 0 <= float(back[0]) < 360 and -90 <= float(back[1]) <= 90


@pytest.mark.parametrize(
    ("mounting", "head", "true"),
    [
        (Mounting(heading_deg=30), (0, 10), (30, 10)),
        (Mounting(pitch_deg=2), (0, 10), (0, 12)),  # the nose is up
        (Mounting(pitch_deg=2), (180, 10), (180, 8)),  # and the tail is down
        (Mounting(roll_deg=2), (90, 10), (90, 8)),  # the right side is down
        (Mounting(roll_deg=2), (270, 10), (270, 12)),
        (Mounting(heading_deg=90, pitch_deg=2), (0, 0), (90, 2)),  # pitch is about the turned lidar's right
        (Mounting(heading_deg=90, roll_deg=2), (90, 0), (180, -2)),
        (Mounting(azimuth_offset_deg=12.31, elevation_offset_deg=0.6), (179.69, 5.36), (192, 5.96)),
        (Mounting(roll_deg=180), (90, 20), (270, -20)),  # hung upside down
        (Mounting(), (0, 100), (180, 80)),  # over the top
        (Mounting(), (-10, 5), (350, 5)),
        (Mounting(), (730, 5), (10, 5)),
    ],
)
def test_signs_of_heading_pitch_roll_and_offsets(mounting, head, true):
    """Each convention in one line, worked out by hand."""
    azimuth, elevation = mounting.to_true(*head)
    assert (float(azimuth), float(elevation)) == pytest.approx(true, abs=1e-12)


def test_offsets_belong_to_the_encoder_inside_the_rotation():
    """With the nose up 1 degree and an azimuth offset of 90, head azimuth 0 looks to the level right side."""
    azimuth, elevation = Mounting(pitch_deg=1, azimuth_offset_deg=90).to_true(0, 0)
    assert float(azimuth) == pytest.approx(90) and float(elevation) == pytest.approx(0, abs=1e-12)


def test_azimuth_to_set_is_in_one_turn():
    """An offset that carries the azimuth below 0 gives 359.99, and rounding never gives 360."""
    assert float(Mounting(azimuth_offset_deg=1.01).to_head(1.0, 0)[0]) == pytest.approx(359.99)
    assert 0 <= float(Mounting(azimuth_offset_deg=1e-17).to_head(0.0, 0)[0]) < 360


def test_range_offset_goes_both_ways():
    """True range = stated range + offset."""
    mounting = Mounting(range_offset_m=-3)
    assert float(mounting.true_range_m(1000)) == 997
    assert float(mounting.head_range_m(mounting.true_range_m(1000))) == 1000


@pytest.mark.parametrize(
    "wrong",
    [
        lambda: Mounting(heading_deg=math.nan),
        lambda: Mounting(range_offset_m=math.inf),
        lambda: Mounting(pitch_deg=91),
        lambda: Mounting(roll_deg=-181),
        lambda: HeadLimits(0, 50, 100, 100),
        lambda: HeadLimits(50, 50, math.inf, 100),
        lambda: turn_time_s(10, speed_deg_per_s=-1, acceleration_deg_per_s2=100),
        lambda: turn_time_s(10, speed_deg_per_s=50, acceleration_deg_per_s2=math.nan),
    ],
)
def test_impossible_heads_are_refused_in_words(wrong):
    """Every error says what to give."""
    with pytest.raises(InputError, match="give"):
        wrong()
