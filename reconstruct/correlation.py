"""How strongly the wind at one place resembles the wind at another: the correlation of two components at a
separation.

Each model answers one call, `correlation(turbulence)(separation_m, first, second)`, in the frame x downwind,
y left, z up, in units of the longitudinal variance. The models are tabulated once, without dimension, and
interpolated.
"""

import math
from functools import lru_cache
from typing import Protocol

import numpy as np

from geometry.arrays import FloatArray, IntArray
from reconstruct.sheared import sheared
from reconstruct.spectra import (
    COHERENCE_DECAY,
    COHERENCE_OFFSET,
    KAIMAL_LENGTH_FACTOR,
    KAIMAL_STD_RATIO,
    Turbulence,
)

TABLE_POINTS = 2**14  # steps of sqrt(r/l); the worst error of linear interpolation, near 0, is 3e-6
TABLE_END = 6.0  # sqrt(r/l): at r = 36 l the correlation is below 1e-15
_NEAR_ZERO = 1e-300


class Correlation(Protocol):
    """Correlation of two wind components at two places."""

    def __call__(self, separation_m: FloatArray, first: FloatArray, second: FloatArray, /) -> FloatArray:
        """Covariance of first · wind and second · wind, the first place being at `separation_m` from the
        second.

        Parameters
        ----------
        separation_m
            First place minus second [m], shape (3, ...).
        first, second
            Vectors that the wind is projected on, shapes (3, ...) that broadcast with the separation.

        Returns
        -------
        numpy.ndarray
            (...) covariance over the longitudinal variance.
        """
        ...


def correlation(turbulence: Turbulence) -> Correlation:
    """Correlation of a turbulence model, its tables built at the first call and kept.

    Examples
    --------
    >>> air = Turbulence(intensity=0.1, length_m=170.0)
    >>> x, y = np.eye(3)[:2]
    >>> apart = np.array([100.0, 0.0, 0.0])
    >>> round(float(correlation(air)(apart, x, x)), 4), round(float(correlation(air)(apart, y, y)), 4)
    (0.5012, 0.3645)
    """
    if turbulence.model == "von-karman" or (turbulence.model == "mann" and turbulence.gamma == 0):
        return isotropic(turbulence.eddy_length_m)
    if turbulence.model == "kaimal":
        return coherent(turbulence.kaimal_length_m)
    return sheared(turbulence.gamma, turbulence.mann_length_m)


def karman_longitudinal(distance: FloatArray) -> FloatArray:
    """Longitudinal correlation f of von Kármán turbulence at a distance in units of l.

    Notes
    -----
    f(x) = 2^(2/3)/Gamma(1/3) x^(1/3) K_(1/3)(x); its integral over r is L = l/1.339. Mann (1994), J. Fluid
    Mech. 273, 141-168, doi:10.1017/S0022112094001886 gives its spectrum.

    Examples
    --------
    >>> karman_longitudinal(np.array([0.0, 1.0, 50.0])).round(4)
    array([1.    , 0.2598, 0.    ])
    """
    from scipy.special import kv

    x = np.maximum(distance, 1e-30)
    return np.asarray(2 ** (2 / 3) / math.gamma(1 / 3) * x ** (1 / 3) * kv(1 / 3, x))


def karman_excess(distance: FloatArray) -> FloatArray:
    """What the longitudinal correlation exceeds the lateral one by, f - g = -(r/2) f', at a distance in units
    of l.

    Notes
    -----
    From incompressibility, g = f + (r/2) f' (Batchelor 1953, The Theory of
    Homogeneous Turbulence), and (x^n K_n)' = -x^n K_(n-1).

    Examples
    --------
    >>> karman_excess(np.array([0.0, 1.0])).round(4)
    array([0.    , 0.1465])
    """
    from scipy.special import kv

    x = np.maximum(distance, 1e-30)
    return np.asarray(2 ** (2 / 3) / math.gamma(1 / 3) * 0.5 * x ** (4 / 3) * kv(2 / 3, x))


@lru_cache(maxsize=1)
def _karman_table() -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """g and its step, f - g and its step, on equal steps of sqrt(r/l)."""
    distance = np.linspace(0.0, TABLE_END, TABLE_POINTS + 1) ** 2
    excess = karman_excess(distance)
    lateral = karman_longitudinal(distance) - excess
    lateral[-1] = excess[-1] = 0.0  # and 0 beyond
    return lateral[:-1], np.diff(lateral), excess[:-1], np.diff(excess)


@lru_cache(maxsize=64)
def isotropic(eddy_length_m: float) -> Correlation:
    """Isotropic von Kármán turbulence: R_ij = (f - g) r_i r_j / r² + g delta_ij (Pope 2000, eq. 6.44)."""
    lateral, lateral_step, excess, excess_step = _karman_table()
    per_root_m = TABLE_POINTS / TABLE_END / math.sqrt(eddy_length_m)

    def covariance(separation_m: FloatArray, first: FloatArray, second: FloatArray) -> FloatArray:
        x, y, z = separation_m
        # in place: fresh memory costs as much as the arithmetic
        square = x * x
        square += y * y
        square += z * z
        square += _NEAR_ZERO
        place = np.sqrt(square)
        place = np.minimum(per_root_m * np.sqrt(place), TABLE_POINTS - 1e-6)
        index = place.astype(np.intp)
        place -= index
        along = _projected(x, y, z, first)
        along *= along if second is first else _projected(x, y, z, second)
        along /= square
        stretch = excess_step.take(index)
        stretch *= place
        stretch += excess.take(index)
        along *= stretch
        place *= lateral_step.take(index)
        place += lateral.take(index)
        along += place * (first[0] * second[0] + first[1] * second[1] + first[2] * second[2])
        return np.asarray(along)

    return covariance


