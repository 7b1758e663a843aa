"""How strong the echo is, how noisy a radial speed is, and what more accumulation buys.

CNR is the wideband carrier-to-noise ratio of one pulse. The model is that of a collimated beam in its far field through hazy
air; near the head real instruments have a flatter signal, because the beam is focused.
"""

import math

import numpy as np

from geometry.arrays import ArrayLike, FloatArray
from geometry.errors import InputError

SPECTRAL_WIDTH_MPS = (
    2.0  # of the echo: turbulence in the probe and the pulse's own width; O'Connor et al. 2010
)
EXTINCTION_PER_M = 1e-4  # 40 km visibility at 1.5 um: clear lowland air
CNR_SPREAD_DB = (
    3.0  # of the aerosol's echo from hour to hour: a round number, to be replaced by the site's own
)
DB_PER_NEPER = 10.0 / math.log(10.0)


def cnr_db(
    range_m: ArrayLike,
    *,
    reference_db: float,
    reference_range_m: float,
    pulse_ratio: float = 1.0,
    extinction_per_m: float = EXTINCTION_PER_M,
) -> FloatArray:
    """Carrier-to-noise ratio of one pulse against range, from one known value.

    Parameters
    ----------
    range_m
        Slant range [m], above 0, any shape.
    reference_db, reference_range_m
        CNR [dB] that the instrument has at one range [m], in the site's air.
    pulse_ratio
        Length of the pulse over that of the reference: a longer pulse carries more energy.
    extinction_per_m
        Extinction of the air [1/m].

    Returns
    -------
    FloatArray
        CNR [dB], same shape.

    Raises
    ------
    InputError
        If a range is not above 0.

    Notes
    -----
    CNR ∝ E/R² exp(-2αR): the coherent lidar equation in the far field, e.g. Frehlich & Kavaya (1991), Appl. Opt. 30, 5325.

    Examples
    --------
    >>> cnr_db([1000.0, 2000.0], reference_db=-15.0, reference_range_m=1000.0, extinction_per_m=0.0).round(2)
    array([-15.  , -21.02])
    """
    distance = np.asarray(range_m, dtype=np.float64)
    if not np.all(distance > 0) or reference_range_m <= 0 or pulse_ratio <= 0:
        raise InputError(
            f"range {distance} m, reference {reference_range_m} m, pulse ratio {pulse_ratio}: all above 0"
        )
    spread = -20.0 * np.log10(distance / reference_range_m)
    absorbed = -2.0 * DB_PER_NEPER * extinction_per_m * (distance - reference_range_m)
    return np.asarray(reference_db + 10.0 * math.log10(pulse_ratio) + spread + absorbed)


def noise_mps(
    cnr_db: ArrayLike,
    *,
    pulses: float,
    points_per_gate: float,
    bandwidth_mps: float,
    width_mps: float = SPECTRAL_WIDTH_MPS,
) -> FloatArray:
    """Standard deviation of a radial speed against CNR and the number of pulses.

    Parameters
    ----------
    cnr_db
        CNR of one pulse [dB], any shape.
    pulses
        Pulses averaged in one ray: repetition frequency times accumulation.
    points_per_gate
        Samples of one gate (FFT points without padding).
    bandwidth_mps
        Range of speeds that can be told apart [m/s]: twice the largest.
    width_mps
        Spectral width of the echo [m/s].

    Returns
    -------
    FloatArray
        Standard deviation [m/s], same shape; never more than that of a speed drawn from anywhere in the band.

    Raises
    ------
    InputError
        If a number is not above 0.

    Notes
    -----
    σ² = √8 Δv² / (α N_p) (1 + α/√(2π))², α = SNR B/(√(2π) Δv) photons per speckle, N_p = M n SNR photons: Rye & Hardesty
    (1997), Appl. Opt. 36, 9425, doi:10.1364/AO.36.009425, in the approximation of O'Connor et al. (2010), J. Atmos.
    Oceanic Technol. 27, 1652, doi:10.1175/2010JTECHA1455.1.

    Examples
    --------
    >>> noise_mps([-20.0, -10.0], pulses=8000, points_per_gate=64, bandwidth_mps=60.0).round(3)
    array([0.142, 0.02 ])
    """
    if not (pulses > 0 and points_per_gate > 0 and bandwidth_mps > 0 and width_mps > 0):
        raise InputError(
            f"pulses {pulses}, points {points_per_gate}, bandwidth {bandwidth_mps} m/s, width {width_mps} m/s: all above 0"
        )
    snr = 10.0 ** (np.asarray(cnr_db, dtype=np.float64) / 10.0)
    photons = points_per_gate * pulses * snr
    per_speckle = snr * bandwidth_mps / (math.sqrt(2.0 * math.pi) * width_mps)
    saturation = 1.0 + per_speckle / math.sqrt(2.0 * math.pi)
    sigma = width_mps * 8.0**0.25 * saturation / np.sqrt(per_speckle * photons)
    return np.asarray(np.minimum(sigma, bandwidth_mps / math.sqrt(12.0)))


def valid_share(cnr_db: ArrayLike, *, least_db: float, spread_db: float = CNR_SPREAD_DB) -> FloatArray:
    """Share of rays whose CNR is above a limit, where CNR varies around its mean like a Gaussian in dB.

    Examples
    --------
    >>> valid_share([-25.0, -22.0, -16.0], least_db=-25.0).round(3)
    array([0.5  , 0.841, 0.999])
    """
    from scipy.special import ndtr

    if not spread_db > 0:
        raise InputError(f"a spread of the CNR of {spread_db} dB came; it has to be above 0")
    return np.asarray(ndtr((np.asarray(cnr_db, dtype=np.float64) - least_db) / spread_db))


def bought_noise(accumulation_ratio: float) -> float:
    """Noise after over noise before, where a ray accumulates longer: 1/√ratio, at any CNR.

    Examples
    --------
    >>> bought_noise(4.0)
    0.5
    """
    return 1.0 / math.sqrt(_above_zero(accumulation_ratio))


def bought_range(
    accumulation_ratio: float, range_m: float, *, extinction_per_m: float = EXTINCTION_PER_M
) -> float:
    """Range [m] at which a ray that accumulates longer is as noisy as it was at `range_m`, where the signal is weak.

    Weak signals have σ ∝ 1/(SNR √n), so the same noise allows the SNR to be lower by √ratio: R² exp(2αR) may grow by that.

    Examples
    --------
    >>> round(bought_range(4.0, 1000.0, extinction_per_m=0.0), 1), round(bought_range(4.0, 1000.0), 1)
    (1414.2, 1363.7)
    """
    allowed = 0.5 * math.log(_above_zero(accumulation_ratio))
    low, high = range_m * min(1.0, accumulation_ratio), range_m * max(1.0, accumulation_ratio)
    for _ in range(100):
        middle = 0.5 * (low + high)
        growth = 2.0 * math.log(middle / range_m) + 2.0 * extinction_per_m * (middle - range_m)
        low, high = (middle, high) if growth < allowed else (low, middle)
    return 0.5 * (low + high)


def _above_zero(ratio: float) -> float:
    if not (ratio > 0 and math.isfinite(ratio)):
        raise InputError(f"an accumulation ratio of {ratio} came; it has to be above 0")
    return ratio
