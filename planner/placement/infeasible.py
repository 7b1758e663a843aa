"""No place is allowed: which constraint leaves nothing, and how much it must give."""

from collections.abc import Sequence

import numpy as np

from geometry.arrays import BoolArray, FloatArray
from planner.placement.maps import CRITERIA, Look
from planner.placement.task import Task
from reconstruct.beam_table import BeamTable

CROSSED = 200  # candidates whose pairs are looked at for how far they cross

HINTS = {
    "area": "allow more ground (site file: areas)",
    "range-min": "take a lidar with a shorter blind zone, or move the targets",
    "range-max": "take a pulse or gates that reach farther (--max-range)",
    "elevation-min": "allow lower elevations",
    "elevation-max": "allow steeper beams (--max-elevation)",
    "sight": "look at what stands in the way, or at targets that are free of it",
    "terrain": "raise the head (--head-height)",
    "signal": "accept weaker echoes (signal.least_cnr_db)",
    "wakes": "accept more lost wind (--max-lost)",
}


def refusal(task: Task, seen: Look, fixed: Sequence[BeamTable]) -> str:
    """Why no set of the candidates is allowed, in words.

    Parameters
    ----------
    task
        What was to be placed.
    seen
        The criteria of every candidate.
    fixed
        What every lidar that stands can measure, one candidate each.
    """
    blind = _blind_fixed(task, [table.seen for table in fixed])
    if blind:
        return blind
    broken = {name: ~np.all(values >= 0.0, axis=0) for name, values in seen.slack.items()}
    count = len(seen.positions_m)
    if not np.logical_or.reduce(list(broken.values())).all():
        return _no_crossing(task, seen, fixed)
    alone = [name for name, out in broken.items() if out.all()]
    lines = [f"no place is allowed: none of the {count} candidates keeps to every constraint"]
    for name in alone or _removable(broken) or _blocking(broken):
        others = ~np.logical_or.reduce([out for other, out in broken.items() if other != name])
        lines.append(_line(task, seen, name, others, by_itself=name in alone))
    return "; ".join(lines)


def _blind_fixed(task: Task, fixed: Sequence[BoolArray]) -> str:
    """Lidars that stand and see no target from there; empty where all see one."""
    blind = [lidar.name for lidar, seen in zip(task.fixed, fixed, strict=True) if not seen.any()]
    if not blind:
        return ""
    return (
        f"{', '.join(blind)}, which stands, can measure none of the targets: they are out of its range or behind the "
        "terrain; move it, or leave it out (--lidar)"
    )


def _no_crossing(task: Task, seen: Look, fixed: Sequence[BeamTable]) -> str:
    limit, reached = task.limits.least_opening_deg, _widest_deg(task, seen, fixed)
    beams = task.count + len(task.fixed)
    lead = f"no set of places is allowed: single places are, of {len(seen.positions_m)} candidates, but"
    if reached >= limit:
        return f"{lead} none of them can measure every target that the others miss; move the lidars that stand (--lidar)"
    return (
        f"{lead} no {beams} beams cross at {limit:g}° or more at every target: it must give {limit - reached:.3g}° "
        f"(some cross at {np.floor(10 * reached) / 10:g}° everywhere); accept a smaller opening angle (--min-opening) or "
        "allow more ground"
    )


def _widest_deg(task: Task, seen: Look, fixed: Sequence[BeamTable]) -> float:
    """The opening angle in plan that some set keeps to at every target [deg], of some hundred candidates."""
    allowed = np.flatnonzero(seen.allowed.all(axis=0))
    azimuth = np.radians(seen.azimuth_deg[:, allowed[:: max(allowed.size // CROSSED, 1)]])
    own = np.zeros(azimuth.shape)  # (target, candidate) sine of the angle with the lidar that stands best
    for table in fixed:
        sine = np.abs(table.east * np.cos(azimuth) - table.north * np.sin(azimuth))
        own = np.maximum(own, np.where(table.seen, sine, 0.0))
    best = float(own.min(axis=0).max(initial=0.0))
    if task.count > 1:
        mutual = np.abs(np.sin(azimuth[:, :, None] - azimuth[:, None, :]))
        both = np.maximum(mutual, np.maximum(own[:, :, None], own[:, None, :]))
        best = max(best, float(both.min(axis=0).max(initial=0.0)))
    return float(np.degrees(np.arcsin(min(best, 1.0))))


def _removable(broken: dict[str, BoolArray]) -> list[str]:
    """Constraints without which some candidate would be allowed."""
    found = []
    for name in broken:
        others = np.logical_or.reduce([out for other, out in broken.items() if other != name])
        if not others.all():
            found.append(name)
    return found


def _blocking(broken: dict[str, BoolArray]) -> list[str]:
    """The constraints that the candidate breaks which breaks fewest."""
    breaks = np.stack(list(broken.values()))
    best = int(np.argmin(breaks.sum(axis=0)))
    return [name for name, out in zip(broken, breaks[:, best], strict=True) if out]


def _line(task: Task, seen: Look, name: str, others: BoolArray, *, by_itself: bool) -> str:
    """One constraint: how much it must give, where the others are kept if they can be."""
    pool = others if others.any() else np.ones_like(others)
    slack = seen.slack[name][:, pool]
    known = slack[:, ~np.isnan(slack).any(axis=0)]
    so = f"{_meaning(name)} alone leaves none" if by_itself else f"without {_meaning(name)} some would be"
    if not known.size:
        return f"{so}: the height of the ground is not known there; give a terrain that covers the candidates"
    per_place: FloatArray = known.min(axis=0)
    best = int(np.argmax(per_place))
    target = task.targets[int(np.argmin(known[:, best]))]
    kept = "" if others.any() else ", and other constraints with it"
    return (
        f"{so}: it must give {_amount(name, -float(per_place[best]))} (target {target}){kept}: {HINTS[name]}"
    )


def _meaning(name: str) -> str:
    return f"{name} ({CRITERIA[name][1]})"


def _amount(name: str, value: float) -> str:
    unit = CRITERIA[name][0]
    if unit == "share":
        return f"{max(value, 0.0):.1%}"
    return f"{max(value, 0.0):.3g}{'°' if unit == 'deg' else ' ' + unit}"
