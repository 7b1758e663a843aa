"""Which effects are modelled and which are left out: each with its size in this scene against the user's tolerance.

What exceeds its tolerance is modelled, the rest is not. Pointing is always exact; all else follows this list.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from geometry.arrays import FloatArray
from geometry.effects import effect_sizes_m
from geometry.frames import EarthModel, model_error_m
from geometry.gates import Probe
from planner.places import Places
from planner.site import Site
from reconstruct.prediction import predict_linear
from reconstruct.rays import Rays
from reconstruct.retrieval import gain, rows
from reconstruct.spectra import Turbulence
from reconstruct.turbulent import predict_turbulent
from reconstruct.uncertainty import ErrorSources, mean_errors_mps
from reconstruct.wind import WindState

POINT_PROBE = Probe(pulse_ns=1.0, window_ns=1.0)  # 20 cm: a point for every eddy that matters


@dataclass(frozen=True)
class Effect:
    """One effect that a model may leave out."""

    name: str
    size: float | None  # in this scene, at the worst target; None where the site does not say enough
    unit: str  # m, m/s or deg
    tolerance: float
    modelled: bool
    text: str  # what it is and why it is in or out


@dataclass(frozen=True)
class Air:
    """The states of the wind and the errors with which the size of an effect on one retrieval is judged."""

    rays: Rays
    states: Sequence[WindState]
    sources: Sequence[ErrorSources]
    turbulence: Turbulence | None


GEOMETRY_TEXTS = {
    "convergence": "grid north is not true north",
    "scale": "grid distance is not ground distance",
    "curvature": "the ground falls away under a level beam",
    "refraction": "the beam bends down; reported beside the elevation, never inside it",
    "geoid": "heights above sea level are taken for ellipsoidal ones",
    "deflection-of-vertical": "the plumb line is not the ellipsoid's normal; a bound, and no model here has it",
}


def geometric_effects(places: Places) -> tuple[Effect, ...]:
    """Size of each geometric effect, in metres at the target where it is largest (`geometry.effects`)."""
    site, targets = places.site, [places.site.target_position_m(target) for target in places.site.targets]
    if not site.lidars or not targets:
        return ()
    sizes = [effect_sizes_m(places.frame, lidar.position, np.asarray(targets)) for lidar in site.lidars]
    return tuple(
        _effect(
            site,
            name,
            max(float(np.max(getattr(each, name.replace("-", "_") + "_m"))) for each in sizes),
            "m",
            site.tolerance.position_m,
            text,
        )
        for name, text in GEOMETRY_TEXTS.items()
    )


def earth_model(places: Places, effects: Sequence[Effect]) -> EarthModel:
    """The cheapest model of the Earth that has every geometric effect that is to be modelled.

    `places` has the exact model. Where the cheap model is off by more than the tolerance after all, the exact one is taken.
    """
    if places.site.fidelity == "all":
        return "exact"
    wanted = {effect.name for effect in effects if effect.modelled}
    model: EarthModel = "flat-grid"
    if wanted & {"convergence", "scale"}:
        model = "flat"
    if "curvature" in wanted:
        model = "curved"
    points = [lidar.position for lidar in places.site.lidars]
    points += [places.site.target_position_m(target) for target in places.site.targets]
    if places.site.fidelity != "auto" or not points:
        return model
    off = model_error_m(places.frame, places.origin_m, np.asarray(points), model)
    return model if float(np.max(off)) <= places.site.tolerance.position_m else "exact"


def wind_effects(site: Site, airs: Sequence[Air]) -> tuple[Effect, ...]:
    """Size of each effect on one scan's wind, in m/s or degrees: the worst over the retrievals and states given."""
    if not airs:
        return ()
    sizes: dict[str, tuple[Sequence[float | None], str]] = {
        "vertical-wind": (
            [_mean_error(air, "vertical wind") for air in airs],
            "looks like w·tan φ along the beam",
        ),
        "shear": (
            [_mean_error(air, "shear") for air in airs],
            "gates above and below the target see another wind",
        ),
        "pointing-noise": (
            [_pointing_deg(air) for air in airs],
            "jitter, heading, levelling, position and ranging, beside the noise",
        ),
        "turbulence": ([_turbulence(air) for air in airs], "each ray meets another eddy at another moment"),
        "probe-averaging": (
            [_probe(air) for air in airs],
            "a gate sees the mean over its probe, not a point",
        ),
        "scan-motion": ([_motion(air) for air in airs], "a moving head smears each ray over its step"),
    }
    found = []
    for name, (values, text) in sizes.items():
        known = [value for value in values if value is not None]
        size = max(known) if known else None
        reason = text if known else f"{text}; not known: the site declares no turbulence"
        turns = name == "pointing-noise"  # it acts on the direction first
        unit, tolerance = ("deg", site.tolerance.angle_deg) if turns else ("m/s", site.tolerance.speed_mps)
        found.append(_effect(site, name, size, unit, tolerance, reason))
    return tuple(found)


def left_out(effects: Sequence[Effect]) -> frozenset[str]:
    """Names of the effects that are not modelled."""
    return frozenset(effect.name for effect in effects if not effect.modelled)


def _effect(site: Site, name: str, size: float | None, unit: str, tolerance: float, text: str) -> Effect:
    if name == "deflection-of-vertical":
        modelled = False
    elif site.fidelity == "all":
        modelled = size is not None
    elif site.fidelity == "auto":
        modelled = size is not None and size > tolerance
    else:
        modelled = name in site.fidelity
    return Effect(name, size, unit, tolerance, modelled, text)


def _mean_error(air: Air, source: str) -> float:
    fit = gain(rows(air.rays.azimuth_deg, air.rays.elevation_deg))
    return max(float(np.linalg.norm(mean_errors_mps(fit, air.rays, state)[source])) for state in air.states)


def _pointing_deg(air: Air) -> float:
    """Scatter of one scan's direction from everything but the noise of the radial speed [deg]."""
    quiet = [replace(each, radial_speed_mps=0.0) for each in air.sources]
    found = [predict_linear(air.rays, state, quiet).direction_std_deg for state in air.states]
    return max((value for value in found if value is not None), default=0.0)


def _turbulence(air: Air) -> float | None:
    if air.turbulence is None:
        return None
    still = ErrorSources()
    return max(
        float(
            np.sqrt(
                np.max(
                    np.linalg.eigvalsh(
                        predict_turbulent(air.rays, state, air.turbulence, still).covariance_m2s2
                    )
                )
            )
        )
        for state in air.states
    )


def _probe(air: Air) -> float | None:
    return _without(air, replace(air.rays, probes=(POINT_PROBE,) * len(air.rays.probes)), sweep=True)


def _motion(air: Air) -> float | None:
    return _without(air, air.rays, sweep=False)


def _without(air: Air, simpler: Rays, *, sweep: bool) -> float | None:
    """How much the scatter of one scan changes where something is left out."""
    if air.turbulence is None:
        return None
    eddies, still = air.turbulence, ErrorSources()
    return max(
        _apart(
            predict_turbulent(air.rays, state, eddies, still).covariance_m2s2,
            predict_turbulent(simpler, state, eddies, still, sweep=sweep).covariance_m2s2,
        )
        for state in air.states
    )


def _apart(covariance: FloatArray, other: FloatArray) -> float:
    """Largest change of a standard deviation, along any direction's axis, between two covariances [m/s]."""
    spread, without = (
        np.sqrt(np.clip(np.linalg.eigvalsh(matrix), 0.0, None)) for matrix in (covariance, other)
    )
    return float(np.max(np.abs(spread - without)))
