"""Blocks of scans fitted by least squares: complete scans of one geometry through one matrix product, others each
on its own; and the noun for what comes out.
"""

from dataclasses import dataclass
from threading import local
from typing import NamedTuple

import numpy as np

from geometry.arrays import FloatArray, IntArray
from reconstruct.factor import dot, factorise, take_out, turn

REASONS = (
    "solved",
    "no ray is left",
    "fewer rays than unknowns",
    "the rays cannot tell the components of the wind apart",
)
"""What `Retrieval.status` means."""

CHUNK = 2**17
"""Radial speeds that are worked on at once: a megabyte."""

MEMORY = 6 * CHUNK
"""Numbers that a thread keeps to work in: speeds, weights, scratch and three columns of a block."""

_THREAD = local()


@dataclass(frozen=True)
class Retrieval:
    """Wind of one or many scans, with what the fit knows about its own quality."""

    wind_mps: FloatArray  # (..., col) u, v or u, v, w; NaN where it cannot be known
    condition: FloatArray  # (...,) of the weighted rows; inf where the rank is short
    residual_std_mps: FloatArray  # (...,) of a ray of weight one; NaN without a ray to spare
    cofactor: FloatArray  # (..., col, col) covariance of the wind when a ray of weight one has variance one
    rays: IntArray  # (...,) rays that took part
    status: IntArray  # (...,) index into REASONS

    @property
    def covariance_m2s2(self) -> FloatArray:
        """(..., col, col) covariance of the wind as the residuals suggest it [m²/s²]."""
        return np.asarray(np.square(self.residual_std_mps)[..., None, None] * self.cofactor)

    @property
    def lost(self) -> dict[str, int]:
        """How many scans gave no wind, by reason."""
        counts = np.bincount(self.status.ravel(), minlength=len(REASONS))
        return {REASONS[i]: int(counts[i]) for i in range(1, len(REASONS)) if counts[i]}


class Turned(NamedTuple):
    """Rows of one geometry or of many scans, turned to the axis of their beams, missing rays set to zero."""

    columns: list[FloatArray]  # each (ray, ...)
    root: FloatArray  # (ray, ...) square root of the weights
    axis: FloatArray  # (2, ...) sine and cosine of its azimuth


class Shared(NamedTuple):
    """What the complete scans of one geometry have in common."""

    rows: Turned  # (ray, 1): one geometry, to be set against many scans
    basis: FloatArray  # (ray, col)
    spread: FloatArray  # (col, col)
    condition: float
    short: bool


def turned_rows(matrix: FloatArray, root: FloatArray) -> Turned:
    """Rows (..., ray, col) with root weights (..., ray), turned and with the ray axis first."""
    known = np.all(np.isfinite(matrix), axis=-1)
    root = np.moveaxis(np.where(known, root, 0.0), -1, 0)
    matrix = np.ascontiguousarray(np.moveaxis(np.where(known[..., None], matrix, 0.0), (-1, -2), (0, 1)))
    columns, axis = turn(list(matrix), root)
    return Turned(columns, root, axis)


def outer_product(spread: FloatArray) -> FloatArray:
    """(..., col, col) spread spreadᵀ of (col, col, ...)."""
    return np.asarray(np.einsum("ik...,jk...->...ij", spread, spread))


def shared_fit(rows: Turned) -> Shared:
    """What the complete scans of one geometry need: its factor, once."""
    factor = factorise(*rows)
    wide = Turned([column[:, None] for column in rows.columns], rows.root[:, None], rows.axis)
    return Shared(
        wide, np.stack(factor.basis, -1), factor.spread, float(factor.condition), bool(factor.short)
    )


def fit_shared(shared: Shared, speed: FloatArray) -> Retrieval:
    """Scans (scan, ray) of one geometry: complete ones through one matrix product, the others on their
    own.
    """
    with np.errstate(invalid="ignore"):
        complete = np.isfinite(np.einsum("nr->n", speed)) & (not shared.short)
    if np.all(complete):
        return _fit_complete(shared, speed)
    out = fit_own(shared.rows, speed)
    if np.any(complete):  # the same fit to rounding; through the product so that equal scans give equal winds
        part = _fit_complete(shared, speed[complete])
        for name, values in vars(part).items():
            getattr(out, name)[complete] = values
    return out


def _fit_complete(shared: Shared, speed: FloatArray) -> Retrieval:
    root = shared.rows.root[:, 0]
    scans, columns = len(speed), len(shared.spread)
    weighted = speed if np.all(root == 1) else speed * root
    parts = weighted @ shared.basis
    rest = parts @ shared.basis.T
    np.subtract(weighted, rest, out=rest)
    rays = np.full(scans, np.count_nonzero(root))
    return Retrieval(
        wind_mps=parts @ shared.spread.T,
        condition=np.full(scans, shared.condition),
        residual_std_mps=_residual_std(np.einsum("nr,nr->n", rest, rest), rays, columns),
        cofactor=np.tile(outer_product(shared.spread), (scans, 1, 1)),
        rays=rays,
        status=np.zeros(scans, dtype=np.intp),
    )


def fit_own(rows: Turned, speed: FloatArray) -> Retrieval:
    """Scans (scan, ray), each with its own missing rays."""
    memory = _memory((len(rows.columns) + 3, *speed.T.shape))
    rest, root, scratch = memory[:3]
    rest[...] = speed.T
    known = np.isfinite(rest)
    np.copyto(rest, 0.0, where=~known)
    np.multiply(rows.root, known, out=root)
    factor = factorise(rows.columns, root, rows.axis, memory[2:])
    rest *= root
    parts = take_out(factor.basis, rest, scratch)
    rays = np.count_nonzero(root, axis=0)
    status = np.select([rays == 0, rays < len(rows.columns), factor.short], [1, 2, 3], 0)
    lost = status > 0
    out = Retrieval(
        wind_mps=np.einsum("ik...,k...->...i", factor.spread, parts),
        condition=np.where(lost, np.inf, factor.condition),
        residual_std_mps=_residual_std(dot(rest, rest), rays, len(rows.columns)),
        cofactor=outer_product(factor.spread),
        rays=rays,
        status=status,
    )
    out.condition[rays == 0] = np.nan
    for values in (out.wind_mps, out.residual_std_mps, out.cofactor):
        values[lost] = np.nan
    return out


def _memory(shape: tuple[int, ...]) -> FloatArray:
    """Memory of this thread to work in, used again for the next block: new pages cost more than the
    arithmetic.
    """
    size = int(np.prod(shape))
    if size > MEMORY:
        return np.empty(shape)
    if not hasattr(_THREAD, "memory"):
        _THREAD.memory = np.empty(MEMORY)
    kept: FloatArray = _THREAD.memory
    return kept[:size].reshape(shape)


def _residual_std(squares: FloatArray, rays: IntArray, columns: int) -> FloatArray:
    """Root of the weighted sum of squares over the rays to spare; NaN where there is none."""
    spare = np.where(rays > columns, rays - columns, np.nan)
    return np.asarray(np.sqrt(squares / spare))
