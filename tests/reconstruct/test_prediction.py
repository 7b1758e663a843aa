"""Noise and linear tiers against published checks, closed forms and a simulation that shares no formula."""

import numpy as np
import pytest

from geometry.beams import beam_to, unit_vector
from geometry.errors import InputError
from geometry.gates import Probe
from reconstruct.lidar_map import pair_map
from reconstruct.prediction import predict_linear, predict_noise
from reconstruct.radial_speed import wind_at_mps
from reconstruct.rays import Rays
from reconstruct.retrieval import gain, rows
from reconstruct.uncertainty import (
    ErrorSources,
    budget,
    mean_errors_mps,
    ray_covariance,
    wind_covariance_by_source,
)
from reconstruct.wind import WindState

PROBE = Probe(pulse_ns=200, window_ns=256)
CHECK = ErrorSources(radial_speed_mps=0.1, azimuth_deg=0.1, elevation_deg=0.1, range_m=5.0)


def sector(azimuth_deg: np.ndarray, *, elevation_deg: float, range_m: float = 1000.0) -> Rays:
    """A sector scan whose middle azimuth points at the target."""
    n = len(azimuth_deg)
    head = -range_m * unit_vector(np.mean(azimuth_deg), elevation_deg)
    return Rays(
        azimuth_deg=np.asarray(azimuth_deg, dtype=float),
        elevation_deg=np.full(n, elevation_deg),
        range_m=np.full(n, range_m),
        head_m=np.tile(head, (n, 1)),
        lidar=np.zeros(n, dtype=int),
        time_s=np.arange(n) + 0.5,
        duration_s=np.ones(n),
        swept_azimuth_deg=np.zeros(n),
        probes=(PROBE,),
        period_s=float(n),
    )


def stares(heads_m: np.ndarray) -> Rays:
    """One ray of each lidar, all aimed at the target."""
    heads = np.asarray(heads_m, dtype=float)
    beam, n = beam_to(-heads), len(heads)
    return Rays(
        azimuth_deg=beam.azimuth_deg,
        elevation_deg=beam.elevation_deg,
        range_m=beam.range_m,
        head_m=heads,
        lidar=np.arange(n),
        time_s=np.full(n, 0.5),
        duration_s=np.ones(n),
        swept_azimuth_deg=np.zeros(n),
        probes=(PROBE,) * n,
        period_s=1.0,
    )


@pytest.mark.parametrize(
    ("first", "count", "origin", "speed_std", "direction_std"),
    [(60, 60, 0.0, 0.0451, 0.0792), (60, 60, 90.0, 0.0143, 0.2656), (75, 30, 0.0, 0.1243, 0.1082)],
)
def test_linear_tier_check_numbers(
    first: int, count: int, origin: float, speed_std: float, direction_std: float
) -> None:
    """10 m/s at 100 m, shear 0.2, half-open sectors at 1000 m: the published values within half a percent."""
    rays = sector(np.arange(first, first + count), elevation_deg=float(np.degrees(np.arcsin(0.1))))
    got = predict_linear(rays, WindState(10.0, origin, shear_exponent=0.2, height_m=100.0), CHECK)
    assert got.speed_std_mps == pytest.approx(speed_std, rel=0.005)
    assert got.direction_std_deg == pytest.approx(direction_std, rel=0.005)


PAIR = np.array([[0.0, 0.0, 0.0], [1000.0, 1000.0, 0.0]])
PAIR_ERRORS = ErrorSources(radial_speed_mps=0.1, azimuth_deg=0.1, elevation_deg=0.1, range_m=1.0)


def test_dual_doppler_check_numbers() -> None:
    """The two-lidar check: azimuths, elevations, 0.0963 m/s and 0.8076 degrees with cos φ."""
    rays = stares(PAIR - [500.0, -500.0, 100.0])
    np.testing.assert_allclose(rays.azimuth_deg, [135, 198.435], atol=5e-4)
    np.testing.assert_allclose(rays.elevation_deg, [8.049, 3.619], atol=5e-4)
    got = predict_linear(rays, WindState(10.0, 0.0, shear_exponent=0.2, height_m=100.0), PAIR_ERRORS)
    assert got.speed_std_mps == pytest.approx(0.0963, abs=5e-5)
    assert got.direction_std_deg == pytest.approx(0.8076, abs=5e-5)


