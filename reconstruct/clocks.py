"""Lidars whose clocks are wrong: what they stamp alike they have measured in different air.

A clock is off by one draw for the whole campaign. What follows is averaged over two places of each lidar's clock, early
and late by its standard deviation.
"""

from collections.abc import Sequence
from dataclasses import replace
from itertools import product

import numpy as np

from geometry.arrays import ArrayLike, FloatArray
from geometry.errors import InputError
from reconstruct.rays import Rays
from reconstruct.uncertainty import ErrorSources


def clock_std_s(rays: Rays, sources: ErrorSources | Sequence[ErrorSources] | None) -> FloatArray:
    """Standard deviation of each lidar's clock (lidar,) [s]."""
    lidars = len(rays.probes)
    each = [sources] * lidars if isinstance(sources, ErrorSources) or sources is None else list(sources)
    return np.array([0.0 if source is None else source.clock_s for source in each])


def early_and_late(rays: Rays, clock_s: ArrayLike) -> list[Rays]:
    """Rays at the true times of stamps that are early or late: every combination of the lidars' two places.

    Parameters
    ----------
    rays
        Rays of one scan.
    clock_s
        Standard deviation of the clocks, one for all lidars or (lidar,) [s].

    Returns
    -------
    list of Rays
        The same rays alone where all clocks are right.

    Raises
    ------
    InputError
        If lidars with different clocks scan back and forth together: their ways back have no common middle.

    Examples
    --------
    >>> from geometry.gates import Probe
    >>> pair = Rays(azimuth_deg=np.array([0.0, 90.0]), elevation_deg=np.zeros(2), range_m=np.full(2, 1000.0),
    ...     head_m=np.zeros((2, 3)), lidar=np.arange(2), time_s=np.ones(2), duration_s=np.ones(2),
    ...     swept_azimuth_deg=np.zeros(2), probes=(Probe(200, 256),) * 2, period_s=2.0)
    >>> [(late.time_s + 0.0).tolist() for late in early_and_late(pair, [0.5, 0.0])]
    [[0.5, 1.0], [1.5, 1.0]]
    """
    off_s = np.broadcast_to(np.asarray(clock_s, dtype=float), (len(rays.probes),))
    if not np.any(off_s):
        return [rays]
    if rays.back_and_forth and len(rays.probes) > 1:
        raise InputError(
            f"lidars with clocks that differ by {off_s.tolist()} s scan back and forth together: "
            "only one lidar can; set clock_s to 0, or let them scan one way"
        )
    signs = product(*((-1.0, 1.0) if std > 0 else (0.0,) for std in off_s))
    return [_moved(rays, np.array(sign) * off_s) for sign in signs]


def _moved(rays: Rays, late_s: FloatArray) -> Rays:
    """Rays that are measured later by (lidar,) seconds, on the way back too."""
    way_back = rays.reversed_time_s[0] + rays.time_s[0]  # their sum is the same for all rays
    sweep_s = float(way_back + 2 * late_s[0]) if rays.back_and_forth else rays.sweep_s
    return replace(rays, time_s=rays.time_s + late_s[rays.lidar], sweep_s=sweep_s)
