"""From rays and the time between them to a `Scan`: the last step of every kind of scan."""

import math

import numpy as np

from geometry.angles import wrap_360_deg
from geometry.arrays import FloatArray
from geometry.errors import InputError
from geometry.gates import require_positive
from geometry.scan import Kind, Scan


def assemble(
    kind: Kind,
    direction_deg: tuple[FloatArray, FloatArray],
    swept_deg: tuple[FloatArray, FloatArray],
    *,
    ray_s: float,
    gaps_s: FloatArray,
    after_s: float,
    accumulation_s: float,
    period_s: float | None,
    back_and_forth: bool,
) -> Scan:
    """Turn rays, the gaps between them and the time after the last one into a scan with its times."""
    require_positive("accumulation_s", accumulation_s, "the seconds that one ray takes")
    if period_s is not None:
        require_positive("period_s", period_s, "the seconds from one pass to the next, or leave it out")
    starts = np.concatenate([[0.0], np.cumsum(ray_s + gaps_s)])
    sweep_s = float(starts[-1]) + ray_s
    measured = sweep_s + after_s
    period = measured if period_s is None else float(period_s)
    squeeze = min(1.0, period / sweep_s)  # a declared period wins: passes never overlap
    return Scan(
        kind=kind,
        azimuth_deg=wrap_360_deg(direction_deg[0]),
        elevation_deg=direction_deg[1],
        time_s=squeeze * (starts + 0.5 * ray_s),
        swept_azimuth_deg=swept_deg[0],
        swept_elevation_deg=swept_deg[1],
        accumulation_s=float(accumulation_s),
        period_s=period,
        measured_period_s=measured,
        sweep_s=squeeze * sweep_s,
        back_and_forth=back_and_forth,
    )


def require_finite(name: str, value: float) -> None:
    """Refuse an angle that is no number."""
    if not math.isfinite(value):
        raise InputError(f"{name} is {value}: give a finite number of degrees")


def require_elevation(elevation_deg: float) -> None:
    """Refuse an elevation beyond the zenith or the nadir."""
    if not -90 <= elevation_deg <= 90:
        raise InputError(
            f"an elevation of {elevation_deg}° came: give -90 to 90 degrees above the horizontal"
        )
