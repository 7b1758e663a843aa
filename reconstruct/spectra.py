"""Turbulence as a planner knows it (an intensity, a length, a model) and the spectra behind it.

Lengths carry a name each, for four quantities are called L in the field:

- `length_m`, the only one that users give: the longitudinal integral length scale L of the von Kármán
  spectrum, the integral of its longitudinal correlation;
- the von Kármán `eddy_length_m` l = 1.339 L, the argument of the Bessel functions and Mann's length at Γ = 0;
- the `kaimal_length_m` of IEC 61400-1, 8.1 Λ = 340 m above 60 m: its spectrum has the inertial subrange of a
  von Kármán spectrum of L = 340/2.329 = 146 m;
- the `mann_length_m` of the sheared tensor, 33 m for the same air, since shear stretches the eddies.

The four describe the same air when the standard deviation of u and the inertial subrange agree; that is how
`length_m` is turned into each of the others. Frame of every tensor: x downwind, y to the left of it, z up.
"""

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal, NamedTuple

import numpy as np

from geometry.arrays import ArrayLike, FloatArray
from geometry.errors import InputError

TurbulenceModel = Literal["von-karman", "kaimal", "mann"]
IecClass = Literal["A+", "A", "B", "C"]

# l / L of the von Kármán spectrum: Gamma(1/3) / (sqrt(pi) Gamma(5/6)) = 1.3390 (its 70.8 is (2 pi 1.339)^2).
EDDY_LENGTH_RATIO: float = math.gamma(1 / 3) / (math.sqrt(math.pi) * math.gamma(5 / 6))
# Kaimal length over the von Kármán L of equal inertial subrange: 4 L/(6 L)^(5/3) against 4 L/(70.8
# L^2)^(5/6).
KAIMAL_LENGTH_RATIO: float = ((2 * math.pi * EDDY_LENGTH_RATIO) ** (5 / 3) / 6 ** (5 / 3)) ** 1.5
MANN_GAMMA = 3.9  # shear distortion parameter, IEC 61400-1 ed. 4, Annex C.2, eq. C.12
KAIMAL_STD_RATIO = (1.0, 0.8, 0.5)  # of u, v, w to u: IEC 61400-1 ed. 4, Annex C.3, Table C.1
KAIMAL_LENGTH_FACTOR = (1.0, 2.7 / 8.1, 0.66 / 8.1)  # same table: 8.1, 2.7 and 0.66 times the scale parameter
COHERENCE_DECAY = 12.0  # IEC 61400-1 ed. 4, Annex C.3
COHERENCE_OFFSET = 0.12
REFERENCE_INTENSITY: dict[str, float] = {
    "A+": 0.18,
    "A": 0.16,
    "B": 0.14,
    "C": 0.12,
}  # IEC 61400-1 ed. 4, table of the basic parameters


@dataclass(frozen=True)
class Turbulence:
    """Homogeneous turbulence, carried along with the mean wind.

    Raises
    ------
    InputError
        If the intensity is outside 0 to 1 or a length is not above 0 m.

    Examples
    --------
    >>> air = Turbulence(intensity=0.09, length_m=170.0)
    >>> round(air.std_mps(10.0), 3), round(air.eddy_length_m, 1), round(air.kaimal_length_m, 1)
    (0.9, 227.6, 395.8)
    """

    intensity: float  # standard deviation of the longitudinal wind over the mean speed
    length_m: float  # longitudinal integral length scale of the von Kármán spectrum
    model: TurbulenceModel = "von-karman"
    gamma: float = MANN_GAMMA  # of the Mann model; 0 is isotropic

    def __post_init__(self) -> None:
        if not 0 <= self.intensity <= 1:
            raise InputError(
                f"turbulence intensity {self.intensity} came; it is a fraction of the mean speed, 0 to 1"
            )
        if not (math.isfinite(self.length_m) and self.length_m > 0):
            raise InputError(
                f"turbulence length {self.length_m} m came; give a length above 0 m, often 50 to 300 m"
            )
        if self.model not in ("von-karman", "kaimal", "mann"):
            raise InputError(f"turbulence model {self.model!r} came; allowed are von-karman, kaimal and mann")
        if not 0 <= self.gamma <= 5:
            raise InputError(
                f"shear distortion gamma {self.gamma} came; allowed is 0 (isotropic) to 5, usual 3 to 4"
            )

    def std_mps(self, speed_mps: float) -> float:
        """Return the standard deviation of the longitudinal wind [m/s] at a mean speed [m/s]."""
        return self.intensity * speed_mps

    @property
    def eddy_length_m(self) -> float:
        """The l of the von Kármán correlation functions [m]: 1.339 times `length_m`."""
        return EDDY_LENGTH_RATIO * self.length_m

    @property
    def kaimal_length_m(self) -> float:
        """Length of the longitudinal IEC Kaimal spectrum [m] with the same variance and inertial subrange."""
        return KAIMAL_LENGTH_RATIO * self.length_m

    @property
    def mann_length_m(self) -> float:
        """Length of the Mann tensor [m] with the same variance of u and inertial subrange; l at gamma 0."""
        return self.eddy_length_m * mann_std_ratio(self.gamma)[0] ** -3


