"""One part of the measured rays of one scan: filtered, cut into scans and sizes, retrieved, summed."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from geometry.arrays import BoolArray, FloatArray, IntArray
from planner.campaign import CNR_DB, Campaign, Filters
from planner.scan_jobs import ScanJob, Size, gridded
from planner.signal_noise import cnr_weights
from reconstruct.automatic_filter import Agreement, Window, compare_filters, filter_outliers
from reconstruct.averaging import PeriodSums, TimeArray, period_sums
from reconstruct.beam_means import BeamSums, along_beam_mps, beam_sums
from reconstruct.filters import (
    OPEN,
    Filtered,
    Step,
    goodness,
    keep,
    limit_cnr,
    limit_goodness,
    limit_radial_speed,
    partial_scans,
)
from reconstruct.pairing import RaySeries
from reconstruct.records import Records
from reconstruct.retrieval import REASONS, Retrieval
from reconstruct.scan_grid import ScanGrid
from reconstruct.sector_scan import sector_wind
from reconstruct.wind import from_deg, speed_mps

LEAST_WINDOW_SCANS = 10  # a median and its deviation of fewer are hardly robust


class ScanPart(NamedTuple):
    """What one part gave."""

    fast: dict[str, FloatArray | TimeArray]  # one row a scan and size; `status` says why a wind is not known
    sums: dict[tuple[float, float], PeriodSums]  # by size and period
    beams: dict[float, BeamSums]  # by period: radial speeds of what is no fan; cell = ray * gates + gate
    gates_m: FloatArray  # (gate,) true ranges of a grid's gates
    series: RaySeries  # rays at the target, for pairs
    steps: tuple[Step, ...]
    lost: dict[str, int]  # scans without a wind, by reason and size
    agreement: Agreement
    offset_deg: float


def retrieve_part(records: Records, job: ScanJob, campaign: Campaign) -> ScanPart:
    """Work on one part: whole passes, with true angles.

    Parameters
    ----------
    records
        With one gate; of a grid with all that there are.
    job
        The scan.
    campaign
        Filters, averaging.
    """
    if job.kind == "grid":
        return _grid_part(records, job, campaign)
    found = gridded(records, job)
    grid = found.grid
    filtered, steps, agreement = filter_rays(grid, campaign.filters, period_s=job.layout.scan.period_s)
    part = empty_part()._replace(
        series=_series(grid, filtered, job),
        steps=(found.step, *steps),
        agreement=agreement,
        offset_deg=found.offset_deg,
    )
    return _fan_part(part, grid, filtered, job, campaign) if job.sizes else _beam_part(part, campaign)


def _fan_part(
    part: ScanPart, grid: ScanGrid, filtered: FloatArray, job: ScanJob, campaign: Campaign
) -> ScanPart:
    """The winds of a fan, of every size, and their sums."""
    whole = partial_scans(filtered, ray_share=campaign.filters.ray_share)
    steps, lost = [*part.steps, whole.step], dict[str, int]()
    weights = None
    if campaign.weights == "cnr":
        weights = cnr_weights(grid.cnr_db, job.layout, noise_mps=campaign.filters.noise_mps)
        steps.append(keep(whole.values, weights > 0, "CNR for its weight").step)
    fast: list[dict[str, FloatArray | TimeArray]] = []
    sums: dict[tuple[float, float], PeriodSums] = {}
    for size in job.sizes:
        table, step, unknown = _fit(grid, whole.values, weights, size, job, campaign)
        if judges_fit(campaign.filters):
            steps.append(step)
        lost |= {f"{reason}, {size.sector_deg:g}°": count for reason, count in unknown.items()}
        fast.append(table)
        sums |= {
            (size.sector_deg, period_s): period_sums(
                np.asarray(table["time_utc"]).astype("datetime64[ns]"),
                np.asarray(table["u_mps"], dtype=float),
                np.asarray(table["v_mps"], dtype=float),
                w_mps=np.asarray(table["w_mps"], dtype=float) if "w_mps" in table else None,
                period_s=period_s,
                shift_s=campaign.averaging.time_shift_s,
            )
            for period_s in periods_of(campaign)
        }
    together = {name: np.concatenate([table[name] for table in fast]) for name in fast[0]}
    beams = {}
    if job.two_beam is not None:
        known = np.isfinite(filtered)
        cell = np.broadcast_to(np.arange(filtered.shape[1]), filtered.shape)[known]
        beams = _beam_sums(grid.time_utc[known], cell, filtered[known], campaign, [job.two_beam.period_s])
    return part._replace(fast=together, sums=sums, beams=beams, steps=tuple(steps), lost=lost)


def _beam_part(part: ScanPart, campaign: Campaign) -> ScanPart:
    """What one beam gives: its radial speeds, a wind that is not known with the reason, and their sums."""
    rays = part.series.at(np.isfinite(part.series.radial_speed_mps))
    fit = sector_wind(rays.azimuth_deg[:, None], rays.elevation_deg[:, None], rays.radial_speed_mps[:, None])
    table = wind_table(rays.time_utc, fit, float("nan"), np.ones(len(fit.rays), dtype=bool))
    table |= {
        "azimuth_deg": np.mod(np.round(rays.azimuth_deg, 5), 360.0),  # as it is written: 0 and not 360.00000
        "elevation_deg": rays.elevation_deg,
        "radial_speed_mps": rays.radial_speed_mps,
        "along_beam_mps": along_beam_mps(rays.radial_speed_mps, rays.elevation_deg),
    }
    cell = np.zeros(len(rays.time_utc), dtype=np.intp)
    beams = _beam_sums(rays.time_utc, cell, rays.radial_speed_mps, campaign)
    return part._replace(fast=table, beams=beams, lost=fit.lost)


def _grid_part(records: Records, job: ScanJob, campaign: Campaign) -> ScanPart:
    """Radial speeds of a slice or raster at every gate; at the gate of the target, if there is one, as a beam."""
    part, samples = empty_part(), []
    at_target = None if job.target_m is None else records.gate_at(job.target_m)
    for gate in range(records.gates):
        found = gridded(records.at_gates(slice(gate, gate + 1)), job)
        grid = found.grid
        filtered, steps, agreement = filter_rays(grid, campaign.filters, period_s=job.layout.scan.period_s)
        rays = np.broadcast_to(np.arange(filtered.shape[1]), filtered.shape)
        known = np.isfinite(filtered)
        samples.append((grid.time_utc[known], rays[known] * records.gates + gate, filtered[known]))
        part = part._replace(
            steps=add_steps(part.steps, (found.step, *steps)),
            agreement=Agreement(*(a + b for a, b in zip(part.agreement, agreement, strict=True))),
            offset_deg=found.offset_deg,
        )
        if gate == at_target:
            part = part._replace(series=_series(grid, filtered, job))
    if at_target is not None:
        part = _beam_part(part, campaign)
    time, cell, speed = (np.concatenate(each) for each in zip(*samples, strict=True))
    return part._replace(beams=_beam_sums(time, cell, speed, campaign), gates_m=records.range_m)


def _beam_sums(
    time_utc: TimeArray,
    cell: IntArray,
    radial_speed_mps: FloatArray,
    campaign: Campaign,
    periods_s: Sequence[float] | None = None,
) -> dict[float, BeamSums]:
    """Sums over each period; default: the campaign's."""
    return {
        period_s: beam_sums(
            time_utc,
            cell,
            radial_speed_mps,
            period_s=period_s,
            shift_s=campaign.averaging.time_shift_s,
        )
        for period_s in periods_s or periods_of(campaign)
    }


