"""One part of the measured rays of one scan: filtered, cut into scans and sizes, retrieved, summed."""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from geometry.angles import difference_deg
from geometry.arrays import BoolArray, FloatArray
from geometry.errors import InputError
from planner.campaign import CNR_DB, Campaign, Filters
from planner.error_curve import default_sizes
from planner.places import Places
from planner.ray_sets import sector_rays, subset_of
from planner.scan_layout import ScanLayout
from reconstruct.automatic_filter import Agreement, Window, compare_filters, filter_outliers
from reconstruct.averaging import PeriodSums, TimeArray, period_sums
from reconstruct.filters import (
    OPEN,
    Filtered,
    Step,
    goodness,
    limit_cnr,
    limit_goodness,
    limit_radial_speed,
    partial_scans,
)
from reconstruct.pairing import RaySeries
from reconstruct.records import Records
from reconstruct.retrieval import Retrieval
from reconstruct.scan_grid import ScanGrid, scan_grid
from reconstruct.sector_scan import sector_wind
from reconstruct.wind import from_deg, speed_mps

LEAST_WINDOW_SCANS = 10  # a median and its deviation of fewer are hardly robust


class Size(NamedTuple):
    """A sector size and the columns of the whole scan that stand for it; a stare has one without a size."""

    sector_deg: float
    rays: slice


class ScanJob(NamedTuple):
    """What every part of a scan is worked on with."""

    layout: ScanLayout
    planned_azimuth_deg: FloatArray  # (ray,) clockwise, at the lidar
    step_deg: float
    turn_deg: float  # from north at the lidar to north at the target
    raise_deg: float  # the same of the horizontal
    target_column: int  # the ray that looks at the target
    sizes: tuple[Size, ...]  # none for a stare


class ScanPart(NamedTuple):
    """What one part gave."""

    fast: dict[str, FloatArray | TimeArray]  # one row a scan and size
    sums: dict[tuple[float, float], PeriodSums]  # by size and period
    series: RaySeries  # rays at the target, for pairs
    steps: tuple[Step, ...]
    agreement: Agreement
    offset_deg: float


def job_of(layout: ScanLayout, places: Places, sizes_deg: Sequence[float] | None) -> ScanJob:
    """Prepare the retrieval of a scan.

    Raises
    ------
    InputError
        If the scan has no target, cannot be cut into scans, or a size is not one of its own.
    """
    spec = layout.spec
    if not layout.targets or spec.type not in ("sector", "ppi", "stare"):
        raise InputError(
            f"scan '{layout.name}' is a {spec.type} {'with' if layout.targets else 'without'} a target: "
            "a sector, ppi or stare with a target can be retrieved"
        )
    target = layout.targets[0]
    rays = sector_rays(places, layout, layout.scan, target)
    azimuth = layout.scan.azimuth_deg
    off = np.abs(np.asarray(difference_deg(azimuth, float(layout.aim.azimuth_deg[0]))))
    sizes: tuple[Size, ...] = ()
    if spec.type == "sector":
        wanted = sorted(sizes_deg or default_sizes(layout), reverse=True)
        sizes = tuple(Size(float(size), subset_of(layout, size)) for size in wanted)
    elif spec.type == "ppi":
        sizes = (Size(360.0, slice(0, layout.scan.count)),)
    return ScanJob(
        layout=layout,
        planned_azimuth_deg=azimuth,
        step_deg=360.0 if spec.type == "stare" else spec.step_deg,
        turn_deg=float(np.mean(np.asarray(difference_deg(rays.azimuth_deg, azimuth)))),
        raise_deg=float(np.mean(rays.elevation_deg - layout.scan.elevation_deg)),
        target_column=int(np.argmin(off)),
        sizes=sizes,
    )


def retrieve_part(records: Records, job: ScanJob, campaign: Campaign) -> ScanPart:
    """Work on one part: whole passes of one gate, with true angles.

    Parameters
    ----------
    records
        With one gate.
    job
        The scan.
    campaign
        Filters, averaging, columns of the fit.
    """
    if job.layout.scan.count == 1:  # every ray of a stare is a pass
        records = replace(records, sweep_id=np.arange(records.rays))
    gridded = scan_grid(records, job.planned_azimuth_deg, step_deg=job.step_deg)
    grid = gridded.grid
    filtered, steps, agreement = filter_rays(grid, campaign.filters, period_s=job.layout.scan.period_s)
    series = _series(grid, filtered, job)
    steps = (gridded.step, *steps)
    fast: list[dict[str, FloatArray | TimeArray]] = []
    sums: dict[tuple[float, float], PeriodSums] = {}
    if job.sizes:
        whole = partial_scans(filtered, ray_share=campaign.filters.ray_share)
        steps = (*steps, whole.step)
        for size in job.sizes:
            table, step = _fit(grid, whole.values, size, job, campaign)
            steps = (*steps, step) if judges_fit(campaign.filters) else steps
            fast.append(table)
            sums |= {
                (size.sector_deg, period_s): period_sums(
                    np.asarray(table["time_utc"]).astype("datetime64[ns]"),
                    np.asarray(table["u_mps"], dtype=float),
                    np.asarray(table["v_mps"], dtype=float),
                    period_s=period_s,
                    shift_s=campaign.averaging.time_shift_s,
                )
                for period_s in periods_of(campaign)
            }
    together = {name: np.concatenate([table[name] for table in fast]) for name in fast[0]} if fast else {}
    return ScanPart(together, sums, series, steps, agreement, gridded.offset_deg)


