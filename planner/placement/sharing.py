"""Several heights or targets for the same lidars: stacked elevations, split time, and the error that each gets."""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

from planner.placement.maps import Look, of_lidar
from planner.placement.numbers import numbers_of
from planner.placement.task import Task, refuse_twice, task_of
from planner.scan_plans import SectorScan
from planner.site import Site


class Shared(NamedTuple):
    """One of the targets that share the lidars."""

    target: str
    elevation_deg: tuple[float, ...]  # of each lidar, those that stand first
    time_share: float  # of each lidar's time
    speed_std_mps: float  # linear tier, in the time of one retrieval of all targets
    direction_std_deg: float
    alone_speed_std_mps: float  # if it had the lidars for itself
    alone_direction_std_deg: float


def shared_by(
    site: Site, *, lidars: Sequence[str] = (), targets: Sequence[str] = ()
) -> tuple[tuple[str, ...], tuple[Shared, ...]]:
    """Split the time of a site's lidars, where they stand, among targets.

    Parameters
    ----------
    site
        With lidars and targets.
    lidars, targets
        Names; default: the lidars of the first pair, else all, and all targets. One lidar alone takes its sector scan.

    Returns
    -------
    tuple
        Names of the lidars, and what each target gets.

    Raises
    ------
    InputError
        If a name is unknown or given twice, or the lidars cannot measure the wind together.
    """
    pair = [site.scan(name).lidar for name in site.pairs[0].scans] if site.pairs else []
    names = tuple(lidars) or tuple(pair) or tuple(lidar.name for lidar in site.lidars)
    refuse_twice("lidar", names)
    chosen = tuple(site.lidar(name) for name in names)
    task = task_of(
        site, fixed=names[:-1], count=1, targets=tuple(targets) or tuple(t.name for t in site.targets)
    )
    scans = [scan for scan in site.scans if scan.lidar == names[-1]]
    own = next((scan for scan in scans if isinstance(scan, SectorScan)), None) if task.single else None
    task = replace(task, pattern=chosen[-1], scan=own or next(iter(scans), None), replaced=())
    return names, shared(task, [of_lidar(task, lidar) for lidar in chosen])


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
