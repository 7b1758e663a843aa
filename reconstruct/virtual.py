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

from geometry.arrays import FloatArray
from geometry.errors import InputError
from reconstruct.error_draws import Draws, draw_pointing, draw_speed_errors
from reconstruct.field import Field, synthesise
from reconstruct.flight import ComplexArray, Sampling, WaveSight, radial_speed_mps, reach_m, to_wind_frame
from reconstruct.monte_carlo import (
    REFERENCE_INTERVAL_S,
    Air,
    reference_phase,
    reference_uv_mps,
    scans_in,
    spread_shifts_m,
)
from reconstruct.periods import TEN_MINUTES_S
from reconstruct.rays import Rays
from reconstruct.spectra import Turbulence
from reconstruct.uncertainty import ErrorSources
from reconstruct.wind import WindState

PERIODS_PER_FIELD = 4  # share a field, at heights of it that have little in common
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

    averaging_s: float = TEN_MINUTES_S
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
    All scans and the reference meet the same eddies of every size. The reference's samples are half a second apart.
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
            passing = None
            if field is not None and turbulence is not None:
                air = Air(field, turbulence.std_mps(state.speed_mps))
                passing = _Passing(air, shift, field.waves.amplitudes(rng))
            seen = [
                _radial_speeds(scan, errors, state, passing, settings, rng)
                for scan, errors in zip(scans, lasting, strict=True)
            ]
            yield Flown(start + step, state, seen, _reference(state, passing, settings.averaging_s), number)


class _Lasting(NamedTuple):
    """What is wrong with a lidar through the whole campaign."""

    draws: Draws  # (1, ray)
    speed_mps: FloatArray  # (1, ray)
    factor: FloatArray  # (1, ray)


class _Passing(NamedTuple):
    """The air of one period: a field from some place of its box on."""

    air: Air
    shift_m: FloatArray  # (3,)
    amplitudes: ComplexArray  # of the field's waves


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
    passing: _Passing | None,
    settings: VirtualSettings,
    rng: np.random.Generator,
) -> FloatArray:
    """(scan, ray) radial speeds of one period as the lidar gives them [m/s]."""
    rays, wind = scan.rays, scan.wind(state)
    shape = (1, scans_in(rays, settings.averaging_s))
    _, sources = split_sources(scan.sources)
    fresh = draw_pointing(sources, rays, shape, rng).realisation(0)
    errors = Draws(*(now + always for now, always in zip(fresh, lasting.draws, strict=True)))
    offset_m = to_wind_frame(scan.offset_m, state.from_deg)
    if passing is None:
        clean = radial_speed_mps(rays, wind, errors, scans=shape[1], sampling=settings.sampling)
    else:
        air = passing.air
        clean = radial_speed_mps(
            rays,
            wind,
            errors,
            scans=shape[1],
            sampling=settings.sampling,
            field=air.field,
            std_mps=air.std_mps,
            shift_m=passing.shift_m + offset_m,
        )
        waves = air.field.waves
        sight = WaveSight.of(rays, wind, waves, errors, scans=shape[1], offset_m=offset_m)
        clean += air.std_mps * sight.radial_speed(passing.amplitudes)
    noise, _ = draw_speed_errors(sources, rays, shape, rng)
    return np.asarray(clean * lasting.factor + lasting.speed_mps + noise[0])


def _reference(state: WindState, passing: _Passing | None, averaging_s: float) -> FloatArray:
    """(sample, 2) eastward and northward wind that a point instrument at the reference meets [m/s]."""
    if passing is None:
        return np.tile(state.uv_mps, (int(averaging_s / REFERENCE_INTERVAL_S), 1))
    phase = reference_phase(state, passing.air.field.waves, averaging_s)
    return reference_uv_mps(state, passing.air, passing.shift_m, passing.amplitudes, phase)