def from_kaimal_length_m(kaimal_length_m: float) -> float:
    """Turn a Kaimal length [m] into the von Kármán integral length scale [m] of the same inertial subrange.

    Examples
    --------
    >>> round(from_kaimal_length_m(8.1 * 42.0), 1)
    146.1
    """
    return kaimal_length_m / KAIMAL_LENGTH_RATIO


def iec_turbulence(
    iec_class: IecClass, speed_mps: float, *, height_m: float, model: TurbulenceModel = "von-karman"
) -> Turbulence:
    """Turbulence of the normal turbulence model of IEC 61400-1.

    Parameters
    ----------
    iec_class
        "A+", "A", "B" or "C".
    speed_mps
        Mean wind speed at the height [m/s], above 0.
    height_m
        Height above ground [m], above 0.
    model
        Model that carries on with the intensity and the length.

    Returns
    -------
    Turbulence
        Intensity that 90 % of the air stays under, as the standard has it (limited to 1), and the length of
        the same inertial subrange.

    Raises
    ------
    InputError
        If the class is unknown, or speed or height is not above 0.

    Notes
    -----
    IEC 61400-1 ed. 4: sigma_1 = I_ref (0.75 V + 5.6 m/s) (normal turbulence model, eq. 10); scale parameter
    0.7 z up to 60 m, then 42 m (eq. 5); Kaimal length 8.1 times it (Table C.1).

    Examples
    --------
    >>> air = iec_turbulence("C", 10.0, height_m=100.0)
    >>> round(air.intensity, 4), round(air.length_m, 1)
    (0.1572, 146.1)
    """
    if iec_class not in REFERENCE_INTENSITY:
        raise InputError(f"IEC class {iec_class!r} came; allowed are {', '.join(REFERENCE_INTENSITY)}")
    if speed_mps <= 0 or height_m <= 0:
        raise InputError(f"speed {speed_mps} m/s at {height_m} m came; both have to be above 0")
    intensity = REFERENCE_INTENSITY[iec_class] * (0.75 * speed_mps + 5.6) / speed_mps
    scale_m = min(0.7 * height_m, 42.0)
    return Turbulence(min(intensity, 1.0), from_kaimal_length_m(8.1 * scale_m), model=model)


