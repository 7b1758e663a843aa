"""Several heights or targets for the same lidars: stacked elevations, split time, and the error that each gets."""

from collections.abc import Sequence
from typing import NamedTuple

from planner.placement.maps import Look
from planner.placement.numbers import numbers_of
from planner.placement.task import Task


class Shared(NamedTuple):
    """One of the targets that share the lidars."""

    target: str
    elevation_deg: tuple[float, ...]  # of each lidar, those that stand first
    time_share: float  # of each lidar's time
    speed_std_mps: float  # linear tier, in the time of one retrieval of all targets
    direction_std_deg: float
    alone_speed_std_mps: float  # if it had the lidars for itself
    alone_direction_std_deg: float


def shared(task: Task, looks: Sequence[Look]) -> tuple[Shared, ...]:
    """Split the time of lidars evenly among the targets of a task.

    Parameters
    ----------
    task
        Its targets: heights above one mast, or points apart.
    looks
        One place each: the lidars that stand, then those that are placed.

    Returns
    -------
    tuple of Shared
        From the lowest beam of the first lidar up. Of n targets each gets 1/n of the rays, so white noise grows by √n;
        pointing and position errors stay, and turbulence is for the turbulent tier with a period n times as long.
    """
    count = len(task.targets)
    split, alone = numbers_of(task, looks, sharing=count), numbers_of(task, looks)
    found = [
        Shared(
            target=name,
            elevation_deg=tuple(split.elevation_deg[number].tolist()),
            time_share=1.0 / count,
            speed_std_mps=float(split.speed_std_mps[number]),
            direction_std_deg=float(split.direction_std_deg[number]),
            alone_speed_std_mps=float(alone.speed_std_mps[number]),
            alone_direction_std_deg=float(alone.direction_std_deg[number]),
        )
        for number, name in enumerate(task.targets)
    ]
    return tuple(sorted(found, key=lambda item: item.elevation_deg))
