"""A lidar's period means against a mast's: slopes, scatter, and what the reference study's tables print.

Mast first: the fit is mast = slope · lidar, and a residual is mast - slope · lidar, as in the study (Simon
2015, Tables 10 and 11). Bias, where it stands, is lidar - mast.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from geometry.angles import circular_mean_deg, difference_deg, wrap_180_deg
from geometry.arrays import ArrayLike, FloatArray, IntArray
from geometry.errors import InputError

MIN_PAIRS = 2
_JACKKNIFE_BLOCKS = 20


class SpeedFit(NamedTuple):
    """Regression mast = slope · lidar of speeds, through the origin."""

    pairs: int
    slope: float
    slope_standard_error: float  # from leaving out blocks of consecutive pairs
    r_squared: float  # centred: 1 - squared residuals over the squares of the mast about its mean
    r_squared_uncentred: float  # 1 - squared residuals over the squares of the mast, as the study has it
    residual_median_mps: float
    residual_mean_mps: float
    residual_std_mps: float  # about its mean, n - 1
    bias_mps: float  # lidar - mast
    std_mps: float  # of lidar - mast about the bias
    residual_std_standard_error_mps: float  # as of the slope


class DirectionFit(NamedTuple):
    """Regression mast = slope · lidar + intercept of directions."""

    pairs: int
    slope: float
    intercept_deg: float
    r_squared: float
    residual_median_deg: float
    residual_std_deg: float
    bias_deg: float  # circular mean of lidar - mast
    std_deg: float  # of lidar - mast about it
    residual_std_standard_error_deg: float  # from leaving out blocks of consecutive pairs


def fit_speed(mast_mps: ArrayLike, lidar_mps: ArrayLike, *, blocks: int = _JACKKNIFE_BLOCKS) -> SpeedFit:
    """Fit mast = slope · lidar through the origin.

    Parameters
    ----------
    mast_mps, lidar_mps : array_like
        (period,) means of the same periods [m/s], in the order of time; NaN in either: left out.
    blocks : int
        Parts of consecutive pairs for the standard error of the slope.

    Returns
    -------
    SpeedFit
        NaN throughout where fewer than two pairs are left.

    Notes
    -----
    a = Σ mast·lidar / Σ lidar² minimises Σ (mast - a·lidar)². Its standard error is a jackknife over blocks
    of consecutive pairs (Efron & Stein 1981, Ann. Statist. 9, 586-596, doi:10.1214/aos/1176345462, eq. 1.4 and
    1.5), which bears with scatter that grows with the wind and with pairs that hang together.

    Examples
    --------
    >>> fit = fit_speed([2.0, 4.0, 6.0], [1.0, 2.0, 3.0])
    >>> fit.pairs, round(fit.slope, 6), round(fit.r_squared, 6)
    (3, 2.0, 1.0)
    """
    mast, lidar = _pairs(mast_mps, lidar_mps)
    if len(mast) < MIN_PAIRS or not np.any(lidar):
        return SpeedFit(len(mast), *[float("nan")] * 10)
    slope = _through_origin(mast, lidar)
    residual = mast - slope * lidar
    squares = float(residual @ residual)
    return SpeedFit(
        pairs=len(mast),
        slope=slope,
        slope_standard_error=_jackknife(mast, lidar, min(blocks, len(mast))),
        residual_std_standard_error_mps=_jackknife_of(_residual_std, mast, lidar, min(blocks, len(mast))),
        r_squared=_share(squares, float(np.sum(np.square(mast - np.mean(mast))))),
        r_squared_uncentred=_share(squares, float(mast @ mast)),
        residual_median_mps=float(np.median(residual)),
        residual_mean_mps=float(np.mean(residual)),
        residual_std_mps=float(np.std(residual, ddof=1)),
        bias_mps=float(np.mean(lidar - mast)),
        std_mps=float(np.std(lidar - mast, ddof=1)),
    )


def fit_direction(mast_deg: ArrayLike, lidar_deg: ArrayLike) -> DirectionFit:
    """Fit mast = slope · lidar + intercept to directions, on the circle.

    Parameters
    ----------
    mast_deg, lidar_deg : array_like
        (period,) directions of the same periods [deg]; NaN in either: left out.

    Returns
    -------
    DirectionFit

    Notes
    -----
    The lidar's directions are unwrapped to within 180 degrees of their circular mean, and each of the mast's
    to within 180 degrees of its own partner; then the ordinary least squares. Two degrees across north are
    two degrees. Where the wind comes from all around, slope and intercept still depend on where the circle is
    cut, opposite the mean; bias and scatter never do.

    Examples
    --------
    >>> fit = fit_direction([358.0, 2.0, 6.0], [356.0, 0.0, 4.0])
    >>> round(fit.slope, 6), round(fit.intercept_deg, 6), round(fit.bias_deg, 6)
    (1.0, 2.0, -2.0)
    """
    mast, lidar = _pairs(mast_deg, lidar_deg)
    if len(mast) < MIN_PAIRS:
        return DirectionFit(len(mast), *[float("nan")] * 8)
    centre = float(circular_mean_deg(lidar))
    centre = 180.0 if np.isnan(centre) else centre
    across = centre + np.asarray(wrap_180_deg(lidar - centre))
    return _line(across + np.asarray(difference_deg(mast, lidar)), across, mast, lidar)


def fit_direction_plainly(mast_deg: ArrayLike, lidar_deg: ArrayLike) -> DirectionFit:
    """The same as if degrees were numbers on a line: the reference study's way, for comparison with it.

    Examples
    --------
    >>> fit = fit_direction_plainly([122.9, 225.3], [124.0, 224.0])
    >>> round(fit.slope, 3), round(fit.intercept_deg, 3)
    (1.024, -4.076)
    """
    mast, lidar = _pairs(mast_deg, lidar_deg)
    if len(mast) < MIN_PAIRS:
        return DirectionFit(len(mast), *[float("nan")] * 8)
    return _line(mast, lidar, mast, lidar)


@dataclass(frozen=True)
class ByDirection:
    """Residuals sorted by where the wind comes from: a turbine's wake shows as a dent."""

    from_deg: FloatArray  # (bin,) middles
    count: IntArray  # (bin,)
    median: FloatArray  # (bin,) NaN where there is none
    lower: FloatArray  # (bin,) quartiles
    upper: FloatArray


