"""Beams that meet something solid, or nearly do."""

from collections.abc import Iterator

import numpy as np

from geometry.arrays import BoolArray
from planner.finding import Finding, Severity
from planner.obstruction import Obstruction
from planner.over_terrain import OverTerrain
from planner.plan import Plan


def find(plan: Plan) -> Iterator[Finding]:
    """Findings about rays lost to rotors, towers, masts and obstacles, and about near misses."""
    for met in plan.obstructions:
        yield _lost(plan, met) if met.lost_rays else _near(met)
    for sight in plan.over_terrain:
        if sight.not_known.any():
            yield _unknown(sight)


def _lost(plan: Plan, met: Obstruction) -> Finding:
    """Rays that touch; all of them lost to something that stands still is an error."""
    when = "in some winds, as it turns" if met.part == "rotor" else "in every wind"
    text = f"{_which(plan, met)} lost to {_named(met)}, {met.range_m:.0f} m from the head, {when}: " + (
        "move the lidar or the target"
        if met.rays == 1
        else "move the lidar, raise the scan or leave them out"
    )
    whole = met.lost_rays == met.rays and met.part != "rotor"  # a rotor is in the way in some winds only
    severity: Severity = "error" if whole else "warning"
    return Finding(severity, "beam-blocked", met.scan, met.clearance_m, "m", 0.0, text)


def _near(met: Obstruction) -> Finding:
    """Rays that pass so close that their own uncertainty may make them touch."""
    text = (
        f"a beam passes {_named(met)} at {met.clearance_m:.1f} m, {met.range_m:.0f} m from the head, nearer "
        f"than it is sure of its own place ({met.margin_m:.1f} m, two standard deviations): look for echoes "
        "of it before trusting the gate"
    )
    return Finding("info", "beam-near", met.scan, met.clearance_m, "m", met.margin_m, text)


def _unknown(sight: OverTerrain) -> Finding:
    """Rays that leave the height raster: nothing is known of the ground under them, so they are not clear."""
    count, rays = int(sight.not_known.sum()), len(sight.not_known)
    which = "the beam leaves" if rays == 1 else f"{count} of {rays} rays leave{'s' if count == 1 else ''}"
    text = (
        f"{which} the height raster, or cross{'es' if count == 1 else ''} a hole of it, on the way to the gate: whether the "
        "ground is in the way there is not known; give a raster that holds lidars and gates"
    )
    return Finding("warning", "terrain-unknown", sight.scan, count, "rays", 0.0, text)


def _named(met: Obstruction) -> str:
    """The thing in words: the rotor of stand 5, mast M1."""
    if met.part == "ground":
        return met.thing
    if met.part in ("rotor", "tower"):
        return f"the {met.part} of {met.thing}"
    return met.thing if met.thing.startswith(met.part) else f"{met.part} {met.thing}"


def _which(plan: Plan, met: Obstruction) -> str:
    """The lost rays in words: how many, their numbers from 1, their azimuths, of an RHI its elevations."""
    if met.rays == 1:
        return "the beam is"
    upright = plan.layout[met.scan].spec.type == "rhi"
    angles_deg = met.lost_elevation_deg if upright else met.lost_azimuth_deg
    if plan.layout[met.scan].spec.type == "points":
        names = [name for name, out in zip(plan.layout[met.scan].targets, met.lost, strict=True) if out]
        return f"{met.lost_rays} of {met.rays} beams (to {', '.join(names)}) {'is' if len(names) == 1 else 'are'}"
    first, last = angles_deg[0], angles_deg[-1]
    alone = met.lost_rays == 1
    angle = f"{first:.1f}°" if alone else f"{first:.1f} to {last:.1f}°"
    numbers = f"{'number' if alone else 'numbers'} {_runs(met.lost)}, {'elevation' if upright else 'azimuth'} {angle}"
    return f"{met.lost_rays} of {met.rays} rays ({numbers}) {'is' if alone else 'are'}"


def _runs(lost: BoolArray) -> str:
    """Numbers of the lost rays, counted from 1, as runs: 3-5, 8."""
    numbers = np.flatnonzero(lost) + 1
    runs = np.split(numbers, np.flatnonzero(np.diff(numbers) > 1) + 1)
    return ", ".join(f"{run[0]}-{run[-1]}" if len(run) > 1 else f"{run[0]}" for run in runs)
