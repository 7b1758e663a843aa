"""Orthogonal factors of the rows of a scan, by hand, for one scan or a million at once.

The first two columns of the rows (east, north) are turned to the principal axis of the beams, where they
become cos d and sin d of the angle d from that axis: nearly orthogonal, however narrow the sector. Each
column is scaled to length one and orthogonalised by modified Gram-Schmidt, a second time where that matters.
No normal equations, no column means.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from geometry.arrays import BoolArray, FloatArray

RANK_TOLERANCE = 1e-14
"""A direction seen with less than this share of the rays' root sum of squares is not seen: its sine is
rounding.
"""


REORTHOGONALISE = 0.5
"""A column that keeps more than this of its length is orthogonal to rounding after one pass."""


_TINY = 1e-300
"""Divisor in place of 0: what it divides is 0 too."""


class Factor(NamedTuple):
    """Weighted rows W A T = Q R of one or many scans, T being the turn to the principal axis of the beams."""

    basis: tuple[FloatArray, ...]  # columns of Q, each (ray, ...)
    spread: FloatArray  # (col, col, ...) T R⁻¹: takes Qᵀ b to the wind
    condition: FloatArray  # (...) ratio of the singular values of W A; inf where the rank is short
    short: BoolArray  # (...) the rays cannot tell the columns apart


def turn(columns: Sequence[FloatArray], root_weights: FloatArray) -> tuple[list[FloatArray], FloatArray]:
    """Turn the east and north columns to the principal axis of the beams: where the sum of sin d cos d is
    zero.

    Parameters
    ----------
    columns : sequence of numpy.ndarray
        (east, north) or (east, north, up), each (ray, ...).
    root_weights : numpy.ndarray
        (ray, ...) square root of the weights.

    Returns
    -------
    turned : list of numpy.ndarray
        (along, across) or (along, across, up), each (ray, ...), without the weights.
    axis : numpy.ndarray
        (2, ...) sine and cosine of the azimuth of the axis.

    Examples
    --------
    >>> turned, axis = turn([np.sin([0.9, 1.0, 1.1]), np.cos([0.9, 1.0, 1.1])], np.ones(3))
    >>> round(float(np.arctan2(*axis)), 6), turned[1].round(4) + 0.0
    (1.0, array([-0.0998,  0.    ,  0.0998]))
    """
    east, north, *others = columns
    x, y = root_weights * east, root_weights * north
    sine, cosine = axis = _half_angle(2 * dot(x, y), dot(y, y) - dot(x, x))
    return [east * sine + north * cosine, east * cosine - north * sine, *others], axis


def factorise(
    columns: Sequence[FloatArray],
    root_weights: FloatArray,
    axis: FloatArray,
    memory: FloatArray | None = None,
) -> Factor:
    """Factorise the rows of scans.

    Parameters
    ----------
    columns : sequence of numpy.ndarray
        Two or three columns of the turned rows (along, across, up), each (ray, ...), finite; from `turn`.
    root_weights : numpy.ndarray
        (ray, ...) square root of the weights; 0 for a ray that is missing.
    axis : numpy.ndarray
        (2, ...) sine and cosine of the azimuth of the axis to which the columns were turned.
    memory : numpy.ndarray, optional
        (col + 1, ray, ...) to work in; the basis is then a part of it.

    Returns
    -------
    Factor
        `spread` is NaN where the rank is short.
    """
    if memory is None:
        memory = np.empty((len(columns) + 1, *root_weights.shape))
    for weighted, column in zip(memory[1:], columns, strict=True):
        np.multiply(root_weights, column, out=weighted)
    basis, triangle = _orthogonalise(list(memory[1:]), memory[0])
    smallest = RANK_TOLERANCE * np.sqrt(dot(root_weights, root_weights))
    short = np.asarray(~(triangle[0, 0] > smallest))
    for k in range(1, len(basis)):
        short = short | ~(triangle[k, k] > smallest)
    with np.errstate(divide="ignore", invalid="ignore"):
        spread = _turn_back(_triangle_inverse(triangle), axis)
        condition = _condition(triangle)
    if np.any(short):
        condition = np.where(short, np.inf, condition)
        spread[..., short] = np.nan
    return Factor(basis, spread, condition, short)


def _orthogonalise(
    columns: list[FloatArray], scratch: FloatArray
) -> tuple[tuple[FloatArray, ...], FloatArray]:
    """Turn columns (ray, ...) into an orthonormal basis in place, and give the triangle (col, col, ...) that they were.

    In place, because fresh memory costs more than the arithmetic in it. Modified Gram-Schmidt, each pass made again
    where it takes much of a column away: "twice is enough" to be orthogonal to rounding is shown for the classical form,
    the worse one, by Giraud et al. (2005), Numer. Math. 101, 87-100, doi:10.1007/s00211-005-0615-4.
    """
    triangle = np.zeros((len(columns), len(columns), *columns[0].shape[1:]))
    for k, rest in enumerate(columns):
        scale = _normalise(rest)
        for _ in range(2 if k else 0):
            for j, known in enumerate(columns[:k]):
                part = dot(known, rest)
                triangle[j, k] += part * scale
                rest -= np.multiply(known, part, out=scratch)
            kept = _normalise(rest)
            scale = scale * kept
            if np.min(kept, initial=1.0) > REORTHOGONALISE:
                break
        triangle[k, k] = scale
    return tuple(columns), triangle


def take_out(basis: Sequence[FloatArray], speed: FloatArray, scratch: FloatArray) -> FloatArray:
    """Components (col, ...) of weighted radial speeds (ray, ...) on the basis; the residuals stay in their
    place.

    Each column is taken from what the one before has left: the form of Gram-Schmidt that is backward stable
    for least squares (Björck 1967, BIT 7, 1-21, doi:10.1007/BF01934122).
    """
    parts = []
    for unit in basis:
        parts.append(dot(unit, speed))
        speed -= np.multiply(unit, parts[-1], out=scratch)
    return np.stack(parts)


def dot(a: FloatArray, b: FloatArray) -> FloatArray:
    """Sum over the rays, the first axis: with the scans last, numpy's loops run along them."""
    return np.asarray(np.einsum("r...,r...->...", a, b))


