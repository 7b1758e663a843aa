"""The synthesised field against published spectra and against integrals that are made here."""

import itertools

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.special import gamma

from geometry.errors import InputError
from reconstruct.field import MARGIN_LENGTHS, MAX_CELLS, synthesise
from reconstruct.spectra import Turbulence

LENGTH_M = 60.0
EDDY_M = LENGTH_M * gamma(1 / 3) / (np.sqrt(np.pi) * gamma(5 / 6))  # l = 1.339 L
SPACING_M = 6.0
FIELDS = 6
AIR = Turbulence(intensity=0.1, length_m=LENGTH_M)


def energy(k):
    """Von Kármán (1948) energy spectrum for unit variance of one component [m]."""
    constant = 55 / 9 * gamma(5 / 6) / (np.sqrt(np.pi) * gamma(1 / 3))
    return constant * EDDY_M * (k * EDDY_M) ** 4 / (1 + (k * EDDY_M) ** 2) ** (17 / 6)


def bell(k):
    """Share of the power that is too long for the box."""
    return np.where(k < 15.0 / LENGTH_M, np.exp(-((k * LENGTH_M / 6) ** 2)), 0.0)


def band(kernel, high):
    """Integral of E(k) times a kernel over what the box has, up to a wavenumber."""
    return quad(lambda k: energy(k) * (1 - bell(k)) * kernel(k), 1e-9, high, limit=400, epsabs=1e-8)[0]


@pytest.fixture(scope="module")
def fields():
    rng = np.random.default_rng(20240229)
    extent = np.array([1200.0, 420.0, 420.0]) - MARGIN_LENGTHS * LENGTH_M
    return [synthesise(AIR, extent, rng=rng, spacing_m=SPACING_M) for _ in range(FIELDS)]


@pytest.fixture(scope="module")
def lines(fields):
    """(field, line, x, component): samples one cell apart along the wind, on lines at random places."""
    rng = np.random.default_rng(7)
    found = []
    for field in fields:
        start = rng.uniform(size=(1500, 1, 3)) * field.size_m
        step = np.arange(field.cells.shape[0])[:, None] * [field.spacing_m, 0, 0]
        found.append(field.at(start + step))
    return np.stack(found).astype(float)


def assert_within(values_by_field, expected, allowed=0.0, power=0.05):
    """Mean over independent fields within 3.5 standard errors (Student: 98 %) and a fixed allowance."""
    mean, error = np.mean(values_by_field), np.std(values_by_field, ddof=1) / np.sqrt(len(values_by_field))
    assert abs(mean - expected) < 3.5 * error + allowed, (mean, error, expected)
    assert error < power  # or the comparison would say nothing


def test_variance_at_random_places_is_that_of_the_energy_in_the_box(lines):
    """A third of 2 E(k) a component: energy() counts the variance of one as 1, so E is 3/2 of it."""
    for component in range(3):
        expected = 2 / 3 * band(lambda _: 1.0, np.pi / SPACING_M)
        assert 0.3 < expected < 0.5
        assert_within(np.mean(lines[..., component] ** 2, axis=(1, 2)), expected)


def test_components_are_uncorrelated_as_isotropy_demands(lines):
    for i, j in ((0, 1), (0, 2), (1, 2)):
        assert_within(np.mean(lines[..., i] * lines[..., j], axis=(1, 2)), 0.0)


def test_interpolation_loses_no_variance(fields):
    """Cell corners carry more than samples at random places: the repair is there and has the right size."""
    for field in fields[:2]:
        rng = np.random.default_rng(3)
        anywhere = field.at(rng.uniform(size=(400_000, 3)) * field.size_m)
        without_repair = np.mean(np.square(field.cells[..., :3])) / np.mean(np.square(anywhere))
        assert without_repair == pytest.approx(corner_over_anywhere(), abs=0.01)


def corner_over_anywhere():
    """Variance that one over (2 + cos k dx)/3 along each axis adds, over the spectrum and the sphere."""
    height = np.linspace(-1, 1, 2001)[1:-1:2]
    turn = np.pi * (1 + 5**0.5) * np.arange(height.size)
    level = np.sqrt(1 - height**2)
    direction = np.stack([level * np.cos(turn), level * np.sin(turn), height])
    raised = band(
        lambda k: np.mean(np.prod(3 / (2 + np.cos(k * SPACING_M * direction)), axis=0)), np.pi / SPACING_M
    )
    return raised / band(lambda _: 1.0, np.pi / SPACING_M)


@pytest.mark.parametrize(
    ("component", "published", "tail"),
    [
        (
            0,
            lambda k: LENGTH_M / np.pi / (1 + (k * EDDY_M) ** 2) ** (5 / 6),
            lambda k, q: (1 - k**2 / q**2) / (2 * q),
        ),
        (
            1,
            lambda k: (
                (LENGTH_M / (2 * np.pi))
                * (1 + 8 / 3 * (k * EDDY_M) ** 2)
                / (1 + (k * EDDY_M) ** 2) ** (11 / 6)
            ),
            lambda k, q: (1 + k**2 / q**2) / (4 * q),
        ),
    ],
    ids=["longitudinal", "lateral"],
)
def test_spectrum_along_the_wind_is_the_published_one(lines, component, published, tail):
    """ESDU 74031: S_u and S_v of von Kármán, less what a grid of this fineness lacks."""
    count = lines.shape[2]
    power = np.mean(np.abs(np.fft.rfft(lines[..., component], axis=-1)) ** 2, axis=1)
    density = power * SPACING_M / count / (2 * np.pi)
    wavenumber = 2 * np.pi * np.fft.rfftfreq(count, SPACING_M)
    cut = np.pi / SPACING_M
    edges = np.geomspace(1.5 / LENGTH_M, 0.9 * cut, 6)
    for low, high in itertools.pairwise(edges):
        chosen = (wavenumber >= low) & (wavenumber < high)
        missing = [
            quad(lambda q, k=k: energy(q) * tail(k, q), cut, np.inf)[0]
            + quad(lambda q, k=k: energy(q) * bell(q) * tail(k, q), k, max(k, 15.0 / LENGTH_M))[0]
            for k in wavenumber[chosen]
        ]
        expected = np.mean(published(wavenumber[chosen]) - missing)
        assert_within(np.mean(density[:, chosen], axis=1) / expected, 1.0, allowed=0.01, power=0.1)