def test_the_map_is_the_linear_tier_at_every_target() -> None:
    """Six targets of a map, all sources, shear, vertical wind and gradient, equal the general way; the condition is
    that of the rows by singular values.
    """
    wind = WindState(
        10.0, 30.0, shear_exponent=0.2, height_m=100.0, vertical_mps=0.2, lateral_gradient_per_s=0.001
    )
    both = (
        ErrorSources(0.1, 0.1, 0.05, 3.0, 0.01, 0.1, 0.03, 2.0),
        ErrorSources(0.2, 0.05, 0.1, 1.0, 0.005, 0.05, 0.06, 1.0),
    )
    east, north = np.array([-400.0, 150.0, 900.0])[:, None], np.array([-700.0, 450.0])
    got = pair_map(PAIR, east, north, 100.0, wind, both)
    for i, j in np.ndindex(3, 2):
        rays = stares(PAIR - [east[i, 0], north[j], 100.0])
        fit = gain(rows(rays.azimuth_deg, rays.elevation_deg))
        total = budget(wind_covariance_by_source(fit, rays, wind, both), wind)[-1]
        assert float(got.speed_std_mps[i, j]) == pytest.approx(total.speed_std_mps, rel=1e-9)
        assert float(got.direction_std_deg[i, j]) == pytest.approx(total.direction_std_deg, rel=1e-9)
        singular = np.linalg.svd(rows(rays.azimuth_deg, rays.elevation_deg), compute_uv=False)
        assert float(got.condition[i, j]) == pytest.approx(singular[0] / singular[1], rel=1e-12)


def test_the_map_says_nothing_where_nothing_can_be_known() -> None:
    """On the baseline, at a lidar and below ground the map is NaN; beside the baseline it is not."""
    wind = WindState(10.0, 0.0, shear_exponent=0.2)
    got = pair_map(
        PAIR, [500.0, 0.0, 500.0, 500.0], [500.0, 0.0, -500.0, 501.0], [0.1, 0.0, -1.0, 50.0], wind, CHECK
    )
    flat = pair_map([[0, 0, 100], [1000, 1000, 100]], 500.0, 500.0, 100.0, wind, CHECK)
    assert np.isnan(flat.speed_std_mps)
    assert np.isinf(flat.condition)
    assert list(np.isfinite(got.speed_std_mps[1:])) == [False, False, True]


@pytest.mark.parametrize("angle", [90.0, 63.0, 20.0, 150.0])
def test_ideal_dual_doppler_noise(angle: float) -> None:
    """σ_u² + σ_v² = (σ1² + σ2²)/sin²χ for level beams."""
    heads = -1000 * unit_vector(np.array([10.0, 10.0 + angle]), 0.0)
    got = predict_noise(stares(heads), WindState(10.0, 0.0), [0.1, 0.3])
    assert np.trace(got.covariance_m2s2) == pytest.approx(0.1 / np.sin(np.radians(angle)) ** 2, rel=1e-12)


def test_sector_noise_closed_form_with_elevation() -> None:
    """σ/cos φ sqrt(2/(N(1 ± S))) along and across, for a sector with its axis to the north."""
    azimuth = np.arange(61) - 30.0
    got = predict_noise(sector(azimuth, elevation_deg=8.0), WindState(10.0, 0.0), 0.2)
    total = np.sin(np.radians(61)) / (61 * np.sin(np.radians(1)))
    want = 0.2 / np.cos(np.radians(8)) * np.sqrt(2 / (61 * np.array([1 - total, 1 + total])))
    np.testing.assert_allclose(np.sqrt(np.diag(got.covariance_m2s2)), want, rtol=1e-12)