def empty_part() -> ScanPart:
    """What a part without any ray gives."""
    nothing = np.empty(0)
    series = RaySeries(np.empty(0, dtype="datetime64[ns]"), nothing, nothing, nothing)
    return ScanPart({}, {}, series, (), Agreement(0, 0, 0, 0), 0.0)


def filter_rays(
    grid: ScanGrid, filters: Filters, *, period_s: float
) -> tuple[FloatArray, tuple[Step, ...], Agreement]:
    """Apply limits, and the automatic filter where it is wanted or a limit is missing.

    Parameters
    ----------
    grid
        Scans of one gate.
    filters
        Limits, and how the automatic filter looks at the data.
    period_s
        From the start of one scan to the next [s].

    Returns
    -------
    values : numpy.ndarray
        (scan, ray) radial speeds [m/s].
    steps : tuple of Step
    agreement : Agreement
        Of the automatic filter with the usual limits of CNR, on the rays that came; zeros where it did not run.
    """
    speed = grid.radial_speed_mps
    steps: list[Step] = []
    cnr = np.where(np.isfinite(speed), grid.cnr_db, np.nan)
    done: Filtered
    if filters.cnr_db is not None:
        done = limit_cnr(speed, cnr, filters.cnr_db)
        speed, steps = done.values, [*steps, done.step]
    if filters.radial_speed_mps is not None:
        done = limit_radial_speed(speed, filters.radial_speed_mps)
        speed, steps = done.values, [*steps, done.step]
    agreement = Agreement(0, 0, 0, 0)
    if uses_automatic(filters):
        scans = max(round(filters.window_s / period_s), LEAST_WINDOW_SCANS)
        window = Window(scans=scans, distance=filters.distance)
        before = speed
        done = filter_outliers(before, np.where(np.isfinite(before), cnr, np.nan), window=window)
        agreement = compare_filters(before, limit_cnr(before, cnr, CNR_DB).values, done.values)
        speed, steps = done.values, [*steps, done.step]
    return speed, tuple(steps), agreement


def uses_automatic(filters: Filters) -> bool:
    """Whether the automatic filter runs: asked for, or in place of a limit that is missing."""
    missing = OPEN in (filters.cnr_db or OPEN, filters.radial_speed_mps or OPEN)
    return filters.automatic == "on" or (filters.automatic == "auto" and missing)


def judges_fit(filters: Filters) -> bool:
    """Whether scans are kept or not by how well they fit."""
    return (filters.residual_std_mps, filters.r_squared, filters.reduced_chi2) != (None, None, None)


def periods_of(campaign: Campaign) -> tuple[float, ...]:
    """The averaging periods [s], that of the comparison among them."""
    wanted = campaign.averaging
    return tuple(sorted({*wanted.periods_s, wanted.compare_s}))


def _series(grid: ScanGrid, speed: FloatArray, job: ScanJob) -> RaySeries:
    """The rays that look at the target, with angles as the target sees them."""
    column = job.target_column
    known = ~np.isnat(grid.time_utc[:, column])
    rays = RaySeries(
        grid.time_utc[known, column],
        np.mod(grid.azimuth_deg[known, column] + job.turn_deg, 360.0),
        grid.elevation_deg[known, column] + job.raise_deg,
        speed[known, column],
    )
    return rays.at(np.argsort(rays.time_utc, kind="stable"))


def _fit(
    grid: ScanGrid, speed: FloatArray, size: Size, job: ScanJob, campaign: Campaign
) -> tuple[dict[str, FloatArray | TimeArray], Step]:
    """Winds of the scans of one size: one row a scan that had any ray."""
    azimuth, elevation = (part[..., size.rays] for part in grid.geometry)
    speed = speed[:, size.rays]
    fit = sector_wind(azimuth + job.turn_deg, elevation + job.raise_deg, speed, columns=campaign.columns)
    filters = campaign.filters
    good = goodness(fit, speed, noise_mps=filters.noise_mps)
    kept = limit_goodness(
        fit.wind_mps[:, 0],
        good,
        residual_std_mps=filters.residual_std_mps,
        r_squared=filters.r_squared,
        reduced_chi2=filters.reduced_chi2,
    )
    left = np.isfinite(kept.values)
    table = wind_table(grid.middle_utc, fit, size.sector_deg, left)
    table |= {"r_squared": good.r_squared[left], "reduced_chi2": good.reduced_chi2[left]}
    name = f"{kept.step.name}, {size.sector_deg:g}°"
    return table, kept.step._replace(name=name)


def wind_table(
    time_utc: TimeArray,
    fit: Retrieval,
    sector_deg: float,
    left: BoolArray,
) -> dict[str, FloatArray | TimeArray]:
    """Columns of the table of single scans."""
    wind, covariance = fit.wind_mps[left], fit.covariance_m2s2[left]
    table: dict[str, FloatArray | TimeArray] = {
        "time_utc": time_utc[left],
        "sector_deg": np.full(len(wind), sector_deg),
        "u_mps": wind[:, 0],
        "v_mps": wind[:, 1],
    }
    if wind.shape[1] == 3:
        table["w_mps"] = wind[:, 2]
    return table | {
        "speed_mps": speed_mps(wind[:, 0], wind[:, 1]),
        "from_deg": from_deg(wind[:, 0], wind[:, 1]),
        "rays": fit.rays[left].astype(float),
        "condition": fit.condition[left],
        "residual_std_mps": fit.residual_std_mps[left],
        "uu_m2s2": covariance[:, 0, 0],
        "uv_m2s2": covariance[:, 0, 1],
        "vv_m2s2": covariance[:, 1, 1],
    }
