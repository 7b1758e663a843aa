"""Scans: the reference study's fence posts, hand-worked times, a simulated head, and properties."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from geometry.beams import unit_vector
from geometry.errors import InputError
from geometry.head import HeadLimits, move_time_s
from geometry.scans import middle_rays, points, ppi, raster, rhi, sector, stare, subset_rays
from geometry.sweeps import passing_time_s, reversal_time_s

quick = settings(derandomize=True, deadline=None, max_examples=60, database=None)
HEAD = HeadLimits(50, 50, 100, 100)  # the WindScanner's
HALO = HeadLimits(36, 72, 36, 72)


def hovsore(**changes):
    """The reference scan: 60 degrees in steps of 2, 400 ms a ray, declared 12 s."""
    options = {"sector_deg": 60, "step_deg": 2, "accumulation_s": 0.4, "period_s": 12, "head": HEAD} | changes
    return sector(150 + 12.31 + 29, 5.96, **options)


def test_hovsore_has_30_rays_whose_middles_span_58_degrees():
    """Published head azimuths 150 to 208, offset 12.31: middles half a step inside the ends."""
    scan = hovsore()
    assert scan.count == 30
    assert scan.azimuth_deg[[0, -1]] - 12.31 == pytest.approx([150, 208])
    assert scan.azimuth_arc_deg == pytest.approx((161.31, 60))
    assert np.all(scan.swept_azimuth_deg == 2)
    assert scan.time_s[[0, 1, -1]] == pytest.approx([0.2, 0.6, 11.8])
    assert scan.scans_in(600) == 50


def test_declared_12_s_leave_no_turn_round():
    """30 rays of 400 ms are 12 s; the head turns at 5 deg/s, not 2.5, and turns round in 2v/A = 0.1 s."""
    scan = hovsore()
    assert scan.asked_speed_deg_per_s == pytest.approx((5, 0))
    assert scan.measured_period_s == pytest.approx(12.1)
    assert scan.period_s == 12
    assert hovsore(period_s=None).period_s == scan.measured_period_s


@pytest.mark.parametrize(
    ("size", "rays"), [(60, 30), (50, 26), (44, 23), (38, 20), (30, 16), (22, 12), (14, 8), (8, 5), (4, 3)]
)
def test_subsets_of_the_reference_study(size, rays):
    """The published numbers of middle rays; the middle moves by half a ray at most, clockwise."""
    scan = hovsore()
    chosen = subset_rays(scan.count, 2, size)
    part = scan.subset(chosen)
    assert part.count == rays
    before, after = chosen.start, scan.count - chosen.stop
    assert before - after in (
        0,
        1,
    )  # what is cut on the counter-clockwise side, less what is cut on the other
    middle = 0.5 * (part.azimuth_deg[0] + part.azimuth_deg[-1])
    assert middle - 191.31 == pytest.approx(0.0 if rays % 2 == 0 else 1.0)
    assert part.period_s == scan.period_s and np.all(part.time_s == scan.time_s[chosen])


def test_the_study_takes_the_middle_ray_and_half_to_each_side():
    """Second formula: ray 16 of 30 (counted from 1) and Φ/2Δ rays to each side, where that is whole."""
    for size in (44, 8, 4):
        half = size // 4
        assert subset_rays(30, 2, size) == slice(15 - half, 15 + half + 1)


@quick
@given(st.integers(1, 500), st.data())
def test_middle_rays_are_in_the_middle(count, data):
    """As many are kept as asked for; the extra one is on the clockwise side."""
    keep = data.draw(st.integers(1, count))
    rays = middle_rays(count, keep)
    assert rays.stop - rays.start == keep and rays.start >= 0 and rays.stop <= count
    assert rays.start - (count - rays.stop) == (count - keep) % 2


def test_a_step_stare_parent_has_a_ray_at_each_end():
    """60 degrees in steps of 2 are 31 rays; the whole is 31 and 58 degrees are 30 of them."""
    scan = hovsore(motion="step", period_s=None)
    assert scan.count == 31
    assert scan.azimuth_deg[[0, -1]] == pytest.approx([161.31, 221.31])
    assert subset_rays(31, 2, 60, motion="step") == slice(0, 31)
    assert subset_rays(31, 2, 58, motion="step") == slice(1, 31)
    with pytest.raises(InputError, match="larger than the scan"):
        subset_rays(31, 2, 62, motion="step")


def test_reverse_passes_run_backwards_through_the_same_directions():
    """Odd passes: the last azimuth first, its middle half a ray after the start of the pass."""
    times = hovsore().ray_times_s(3)
    assert times[1, -1] == pytest.approx(12.2) and times[1, 0] == pytest.approx(23.8)
    assert np.all(np.diff(times[1]) < 0) and np.all(np.diff(times[2]) > 0)
    assert times[2] == pytest.approx(times[0] + 24)


def test_the_turn_round_comes_before_the_reverse_pass():
    """Period 12.1 s: the reverse pass begins at 12.1 s with the last ray, not with a pause at its end."""
    times = hovsore(period_s=None).ray_times_s(2)
    assert times[1, -1] == pytest.approx(12.3) and times[1, 0] == pytest.approx(23.9)


def test_a_subset_keeps_the_parents_mirror():
    """In the reverse pass a ray of an uneven subset is measured when the parent measures it."""
    scan = hovsore()
    rays = subset_rays(30, 2, 44)
    assert np.array_equal(scan.subset(rays).ray_times_s(4), scan.ray_times_s(4)[:, rays])


def test_forward_and_reset_passes_are_copies():
    """No pass is reversed; the way back is in the period."""
    for sweep in ("forward", "reset"):
        scan = hovsore(sweep=sweep, period_s=None)
        times = scan.ray_times_s(2)
        assert times[1] - times[0] == pytest.approx(scan.period_s)
        assert scan.period_s > 12


def test_reset_runs_back_at_full_speed():
    """Braking from 5 deg/s, 60.25 degrees back from rest to rest and the run-up: 0.05 + 1.705 + 0.05 s."""
    scan = hovsore(sweep="reset", period_s=None)
    assert scan.period_s == pytest.approx(12 + 0.1 + 60.25 / 50 + 0.5)


def test_forward_goes_round_the_rest_of_the_circle():
    """300 degrees, entered and left at 5 deg/s: 0.9 s of ramps for 24.75 degrees, 275.25 at 50 deg/s."""
    scan = hovsore(sweep="forward", period_s=None)
    assert scan.period_s == pytest.approx(12 + 0.9 + 275.25 / 50)


def moved_s(distance, before, after, axis, step_s=1e-4):
    """Bang-bang head stepped in time: enters at `before`, leaves at `after`, without stopping in between."""
    top, acceleration = axis
    position, speed, elapsed = 0.0, before, 0.0
    while position < distance:
        brake = (speed**2 - after**2) / (2 * acceleration) >= distance - position
        speed = (
            max(speed - acceleration * step_s, after) if brake else min(speed + acceleration * step_s, top)
        )
        position, elapsed = position + speed * step_s, elapsed + step_s
    return elapsed


@pytest.mark.parametrize("distance", [5.0, 20.0, 300.0])
def test_passing_time_is_what_a_stepped_head_takes(distance):
    """Short ways (top speed is not reached) and long ones."""
    assert passing_time_s(distance, 5.0, HEAD.azimuth) == pytest.approx(
        moved_s(distance, 5.0, 5.0, HEAD.azimuth), abs=3e-3
    )


def test_turning_round_on_the_spot_takes_twice_the_speed_over_the_acceleration():
    """And a stop, a turn and a start add up where the sweeps do not move at all."""
    assert reversal_time_s(0, 36, -36, HALO.azimuth) == pytest.approx(2.0)
    assert reversal_time_s(90, 0, 0, HEAD.azimuth) == pytest.approx(2.3)
    assert passing_time_s(90, 0, HEAD.azimuth) == pytest.approx(2.3)
    assert passing_time_s(0, 0, HEAD.azimuth) == 0.0


def test_full_ppi_goes_round_without_a_loss():
    """360 rays of 0.2 s: 72 s from start to start, the first middle half a step from the start."""
    scan = ppi(5, step_deg=1, accumulation_s=0.2, head=HEAD, start_azimuth_deg=350)
    assert scan.count == 360
    assert scan.measured_period_s == pytest.approx(72)
    assert scan.azimuth_deg[[0, 9, 10]] == pytest.approx([350.5, 359.5, 0.5])
    assert scan.azimuth_arc_deg[1] == pytest.approx(360)
    times = scan.ray_times_s(2)
    assert times[1, 0] - times[0, -1] == pytest.approx(0.2)


def test_full_ppi_back_and_forth_and_in_steps():
    """Back and forth turns round at the seam; in steps no direction comes twice."""
    assert ppi(
        5, step_deg=1, accumulation_s=0.2, head=HEAD, sweep="back_and_forth"
    ).measured_period_s == pytest.approx(72.1)
    steps = ppi(5, step_deg=30, accumulation_s=1, head=HEAD, motion="step")
    assert steps.azimuth_deg.tolist() == [float(a) for a in range(0, 360, 30)]
    assert steps.measured_period_s == pytest.approx(12 * (1 + 30 / 50 + 0.5))


def test_a_sector_may_cross_north():
    """Azimuths stay in [0, 360) and clockwise; the arc starts before north."""
    scan = sector(358, 3, sector_deg=20, step_deg=2, accumulation_s=0.5, head=HEAD)
    assert scan.azimuth_deg.tolist() == [349, 351, 353, 355, 357, 359, 1, 3, 5, 7]
    assert scan.azimuth_arc_deg == pytest.approx((348, 20))
    assert np.all(scan.swept_azimuth_deg == 2)


def test_the_arc_of_uneven_rays_is_the_smallest_that_holds_all():
    """A wide ray, over north or not, swallows a narrow one; spread points leave their largest hole out."""
    pair = points([1, 0], [5, 5], accumulation_s=1, head=HEAD)
    assert replace(pair, swept_azimuth_deg=np.array([2.0, 20.0])).azimuth_arc_deg == (350, 20)
    pair = points([20, 10], [5, 5], accumulation_s=1, head=HEAD)
    assert replace(pair, swept_azimuth_deg=np.array([40.0, 2.0])).azimuth_arc_deg == (0, 40)
    assert points([10, 350, 200], [5, 5, 5], accumulation_s=1, head=HEAD).azimuth_arc_deg == (200, 170)


def test_rhi_may_cross_the_zenith():
    """Directions are those of a head that goes over the top, with elevations of at most 90."""
    scan = rhi(20, from_deg=0, to_deg=180, step_deg=4, accumulation_s=0.1, head=HEAD)
    head_elevation = np.arange(2, 180, 4)
    assert (
        np.abs(unit_vector(scan.azimuth_deg, scan.elevation_deg) - unit_vector(20, head_elevation)).max()
        < 1e-15
    )
    assert scan.elevation_deg.max() <= 90
    start = unit_vector(scan.azimuth_deg, scan.elevation_deg - 0.5 * scan.swept_elevation_deg)
    assert (
        np.abs(start - unit_vector(20, head_elevation - 2)).max() < 1e-15
    )  # every ray begins where the last ended
    assert scan.measured_period_s == pytest.approx(4.5 + 2 * 40 / 100)


def test_rhi_may_run_down():
    """From above to below: negative sweep, the same time."""
    scan = rhi(20, from_deg=30, to_deg=0, step_deg=1, accumulation_s=0.5, head=HALO, sweep="reset")
    assert scan.elevation_deg[[0, -1]].tolist() == [29.5, 0.5]
    assert np.all(scan.swept_elevation_deg == -1) and np.all(scan.swept_azimuth_deg == 0)
    back = 30 + 2 * 2**2 / (2 * 72)
    assert scan.measured_period_s == pytest.approx(15 + 2 * 2 / 72 + 2 * math.sqrt(back / 72))


def test_step_stare_times_are_accumulation_and_turn():
    """2 degrees from rest to rest at 100 deg/s² take 0.2828 s; nothing to do before going back."""
    scan = hovsore(motion="step", period_s=None)
    turn = 2 * math.sqrt(2 / 100)
    assert np.diff(scan.time_s) == pytest.approx(0.4 + turn)
    assert scan.period_s == pytest.approx(31 * 0.4 + 30 * turn)
    times = scan.ray_times_s(2)
    assert times[1, -1] - times[0, -1] == pytest.approx(0.4)  # the last ray is measured twice in a row


def test_stare_repeats_one_ray():
    """A ray each half second, 1200 in ten minutes; declared 2 s, 300."""
    scan = stare(366.5, 6.1, accumulation_s=0.5)
    assert scan.azimuth_deg.tolist() == [6.5] and scan.kind == "stare"
    assert scan.ray_times_s(3).ravel().tolist() == [0.25, 0.75, 1.25]
    assert scan.scans_in(600) == 1200
    assert stare(0, 0, accumulation_s=0.5, period_s=2).scans_in(600) == 300
    assert scan.azimuth_arc_deg == (6.5, 0.0)


def test_raster_is_a_serpentine():
    """Rows alternate; between rows the head moves one step up only."""
    scan = raster(
        0, 5, width_deg=2, height_deg=2, step_deg=1, elevation_step_deg=2, accumulation_s=0.2, head=HALO
    )
    assert scan.azimuth_deg.tolist() == [359, 0, 1, 1, 0, 359]
    assert scan.elevation_deg.tolist() == [4, 4, 4, 6, 6, 6]
    across, up = 2 * math.sqrt(1 / 36), 2 * math.sqrt(2 / 72)
    assert np.diff(scan.time_s) - 0.2 == pytest.approx([across, across, up, across, across])
    assert scan.azimuth_arc_deg == pytest.approx((359, 2))
    assert scan.ray_times_s(2)[1, ::-1] - scan.period_s == pytest.approx(scan.time_s)


@pytest.mark.parametrize(("rise_deg", "between_s"), [(0.5, 0.2), (1, 0.2), (4, 0.4)])
def test_continuous_raster_turns_round_between_rows(rise_deg, between_s):
    """At 10 deg/s the turn-round takes 0.2 s, as much as 1 degree up; 4 degrees up take 0.4 s."""
    size = {"width_deg": 10, "height_deg": 2 * rise_deg, "step_deg": 1, "elevation_step_deg": rise_deg}
    scan = raster(90, 5, **size, accumulation_s=0.1, motion="continuous", sweep="reset", head=HEAD)
    assert scan.count == 30
    assert np.diff(scan.time_s)[[0, 9, 19]] == pytest.approx([0.1, 0.1 + between_s, 0.1 + between_s])
    assert scan.swept_azimuth_deg[[0, 10, 20]].tolist() == [1, -1, 1]
    # braking and run-up take 0.1 s each and 0.5 degrees: 11 degrees back from rest to rest
    assert scan.measured_period_s == pytest.approx(30 * 0.1 + 2 * between_s + 0.2 + 2 * math.sqrt(11 / 100))


def test_points_take_the_shorter_way_and_the_slower_axis():
    """350 to 10 over north; the way back to the first is in the period, unless the list is run in reverse."""
    directions = ([350, 10, 100], [0, 40, 40])
    scan = points(*directions, accumulation_s=1, head=HALO)
    moves = [float(move_time_s(*d, HALO)) for d in ((20, 40), (90, 0), (-110, -40))]
    assert np.diff(scan.time_s) == pytest.approx([1 + moves[0], 1 + moves[1]])
    assert scan.measured_period_s == pytest.approx(3 + sum(moves))
    again = points(*directions, accumulation_s=1, head=HALO, sweep="back_and_forth")
    assert again.measured_period_s == pytest.approx(3 + sum(moves[:2]))
    assert np.all(np.diff(again.ray_times_s(2)[1]) < 0)


def test_a_head_that_is_too_slow_stretches_the_rays():
    """10 degrees in 0.1 s ask for 100 deg/s; at 36 deg/s a ray takes 0.278 s."""
    scan = sector(0, 0, sector_deg=60, step_deg=10, accumulation_s=0.1, head=HALO)
    assert scan.asked_speed_deg_per_s[0] == pytest.approx(100)
    assert np.diff(scan.time_s) == pytest.approx(10 / 36)


def test_a_declared_period_that_is_too_short_presses_the_rays_together():
    """The declared period wins and no pass runs into the next."""
    scan = hovsore(period_s=6)
    assert scan.time_s[[0, -1]] == pytest.approx([0.1, 5.9])
    assert scan.ray_times_s(2)[1, [-1, 0]] == pytest.approx([6.1, 11.9])
    assert scan.measured_period_s == pytest.approx(12.1)


def test_declared_periods_hold_a_whole_number_of_scans():
    """600 s hold 6000 periods of 0.1 s although 600/0.1 may round below."""
    assert stare(0, 0, accumulation_s=0.1).scans_in(600) == 6000
    assert hovsore(period_s=12.1).scans_in(600) == 49


def test_a_measured_sector_scan_turns_round_in_the_period_that_is_computed():
    """Scanner file of WS9, NEWA Kassel 2016: 120 degrees at 2 deg/s, 1 s a ray, from turn to turn 60 s."""
    name = "shared/data/windscanner/WS9_20161213181000_scanner.txt"
    path = Path(__file__).parents[3] / name
    if not path.exists():
        pytest.skip(f"the measured file {name} is not beside this checkout")
    table = np.loadtxt(path, delimiter=";")
    azimuth, time_s = table[:, 1], table[:, 3] * 1e-4
    tops = (
        (azimuth[1:-1] >= azimuth[:-2])
        & (azimuth[1:-1] > azimuth[2:])
        & (azimuth[1:-1] > azimuth.max() - 0.5)
    )
    measured_s = np.diff(time_s[1:-1][tops]) / 2
    scan = sector(75, 6.78, sector_deg=120, step_deg=2, accumulation_s=1, head=HEAD)
    assert scan.measured_period_s == pytest.approx(60.04)
    assert measured_s == pytest.approx(scan.measured_period_s, abs=0.1)
    assert np.ptp(azimuth) == pytest.approx(scan.azimuth_arc_deg[1], abs=0.2)  # with overshoots


def any_scan():
    """Scans of every kind with random sizes."""
    motion = st.sampled_from(["continuous", "step"])
    back = st.sampled_from(["back_and_forth", "reset"])
    head = st.builds(HeadLimits, *[st.floats(1, 100)] * 4)
    common = {"accumulation_s": st.floats(0.05, 5), "head": head}
    steps = st.integers(1, 60)
    step = st.floats(0.1, 5)
    sectors = st.builds(
        lambda n, d, **k: sector(k.pop("axis"), 5, sector_deg=n * d, step_deg=d, **k),
        steps,
        step,
        axis=st.floats(-400, 400),
        motion=motion,
        sweep=st.sampled_from(["back_and_forth", "reset", "forward"]),
        **common,
    )
    fans = st.builds(
        lambda n, d, **k: rhi(9, from_deg=-3, to_deg=-3 + n * min(d, 4), step_deg=min(d, 4), **k),
        steps,
        step,
        motion=motion,
        sweep=back,
        **common,
    )
    rasters = st.builds(
        lambda n, m, **k: raster(3, 0, width_deg=n * 0.5, height_deg=m * 0.5, step_deg=0.5, **k),
        steps,
        st.integers(1, 8),
        motion=motion,
        sweep=back,
        **common,
    )
    lists = st.builds(
        lambda pairs, **k: points(*zip(*pairs, strict=True), **k),
        st.lists(st.tuples(st.floats(0, 360), st.floats(-90, 90)), min_size=1, max_size=9),
        sweep=back,
        **common,
    )
    return st.one_of(sectors, fans, rasters, lists)


@quick
@given(any_scan())
def test_rays_never_overlap_and_passes_never_run_into_each_other(scan):
    """Whatever the kind: rays in time order, one accumulation apart at least, over several passes."""
    times = np.sort(scan.ray_times_s(4).ravel())
    assert np.all(np.diff(times) >= scan.accumulation_s * (1 - 1e-9))
    assert times[0] >= 0.5 * scan.accumulation_s * (1 - 1e-9)
    assert scan.sweep_s <= scan.measured_period_s * (1 + 1e-12)
    assert np.all((scan.azimuth_deg >= 0) & (scan.azimuth_deg < 360))
    assert np.all(np.abs(scan.elevation_deg) <= 90)


@quick
@given(st.integers(1, 90), st.sampled_from([0.1, 0.3, 1.0, 2.0, 4.0]), st.floats(-720, 720), st.booleans())
def test_a_sector_is_what_the_beam_sweeps(steps, step_deg, axis_deg, continuous):
    """Arc and middle of any sector, with decimal steps, wherever north is."""
    size = steps * step_deg
    motion = "continuous" if continuous else "step"
    scan = sector(axis_deg, 0, sector_deg=size, step_deg=step_deg, accumulation_s=1, motion=motion, head=HEAD)
    full = size == 360
    assert scan.count == (steps if continuous or full else steps + 1)
    start, width = scan.azimuth_arc_deg
    if not full:
        assert width == pytest.approx(size, abs=1e-9)
        assert math.remainder(start + 0.5 * width - axis_deg, 360) == pytest.approx(0, abs=1e-9)


def test_a_scan_cannot_be_written_to_and_keeps_no_callers_array():
    """The arrays are copies and read-only."""
    scan = hovsore()
    with pytest.raises(ValueError, match="read-only"):
        scan.azimuth_deg[0] = 0.0
    mine = np.array([1.0, 2.0])
    listed = points(mine, np.zeros(2), accumulation_s=1, head=HEAD)
    mine[0] = 99
    assert listed.azimuth_deg[0] == 1.0


SECTOR = {"sector_deg": 60, "step_deg": 2, "accumulation_s": 0.4, "head": HEAD}


@pytest.mark.parametrize(
    "wrong",
    [
        lambda: sector(0, 5, **SECTOR | {"sector_deg": 0}),
        lambda: sector(0, 5, **SECTOR | {"sector_deg": 361}),
        lambda: sector(0, 5, **SECTOR | {"sector_deg": math.nan}),
        lambda: sector(0, 5, **SECTOR | {"step_deg": 7}),
        lambda: sector(0, 5, **SECTOR | {"step_deg": 0}),
        lambda: sector(0, 5, **SECTOR | {"step_deg": 61}),
        lambda: sector(0, 5, **SECTOR | {"step_deg": 1e-9}),
        lambda: sector(0, 5, **SECTOR | {"accumulation_s": 0}),
        lambda: sector(0, 5, **SECTOR | {"accumulation_s": math.nan}),
        lambda: sector(0, 5, **SECTOR | {"accumulation_s": 0, "motion": "step"}),
        lambda: sector(0, 5, **SECTOR | {"period_s": -1}),
        lambda: sector(math.inf, 5, **SECTOR),
        lambda: sector(0, 91, **SECTOR),
        lambda: sector(0, math.nan, **SECTOR),
        lambda: ppi(5, step_deg=7, accumulation_s=1, head=HEAD),
        lambda: rhi(0, from_deg=10, to_deg=10, step_deg=1, accumulation_s=1, head=HEAD),
        lambda: rhi(0, from_deg=10, to_deg=300, step_deg=1, accumulation_s=1, head=HEAD),
        lambda: rhi(math.nan, from_deg=0, to_deg=30, step_deg=1, accumulation_s=1, head=HEAD),
        lambda: raster(0, 89, width_deg=2, height_deg=4, step_deg=1, accumulation_s=1, head=HEAD),
        lambda: raster(0, 5, width_deg=0, height_deg=4, step_deg=1, accumulation_s=1, head=HEAD),
        lambda: raster(0, 5, width_deg=300, height_deg=3, step_deg=1e-3, accumulation_s=1, head=HEAD),
        lambda: points([], [], accumulation_s=1, head=HEAD),
        lambda: points([1, 2], [3], accumulation_s=1, head=HEAD),
        lambda: points([1, math.nan], [3, 4], accumulation_s=1, head=HEAD),
        lambda: points([1], [95], accumulation_s=1, head=HEAD),
        lambda: stare(0, 0, accumulation_s=-1),
        lambda: hovsore().ray_times_s(0),
        lambda: hovsore().scans_in(0),
        lambda: hovsore().subset(slice(30, 30)),
        lambda: middle_rays(30, 31),
        lambda: subset_rays(30, 2, 62),
        lambda: subset_rays(30, 2, 3),
        lambda: replace(hovsore(), azimuth_deg=np.zeros(3)),
    ],
)
def test_impossible_scans_are_refused_in_words(wrong):
    """Every error says what to do."""
    with pytest.raises(InputError, match=r"give|take|enlarge|must"):
        wrong()


def test_a_sector_that_does_not_fit_its_steps_is_told_what_would():
    """60 degrees in steps of 7: 56 or 63 degrees, or a step of 7.5."""
    with pytest.raises(InputError, match=r"take 56° or 63°, or a step of 7\.5°"):
        sector(0, 5, **SECTOR | {"step_deg": 7})