def test_what_a_tier_cannot_know_is_none_with_a_reason() -> None:
    """Ten-minute means need eddies; one azimuth gives no wind; a calm no direction: each says why."""
    rays = sector(np.arange(60, 120), elevation_deg=5.0)
    got = predict_noise(rays, WindState(10.0, 0.0), 0.1)
    assert got.mean10_speed_std_mps is None
    assert "eddies" in got.reasons["mean10_speed_std_mps"]
    lost = predict_linear(sector(np.full(5, 30.0), elevation_deg=5.0), WindState(10.0, 0.0), CHECK)
    assert lost.speed_std_mps is None
    assert "apart" in lost.reasons["speed_std_mps"]
    assert np.isinf(lost.condition)
    calm = predict_noise(rays, WindState(0.0, 0.0), 0.1)
    assert calm.speed_bias_mps is not None
    assert calm.speed_bias_mps > 0
    assert "calm" in calm.reasons["direction_std_deg"]


def simulated_covariance(rays: Rays, wind: WindState, sources: ErrorSources, draws: int) -> np.ndarray:
    """True beams drawn with their errors through rotation matrices, the wind looked up there, the nominal fit
    applied.
    """
    rng, n = np.random.default_rng(8), rays.count
    fit = gain(rows(rays.azimuth_deg, rays.elevation_deg))

    def draw(std: float, correlation: float) -> np.ndarray:
        shared = rng.standard_normal((draws, len(rays.probes)))[:, rays.lidar]
        return std * (
            np.sqrt(correlation) * shared + np.sqrt(1 - correlation) * rng.standard_normal((draws, n))
        )

    azimuth = (
        rays.azimuth_deg
        + draw(sources.azimuth_deg, sources.azimuth_correlation)
        + draw(sources.heading_deg, 1)
    )
    elevation = rays.elevation_deg + draw(sources.elevation_deg, sources.elevation_correlation)
    distance = rays.range_m + draw(sources.range_m, sources.range_correlation)
    beam = unit_vector(azimuth, elevation)
    for axis in (0, 1):  # tilt about east, then about north
        angle = np.radians(draw(sources.levelling_deg, 1.0))
        other = 1 - axis
        level, up = beam[..., other].copy(), beam[..., 2].copy()
        sign = 1 if axis == 0 else -1
        beam[..., other] = level * np.cos(angle) - sign * up * np.sin(angle)
        beam[..., 2] = up * np.cos(angle) + sign * level * np.sin(angle)
    head = rays.head_m + np.stack([draw(sources.position_m, 1.0) for _ in range(3)], -1)
    seen = np.einsum("drk,drk->dr", wind_at_mps(wind, head + distance[..., None] * beam), beam)
    seen = seen * (1 + draw(sources.radial_speed_relative, 1.0))
    seen += draw(sources.radial_speed_mps, sources.radial_speed_correlation)
    return np.cov(seen @ fit.T, rowvar=False)


EVERYTHING = ErrorSources(
    radial_speed_mps=0.1,
    azimuth_deg=0.3,
    elevation_deg=0.3,
    range_m=15.0,
    radial_speed_relative=0.005,
    heading_deg=0.4,
    levelling_deg=0.3,
    position_m=8.0,
    radial_speed_correlation=0.3,
    azimuth_correlation=0.5,
    elevation_correlation=0.2,
    range_correlation=0.7,
)
FULL_WIND = WindState(
    10.0, 65.0, shear_exponent=0.25, height_m=100.0, vertical_mps=0.3, lateral_gradient_per_s=0.002
)


