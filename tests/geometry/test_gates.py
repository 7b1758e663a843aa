"""Range gates and probes against published numbers, numeric integration and limits."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import integrate, optimize

from geometry.errors import InputError
from geometry.gates import Gates, Probe, overlap_m, unambiguous_range_m, window_ns

LIGHT_MPS = 299_792_458.0
PROBES = [(200, 256), (400, 512), (100, 256), (20, 1000), (1000, 20)]
quick = settings(derandomize=True, deadline=None, max_examples=60, database=None)


def smeared(offset_m, pulse_ns, window_ns):
    """Second formula: the convolution itself, integrated over the window."""
    std = LIGHT_MPS / 2e9 * pulse_ns / 2.3548200450309493
    half = LIGHT_MPS / 4e9 * window_ns

    def pulse(shift):
        return math.exp(-0.5 * ((offset_m - shift) / std) ** 2) / (std * math.sqrt(2 * math.pi))

    near = min(max(offset_m, -half), half)
    return integrate.quad(pulse, -half, half, points=[near], limit=200, epsabs=0, epsrel=1e-12)[0] / (
        2 * half
    )


@pytest.mark.parametrize(
    ("pulse_ns", "window", "length_m"), [(200, 256, 42.6), (400, 512, 85.1), (100, 256, 38.4)]
)
def test_probe_length_is_that_of_the_200s(pulse_ns, window, length_m):
    """Published probe lengths of the WindScanner's three pulses."""
    assert Probe(pulse_ns, window).length_m == pytest.approx(length_m, abs=0.05)


@pytest.mark.parametrize(("hertz", "range_m"), [(10_000, 15_000), (20_000, 7_500), (40_000, 3_700)])
def test_unambiguous_range_is_c_over_2f(hertz, range_m):
    """15, 7.5 and 3.7 km; c/f (30 km at 10 kHz), a known slip, is twice too far."""
    assert unambiguous_range_m(hertz) == pytest.approx(range_m, abs=50)


@pytest.mark.parametrize("sizes", PROBES)
def test_weight_is_the_convolution_of_pulse_and_window(sizes):
    """The closed form agrees with numeric integration from the centre far into the tail."""
    probe = Probe(*sizes)
    for offset in np.array([0.0, 0.3, 1.0, -1.7, 3.0]) * probe.length_m:
        expected = smeared(offset, *sizes)
        assert float(probe.weight(offset)) == pytest.approx(expected, rel=1e-9, abs=1e-300)


@pytest.mark.parametrize("sizes", PROBES)
def test_weight_halves_at_half_the_probe_length(sizes):
    """Full width at half maximum, found by a root finder on the integrated convolution."""
    half_maximum = 0.5 * smeared(0.0, *sizes)
    edge = optimize.brentq(lambda x: smeared(x, *sizes) - half_maximum, 0.0, 300.0, xtol=1e-10)
    assert Probe(*sizes).length_m == pytest.approx(2 * edge, abs=1e-6)


@pytest.mark.parametrize("sizes", PROBES)
@pytest.mark.parametrize("count", [1, 2, 3, 5, 9, 16])
def test_nodes_have_exact_moments(sizes, count):
    """n nodes give every moment up to 2n - 1, those of a Gaussian plus a uniform variable."""
    probe = Probe(*sizes)
    std, window = LIGHT_MPS / 2e9 * sizes[0] / 2.3548200450309493, LIGHT_MPS / 2e9 * sizes[1]

    def gaussian(order):
        return 0.0 if order % 2 else std**order * math.prod(range(order - 1, 0, -2))

    def uniform(order):
        return 0.0 if order % 2 else (window / 2) ** order / (order + 1)

    offset, weight = probe.nodes(count)
    assert float(np.sum(weight)) == pytest.approx(1.0, abs=1e-14)
    assert np.all(weight > 0) and len(offset) == count
    for order in range(1, 2 * count):
        exact = sum(math.comb(order, k) * gaussian(k) * uniform(order - k) for k in range(order + 1))
        scale = float(np.sum(weight * np.abs(offset) ** order)) or 1.0
        assert abs(float(np.sum(weight * offset**order)) - exact) < 1e-11 * scale


@pytest.mark.parametrize("sizes", PROBES)
def test_nodes_average_a_wave_as_numeric_integration_does(sizes):
    """The mean of a cosine over the probe: quadrature, adaptive integration and transfer function agree."""
    probe = Probe(*sizes)
    wavenumber = 1.5 / probe.length_m
    limit = 12 * probe.std_m
    integral = integrate.quad(
        lambda x: float(probe.weight(x)) * math.cos(wavenumber * x), 0, limit, limit=400
    )
    offset, weight = probe.nodes(9)
    assert float(np.sum(weight * np.cos(wavenumber * offset))) == pytest.approx(2 * integral[0], abs=1e-7)
    assert float(probe.transfer(wavenumber)) == pytest.approx(2 * integral[0], abs=1e-7)


