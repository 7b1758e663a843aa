"""The recommended sector size on curves made by hand."""

import pytest

from planner.error_nouns import ErrorCurve, SizeError
from planner.sector_size import recommend
from planner.site import Tolerance


def size(sector_deg, slope, scatter, *, period_s=12.0):
    values = {"slope": slope, "residual_std_mps": scatter}
    return SizeError(sector_deg, 10, int(600 / period_s), period_s, 1000.0, 5.0, values)


def curve(*sizes):
    return ErrorCurve("sector", "lidar", "cup", "turbulent", "scalar", 40, tuple(sizes))


TOLERANCE = Tolerance(slope=0.01, scatter_growth=0.25)


@pytest.mark.parametrize(
    ("slopes", "scatters", "expected"),
    [
        ((1.0, 0.995, 0.985), (0.2, 0.22, 0.24), 40),  # the slope stops it
        ((1.0, 0.999, 0.998), (0.2, 0.24, 0.26), 40),  # the scatter stops it
        ((1.0, 0.999, 0.998), (0.2, 0.2, 0.2), 20),  # nothing stops it
        ((1.0, 0.97, 1.0), (0.2, 0.2, 0.2), 60),  # a size behind a bad one is not reached
    ],
)
def test_smallest_size_before_the_first_bad_one_is_recommended(slopes, scatters, expected):
    sizes = [size(deg, a, s) for deg, a, s in zip((60, 40, 20), slopes, scatters, strict=True)]
    assert recommend(curve(*sizes), TOLERANCE).sector_deg == expected


def test_reason_names_the_tolerance_and_what_stops_the_next_size():
    reason = recommend(curve(size(60, 1.0, 0.2), size(40, 0.98, 0.4)), TOLERANCE).reason
    assert "40° moves the slope by -0.020 and scatters 100% more" in reason


def test_saved_time_buys_noise_as_the_root_and_range_as_the_fourth_root_in_clear_air():
    saving = recommend(curve(size(60, 1.0, 0.2), size(40, 0.999, 0.2, period_s=3.0)), TOLERANCE).saving
    assert "4.00 times as long" in saving
    assert "falls to 50%" in saving
    assert "1.36 times as far" in saving  # 2^(1/2) without the haze on the way


def test_sizes_of_one_scan_save_nothing():
    assert recommend(curve(size(60, 1.0, 0.2), size(40, 0.999, 0.2)), TOLERANCE).saving == ""


def test_unknown_slopes_give_no_recommendation():
    advice = recommend(curve(size(60, None, None), size(40, None, None)), TOLERANCE)
    assert advice.sector_deg is None
    assert "turbulence" in advice.reason


def test_a_pair_has_no_size():
    assert recommend(curve(size(None, 1.0, 0.2)), TOLERANCE).sector_deg is None
