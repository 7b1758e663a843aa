"""What is to be done with the rays of a scan: which gate, which rays belong together, in which sizes.

A sector or a full circle is a fan, whose rays make one wind. A stare, and each point of a list, is a beam that
another lidar's beam has to meet. A vertical slice or a raster is a grid: its rays at every gate.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Literal, NamedTuple

import numpy as np

from geometry.angles import difference_deg
from geometry.errors import InputError
from planner.campaign import RayInput, TwoBeam
from planner.error_curve import default_sizes
from planner.places import Places
from planner.ray_sets import sector_rays, subset_of
from planner.scan_layout import ScanLayout
from planner.scan_plans import PointsScan, RasterScan, SectorScan
from reconstruct.filters import Step
from reconstruct.records import Records
from reconstruct.scan_grid import (
    Gridded,
    alternating_passes,
    angle_between_deg,
    direction_grid,
    nearest_direction,
    plane_angle_deg,
    plane_grid,
    scan_grid,
)

Kind = Literal["fan", "beam", "grid"]

OF = ", "  # between a scan and one of its points or gates
FARTHEST_POINT_DEG = 1.0  # a ray farther than this from a point of a list looks at something else


class Size(NamedTuple):
    """A sector size and the columns of the whole scan that stand for it."""

    sector_deg: float
    rays: slice


class ScanJob(NamedTuple):
    """What every part of a scan is worked on with."""

    name: str  # of the results: the scan's, with the target or the gate where it has several
    kind: Kind
    layout: ScanLayout
    range_m: float | None  # true range of the gate; None: every gate
    height_m: float | None  # of what is measured, above the ground; None for a grid
    turn_deg: float = 0.0  # from north at the lidar to north at the target
    raise_deg: float = 0.0  # the same of the horizontal
    target_column: int | None = None  # the ray that looks at the target
    target_m: float | None = None  # true range of the gate at the target
    sizes: tuple[Size, ...] = ()  # of a fan
    columns: Literal[2, 3] = 2  # of the fit
    two_beam: TwoBeam | None = None  # rules, where both beams are averaged on their own

    @property
    def rays_stand_alone(self) -> bool:
        """Whether every ray is a pass of its own."""
        return self.kind == "beam"


def jobs_of(
    layout: ScanLayout,
    places: Places,
    item: RayInput,
    *,
    sizes_deg: Sequence[float] | None = None,
    columns: Literal[2, 3] = 2,
) -> tuple[ScanJob, ...]:
    """Prepare the retrieval of a scan: one job, or one for each point or gate that is wanted.

    Parameters
    ----------
    layout, places
        The scan and where it is.
    item
        Says which gates are wanted, if not the one at the target, and how many columns the fit has.
    sizes_deg
        Sector sizes [deg]; default: the declared one and the usual smaller ones.
    columns
        Of the fit where the input does not say.

    Raises
    ------
    InputError
        If the scan looks for a hard target, has neither target nor gate, or a size is not its own.
    """
    spec = layout.spec
    if not layout.measures_wind:
        raise InputError(
            f"scan '{layout.name}' looks for a hard target, not for wind: see `lidarplan cnr-map fit`"
        )
    if isinstance(spec, PointsScan):
        return tuple(_towards(layout, places, place) for place in range(len(layout.targets)))
    if spec.type in ("rhi", "raster"):
        return (_towards(layout, places, 0)._replace(kind="grid", range_m=None, height_m=None),)
    job = _towards(layout, places, 0)
    if spec.type != "stare":
        job = job._replace(kind="fan", sizes=_sizes(layout, sizes_deg), columns=item.fit_columns or columns)
    if item.two_beam is not None:
        if spec.type != "sector" or layout.scan.count != 2:
            raise InputError(
                f"two_beam came with scan '{layout.name}', a {spec.type} of {layout.scan.count} rays: it belongs to a sector "
                "of two, such as sector_deg: 60, step_deg: 60, motion: step"
            )
        job = job._replace(two_beam=item.two_beam)
    if item.gates_m is not None:
        return tuple(
            _at_gate(job, places, gate_m)._replace(name=job_name(layout.name, f"{gate_m:g} m"))
            for gate_m in item.gates_m
        )
    if item.gate_m is not None:
        return (_at_gate(job, places, item.gate_m),)
    if job.range_m is None:
        raise InputError(
            f"scan '{layout.name}' has no target: give its input's gate_m or gates_m, the ranges that are wanted [m]"
        )
    return (job,)


def job_name(scan: str, part: str) -> str:
    """What the results of one of the points or gates of a scan are called.

    Examples
    --------
    >>> job_name("tour", "hub")
    'tour, hub'
    """
    return f"{scan}{OF}{part}"


def scan_of(result: str) -> str:
    """The scan that a result is named after, or the pair.

    Examples
    --------
    >>> scan_of("circle, 200 m"), scan_of("dual")
    ('circle', 'dual')
    """
    return result.rsplit(OF, 1)[0]


def result_name(layout: ScanLayout, target: str) -> str:
    """What the results of a scan at a target are called."""
    return job_name(layout.name, target) if isinstance(layout.spec, PointsScan) else layout.name


def gridded(records: Records, job: ScanJob) -> Gridded:
    """Rays of one gate as scans: a row for each pass; every ray of a beam is a pass."""
    scan, spec = job.layout.scan, job.layout.spec
    if spec.type == "rhi":
        axis_deg = float(scan.azimuth_deg[0])
        planned = plane_angle_deg(scan.azimuth_deg, scan.elevation_deg, axis_deg=axis_deg)
        return plane_grid(records, planned, axis_deg=axis_deg, step_deg=spec.step_deg)
    if isinstance(spec, RasterScan):
        within_deg = max(spec.step_deg, spec.elevation_step_deg or 0.0) / np.sqrt(2.0)
        return direction_grid(records, scan.azimuth_deg, scan.elevation_deg, within_deg=within_deg)
    if isinstance(spec, PointsScan):
        looks_at = nearest_direction(
            records, scan.azimuth_deg, scan.elevation_deg, within_deg=FARTHEST_POINT_DEG
        )
        column = job.target_column or 0
        own = records.at_rays(looks_at == column)
        found = scan_grid(_alone(own), scan.azimuth_deg[column : column + 1], step_deg=360.0)
        near = Step("near a point", records.rays, int(np.count_nonzero(looks_at >= 0)))
        return found._replace(step=near)
    if spec.type == "stare":
        return scan_grid(_alone(records), scan.azimuth_deg, step_deg=360.0)
    if scan.count == 2:
        passes = alternating_passes(records.azimuth_deg, records.time_utc, longest_s=scan.period_s)
        records = replace(records, sweep_id=passes)
    return scan_grid(records, scan.azimuth_deg, step_deg=spec.step_deg)


def _alone(records: Records) -> Records:
    """Every ray as a pass of its own."""
    return replace(records, sweep_id=np.arange(records.rays))


def _sizes(layout: ScanLayout, sizes_deg: Sequence[float] | None) -> tuple[Size, ...]:
    if not isinstance(layout.spec, SectorScan):
        return (Size(360.0, slice(0, layout.scan.count)),)
    wanted = sorted(sizes_deg or default_sizes(layout), reverse=True)
    return tuple(Size(float(size), subset_of(layout, size)) for size in wanted)


def _towards(layout: ScanLayout, places: Places, place: int) -> ScanJob:
    """A beam towards one of the targets of a scan, at its gate; where it has none, without a gate."""
    name = layout.name
    if not layout.targets:
        return ScanJob(name, "beam", layout, None, None)
    target = layout.targets[place]
    rays = sector_rays(places, layout, layout.scan, target)
    scan, listed = layout.scan, isinstance(layout.spec, PointsScan)
    aim_deg = (float(layout.aim.azimuth_deg[place]), float(layout.aim.elevation_deg[place]))
    off = angle_between_deg(scan.azimuth_deg, scan.elevation_deg, *aim_deg)
    range_m = layout.measured_range_m(layout.range_to_m(target))
    return ScanJob(
        name=job_name(name, target) if listed else name,
        kind="beam",
        layout=layout,
        range_m=range_m,
        height_m=places.height_above_ground_m(target),
        turn_deg=float(np.mean(np.asarray(difference_deg(rays.azimuth_deg, scan.azimuth_deg)))),
        raise_deg=float(np.mean(rays.elevation_deg - scan.elevation_deg)),
        target_column=place if listed else int(np.argmin(off)),
        target_m=range_m,
    )


def _at_gate(job: ScanJob, places: Places, gate_m: float) -> ScanJob:
    """The same at another gate: north stays that at the target, 0.013° a kilometre away at 55° latitude."""
    layout = job.layout
    beam = places.beam_local_m(layout.lidar, layout.scan.azimuth_deg, layout.scan.elevation_deg, gate_m)
    height_m = float(np.mean(beam[:, 2]))  # the origin of the local frame is on the ground
    return job._replace(range_m=gate_m, height_m=height_m)
