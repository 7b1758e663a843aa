"""Random frozen wind fields, made from the spectrum of the turbulence alone.

A field is a periodic box of cubic cells, carried past by the mean wind, and the waves that no such box can
carry. Its frame is downwind, left of the wind, up. The box is made mode by mode: each wavevector gets a random
Gaussian amplitude whose covariance is the spectral tensor there. What a grid loses is made up for:

- *Long waves.* Point samples of the tensor at the wavevectors of the box are the covariance function summed
  over all copies of the box (Poisson summation), and a sheared tensor is not even smooth at wavenumber 0. The
  longest waves are therefore taken out of the box and drawn one by one (`waves`), at wavevectors of any
  length; what is left in the box reaches only a few length scales.
- *Short waves.* Wavenumbers beyond `Field.cut_per_m` (a sphere, so that the field stays isotropic) are drawn one
  by one as well.
- *Interpolation.* Trilinear interpolation damps a wave of wavenumber k, on average over where the sample
  falls in its cell, to (2 + cos k dx)/3 of its variance in each direction. Every mode is made larger by just
  that, so that samples at random places have the right variance. Where samples fall must therefore be random:
  shift the origin.

Nothing here knows a covariance function: the judge of the closed forms must not share their mathematics.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geometry.arrays import FloatArray
from geometry.errors import InputError
from reconstruct.spectra import Turbulence, spectral_tensor
from reconstruct.waves import Waves, draw_waves, long_share, tensor_root

MAX_CELLS = 20_000_000  # 320 MB of field and 720 MB while it is made
CELLS_PER_LENGTH = 12  # at 170 m: cells of 14 m, a third of a 43 m probe; 11 % of the variance is smaller
COARSEST_CELLS_PER_LENGTH = 5  # the bell of the long waves ends at 15 / L, the box at 5 pi / L
COARSEST_CELL_M = 40.0  # about a probe
# From the last sample to the first in the next copy of the box, downwind, left, up: without its long waves the
# box has forgotten itself by then.
MARGIN_LENGTHS = np.array([4.0, 4.0, 4.0])
_SLAB_MODES = 1 << 18
_CHUNK_POINTS = 1 << 17


@dataclass(frozen=True)
class Field:
    """A periodic box of frozen turbulence and the waves it lacks; their downwind component has variance 1.

    Notes
    -----
    Multiply by the standard deviation (intensity times speed) to have m/s.
    """

    cells: NDArray[np.float32]  # (x, y, z, 4) downwind, left, up; the fourth is 0 and makes a cell 16 bytes
    spacing_m: float
    waves: Waves  # too long for the box or too short for its cells; `flight` adds them

    @property
    def size_m(self) -> FloatArray:
        """(3,) period of the box downwind, to the left and upward [m]."""
        return np.asarray(self.cells.shape[:3]) * self.spacing_m

    @property
    def cut_per_m(self) -> float:
        """Largest wavenumber in the box [rad/m]."""
        return float(np.pi / self.spacing_m)

    def at(self, points_m: FloatArray) -> NDArray[np.float32]:
        """Interpolate the wind of the box, trilinearly and periodically.

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
        Standardised field: the downwind component of box and waves together has variance 1.

    Raises
    ------
    InputError
        If the box needs more cells than `MAX_CELLS`, or cells coarser than L / `COARSEST_CELLS_PER_LENGTH` or
        `COARSEST_CELL_M`, or the model has no spectral tensor.

    Notes
    -----
    The amplitude of wavevector k is complex Gaussian with covariance Phi_ij(k) (2 pi)^3 / volume (Mann 1998,
    Prob. Eng. Mech. 13, 269-282, doi:10.1016/S0266-8920(97)00036-2, with the tensor at the
    wavevector itself, which makes the covariance in space periodic and otherwise exact). It is drawn in the
    plane normal to k, so that the field is free of divergence.

    Examples
    --------
    >>> field = synthesise(Turbulence(0.1, 50.0), np.zeros(3), rng=np.random.default_rng(1))
    >>> field.cells.shape, field.waves.vector.shape
    ((48, 48, 48, 4), (3, 2048))
    """
    spacing = _spacing_m(turbulence.length_m, np.asarray(extent_m), spacing_m)
    counts = _counts(np.asarray(extent_m) + MARGIN_LENGTHS * turbulence.length_m, spacing)
    modes = _modes(turbulence, counts, spacing, rng)
    return Field(_cells(modes, counts), spacing, draw_waves(turbulence, np.pi / spacing, rng=rng))


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
) -> NDArray[np.complex64]:
    """Amplitudes (component, kx, ky, half of kz)."""
    axes = _axes(counts, spacing_m)
    modes = np.zeros((3, *(len(axis) for axis in axes)), dtype=np.complex64)
    cell = (2 * np.pi / spacing_m) ** 3 / float(np.prod(counts))  # wavenumber space of one mode
    rows = max(1, _SLAB_MODES // modes[0, 0].size)
    for start in range(0, counts[0], rows):
        slab = slice(start, start + rows)
        wavevector = np.stack(np.meshgrid(axes[0][slab], axes[1], axes[2], indexing="ij"))
        noise = rng.standard_normal((2, *wavevector.shape[1:], 2), dtype=np.float32).view(np.complex64)[
            ..., 0
        ]
        square = np.sum(np.square(wavevector), axis=0)
        inside = (square > 0) & (square < (np.pi / spacing_m) ** 2)
        inner = wavevector[:, inside]
        first, second = tensor_root(inner, spectral_tensor(turbulence, inner))
        share = cell * (1 - long_share(turbulence, np.sqrt(square[inside])))
        alone = inner[2] == 0  # the other modes stand for their complex conjugates too
        scale = np.sqrt(np.where(alone, share, share / 2)) * _interpolation_repair(inner, spacing_m)
        one, two = noise[:, inside]
        modes[:, slab][:, inside] = one * (scale * first) + two * (scale * second)
    return modes


def _axes(counts: tuple[int, int, int], spacing_m: float) -> list[FloatArray]:
    """Wavenumbers along each axis [rad/m]; of the last one the half that is not redundant."""
    x, y, z = (np.asarray(2 * np.pi * np.fft.fftfreq(count, spacing_m), dtype=float) for count in counts)
    return [x, y, np.abs(z[: counts[2] // 2 + 1])]


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
