"""Geometry at its ends: zone edges, the antimeridian, float32, beams that hardly cross, straight up, tiny sectors."""

import math

import mpmath
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from geometry.angles import Sector, SectorSet, circular_mean_deg, difference_deg
from geometry.beams import beam_to, point_at, unit_vector
from geometry.crossing import cross, shared_probe_length_m
from geometry.frames import SiteFrame
from geometry.head import HeadLimits, Mounting, turn_time_s
from geometry.scans import sector
from geometry.wakes import iec_sector_width_deg, jensen_speed_ratio
from tests.extremes import oracle
from tests.extremes.digits import PLACES, frame_errors

few = settings(derandomize=True, max_examples=60, deadline=None, database=None)
HEAD = HeadLimits(50, 50, 100, 100)
ANGLES = (1e-9, 1e-6, 1e-3, 1.0, 90.0, 179.0, 180 - 1e-6, 180 - 1e-9)


@pytest.mark.parametrize("range_m", [1.0, 1e5])
@pytest.mark.parametrize("place", PLACES, ids=[place[0] for place in PLACES])
def test_exact_frame_against_the_meridian_arc_of_complex_latitude(place, range_m):
    """Positions within 10 nm (a northing's own rounding is 1 nm), convergence and scale to nine digits."""
    error, convergence, scale = frame_errors(*place[1:], range_m=range_m)
    assert error < 1e-8
    assert convergence > 8.5 and scale > 9


def test_both_sides_of_the_antimeridian_are_neighbours():
    """22.4 m apart across 180 degrees, from either zone: the chord of the ellipsoid to a nanometre's rounding."""
    west, east = (179.9999, -17.0, 5.0), (-179.9999, -17.0, 5.0)
    exact = oracle.enu(west, east)
    for crs in ("EPSG:32760", "EPSG:32701"):
        frame = SiteFrame(crs)
        head, point = (frame.from_geographic(*place) for place in (west, east))
        assert max(abs(g - x) for g, x in zip(frame.enu_m(head, point), exact, strict=True)) < 2e-8


def test_float32_coordinates_of_ten_million_metres_lose_their_own_rounding_and_no_more():
    """Float32 is the frame of the rounded numbers themselves: exactly, with every model."""
    frame = SiteFrame("EPSG:32760")
    head, point = np.float32([500_000.4, 9_999_999.7, 5.0]), np.float32([500_800.1, 9_999_399.2, 105.0])
    for model in ("exact", "refracted", "curved", "flat", "flat-grid"):
        narrow = frame.enu_m(head, point, model=model)
        wide = frame.enu_m(head.astype(float), point.astype(float), model=model)
        np.testing.assert_array_equal(narrow, wide)
    assert np.spacing(np.float32(9_999_999.7)) == 1.0


@pytest.mark.parametrize("range_m", [1.0, 1e5])
@pytest.mark.parametrize("elevation", [-90.0, -89.999999, 0.0, 89.999999, 90.0])
def test_beams_return_from_one_metre_and_from_a_hundred_kilometres(range_m, elevation):
    """Angles and range of a point come back to 15 digits; straight up the elevation and range do."""
    beam = beam_to(point_at(217.3, elevation, range_m))
    assert float(beam.elevation_deg) == pytest.approx(elevation, abs=2e-14)
    assert float(beam.range_m) == pytest.approx(range_m, rel=1e-15)
    if abs(elevation) < 90:
        assert float(beam.azimuth_deg) == pytest.approx(217.3, abs=1e-13)


@pytest.mark.parametrize("angle", ANGLES)
@pytest.mark.parametrize("azimuth", [0.0, 33.0])
def test_crossings_keep_the_digits_of_their_vectors_and_what_degrees_leave(azimuth, angle):
    """The given vectors: 14 digits. Degrees: 15 less the logarithm of the condition 1/sin."""
    second = azimuth + angle, (2.0 if angle < 90 else -2.0)
    heads = [0.0, 0.0, 0.0], [1000.0, -800.0, 5.0]
    beams = unit_vector(azimuth, 2.0), unit_vector(*second)
    got = cross(heads[0], beams[0], heads[1], beams[1])
    own = oracle.crossing(heads[0], list(beams[0]), heads[1], list(beams[1]))
    asked = oracle.crossing(heads[0], oracle.unit_vector(azimuth, 2.0), heads[1], oracle.unit_vector(*second))
    lost = math.log10(abs(1 / mpmath.sin(mpmath.radians(asked["angle"]))))
    for name in ("range1", "range2", "gap", "angle"):
        value = float(getattr(got, f"{name}_m" if name != "angle" else "angle_deg"))
        # the gap of nearly parallel beams is the distance of the heads' projections: measured against it
        scale = {"gap": 1300.0, "angle": None}.get(name, max(abs(own[name]), mpmath.mpf(10) ** (lost + 2)))
        assert oracle.digits(value, own[name], scale) > 13.5
        assert oracle.digits(value, asked[name], scale) > 14 - lost


@few
@given(st.floats(0, 360), st.floats(-89, 89))
def test_opposite_beams_meet_nowhere(azimuth, elevation):
    """At 180 degrees no crossing is known, whatever rounding the azimuths bring: NaN, with angle and gap."""
    away = cross(
        [0, 0, 0], unit_vector(azimuth, elevation), [0, 0, 7], unit_vector(azimuth + 180, -elevation)
    )
    assert np.isnan(away.range1_m) and np.isnan(away.point2_m).all() and np.isnan(away.height_difference_m)
    assert float(away.angle_deg) == pytest.approx(180.0, abs=1e-12)
    assert float(away.gap_m) == pytest.approx(7 * math.cos(math.radians(elevation)), rel=1e-9)


