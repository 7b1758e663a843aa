"""The one least-squares core: radial speeds to wind, for every technique, one scan or a million at once.

A ray sees v_r = b · (u, v, w) with b = (sin θ cos φ, cos θ cos φ, sin φ). Sector scan, dual and triple
Doppler and the two-beam lidar are weighted linear least squares of v_r on the rows b, and differ in their
rows alone.
"""

from collections.abc import Iterator
from typing import Literal, NamedTuple

import numpy as np

from geometry.arrays import ArrayLike, FloatArray
from geometry.errors import InputError
from reconstruct.block_fit import (
    CHUNK,
    REASONS,
    Retrieval,
    fit_own,
    fit_shared,
    outer_product,
    shared_fit,
    turned_rows,
)
from reconstruct.factor import Factor, factorise

__all__ = [
    "REASONS",
    "Block",
    "Fit",
    "Retrieval",
    "blocks",
    "cofactor",
    "condition",
    "fit",
    "gain",
    "rows",
    "solve",
]

Block = tuple[int | slice, ...]
"""Index of a part of an array."""


def rows(azimuth_deg: ArrayLike, elevation_deg: ArrayLike, *, columns: Literal[2, 3] = 2) -> FloatArray:
    """Rows of the least-squares problem: the first components of each beam's unit vector.

    Parameters
    ----------
    azimuth_deg, elevation_deg : array_like
        (..., ray) beam directions [degrees], clockwise from true north and above the horizontal.
    columns : {2, 3}
        2 fits u and v and leaves a vertical wind in them, about w tan φ along the axis; 3 fits w too.

    Returns
    -------
    numpy.ndarray
        (..., ray, col) b = (sin θ cos φ, cos θ cos φ, sin φ).

    Raises
    ------
    InputError
        If the number of columns is neither 2 nor 3.

    Examples
    --------
    >>> rows([90.0, 0.0], [0.0, 60.0], columns=3).round(3) + 0.0
    array([[1.   , 0.   , 0.   ],
           [0.   , 0.5  , 0.866]])
    """
    if columns not in (2, 3):
        raise InputError(f"a fit has 2 columns (u, v) or 3 (u, v, w), not {columns}")
    # float32 is widened first: its own sines would have seven digits
    azimuth, elevation = np.broadcast_arrays(
        *(np.radians(np.asarray(a, dtype=float)) for a in (azimuth_deg, elevation_deg))
    )
    cosine = np.cos(elevation)
    parts = (np.sin(azimuth) * cosine, np.cos(azimuth) * cosine, np.sin(elevation))
    return np.stack(parts[:columns], axis=-1)


