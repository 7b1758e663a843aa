"""Correlation of Mann's sheared turbulence, tabulated from its spectral tensor.

The tensor is expanded in spherical harmonics of the wave vector's direction; each harmonic of wave vectors
makes the same harmonic of separations, with a spherical Bessel transform of its strength (Rayleigh's
expansion of a plane wave). The sums are tabulated over distance and direction, once for each gamma, and
interpolated linearly.
"""

import math
from collections.abc import Callable
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from geometry.arrays import FloatArray
from reconstruct.spectra import mann_std_ratio, sheared_tensor, sphere

DEGREE = 24  # highest degree of the harmonics; only even ones occur
RINGS, SECTORS = 48, 96  # of the quadrature over directions
WAVENUMBERS = 192  # from 1e-6 to 1e6 over the length, for the transforms
HEIGHTS, TURNS, DISTANCES = 31, 61, 129  # of the table: upper half sphere, left half, roots of distance
ROOT_END = 12.0  # sqrt of the distance over the length, the last in the table


class _Table(NamedTuple):
    values: FloatArray  # (distance, height, turn, component) flattened to (place, component)


def sheared(gamma: float, mann_length_m: float) -> Callable[[FloatArray, FloatArray, FloatArray], FloatArray]:
    """Correlation of the Mann model, in units of the variance of u.

    Notes
    -----
    R_ij(r) = sum over l, m of 4 pi (-1)^(l/2) Y_lm(r/|r|) integral of k² a_lm(k) j_l(k r) dk, a_lm the
    coefficients of Phi_ij (Rayleigh's expansion: NIST DLMF, section 10.60). Tensor: Mann (1994),
    doi:10.1017/S0022112094001886.
    """
    values = _table(gamma).values
    scale = (DISTANCES - 1) / ROOT_END / math.sqrt(mann_length_m)

    def covariance(separation_m: FloatArray, first: FloatArray, second: FloatArray) -> FloatArray:
        x, y, z = np.broadcast_arrays(*separation_m)
        below = np.where(z < 0, -1.0, 1.0)  # R(-r) = R(r): look from below to above
        x, y, z = below * x, below * y, below * z
        level = np.hypot(x, y)
        root = np.minimum(np.sqrt(np.hypot(level, z)) * scale, DISTANCES - 1 - 1e-6)
        height = np.minimum(np.arctan2(z, level) * (2 / math.pi * (HEIGHTS - 1)), HEIGHTS - 1 - 1e-6)
        turn = np.minimum(np.arctan2(np.abs(y), x) * ((TURNS - 1) / math.pi), TURNS - 1 - 1e-6)
        parts = _interpolated(values, root, height, turn)
        mirror = np.where(y < 0, -1.0, 1.0)  # the two components with one index to the left change sign
        a, b = first, second
        return np.asarray(
            a[0] * b[0] * parts[..., 0]
            + a[1] * b[1] * parts[..., 1]
            + a[2] * b[2] * parts[..., 2]
            + (a[0] * b[2] + a[2] * b[0]) * parts[..., 4]
            + mirror
            * ((a[0] * b[1] + a[1] * b[0]) * parts[..., 3] + (a[1] * b[2] + a[2] * b[1]) * parts[..., 5])
        )

    return covariance


def _interpolated(values: FloatArray, root: FloatArray, height: FloatArray, turn: FloatArray) -> FloatArray:
    """(..., 6) components between the eight corners of a cell of the table."""
    places = [part.astype(np.intp) for part in (root, height, turn)]
    over = [part - place for part, place in zip((root, height, turn), places, strict=True)]
    start = (places[0] * HEIGHTS + places[1]) * TURNS + places[2]
    total = np.zeros((*root.shape, 6))
    for corner in range(8):
        bits = (corner >> 2 & 1, corner >> 1 & 1, corner & 1)
        weight = math.prod(part if bit else 1 - part for part, bit in zip(over, bits, strict=True))
        index = start + (bits[0] * HEIGHTS + bits[1]) * TURNS + bits[2]
        total += np.asarray(weight)[..., None] * values[index]
    return total