@pytest.mark.parametrize("elevation", [90.0, -90.0])
def test_a_beam_at_ninety_degrees_has_no_opening_angle(elevation):
    """cos 90° is 6e-17 in floating point and would give the difference of two meaningless azimuths."""
    got = cross([0, 0, 0], unit_vector(30.0, elevation), [1000, 0, 0], unit_vector(270.0, 3.0))
    assert np.isnan(got.opening_angle_deg) and np.isnan(got.folded_angle_deg)
    assert float(got.angle_deg) == pytest.approx(90.0 - math.copysign(3.0, elevation))
    assert float(got.gap_m) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(
    ("angle", "length"), [(0.0, 43.0), (1e-9, 43.0), (180.0 - 1e-9, 43.0), (180.0, 43.0), (90.0, 21.5)]
)
def test_probes_of_parallel_beams_share_all_their_air(angle, length):
    """Limits of 2 sqrt(D² - gap²)/sin: the whole probe when parallel, half of it at right angles."""
    assert float(shared_probe_length_m(angle, 0.0, 43.0, 43.0)) == pytest.approx(length, rel=1e-12)


@few
@given(st.floats(0, 360), st.floats(0.001, 360))
def test_a_sector_holds_its_own_ends(start, width):
    """Whatever the rounding of start + width, both ends and the middle are inside, and a bit more is not."""
    own = Sector(start, width)
    assert own.contains([own.from_deg, own.middle_deg, own.to_deg]).all()
    if width < 359.9:
        assert not own.contains([own.from_deg - 1e-6, own.to_deg + 1e-6]).any()


def test_the_ends_of_sectors():
    """0.001 degrees and the full circle: widths, complements and containment are those of arithmetic."""
    tiny = SectorSet.of([Sector(359.9995, 0.001)])
    assert tiny.contains([359.9996, 0.0, 0.0004]).all() and not tiny.contains([0.00051, 359.9994]).any()
    assert tiny.complement().width_deg == pytest.approx(359.999, abs=1e-12)
    assert SectorSet.full().complement() == SectorSet.empty()
    assert float(difference_deg(1e-13, 360.0)) == pytest.approx(1e-13, rel=1e-12)
    assert np.isnan(circular_mean_deg([10.0, 190.0])) and np.isnan(circular_mean_deg([0.0, 120.0, 240.0]))


@pytest.mark.parametrize(
    ("size", "step", "count"),
    [(0.001, 1e-8, 100_000), (0.001, 5e-4, 2), (360.0, 180.0, 2), (360.0, 0.0036, 100_000)],
)
def test_scans_of_two_and_of_a_hundred_thousand_rays(size, step, count):
    """Every ray stands where half-step arithmetic puts it, to the rounding of an azimuth; the arc is the sector."""
    scan = sector(217.3, 3.0, sector_deg=size, step_deg=step, accumulation_s=0.1, head=HEAD)
    assert scan.count == count
    offset = difference_deg(scan.azimuth_deg, 217.3)
    want = [(i + 0.5) * (size / count) - size / 2 for i in (0, count // 3, count - 1)]
    np.testing.assert_allclose(offset[[0, count // 3, count - 1]], want, atol=1.2e-13)
    assert scan.azimuth_arc_deg[1] == pytest.approx(size, rel=1e-9)


def test_the_head_turns_by_nothing_in_no_time_and_tiny_turns_by_the_root():
    """2 sqrt(d/A) down to 1e-9 degrees."""
    got = turn_time_s([0.0, 1e-9, -1e-9], speed_deg_per_s=50, acceleration_deg_per_s2=100)
    np.testing.assert_allclose(got, [0.0, 2e-5 / math.sqrt(10), 2e-5 / math.sqrt(10)], rtol=1e-14)


@few
@given(st.floats(0, 360), st.floats(-90, 90), st.floats(0, 360), st.sampled_from([-90.0, 90.0]))
def test_a_head_pitched_to_the_zenith_still_points_where_it_is_told(azimuth, elevation, heading, pitch):
    """There and back at the singular tilt: the same direction, though its angles may differ."""
    mounting = Mounting(heading_deg=heading, pitch_deg=pitch, roll_deg=13.0, azimuth_offset_deg=7.0)
    back = mounting.to_true(*mounting.to_head(azimuth, elevation))
    np.testing.assert_allclose(unit_vector(*back), unit_vector(azimuth, elevation), atol=1e-15 * 20)


def test_wakes_at_the_rotor_and_very_far():
    """Limits of the formulas: 127 degrees at no distance, 21.09 far away; a speed ratio of sqrt(1 - Ct), and 1."""
    width = iec_sector_width_deg([0.0, 1e12])
    np.testing.assert_allclose(width, [1.3 * 90 + 10, 1.3 * math.degrees(math.atan(0.15)) + 10], rtol=1e-11)
    np.testing.assert_allclose(
        jensen_speed_ratio(100.0, [0.0, 1e12], 1.0, decay=0.05), [0.0, 1.0], atol=1e-15
    )
