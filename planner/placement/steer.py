"""With turbulence: places that the linear tier finds good, judged by the turbulent tier and moved to where its error is least.

The turbulent tier takes a tenth of a second for a set and a target, so that it cannot look at every pair of a grid. It
ranks the linear tier's best distinct places anew, and moves the best of those.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from geometry.arrays import FloatArray
from planner.placement.fan_out import Batch, How, run
from planner.placement.maps import look, of_lidar, standing_m
from planner.placement.numbers import turbulent_numbers
from planner.placement.refine import Improve

Found = tuple[FloatArray, float]  # places (lidar, 2) [m] and their value

STEPS = 12  # of Nelder and Mead's simplex, for each coordinate

# Measured: one state of the wind at one target, a pair or a sector scan, on one core.
STATE_S = 3e-3


class Steering(NamedTuple):
    """What all batches share."""

    improve: Improve
    places_m: FloatArray  # (set, lidar, 2)
    moved: bool  # whether the places are moved, or only judged


def steered(improve: Improve, places_m: Sequence[FloatArray], *, most: int, how: How | None) -> list[Found]:
    """Judge places by the turbulent tier, and move the best of them.

    Parameters
    ----------
    improve
        Task, constraints and soft cost.
    places_m
        Sets of places (lidar, 2), all allowed [m].
    most
        How many are kept and moved.
    how
        Where the work is done.

    Returns
    -------
    list
        Places and their value, best first, each no worse than where it began.

    Raises
    ------
    InputError
        If the site does not give the turbulence of the air.
    """
    quiet = (how or How())._replace(progress=None)
    judged = _run(Steering(improve, np.array(places_m), moved=False), quiet)
    best = sorted(judged, key=_value)[:most]
    return sorted(
        _run(Steering(improve, np.array([places for places, _ in best]), moved=True), how), key=_value
    )


def _value(found: Found) -> float:
    return found[1]


def _run(steering: Steering, how: How | None) -> list[Found]:
    task, count = steering.improve.task, len(steering.places_m)
    states = sum(climate.count for climate in task.lean_climates)
    each_s = states * STATE_S * (STEPS * steering.places_m[0].size if steering.moved else 1)
    batches = [(number,) for number in range(count)]
    return run(
        steer_batch, steering, batches, how=how, expected_s=each_s * count, known_as=_known_as(steering)
    )


def _known_as(steering: Steering) -> str:
    """What tells this steering from another, alike from run to run."""
    improve, task = steering.improve, steering.improve.task
    soft = [improve.cost(places).tolist() for places in steering.places_m]
    names = (task.targets, task.pattern.name, [lidar.name for lidar in task.fixed])
    choice = (task.count, task.limits, task.criterion, task.aggregate, task.head_height_m)
    parts = (names, choice, improve.spacing_m, steering.places_m.tolist(), soft, steering.moved)
    return task.site.model_dump_json() + repr(parts)


def steer_batch(steering: Steering, batch: Batch) -> Found:
    """One set judged, or moved: a batch for `fan_out.run`."""
    from scipy.optimize import minimize

    improve = steering.improve
    start: FloatArray = steering.places_m[batch[0]]

    def value_at(places: FloatArray) -> float:
        return turbulent_value(improve, places.reshape(start.shape))

    value, flat = turbulent_value(improve, start), start.ravel()
    if not steering.moved:
        return start, value
    found = minimize(
        value_at,
        flat,
        method="Nelder-Mead",
        options={
            "initial_simplex": np.vstack([flat, flat + improve.spacing_m * np.eye(flat.size)]),
            "maxfev": STEPS * flat.size,
            "xatol": 1.0,
            "fatol": 1e-5,
        },
    )
    return (found.x.reshape(start.shape), float(found.fun)) if found.fun < value else (start, value)


def turbulent_value(improve: Improve, places_m: FloatArray) -> float:
    """Value of one set of places (lidar, 2) with turbulence, soft costs included; inf where it is not allowed.

    The wind is that of the linear tier's search, one speed for each direction; what is shown is over all its states.
    """
    if not np.isfinite(improve.value(places_m)):
        return float("inf")
    task = improve.task
    heads = [standing_m(task, place) for place in places_m]
    looks = [*(of_lidar(task, lidar) for lidar in task.fixed), *(look(task, head) for head in heads)]
    found = turbulent_numbers(task, looks, climates=task.lean_climates)
    return found.value(task.criterion, task.aggregate) + float(improve.cost(places_m).sum())
