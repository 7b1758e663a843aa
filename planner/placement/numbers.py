"""The numbers of chosen places, from the retrieval core: error at every target, crossing, ranges, wind lost."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from geometry.arrays import FloatArray
from geometry.beams import beam_to
from geometry.errors import InputError
from planner.placement.echo import echo
from planner.placement.maps import Look
from planner.placement.task import Aggregate, Task
from planner.scan_plans import SectorScan
from planner.wind_climate import error_sources, turbulence
from reconstruct.beam_table import Criterion, condensed
from reconstruct.climate import Climate
from reconstruct.rays import Rays
from reconstruct.retrieval import gain, rows
from reconstruct.turbulent import predict_turbulent
from reconstruct.uncertainty import ErrorSources, wind_covariance_by_source
from reconstruct.wind import WindState

DEFAULT_ACCUMULATION_S = 1.0  # of a lidar without a scan; it matters to turbulence alone


class Numbers(NamedTuple):
    """What a set of lidars does at each target."""

    speed_std_mps: FloatArray  # (target,) linear tier, root mean square over the climate
    direction_std_deg: FloatArray  # (target,)
    opening_deg: FloatArray  # (target,) in plan, 0 to 180, of those two that cross best; NaN for one lidar
    range_m: FloatArray  # (target, lidar), those that stand first
    azimuth_deg: (
        FloatArray  # (target, lidar) true, by the exact model from the head, as an instrument is pointed
    )
    elevation_deg: FloatArray  # (target, lidar) the same, above the horizontal at the head
    lost_share: FloatArray  # (target,) of the wanted wind, to wakes, of the lidar that loses most
    vector_std_mps: FloatArray  # (target,) of both components together

    def value(self, criterion: Criterion, aggregate: Aggregate) -> float:
        """What a search minimises, at these places."""
        return _value(self.vector_std_mps, self.speed_std_mps, self.direction_std_deg, criterion, aggregate)


class Turbulent(NamedTuple):
    """Error of one retrieval with turbulence, root mean square over the climate; NaN where the tier gives none."""

    speed_std_mps: FloatArray  # (target,)
    direction_std_deg: FloatArray  # (target,)
    vector_std_mps: FloatArray  # (target,) along and across the wind together

    def value(self, criterion: Criterion, aggregate: Aggregate) -> float:
        """What a search with turbulence minimises, at these places."""
        return _value(self.vector_std_mps, self.speed_std_mps, self.direction_std_deg, criterion, aggregate)


def _value(
    vector: FloatArray, speed: FloatArray, direction: FloatArray, criterion: Criterion, aggregate: Aggregate
) -> float:
    each = {"vector": vector, "speed": speed, "direction": direction}[criterion]
    return float(each.max() if aggregate == "worst" else np.sqrt(np.mean(each**2)))


def numbers_of(task: Task, looks: Sequence[Look], *, sharing: int = 1) -> Numbers:
    """Work out the numbers of lidars that stand and of those that are placed.

    Parameters
    ----------
    task
        What they are for.
    looks
        One place each: the lidars that stand, then those that are placed.
    sharing
        Among how many targets each lidar splits its time: noise is √n times as large in the time of one retrieval.

    Returns
    -------
    Numbers
        Errors by the linear tier through the retrieval core, at every target and state of its climate.
    """
    lidars = [*task.fixed, *[task.pattern] * (len(looks) - len(task.fixed))]
    noise = [
        np.sqrt(sharing) * echo(lidar, task.scan_of(lidar), each.range_m).noise_mps[:, 0]
        for lidar, each in zip(lidars, looks, strict=True)
    ]
    heads = np.concatenate([each.local_m for each in looks])
    errors = [
        _errors(task, number, heads, [error_sources(*pair) for pair in zip(lidars, of_target, strict=True)])
        for number, of_target in enumerate(np.transpose(noise).tolist())
    ]
    azimuth, elevation = _pointed_deg(task, np.concatenate([each.positions_m for each in looks]))
    return Numbers(
        speed_std_mps=np.array([speed for speed, _, _ in errors]),
        direction_std_deg=np.array([direction for _, direction, _ in errors]),
        opening_deg=_opening_deg(np.concatenate([each.azimuth_deg for each in looks], axis=1)),
        range_m=np.concatenate([each.range_m for each in looks], axis=1),
        azimuth_deg=azimuth,
        elevation_deg=elevation,
        lost_share=np.concatenate([each.lost_share for each in looks], axis=1).max(axis=1),
        vector_std_mps=np.array([vector for _, _, vector in errors]),
    )


def _pointed_deg(task: Task, heads_m: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(target, lidar) azimuth and elevation from heads (lidar, 3) in the site's coordinates, each in its own frame.

    The search and its errors take all angles in the axes of the site's middle. Those are turned against a head's own by
    its distance over the Earth's radius, 0.03° at 3 km. Beams cross alike in both; an error changes by no more than that turn
    times tan φ, 5e-5 of itself at an elevation of 5°.
    """
    beams = [beam_to(task.places.frame.enu_m(head, task.targets_m)) for head in heads_m]
    return (
        np.stack([beam.azimuth_deg for beam in beams], axis=1),
        np.stack([beam.elevation_deg for beam in beams], axis=1),
    )