def _projected(x: FloatArray, y: FloatArray, z: FloatArray, vector: FloatArray) -> FloatArray:
    """Component along a vector."""
    return np.asarray(x * vector[0] + y * vector[1] + z * vector[2])


ROOT_STEPS = 256  # of the tables of the coherent model, along and across
ROOT_END = 4.5  # sqrt of the distance over the Kaimal length


@lru_cache(maxsize=64)
def coherent(kaimal_length_m: float) -> Correlation:
    """IEC Kaimal turbulence with the exponential coherence of IEC 61400-1.

    The standard gives a coherence for u alone; here v and w get the same one, each with its own spectrum, and
    no component is correlated with another. Such a wind is not free of divergence; that is the standard's
    doing.

    Notes
    -----
    Coh(d, n) = exp(-12 sqrt((n d/V)² + (0.12 d/L_c)²)) (IEC 61400-1 ed. 4, Annex C.3), L_c the
    longitudinal length; its in-phase cross-spectrum, frozen, gives R(x, d) = integral of S(k) Coh
    cos(2 pi k x) dk.
    """
    tables = _coherent_tables()
    scale = (ROOT_STEPS - 1) / ROOT_END / math.sqrt(kaimal_length_m)

    def covariance(separation_m: FloatArray, first: FloatArray, second: FloatArray) -> FloatArray:
        x, y, z = separation_m
        corners, weights = _bilinear(np.sqrt(np.abs(x)) * scale, np.sqrt(np.hypot(y, z)) * scale)
        total = np.zeros(())
        for component, table in enumerate(tables):
            value = sum(weight * table.take(corner) for corner, weight in zip(corners, weights, strict=True))
            total = total + first[component] * second[component] * value
        return np.asarray(total)

    return covariance


def _bilinear(row: FloatArray, column: FloatArray) -> tuple[list[IntArray], list[FloatArray]]:
    """Flat indices and weights of the four corners around a place in a square table."""
    row, column = np.minimum(row, ROOT_STEPS - 1 - 1e-6), np.minimum(column, ROOT_STEPS - 1 - 1e-6)
    i, j = row.astype(np.intp), column.astype(np.intp)
    up, right = row - i, column - j
    start = i * ROOT_STEPS + j
    corners = [start, start + 1, start + ROOT_STEPS, start + ROOT_STEPS + 1]
    return corners, [(1 - up) * (1 - right), (1 - up) * right, up * (1 - right), up * right]


@lru_cache(maxsize=1)
def _coherent_tables() -> tuple[FloatArray, ...]:
    """Correlation of u, v, w on equal steps of the roots of distance (in Kaimal lengths) along and across."""
    k = np.concatenate([[0.0], np.geomspace(1e-4, 1e5, 3000)])  # cycles per Kaimal length
    distance = np.linspace(0.0, ROOT_END, ROOT_STEPS) ** 2
    coherence = np.exp(-COHERENCE_DECAY * distance * np.hypot(k[:, None], COHERENCE_OFFSET))
    transform = _cosine_rule(2 * math.pi * distance, k)
    tables = []
    for std, factor in zip(KAIMAL_STD_RATIO, KAIMAL_LENGTH_FACTOR, strict=True):
        spectrum = 4 * factor / (1 + 6 * k * factor) ** (5 / 3)
        table = transform @ (spectrum[:, None] * coherence)
        table *= std**2 / table[0, 0]  # the spectrum beyond the last wavenumber, .02 % of the variance
        table[-1], table[:, -1] = 0.0, 0.0
        tables.append(table.ravel())
    return tuple(tables)


def _cosine_rule(a: FloatArray, k: FloatArray) -> FloatArray:
    """Weights (a, k) that integrate S(k) cos(a k) exactly for S linear between its points (Filon)."""
    step, middle = np.diff(k), 0.5 * (k[1:] + k[:-1])
    half = 0.5 * np.outer(a, step)
    level = np.cos(np.outer(a, middle)) * np.sinc(half / math.pi)
    # integral over one step of (k - middle)/step cos(a k): -sin(a middle) (sin h - h cos h) / (2 h²)
    with np.errstate(invalid="ignore", divide="ignore"):
        odd = np.where(half < 1e-2, half / 6, (np.sin(half) - half * np.cos(half)) / (2 * half**2))
    slope = -np.sin(np.outer(a, middle)) * odd
    weights = np.zeros((len(a), len(k)))
    weights[:, :-1] += step * (0.5 * level - slope)
    weights[:, 1:] += step * (0.5 * level + slope)
    return weights
