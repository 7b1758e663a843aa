"""Covariances of rays against one-dimensional spectra, brute-force averages over patches, and limits."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.special import gamma, kv
from scipy.stats import norm, qmc

from geometry.beams import unit_vector
from geometry.gates import Probe
from reconstruct.covariance import lag_covariance, patches_of, point_covariance, target_covariance
from reconstruct.rays import Rays
from reconstruct.spectra import Turbulence, longitudinal_spectrum
from reconstruct.wind import WindState

PROBE = Probe(pulse_ns=200, window_ns=256)
AIR = Turbulence(0.09, 170.0)


def sector(
    count=30,
    step_deg=2.0,
    axis_deg=192.0,
    elevation_deg=6.0,
    range_m=1160.0,
    back_and_forth=True,
    probe=PROBE,
):
    """A sector scan whose middle passes through the target."""
    azimuth = axis_deg + step_deg * (np.arange(count) - 0.5 * (count - 1))
    return Rays(
        azimuth_deg=azimuth,
        elevation_deg=np.full(count, elevation_deg),
        range_m=np.full(count, range_m),
        head_m=np.tile(-range_m * unit_vector(axis_deg, elevation_deg), (count, 1)),
        lidar=np.zeros(count, dtype=np.intp),
        time_s=0.4 * (np.arange(count) + 0.5),
        duration_s=np.full(count, 0.4),
        swept_azimuth_deg=np.full(count, step_deg),
        probes=(probe,),
        period_s=0.4 * count,
        back_and_forth=back_and_forth,
    )


def stare(duration_s=0.5, period_s=10.0, range_m=1000.0):
    """One beam to the north, at rest."""
    return Rays(
        azimuth_deg=np.zeros(1),
        elevation_deg=np.zeros(1),
        range_m=np.array([range_m]),
        head_m=np.array([[0.0, -range_m, 0.0]]),
        lidar=np.zeros(1, dtype=np.intp),
        time_s=np.zeros(1),
        duration_s=np.array([duration_s]),
        swept_azimuth_deg=np.zeros(1),
        probes=(PROBE,),
        period_s=period_s,
    )


def tensor(apart, l):
    """R_ij of von Kármán turbulence of variance 1, written out anew: separations (..., 3) to (..., 3, 3)."""
    r = np.linalg.norm(apart, axis=-1) + 1e-9
    x = r / l
    c = 2 ** (2 / 3) / gamma(1 / 3)
    f, excess = c * x ** (1 / 3) * kv(1 / 3, x), c / 2 * x ** (4 / 3) * kv(2 / 3, x)
    outer = apart[..., :, None] * apart[..., None, :] / (r * r)[..., None, None]
    return excess[..., None, None] * outer + (f - excess)[..., None, None] * np.eye(3)


@pytest.mark.parametrize("length_m", [10.0, 170.0, 10_000.0])
@pytest.mark.parametrize("lag", [0, 1, 3])
def test_beam_along_the_wind_agrees_with_the_one_dimensional_spectrum(length_m, lag):
    """Probe and accumulation are filters of the longitudinal spectrum there: T(k)² sinc²(n t)."""
    air, wind = Turbulence(0.1, length_m), WindState(10.0, 0.0)
    n = np.concatenate([[0.0], np.geomspace(1e-8, 3.0, 60_000)])
    kept = PROBE.transfer(2 * np.pi * n / 10.0) ** 2 * np.sinc(n * 0.5) ** 2
    spectrum = longitudinal_spectrum(air, n, speed_mps=10.0)
    theirs = np.trapezoid(spectrum * kept * np.cos(2 * np.pi * n * 10.0 * lag), n)
    ours = lag_covariance(stare(), wind, air, [lag])[0, 0, 0, 0]
    assert ours == pytest.approx(theirs, abs=2e-3)


def test_covariance_of_neighbours_agrees_with_brute_force_over_both_patches():
    rays, wind = sector(), WindState(8.0, 190.0)
    ours = lag_covariance(rays, wind, AIR, [0, 1])[0]
    first, second = patches_of(rays, wind), patches_of(rays, wind, reverse=True)
    for lag, m, n in ((0, 5, 6), (0, 5, 8), (0, 0, 29), (1, 29, 28), (1, 20, 22)):
        later = second if lag else first
        apart = first.centre_m[:, m] - later.centre_m[:, n] + np.array([8.0 * 12.0 * lag, 0, 0])
        parts = []
        for patches, ray, counts in ((first, m, (9, 6)), (later, n, (10, 7))):
            offset, weight = PROBE.nodes(counts[0])
            turn, share = np.polynomial.legendre.leggauss(counts[1])
            places = np.multiply.outer(offset, patches.beam[:, ray])[:, None]
            places = places + np.multiply.outer(0.5 * turn, patches.sweep_m[:, ray])[None]
            parts.append((places.reshape(-1, 3), np.outer(weight, share / 2).ravel()))
        separation = apart + parts[0][0][:, None] - parts[1][0][None]
        values = np.einsum(
            "i,abij,j->ab", first.beam[:, m], tensor(separation, 1.339 * 170), later.beam[:, n]
        )
        theirs = (0.09 * 8.0) ** 2 * parts[0][1] @ values @ parts[1][1]
        assert ours[lag, m, n] == pytest.approx(theirs, abs=5e-4 * 0.72**2)


def crossing(angle_deg, probes, aside_m=(0.0, 0.0, 0.0)):
    """Two lidars at 1500 m that stare at the target, or the second one past it."""
    azimuth, elevation = np.array([180.0, 180.0 + angle_deg]), np.full(2, 4.0)
    head = -1500.0 * unit_vector(azimuth, elevation)
    head[1] += aside_m
    return Rays(
        azimuth_deg=azimuth,
        elevation_deg=elevation,
        range_m=np.full(2, 1500.0),
        head_m=head,
        lidar=np.arange(2),
        time_s=np.full(2, 0.25),
        duration_s=np.full(2, 0.5),
        swept_azimuth_deg=np.zeros(2),
        probes=probes,
        period_s=1.0,
    )


def brute_force(first, second, ray, other, probes, length_m, moved_m=(0.0, 0.0, 0.0), point=False):
    """Average of b R b over 2^17 low-discrepancy places in both probes and both sweeps."""
    x = np.linspace(0.0, 6.0, 60_001)[1:] ** 2  # of distance over l, equal steps of the root
    c = 2 ** (2 / 3) / gamma(1 / 3)
    f, excess = c * x ** (1 / 3) * kv(1 / 3, x), c / 2 * x ** (4 / 3) * kv(2 / 3, x)
    draws = qmc.Sobol(6, seed=1).random(2**17).T

    def places(patches, index, part):
        probe = probes[patches.lidar[index]]
        along = probe.pulse_std_m * norm.ppf(part[0] + 1e-9) + probe.window_m * (part[1] - 0.5)
        return np.outer(patches.beam[:, index], along) + np.outer(patches.sweep_m[:, index], part[2] - 0.5)

    apart = (first.centre_m[:, ray] - second.centre_m[:, other] + moved_m)[:, None]
    apart = apart + places(first, ray, draws[:3]) - (0 if point else places(second, other, draws[3:]))
    distance = np.linalg.norm(apart, axis=0)
    root = np.sqrt(distance / (1.339 * length_m))
    b, d = first.beam[:, ray], second.beam[:, other]
    same = np.interp(root, np.sqrt(x), f - excess)
    stretch = np.interp(root, np.sqrt(x), excess)
    return np.mean((b @ apart) * (d @ apart) / distance**2 * stretch + (b @ d) * same)


SHORT, LONG = PROBE, Probe(pulse_ns=400, window_ns=512)


@pytest.mark.parametrize("angle_deg", [3.0, 20.0, 63.0, 90.0, 170.0])
@pytest.mark.parametrize(
    ("probes", "aside_m"),
    [((SHORT, LONG), (0, 0, 0)), ((LONG, LONG), (0, 30, 0)), ((LONG, SHORT), (30, 30, 10))],
    ids=["meeting", "one behind the other", "missing each other"],
)
def test_two_crossing_stares_agree_with_brute_force_over_both_probes(angle_deg, probes, aside_m):
    """The wind that they retrieve is a difference of their covariances over sin² of the angle: all three
    to 1e-4, and both variances of the retrieved wind to half a per cent, a whole one at 3 degrees."""
    air, wind = Turbulence(0.15, 120.0), WindState(8.0, 120.0)
    rays = crossing(angle_deg, probes, aside_m)
    patches = patches_of(rays, wind)
    theirs = np.empty((2, 2))
    for m, n in ((0, 0), (0, 1), (1, 1)):
        theirs[m, n] = theirs[n, m] = brute_force(patches, patches, m, n, probes, 120.0)
    ours = lag_covariance(rays, wind, air)[0, 0] / 1.2**2
    np.testing.assert_allclose(ours, theirs, atol=1.2e-4)
    matrix = np.linalg.inv(unit_vector(rays.azimuth_deg, rays.elevation_deg)[:, :2])
    retrieved, expected = (np.diag(matrix @ each @ matrix.T) for each in (ours, theirs))
    np.testing.assert_allclose(retrieved, expected, rtol=0.01 if angle_deg < 10 else 0.005)


@pytest.mark.parametrize("from_deg", [192.0, 240.0, 282.0])
def test_rays_closer_than_a_probe_agree_with_brute_force(from_deg):
    """Steps of 0.05 degrees: neighbours 1 m and some wind apart, whose small differences a fit enlarges."""
    rays, wind = sector(count=8, step_deg=0.05), WindState(8.0, from_deg)
    patches = patches_of(rays, wind)
    ours = lag_covariance(rays, wind, AIR)[0, 0] / 0.72**2
    for m, n in ((0, 0), (0, 1), (0, 3), (2, 7)):
        assert ours[m, n] == pytest.approx(brute_force(patches, patches, m, n, (PROBE,), 170.0), abs=1.5e-3)


@pytest.mark.parametrize("time_s", [0.25, 1.0, 4.0])
def test_ray_through_the_target_agrees_with_brute_force_there(time_s):
    rays, wind = crossing(63.0, (SHORT, LONG)), WindState(8.0, 170.0)
    ours = target_covariance(rays, wind, AIR, [time_s])[0, 0] / 0.72**2
    patches = patches_of(rays, wind)
    moved = np.array([8.0 * time_s, 0.0, 0.0])
    for component in range(2):
        axis = np.zeros((3, 2))
        axis[component] = 1.0
        point = patches._replace(centre_m=np.zeros((3, 2)), beam=axis)
        for ray in range(2):
            theirs = brute_force(patches, point, ray, ray, (SHORT, LONG), 170.0, moved, point=True)
            assert ours[ray, component] == pytest.approx(theirs, abs=3e-4)


def test_variance_of_a_ray_agrees_with_drawing_places_in_its_patch():
    rays, wind = sector(count=3), WindState(8.0, 190.0)
    patch = patches_of(rays, wind)
    rng = np.random.default_rng(7)
    draws = 200_000
    # pulse and window are independent Gaussian and uniform shifts
    along = PROBE.pulse_std_m * rng.normal(size=(2, draws)) + PROBE.window_m * (rng.random((2, draws)) - 0.5)
    turn = rng.random((2, draws))
    apart = (along[0] - along[1])[:, None] * patch.beam[:, 1] + (turn[0] - turn[1])[:, None] * patch.sweep_m[
        :, 1
    ]
    values = np.einsum("i,aij,j->a", patch.beam[:, 1], tensor(apart, 1.339 * 170), patch.beam[:, 1])
    theirs, error = values.mean(), values.std() / np.sqrt(draws)
    ours = lag_covariance(rays, wind, AIR)[0, 0, 1, 1] / 0.72**2
    assert abs(ours - theirs) < 4 * error


def test_covariance_of_one_scan_is_symmetric_and_positive():
    within = lag_covariance(sector(), WindState(9.0, 250.0), AIR)[:, 0]
    for one in within:
        np.testing.assert_array_equal(one, one.T)
        assert np.min(np.linalg.eigvalsh(one)) > 0


def test_reverse_pass_is_the_scan_with_its_times_mirrored():
    rays, wind = sector(), WindState(8.0, 240.0)
    mirrored = dataclasses.replace(
        rays, time_s=12.0 - rays.time_s, swept_azimuth_deg=-rays.swept_azimuth_deg, back_and_forth=False
    )
    np.testing.assert_allclose(lag_covariance(rays, wind, AIR)[1], lag_covariance(mirrored, wind, AIR)[0])


def test_lag_in_scans_is_a_shift_of_time():
    """Two scans of a forward sweep are one long scan of twice the rays."""
    rays, wind = sector(count=6, back_and_forth=False), WindState(8.0, 240.0)
    fields = ("azimuth_deg", "elevation_deg", "range_m", "head_m", "lidar", "duration_s", "swept_azimuth_deg")
    twice = dataclasses.replace(
        rays,
        **{name: np.concatenate([getattr(rays, name)] * 2) for name in fields},
        time_s=np.concatenate([rays.time_s, rays.time_s + rays.period_s]),
    )
    ours = lag_covariance(rays, wind, AIR, [1])[0, 0]
    np.testing.assert_allclose(ours, lag_covariance(twice, wind, AIR)[0, 0, :6, 6:], rtol=1e-6)


@settings(max_examples=15, deadline=None, derandomize=True)
@given(turn_deg=st.floats(-180, 180), from_deg=st.floats(0, 360))
def test_turning_scan_and_wind_together_changes_nothing(turn_deg, from_deg):
    rays, turned = sector(count=5), sector(count=5, axis_deg=192.0 + turn_deg)
    one = lag_covariance(rays, WindState(8.0, from_deg), AIR, [0, 2])
    two = lag_covariance(turned, WindState(8.0, from_deg + turn_deg), AIR, [0, 2])
    np.testing.assert_allclose(one, two, atol=2e-6)


@pytest.mark.parametrize("model", ["von-karman", "kaimal", "mann"])
def test_very_large_eddies_are_a_uniform_wind(model):
    """With eddies much larger than the scan every ray sees the same wind: covariance b_mᵀ R(0) b_n."""
    air = Turbulence(0.1, 1e9, model=model)
    rays, wind = sector(count=4), WindState(10.0, 0.0)
    beams = unit_vector(rays.azimuth_deg, rays.elevation_deg)
    # downwind is south and left of it is east
    frame = np.stack([-beams[:, 1], beams[:, 0], beams[:, 2]], axis=1)
    std = {"von-karman": (1, 1, 1, 0), "kaimal": (1, 0.8, 0.5, 0)}.get(model)
    if std is None:
        from reconstruct.correlation import correlation

        at = correlation(air)
        axes = np.eye(3)
        matrix = np.array([[float(at(np.zeros(3), a, b)) for b in axes] for a in axes])
    else:
        matrix = np.diag(np.square(std[:3]))
    ours = lag_covariance(rays, wind, air, [0, 1])
    for one in ours.reshape(-1, 4, 4):
        np.testing.assert_allclose(one, frame @ matrix @ frame.T, atol=0.02)


def test_still_rays_without_length_correlate_with_the_target_as_points_do():
    tiny = Probe(pulse_ns=0.1, window_ns=0.1)
    rays = sector(count=3, back_and_forth=False, probe=tiny)
    wind = WindState(8.0, 250.0)
    ours = target_covariance(rays, wind, AIR, [0.6, 5.0], sweep=False)[0]
    turn = np.radians(250.0)
    downwind = np.array([-np.sin(turn), -np.cos(turn), 0.0])
    left = np.array([np.cos(turn), -np.sin(turn), 0.0])
    beams = unit_vector(rays.azimuth_deg, rays.elevation_deg)
    for index, time_s in enumerate((0.6, 5.0)):
        apart = rays.centre_m - np.multiply.outer(rays.time_s - time_s, 8.0 * downwind)
        matrix = 0.72**2 * tensor(apart, 1.339 * 170)
        for component, axis in enumerate((downwind, left)):
            theirs = np.einsum("mi,mij,j->m", beams, matrix, axis)
            np.testing.assert_allclose(ours[index, :, component], theirs, atol=0.003)


def test_point_covariance_is_f_along_and_g_across_the_wind():
    ours = point_covariance(WindState(8.0, 33.0), AIR, [0.0, 10.0])
    expected = np.diag(tensor(np.array([80.0, 0.0, 0.0]), 1.339 * 170))[:2]
    np.testing.assert_allclose(ours, 0.72**2 * np.array([[1.0, 1.0], expected]), atol=1e-4)


def test_no_intensity_no_covariance():
    rays, wind = sector(count=4), WindState(8.0, 190.0)
    assert np.all(lag_covariance(rays, wind, Turbulence(0.0, 170.0), [0, 5]) == 0)


def test_calm_air_gives_no_covariance_and_no_warning():
    assert np.all(lag_covariance(sector(count=4), WindState(0.0, 190.0), AIR, [0, 5]) == 0)
