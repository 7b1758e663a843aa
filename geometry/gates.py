"""Range gates: where they stand, how long a probe each one averages, how far a pulse train is unambiguous."""

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from geometry.arrays import ArrayLike, FloatArray, IntArray
from geometry.errors import InputError

#: Speed of light in vacuum [m/s], exact by the definition of the metre (SI). Air slows it by 0.03 %, 2 m at
#: 6 km: the instruments' own range stamps decide, and their range offset takes it up.
SPEED_OF_LIGHT_MPS = 299_792_458.0

#: Metres of range per nanosecond of time: light goes there and back, so half the speed of light.
RANGE_PER_NS_M = 0.5e-9 * SPEED_OF_LIGHT_MPS

#: Full width at half maximum of a Gaussian over its standard deviation, 2·sqrt(2·ln 2).
FWHM_PER_STD = 2.0 * math.sqrt(2.0 * math.log(2.0))

#: More gates than any instrument has (500 to 4000): a larger count is a slip of the pen and would fill the
#: memory.
MAX_GATES = 1_000_000

#: Largest number of quadrature nodes over one probe; the rule is built from this many squared points.
MAX_NODES = 64

#: From this many values on scipy.special, which takes 0.6 s to import, is worth it: ten times as fast as math.erfc.
MANY_VALUES = 500

_short_erfc = np.frompyfunc(math.erfc, 1, 1)


@dataclass(frozen=True)
class Gates:
    """Equally spaced range gates of one beam.

    Parameters
    ----------
    first_m : float
        Slant range from the head to the centre of gate 0 [m], not negative.
    spacing_m : float
        Distance from one centre to the next [m], positive.
    count : int
        Number of gates, at least 1.

    Raises
    ------
    InputError
        If a number is not finite or outside these limits.

    Examples
    --------
    >>> gates = Gates(first_m=666, spacing_m=25, count=41)
    >>> gates.last_m
    1666.0
    >>> index, offset_m = gates.nearest([1160.0, 3000.0])
    >>> index
    array([20, 40])
    >>> offset_m
    array([    6., -1334.])
    """

    first_m: float
    spacing_m: float
    count: int

    def __post_init__(self) -> None:
        if not (math.isfinite(self.first_m) and self.first_m >= 0):
            raise InputError(
                f"first_m is {self.first_m}: give the range to the centre of gate 0 in metres, 0 or more"
            )
        require_positive("spacing_m", self.spacing_m, "the distance between two gate centres in metres")
        whole = isinstance(self.count, int | np.integer) and not isinstance(self.count, bool)
        if not (whole and 1 <= self.count <= MAX_GATES):
            raise InputError(f"count of gates is {self.count!r}: give a whole number from 1 to {MAX_GATES}")
        if not math.isfinite(self.last_m):
            raise InputError(
                f"{self.count} gates {self.spacing_m} m apart have no finite end: give smaller numbers"
            )

    @property
    def centres_m(self) -> FloatArray:
        """(gate,) slant range of every gate centre [m]."""
        return self.first_m + self.spacing_m * np.arange(self.count, dtype=np.float64)

    @property
    def last_m(self) -> float:
        """Slant range of the last gate centre [m]."""
        return float(self.first_m + self.spacing_m * (self.count - 1))

    def nearest(self, range_m: ArrayLike) -> tuple[IntArray, FloatArray]:
        """Give the gate whose centre is nearest to a range, and how far the centre is off.

        Parameters
        ----------
        range_m : array_like, any shape
            Slant range of the target [m].

        Returns
        -------
        index : array of int, same shape
            Gate number, from 0. Half way between two centres the nearer gate to the lidar is taken; a range
            outside the gates gets the first or the last one.
        offset_m : array, same shape
            Centre of that gate minus the range [m]: positive when the gate measures beyond the target.

        Raises
        ------
        InputError
            If a range is not finite.
        """
        ranges = np.asarray(range_m, dtype=np.float64)
        if not np.all(np.isfinite(ranges)):
            raise InputError(
                "a range to look up in the gates is not finite: give metres from the head to the target"
            )
        position = np.ceil((ranges - self.first_m) / self.spacing_m - 0.5)
        index = np.clip(position, 0, self.count - 1).astype(np.intp)
        return index, np.asarray(self.first_m + self.spacing_m * index - ranges)