def rays_at(task: Task, number: int, heads_m: FloatArray) -> Rays:
    """Rays of one retrieval at a target, seen from it: one of each lidar, or those of the sector of one."""
    relative = heads_m - task.local_targets_m[number]
    beam = beam_to(-relative)
    offsets = task.offsets_deg if len(heads_m) == 1 else np.zeros(1)
    which = np.repeat(np.arange(len(heads_m)), offsets.size)
    accumulation_s = task.scan.accumulation_s if task.scan else DEFAULT_ACCUMULATION_S
    moving = len(heads_m) == 1 and isinstance(task.scan, SectorScan) and task.scan.motion == "continuous"
    swept_deg = task.scan.step_deg if moving and isinstance(task.scan, SectorScan) else 0.0
    return Rays(
        azimuth_deg=beam.azimuth_deg[which] + np.tile(offsets, len(heads_m)),
        elevation_deg=beam.elevation_deg[which],
        range_m=beam.range_m[which],
        head_m=relative[which],
        lidar=which,
        time_s=np.asarray(
            (np.tile(np.arange(offsets.size), len(heads_m)) + 0.5) * accumulation_s, np.float64
        ),
        duration_s=np.full(which.size, accumulation_s),
        swept_azimuth_deg=np.full(which.size, swept_deg),
        probes=(task.probe,) * len(heads_m),
        period_s=(task.scan.period_s if task.scan else None) or offsets.size * accumulation_s,
    )


def _errors(
    task: Task, number: int, heads_m: FloatArray, sources: list[ErrorSources]
) -> tuple[float, float, float]:
    """Standard deviation of speed [m/s], direction [deg] and vector [m/s] at one target over its climate."""
    rays, climate, like = rays_at(task, number, heads_m), task.climates[number], task.states[number]
    fit = gain(rows(rays.azimuth_deg, rays.elevation_deg))
    squares = condensed(climate, like, "speed")
    parts = np.array([_along_across(fit, rays, state, sources) for state in squares.states(like)])
    speed, side = squares.mean(parts[:, 0]), squares.mean(parts[:, 1])
    inverse = condensed(climate, like, "direction")
    turned = [
        _along_across(fit, rays, state, sources)[1] / state.speed_mps**2 for state in inverse.states(like)
    ]
    return (
        float(np.sqrt(speed)),
        float(np.degrees(np.sqrt(inverse.mean(turned)))),
        float(np.sqrt(speed + side)),
    )


def _along_across(
    fit: FloatArray, rays: Rays, state: WindState, sources: list[ErrorSources]
) -> tuple[float, float]:
    """Variance of the retrieved wind along and across the wind [m²/s²]: the linear tier, without its moments."""
    covariance = np.sum(list(wind_covariance_by_source(fit, rays, state, sources).values()), axis=0)
    along = np.array(state.uv_mps) / state.speed_mps
    across = np.array([-along[1], along[0]])
    return float(along @ covariance @ along), float(across @ covariance @ across)


def turbulent_numbers(
    task: Task, looks: Sequence[Look], *, climates: Sequence[Climate] | None = None
) -> Turbulent:
    """Error of one retrieval with turbulence, by the turbulent tier.

    Parameters
    ----------
    task, looks
        As for `numbers_of`.
    climates
        The wind at each target; default: the task's.

    Returns
    -------
    Turbulent

    Raises
    ------
    InputError
        If the site does not give the turbulence of the air.
    """
    eddies = turbulence(task.site)
    if eddies is None:
        raise InputError(
            "--tier turbulent needs the turbulence of the air, and the site does not give it: add wind.turbulence "
            "{intensity, length_m}"
        )
    lidars = [*task.fixed, *[task.pattern] * (len(looks) - len(task.fixed))]
    heads = np.concatenate([each.local_m for each in looks])
    out = Turbulent(*(np.empty(len(task.targets)) for _ in Turbulent._fields))
    for number, (climate, like) in enumerate(zip(climates or task.climates, task.states, strict=True)):
        rays = rays_at(task, number, heads)
        noise = [
            float(echo(lidar, task.scan_of(lidar), each.range_m).noise_mps[number, 0])
            for lidar, each in zip(lidars, looks, strict=True)
        ]
        sources = [error_sources(lidar, mps) for lidar, mps in zip(lidars, noise, strict=True)]
        states = list(climate.states(like))
        found = [predict_turbulent(rays, state, eddies, sources) for state in states]
        along = np.array([_square(each.speed_std_mps) for each in found])
        turned = np.array([_square(each.direction_std_deg) for each in found])
        across = turned * np.radians([state.speed_mps for state in states]) ** 2
        for values, squares in zip(out, (along, turned, along + across), strict=True):
            values[number] = np.sqrt(climate.mean(squares))
    return out


def _square(value: float | None) -> float:
    return np.nan if value is None else value**2


def _opening_deg(azimuth_deg: FloatArray) -> FloatArray:
    """(target,) angle in plan of those two beams (target, lidar) that cross nearest to a right angle."""
    if azimuth_deg.shape[1] < 2:
        return np.full(len(azimuth_deg), np.nan)
    first, second = np.triu_indices(azimuth_deg.shape[1], 1)
    apart = np.abs((azimuth_deg[:, first] - azimuth_deg[:, second] + 180.0) % 360.0 - 180.0)
    best = np.argmin(np.abs(apart - 90.0), axis=1)
    return np.asarray(apart[np.arange(len(apart)), best])


def lidar_names(task: Task) -> tuple[str, ...]:
    """Names of the lidars of a set: those that stand, then those that are placed, numbered where there are several."""
    placed = [task.pattern] if task.count == 1 else []
    several = [f"lidar {number}" for number in range(1, task.count + 1)] if task.count > 1 else []
    return (*(lidar.name for lidar in task.fixed), *(lidar.name for lidar in placed), *several)