def residual_by_direction(from_deg: ArrayLike, residual: ArrayLike, *, bin_deg: float = 10.0) -> ByDirection:
    """Median and quartiles of residuals in bins of direction.

    Parameters
    ----------
    from_deg : array_like
        (period,) where the wind comes from [deg].
    residual : array_like
        (period,) in any unit.
    bin_deg : float
        Width of a bin [deg], a divisor of 360; the first begins at north.

    Raises
    ------
    InputError
        If the bins do not fill the circle.

    Examples
    --------
    >>> found = residual_by_direction([5.0, 7.0, 365.0], [1.0, 2.0, 3.0], bin_deg=180.0)
    >>> found.count.tolist(), found.median.tolist()
    ([3, 0], [2.0, nan])
    """
    bins = round(360.0 / bin_deg) if bin_deg > 0 else 0
    if bins < 1 or abs(bins * bin_deg - 360.0) > 1e-9:
        raise InputError(f"bins of {bin_deg:g} degrees came: give a divisor of 360, such as 10")
    direction, values = _pairs(from_deg, residual)
    place = np.minimum(np.mod(direction, 360.0) // bin_deg, bins - 1).astype(np.intp)
    cut = np.full((3, bins), np.nan)
    for number in np.unique(place):
        cut[:, number] = np.quantile(values[place == number], [0.25, 0.5, 0.75])
    middles = (np.arange(bins) + 0.5) * bin_deg
    counts = np.bincount(place, minlength=bins).astype(np.intp)
    return ByDirection(np.asarray(middles, dtype=float), counts, cut[1], cut[0], cut[2])


class WeibullFit(NamedTuple):
    """A Weibull distribution of speeds."""

    scale_mps: float
    shape: float


def fit_weibull(speed_mps: ArrayLike) -> WeibullFit:
    """Fit a Weibull distribution to speeds by maximum likelihood.

    Parameters
    ----------
    speed_mps : array_like
        Speeds [m/s]; those that are not above 0 are left out.

    Returns
    -------
    WeibullFit
        NaN where fewer than two different speeds are left.

    Notes
    -----
    The shape k solves Σ V^k ln V / Σ V^k - 1/k = mean ln V, and A = (mean V^k)^(1/k) (Seguro & Lambert 2000,
    J. Wind Eng. Ind. Aerodyn. 85, 75-84, doi:10.1016/S0167-6105(99)00122-1). The left side rises with k,
    so that bisection always finds it.

    Examples
    --------
    >>> quantile = (np.arange(2000) + 0.5) / 2000
    >>> fit = fit_weibull(8.9 * (-np.log(1 - quantile)) ** (1 / 2.75))
    >>> round(fit.scale_mps, 2), round(fit.shape, 2)
    (8.9, 2.75)
    """
    speed = np.asarray(speed_mps, dtype=float)
    speed = speed[np.isfinite(speed) & (speed > 0)]
    if len(np.unique(speed)) < 2:
        return WeibullFit(float("nan"), float("nan"))
    logarithm = np.log(speed / np.max(speed))  # powers of at most 1 cannot overflow

    def excess(shape: float) -> float:
        power = np.exp(shape * logarithm)
        return float(power @ logarithm / np.sum(power) - 1 / shape - np.mean(logarithm))

    low, high = 1e-3, 1.0
    while excess(high) < 0:
        high *= 2
    for _ in range(80):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if excess(middle) < 0 else (low, middle)
    scale = float(np.max(speed)) * float(np.mean(np.exp(high * logarithm))) ** (1 / high)
    return WeibullFit(scale, high)


class Residuals(NamedTuple):
    """Residuals of one comparison, a value a pair."""

    speed_mps: FloatArray  # (period,) mast - slope · lidar
    direction_deg: FloatArray  # (period,) mast - lidar by the shorter way


def residuals(
    mast_mps: FloatArray, lidar_mps: FloatArray, mast_deg: FloatArray, lidar_deg: FloatArray
) -> Residuals:
    """Residuals of speed about the line through the origin, and of direction about equality.

    Examples
    --------
    >>> one = np.array([1.0, 2.0])
    >>> residuals(2 * one, one, np.array([359.0, 1.0]), np.array([1.0, 1.0])).direction_deg
    array([-2.,  0.])
    """
    fit = fit_speed(mast_mps, lidar_mps)
    return Residuals(mast_mps - fit.slope * lidar_mps, np.asarray(difference_deg(mast_deg, lidar_deg)))


def _pairs(first: ArrayLike, second: ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Values of which both partners are there."""
    one, other = np.asarray(first, dtype=float), np.asarray(second, dtype=float)
    if one.shape != other.shape or one.ndim != 1:
        raise InputError(f"values {one.shape} and {other.shape} came: one of each per period is needed")
    known = np.isfinite(one) & np.isfinite(other)
    return one[known], other[known]


def _through_origin(mast: FloatArray, lidar: FloatArray) -> float:
    return float(mast @ lidar / (lidar @ lidar))


def _share(squares: float, whole: float) -> float:
    return 1.0 - squares / whole if whole > 0 else float("nan")


def _jackknife(mast: FloatArray, lidar: FloatArray, blocks: int) -> float:
    """Standard error of the slope; sums without each block, so that nothing is fitted again."""
    edges = np.linspace(0, len(mast), blocks + 1).round().astype(int)[:-1]
    product = np.add.reduceat(mast * lidar, edges)
    square = np.add.reduceat(np.square(lidar), edges)
    left = np.sum(square) - square
    if not np.all(left > 0):
        return float("nan")
    slopes = (np.sum(product) - product) / left
    return float(np.sqrt((1 - 1 / blocks) * np.sum(np.square(slopes - np.mean(slopes)))))


def _jackknife_of(
    statistic: Callable[[FloatArray, FloatArray], float], one: FloatArray, other: FloatArray, blocks: int
) -> float:
    """Standard error of any statistic of pairs, made anew without each block."""
    parts = np.array_split(np.arange(len(one)), blocks)
    if len(one) - max(map(len, parts)) < MIN_PAIRS:
        return float("nan")
    each = np.array([statistic(np.delete(one, part), np.delete(other, part)) for part in parts])
    return float(np.sqrt((1 - 1 / blocks) * np.sum(np.square(each - np.mean(each)))))


def _residual_std(mast: FloatArray, lidar: FloatArray) -> float:
    return float(np.std(mast - _through_origin(mast, lidar) * lidar, ddof=1))


def _line_residual_std(y: FloatArray, x: FloatArray) -> float:
    """About the ordinary least squares of y on x."""
    about_x, about_y = x - np.mean(x), y - np.mean(y)
    spread = float(about_x @ about_x)
    if not spread > 0:
        return float("nan")
    return float(np.std(about_y - float(about_x @ about_y) / spread * about_x, ddof=1))


def _line(y: FloatArray, x: FloatArray, mast: FloatArray, lidar: FloatArray) -> DirectionFit:
    """Ordinary least squares of unwrapped directions y on x, and the error lidar - mast on the circle."""
    about_x, about_y = x - np.mean(x), y - np.mean(y)
    spread = float(about_x @ about_x)
    slope = float(about_x @ about_y) / spread if spread > 0 else float("nan")
    intercept = float(np.mean(y) - slope * np.mean(x))
    residual = y - intercept - slope * x
    error = np.asarray(difference_deg(lidar, mast))
    bias = float(wrap_180_deg(circular_mean_deg(error)))
    return DirectionFit(
        pairs=len(x),
        slope=slope,
        intercept_deg=intercept,
        r_squared=_share(float(residual @ residual), float(about_y @ about_y)),
        residual_median_deg=float(np.median(residual)),
        residual_std_deg=float(np.std(residual, ddof=1)),
        bias_deg=bias,
        std_deg=float(np.sqrt(np.sum(np.square(difference_deg(error, bias))) / (len(error) - 1))),
        residual_std_standard_error_deg=_jackknife_of(
            _line_residual_std, y, x, min(_JACKKNIFE_BLOCKS, len(x))
        ),
    )
