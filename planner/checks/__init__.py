"""Every check of a plan. A check reads the Plan, compares and returns findings; it computes nothing."""

from collections.abc import Callable, Iterator

from planner.checks import (
    beams,
    crossing,
    heights,
    instrument,
    joint_fit,
    map_frame,
    obstruction,
    timing,
    wakes,
)
from planner.finding import Finding, by_severity
from planner.plan import Plan

CHECKS: tuple[Callable[[Plan], Iterator[Finding]], ...] = (
    map_frame.find,
    heights.find,
    beams.find,
    crossing.find,
    joint_fit.find,
    obstruction.find,
    wakes.find,
    timing.find,
    instrument.find,
)


def findings(plan: Plan) -> list[Finding]:
    """All findings of a plan, errors first."""
    return by_severity([finding for check in CHECKS for finding in check(plan)])
