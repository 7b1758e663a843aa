"""Random frozen wind fields, made from the spectrum of the turbulence alone.

A field is a periodic box of cubic cells, carried past by the mean wind. Its frame is downwind, left of the
wind, up. It is made mode by mode: each wavevector of the box gets a random Gaussian amplitude whose
covariance is the spectral tensor there. That gives, exactly, the covariance of the model with three
differences, each bounded and repaired here:

- *Box.* Point samples of the tensor at the wavevectors of the box are the covariance function summed over all
  copies of the box (Poisson summation). With several length scales of margin the copies take away a per cent
  or two of the variance, at wavelengths that hardly fit: one factor on the waves longer than pi L gives it
  back (`Field.box_share` keeps what it was).
- *Grid.* Wavenumbers beyond `Field.cut_per_m` (a sphere, so that the field stays isotropic) are not in the
  box. Their covariance is `Field.subgrid`; whoever samples the field adds it back as independent noise: in
  full for a sample at a point, and for an average over a probe what `subgrid_covariance` leaves of it.
- *Interpolation.* Trilinear interpolation damps a wave of wavenumber k, on average over where the sample
  falls in its cell, to (2 + cos k dx)/3 of its variance in each direction. Every mode is made larger by just
  that, so that samples at random places have the right variance. Where samples fall must therefore be random:
  shift the origin.

The sheared tensor keeps power down to wavenumber 0, which no box has: it loses some 8 % of the variance, all
of it in the longest waves of u, and the factor gives the variance back but not those waves. Means of u over a
wide scan then vary too little; `Field.box_share` tells.

Nothing here knows a covariance function: the judge of the closed forms must not share their mathematics.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geometry.arrays import FloatArray
from geometry.errors import InputError
from reconstruct.spectra import Tensor, Turbulence, mann_std_ratio, spectral_tensor

MAX_CELLS = 20_000_000  # 320 MB of field and 720 MB while it is made
CELLS_PER_LENGTH = 12  # at 170 m: cells of 14 m, a third of a 43 m probe; 11 % of the variance is smaller
COARSEST_CELLS_PER_LENGTH = 5  # beyond that a fifth of the variance would be added as noise
COARSEST_CELL_M = 40.0  # about a probe: what is smaller may pass for independent from ray to ray
# From the last sample to the first in the next copy of the box, downwind, left, up. Copies abreast have the
# negative correlation of g: at 7 lengths -.005 each, which took 5 % from the wind that a wide scan averages.
MARGIN_LENGTHS = np.array([7.0, 10.0, 10.0])
_LONG_WAVES = 2.0  # wavenumber times L under which the box is too small for a wave
_SUBGRID_SPAN = 1e4
_SUBGRID_NODES = 24
_SLAB_MODES = 1 << 18
_CHUNK_POINTS = 1 << 17


@dataclass(frozen=True)
class Field:
    """A periodic box of frozen turbulence whose downwind component has variance 1.

    Notes
    -----
    Multiply by the standard deviation (intensity times speed) to have m/s.
    """

    cells: NDArray[np.float32]  # (x, y, z, 4) downwind, left, up; the fourth is 0 and makes a cell 16 bytes
    spacing_m: float
    subgrid: FloatArray  # (3, 3) covariance of what the cells are too coarse for
    box_share: float  # resolved variance before the repair, over what it should have been

    @property
    def size_m(self) -> FloatArray:
        """(3,) period of the box downwind, to the left and upward [m]."""
        return np.asarray(self.cells.shape[:3]) * self.spacing_m

    @property
    def cut_per_m(self) -> float:
        """Largest wavenumber in the box [rad/m]."""
        return float(np.pi / self.spacing_m)

    def at(self, points_m: FloatArray) -> NDArray[np.float32]:
        """Interpolate the resolved wind, trilinearly and periodically.

        Parameters
        ----------
        points_m : numpy.ndarray
            (..., 3) places downwind, to the left and up from the corner of the box [m].

        Returns
        -------
        numpy.ndarray
            (..., 3) downwind, left and upward wind, in standard deviations.
        """
        places = points_m.reshape(-1, 3)
        wind = np.empty((len(places), 3), dtype=np.float32)
        for start in range(0, len(places), _CHUNK_POINTS):
            part = slice(start, start + _CHUNK_POINTS)
            wind[part] = self._interpolated(places[part])
        return wind.reshape(points_m.shape)

    def _interpolated(self, places_m: FloatArray) -> NDArray[np.float32]:
        counts = self.cells.shape[:3]
        flat = self.cells.reshape(-1).view(np.complex128)  # one cell is one 16-byte number: gathers are quick
        scaled = places_m.T / self.spacing_m
        floor = np.floor(scaled)
        upper = (scaled - floor).astype(np.float32)
        low = [part.astype(np.intp) % count for part, count in zip(floor, counts, strict=True)]
        high = [np.where(part == count - 1, 0, part + 1) for part, count in zip(low, counts, strict=True)]
        total = np.zeros((len(places_m), 4), dtype=np.float32)
        for x, weight_x in ((low[0], 1 - upper[0]), (high[0], upper[0])):
            for y, weight_y in ((low[1], 1 - upper[1]), (high[1], upper[1])):
                column, weight = (x * counts[1] + y) * counts[2], weight_x * weight_y
                for z, weight_z in ((low[2], 1 - upper[2]), (high[2], upper[2])):
                    corner = flat[column + z].view(np.float32).reshape(-1, 4)
                    total += (weight * weight_z)[:, None] * corner
        return total[:, :3]


def synthesise(
    turbulence: Turbulence, extent_m: FloatArray, *, rng: np.random.Generator, spacing_m: float | None = None
) -> Field:
    """Draw a frozen field, large enough to carry an extent past once.

    Parameters
    ----------
    turbulence : Turbulence
        Model and length; the intensity is not used.
    extent_m : numpy.ndarray
        (3,) how far samples reach downwind, across and upward [m]; the box is `MARGIN_LENGTHS` lengths
        larger.
    rng : numpy.random.Generator
        Source of the amplitudes.
    spacing_m : float, optional
        Side of a cell [m]; without it L / `CELLS_PER_LENGTH`, or what `MAX_CELLS` allows.

    Returns
    -------
    Field
        Standardised field: its downwind component has variance 1, subgrid part included.

    Raises
    ------
    InputError
        If the box needs more cells than `MAX_CELLS`, or cells coarser than L / `COARSEST_CELLS_PER_LENGTH` or
        `COARSEST_CELL_M`, or the model has no spectral tensor.

    Notes
    -----
    The amplitude of wavevector k is complex Gaussian with covariance Phi_ij(k) (2 pi)^3 / volume (Mann 1998,
    Prob. Eng. Mech. 13, 269-282, doi:10.1016/S0266-8920(97)00036-2, equation 9, with the tensor at the
    wavevector itself, which makes the covariance in space periodic and otherwise exact). It is drawn in the
    plane normal to k, so that the field is free of divergence.

    Examples
    --------
    >>> field = synthesise(Turbulence(0.1, 50.0), np.zeros(3), rng=np.random.default_rng(1))
    >>> field.cells.shape, round(float(field.subgrid[0, 0]), 3)
    ((84, 120, 120, 4), 0.106)
    """
    spacing = _spacing_m(turbulence.length_m, np.asarray(extent_m), spacing_m)
    counts = _counts(np.asarray(extent_m) + MARGIN_LENGTHS * turbulence.length_m, spacing)
    subgrid = subgrid_covariance(turbulence, np.pi / spacing)
    modes, resolved, long_waves = _modes(turbulence, counts, spacing, rng)
    wanted = _total_variance(turbulence) - float(np.trace(subgrid))
    gain = np.sqrt(1 + (wanted - resolved) / long_waves)
    _amplify_long_waves(modes, _axes(counts, spacing), _LONG_WAVES / turbulence.length_m, gain)
    return Field(_cells(modes, counts), spacing, subgrid, resolved / wanted)


def subgrid_covariance(
    turbulence: Turbulence,
    cut_per_m: float,
    *,
    response: Callable[[FloatArray], FloatArray] | None = None,
    axis: FloatArray | None = None,
) -> FloatArray:
    """Covariance of the eddies beyond a wavenumber, for a longitudinal variance of 1.

    Parameters
    ----------
    turbulence : Turbulence
        Model and length.
    cut_per_m : float
        Wavenumber from which on eddies count [rad/m].
    response : callable, optional
        What an average leaves of the power of waves (3, ...) [rad/m], of shape (...), or two averages of the
        power they share; 1 for a sample at a point.
    axis : numpy.ndarray, optional
        (3,) unit vector along which the average is long: only waves nearly normal to it are left.

    Returns
    -------
    numpy.ndarray
        (3, 3) downwind, left, up.

    Notes
    -----
    Gauss-Legendre in the logarithm of the wavenumber over four decades, beyond which there is 0.2 % of the
    rest; in the cube root of the cosine to the axis, which crowds the nodes where the waves are normal to it;
    and equal steps around it.

    Examples
    --------
    >>> subgrid_covariance(Turbulence(0.1, 170.0), np.pi / 10).diagonal().round(4)
    array([0.0841, 0.0841, 0.0841])
    """
    node, weight = np.polynomial.legendre.leggauss(_SUBGRID_NODES)
    span = np.log(_SUBGRID_SPAN) / 2
    wavenumber = cut_per_m * np.exp(span * (node + 1))
    direction, solid_angle = _around(np.array([1.0, 0.0, 0.0]) if axis is None else axis, node, weight)
    wavevector = direction[:, None, :] * wavenumber[:, None]
    density = np.outer(span * weight * wavenumber**3, solid_angle)
    if response is not None:
        density = density * response(wavevector)
    tensor = spectral_tensor(turbulence, wavevector)
    c11, c22, c33, c12, c13, c23 = (float(np.sum(density * part)) for part in tensor)
    return np.array([[c11, c12, c13], [c12, c22, c23], [c13, c23, c33]])


def _around(axis: FloatArray, node: FloatArray, weight: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Directions (3, point) and solid angles (point,) that are dense where they are normal to an axis."""
    sectors = 2 * len(node)
    turn = (np.arange(sectors) + 0.5) * (2 * np.pi / sectors)
    first = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    first /= np.linalg.norm(first)
    around = np.outer(first, np.cos(turn)) + np.outer(np.cross(axis, first), np.sin(turn))
    cosine = np.repeat(node**3, sectors)
    direction = axis[:, None] * cosine + np.sqrt(1 - cosine**2) * np.tile(around, len(node))
    return direction, np.repeat(3 * node**2 * weight, sectors) * (2 * np.pi / sectors)