def solve(rows: ArrayLike, radial_speed_mps: ArrayLike, *, weights: ArrayLike | None = None) -> Retrieval:
    """Wind that fits the radial speeds of each scan best.

    Complete scans of one geometry (rows without leading axes) share one matrix product; a scan that misses
    rays is factorised on its own.

    Parameters
    ----------
    rows : array_like
        (ray, col), or (..., ray, col) where every scan has its own; from `rows`. NaN: the ray is missing.
    radial_speed_mps : array_like
        (..., ray) positive away from the lidar [m/s]; not finite: the ray is missing.
    weights : array_like, optional
        (ray,) or (..., ray), not negative: 1 over the variance of each ray up to a factor; 0 leaves the ray
        out.

    Returns
    -------
    Retrieval
        NaN, with the reason in `status`, where the rays left over cannot tell the components apart.

    Raises
    ------
    InputError
        If the shapes do not belong together or a weight is negative.

    Examples
    --------
    >>> azimuth = np.array([75.0, 90.0, 105.0])
    >>> fit = solve(rows(azimuth, 0.0), [8.6603, 7.0711, 5.0])
    >>> fit.wind_mps.round(3)
    array([7.071, 7.071])
    >>> solve(rows(azimuth, 0.0), [8.6603, np.nan, np.nan]).lost
    {'fewer rays than unknowns': 1}
    """
    matrix, speed, root, lead = _checked(rows, radial_speed_mps, weights)
    count, columns = matrix.shape[-2:]
    shared = turned_rows(matrix, root) if matrix.ndim == 2 and root.ndim == 1 else None
    product = shared_fit(shared) if shared else None
    speed = np.broadcast_to(speed, (*lead, count))
    matrix, root = np.broadcast_to(matrix, (*lead, count, columns)), np.broadcast_to(root, (*lead, count))
    out = _empty(lead, columns)
    for index in blocks(lead, CHUNK // max(count, 1)):
        part = speed[index].reshape(-1, count)
        if product:
            fitted = fit_shared(product, part)
        else:
            own = turned_rows(matrix[index].reshape(-1, count, columns), root[index].reshape(-1, count))
            fitted = fit_own(own, part)
        for name, values in vars(fitted).items():
            target = getattr(out, name)
            target[index] = values.reshape(target[index].shape)
    return out


def gain(rows: ArrayLike, weights: ArrayLike | None = None) -> FloatArray:
    """Matrix G of the fit: wind = G v_r.

    Parameters
    ----------
    rows : array_like
        (..., ray, col) from `rows`; a row with NaN takes no part.
    weights : array_like, optional
        (..., ray) not negative.

    Returns
    -------
    numpy.ndarray
        (..., col, ray); NaN where the rank is short.

    Examples
    --------
    >>> gain(rows([0.0, 90.0], 0.0)).round(3) + 0.0
    array([[0., 1.],
           [1., 0.]])
    """
    return fit(rows, weights).gain


class Fit(NamedTuple):
    """What a fit does with radial speeds, before there are any."""

    gain: FloatArray  # (..., col, ray) wind = gain · radial speeds; NaN where the rank is short
    condition: FloatArray  # (...,) of the weighted rows; inf where the rank is short


def fit(rows: ArrayLike, weights: ArrayLike | None = None) -> Fit:
    """Gain and condition of a fit from one factorisation: see `gain` and `condition`.

    Examples
    --------
    >>> both = fit(rows([0.0, 90.0], 0.0))
    >>> both.gain.round(3) + 0.0, round(float(both.condition), 3)
    (array([[0., 1.],
           [1., 0.]]), 1.0)
    """
    factor, root = _factor_of(rows, weights)
    weighted = np.stack([unit * root for unit in factor.basis])
    return Fit(np.asarray(np.einsum("ik...,kr...->...ir", factor.spread, weighted)), factor.condition)


def condition(rows: ArrayLike, weights: ArrayLike | None = None) -> FloatArray:
    """Condition number (...,) of the weighted rows (..., ray, col): how much the worst relative error may
    grow.

    Examples
    --------
    >>> round(float(condition(rows(np.arange(-5.0, 5.5), 0.0))), 3)
    18.107
    """
    factor, _ = _factor_of(rows, weights)
    return factor.condition


def cofactor(rows: ArrayLike, weights: ArrayLike | None = None) -> FloatArray:
    """Covariance (..., col, col) of the fitted wind when a ray of weight one has variance one; NaN if the
    rank is short.
    """
    factor, _ = _factor_of(rows, weights)
    return outer_product(factor.spread)


def _factor_of(rows: ArrayLike, weights: ArrayLike | None) -> tuple[Factor, FloatArray]:
    matrix = np.asarray(rows, dtype=float)
    matrix, _, root, lead = _checked(matrix, np.zeros(matrix.shape[:-1]), weights)
    turned = turned_rows(
        np.broadcast_to(matrix, lead + matrix.shape[-2:]), np.broadcast_to(root, lead + root.shape[-1:])
    )
    return factorise(*turned), turned.root


def _empty(lead: tuple[int, ...], columns: int) -> Retrieval:
    return Retrieval(
        wind_mps=np.empty((*lead, columns)),
        condition=np.empty(lead),
        residual_std_mps=np.empty(lead),
        cofactor=np.empty((*lead, columns, columns)),
        rays=np.empty(lead, dtype=np.intp),
        status=np.empty(lead, dtype=np.intp),
    )


def blocks(shape: tuple[int, ...], size: int) -> Iterator[Block]:
    """Indices of blocks of an array of that shape, each of about that many elements and contiguous in order.

    Examples
    --------
    >>> list(blocks((2, 5), 3))
    [(0, slice(0, 3, None)), (0, slice(3, 6, None)), (1, slice(0, 3, None)), (1, slice(3, 6, None))]
    """
    if not shape:
        yield ()
        return
    axis, inner = 0, int(np.prod(shape[1:]))
    while axis < len(shape) - 1 and inner > size:
        axis += 1
        inner //= max(shape[axis], 1)
    step = max(1, size // max(inner, 1))
    for outer in np.ndindex(shape[:axis]):
        for start in range(0, shape[axis], step):
            yield (*outer, slice(start, start + step))


def _checked(
    rows: ArrayLike, radial_speed_mps: ArrayLike, weights: ArrayLike | None
) -> tuple[FloatArray, FloatArray, FloatArray, tuple[int, ...]]:
    """Rows, speeds, root weights and the shape of the scans, or one clear error."""
    matrix = np.asarray(rows, dtype=float)
    speed = np.asarray(radial_speed_mps, dtype=float)
    if matrix.ndim < 2 or matrix.shape[-1] not in (2, 3):
        raise InputError(
            f"rows have the shape {matrix.shape}: (..., ray, 2) or (..., ray, 3) is needed, see rows()"
        )
    weight = np.ones(matrix.shape[-2]) if weights is None else np.asarray(weights, dtype=float)
    if speed.ndim < 1 or weight.ndim < 1 or {speed.shape[-1], weight.shape[-1]} != {matrix.shape[-2]}:
        raise InputError(
            f"rows {matrix.shape}, radial speeds {speed.shape} and weights {weight.shape} do not belong "
            "together: the last axis of speeds and weights and the last but one of the rows are the rays"
        )
    if not np.all(np.isfinite(weight) & (weight >= 0)):
        raise InputError(
            "a weight is negative or not finite: weights are 1 over the variance, 0 leaves a ray out"
        )
    try:
        lead = np.broadcast_shapes(matrix.shape[:-2], speed.shape[:-1], weight.shape[:-1])
    except ValueError:
        raise InputError(
            f"the scans of rows {matrix.shape}, radial speeds {speed.shape} and weights {weight.shape} "
            "differ in number"
        ) from None
    return matrix, speed, np.sqrt(weight), lead
