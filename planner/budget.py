"""The uncertainty budget of ten-minute means: what each source adds to speed and direction."""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import numpy as np

from geometry.arrays import FloatArray
from planner.fidelity_wind import Air
from planner.places import Places
from planner.site import Mast
from reconstruct.clocks import clock_std_s
from reconstruct.periods import scans_in
from reconstruct.persistence import split_covariance
from reconstruct.ray_fit import ray_fit
from reconstruct.rays import Rays
from reconstruct.ten_minute import predict_ten_minute
from reconstruct.uncertainty import REFERENCE, BudgetEntry, ErrorSources, budget, unknown_sources
from reconstruct.wind import WindState

# Names of the fields of ErrorSources in words, in the order of the table.
SOURCES = {
    "radial_speed_mps": "noise of the radial speed",
    "azimuth_deg": "azimuth",
    "elevation_deg": "elevation",
    "range_m": "ranging",
    "radial_speed_relative": "calibration of the radial speed",
    "heading_deg": "heading",
    "levelling_deg": "levelling",
    "position_m": "position",
}
TURBULENCE = "turbulence between scan and target"
CLOCK = "clock of the lidar"  # what it adds to that
NOT_DECLARED = "the site declares no turbulence"
NO_REFERENCE = "the mast's speed_uncertainty_mps and direction_uncertainty_deg are not declared"


@dataclass(frozen=True)
class Budget:
    """What adds to the error of ten-minute means of one scan or pair, in the middle of the site's speeds."""

    scan: str
    target: str
    wind: WindState
    scans: int  # in ten minutes
    entries: tuple[BudgetEntry, ...]  # the total last


def ten_minute_budget(scan: str, target: str, air: Air, mast: Mast | None) -> Budget:
    """Add up every source for the ten-minute mean of a scan, at the state of its air whose direction is the middle one.

    Errors drawn anew in every scan are divided by the number of scans; those that stay do not average out.
    """
    state, rays = air.states[len(air.states) // 2], air.rays
    scans = scans_in(rays.period_s)
    parts = {
        words: _part(rays, state, [_only(each, name) for each in air.sources], scans)
        for name, words in SOURCES.items()
        if any(getattr(each, name) > 0 for each in air.sources)
    }
    unknown = dict(unknown_sources(list(air.sources)))
    if air.turbulence is None:
        unknown[TURBULENCE] = NOT_DECLARED
    else:
        parts[TURBULENCE] = predict_ten_minute(rays, state, air.turbulence).vector_covariance_m2s2
        if unknown.pop("clock", None):
            clock_s = clock_std_s(rays, air.sources)
            late = predict_ten_minute(rays, state, air.turbulence, clock_s=clock_s)
            parts[CLOCK] = late.vector_covariance_m2s2 - parts[TURBULENCE]
    speed, direction = (mast.speed_uncertainty_mps, mast.direction_uncertainty_deg) if mast else (None, None)
    if speed is None or direction is None:
        unknown[REFERENCE] = NO_REFERENCE
    entries = budget(
        parts,
        state,
        reference_speed_mps=speed or 0.0,
        reference_direction_deg=direction or 0.0,
        unknown=unknown,
    )
    return Budget(scan, target, state, scans, tuple(entries))


def mast_of(places: Places, target: str) -> Mast | None:
    """The mast that a target is on; None where it is on none."""
    name = next((item.mast for item in places.site.targets if item.name == target), None)
    return None if name is None else places.site.mast(name)


def _only(sources: ErrorSources, name: str) -> ErrorSources:
    """The same sources with all but one set to zero; correlations stay."""
    others = {
        field.name: 0.0
        for field in fields(sources)
        if field.name != name and not field.name.endswith("_correlation")
    }
    return replace(sources, **others)


def _part(rays: Rays, state: WindState, sources: Sequence[ErrorSources], scans: int) -> FloatArray:
    """(2, 2) covariance of a ten-minute mean from one source [m²/s²]."""
    fit = ray_fit(rays).gain
    errors = split_covariance(rays, state, sources)
    return np.asarray(fit @ (np.diag(errors.random_m2s2) / scans + errors.persistent_m2s2) @ fit.T)