def _total_variance(turbulence: Turbulence) -> float:
    """Sum of the variances of the three components over that of the first."""
    ratio = np.asarray(mann_std_ratio(turbulence.gamma if turbulence.model == "mann" else 0.0))
    return float(np.sum(np.square(ratio / ratio[0])))


def _spacing_m(length_m: float, extent_m: FloatArray, asked_m: float | None) -> float:
    size = np.asarray(extent_m) + MARGIN_LENGTHS * length_m
    affordable = float(np.cbrt(np.prod(size) / (0.9 * MAX_CELLS)))  # a tenth is left for rounding up
    spacing = asked_m if asked_m is not None else max(length_m / CELLS_PER_LENGTH, affordable)
    coarsest = min(length_m / COARSEST_CELLS_PER_LENGTH, COARSEST_CELL_M)
    if not affordable <= spacing <= coarsest:
        raise InputError(
            f"turbulence of length {length_m:g} m over {' x '.join(f'{side:.0f}' for side in size)} m needs "
            f"cells of {affordable:.1f} m or more to fit in memory and of {coarsest:.1f} m or less to carry "
            f"the turbulence, but got {spacing:.1f} m: shorten the averaging time or take another tier"
        )
    return spacing


def _counts(size_m: FloatArray, spacing_m: float) -> tuple[int, int, int]:
    """Cells along each axis: even numbers that the FFT likes."""
    from scipy.fft import next_fast_len

    x, y, z = (2 * next_fast_len(int(np.ceil(side / spacing_m / 2))) for side in size_m)
    return x, y, z


