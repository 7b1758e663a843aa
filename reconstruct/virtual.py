"""A virtual campaign: every scan of a site flown past by the same random field, period after period.

The judge (`monte_carlo`) repeats one state of the wind many times; here each averaging period has its own.
All scans meet the same air at their own place, and what is wrong with a lidar for good (heading, levelling,
position, calibration, clock) is drawn once for the whole campaign. Between periods the air is independent: a
campaign of such periods has the statistics of the climate, not the weather's memory from one to the next.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from geometry.arrays import FloatArray, IntArray
from geometry.errors import InputError
from reconstruct.error_draws import Draws, draw_pointing, draw_speed_errors
from reconstruct.field import Field, synthesise
from reconstruct.flight import Sampling, radial_speed_mps, reach_m, reference_mps, subgrid_root, to_wind_frame
from reconstruct.monte_carlo import scans_in, spread_shifts_m
from reconstruct.rays import Rays
from reconstruct.spectra import Turbulence
from reconstruct.uncertainty import ErrorSources
from reconstruct.wind import WindState, uv_mps

PERIODS_PER_FIELD = 4  # share a field, at heights of it that have little in common
REFERENCE_INTERVAL_S = 1.0
FAN_KNOTS = 7  # rays of a fan that the small eddies are worked out for: every 10° of 60°
FAN_ELEVATION_DEG = 3.0  # a fan is about level
_CORRELATED = (
    ("radial_speed_mps", "radial_speed_correlation"),
    ("azimuth_deg", "azimuth_correlation"),
    ("elevation_deg", "elevation_correlation"),
    ("range_m", "range_correlation"),
)
_FOR_GOOD = ("radial_speed_relative", "heading_deg", "levelling_deg", "position_m", "clock_s")


@dataclass(frozen=True)
class VirtualScan:
    """One scan of a virtual campaign."""

    rays: Rays  # relative to its own target
    offset_m: FloatArray  # (3,) east, north, up of its target from the reference
    speed_ratio: float  # mean speed at its target over that at the reference
    height_m: float  # of its target above ground
    sources: ErrorSources
    lidar: int  # scans of one lidar share what is wrong with it for good

    def wind(self, state: WindState) -> WindState:
        """The state at this scan's target."""
        return replace(state, speed_mps=state.speed_mps * self.speed_ratio, height_m=self.height_m)


@dataclass(frozen=True)
class Flown:
    """What the instruments measure in one averaging period."""

    index: int
    state: WindState  # at the reference
    radial_speed_mps: list[FloatArray]  # one (scan, ray) for each scan
    reference_mps: FloatArray  # (sample, 2) u, v at the reference
    field: int  # periods of one field are not quite independent


class VirtualSettings(NamedTuple):
    """How a campaign is flown."""

    averaging_s: float = 600.0
    sampling: Sampling = Sampling()
    spacing_m: float | None = None  # of the field's cells
    periods_per_field: int = PERIODS_PER_FIELD


DEFAULT = VirtualSettings()


def split_sources(sources: ErrorSources) -> tuple[ErrorSources, ErrorSources]:
    """The part of a lidar's errors that stays for good, and the part that is new in every ray.

    Of a source with correlation ρ between rays the variance ρ s² stays.

    Examples
    --------
    >>> lasting, fresh = split_sources(ErrorSources(azimuth_deg=1.0, azimuth_correlation=0.36, heading_deg=0.1))
    >>> lasting.azimuth_deg, lasting.heading_deg, fresh.azimuth_deg, fresh.heading_deg
    (0.6, 0.1, 0.8, 0.0)
    """
    lasting: dict[str, float] = {}
    fresh: dict[str, float] = dict.fromkeys(_FOR_GOOD, 0.0)
    for name, correlation_name in _CORRELATED:
        std, correlation = getattr(sources, name), getattr(sources, correlation_name)
        lasting |= {name: float(std * np.sqrt(correlation)), correlation_name: 1.0}
        fresh |= {name: float(std * np.sqrt(1.0 - correlation)), correlation_name: 0.0}
    return replace(sources, **lasting), replace(sources, **fresh)


def fly(
    scans: Sequence[VirtualScan],
    states: Sequence[WindState],
    *,
    turbulence: Turbulence | None,
    seed: int,
    settings: VirtualSettings = DEFAULT,
) -> Iterator[Flown]:
    """Fly all scans through a campaign, one averaging period for each state of the wind.

    Parameters
    ----------
    scans : sequence of VirtualScan
        At least one.
    states : sequence of WindState
        Mean wind of each period at the reference.
    turbulence : Turbulence, optional
        A steady wind without.
    seed : int
        The same seed gives the same campaign.
    settings : VirtualSettings
        Averaging time, sampling, and how many periods share a field.

    Yields
    ------
    Flown
        Period by period: memory does not grow with the campaign.

    Raises
    ------
    InputError
        If there is no scan, none fits into the averaging time, or the field does not fit in memory.

    Notes
    -----
    Eddies smaller than the field's cells are added as noise that is independent between scans and the
    reference. The reference's samples are one second apart.
    """
    if not scans:
        raise InputError("there is no scan to fly: a virtual campaign needs at least one that has a target")
    for scan in scans:
        if scans_in(scan.rays, settings.averaging_s) < 1:
            raise InputError(
                f"a scan takes {scan.rays.period_s:g} s and the averaging time is {settings.averaging_s:g} s"
            )
    rng = np.random.default_rng([seed, 0])
    lasting = [_lasting(scan, seed) for scan in scans]
    for number, start in enumerate(range(0, len(states), settings.periods_per_field)):
        together = states[start : start + settings.periods_per_field]
        field = _field(scans, together, turbulence, settings, rng)
        shifts = np.zeros((len(together), 3)) if field is None else spread_shifts_m(field, len(together), rng)
        for step, (state, shift) in enumerate(zip(together, shifts, strict=True)):
            air = _Air(field, turbulence, shift)
            seen = [
                _radial_speeds(scan, errors, state, air, settings, rng)
                for scan, errors in zip(scans, lasting, strict=True)
            ]
            yield Flown(start + step, state, seen, _reference(state, air, settings.averaging_s, rng), number)