def longitudinal_spectrum(turbulence: Turbulence, frequency_hz: ArrayLike, *, speed_mps: float) -> FloatArray:
    """One-sided spectrum of the longitudinal wind at a point.

    Parameters
    ----------
    turbulence
        A von Kármán or Kaimal turbulence; for Mann integrate `spectral_tensor`.
    frequency_hz
        Frequencies [Hz], 0 or above, any shape.
    speed_mps
        Mean wind speed [m/s], above 0.

    Returns
    -------
    numpy.ndarray
        Spectral density [m2/s2/Hz], the shape of the frequencies; its integral over them is the variance.

    Raises
    ------
    InputError
        If the model is Mann's.

    Notes
    -----
    von Kármán: S = 4 sigma² (L/V) / (1 + 70.8 (n L/V)²)^(5/6) (ESDU 85020), L the integral
    length; Kaimal: S = 4 sigma² (L_k/V) / (1 + 6 n L_k/V)^(5/3) (IEC 61400-1 ed. 4, Annex C.3).

    Examples
    --------
    >>> air = Turbulence(0.1, 100.0)
    >>> longitudinal_spectrum(air, [0.0, 0.1], speed_mps=10.0).round(3)
    array([40.   ,  1.136])
    """
    n = np.asarray(frequency_hz, dtype=float)
    variance = turbulence.std_mps(speed_mps) ** 2
    if turbulence.model == "von-karman":
        time_s = turbulence.length_m / speed_mps
        return np.asarray(
            4 * variance * time_s / (1 + (2 * math.pi * EDDY_LENGTH_RATIO * n * time_s) ** 2) ** (5 / 6)
        )
    if turbulence.model == "kaimal":
        time_s = turbulence.kaimal_length_m / speed_mps
        return np.asarray(4 * variance * time_s / (1 + 6 * n * time_s) ** (5 / 3))
    raise InputError(
        "the Mann model has no closed one-dimensional spectrum: integrate spectral_tensor over k2 and k3"
    )


class Tensor(NamedTuple):
    """Six components of a symmetric tensor, all of one shape: 1 downwind, 2 to the left, 3 up."""

    c11: FloatArray
    c22: FloatArray
    c33: FloatArray
    c12: FloatArray
    c13: FloatArray
    c23: FloatArray


def spectral_tensor(turbulence: Turbulence, wavenumber_per_m: FloatArray) -> Tensor:
    """Spectral tensor of the wind for a longitudinal variance of 1.

    Parameters
    ----------
    turbulence
        A von Kármán or Mann turbulence; its intensity is not used: multiply by the longitudinal variance.
    wavenumber_per_m
        Wave vectors [rad/m], shape (3, ...): downwind, left, up.

    Returns
    -------
    Tensor
        Spectral density [m3], each component of shape (...), two-sided: the integral over all wave vectors is
        the covariance at a point, and its Fourier transform the covariance at a separation.

    Raises
    ------
    InputError
        If the model is Kaimal's: IEC gives it a coherence, which no tensor of an incompressible flow has.

    Notes
    -----
    Isotropic: Phi_ij = E(k)/(4 pi k²) (delta_ij - k_i k_j/k²) with the von Kármán energy spectrum. Sheared:
    Mann (1994), J. Fluid Mech. 273, 141-168, doi:10.1017/S0022112094001886, the uniform-shear
    model, with his C1, C2, zeta1 and zeta2.

    Examples
    --------
    >>> tensor = spectral_tensor(Turbulence(0.1, 100.0), np.array([[0.0], [0.01], [0.0]]))
    >>> tensor.c11.round(1), tensor.c22.round(1)
    (array([27104.9]), array([0.]))
    """
    if turbulence.model == "kaimal":
        raise InputError(
            "IEC's Kaimal model has spectra and a coherence but no spectral tensor: use von-karman or mann"
        )
    gamma = turbulence.gamma if turbulence.model == "mann" else 0.0
    length = turbulence.mann_length_m if turbulence.model == "mann" else turbulence.eddy_length_m
    scale = length**3 / mann_std_ratio(gamma)[0] ** 2
    unit = sheared_tensor(gamma, wavenumber_per_m * length)
    return Tensor(*(scale * component for component in unit))


def energy_spectrum(k: FloatArray) -> FloatArray:
    """Von Kármán energy spectrum for l = 1 m and a variance of 1 in each component (Mann 1994)."""
    integral = math.gamma(5 / 2) * math.gamma(1 / 3) / (2 * math.gamma(17 / 6))  # of k^4/(1+k^2)^(17/6)
    return np.asarray(1.5 / integral * k**4 / (1 + k * k) ** (17 / 6))


