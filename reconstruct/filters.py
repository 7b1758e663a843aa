"""Filters on scans, each a pure function that returns what is left and a count of it.

Arrays (scan, ray) hold the rays of one gate, one column for each direction of the scan in clockwise order,
NaN where a ray is missing. What a filter takes away becomes NaN; nothing disappears without a count.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from geometry.angles import SectorSet
from geometry.arrays import ArrayLike, BoolArray, FloatArray
from geometry.errors import InputError
from geometry.scan import subset_rays
from geometry.sweeps import Motion
from reconstruct.retrieval import Retrieval

Limits = tuple[float | None, float | None]
"""Lowest and highest value that is kept; None: no limit on that side."""

OPEN: Limits = (None, None)


class Step(NamedTuple):
    """What one filter left."""

    name: str
    before: int
    after: int
    unit: str = "rays"

    @property
    def lost(self) -> int:
        """How many it took away."""
        return self.before - self.after

    @property
    def lost_share(self) -> float:
        """The same as a share of what came; 0 where nothing came."""
        return self.lost / self.before if self.before else 0.0

    def __add__(self, other: object) -> "Step":
        """The same step over two parts of a campaign."""
        if not isinstance(other, Step) or (other.name, other.unit) != (self.name, self.unit):
            return NotImplemented
        return Step(self.name, self.before + other.before, self.after + other.after, self.unit)


class Filtered(NamedTuple):
    """Values (...) with NaN for what was taken away, and the count."""

    values: FloatArray
    step: Step


def keep(values: FloatArray, kept: BoolArray, name: str) -> Filtered:
    """Keep some of the values, count them, and make NaN of the others.

    Examples
    --------
    >>> keep(np.array([1.0, 2.0, np.nan]), np.array([True, False, True]), "mine")
    Filtered(values=array([ 1., nan, nan]), step=Step(name='mine', before=2, after=1, unit='rays'))
    """
    there = np.isfinite(values)
    left = there & kept
    step = Step(name, int(np.count_nonzero(there)), int(np.count_nonzero(left)))
    return Filtered(np.where(left, values, np.nan), step)


def within(values: ArrayLike, limits: Limits) -> BoolArray:
    """Whether values lie within limits, the limits included; NaN does not unless both sides are open.

    Raises
    ------
    InputError
        If the lower limit is above the upper one.

    Examples
    --------
    >>> within([-30.0, -25.0, -5.0, np.nan], (-25.0, None))
    array([False,  True,  True, False])
    """
    low, high = limits
    if low is not None and high is not None and low > high:
        raise InputError(f"limits from {low:g} to {high:g} came: the lower one has to come first")
    checked = np.asarray(values, dtype=float)
    if low is None and high is None:
        return np.ones(checked.shape, dtype=bool)
    above = np.isfinite(checked) if low is None else checked >= low
    return np.asarray(above if high is None else above & (checked <= high))


def limit_cnr(radial_speed_mps: FloatArray, cnr_db: FloatArray, limits_db: Limits) -> Filtered:
    """Keep the rays whose carrier-to-noise ratio lies within limits [dB]; a usual range is -25 to -5.

    Examples
    --------
    >>> limit_cnr(np.array([5.0, 6.0]), np.array([-12.0, -28.0]), (-25.0, -5.0)).step
    Step(name='CNR', before=2, after=1, unit='rays')
    """
    return keep(radial_speed_mps, within(cnr_db, limits_db), "CNR")


def limit_radial_speed(radial_speed_mps: FloatArray, limits_mps: Limits) -> Filtered:
    """Keep the rays whose radial speed lies within limits [m/s], positive away.

    Examples
    --------
    >>> limit_radial_speed(np.array([5.0, -29.0]), (-20.0, 20.0)).values
    array([ 5., nan])
    """
    return keep(radial_speed_mps, within(radial_speed_mps, limits_mps), "radial speed")


def partial_scans(radial_speed_mps: FloatArray, *, ray_share: float = 1.0) -> Filtered:
    """Keep the scans (rows) of which at least a share of the rays is left, whole: 1 drops every partial scan.

    Parameters
    ----------
    radial_speed_mps : numpy.ndarray
        (scan, ray) [m/s].
    ray_share : float
        In (0, 1].

    Returns
    -------
    Filtered
        The step counts scans that have any ray.

    Raises
    ------
    InputError
        If the share is not in (0, 1].

    Examples
    --------
    >>> scans = np.array([[1.0, 2.0, 3.0, 4.0], [1.0, np.nan, 3.0, 4.0], [np.nan, np.nan, 1.0, 1.0]])
    >>> partial_scans(scans).step.after, partial_scans(scans, ray_share=0.75).step.after
    (1, 2)
    """
    if not 0 < ray_share <= 1:
        raise InputError(f"a share of the rays of {ray_share:g} came: give one above 0 and up to 1")
    left = np.count_nonzero(np.isfinite(radial_speed_mps), axis=-1)
    rays = radial_speed_mps.shape[-1]
    kept = (left > 0) & (left >= ray_share * rays - 1e-9)
    step = Step("partial scans", int(np.count_nonzero(left)), int(np.count_nonzero(kept)), "scans")
    return Filtered(np.where(kept[..., None], radial_speed_mps, np.nan), step)


def reduce_sector(rays: int, step_deg: float, sizes_deg: Sequence[float], *, motion: Motion) -> list[slice]:
    """The middle rays of a scan that stand for each of some sector sizes, as `geometry.scan.subset_rays`.

    Examples
    --------
    >>> reduce_sector(30, 2.0, [60.0, 8.0], motion="continuous")
    [slice(0, 30, None), slice(13, 18, None)]
    """
    return [subset_rays(rays, step_deg, size_deg, motion=motion) for size_deg in sizes_deg]


def limit_directions(values: FloatArray, from_deg: FloatArray, allowed: SectorSet) -> Filtered:
    """Keep the values whose wind comes from allowed directions, such as those free of wakes.

    Parameters
    ----------
    values : numpy.ndarray
        (...,) any quantity.
    from_deg : numpy.ndarray
        (...,) where the wind comes from [deg]; NaN is not allowed, unless every direction is.
    allowed : SectorSet
        The directions.

    Examples
    --------
    >>> allowed = SectorSet.of([])
    >>> limit_directions(np.array([8.0]), np.array([200.0]), allowed).step
    Step(name='direction', before=1, after=0, unit='rays')
    """
    everything = allowed.width_deg >= 360.0 - 1e-9
    known = np.isfinite(from_deg)
    inside = np.asarray(allowed.contains(np.where(known, from_deg, 0.0))) & known
    return keep(values, inside | everything, "direction")


def limit_speed(values: FloatArray, speed_mps: FloatArray, limits_mps: Limits) -> Filtered:
    """Keep the values whose wind speed [m/s] lies within limits.

    Examples
    --------
    >>> limit_speed(np.array([3.0, 8.0]), np.array([3.0, 8.0]), (4.0, 25.0)).values
    array([nan,  8.])
    """
    return keep(values, within(speed_mps, limits_mps), "speed")


def limit_availability(values: FloatArray, count: ArrayLike, *, expected: float, share: float) -> Filtered:
    """Keep the period means that enough scans stand behind.

    Parameters
    ----------
    values : numpy.ndarray
        (period,) means.
    count : array_like
        (period,) scans in each.
    expected : float
        Scans that a full period has, above 0.
    share : float
        Least share of them, 0 to 1; the study's 19 of 50 is 0.38.

    Raises
    ------
    InputError
        If the share is not in [0, 1] or nothing is expected.

    Examples
    --------
    >>> limit_availability(np.array([8.0, 9.0]), [19, 18], expected=50, share=0.38).step.after
    1
    """
    if not 0 <= share <= 1 or not expected > 0:
        raise InputError(
            f"a share of {share:g} of {expected:g} scans came: give a share from 0 to 1 of a positive number"
        )
    enough = np.asarray(count, dtype=float) >= share * expected - 1e-9
    return keep(values, enough, "availability")


class Goodness(NamedTuple):
    """How well the fitted wind explains the rays of each scan; NaN where no ray is to spare."""

    residual_std_mps: FloatArray  # (...,) root of the squared residuals over the rays to spare
    r_squared: FloatArray  # (...,) 1 - squared residuals over the squares about the scan's mean radial speed
    reduced_chi2: FloatArray  # (...,) squared residuals over the rays to spare and the noise's variance


def goodness(
    fit: Retrieval, radial_speed_mps: FloatArray, *, noise_mps: float, weights: FloatArray | None = None
) -> Goodness:
    """Judge the fit of each scan.

    Parameters
    ----------
    fit : Retrieval
        Of each scan.
    radial_speed_mps : numpy.ndarray
        (..., ray) what was fitted [m/s].
    noise_mps : float
        Standard deviation of one radial speed [m/s], above 0: the instrument's, and turbulence if it is to
        count as noise. Of weighted rays that of one of weight one.
    weights : numpy.ndarray, optional
        (..., ray) with which the rays were fitted; default: all alike.

    Notes
    -----
    r² of a narrow sector is low even when the fit is good: the wind hardly differs from ray to ray there, so
    that all is noise. The reduced χ² (Bevington & Robinson 2003, Data Reduction and Error
    Analysis) has no such trouble, but turbulence makes it large. For a filter the residual's own size is the
    plainest.

    Examples
    --------
    >>> from reconstruct.sector_scan import sector_wind
    >>> speed = np.array([8.6603, 7.0711, 5.0])
    >>> good = goodness(sector_wind([75.0, 90.0, 105.0], 0.0, speed), speed, noise_mps=0.1)
    >>> round(float(good.r_squared), 6), round(float(good.reduced_chi2), 6)
    (1.0, 0.0)
    """
    if not noise_mps > 0:
        raise InputError(
            f"a noise of {noise_mps:g} m/s came: give the standard deviation of a radial speed, above 0"
        )
    columns = fit.wind_mps.shape[-1]
    known = np.isfinite(radial_speed_mps)
    weight = known.astype(float) if weights is None else np.where(known, weights, 0.0)
    rays, whole = np.count_nonzero(weight, axis=-1), np.sum(weight, axis=-1)
    mean = np.sum(weight * radial_speed_mps, axis=-1, where=known) / np.where(whole > 0, whole, 1.0)
    about = np.sum(weight * np.square(radial_speed_mps - mean[..., None]), axis=-1, where=known)
    squares = np.square(fit.residual_std_mps) * (rays - columns)
    with np.errstate(divide="ignore", invalid="ignore"):
        explained = np.where(about > 0, 1.0 - squares / about, np.nan)
    return Goodness(fit.residual_std_mps, explained, np.square(fit.residual_std_mps / noise_mps))


def limit_goodness(
    values: FloatArray,
    good: Goodness,
    *,
    residual_std_mps: float | None = None,
    r_squared: float | None = None,
    reduced_chi2: float | None = None,
) -> Filtered:
    """Keep the scans whose fit is good enough; a scan without a ray to spare passes, since nothing is known.

    Parameters
    ----------
    values : numpy.ndarray
        (scan,) any quantity.
    good : Goodness
        Of each scan.
    residual_std_mps, reduced_chi2 : float, optional
        Largest that is kept.
    r_squared : float, optional
        Smallest that is kept.

    Examples
    --------
    >>> good = Goodness(np.array([0.3, 2.5]), np.array([0.99, 0.2]), np.array([9.0, 625.0]))
    >>> limit_goodness(np.array([8.0, 9.0]), good, residual_std_mps=1.0).values
    array([ 8., nan])
    """
    kept = np.ones(values.shape, dtype=bool)
    for measured, limits in (
        (good.residual_std_mps, (None, residual_std_mps)),
        (good.r_squared, (r_squared, None)),
        (good.reduced_chi2, (None, reduced_chi2)),
    ):
        kept &= within(measured, limits) | np.isnan(measured)
    filtered = keep(values, kept, "goodness of fit")
    return Filtered(filtered.values, filtered.step._replace(unit="scans"))
