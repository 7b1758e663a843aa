"""Waves that a box of cells cannot carry, one by one: those too long for the box, those too short for its cells.

Both are drawn at random from the spectral tensor. A wave is no field that has to be looked up: what an
instrument makes of it (probe, sweep, passing wind) is known exactly, at any distance, so that whatever meets
the same air (two beams, a beam and the target, one scan and the next) sees the same wave.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from geometry.arrays import FloatArray
from reconstruct.spectra import Tensor, Turbulence, spectral_tensor

# Waves hand over from those drawn here to those of the box like a bell curve, exp(-(k L / 6)²): the longest, where
# a sheared tensor is not smooth and no box is long enough, are all drawn here.
LONG_WAVES = 6.0  # wavenumber times L
_LONGEST_OVER = 2.5  # times that, the bell is .002: the box has the rest
LONG_COUNT = 1536
SHORT_COUNT = 512
# Steps of a sequence that fills a cube evenly, powers of the root of x^4 = x + 1. Drawn at random instead, as a Latin
# hypercube, waves of one draw miss the variance of ten minutes by 11 % (rms) instead of 4 %.
_STEPS = 1.2207440846057596 ** -np.array([1.0, 2.0, 3.0])


class Waves(NamedTuple):
    """Random waves whose sum has the covariance of a part of the spectrum, for a longitudinal variance of 1.

    The wind at place x is the real part of the sum of (a first + b second) exp(i k·x), a and b from `amplitudes`.
    """

    vector: FloatArray  # (3, wave) wavevectors k [rad/m]: downwind, left, up
    first: FloatArray  # (3, wave)
    second: FloatArray  # (3, wave)

    def amplitudes(self, rng: np.random.Generator) -> NDArray[np.complex64]:
        """Draw a and b (2, wave): real and imaginary parts are standard normal."""
        return rng.standard_normal((2, 2 * self.vector.shape[1]), dtype=np.float32).view(np.complex64)


def draw_waves(
    turbulence: Turbulence,
    cut_per_m: float,
    *,
    rng: np.random.Generator,
    long_count: int = LONG_COUNT,
    short_count: int = SHORT_COUNT,
) -> Waves:
    """Draw the waves that a box with a largest wavenumber lacks.

    Parameters
    ----------
    turbulence : Turbulence
        Model and length; the intensity is not used.
    cut_per_m : float
        Largest wavenumber of the box [rad/m].
    rng : numpy.random.Generator
        Source of the wavevectors.
    long_count, short_count : int
        How many there are of each.

    Returns
    -------
    Waves
        Any number of them has the right covariance on average over draws; more make a single draw more nearly Gaussian.

    Raises
    ------
    InputError
        If the model has no spectral tensor.

    Notes
    -----
    Randomisation of the spectrum (Kraichnan 1970, Phys. Fluids 13, 22-31, doi:10.1063/1.1692799) with importance
    sampling: wavenumbers evenly up to the bell's end, and beyond the cut as the inertial subrange has its variance; the
    cosine to the wind as a cube, which crowds the waves that a mean over minutes leaves. The three coordinates are an
    additive sequence from a random start (Cranley & Patterson 1976, SIAM J. Numer. Anal. 13, 904-914): it fills
    their cube evenly, and every single wave is anywhere with the same probability.

    Examples
    --------
    >>> waves = draw_waves(Turbulence(0.1, 170.0), np.pi / 14, rng=np.random.default_rng(1))
    >>> waves.vector.shape, bool(np.allclose(np.sum(waves.vector * waves.first, axis=0), 0.0))
    ((3, 2048), True)
    """
    longest = LONG_WAVES * _LONGEST_OVER / turbulence.length_m
    share, direction, solid_angle = _directions(long_count, rng)
    wavenumber = longest * share
    long = wavenumber * direction
    weight = longest / long_count * wavenumber**2 * solid_angle * long_share(turbulence, wavenumber)
    share, direction, solid_angle = _directions(short_count, rng)
    wavenumber = cut_per_m * share**-1.5  # E(k) dk ~ k^(-5/3) dk is the same for each
    short = wavenumber * direction
    vector = np.concatenate([long, short], axis=1)
    weight = np.append(weight, 1.5 / short_count * wavenumber**3 / share * solid_angle)
    first, second = tensor_root(vector, spectral_tensor(turbulence, vector))
    return Waves(vector, np.sqrt(weight) * first, np.sqrt(weight) * second)


def long_share(turbulence: Turbulence, wavenumber_per_m: FloatArray) -> FloatArray:
    """Share of the power at a wavenumber that is too long for a box and drawn as single waves, 0 to 1.

    Examples
    --------
    >>> long_share(Turbulence(0.1, 100.0), np.array([0.0, 0.06, 0.16])).round(3)
    array([1.   , 0.368, 0.   ])
    """
    scaled = wavenumber_per_m * (turbulence.length_m / LONG_WAVES)
    return np.where(scaled < _LONGEST_OVER, np.exp(-np.square(scaled)), 0.0)


def tensor_root(k: FloatArray, tensor: Tensor) -> tuple[FloatArray, FloatArray]:
    """Two vectors (3, wave) whose outer products sum to the tensor at wavevectors.

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
    return first, np.stack([rest * p, rest * q, rest * s])


def _directions(count: int, rng: np.random.Generator) -> tuple[FloatArray, FloatArray, FloatArray]:
    """A number in (0, 1], a unit vector (3, wave) that crowds where it is normal to the wind, and its solid angle."""
    start = rng.uniform(size=3)[:, None]
    share, root, turn = 1 - (start + _STEPS[:, None] * np.arange(count)) % 1.0
    root, turn = 2 * root - 1, 2 * np.pi * turn
    cosine = root**3
    level = np.sqrt(1 - cosine**2)
    direction = np.stack([cosine, level * np.cos(turn), level * np.sin(turn)])
    return share, direction, 12 * np.pi * root**2  # 2 dξ · 3 ξ² · 2π
