"""Whether three beams or more can tell the vertical wind from the horizontal one."""

import math
from collections.abc import Iterator

from planner.finding import Finding, Severity
from planner.plan import Plan

# Noise of one ray times this comes out in w: as much as two beams that open by 16 degrees give across them.
WARN_GAIN = 5.0
# As two beams that open by 4 degrees: a noise of 0.2 m/s hides any vertical wind of the boundary layer's.
ERROR_GAIN = 20.0
UNIT = "m/s per m/s"


def find(plan: Plan) -> Iterator[Finding]:
    """Findings about every pair that retrieves the vertical wind too."""
    for met in plan.joint_fits:
        gain = met.vertical_gain
        if gain <= WARN_GAIN:
            continue
        blind = math.isnan(gain)
        severe = blind or gain > ERROR_GAIN
        severity: Severity = "error" if severe else "warning"
        limit = ERROR_GAIN if severe else WARN_GAIN
        told = (
            "the beams lie in one plane and cannot tell the vertical wind"
            if blind
            else f"noise of the radial speeds comes out {gain:.1f} times as large in the vertical wind (limit {limit:g}), "
            "and part of it in u and v"
        )
        text = (
            f"{told}: raise a beam or stand nearer with one, or give the pair `columns: 2` for u and v alone"
        )
        subject = f"{met.pair} ({met.target})"
        yield Finding(severity, "vertical-noise", subject, None if blind else gain, UNIT, limit, text)
