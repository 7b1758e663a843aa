"""Hard targets: found where they are, with an honest uncertainty, and refused where they cannot be told."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from geometry.beams import beam_to, point_at, unit_vector
from geometry.errors import InputError
from geometry.gates import Probe
from geometry.head import Mounting
from reconstruct.cnr_map import CnrMap
from reconstruct.cnr_simulation import Signal, simulate_cnr_map
from reconstruct.hard_target import find_target
from reconstruct.mounting_fit import fit_mounting
from reconstruct.range_fit import edge_range, peak_range
from reconstruct.sightings import Sighting, undetermined

PROBE = Probe(pulse_ns=200, window_ns=256)
SIZES_M = {"mast": 1.0, "tip": 1.0, "boom": 1.0}


def window(azimuth_deg: float, elevation_deg: float, half_deg: float = 0.25, step_deg: float = 0.0125):
    """Rays of a raster."""
    aside = np.arange(-half_deg, half_deg + step_deg / 2, step_deg)
    across, up = np.meshgrid(azimuth_deg + aside, elevation_deg + aside)
    return across.ravel(), up.ravel()


def simulated(
    seed,
    *,
    azimuth_deg=192.0,
    elevation_deg=6.0,
    range_m=1150.0,
    shape="tip",
    mounting=None,
    signal=None,
    **options,
) -> CnrMap:
    """A map around azimuth 192, elevation 6 of a target at the given place, with gates from 1100 to 1200 m."""
    around = (options.pop("azimuth_middle_deg", 192.0), options.pop("elevation_middle_deg", 6.0))
    return simulate_cnr_map(
        *window(*around),
        np.arange(1100.0, 1201.0),
        target_m=point_at(azimuth_deg, elevation_deg, range_m),
        shape=shape,
        size_m=options.pop("size_m", SIZES_M[shape]),
        probe=PROBE,
        rng=np.random.default_rng(seed),
        mounting=mounting,
        signal=signal,
        **options,
    )


@pytest.mark.parametrize("shape", ["mast", "tip", "boom"])
def test_a_target_is_found_within_a_hundredth_of_a_degree_and_its_uncertainty_is_honest(shape: str) -> None:
    """10 maps with size and beam as uncertain as stated: errors under 0.01°, 0.2 m, and inside two sigma."""
    inside = []
    for seed in range(10):
        rng = np.random.default_rng(1000 + seed)
        azimuth, elevation, reach = (
            192 + rng.uniform(-0.1, 0.1),
            6 + rng.uniform(-0.1, 0.1),
            rng.uniform(1140, 1160),
        )
        size, beam = SIZES_M[shape] * rng.normal(1, 0.1), 0.1 * max(rng.normal(1, 0.3), 0.2)
        cnr_map = simulated(
            seed,
            azimuth_deg=azimuth,
            elevation_deg=elevation,
            range_m=reach,
            shape=shape,
            size_m=size,
            beam_width_m=beam,
        )
        found = find_target(cnr_map, shape=shape, size_m=SIZES_M[shape], probe=PROBE)
        rise = np.cos(np.deg2rad(elevation)) / np.cos(np.deg2rad(found.elevation_deg))
        upright_m = reach * rise if shape == "mast" else reach  # a mast is told at the height that was hit
        for known, error, std, limit in (
            (shape != "boom", found.azimuth_deg - azimuth, found.azimuth_std_deg, 0.01),
            (shape != "mast", found.elevation_deg - elevation, found.elevation_std_deg, 0.01),
            (True, found.range_m - upright_m, found.range_std_m, 0.2),
        ):
            assert np.isfinite(std) == known
            if known:
                assert abs(error) < limit
                inside.append(abs(error) < 2 * std)
    assert np.mean(inside) >= 0.85  # of 20 or 30: 95.4 % expected, less is under 2 % likely


def test_a_window_across_north_is_found_as_any_other() -> None:
    plain = find_target(simulated(1), shape="tip", size_m=1.0, probe=PROBE)
    turned = find_target(
        simulated(1, azimuth_deg=360.02, azimuth_middle_deg=360.02), shape="tip", size_m=1.0, probe=PROBE
    )
    assert turned.azimuth_deg == pytest.approx(plain.azimuth_deg - 192 + 0.02, abs=1e-9)


def test_the_steps_of_a_map_are_told_whether_its_rays_share_angles_or_not() -> None:
    """A raster, one with encoder noise along the rows, and one with noise both ways: .02° by .01° within 8 %, .0141° if even."""
    rng = np.random.default_rng(3)
    across, up = (each.ravel() for each in np.meshgrid(100 + np.arange(30) * 0.02, 2 + np.arange(40) * 0.01))
    gates, dark = np.arange(10.0), np.zeros((1200, 10))
    noise = rng.uniform(-0.004, 0.004, (2, 1200))
    plain = CnrMap(across, up, gates, dark).step_deg
    rows = CnrMap(across + noise[0], up, gates, dark).step_deg
    both = CnrMap(across + noise[0], up + noise[1], gates, dark).step_deg
    assert plain == pytest.approx((0.02, 0.01), rel=1e-6)
    assert rows == pytest.approx((0.02, 0.01), rel=0.08)
    assert both == pytest.approx((0.0141, 0.0141), rel=0.08)


def test_a_gate_that_is_missing_in_every_ray_is_passed_over() -> None:
    whole = simulated(2)
    holes = whole.cnr_db.copy()
    holes[:, 7] = np.nan
    found = find_target(
        CnrMap(whole.azimuth_deg, whole.elevation_deg, whole.range_m, holes),
        shape="tip",
        size_m=1.0,
        probe=PROBE,
    )
    assert abs(found.azimuth_deg - 192) < 0.005


def test_missing_rays_and_gates_move_nothing_much() -> None:
    whole = simulated(2)
    holes = np.where(np.random.default_rng(0).uniform(size=whole.cnr_db.shape) < 0.02, np.nan, whole.cnr_db)
    found = find_target(
        CnrMap(whole.azimuth_deg, whole.elevation_deg, whole.range_m, holes),
        shape="tip",
        size_m=1.0,
        probe=PROBE,
    )
    assert abs(found.azimuth_deg - 192) < 0.005
    assert abs(found.elevation_deg - 6) < 0.01


def test_a_map_without_a_target_is_refused() -> None:
    with pytest.raises(InputError, match="no hard target in the map"):
        find_target(simulated(3, signal=Signal(target_db=-60.0)), shape="tip", size_m=1.0, probe=PROBE)


def test_noise_alone_is_no_target() -> None:
    rng = np.random.default_rng(8)
    for _ in range(5):
        noise = CnrMap(*window(192.0, 6.0), np.arange(1100.0, 1201.0), rng.normal(-25, 1, (1681, 101)))
        with pytest.raises(InputError, match="no hard target"):
            find_target(noise, shape="mast", size_m=1.0, probe=PROBE)


@pytest.mark.parametrize(
    ("azimuth", "range_m", "told"), [(0.12, 1150.0, "azimuth 192.1"), (0.0, 1500.0, "range 15")]
)
def test_two_targets_in_one_map_are_refused(azimuth: float, range_m: float, told: str) -> None:
    """Side by side at one range, and one behind the other."""
    gates = np.arange(1100.0, 1560.0, 2.0)
    maps = [
        simulate_cnr_map(
            *window(192.0, 6.0),
            gates,
            target_m=point_at(192.0 + across, 6.0, reach),
            shape="tip",
            size_m=1.0,
            probe=PROBE,
            rng=np.random.default_rng(seed),
            signal=Signal(target_db=strength),
        )
        for seed, across, reach, strength in ((1, -0.1, 1150.0, 0.0), (2, azimuth, range_m, -1.0))
    ]
    both = 10 * np.log10(sum(10 ** (each.cnr_db / 10) for each in maps))
    with pytest.raises(InputError, match=f"two targets in one map.*{told}"):
        find_target(CnrMap(*window(192.0, 6.0), gates, both), shape="tip", size_m=1.0, probe=PROBE)


def staggered(azimuth_deg, elevation_deg):
    """Rays of a raster, each row and column a golden section of a step beside the last: none shares an angle."""
    column, row = np.meshgrid(np.arange(azimuth_deg.size), np.arange(elevation_deg.size))
    aside, above = ((0.6180339887498949 * number + 0.5) % 1.0 - 0.5 for number in (row, column))
    across, up = (
        azimuth_deg[column] + aside * np.diff(azimuth_deg)[0],
        elevation_deg[row] + above * np.diff(elevation_deg)[0],
    )
    return across.ravel(), up.ravel()


def fine_map(size_m: float, reach_m: float, seed: int, *, aside_m=(0.0,), digits: int = 4) -> CnrMap:
    """121 x 121 staggered rays, four across the target but no finer than half the beam; tips so far aside of 192°, 6°."""
    step_deg = max(np.floor(np.rad2deg(max(size_m / 4, 0.05) / reach_m) * 1e3) / 1e3, 0.001)
    lines_deg = step_deg * np.arange(-60, 61)
    rays = [each.round(digits) for each in staggered(192.0 + lines_deg, 6.0 + lines_deg)]
    gates = np.arange(reach_m - 58, reach_m + 59)
    rng = np.random.default_rng(seed)
    maps = [
        simulate_cnr_map(
            *rays,
            gates,
            target_m=point_at(192.0 + np.rad2deg(aside / reach_m), 6.0, reach_m),
            shape="tip",
            size_m=size_m,
            probe=PROBE,
            rng=rng,
        )
        for aside in aside_m
    ]
    return CnrMap(*rays, gates, 10 * np.log10(sum(10 ** (each.cnr_db / 10) for each in maps)))


@pytest.mark.parametrize("digits", [3, 4, 9])
@pytest.mark.parametrize(
    ("size_m", "reach_m"), [(0.3, 1505.0), (0.3, 3000.0), (0.5, 2200.0), (0.5, 500.0), (1.0, 3000.0)]
)
def test_one_thin_target_is_one_target_however_far_and_fine(
    size_m: float, reach_m: float, digits: int
) -> None:
    """14,641 rays that share no angle, and as files round them: found within 3.5 stated deviations and 0.1 m."""
    for seed in range(2):
        found = find_target(
            fine_map(size_m, reach_m, seed, digits=digits), shape="tip", size_m=size_m, probe=PROBE
        )
        for off, std in (
            (found.azimuth_deg - 192.0, found.azimuth_std_deg),
            (found.elevation_deg - 6.0, found.elevation_std_deg),
        ):
            assert abs(off) < 3.5 * std
            assert np.deg2rad(abs(off)) * reach_m < 0.1


@pytest.mark.parametrize(("size_m", "reach_m"), [(0.3, 1505.0), (0.3, 3000.0), (1.0, 500.0)])
def test_two_thin_targets_a_metre_and_a_half_apart_are_two(size_m: float, reach_m: float) -> None:
    cnr_map = fine_map(size_m, reach_m, 0, aside_m=(-0.75, 0.75))
    with pytest.raises(InputError, match="two targets in one map"):
        find_target(cnr_map, shape="tip", size_m=size_m, probe=PROBE)


def test_the_steps_of_many_staggered_rays_are_what_each_has_to_itself() -> None:
    """225 x 189 rays a golden section of a step aside lie 2e-5 of the window apart: .002° by .002° within 2 %."""
    rays = staggered(112.36 + 0.002 * np.arange(225), 4.58 + 0.002 * np.arange(189))
    steps = CnrMap(*rays, np.arange(5.0), np.zeros((42525, 5))).step_deg
    assert steps == pytest.approx((0.002, 0.002), rel=0.02)


@pytest.mark.parametrize(
    ("place", "told"),
    [
        ({"azimuth_deg": 192.24}, "edge of the map's azimuth.*larger azimuth"),
        ({"elevation_deg": 5.751}, "edge of the map's elevation.*smaller elevation"),
        ({"elevation_deg": 7.0}, "edge of the map's elevation.*larger elevation"),
        ({"range_m": 1106.0}, "edge of the map's range.*smaller range"),
    ],
)
def test_a_target_at_the_edge_of_the_window_is_refused(place: dict, told: str) -> None:
    with pytest.raises(InputError, match=told):
        find_target(simulated(4, **place), shape="tip", size_m=1.0, probe=PROBE)


def test_the_peak_of_a_thin_target_is_found_between_gates() -> None:
    gates = np.arange(1100.0, 1200.0)
    rays = np.outer([1.0, 3.0], PROBE.weight(gates - 1151.37)) + 1e-4
    found = peak_range(gates, rays, 1150.0, PROBE)
    assert abs(found.range_m - 1151.37) < 1e-3


def test_the_edge_of_a_surface_is_the_middle_of_the_published_curve() -> None:
    """CNR(r) = low + (high - low)/(1 + exp(g(r - mid))), high -8 dB, low -30 dB, g 0.2/m; no edge, no range."""
    gates = np.arange(400.0, 560.0, 5.0)
    rng = np.random.default_rng(5)
    mids = rng.uniform(440, 520, 50)
    curves = -30 + 22 / (1 + np.exp(0.2 * (gates - mids[:, None]))) + rng.normal(0, 0.5, (50, gates.size))
    edge = edge_range(gates, np.vstack([curves, rng.normal(-30, 0.5, gates.size)]))
    error = edge.range_m[:50] - mids
    assert np.abs(error).max() < 2.0
    assert 0.88 < np.mean(np.abs(error) < 2 * edge.std_m[:50]) <= 1.0
    assert np.isnan(edge.range_m[50])


def sighting(
    name: str,
    azimuth_deg: float,
    elevation_deg: float,
    mounting: Mounting,
    std_deg=0.003,
    aside_deg=(0.0, 0.0),
):
    """A target 1 km away and where a head that stands like this finds it."""
    azimuth, elevation = mounting.to_head(azimuth_deg, elevation_deg)
    there = 1000.0 * unit_vector(azimuth_deg, elevation_deg)
    seen = (float(azimuth) + aside_deg[0], float(elevation) + aside_deg[1])
    return Sighting(name, there, *seen, 1000.0 - mounting.range_offset_m, std_deg, std_deg, 0.1, 0.0)


def test_the_published_elevation_offsets_give_the_published_tilt() -> None:
    """Δel = o - p cosγ + ρ sinγ: p -.01244, ρ -.07649, o .29495 (our pitch and roll have the other sign)."""
    offsets = zip((322.911, 127.975, 64.848), (0.351, 0.227, 0.231), strict=True)
    seen = [
        Sighting(f"{azimuth}", 1000 * unit_vector(azimuth, off), azimuth, 0.0, 1000.0, 0.02, 0.02, 1.0, 0.0)
        for azimuth, off in offsets
    ]
    fit = fit_mounting(seen)
    assert fit.mounting.pitch_deg == pytest.approx(0.01244, abs=5e-4)
    assert fit.mounting.roll_deg == pytest.approx(0.07649, abs=5e-4)
    assert fit.mounting.elevation_offset_deg == pytest.approx(0.29495, abs=5e-4)
    assert [angle for angle in fit.solved if fit.is_significant(angle)] == ["elevation_offset_deg"]
    assert fit.coverage_factor == pytest.approx(
        4.303, abs=0.001
    )  # Student's table: 95 %, two angles left over


@settings(max_examples=25, derandomize=True, deadline=None)
@given(st.floats(-180, 180), st.floats(-5, 5), st.floats(-5, 5), st.floats(-3, 3), st.integers(0, 10_000))
def test_any_mounting_is_found_from_exact_sightings(
    offset: float, pitch: float, roll: float, rise: float, seed: int
) -> None:
    """Exact rotations by geometry.head, not small angles, whatever the start."""
    true = Mounting(
        pitch_deg=pitch,
        roll_deg=roll,
        azimuth_offset_deg=offset,
        elevation_offset_deg=rise,
        range_offset_m=3.0,
    )
    rng = np.random.default_rng(seed)
    bearings = np.array([0.0, 95.0, 170.0, 260.0]) + rng.uniform(-20, 20, 4)
    seen = [sighting(f"{a}", a, e, true) for a, e in zip(bearings, rng.uniform(2, 10, 4), strict=True)]
    found = fit_mounting(seen).mounting
    for azimuth, elevation in ((10.0, 5.0), (200.0, 20.0)):
        apart = np.subtract(
            unit_vector(*found.to_true(azimuth, elevation)), unit_vector(*true.to_true(azimuth, elevation))
        )
        assert np.rad2deg(np.linalg.norm(apart)) < 1e-5
    assert found.range_offset_m == pytest.approx(3.0, abs=1e-6)


def test_offsets_from_noisy_sightings_lie_inside_two_sigma_as_often_as_they_should() -> None:
    true = Mounting(azimuth_offset_deg=0.05, elevation_offset_deg=0.6, pitch_deg=0.03, roll_deg=-0.03)
    inside = []
    for seed in range(60):
        rng = np.random.default_rng(seed)
        seen = [
            sighting(f"{a}", a, 5.0, true, aside_deg=tuple(rng.normal(0, 0.003, 2)))
            for a in (10, 80, 200, 300)
        ]
        fit = fit_mounting(seen)
        inside += [abs(getattr(fit.mounting, a) - getattr(true, a)) < 2 * fit.std_deg(a) for a in fit.solved]
    assert 0.91 <= np.mean(inside) <= 0.99


def test_an_outlier_is_named_and_left_out() -> None:
    true = Mounting(azimuth_offset_deg=12.31, elevation_offset_deg=0.6, pitch_deg=0.03)
    rng = np.random.default_rng(2)
    seen = [
        sighting(f"{a}", a, 5.0, true, aside_deg=tuple(rng.normal(0, 0.003, 2)))
        for a in (10, 80, 150, 220, 300)
    ]
    wrong = seen[2]._replace(azimuth_head_deg=seen[2].azimuth_head_deg + 0.2)
    fit = fit_mounting([*seen[:2], wrong, *seen[3:]])
    assert fit.outliers == ("150",)
    assert abs(fit.mounting.azimuth_offset_deg - 12.31) < 0.01
    assert fit.residuals[2].azimuth_deg == pytest.approx(-0.2, abs=0.02)


@pytest.mark.parametrize("elevation", [2.0, 8.0, 25.0])
def test_three_targets_in_a_line_are_refused_however_steep(elevation: float) -> None:
    """At 25° their azimuths alone would tell the tilt to 1.4 times the error of a map; by their bearings nothing does."""
    seen = [sighting(f"{number}", a, elevation, Mounting()) for number, a in enumerate((10.0, 10.5, 190.0))]
    with pytest.raises(InputError, match=r"do not determine .*(pitch|roll)"):
        fit_mounting(seen)


def test_masts_alone_tell_the_heading_and_no_tilt() -> None:
    """A mast has no elevation: three around the horizon leave the elevation offset and the tilt open."""
    masts = [
        sighting(f"{a}", a, 5.0, Mounting(azimuth_offset_deg=2.0))._replace(elevation_std_deg=np.nan)
        for a in (0, 120, 240)
    ]
    assert set(undetermined(masts)) == {"elevation_offset_deg", "pitch_deg", "roll_deg"}
    assert fit_mounting(masts, solve=("azimuth_offset_deg",)).mounting.azimuth_offset_deg == pytest.approx(
        2.0
    )


def test_targets_that_half_contradict_the_other_half_are_refused() -> None:
    """Four maps before and four after the head turned by 0.1°: no majority, so none is called an outlier."""
    before = [sighting(f"{a}", a, 5.0, Mounting()) for a in (0, 90, 180, 270)]
    after = [
        item._replace(name=f"{item.name} again", azimuth_head_deg=item.azimuth_head_deg + 0.1)
        for item in before
    ]
    with pytest.raises(InputError, match="no majority of them agrees"):
        fit_mounting([*before, *after])


@pytest.mark.parametrize("bearings", [(10.0,), (10.0, 190.0), (10.0, 10.0, 190.0), (10.0, 10.0, 10.0)])
def test_too_few_targets_or_targets_in_a_line_are_refused(bearings: tuple[float, ...]) -> None:
    seen = [sighting(f"{number}", a, 3.0 + number, Mounting()) for number, a in enumerate(bearings)]
    with pytest.raises(InputError, match=r"do not determine .*(pitch|roll)"):
        fit_mounting(seen)


def test_contradicting_targets_without_a_culprit_are_refused() -> None:
    """Three targets leave two angles over: one is wrong, and it cannot be told which."""
    seen = [sighting(f"{a}", a, 5.0, Mounting()) for a in (0, 120, 240)]
    wrong = seen[1]._replace(azimuth_head_deg=seen[1].azimuth_head_deg + 0.5)
    with pytest.raises(InputError, match="contradict each other"):
        fit_mounting([seen[0], wrong, seen[2]])


def test_the_head_position_moves_all_targets_together() -> None:
    """A common error widens what is found, but is no contradiction between targets."""
    near = [sighting(f"{a}", a, 5.0, Mounting()) for a in (10, 80, 200, 300)]
    shifted = []
    for item in near:
        beam = beam_to(item.enu_m - [0.5, 0.0, 0.0])
        shifted.append(
            item._replace(
                azimuth_head_deg=float(beam.azimuth_deg), elevation_head_deg=float(beam.elevation_deg)
            )
        )
    fit = fit_mounting(shifted, head_std_m=0.5)
    assert fit.outliers == ()
    assert abs(fit.mounting.azimuth_offset_deg) < 1e-3
    with pytest.raises(InputError, match="contradict"):
        fit_mounting(shifted)


@pytest.mark.parametrize("seed", range(12))
def test_odd_edges_and_maps_give_a_result_or_a_refusal_and_nothing_else(seed: int) -> None:
    """Constant, mostly missing, a spike, a step, a row or gate of its own, infinite, absurd; one ray and one gate too."""
    rng = np.random.default_rng(seed)
    for _ in range(12):
        across, up, gates = rng.choice([1, 3, 12]), rng.choice([1, 3, 12]), rng.choice([1, 6, 9, 60])
        cnr = odd(rng, int(across * up), int(gates))
        ranges = np.arange(gates) * rng.choice([0.1, 1.0, 25.0]) + rng.choice([0.0, 1000.0])
        rays = [
            each.ravel()
            for each in np.meshgrid(
                10 + np.arange(across) * 0.01, 4 + np.arange(up) * rng.choice([0.0, 0.01])
            )
        ]
        try:
            found = find_target(
                CnrMap(*rays, ranges, cnr), shape=rng.choice(["tip", "boom", "mast"]), size_m=0.5, probe=PROBE
            )
            assert np.isfinite(found.range_m)
        except InputError:
            pass
        if gates >= 6:
            edge = edge_range(ranges, cnr)
            known = np.isfinite(edge.range_m)
            assert np.all((edge.range_m[known] > ranges[0]) & (edge.range_m[known] < ranges[-1]))


def odd(rng: np.random.Generator, rays: int, gates: int):
    """(ray, gate) of noise with one thing wrong."""
    cnr = rng.normal(-25.0, rng.choice([0.0, 0.3, 100.0]), (rays, gates))
    what = rng.integers(7)
    if what == 0:
        cnr[rng.random(cnr.shape) < 0.9] = np.nan
    elif what == 1:
        cnr.flat[rng.integers(cnr.size)] = rng.choice([10.0, 1e6, np.inf, -np.inf])
    elif what == 2:
        cnr[:, gates // 2 :] -= rng.choice([1.0, 20.0, 1e5])
    elif what == 3:
        cnr[:, rng.integers(gates)] += rng.choice([10.0, 300.0, 1e6])
    elif what == 4:
        cnr[rng.integers(rays)] += rng.choice([10.0, 300.0, 1e6])
    elif what == 5:
        cnr[:, 0] += 30.0  # at the first gate, which may lie at 0 m
    return cnr