def add_steps(first: Sequence[Step], more: Sequence[Step]) -> tuple[Step, ...]:
    """Steps of one name as one, in their order.

    Examples
    --------
    >>> add_steps([Step("CNR", 10, 9)], [Step("CNR", 5, 5), Step("mine", 1, 1)])
    (Step(name='CNR', before=15, after=14, unit='rays'), Step(name='mine', before=1, after=1, unit='rays'))
    """
    found: dict[str, Step] = {}
    for step in (*first, *more):
        found[step.name] = found[step.name] + step if step.name in found else step
    return tuple(found.values())


def empty_part() -> ScanPart:
    """What a part without any ray gives."""
    nothing = np.empty(0)
    series = RaySeries(np.empty(0, dtype="datetime64[ns]"), nothing, nothing, nothing)
    return ScanPart({}, {}, {}, nothing, series, (), {}, Agreement(0, 0, 0, 0), 0.0)


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
    column = 0 if job.rays_stand_alone or job.target_column is None else job.target_column
    known = ~np.isnat(grid.time_utc[:, column])
    rays = RaySeries(
        grid.time_utc[known, column],
        np.mod(grid.azimuth_deg[known, column] + job.turn_deg, 360.0),
        grid.elevation_deg[known, column] + job.raise_deg,
        speed[known, column],
    )
    return rays.at(np.argsort(rays.time_utc, kind="stable"))


def _fit(
    grid: ScanGrid,
    speed: FloatArray,
    weights: FloatArray | None,
    size: Size,
    job: ScanJob,
    campaign: Campaign,
) -> tuple[dict[str, FloatArray | TimeArray], Step, dict[str, int]]:
    """Winds of the scans of one size: one row a scan that had any ray, and how many have no wind, by reason."""
    azimuth, elevation = (part[..., size.rays] for part in grid.geometry)
    speed = speed[:, size.rays]
    weight = None if weights is None else weights[:, size.rays]
    fit = sector_wind(
        azimuth + job.turn_deg, elevation + job.raise_deg, speed, columns=job.columns, weights=weight
    )
    filters = campaign.filters
    good = goodness(fit, speed, noise_mps=filters.noise_mps, weights=weight)
    kept = limit_goodness(
        fit.wind_mps[:, 0],
        good,
        residual_std_mps=filters.residual_std_mps,
        r_squared=filters.r_squared,
        reduced_chi2=filters.reduced_chi2,
    )
    unknown = (fit.status > 0) & (fit.rays > 0)
    left = np.isfinite(kept.values) | unknown
    table = wind_table(grid.middle_utc, fit, size.sector_deg, left)
    table |= {"r_squared": good.r_squared[left], "reduced_chi2": good.reduced_chi2[left]}
    name = f"{kept.step.name}, {size.sector_deg:g}°"
    reasons = {
        REASONS[status]: int(count) for status, count in enumerate(np.bincount(fit.status[unknown])) if count
    }
    return table, kept.step._replace(name=name), reasons


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
        "status": fit.status[left].astype(float),
    }