@pytest.mark.parametrize(
    "name", ["all", "levelling_deg", "heading_deg", "position_m", "radial_speed_relative", "range_m"]
)
@pytest.mark.parametrize("technique", ["sector", "dual"])
def test_linear_tier_is_what_a_simulation_finds(name: str, technique: str) -> None:
    """Sources one by one and all together: covariance of the fitted wind within sampling error of 20,000
    draws.
    """
    rays = sector(np.arange(60.0, 120.0, 4.0), elevation_deg=6.0)
    if technique == "dual":
        rays = stares(np.array([[-600.0, -700.0, -95.0], [900.0, -500.0, -90.0]]))
    sources = EVERYTHING if name == "all" else ErrorSources(**{name: getattr(EVERYTHING, name)})
    want = simulated_covariance(rays, FULL_WIND, sources, 20_000)
    fit = gain(rows(rays.azimuth_deg, rays.elevation_deg))
    got = sum(wind_covariance_by_source(fit, rays, FULL_WIND, sources).values())
    scale = np.sqrt(np.outer(np.diag(want), np.diag(want)))
    np.testing.assert_allclose((got - want) / scale, 0, atol=0.05)
    np.testing.assert_allclose(
        fit @ ray_covariance(rays, FULL_WIND, sources) @ fit.T, got, rtol=1e-9, atol=1e-15
    )


def test_mean_errors_are_what_the_fit_makes_of_the_wind() -> None:
    """Vertical wind, gradient and shear together: G times the true radial speeds, less the wind at the
    target.
    """
    azimuth = np.arange(-20.0, 21.0)
    rays = sector(azimuth, elevation_deg=5.0)
    lifted = Rays(
        **{**vars(rays), "head_m": np.add(rays.head_m, [0.0, 0.0, 12.0])}
    )  # aimed 12 m over the target
    fit = gain(rows(azimuth, 5.0))
    seen = np.einsum("rk,rk->r", wind_at_mps(FULL_WIND, lifted.centre_m), unit_vector(azimuth, 5.0))
    parts = mean_errors_mps(fit, lifted, FULL_WIND)
    np.testing.assert_allclose(sum(parts.values()), fit @ seen - FULL_WIND.uv_mps, atol=1e-12)
    higher = 10 * (1.12**0.25 - 1)
    assert np.hypot(*parts["shear"]) == pytest.approx(higher, rel=1e-3)


def test_budget_adds_up() -> None:
    """Shares add to one, k = 2 is twice k = 1, the reference stands in it, a clock has its reason."""
    rays = sector(np.arange(60, 120), elevation_deg=5.0)
    fit = gain(rows(rays.azimuth_deg, rays.elevation_deg))
    parts = wind_covariance_by_source(fit, rays, FULL_WIND, EVERYTHING)
    table = budget(
        parts,
        FULL_WIND,
        reference_speed_mps=0.05,
        reference_direction_deg=1.0,
        unknown={"clock": "needs turbulence"},
    )
    by_name = {entry.source: entry for entry in table}
    known = [e for e in table[:-1] if e.speed_share is not None]
    assert sum(e.speed_share for e in known) == pytest.approx(1)  # type: ignore[misc]
    assert sum(e.direction_share for e in known) == pytest.approx(1)  # type: ignore[misc]
    assert by_name["reference instrument"].direction_std_deg == pytest.approx(1.0)
    assert by_name["clock"].speed_std_mps is None
    assert by_name["total"].expanded()[0] == pytest.approx(2 * by_name["total"].speed_std_mps)  # type: ignore[operator]


def test_a_hundred_thousand_rays_need_no_square_matrix() -> None:
    """100,000 rays in the linear tier: noise falls with the root of their number."""
    got = predict_linear(
        sector(np.linspace(-30, 30, 100_000), elevation_deg=0.0),
        WindState(10.0, 0.0),
        ErrorSources(radial_speed_mps=1.0),
    )
    angle = np.radians(60)
    want = np.sqrt(2 / (100_000 * (1 + np.sin(angle) / angle)))
    assert got.speed_std_mps == pytest.approx(want, rel=1e-4)


def test_wrong_sources_are_refused() -> None:
    """Negative errors, correlations above one and a wrong number of lidars are input errors."""
    with pytest.raises(InputError):
        ErrorSources(azimuth_deg=-0.1)
    with pytest.raises(InputError):
        ErrorSources(range_correlation=1.5)
    with pytest.raises(InputError):
        predict_linear(sector(np.arange(5), elevation_deg=0.0), WindState(10.0, 0.0), [CHECK, CHECK])
    with pytest.raises(InputError):
        predict_noise(sector(np.arange(5), elevation_deg=0.0), WindState(10.0, 0.0), -1.0)