def sheared_tensor(gamma: float, k: FloatArray) -> Tensor:
    """Mann's tensor for a length of 1 m and an unsheared variance of 1; wave vectors (3, ...), not 0."""
    k1, k2, k3 = np.where(k == 0, 1e-12, k)  # the limits along an axis exist, their formulas divide by zero
    square = k1 * k1 + k2 * k2 + k3 * k3
    beta = gamma * eddy_lifetime(np.sqrt(square)) if gamma else np.zeros_like(square)
    k30 = k3 + beta * k1
    level = k1 * k1 + k2 * k2
    start = level + k30 * k30
    c1 = beta * k1**2 * (start - 2 * k30**2 + beta * k1 * k30) / (square * level)  # Mann's C1
    turn = np.arctan2(beta * k1 * np.sqrt(level), start - k30 * k1 * beta)
    c2 = k2 * start / level**1.5 * turn  # his C2
    z1, z2 = c1 - k2 / k1 * c2, k2 / k1 * c1 + c2  # his zeta1 and zeta2
    energy = energy_spectrum(np.sqrt(start)) / (4 * math.pi)
    both, mixed = energy / start**2, energy / (start * square)
    return Tensor(
        c11=both * (start - k1**2 - 2 * k1 * k30 * z1 + level * z1**2),
        c22=both * (start - k2**2 - 2 * k2 * k30 * z2 + level * z2**2),
        c33=energy / square**2 * level,
        c12=both * (-k1 * k2 - k1 * k30 * z2 - k2 * k30 * z1 + level * z1 * z2),
        c13=mixed * (-k1 * k30 + level * z1),
        c23=mixed * (-k2 * k30 + level * z2),
    )


def eddy_lifetime(k: FloatArray) -> FloatArray:
    """Life of an eddy of wavenumber k times the shear, for l = 1 m and gamma 1 (Mann 1994)."""
    return np.asarray(np.exp(np.interp(np.log(k), *_lifetime_table())))


@lru_cache(maxsize=1)
def _lifetime_table() -> tuple[FloatArray, FloatArray]:
    """Logarithms of wavenumber and lifetime; both ends are power laws, so the table ends where they hold."""
    from scipy.special import hyp2f1

    k = np.geomspace(1e-5, 1e5, 4001)
    lifetime = k ** (-2 / 3) / np.sqrt(hyp2f1(1 / 3, 17 / 6, 4 / 3, -(k**-2)))
    return np.log(k), np.log(lifetime)


@lru_cache(maxsize=16)
def mann_std_ratio(gamma: float) -> tuple[float, float, float]:
    """Standard deviations of u, v, w of the sheared tensor over that of the unsheared one.

    Examples
    --------
    >>> tuple(round(ratio, 1) for ratio in mann_std_ratio(3.9))
    (1.8, 1.3, 0.9)
    >>> mann_std_ratio(0.0)
    (1.0, 1.0, 1.0)
    """
    if gamma == 0:
        return (1.0, 1.0, 1.0)
    k = np.geomspace(1e-4, 1e3, 150)
    direction, weight = sphere(32, 48)
    wave = direction[:, None, :] * k[:, None]
    volume = k[:, None] ** 3 * weight * math.log(k[1] / k[0])
    sheared, unsheared = sheared_tensor(gamma, wave), sheared_tensor(0.0, wave)
    # beyond the largest wavenumber, .9 % of the unsheared variance, the eddies are too short-lived to be
    # sheared
    beyond = 1 - sum(float(np.sum(volume * part)) for part in unsheared[:3]) / 3
    first, second, third = (math.sqrt(float(np.sum(volume * part)) + beyond) for part in sheared[:3])
    return first, second, third


def sphere(rings: int, sectors: int) -> tuple[FloatArray, FloatArray]:
    """Directions (3, point) and weights (point,) that integrate over the unit sphere."""
    height, weight = np.polynomial.legendre.leggauss(rings)
    turn = (np.arange(sectors) + 0.5) * (2 * math.pi / sectors)
    level = np.sqrt(1 - height**2)
    direction = np.stack(
        [
            np.outer(level, np.cos(turn)).ravel(),
            np.outer(level, np.sin(turn)).ravel(),
            np.repeat(height, sectors),
        ]
    )
    return direction, np.repeat(weight, sectors) * (2 * math.pi / sectors)
