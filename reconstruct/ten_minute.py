"""The ten-minute mean of a scan against an instrument at the target: bias, scatter and how the two hang
together.

Everything random is Gaussian in the wind *vector*: turbulence seen by the rays, turbulence at the target,
noise. The means compared are of *speeds*, so that each covariance goes through `reconstruct.joint`.
Stationarity leaves a sum over the lags between scans instead of one over all pairs.

Three kinds of error of a ray are told apart: turbulence hangs together from scan to scan and with the target;
random errors (noise, pointing jitter) are drawn anew for every ray; persistent errors (heading, levelling,
calibration) are drawn once for the whole campaign.
"""

from collections.abc import Iterator, Sequence
from typing import Literal, NamedTuple

import numpy as np

from geometry.arrays import ArrayLike, FloatArray
from geometry.errors import InputError
from reconstruct.clocks import early_and_late
from reconstruct.covariance import wind_frame
from reconstruct.joint import expand, speed_covariance
from reconstruct.moments import WindMoments, wind_moments
from reconstruct.periods import TEN_MINUTES_S
from reconstruct.ray_fit import ray_fit, ray_rows
from reconstruct.rays import Rays
from reconstruct.retrieval import gain
from reconstruct.scan_means import (
    Period,
    PointMean,
    ScanMean,
    point_mean,
    scan_mean,
    scan_with_target,
    through,
)
from reconstruct.spectra import Turbulence
from reconstruct.thinning import MOST_RAYS, thinned
from reconstruct.wind import WindState

Reference = Literal["scalar", "vector"]

TOGETHER = (
    2**14
)  # pairs of rays of all winds that are worked out at once, for every lag: some tens of megabytes


class TenMinute(NamedTuple):
    """Ten-minute means of lidar and reference, over many such periods of one state of the wind; (...) is the
    size axis.

    Speeds are scalar means of the scans' speeds, as the reference study took them; directions those of vector
    means.
    """

    scans: float  # scans that take part in one mean
    lidar_mean_mps: FloatArray  # (...) expected mean speed
    reference_mean_mps: FloatArray  # (...) same for all sizes
    lidar_variance_m2s2: FloatArray  # (...) of the ten-minute means
    reference_variance_m2s2: FloatArray  # (...)
    covariance_m2s2: FloatArray  # (...) of the two means
    vector_covariance_m2s2: FloatArray  # (..., 2, 2) of lidar minus reference, mean vectors east and north
    mean_error_mps: FloatArray  # (..., 2) of the mean vector, east and north
    reference_direction_std_deg: float  # of the ten-minute mean at the target
    direction_covariance_deg2: FloatArray  # (...) of the directions of lidar and reference, to first order
    moments: WindMoments  # of the lidar's mean vector against the reference's

    @property
    def speed_bias_mps(self) -> FloatArray:
        """Lidar minus reference, expected [m/s]."""
        return self.lidar_mean_mps - self.reference_mean_mps

    @property
    def speed_std_mps(self) -> FloatArray:
        """Standard deviation of lidar minus reference [m/s]."""
        return self.scatter_std_mps(1.0)

    @property
    def direction_bias_deg(self) -> FloatArray:
        """Lidar minus reference, expected [degrees]."""
        return self.moments.direction_bias_deg

    @property
    def direction_std_deg(self) -> FloatArray:
        """Standard deviation of lidar minus reference [degrees]."""
        return self.moments.direction_std_deg

    def scatter_std_mps(self, slope: float) -> FloatArray:
        """Standard deviation of reference - slope · lidar [m/s]."""
        square = (
            self.reference_variance_m2s2
            - 2 * slope * self.covariance_m2s2
            + slope**2 * self.lidar_variance_m2s2
        )
        return np.asarray(np.sqrt(np.clip(square, 0.0, None)))


