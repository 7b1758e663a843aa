"""Which effects are modelled and which are left out: each with its size in this scene against the user's tolerance.

What exceeds its tolerance is modelled, the rest is not. Pointing is always exact; all else follows this list. Here are
the noun and what geometry leaves out; what acts on the wind is in `planner.fidelity_wind`.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from geometry.effects import effect_sizes_m, model_error_m
from geometry.frames import EarthModel
from planner.places import Places
from planner.site import Site


@dataclass(frozen=True)
class Effect:
    """One effect that a model may leave out."""

    name: str
    size: float | None  # in this scene, at the worst target; None where the site does not say enough
    unit: str  # m, m/s or deg
    tolerance: float
    modelled: bool
    text: str  # what it is and why it is in or out


GEOMETRY_TEXTS = {
    "convergence": "grid north is not true north",
    "scale": "grid distance is not ground distance",
    "curvature": "the ground falls away under a level beam; concerns maps, wakes and predictions: pointing is exact",
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
        judged(
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


def left_out(effects: Sequence[Effect]) -> frozenset[str]:
    """Names of the effects that are not modelled."""
    return frozenset(effect.name for effect in effects if not effect.modelled)


def judged(site: Site, name: str, size: float | None, unit: str, tolerance: float, text: str) -> Effect:
    """Decide whether an effect is modelled: by the site's word, else by its size."""
    if name == "deflection-of-vertical":
        modelled = False
    elif site.fidelity == "all":
        modelled = size is not None
    elif site.fidelity == "auto":
        modelled = size is not None and size > tolerance
    else:
        modelled = name in site.fidelity
    return Effect(name, size, unit, tolerance, modelled, text)