@dataclass(frozen=True)
class Probe:
    """What one gate averages along the beam: a Gaussian pulse smeared by a rectangular time window.

    The weighting along range is the convolution of the pulse and the window, both turned into range by c/2:

        w(x) = [erf((x + W/2)/(σ√2)) - erf((x - W/2)/(σ√2))] / (2W),
        W = c/2·window,  σ = c/2·pulse/(2√(2 ln 2)).

    Parameters
    ----------
    pulse_ns : float
        Full width at half maximum of the Gaussian pulse [ns], positive.
    window_ns : float
        Length of the rectangular window that goes into one spectrum [ns], positive; see `window_ns`.

    Raises
    ------
    InputError
        If a width is not finite and positive.

    References
    ----------
    Banakh, V. A. and Smalikho, I. N. (1997), Atmos. Oceanic Opt. 10(12), 957-965: the weighting of a pulsed
    lidar as a Gaussian pulse convolved with the window of its spectral estimate.

    Examples
    --------
    >>> probe = Probe(pulse_ns=200, window_ns=256)
    >>> round(probe.length_m, 1)
    42.6
    >>> offset_m, weight = probe.nodes(3)
    >>> round(float(np.sum(weight * offset_m**2)) ** 0.5, 3) == round(probe.std_m, 3)
    True
    """

    pulse_ns: float
    window_ns: float

    def __post_init__(self) -> None:
        require_positive(
            "pulse_ns", self.pulse_ns, "the full width at half maximum of the pulse in nanoseconds"
        )
        require_positive("window_ns", self.window_ns, "the length of the time window in nanoseconds")

    @property
    def pulse_std_m(self) -> float:
        """Standard deviation of the pulse along range [m]."""
        return RANGE_PER_NS_M * self.pulse_ns / FWHM_PER_STD

    @property
    def window_m(self) -> float:
        """Length of the time window along range [m]."""
        return RANGE_PER_NS_M * self.window_ns

    @property
    def length_m(self) -> float:
        """Probe length: full width of the weighting at half its maximum [m]."""
        return RANGE_PER_NS_M * _full_width(float(self.pulse_ns), float(self.window_ns))

    @property
    def std_m(self) -> float:
        """Standard deviation of the weighting along range [m]: the variances of pulse and window add."""
        return math.sqrt(self.pulse_std_m**2 + self.window_m**2 / 12.0)

    def weight(self, offset_m: ArrayLike) -> FloatArray:
        """Weight of the air at some distance from the gate's centre.

        Parameters
        ----------
        offset_m : array_like, any shape
            Distance along the beam from the centre of the gate [m], either sign.

        Returns
        -------
        array, same shape
            Weight [1/m]; its integral over all offsets is 1.
        """
        offset = np.abs(np.asarray(offset_m, dtype=np.float64))
        scale, half = math.sqrt(2.0) * self.pulse_std_m, 0.5 * self.window_m
        # erfc on the positive side keeps its digits in the tail, where two erf would cancel
        near, far = _erfc((offset - half) / scale), _erfc((offset + half) / scale)
        return np.asarray((near - far) / (2.0 * self.window_m))

    def nodes(self, count: int) -> tuple[FloatArray, FloatArray]:
        """Gauss quadrature over the weighting: the mean over the probe as a sum of few points.

        Parameters
        ----------
        count : int
            Number of points, 1 to 64; polynomials up to degree 2·count - 1 are averaged exactly.

        Returns
        -------
        offset_m : array (count,)
            Distances from the centre of the gate [m], ascending, symmetric about 0. Read-only.
        weight : array (count,)
            Positive weights that sum to 1. Read-only.

        Raises
        ------
        InputError
            If the count is outside 1 to 64.

        Notes
        -----
        The weighting is that of the sum of a Gaussian and a uniform variable, so the products of a
        Gauss-Hermite and a Gauss-Legendre rule integrate it exactly to the same degree; the Lanczos process
        turns those count² points into the three-term recurrence of the weighting and its Jacobi matrix into
        the rule (Golub and Welsch 1969, Math. Comp. 23, 221-230, doi:10.1090/S0025-5718-69-99647-1).
        """
        if not 1 <= count <= MAX_NODES:
            raise InputError(f"{count} points over the probe were asked for: 1 to {MAX_NODES} are possible")
        return _gauss_rule(self.pulse_std_m, self.window_m, int(count))

    def transfer(self, wavenumber_rad_per_m: ArrayLike) -> FloatArray:
        """Fourier transform of the weighting: what is left of a wave along the beam.

        Parameters
        ----------
        wavenumber_rad_per_m : array_like, any shape
            Wavenumber k along the beam [rad/m], either sign.

        Returns
        -------
        array, same shape
            exp(-k²σ²/2)·sin(kW/2)/(kW/2): 1 at k = 0; negative where the window turns the wave over.
        """
        wavenumber = np.asarray(wavenumber_rad_per_m, dtype=np.float64)
        gaussian = np.exp(-0.5 * (wavenumber * self.pulse_std_m) ** 2)
        return np.asarray(gaussian * np.sinc(wavenumber * self.window_m / (2.0 * np.pi)))