def predict_ten_minute(
    rays: Rays,
    wind: WindState,
    turbulence: Turbulence,
    *,
    gains: FloatArray | None = None,
    random_m2s2: ArrayLike = 0.0,
    persistent_m2s2: ArrayLike = 0.0,
    mean_error_mps: ArrayLike = (0.0, 0.0),
    reference: Reference = "scalar",
    averaging_s: float = TEN_MINUTES_S,
    scan_share: float = 1.0,
    sweep: bool = True,
    clock_s: ArrayLike = 0.0,
) -> TenMinute:
    """Predict the mean over ten minutes of a scan, or of several cut from it, against a point at the target.

    Parameters
    ----------
    rays
        Rays of one scan.
    wind
        Mean wind at the target.
    turbulence
        Model, intensity and length.
    gains
        (..., 2, ray) matrices that take radial speeds to east and north wind: one for each sector cut from
        the scan, zero for rays left out (see `subset_gains`). Without it the whole scan.
    random_m2s2
        (ray, ray) covariance of the errors drawn anew for every scan [m²/s²]; a number stands for white
        noise.
    persistent_m2s2
        The same for the errors that all scans share [m²/s²], see `persistence.split_covariance`.
    mean_error_mps
        (..., 2) mean error of the retrieved wind, east and north [m/s]: vertical wind, shear, gradients.
    reference
        "scalar": mean of the speeds at the target, a cup; "vector": speed of the mean vector, as of a sonic.
    averaging_s
        Averaging time [s].
    scan_share
        Share of the scans that are valid, above 0 to 1, lost at random.
    sweep
        Average over the head's turn and the air's way during each ray.
    clock_s
        Standard deviation of the lidars' clocks against that of the reference, one for all or (lidar,) [s]: what is
        averaged carries the same stamps and is other air. The correlation with the target is sampled finely near the
        middle of the rays: right to 1e-3 of the variance for clocks up to an eddy's passage (length over speed) off.

    Returns
    -------
    TenMinute
        With the leading axes of `gains`; NaN where a gain is NaN.

    Raises
    ------
    InputError
        If no scan fits into the averaging time, or the share is not above 0 and up to 1.

    Examples
    --------
    >>> from geometry.gates import Probe
    >>> azimuth = np.arange(-29.0, 30.0, 2.0)
    >>> scan = Rays(azimuth_deg=azimuth, elevation_deg=np.zeros(30), range_m=np.full(30, 1000.0),
    ...     head_m=np.tile([0.0, -1000.0, 0.0], (30, 1)), lidar=np.zeros(30, dtype=int),
    ...     time_s=0.4 * np.arange(30) + 0.2,
    ...     duration_s=np.full(30, 0.4), swept_azimuth_deg=np.full(30, 2.0), probes=(Probe(pulse_ns=200,
    ...     window_ns=256),),
    ...     period_s=12.0, back_and_forth=True)
    >>> mean = predict_ten_minute(scan, WindState(8.0, 180.0), Turbulence(0.09, 170.0), random_m2s2=0.01)
    >>> mean.scans, round(float(mean.speed_std_mps), 2)
    (50.0, 0.14)
    """
    return predict_ten_minutes(
        rays,
        [wind],
        turbulence,
        gains=gains,
        random_m2s2=[random_m2s2],
        persistent_m2s2=persistent_m2s2,
        mean_error_mps=[mean_error_mps],
        reference=reference,
        averaging_s=averaging_s,
        scan_share=scan_share,
        sweep=sweep,
        clock_s=clock_s,
    )[0]


def predict_ten_minutes(
    rays: Rays,
    winds: Sequence[WindState],
    turbulence: Turbulence,
    *,
    gains: FloatArray | None = None,
    random_m2s2: Sequence[ArrayLike] | None = None,
    persistent_m2s2: ArrayLike = 0.0,
    mean_error_mps: Sequence[ArrayLike] | None = None,
    reference: Reference = "scalar",
    averaging_s: float = TEN_MINUTES_S,
    scan_share: float = 1.0,
    sweep: bool = True,
    clock_s: ArrayLike = 0.0,
) -> list[TenMinute]:
    """Predict `predict_ten_minute` for several states of the wind: those of one speed are worked out together.

    Parameters
    ----------
    rays, turbulence, gains, persistent_m2s2, reference, averaging_s, scan_share, sweep, clock_s
        See `predict_ten_minute`.
    winds
        States.
    random_m2s2, mean_error_mps
        For each state what `predict_ten_minute` takes; none without.

    Returns
    -------
    list of TenMinute
        One for each state.
    """
    fits = ray_fit(rays).gain if gains is None else gains
    random = [0.0] * len(winds) if random_m2s2 is None else random_m2s2
    offset = [np.zeros(2)] * len(winds) if mean_error_mps is None else mean_error_mps
    clocks = early_and_late(rays, clock_s)
    out: dict[int, TenMinute] = {}
    for group in _alike(winds, rays.count):
        some = [winds[index] for index in group]
        errors = ([random[index] for index in group], persistent_m2s2, [offset[index] for index in group])
        each = [
            _means(
                _checked(Period(late, some, turbulence, averaging_s, scan_share, sweep)),
                fits,
                *errors,
                reference,
            )
            for late in clocks
        ]
        out.update((index, _mixed(winds[index], means)) for index, *means in zip(group, *each, strict=True))
    return [out[index] for index in range(len(winds))]


