"""Covariance of two wind *speeds* when the two wind vectors are Gaussian together.

|V| is not linear in V. A single weight vector, its slope at the mean wind, understates the scatter of a
narrow sector's ten-minute mean by half, because the error across the beams is as large as the wind. Here |V|
is expanded in Hermite polynomials of the standardised vector; the covariance of two speeds is then a sum over
the degrees (Mehler's formula), in which degree n carries the n-th power of the correlation. One expansion
serves every lag.
"""

import math
from functools import cache
from types import EllipsisType
from typing import NamedTuple

import numpy as np

from geometry.arrays import FloatArray, IntArray
from reconstruct.moments import wind_moments

DEGREES = 8  # of the expansion; what lies beyond is at most the variance left over times correlation**9
HERMITE_NODES = 32  # of the quadrature for the coefficients, each way
WIDE = 0.25  # of standard deviation to wind: below it the Hermite rule gives the mean to 1e-6
_FLAT = 1e-12  # an axis with less than this share of the larger variance has no spread of its own


Index = tuple[EllipsisType | slice | IntArray | None, ...]


class Speed(NamedTuple):
    """Speed of Gaussian wind vectors, expanded."""

    mean_mps: FloatArray  # (...)
    variance_m2s2: FloatArray  # (...) exact
    coefficients: (
        FloatArray  # (..., a, b) of orthonormal Hermite polynomials of degrees a and b; a + b <= DEGREES
    )
    # (..., 2, 2) takes a deviation of the vector to its standardised axes; 0 where it has no spread
    whitening: FloatArray

    def at(self, index: Index) -> "Speed":
        """Pick from the axes (...), or add some; the index begins with an ellipsis."""
        matrix = (*index, slice(None), slice(None))
        return Speed(
            self.mean_mps[index], self.variance_m2s2[index], self.coefficients[matrix], self.whitening[matrix]
        )


def expand(mean_mps: FloatArray, covariance_m2s2: FloatArray) -> Speed:
    """Expand the speed of Gaussian wind vectors.

    Parameters
    ----------
    mean_mps
        (..., 2) mean vector [m/s].
    covariance_m2s2
        (..., 2, 2) its covariance [m²/s²].

    Returns
    -------
    Speed
        Mean, variance and expansion of |V|.

    Notes
    -----
    E|V|² = |mean|² + trace of the covariance is exact, so the variance needs the quadrature for E|V| alone.

    Examples
    --------
    >>> calm = expand(np.zeros(2), np.eye(2))  # Rayleigh: mean sqrt(pi/2), variance 2 - pi/2
    >>> round(float(calm.mean_mps), 2), round(float(calm.variance_m2s2), 2)
    (1.25, 0.43)
    """
    mean, covariance = np.broadcast_arrays(mean_mps[..., None], covariance_m2s2)
    mean = mean[..., 0]
    variance, axes = np.linalg.eigh(covariance)
    largest = variance[..., -1:]
    spread = np.where(variance > _FLAT * largest, np.sqrt(np.clip(variance, 0.0, None)), 0.0)
    nodes, basis = _rule()
    along = np.einsum("...ji,...j->...i", axes, mean)
    first = along[..., 0, None] + spread[..., 0, None] * nodes
    second = along[..., 1, None] + spread[..., 1, None] * nodes
    speed = np.hypot(first[..., :, None], second[..., None, :])
    coefficients = basis @ speed @ basis.T
    level = _exact_where_wide(mean, covariance, spread[..., -1], coefficients[..., 0, 0])
    square = np.sum(mean**2, axis=-1) + np.trace(covariance, axis1=-2, axis2=-1)
    inverse = np.where(spread > 0, 1 / np.where(spread > 0, spread, 1.0), 0.0)
    whitening = inverse[..., :, None] * np.swapaxes(axes, -1, -2)
    return Speed(level, np.clip(square - level**2, 0.0, None), coefficients, whitening)


def _exact_where_wide(
    mean: FloatArray, covariance: FloatArray, widest: FloatArray, level: FloatArray
) -> FloatArray:
    """Mean speed; the exact one where the vector reaches the calm, whose kink the Hermite rule rounds off."""
    speed = np.hypot(mean[..., 0], mean[..., 1])
    wide = widest > WIDE * speed
    if not np.any(wide):
        return level
    moments = wind_moments(mean[wide], covariance[wide])
    exact = level.copy()
    exact[wide] = speed[wide] + moments.speed_bias_mps
    return exact


def speed_covariance(first: Speed, second: Speed, cross_m2s2: FloatArray) -> FloatArray:
    """Covariance of two speeds.

    Parameters
    ----------
    first, second
        Expansions whose shapes (...) broadcast with the cross-covariance.
    cross_m2s2
        (..., 2, 2) covariance of the first vector (rows) with the second (columns) [m²/s²].

    Returns
    -------
    numpy.ndarray
        (...) covariance of |V1| and |V2| [m²/s²].

    Notes
    -----
    With K the cross-correlation of the standardised vectors, cov = sum over n >= 1 of c1ᵀ S_n(K) c2, S_n the
    n-th symmetric power: the part of degree n of exp(sᵀ K t) (Mehler's formula in two dimensions).

    Examples
    --------
    >>> strong = expand(np.array([10.0, 0.0]), 0.01 * np.eye(2))  # then |V| is the component along the wind
    >>> cross = np.array([[0.004, 0.0], [0.0, 0.009]])
    >>> round(float(speed_covariance(strong, strong, cross)), 5)
    0.004
    """
    k = np.moveaxis(first.whitening @ cross_m2s2 @ np.swapaxes(second.whitening, -1, -2), (-2, -1), (0, 1))
    shape = k.shape[2:]
    rows = [np.stack([k[row, 0], k[row, 1]]) for row in range(2)]
    power = [np.ones((1, *shape))]  # of the second row, as polynomials in t
    total = np.zeros(shape)
    for degree in range(1, DEGREES + 1):
        power.append(_times(power[-1], rows[1]))
        sums = _coefficient(first, degree, 0) * power[0]
        for b in range(1, degree + 1):
            sums = _times(sums, rows[0]) + _coefficient(first, degree, b) * power[b]
        for b in range(degree + 1):
            total += sums[b] * second.coefficients[..., degree - b, b] * _root_factorials(degree - b, b)
    return total


def _coefficient(speed: Speed, degree: int, b: int) -> FloatArray:
    return np.asarray(speed.coefficients[..., degree - b, b] / _root_factorials(degree - b, b))


def _times(polynomial: FloatArray, linear: FloatArray) -> FloatArray:
    """Product of a homogeneous polynomial (power of t2, ...) with a linear form (2, ...)."""
    product = np.empty((len(polynomial) + 1, *np.broadcast_shapes(polynomial.shape[1:], linear.shape[1:])))
    product[:-1] = polynomial * linear[0]
    product[-1] = 0.0
    product[1:] += polynomial * linear[1]
    return product


@cache
def _root_factorials(a: int, b: int) -> float:
    return math.sqrt(math.factorial(a) * math.factorial(b))


@cache
def _rule() -> tuple[FloatArray, FloatArray]:
    """Nodes (node,) and orthonormal Hermite polynomials times weights (degree, node)."""
    nodes, weights = np.polynomial.hermite_e.hermegauss(HERMITE_NODES)
    rows = [np.ones_like(nodes), nodes]
    for degree in range(1, DEGREES):
        rows.append((nodes * rows[degree] - math.sqrt(degree) * rows[degree - 1]) / math.sqrt(degree + 1))
    return nodes, np.stack(rows) * weights / math.sqrt(2 * math.pi)