def window_ns(fft_points: int, sample_ns: float = 4.0) -> float:
    """Length of the time window of one spectrum [ns]: points times the sampling interval (4 ns at 250 MHz).

    Raises
    ------
    InputError
        If either number is not finite and positive.

    Examples
    --------
    >>> window_ns(64)
    256.0
    """
    require_positive("fft_points", fft_points, "the number of points of one spectrum")
    require_positive("sample_ns", sample_ns, "the sampling interval in nanoseconds")
    return float(fft_points * sample_ns)


def unambiguous_range_m(pulse_repetition_hz: float) -> float:
    """Range beyond which an echo comes back after the next pulse has left [m]: c/(2f).

    Raises
    ------
    InputError
        If the frequency is not finite and positive.

    Examples
    --------
    >>> [round(unambiguous_range_m(f) / 1000, 1) for f in (10_000, 20_000, 40_000)]
    [15.0, 7.5, 3.7]
    """
    require_positive("pulse_repetition_hz", pulse_repetition_hz, "the pulse repetition frequency in hertz")
    return 0.5 * SPEED_OF_LIGHT_MPS / pulse_repetition_hz


def overlap_m(spacing_m: float, probe: Probe) -> float:
    """Length that two neighbouring gates have in common [m]; negative where there is a hole between them.

    Raises
    ------
    InputError
        If the spacing is not finite and positive.

    Examples
    --------
    >>> round(overlap_m(25.0, Probe(pulse_ns=200, window_ns=256)), 1)
    17.6
    """
    require_positive("spacing_m", spacing_m, "the distance between two gate centres in metres")
    return probe.length_m - spacing_m


def require_positive(name: str, value: float, meaning: str) -> None:
    """Refuse a number that is not finite and positive, in the user's words."""
    if not (math.isfinite(value) and value > 0):
        raise InputError(f"{name} is {value}: give {meaning}, greater than 0")


@lru_cache(maxsize=256)
def _full_width(pulse: float, window: float) -> float:
    """Full width at half maximum of a Gaussian (FWHM `pulse`) convolved with a rectangle (`window`)."""
    scale, half = math.sqrt(2.0) * pulse / FWHM_PER_STD, 0.5 * window
    target = math.erf(half / scale)
    low, high = half, half + scale  # w(half) is never under half the maximum, w(half + σ√2) never above
    for _ in range(60):
        middle = 0.5 * (low + high)
        excess = math.erfc((middle - half) / scale) - math.erfc((middle + half) / scale) - target
        low, high = (middle, high) if excess > 0 else (low, middle)
    return low + high


@lru_cache(maxsize=256)
def _gauss_rule(pulse_std_m: float, window_m: float, count: int) -> tuple[FloatArray, FloatArray]:
    """Gauss rule of the probe weighting from its Jacobi matrix, made symmetric and read-only."""
    gauss, gauss_weight = np.polynomial.hermite_e.hermegauss(count)
    box, box_weight = np.polynomial.legendre.leggauss(count)
    points = (pulse_std_m * gauss[:, None] + 0.5 * window_m * box).ravel()
    masses = np.outer(gauss_weight / gauss_weight.sum(), box_weight / 2.0).ravel()
    spread = math.sqrt(pulse_std_m**2 + window_m**2 / 12.0)
    off_diagonal = _lanczos(points / spread, masses, count)
    nodes, vectors = np.linalg.eigh(np.diag(off_diagonal, 1) + np.diag(off_diagonal, -1))
    weights = vectors[0] ** 2
    offset_m = 0.5 * spread * (nodes - nodes[::-1])
    weight = 0.5 * (weights + weights[::-1]) / weights.sum()
    offset_m.flags.writeable = weight.flags.writeable = False
    return offset_m, weight


def _lanczos(points: FloatArray, masses: FloatArray, count: int) -> FloatArray:
    """Off-diagonal of the Jacobi matrix of a symmetric discrete measure; its diagonal is zero."""
    basis = np.zeros((count, len(points)))
    basis[0] = np.sqrt(masses / masses.sum())
    off_diagonal = np.zeros(count - 1)
    for k in range(1, count):
        vector = points * basis[k - 1]
        for _ in range(2):  # twice is enough to keep the basis orthogonal to rounding
            vector = vector - basis[:k].T @ (basis[:k] @ vector)
        off_diagonal[k - 1] = np.linalg.norm(vector)
        basis[k] = vector / off_diagonal[k - 1]
    return off_diagonal


def _erfc(values: FloatArray) -> FloatArray:
    """Complementary error function, any shape."""
    if values.size < MANY_VALUES:
        return np.asarray(_short_erfc(values), dtype=np.float64)
    from scipy.special import erfc

    return np.asarray(erfc(values))