@pytest.mark.parametrize("separation", [0.25, 0.5, 1.0, 2.0])
@pytest.mark.parametrize("axis", [0, 1, 2])
def test_two_point_correlation_is_that_of_the_spectrum(fields, separation, axis):
    """Isotropic turbulence (Batchelor 1953): longitudinal and lateral correlation as integrals over E(k)."""
    distance, cut = separation * LENGTH_M, np.pi / SPACING_M

    def bessel(k):
        x = k * distance
        return (np.sin(x) - x * np.cos(x)) / x**3

    along = band(lambda k: 2 * bessel(k), cut)
    aside = band(lambda k: np.sin(k * distance) / (k * distance) - bessel(k), cut)
    rng = np.random.default_rng(11)
    step = np.eye(3)[axis] * distance
    products = []
    for field in fields:
        place = rng.uniform(size=(50_000, 3)) * field.size_m
        products.append(np.mean(field.at(place) * field.at(place + step), axis=0))
    for component in range(3):
        expected = along if component == axis else aside
        assert_within(np.array(products)[:, component], expected, allowed=0.004)


def test_field_is_free_of_divergence(fields):
    cells = fields[0].cells[..., :3]
    modes = np.fft.rfftn(cells, axes=(0, 1, 2))
    x, y, z = cells.shape[:3]
    wavevector = np.stack(
        np.meshgrid(np.fft.fftfreq(x), np.fft.fftfreq(y), np.fft.rfftfreq(z), indexing="ij"), -1
    )
    along = np.abs(np.sum(wavevector * modes, axis=-1))
    size = np.sqrt(np.sum(wavevector**2, axis=-1) * np.sum(np.abs(modes) ** 2, axis=-1))
    assert np.sqrt(np.sum(along**2) / np.sum(size**2)) < 1e-6


def test_same_seed_gives_the_same_field_and_another_seed_another():
    first, second, third = (
        synthesise(AIR, np.zeros(3), rng=np.random.default_rng(seed)) for seed in (1, 1, 2)
    )
    assert np.array_equal(first.cells, second.cells)
    assert abs(np.corrcoef(first.cells[..., 0].ravel(), third.cells[..., 0].ravel())[0, 1]) < 0.2


def test_field_is_periodic_and_meets_its_cells(fields):
    field = fields[0]
    corner = np.array([5.0, 3.0, 2.0]) * SPACING_M
    assert np.allclose(field.at(corner), field.cells[5, 3, 2, :3], atol=1e-6)
    assert np.allclose(field.at(corner - 3 * field.size_m), field.cells[5, 3, 2, :3], atol=1e-4)


def test_sheared_field_has_the_ratios_of_the_standard():
    """IEC 61400-1, C: at gamma 3.9 sigma_v is 0.7 and sigma_w 0.5 of sigma_u, and the stress is downward."""
    rng = np.random.default_rng(5)
    fields = [
        synthesise(Turbulence(0.1, 60.0, "mann"), np.array([900.0, 0.0, 0.0]), rng=rng) for _ in range(3)
    ]
    boxes = [np.cov(field.at(rng.uniform(size=(100_000, 3)) * field.size_m).T) for field in fields]
    waves = [
        field.waves.first @ field.waves.first.T + field.waves.second @ field.waves.second.T
        for field in fields
    ]
    covariance = np.mean(boxes, axis=0) + np.mean(waves, axis=0)
    u, v, w = np.sqrt(np.diag(covariance))
    assert abs(u - 1) < 0.08
    assert abs(v / u - 0.7) < 0.07
    assert abs(w / u - 0.5) < 0.06
    assert -0.5 < covariance[0, 2] / (u * w) < -0.3


@pytest.mark.parametrize("length_m", [0.5, 20_000.0])
def test_turbulence_that_does_not_fit_is_refused_with_both_limits(length_m):
    with pytest.raises(InputError, match="to fit in memory"):
        synthesise(Turbulence(0.1, length_m), np.array([6000.0, 1200.0, 0.0]), rng=np.random.default_rng(1))


def test_box_keeps_its_margin_and_its_memory():
    extent = np.array([3000.0, 500.0, 0.0])
    field = synthesise(Turbulence(0.1, 100.0), extent, rng=np.random.default_rng(1), spacing_m=20.0)
    assert np.all(field.size_m >= extent + MARGIN_LENGTHS * 100.0)
    assert field.cells.size / 4 < MAX_CELLS


def test_field_of_a_kaimal_spectrum_is_refused():
    with pytest.raises(InputError, match="no spectral tensor"):
        synthesise(Turbulence(0.1, 100.0, "kaimal"), np.zeros(3), rng=np.random.default_rng(1))
