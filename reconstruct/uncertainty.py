"""What pointing, ranging, levelling, position and calibration do to a retrieved wind: sources, covariance,
budget.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import NamedTuple

import numpy as np

from geometry.arrays import FloatArray
from geometry.beams import unit_vector
from geometry.errors import InputError
from reconstruct import responses
from reconstruct.radial_speed import gradient_per_s, power_law_mps, wind_at_mps
from reconstruct.rays import Rays
from reconstruct.wind import WindState, uv_mps

COMMON = 1.0
"""Correlation between the rays of one lidar of an error that they share."""

REFERENCE = "reference instrument"
"""What a budget calls the instrument that the retrieved wind is compared with."""

CLOCK_NEEDS_TURBULENCE = "a clock difference acts through turbulence, and a steady wind has none"


@dataclass(frozen=True)
class ErrorSources:
    """Standard deviations (k = 1) of what can be wrong with one lidar. Different lidars err independently.

    The first four differ from ray to ray, with the given correlation between rays of one lidar; the others
    are one draw for the whole campaign.

    Raises
    ------
    InputError
        If a standard deviation is negative or not finite, or a correlation outside 0 to 1.

    Examples
    --------
    >>> ErrorSources(radial_speed_mps=0.1, azimuth_deg=0.1).azimuth_deg
    0.1
    """

    radial_speed_mps: float = 0.0  # noise
    azimuth_deg: float = 0.0
    elevation_deg: float = 0.0
    range_m: float = 0.0
    radial_speed_relative: float = 0.0  # calibration: a share of the radial speed
    heading_deg: float = 0.0
    levelling_deg: float = 0.0  # of pitch and of roll
    position_m: float = 0.0  # of each of the three coordinates of the head
    clock_s: float = 0.0  # difference from the common clock: acts through turbulence alone
    radial_speed_correlation: float = 0.0
    azimuth_correlation: float = 0.0
    elevation_correlation: float = 0.0
    range_correlation: float = 0.0

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if not (np.isfinite(value) and value >= 0):
                raise InputError(f"the error source {field.name} is {value}: a number from 0 up is needed")
            if field.name.endswith("_correlation") and value > 1:
                raise InputError(f"{field.name} is {value}: a correlation between rays lies between 0 and 1")


class RayError(NamedTuple):
    """One source of error as the rays see it."""

    source: str
    response_mps: FloatArray  # (ray,) error of each radial speed for one standard deviation of the source
    correlation: FloatArray  # (ray,) between this ray and the others of its lidar


class BudgetEntry(NamedTuple):
    """What one source, or all of them, add to the error of speed and direction; None where it cannot be
    known.
    """

    source: str
    speed_std_mps: float | None  # k = 1
    direction_std_deg: float | None  # k = 1
    speed_share: float | None  # of the variance
    direction_share: float | None
    reason: str | None = None

    def expanded(self, k: float = 2.0) -> tuple[float | None, float | None]:
        """Speed [m/s] and direction [degrees] uncertainty with a coverage factor."""
        speed, direction = self.speed_std_mps, self.direction_std_deg
        return (None if speed is None else k * speed), (None if direction is None else k * direction)


def ray_errors(rays: Rays, wind: WindState, sources: ErrorSources | Sequence[ErrorSources]) -> list[RayError]:
    """First-order error of every ray from every source that is not zero.

    Parameters
    ----------
    rays : Rays
    wind : WindState
        Taken at the height of each gate above ground, with the shear there.
    sources : ErrorSources or sequence of ErrorSources
        One for all lidars, or one for each.

    Returns
    -------
    list of RayError
        A source with several independent parts (levelling, position) stands there several times.

    Raises
    ------
    InputError
        If the number of sources is not the number of lidars.

    Examples
    --------
    >>> from geometry.gates import Probe
    >>> rays = Rays(azimuth_deg=np.array([0.0, 90.0]), elevation_deg=np.zeros(2), range_m=np.full(2, 500.0),
    ...             head_m=np.array([[0.0, -500.0, 0.0], [-500.0, 0.0, 0.0]]), lidar=np.array([0, 1]),
    ...     time_s=np.zeros(2),
    ...             duration_s=np.ones(2), swept_azimuth_deg=np.zeros(2), probes=(Probe(pulse_ns=200,
    ...     window_ns=256),) * 2,
    ...             period_s=1.0)
    >>> error = ray_errors(rays, WindState(speed_mps=10.0, from_deg=270.0), ErrorSources(heading_deg=0.1))[0]
    >>> error.source, error.response_mps.round(4) + 0.0
    ('heading', array([0.0175, 0.    ]))
    """
    each = _for_each_ray(rays, sources)
    view = _view(rays, wind)
    per_degree, common = np.radians(1.0), np.full(rays.count, COMMON)
    parts: list[tuple[str, tuple[FloatArray, ...], FloatArray, FloatArray]] = [
        ("noise", (np.ones(rays.count),), each["radial_speed_mps"], each["radial_speed_correlation"]),
        ("azimuth", responses.azimuth(view), per_degree * each["azimuth_deg"], each["azimuth_correlation"]),
        (
            "elevation",
            responses.elevation(view),
            per_degree * each["elevation_deg"],
            each["elevation_correlation"],
        ),
        ("ranging", responses.ranging(view), each["range_m"], each["range_correlation"]),
        ("calibration", responses.relative(view), each["radial_speed_relative"], common),
        ("heading", responses.azimuth(view), per_degree * each["heading_deg"], common),
        ("levelling", responses.tilt(view), per_degree * each["levelling_deg"], common),
        ("position", responses.position(view), each["position_m"], common),
    ]
    return [
        RayError(source, answer * std, correlation)
        for source, answers, std, correlation in parts
        if np.any(std > 0)
        for answer in answers
    ]


def ray_covariance(rays: Rays, wind: WindState, sources: ErrorSources | Sequence[ErrorSources]) -> FloatArray:
    """Covariance (ray, ray) of the errors of the radial speeds [m²/s²]: Σ over sources of ρ s sᵀ + (1 - ρ)
    diag(s²).

    The u(x_i, x_j) of JCGM 100:2008, equation 13; rays of different lidars are independent. The matrix grows with the square of
    the number of rays: to propagate alone, `wind_covariance_by_source` needs none.

    Examples
    --------
    >>> from geometry.gates import Probe
    >>> rays = Rays(azimuth_deg=np.array([0.0, 90.0]), elevation_deg=np.zeros(2), range_m=np.full(2, 500.0),
    ...             head_m=np.tile([0.0, -500.0, 0.0], (2, 1)), lidar=np.zeros(2, int), time_s=np.zeros(2),
    ...             duration_s=np.ones(2), swept_azimuth_deg=np.zeros(2), probes=(Probe(pulse_ns=200,
    ...     window_ns=256),),
    ...             period_s=1.0)
    >>> noise = ErrorSources(radial_speed_mps=0.1, radial_speed_correlation=0.5)
    >>> ray_covariance(rays, WindState(speed_mps=10.0, from_deg=0.0), noise).round(4)
    array([[0.01 , 0.005],
           [0.005, 0.01 ]])
    """
    together = rays.lidar[:, None] == rays.lidar
    out = np.zeros((rays.count, rays.count))
    for error in ray_errors(rays, wind, sources):
        shared = error.response_mps * np.sqrt(error.correlation)
        out += together * np.outer(shared, shared) + np.diag(error.response_mps**2 - shared**2)
    return out


def wind_covariance_by_source(
    gain: FloatArray, rays: Rays, wind: WindState, sources: ErrorSources | Sequence[ErrorSources]
) -> dict[str, FloatArray]:
    """Covariance (2, 2) of the retrieved (u, v) from each source [m²/s²]: P = G C Gᵀ (JCGM 102:2011, 6.2.1.3).

    Parameters
    ----------
    gain : numpy.ndarray
        (2, ray) matrix of the fit that will be used, from `reconstruct.retrieval.gain`.
    rays, wind, sources
        As for `ray_errors`.

    Returns
    -------
    dict
        Source to (2, 2); their sum is the whole.

    Examples
    --------
    >>> from geometry.gates import Probe
    >>> rays = Rays(azimuth_deg=np.array([0.0, 90.0]), elevation_deg=np.zeros(2), range_m=np.full(2, 500.0),
    ...             head_m=np.tile([0.0, -500.0, 0.0], (2, 1)), lidar=np.zeros(2, int), time_s=np.zeros(2),
    ...             duration_s=np.ones(2), swept_azimuth_deg=np.zeros(2), probes=(Probe(pulse_ns=200,
    ...     window_ns=256),),
    ...             period_s=1.0)
    >>> state, errors = WindState(speed_mps=10.0, from_deg=0.0), ErrorSources(radial_speed_mps=0.1)
    >>> wind_covariance_by_source(np.array([[0.0, 1.0], [1.0, 0.0]]), rays, state, errors)["noise"].round(4)
    array([[0.01, 0.  ],
           [0.  , 0.01]])
    """
    of_lidar = (rays.lidar[:, None] == np.arange(len(rays.probes))).astype(float)
    out: dict[str, FloatArray] = {}
    for error in ray_errors(rays, wind, sources):
        carried = gain * error.response_mps
        own = carried * np.sqrt(1 - error.correlation)
        shared = (carried * np.sqrt(error.correlation)) @ of_lidar  # (2, lidar)
        out[error.source] = out.get(error.source, 0.0) + own @ own.T + shared @ shared.T
    return out


def mean_errors_mps(gain: FloatArray, rays: Rays, wind: WindState) -> dict[str, FloatArray]:
    """Mean error (2,) of the retrieved (u, v) from a wind that is not uniform and level [m/s].

    Each is G v_r of the part of the wind that the two-column fit does not know: `vertical wind` (about w tan
    φ along the axis), `lateral gradient` (for one along the axis of a sector Φ at range R: across it, a R
    (4/3) sin³(Φ/2)/(Φ - sin Φ)), and `shear` between the height of the target and those of the gates.

    Examples
    --------
    >>> from geometry.gates import Probe
    >>> rays = Rays(azimuth_deg=np.array([-5.0, 5.0]), elevation_deg=np.full(2, 10.0), range_m=np.full(2,
    ...     500.0),
    ...             head_m=np.tile([0.0, -490.0, -87.0], (2, 1)), lidar=np.zeros(2, int), time_s=np.zeros(2),
    ...             duration_s=np.ones(2), swept_azimuth_deg=np.zeros(2), probes=(Probe(pulse_ns=200,
    ...     window_ns=256),),
    ...             period_s=1.0)
    >>> from reconstruct.retrieval import gain, rows
    >>> state = WindState(speed_mps=10.0, from_deg=0.0, vertical_mps=0.5)
    >>> mean_errors_mps(gain(rows(rays.azimuth_deg, rays.elevation_deg)), rays,
    ...     state)["vertical wind"].round(4) + 0.0
    array([0.    , 0.0885])
    """
    beam = unit_vector(rays.azimuth_deg, rays.elevation_deg)
    east, north, up = (rays.head_m + rays.range_m[:, None] * beam).T
    u, v = uv_mps(1.0, wind.from_deg)
    along = beam[:, 0] * u + beam[:, 1] * v
    sheared = power_law_mps(
        wind.height_m + up,
        speed_mps=wind.speed_mps,
        reference_height_m=wind.height_m,
        exponent=wind.shear_exponent,
    )
    return {
        "vertical wind": gain @ (wind.vertical_mps * beam[:, 2]),
        "lateral gradient": gain @ (wind.lateral_gradient_per_s * (east * v - north * u) * along),
        "shear": gain @ ((sheared - wind.speed_mps) * along),
    }


def budget(
    covariances_m2s2: Mapping[str, FloatArray],
    wind: WindState,
    *,
    reference_speed_mps: float = 0.0,
    reference_direction_deg: float = 0.0,
    unknown: Mapping[str, str] | None = None,
) -> list[BudgetEntry]:
    """Uncertainty budget: what each source adds to speed and direction, and its share of the variance.

    To first order, so that shares add up to one: speed along the wind, direction across it over the speed.

    Parameters
    ----------
    covariances_m2s2 : mapping
        Source to (2, 2) covariance of the error of (u, v) [m²/s²]: from `wind_covariance_by_source`, and any
        other.
    wind : WindState
    reference_speed_mps, reference_direction_deg : float
        Standard uncertainty (k = 1) of the instrument that the lidar is compared with, 0 for none.
    unknown : mapping, optional
        Sources that this tier cannot size, with the reason.

    Returns
    -------
    list of BudgetEntry
        One a source and `total` at the end; the direction is None in a calm.

    Examples
    --------
    >>> entries = budget({"noise": np.diag([0.03, 0.01])}, WindState(speed_mps=10.0, from_deg=0.0),
    ...     reference_speed_mps=0.1)
    >>> [(e.source, round(e.speed_std_mps, 4), round(e.speed_share, 3)) for e in entries]
    [('noise', 0.1, 0.5), ('reference instrument', 0.1, 0.5), ('total', 0.1414, 1.0)]
    """
    along = np.stack(uv_mps(1.0, wind.from_deg))
    across = np.array([-along[1], along[0]])
    speed = {name: float(along @ cov @ along) for name, cov in covariances_m2s2.items()}
    side = {name: float(across @ cov @ across) for name, cov in covariances_m2s2.items()}
    if reference_speed_mps > 0 or reference_direction_deg > 0:
        speed[REFERENCE] = reference_speed_mps**2
        side[REFERENCE] = (np.radians(reference_direction_deg) * wind.speed_mps) ** 2
    speed["total"], side["total"] = sum(speed.values()), sum(side.values())
    entries = [_entry(name, speed, side, wind.speed_mps) for name in speed]
    lost = [BudgetEntry(name, None, None, None, None, reason) for name, reason in (unknown or {}).items()]
    return [*entries[:-1], *lost, entries[-1]]


def unknown_sources(sources: ErrorSources | Sequence[ErrorSources]) -> dict[str, str]:
    """Sources that first-order propagation cannot size, with the reason: for `budget`.

    Examples
    --------
    >>> list(unknown_sources(ErrorSources(clock_s=0.5)))
    ['clock']
    """
    each = [sources] if isinstance(sources, ErrorSources) else sources
    return {"clock": CLOCK_NEEDS_TURBULENCE} if any(s.clock_s > 0 for s in each) else {}


def _entry(name: str, speed: dict[str, float], side: dict[str, float], speed_mps: float) -> BudgetEntry:
    if not np.isfinite(speed[name] + side[name]):
        return BudgetEntry(name, None, None, None, None, "the fit gives no wind here, see its condition")
    calm = speed_mps == 0
    return BudgetEntry(
        name,
        float(np.sqrt(max(speed[name], 0.0))),  # a source that acts across alone may round to -1e-20 along
        None if calm else float(np.degrees(np.sqrt(max(side[name], 0.0)) / speed_mps)),
        speed[name] / speed["total"] if speed["total"] > 0 else None,
        side[name] / side["total"] if side["total"] > 0 and not calm else None,
        "a calm has no direction" if calm else None,
    )


def _for_each_ray(rays: Rays, sources: ErrorSources | Sequence[ErrorSources]) -> dict[str, FloatArray]:
    """Every field of the sources, one value a ray."""
    each = [sources] * len(rays.probes) if isinstance(sources, ErrorSources) else list(sources)
    if len(each) != len(rays.probes):
        raise InputError(
            f"{len(each)} error sources came for {len(rays.probes)} lidars: give one, or one for each"
        )
    return {
        f.name: np.array([getattr(s, f.name) for s in each], float)[rays.lidar] for f in fields(ErrorSources)
    }


def _view(rays: Rays, wind: WindState) -> responses.View:
    azimuth, elevation = np.radians(rays.azimuth_deg), np.radians(rays.elevation_deg)
    beam = unit_vector(rays.azimuth_deg, rays.elevation_deg)
    centre = rays.head_m + rays.range_m[:, None] * beam
    seen, gradient = wind_at_mps(wind, centre), gradient_per_s(wind, centre)
    u, v = uv_mps(1.0, wind.from_deg)
    return responses.View(
        sin_azimuth=np.sin(azimuth),
        cos_azimuth=np.cos(azimuth),
        sin_elevation=np.sin(elevation),
        cos_elevation=np.cos(elevation),
        east=beam[:, 0],
        north=beam[:, 1],
        range_m=rays.range_m,
        u_mps=seen[:, 0],
        v_mps=seen[:, 1],
        w_mps=seen[:, 2],
        shear_per_s=np.einsum("rk,rk->r", beam, gradient[:, :, 2]),
        lateral_per_s=wind.lateral_gradient_per_s,
        downwind=(float(u), float(v)),
    )