def _modes(
    turbulence: Turbulence, counts: tuple[int, int, int], spacing_m: float, rng: np.random.Generator
) -> tuple[NDArray[np.complex64], float, float]:
    """Amplitudes (component, kx, ky, half of kz), their variance, and that of the long waves."""
    axes = _axes(counts, spacing_m)
    modes = np.zeros((3, *(len(axis) for axis in axes)), dtype=np.complex64)
    cell = (2 * np.pi / spacing_m) ** 3 / float(np.prod(counts))  # wavenumber space of one mode
    rows = max(1, _SLAB_MODES // modes[0, 0].size)
    total = long_waves = 0.0
    for start in range(0, counts[0], rows):
        slab = slice(start, start + rows)
        wavevector = np.stack(np.meshgrid(axes[0][slab], axes[1], axes[2], indexing="ij"))
        noise = rng.standard_normal((2, *wavevector.shape[1:], 2), dtype=np.float32).view(np.complex64)[
            ..., 0
        ]
        square = np.sum(np.square(wavevector), axis=0)
        inside = (square > 0) & (square < (np.pi / spacing_m) ** 2)
        inner = wavevector[:, inside]
        first, second, density = _root(inner, spectral_tensor(turbulence, inner))
        alone = inner[2] == 0  # the other modes stand for their complex conjugates too
        carried = density * np.where(alone, cell, 2 * cell)
        total += float(np.sum(carried))
        long_waves += float(np.sum(carried[square[inside] < (_LONG_WAVES / turbulence.length_m) ** 2]))
        scale = np.sqrt(np.where(alone, cell, cell / 2)) * _interpolation_repair(inner, spacing_m)
        one, two = noise[:, inside]
        modes[:, slab][:, inside] = one * (scale * first) + two * (scale * second)
    return modes, total, long_waves


def _axes(counts: tuple[int, int, int], spacing_m: float) -> list[FloatArray]:
    """Wavenumbers along each axis [rad/m]; of the last one the half that is not redundant."""
    x, y, z = (np.asarray(2 * np.pi * np.fft.fftfreq(count, spacing_m), dtype=float) for count in counts)
    return [x, y, np.abs(z[: counts[2] // 2 + 1])]


def _amplify_long_waves(
    modes: NDArray[np.complex64], axes: list[FloatArray], limit_per_m: float, gain: float
) -> None:
    """Multiply, in place, the amplitudes of the wavenumbers under a limit."""
    near = [np.flatnonzero(np.abs(axis) < limit_per_m) for axis in axes]
    block = np.ix_(np.arange(3), *near)
    x, y, z = np.ix_(*(axis[index] for axis, index in zip(axes, near, strict=True)))
    modes[block] *= np.where(x**2 + y**2 + z**2 < limit_per_m**2, gain, 1.0).astype(np.float32)


def _root(k: FloatArray, tensor: Tensor) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Two vectors (3, mode) whose outer products sum to the tensor (mode,), and its trace.

    The tensor of an incompressible flow lives in the plane normal to k: a Cholesky factor of its two rows
    there, on a level unit vector and the one that completes the triad, never meets the null direction.
    """
    level = np.hypot(k[0], k[1])
    safe = np.where(level > 0, level, 1.0)
    x, y = np.where(level > 0, -k[1] / safe, 0.0), np.where(level > 0, k[0] / safe, 1.0)
    size = np.sqrt(np.square(level) + np.square(k[2]))
    p, q, s = -k[2] * y / size, k[2] * x / size, level / size
    c11, c22, c33, c12, c13, c23 = tensor
    across = x * x * c11 + 2 * x * y * c12 + y * y * c22
    mixed = x * (c11 * p + c12 * q + c13 * s) + y * (c12 * p + c22 * q + c23 * s)
    steep = p * p * c11 + q * q * c22 + s * s * c33 + 2 * (p * q * c12 + p * s * c13 + q * s * c23)
    root = np.sqrt(np.maximum(across, 0.0))
    share = np.divide(mixed, root, out=np.zeros_like(root), where=root > 0)
    rest = np.sqrt(np.maximum(steep - np.square(share), 0.0))
    first = np.stack([root * x + share * p, root * y + share * q, share * s])
    return first, np.stack([rest * p, rest * q, rest * s]), across + steep


def _interpolation_repair(wavevector: FloatArray, spacing_m: float) -> FloatArray:
    """One over the rms damping of a wave by trilinear interpolation at a random place in its cell."""
    kept = (2 + np.cos(wavevector * spacing_m)) / 3
    return np.asarray(1 / np.sqrt(np.prod(kept, axis=0)))


def _cells(modes: NDArray[np.complex64], counts: tuple[int, int, int]) -> NDArray[np.float32]:
    """Field in space (x, y, z, 4), from amplitudes that are overwritten on the way."""
    from scipy.fft import irfftn

    cells = np.zeros((*counts, 4), dtype=np.float32)
    for component in range(3):
        cells[..., component] = irfftn(modes[component], s=counts, norm="forward", overwrite_x=True)
    return cells
