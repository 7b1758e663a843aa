"""What acts on the retrieved wind and may be left out: its size on one scan, in this scene."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from geometry.arrays import FloatArray
from geometry.gates import Probe
from planner.fidelity import Effect, judged
from planner.site import Site
from reconstruct.prediction import predict_linear
from reconstruct.ray_fit import ray_fit
from reconstruct.rays import Rays
from reconstruct.spectra import Turbulence
from reconstruct.turbulent import predict_turbulent
from reconstruct.uncertainty import ErrorSources, mean_errors_mps
from reconstruct.wind import WindState

POINT_PROBE = Probe(pulse_ns=1.0, window_ns=1.0)  # 20 cm: a point for every eddy that matters


@dataclass(frozen=True)
class Air:
    """The states of the wind and the errors with which the size of an effect on one retrieval is judged."""

    name: str  # of the scan with its size, or of the pair
    rays: Rays
    states: Sequence[WindState]
    sources: Sequence[ErrorSources]
    turbulence: Turbulence | None


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
    return tuple(_worst(site, airs, name, values, text) for name, (values, text) in sizes.items())


def _worst(site: Site, airs: Sequence[Air], name: str, values: Sequence[float | None], text: str) -> Effect:
    """The largest size of an effect, and where it is."""
    turns = name == "pointing-noise"  # it acts on the direction first
    unit, tolerance = ("deg", site.tolerance.angle_deg) if turns else ("m/s", site.tolerance.speed_mps)
    known = [(value, air.name) for value, air in zip(values, airs, strict=True) if value is not None]
    if not known:
        return judged(
            site, name, None, unit, tolerance, f"{text}; not known: the site declares no turbulence"
        )
    size, where = max(known)
    return judged(site, name, size, unit, tolerance, f"{text}; largest for {where}" if size > 0 else text)


def _mean_error(air: Air, source: str) -> float:
    fit = ray_fit(air.rays).gain
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
