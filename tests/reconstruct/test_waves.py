"""Single waves beside the box: their covariance against integrals made here, and what a scan makes of them."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.special import betainc, gamma

from geometry.beams import unit_vector
from geometry.errors import InputError
from geometry.gates import Probe
from reconstruct.error_draws import Draws
from reconstruct.flight import WaveSight, carried_mps, met_waves, passing, to_wind_frame
from reconstruct.rays import Rays
from reconstruct.spectra import Turbulence, spectral_tensor, sphere
from reconstruct.waves import LONG_COUNT, SHORT_COUNT, Waves, draw_waves, long_share
from reconstruct.wind import WindState

LENGTH_M = 60.0
EDDY_M = LENGTH_M * gamma(1 / 3) / (np.sqrt(np.pi) * gamma(5 / 6))
AIR = Turbulence(intensity=0.1, length_m=LENGTH_M)
CUT = np.pi / 6.0
MANY = 200_000


def energy(k):
    """Von Kármán energy spectrum for unit variance of one component [m]."""
    constant = 55 / 9 * gamma(5 / 6) / (np.sqrt(np.pi) * gamma(1 / 3))
    return constant * EDDY_M * (k * EDDY_M) ** 4 / (1 + (k * EDDY_M) ** 2) ** (17 / 6)


def drawn(air=AIR, *, long_count=1, short_count=1, seed=1, cut=CUT):
    return draw_waves(
        air, cut, rng=np.random.default_rng(seed), long_count=long_count, short_count=short_count
    )


def part_of(waves, chosen):
    return Waves(*(each[:, chosen] for each in waves))


def covariance(waves, separation_m):
    """(3, 3) covariance of the sum of waves at two places, amplitudes averaged over."""
    turned = np.cos(np.asarray(separation_m) @ waves.vector)
    return (waves.first * turned) @ waves.first.T + (waves.second * turned) @ waves.second.T


@pytest.mark.parametrize("cut", [0.26, np.pi / 12, 5.0])
def test_short_waves_have_the_tail_of_the_energy(cut):
    """With s = 1/(1 + k²l²) the tail of E is a regularised incomplete beta function."""
    short = part_of(drawn(short_count=MANY, cut=cut), slice(1, None))
    expected = betainc(1 / 3, 5 / 2, 1 / (1 + (cut * EDDY_M) ** 2))
    assert np.allclose(covariance(short, np.zeros(3)), expected * np.eye(3), atol=0.01 * expected)


@pytest.mark.parametrize("lengths", [0.0, 0.5, 2.0, 20.0])
@pytest.mark.parametrize("axis", [0, 1, 2])
def test_long_waves_have_the_correlation_of_the_bell_of_the_spectrum_at_any_distance(lengths, axis):
    """Isotropic turbulence (Batchelor 1953) of E(k) times exp(-(k L / 6)²); a box of 10 lengths would repeat itself."""
    long = part_of(drawn(long_count=MANY), slice(0, MANY))
    distance = max(lengths * LENGTH_M, 1.0)

    def band(kernel):
        bell = lambda k: np.exp(-((k * LENGTH_M / 6) ** 2))  # noqa: E731
        return quad(lambda k: energy(k) * bell(k) * kernel(k * distance), 1e-9, 15.0 / LENGTH_M, limit=400)[0]

    along = band(lambda x: 2 * (np.sin(x) - x * np.cos(x)) / x**3)
    aside = band(lambda x: np.sin(x) / x - (np.sin(x) - x * np.cos(x)) / x**3)
    expected = aside * np.eye(3)
    expected[axis, axis] = along
    found = covariance(long, distance * np.eye(3)[axis])
    assert np.allclose(found, expected, atol=0.006)


def test_long_waves_of_a_sheared_tensor_have_its_variance_down_to_wavenumber_0():
    """Gauss and equal steps over the sphere, a fine logarithmic rule over the wavenumber."""
    air = Turbulence(0.1, LENGTH_M, "mann")
    long = part_of(drawn(air, long_count=MANY), slice(0, MANY))
    direction, weight = sphere(64, 128)
    k = np.geomspace(1e-6, 15.0 / LENGTH_M, 400)
    each = [
        [np.sum(weight * part) for part in spectral_tensor(air, direction * wavenumber)] for wavenumber in k
    ]
    c11, c22, c33, _, c13, _ = np.trapezoid(np.transpose(each) * k**3 * long_share(air, k), np.log(k))
    found = covariance(long, np.zeros(3))
    assert np.diag(found) == pytest.approx([c11, c22, c33], rel=0.03)
    assert found[0, 2] == pytest.approx(c13, rel=0.05)
    assert c11 > 0.25  # a good part of the variance is in waves that a box holds badly


def test_waves_are_free_of_divergence():
    waves = drawn(Turbulence(0.1, LENGTH_M, "mann"), long_count=200, short_count=200)
    for root in (waves.first, waves.second):
        along = np.abs(np.sum(waves.vector * root, axis=0))
        assert np.all(along <= 1e-9 * np.linalg.norm(waves.vector, axis=0) * np.linalg.norm(root, axis=0))


def test_a_single_draw_of_the_usual_size_is_near_the_right_variance():
    """Within 2 %, and more than 200 waves share it: their sum is nearly Gaussian."""
    usual = [drawn(long_count=LONG_COUNT, short_count=SHORT_COUNT, seed=seed) for seed in range(20)]
    variance = np.array([np.diag(covariance(waves, np.zeros(3))) for waves in usual])
    assert np.max(np.std(variance, axis=0) / np.mean(variance, axis=0)) < 0.02
    each = np.square(usual[0].first) + np.square(usual[0].second)
    assert np.all(np.sum(each, axis=1) ** 2 / np.sum(each**2, axis=1) > 200)


def test_kaimal_is_refused():
    with pytest.raises(InputError, match="no spectral tensor"):
        drawn(Turbulence(0.1, LENGTH_M, "kaimal"))


def scan():
    """Four rays of two lidars, back and forth, each with a sweep, a probe and a duration."""
    azimuth = np.array([20.0, 30.0, 40.0, 130.0])
    return Rays(
        azimuth_deg=azimuth,
        elevation_deg=np.full(4, 5.0),
        range_m=np.full(4, 400.0),
        head_m=-400.0 * unit_vector(np.array([30.0, 30.0, 30.0, 130.0]), 5.0),
        lidar=np.array([0, 0, 0, 1]),
        time_s=np.array([0.5, 1.5, 2.5, 3.5]),
        duration_s=np.full(4, 1.0),
        swept_azimuth_deg=np.array([2.0, 2.0, 2.0, 0.0]),
        probes=(Probe(200, 256), Probe(400, 512)),
        period_s=5.0,
        back_and_forth=True,
    )


def sums_by_hand(rays, wind, waves, amplitudes, scans):
    """Each ray of each scan averaged over 200 moments and 64 places of its probe, wave by wave."""
    a, b = amplitudes
    strength = waves.first * a + waves.second * b
    share = (np.arange(200) + 0.5) / 200 - 0.5
    out = np.empty((scans, rays.count))
    for number in range(scans):
        for ray in range(rays.count):
            sense = -1 if number % 2 else 1
            time = rays.times_s(scans)[number, ray] + share * rays.duration_s[ray]
            azimuth = rays.azimuth_deg[ray] + sense * share * rays.swept_azimuth_deg[ray]
            offset, weight = rays.probes[rays.lidar[ray]].nodes(64)
            beam = to_wind_frame(unit_vector(azimuth, rays.elevation_deg[ray]), wind.from_deg)
            head = to_wind_frame(rays.head_m[ray], wind.from_deg)
            place = head + beam[:, None] * (rays.range_m[ray] + offset)[:, None]
            place = place - time[:, None, None] * carried_mps(wind)
            wave = np.exp(1j * place @ waves.vector) * (beam @ strength)[:, None]
            out[number, ray] = np.mean(np.einsum("tpw,p->t", wave, weight).real)
    return out


def test_a_scan_makes_of_waves_what_averages_by_hand_make():
    """But for the 2° by which a beam turns in its ray while the wave does; waves that 64 places in 170 m resolve."""
    rays, wind = scan(), WindState(speed_mps=8.0, from_deg=250.0)
    waves = drawn(long_count=30, short_count=30, cut=0.3)
    waves = part_of(waves, np.linalg.norm(waves.vector, axis=0) < 0.5)
    assert waves.vector.shape[1] > 30
    amplitudes = waves.amplitudes(np.random.default_rng(2))
    found = WaveSight.of(rays, wind, waves, Draws.none(rays), scans=5).radial_speed(amplitudes)
    wanted = sums_by_hand(rays, wind, waves, amplitudes, 5)
    assert np.max(np.abs(found - wanted)) < 0.02 * np.std(wanted)
    assert np.std(found - wanted) < 0.008 * np.std(wanted)


def test_lasting_errors_and_the_place_of_the_target_move_the_waves_as_they_move_the_scan():
    rays, wind = scan(), WindState(speed_mps=8.0, from_deg=250.0)
    waves = drawn(long_count=30, short_count=10)
    amplitudes = waves.amplitudes(np.random.default_rng(2))
    none = Draws.none(rays)
    moved = replace(
        rays,
        azimuth_deg=rays.azimuth_deg + 1.5,
        time_s=rays.time_s + 2.0,
        head_m=rays.head_m + np.array([30.0, 0.0, 0.0]),
        sweep_s=8.0,
    )
    errors = none._replace(
        azimuth_deg=none.azimuth_deg + 1.5,
        delay_s=none.delay_s + 2.0,
        head_m=none.head_m + np.array([10.0, 0.0, 0.0]),
    )
    offset = to_wind_frame(np.array([20.0, 0.0, 0.0]), wind.from_deg)
    found = WaveSight.of(rays, wind, waves, errors, scans=4, offset_m=offset).radial_speed(amplitudes)
    wanted = WaveSight.of(moved, wind, waves, none, scans=4).radial_speed(amplitudes)
    assert np.allclose(found, wanted, atol=1e-4)


def test_the_target_meets_the_waves_as_time_passes():
    wind, waves = (
        WindState(speed_mps=7.0, from_deg=10.0, vertical_mps=0.5),
        drawn(long_count=20, short_count=5),
    )
    amplitudes = waves.amplitudes(np.random.default_rng(2))
    found = met_waves(waves, amplitudes, passing(wind, waves, 0.5, 1.0, 150))
    place = -(np.arange(150) + 0.5)[:, None] * carried_mps(wind)
    a, b = amplitudes
    wanted = (np.exp(1j * place @ waves.vector) @ (waves.first * a + waves.second * b).T).real
    assert np.allclose(found, wanted, atol=1e-4)