class _Lasting(NamedTuple):
    """What is wrong with a lidar through the whole campaign."""

    draws: Draws  # (1, ray)
    speed_mps: FloatArray  # (1, ray)
    factor: FloatArray  # (1, ray)


class _Air(NamedTuple):
    """The air of one period."""

    field: Field | None
    turbulence: Turbulence | None
    shift_m: FloatArray  # (3,)


def _lasting(scan: VirtualScan, seed: int) -> _Lasting:
    rng = np.random.default_rng([seed, 1, scan.lidar])  # scans of one lidar draw the same numbers
    sources, _ = split_sources(scan.sources)
    draws = draw_pointing(sources, scan.rays, (1, 1), rng).realisation(0)
    noise, factor = draw_speed_errors(sources, scan.rays, (1, 1), rng)
    return _Lasting(draws, noise[0], factor[0])


def _field(
    scans: Sequence[VirtualScan],
    states: Sequence[WindState],
    turbulence: Turbulence | None,
    settings: VirtualSettings,
    rng: np.random.Generator,
) -> Field | None:
    """A field large enough for all scans in each of some states; None without turbulence."""
    if turbulence is None or turbulence.intensity == 0:
        return None
    extents = []
    for state in states:
        reaches = [reach_m(scan.rays, scan.wind(state), settings.averaging_s) for scan in scans]
        apart = to_wind_frame(np.stack([scan.offset_m for scan in scans]), state.from_deg)
        extents.append(np.max(reaches, axis=0) + np.ptp(apart, axis=0))
    return synthesise(turbulence, np.max(extents, axis=0), rng=rng, spacing_m=settings.spacing_m)


def _radial_speeds(
    scan: VirtualScan,
    lasting: _Lasting,
    state: WindState,
    air: _Air,
    settings: VirtualSettings,
    rng: np.random.Generator,
) -> FloatArray:
    """(scan, ray) radial speeds of one period as the lidar gives them [m/s]."""
    rays, wind = scan.rays, scan.wind(state)
    shape = (1, scans_in(rays, settings.averaging_s))
    _, sources = split_sources(scan.sources)
    fresh = draw_pointing(sources, rays, shape, rng).realisation(0)
    errors = Draws(*(now + always for now, always in zip(fresh, lasting.draws, strict=True)))
    std = 0.0 if air.turbulence is None else air.turbulence.std_mps(state.speed_mps)
    clean = radial_speed_mps(
        rays,
        wind,
        errors,
        scans=shape[1],
        sampling=settings.sampling,
        field=air.field,
        std_mps=std,
        shift_m=air.shift_m + to_wind_frame(scan.offset_m, state.from_deg),
    )
    if air.field is not None and air.turbulence is not None:
        small = subgrid_std(rays, wind, air.turbulence, air.field.cut_per_m)
        clean += std * small * rng.standard_normal(clean.shape)
    noise, _ = draw_speed_errors(sources, rays, shape, rng)
    return np.asarray(clean * lasting.factor + lasting.speed_mps + noise[0])


def subgrid_std(rays: Rays, wind: WindState, turbulence: Turbulence, cut_per_m: float) -> FloatArray:
    """(ray,) standard deviation of what eddies beyond a wavenumber add to the rays of one lidar.

    For a longitudinal variance of 1. Along a fan it changes slowly: some rays are worked out
    (`flight.subgrid_root`) and the others lie between them.
    """
    if rays.count <= FAN_KNOTS or np.ptp(rays.elevation_deg) > FAN_ELEVATION_DEG:
        root = subgrid_root(rays, wind, turbulence, cut_per_m)
        return np.asarray(np.sqrt(np.sum(np.square(root), axis=1)))
    knots = np.unique(np.linspace(0, rays.count - 1, FAN_KNOTS).round().astype(np.intp))
    some = subgrid_root(rays_at(rays, knots), wind, turbulence, cut_per_m)
    variance = np.interp(np.arange(rays.count), knots, np.sum(np.square(some), axis=1))
    return np.asarray(np.sqrt(variance))


def rays_at(rays: Rays, index: IntArray) -> Rays:
    """Some rays of a scan, with its timing."""
    per_ray = (
        "azimuth_deg",
        "elevation_deg",
        "range_m",
        "head_m",
        "lidar",
        "time_s",
        "duration_s",
        "swept_azimuth_deg",
    )
    return replace(rays, **{name: getattr(rays, name)[index] for name in per_ray})


def _reference(state: WindState, air: _Air, averaging_s: float, rng: np.random.Generator) -> FloatArray:
    """(sample, 2) eastward and northward wind that a point instrument at the reference meets [m/s]."""
    times = np.arange(0.5 * REFERENCE_INTERVAL_S, averaging_s, REFERENCE_INTERVAL_S)
    if air.field is None or air.turbulence is None:
        return np.tile(state.uv_mps, (len(times), 1))
    std = air.turbulence.std_mps(state.speed_mps)
    met = reference_mps(state, times, field=air.field, std_mps=std, shift_m=air.shift_m)
    met = met + std * rng.multivariate_normal(
        np.zeros(3), air.field.subgrid, size=len(times), method="cholesky"
    )
    downwind = np.stack(uv_mps(1.0, state.from_deg))
    left = np.array([-downwind[1], downwind[0]])
    return np.asarray(met[:, :1] * downwind + met[:, 1:2] * left)