def _normalise(column: FloatArray) -> FloatArray:
    """Scale a column (ray, ...) to length one in place and give its length (...); a column of zeros stays
    one.
    """
    length = np.sqrt(dot(column, column))
    column *= 1 / np.maximum(length, _TINY)
    return length


def _half_angle(sine: FloatArray, cosine: FloatArray) -> FloatArray:
    """(2, ...) sine and cosine of half the angle of a vector of any length: tan(a/2) = sin a / (1 + cos
    a).
    """
    small = np.asarray(np.sqrt(sine * sine + cosine * cosine))
    small += np.abs(cosine)
    np.divide(sine, np.maximum(small, _TINY), out=small)
    large = 1 / np.sqrt(1 + small * small)
    small = small * large
    near, out = cosine >= 0, np.empty((2, *small.shape))
    out[0], out[1] = large, small
    np.copyto(out[0, ...], small, where=near)
    np.copyto(out[1, ...], large, where=near)
    return out


def _turn_back(inverse: FloatArray, axis: FloatArray) -> FloatArray:
    """Rows (along, across, up) of a small matrix turned to (east, north, up)."""
    sine, cosine = axis
    along, across = inverse[0], inverse[1]
    return np.stack([along * sine + across * cosine, along * cosine - across * sine, *inverse[2:]])


def _triangle_inverse(triangle: FloatArray) -> FloatArray:
    """Inverse of small upper triangles by back substitution, (col, col, ...)."""
    inverse = np.zeros_like(triangle)
    for k in range(len(triangle)):
        inverse[k, k] = 1 / triangle[k, k]
        for i in range(k - 1, -1, -1):
            known = sum(triangle[i, j] * inverse[j, k] for j in range(i + 1, k + 1))
            inverse[i, k] = -known / triangle[i, i]
    return inverse


def _condition(triangle: FloatArray) -> FloatArray:
    """Ratio of the singular values of small upper triangles.

    For two columns [[a, b], [0, d]] the sum of the two is |(a + d, b)|, their difference |(a - d, b)| and
    their product a d: nothing cancels.
    """
    if len(triangle) > 2:
        values = np.linalg.svd(np.moveaxis(triangle, (0, 1), (-2, -1)), compute_uv=False)
        return np.asarray(values[..., 0] / values[..., -1])
    a, b, d = triangle[0, 0], triangle[0, 1], triangle[1, 1]
    square = b * b
    largest = 0.5 * (np.sqrt((a + d) ** 2 + square) + np.sqrt((a - d) ** 2 + square))
    return np.asarray(largest * (largest / (a * d)))