def _mixed(wind: WindState, means: list[TenMinute]) -> TenMinute:
    """The mean of predictions for clocks as likely as each other."""
    if len(means) == 1:
        return means[0]
    fields = [name for name in TenMinute._fields if name != "moments"]
    mean = {name: np.mean([getattr(each, name) for each in means], axis=0) for name in fields}
    moments = wind_moments(wind.uv_mps, mean["vector_covariance_m2s2"], mean_error_mps=mean["mean_error_mps"])
    return TenMinute(**mean, moments=moments)


def _alike(winds: Sequence[WindState], rays: int) -> Iterator[list[int]]:
    """Places of states with one speed, as many at once as memory allows."""
    most = max(1, TOGETHER // min(rays, MOST_RAYS) ** 2)
    speeds = np.array([wind.speed_mps for wind in winds])
    for speed in dict.fromkeys(speeds.tolist()):
        same = np.flatnonzero(speeds == speed).tolist()
        yield from (same[start : start + most] for start in range(0, len(same), most))


def _means(
    period: Period,
    gains: FloatArray,
    random_m2s2: list[ArrayLike],
    persistent_m2s2: ArrayLike,
    mean_error_mps: list[ArrayLike],
    reference: Reference,
) -> list[TenMinute]:
    """Means of all winds of a period."""
    turns = np.stack([wind_frame(wind.from_deg)[:2, :2] for wind in period.winds])
    shape = gains.shape[:-2]
    matrix, known = _fits(gains.reshape(-1, *gains.shape[-2:]), turns)
    offset = np.stack([np.broadcast_to(each, (*shape, 2)) for each in mean_error_mps]).reshape(
        *known.shape, 2
    )
    errors = [_wind_covariance(part, each) for part, each in zip(matrix, random_m2s2, strict=True)]
    persistent = _wind_covariance(matrix, persistent_m2s2)
    few, matrix = thinned(period.rays, matrix)
    period = period._replace(rays=few)
    vector = np.array([period.speed_mps, 0.0]) + np.einsum("wij,wsj->wsi", turns, offset)
    lidar = scan_mean(period, matrix, vector, np.stack(errors), persistent)
    point = point_mean(period)
    cross, weight = scan_with_target(period, matrix)
    against = _against_cup if reference == "scalar" else _against_sonic
    mean, variance, covariance = against(period, lidar, point, cross, weight)
    lost = np.where(known, 0.0, np.nan)
    vectors = _Vectors.of(lidar, point, np.einsum("pt,...ptij->...ij", weight, cross), turns, lost)
    degrees = np.degrees(1.0) / period.speed_mps if period.speed_mps > 0 else np.nan
    truth = np.stack([wind.uv_mps for wind in period.winds])[:, None]
    moments = wind_moments(truth, vectors.difference_m2s2, mean_error_mps=offset)

    def of(index: int, values: FloatArray) -> FloatArray:
        """One wind, with the axes of the gains."""
        return np.asarray(values[index].reshape((*shape, *values.shape[2:])))

    return [
        TenMinute(
            scans=period.scan_share * period.scans,
            lidar_mean_mps=of(index, lidar.mean_mps + lost),
            reference_mean_mps=np.broadcast_to(mean, shape),
            lidar_variance_m2s2=of(index, lidar.variance_m2s2 + lost),
            reference_variance_m2s2=np.broadcast_to(variance, shape),
            covariance_m2s2=of(index, covariance + lost),
            vector_covariance_m2s2=of(index, vectors.difference_m2s2),
            mean_error_mps=of(index, offset),
            reference_direction_std_deg=float(degrees * np.sqrt(point.vector_variance_m2s2[1])),
            direction_covariance_deg2=of(index, degrees**2 * vectors.across_m2s2),
            moments=WindMoments(*(of(index, values) for values in moments)),
        )
        for index in range(len(period.winds))
    ]


def subset_gains(rays: Rays, kept: list[slice]) -> FloatArray:
    """Matrices (size, 2, ray) of fits that use some of a scan's rays, zero for the others.

    Examples
    --------
    >>> from geometry.gates import Probe
    >>> scan = Rays(azimuth_deg=np.array([0.0, 45.0, 90.0]), elevation_deg=np.zeros(3), range_m=np.full(3,
    ...     1000.0),
    ...     head_m=np.zeros((3, 3)), lidar=np.zeros(3, dtype=int), time_s=np.arange(3.0),
    ...     duration_s=np.ones(3),
    ...     swept_azimuth_deg=np.zeros(3), probes=(Probe(pulse_ns=200, window_ns=256),), period_s=3.0)
    >>> subset_gains(scan, [slice(0, 3), slice(0, 2)])[1].round(3) + 0.0
    array([[-1.   ,  1.414,  0.   ],
           [ 1.   ,  0.   ,  0.   ]])
    """
    matrix = ray_rows(rays)
    out = np.zeros((len(kept), 2, rays.count))
    for index, part in enumerate(kept):
        out[index, :, part] = gain(matrix[part])[:2]
    return out


class _Vectors(NamedTuple):
    """Mean vectors of lidar and target."""

    difference_m2s2: FloatArray  # (..., 2, 2) covariance of lidar minus target, east and north
    across_m2s2: FloatArray  # (...) covariance of the two components across the wind

    @classmethod
    def of(
        cls, lidar: ScanMean, point: PointMean, cross: FloatArray, turns: FloatArray, lost: FloatArray
    ) -> "_Vectors":
        both = cross + np.swapaxes(cross, -1, -2)
        difference = lidar.vector_covariance_m2s2 - both + np.diag(point.vector_variance_m2s2)
        turned = np.einsum("wki,wskl,wlj->wsij", turns, difference, turns)
        return cls(turned + lost[..., None, None], cross[..., 1, 1] + lost)


def _checked(period: Period) -> Period:
    if not 0 < period.scan_share <= 1:
        raise InputError(f"a share of {period.scan_share} valid scans came; allowed is above 0, up to 1")
    if period.scans < 1:
        raise InputError(
            f"a scan of {period.rays.period_s} s does not fit into {period.averaging_s} s: "
            "shorten the scan or average longer"
        )
    return period


def _fits(gains: FloatArray, turns: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Fits (wind, size, 1, 2, ray) to downwind and left, 0 where they are not known, and where they are."""
    known = np.all(np.isfinite(gains), axis=(-2, -1))
    matrix = turns[:, None] @ np.where(known[:, None, None], gains, 0.0)
    return matrix[:, :, None], np.broadcast_to(known, matrix.shape[:2])


def _wind_covariance(matrix: FloatArray, ray_errors_m2s2: ArrayLike) -> FloatArray:
    """Covariance (..., 1, 2, 2) from errors of the rays: one variance, one a ray, or their covariance."""
    given = np.asarray(ray_errors_m2s2, dtype=float)
    return through(matrix, given) if given.ndim == 2 else (matrix * given) @ np.swapaxes(matrix, -1, -2)


Moments = tuple[FloatArray, FloatArray, FloatArray]


def _against_cup(
    period: Period, lidar: ScanMean, point: PointMean, cross: FloatArray, weight: FloatArray
) -> Moments:
    """Mean and variance of the mean of the speeds at the target, and its covariance with the lidar's."""
    del period  # the speed at one moment is expanded already
    values = speed_covariance(lidar.lidar.at((..., slice(None), None)), point.speed, cross)
    return point.mean_mps, point.variance_m2s2, np.einsum("pt,...pt->...", weight, values)


def _against_sonic(
    period: Period, lidar: ScanMean, point: PointMean, cross: FloatArray, weight: FloatArray
) -> Moments:
    """Mean and variance of the speed of the target's mean vector, and its covariance with the lidar."""
    averaged = expand(np.array([period.speed_mps, 0.0]), np.diag(point.vector_variance_m2s2))
    share = period.pass_share
    each = np.einsum("pt,...ptij->...pij", weight / np.where(share > 0, share, 1.0)[:, None], cross)
    values = speed_covariance(lidar.lidar, averaged, each)
    return averaged.mean_mps, averaged.variance_m2s2, np.einsum("p,...p->...", share, values)