def test_std_is_that_of_the_weighting():
    """The second moment of the weight, integrated, is std_m squared; all of the weight is 1."""
    probe = Probe(200, 256)
    mass = integrate.quad(lambda x: float(probe.weight(x)), 0, 250)[0]
    second = integrate.quad(lambda x: float(probe.weight(x)) * x * x, 0, 250)[0]
    assert 2 * mass == pytest.approx(1.0, abs=1e-9)
    assert math.sqrt(2 * second) == pytest.approx(probe.std_m, rel=1e-9)


def test_transfer_starts_at_one_and_turns_over_behind_the_window():
    """A constant passes whole; a wave between pulse and window in length comes out upside down."""
    probe = Probe(pulse_ns=1, window_ns=256)
    assert float(probe.transfer(0.0)) == 1.0
    assert float(probe.transfer(3 * math.pi / probe.window_m)) == pytest.approx(-2 / (3 * math.pi), abs=0.01)


@pytest.mark.parametrize(
    ("pulse_ns", "window", "longer"), [(1e-6, 256, 256), (256, 1e-6, 256), (1e-9, 1e9, 1e9)]
)
def test_a_very_short_pulse_or_window_leaves_the_other(pulse_ns, window, longer):
    """Limits: the probe is then as long as the longer of the two."""
    assert Probe(pulse_ns, window).length_m == pytest.approx(LIGHT_MPS / 2e9 * longer, rel=1e-6)


@quick
@given(st.floats(1, 1000), st.floats(1, 1000), st.floats(0.1, 10))
def test_a_probe_scales_with_its_times(pulse_ns, window, factor):
    """Twice the times make twice the length, which lies between the larger part and the sum."""
    length = Probe(pulse_ns, window).length_m
    assert Probe(factor * pulse_ns, factor * window).length_m == pytest.approx(factor * length, rel=1e-12)
    metres = LIGHT_MPS / 2e9
    assert max(pulse_ns, window) * metres * (1 - 1e-12) <= length <= (pulse_ns + window) * metres


@quick
@given(st.floats(0, 5000), st.floats(0.5, 100), st.integers(1, 500), st.floats(-100, 60_000))
def test_nearest_gate_is_the_nearest_of_all_centres(first_m, spacing_m, count, range_m):
    """Against a search through every centre."""
    gates = Gates(first_m, spacing_m, count)
    index, offset = gates.nearest(range_m)
    distances = np.abs([first_m + k * spacing_m - range_m for k in range(count)])
    assert abs(float(offset)) <= float(distances.min()) + 1e-9
    assert float(offset) == pytest.approx(first_m + int(index) * spacing_m - range_m, abs=1e-9)


def test_half_way_between_gates_the_nearer_one_to_the_lidar_is_taken():
    """A tie has a rule: gate 0 of 100 and 125 m for 112.5 m; shapes are kept."""
    index, offset = Gates(100, 25, 5).nearest([[112.5, 112.6], [0.0, 9999.0]])
    assert index.tolist() == [[0, 1], [0, 4]]
    assert offset[0, 0] == -12.5


def test_hovsore_gates_have_the_stated_distance_in_the_middle():
    """41 gates of 25 m from 666 m: the 21st is the published 1166 m."""
    gates = Gates(666, 25, 41)
    assert gates.centres_m[20] == 1166.0
    assert gates.last_m == gates.centres_m[-1] == 1666.0


def test_a_hole_between_gates_is_a_negative_overlap():
    """Probes of 42.6 m: 17.6 m in common at 25 m, 57.4 m missing at 100 m."""
    probe = Probe(200, window_ns(64))
    assert overlap_m(25, probe) == pytest.approx(17.6, abs=0.05)
    assert overlap_m(100, probe) == pytest.approx(-57.4, abs=0.05)


@pytest.mark.parametrize(
    "wrong",
    [
        lambda: Gates(-1, 25, 41),
        lambda: Gates(math.nan, 25, 41),
        lambda: Gates(100, 0, 41),
        lambda: Gates(100, math.inf, 41),
        lambda: Gates(100, 25, 0),
        lambda: Gates(100, 25, 2.5),
        lambda: Gates(100, 25, True),
        lambda: Gates(100, 25, 10**12),
        lambda: Gates(100, 1e308, 1000),
        lambda: Gates(100, 25, 41).nearest(math.nan),
        lambda: Probe(0, 256),
        lambda: Probe(200, -1),
        lambda: Probe(math.nan, 256),
        lambda: Probe(200, 256).nodes(0),
        lambda: Probe(200, 256).nodes(65),
        lambda: unambiguous_range_m(0),
        lambda: window_ns(0),
        lambda: overlap_m(-5, Probe(200, 256)),
    ],
)
def test_impossible_gates_are_refused_in_words(wrong):
    """Every error says what to give."""
    with pytest.raises(InputError, match=r"give|possible"):
        wrong()


def test_nodes_cannot_be_written_to():
    """The rule is shared between callers."""
    offset, _ = Probe(200, 256).nodes(3)
    with pytest.raises(ValueError, match="read-only"):
        offset[0] = 0.0