@lru_cache(maxsize=4)
def _table(gamma: float) -> _Table:
    """Sum the harmonics on a grid of distance, height and turn, for length 1 and a variance of u of 1."""
    log_k = np.linspace(math.log(1e-6), math.log(1e6), WAVENUMBERS)
    distance = np.linspace(0.0, ROOT_END, DISTANCES) ** 2
    strengths = _strengths(gamma, np.exp(log_k))
    height = np.linspace(0.0, 1.0, HEIGHTS) * math.pi / 2
    turn = np.linspace(0.0, 1.0, TURNS) * math.pi
    total = np.zeros((DISTANCES, HEIGHTS, TURNS, 6))
    for degree in range(0, DEGREE + 1, 2):
        radial = _radial(degree, log_k, strengths[degree], distance)
        shape = _harmonics(degree, np.sin(height), turn)
        total += 4 * math.pi * (-1) ** (degree // 2) * np.einsum("rmc,mhtc->rhtc", radial, shape)
    total /= mann_std_ratio(gamma)[0] ** 2
    total[-1] = 0.0
    return _Table(total.reshape(-1, 6))


def _strengths(gamma: float, k: FloatArray) -> dict[int, FloatArray]:
    """Coefficients {degree: (k, order, component)} of the tensor in real harmonics.

    Components 11, 22, 33 and 13 do not change when left and right are exchanged and have the cosines of the
    turn; 12 and 23 change sign and have the sines.
    """
    direction, weight = sphere(RINGS, SECTORS)
    height = direction[2].reshape(RINGS, SECTORS)[:, 0]
    turn = np.asarray((np.arange(SECTORS) + 0.5) * (2 * math.pi / SECTORS), dtype=np.float64)
    ring_weight = weight.reshape(RINGS, SECTORS)
    bases = {
        degree: _harmonics(degree, height, turn) * ring_weight[None, :, :, None]
        for degree in range(0, DEGREE + 1, 2)
    }
    out = {degree: np.empty((len(k), degree + 1, 6)) for degree in bases}
    for index, wavenumber in enumerate(k):
        tensor = np.stack(sheared_tensor(gamma, direction * wavenumber), axis=-1).reshape(RINGS, SECTORS, 6)
        for degree, basis in bases.items():
            out[degree][index] = np.einsum("mhtc,htc->mc", basis, tensor)
    return out


def _harmonics(degree: int, height: FloatArray, turn: FloatArray) -> FloatArray:
    """(order, height, turn, component) real orthonormal spherical harmonics; `height` is sin(elevation)."""
    from scipy.special import gammaln, lpmv

    orders = np.arange(degree + 1)
    norm = np.sqrt(
        (2 * degree + 1) / (4 * math.pi) * np.exp(gammaln(degree - orders + 1) - gammaln(degree + orders + 1))
    ) * np.where(orders > 0, math.sqrt(2), 1.0)
    legendre = norm[:, None] * lpmv(orders[:, None], degree, height[None, :])
    even = legendre[:, :, None] * np.cos(orders[:, None] * turn)[:, None, :]
    odd = legendre[:, :, None] * np.sin(orders[:, None] * turn)[:, None, :]
    return np.stack([even, even, even, odd, even, odd], axis=-1)


def _radial(degree: int, log_k: FloatArray, strength: FloatArray, distance: FloatArray) -> FloatArray:
    """(distance, order, component) integral of k² a(k) j_l(k r) dk by a fast Hankel transform on logarithmic
    steps.

    Notes
    -----
    j_l(x) = sqrt(pi/(2x)) J_(l+1/2)(x); Hamilton (2000), Mon. Not. R. Astron. Soc. 312, 257, appendix B.
    """
    from scipy.fft import fht, fhtoffset

    step = float(log_k[1] - log_k[0])
    order = degree + 0.5
    offset = fhtoffset(step, order)
    middle = 0.5 * (log_k[0] + log_k[-1])
    log_r = log_k - 2 * middle + offset
    k = np.exp(log_k)
    transformed = fht((k**1.5)[:, None, None].T * strength.T, step, order, offset=offset)
    radial = math.sqrt(math.pi / 2) * transformed.T * np.exp(-1.5 * log_r)[:, None, None]
    return _at_distances(radial, log_r, distance, degree, k, strength)


def _at_distances(
    radial: FloatArray,
    log_r: FloatArray,
    distance: FloatArray,
    degree: int,
    k: FloatArray,
    strength: FloatArray,
) -> FloatArray:
    """Interpolate in log distance; at 0 only the degree 0 is left, the integral of k² a."""
    out = np.zeros((len(distance), *radial.shape[1:]))
    place = np.interp(np.log(distance[1:]), log_r, np.arange(len(log_r)))
    index = place.astype(np.intp)
    part = (place - index)[:, None, None]
    out[1:] = (1 - part) * radial[index] + part * radial[index + 1]
    if degree == 0:
        out[0] = np.trapezoid(k[:, None, None] ** 3 * strength, np.log(k), axis=0)
    return out
