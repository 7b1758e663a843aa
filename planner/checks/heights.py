"""Heads, targets and bases against the ground that they are over or stand on."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from planner.finding import Finding, Severity
from planner.ground import ground_doubt_m, ground_under_m, heights_of
from planner.nouns import Position
from planner.plan import Plan
from planner.site import Site

# One level for the ground of a site is not more exact; farther below it a head's height is a slip.
HEAD_BELOW_GROUND_M = 2.0
# Sites that one level stands for are flatter than this; a lost or added digit of a height is more.
LEVEL_GROUND_DOUBT_M = 50.0
WHAT_TO_DO = "check its height, ground_height_m and height_datum"
WITH_TERRAIN = (
    "check its height, height_datum, and the easting, northing and zone of its position and of `crs`"
)


class _Base(NamedTuple):
    """Something that stands on the ground."""

    kind: str
    name: str
    position: Position  # of its foot


def find(plan: Plan) -> Iterator[Finding]:
    """Findings about heights above or below the ground."""
    yield from _targets(plan)
    yield from _heads(plan)
    yield from _bases(plan)


def _targets(plan: Plan) -> Iterator[Finding]:
    for target in plan.site.targets:
        above_m = plan.places.height_above_ground_m(target.name)
        ground_m = plan.site.target_position_m(target)[2] - above_m
        if above_m <= 0.0:
            text = (
                f"the target is {abs(above_m):.1f} m below the ground at {ground_m:g} m: {_advice(plan.site)}"
            )
            yield Finding("error", "target-height", target.name, above_m, "m", 0.0, text)


def _heads(plan: Plan) -> Iterator[Finding]:
    """Heads below the ground: where a raster shows it beyond its own doubt, all beams are lost in the ground."""
    for lidar in plan.site.lidars:
        ground_m = float(ground_under_m(plan.site, lidar.position))
        above_m = lidar.position[2] - ground_m
        if not above_m < -HEAD_BELOW_GROUND_M:
            continue
        doubt_m = _doubt_m(plan.site, lidar.position)
        buried = plan.site.terrain is not None and above_m < -doubt_m
        limit_m = doubt_m if buried else HEAD_BELOW_GROUND_M
        severity: Severity = "error" if buried else "warning"
        why = (
            "this raster may be wrong there, so all its beams are blocked"
            if buried
            else "uneven ground explains"
        )
        text = (
            f"the head is {abs(above_m):.1f} m below the ground at {ground_m:g} m, more than the {limit_m:g} m that {why}: "
            f"{_advice(plan.site)}"
        )
        yield Finding(severity, "head-height", lidar.name, above_m, "m", -limit_m, text)


def _bases(plan: Plan) -> Iterator[Finding]:
    """Feet of masts, turbines and obstacles, and hard targets below the ground."""
    site = plan.site
    if site.terrain is None and site.ground_height_m is None:
        return  # the ground was taken from them
    severity: Severity = "info" if site.terrain is None else "warning"
    for kind, name, position in _standing(site):
        above_m = position[2] - float(ground_under_m(site, position))
        limit_m = _doubt_m(site, position)
        hangs = kind == "hard target"  # above the ground it may be on anything
        if above_m < -limit_m or (above_m > limit_m and not hangs):
            side = "above" if above_m > 0 else "below"
            what = "it" if hangs else "its foot"
            text = (
                f"{kind} {name}: {what} is {abs(above_m):.1f} m {side} the ground at {position[2] - above_m:.1f} m, more than "
                f"the {limit_m:.1f} m that {'one level' if site.terrain is None else 'the raster'} may be off: {_advice(site)}"
            )
            yield Finding(
                severity, "base-height", name, above_m, "m", limit_m if above_m > 0 else -limit_m, text
            )


def _standing(site: Site) -> Iterator[_Base]:
    yield from (_Base("mast", item.name, item.position) for item in site.masts)
    yield from (_Base("turbine", item.name, item.position) for item in site.turbines)
    yield from (_Base("obstacle", item.name, item.position) for item in site.obstacles)
    own = (item for item in site.hard_targets if item.position is not None)
    yield from (_Base("hard target", item.name, site.target_position_m(item)) for item in own)


def _doubt_m(site: Site, position: Position) -> float:
    """How far the ground may be from what the site says of it [m]."""
    heights = heights_of(site)
    return (
        LEVEL_GROUND_DOUBT_M if heights is None else float(ground_doubt_m(heights.ground, np.array(position)))
    )


def _advice(site: Site) -> str:
    return WHAT_TO_DO if site.terrain is None else WITH_TERRAIN
