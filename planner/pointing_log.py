"""Rays as their file has them -> rays at UTC that point where the beam did: clock, lead of the stamps, attitude, mounting.

What holds for a whole campaign (the lead, from where changes of the attitude count) is found in the first part that
shows it and handed on from part to part.
"""

from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

import numpy as np

from geometry.angles import circular_mean_deg
from geometry.arrays import BoolArray, FloatArray
from geometry.errors import InputError
from geometry.head import Mounting
from planner.campaign import RayInput
from planner.campaign_logs import Attitude
from planner.places import Places
from planner.scan_layout import ScanLayout
from reconstruct.alignment import LONGEST_GAP
from reconstruct.attitude import ATTITUDE, LogMeans, changes_from, log_means, pointing_angles, running_mean
from reconstruct.averaging import TimeArray
from reconstruct.records import Records
from reconstruct.sweep_lag import estimate_lead, without_lead

REFERENCE_S = 600.0  # a compass of 1° scatter and one sample a second is known to better than 0.1° by then


class Known(NamedTuple):
    """What an instrument's data have shown so far."""

    lead: tuple[float, float, int] | None = None  # its degrees, their standard deviation, sweeps
    reference_deg: tuple[float, float, float] | None = None  # heading, pitch, roll; NaN where not logged


NOTHING_KNOWN = Known()


class Pointed(NamedTuple):
    """Rays with pointing angles, and what their log says."""

    records: Records
    known: Known
    log: LogMeans | None  # None where nothing is logged
    unlogged: int  # rays without a logged attitude while others have one


def pointed(
    records: Records, item: RayInput, layout: ScanLayout, places: Places, known: Known = NOTHING_KNOWN
) -> Pointed:
    """Give rays their time and their pointing angles.

    Parameters
    ----------
    records
        As their file has them.
    item, layout, places
        What the campaign and the site say of them.
    known
        What earlier parts have shown.

    Returns
    -------
    Pointed

    Raises
    ------
    InputError
        If the lead is to be estimated and cannot be.
    """
    if seconds := item.offsets.clock_s:
        moved = records.time_utc + np.timedelta64(round(seconds * 1e9), "ns")
        records = _noted(replace(records, time_utc=moved), f"clock moved by {seconds:+.4g} s")
    records, known = _turned_back(records, item, known)
    return _mounted(records, item, layout, places, known)


def require_log(asked: Attitude) -> str:
    """Read a separate log before any ray.

    Returns
    -------
    str
        What changes when the log does; empty where there is none.

    Raises
    ------
    InputError
        If it is asked for and cannot be read, or has not the columns that it is said to have.
    """
    if asked.path is None:
        return ""
    _read_log(*_log_key(asked))
    stat = Path(asked.path).stat()
    return f"{stat.st_size} {stat.st_mtime_ns}"


def mounting_of(item: RayInput, layout: ScanLayout, places: Places) -> Mounting:
    """The site's mounting with the input's own offsets on top; of true angles the offsets alone."""
    stands = places.mounting(layout.lidar) if item.angles == "head" else Mounting()
    more = item.offsets
    return replace(
        stands,
        azimuth_offset_deg=stands.azimuth_offset_deg + more.azimuth_deg,
        elevation_offset_deg=stands.elevation_offset_deg + more.elevation_deg,
        range_offset_m=stands.range_offset_m + more.range_m,
    )


def _noted(records: Records, note: str) -> Records:
    return replace(records, notes=(*records.notes, note))


def _turned_back(records: Records, item: RayInput, known: Known) -> tuple[Records, Known]:
    """Azimuths without the lead of their stamps, as given or found."""
    asked = item.azimuth_lead_deg
    if asked == 0 or not records.rays:
        return records, known
    if asked != "estimate":
        return _noted(
            without_lead(records, asked), f"azimuths turned back by {asked:g}°, their given lead"
        ), known
    lead = known.lead or estimate_lead(records)
    note = (
        f"azimuths turned back by {lead[0]:.2f} ± {lead[1]:.2f}°, the lead that {lead[2]} up- and down-sweeps show "
        "(the first that there are)"
    )
    return _noted(without_lead(records, lead[0]), note), known._replace(lead=(lead[0], lead[1], lead[2]))


def _mounted(records: Records, item: RayInput, layout: ScanLayout, places: Places, known: Known) -> Pointed:
    """Pointing angles by the mounting and what is logged of it."""
    stands, asked = mounting_of(item, layout, places), item.attitude
    logged = _logged(records, asked)
    if asked.path is not None and (lost := _read_log(*_log_key(asked))[2]):
        records = _noted(records, lost)
    there = np.isfinite(logged)
    if not np.any(there):
        unlogged = records.rays if known.reference_deg is not None else 0
        return Pointed(records.mounted(stands), known, None, unlogged)
    reference = known.reference_deg or _reference(records.time_utc, logged, asked)
    known = known._replace(reference_deg=reference)
    changes = changes_from(logged, np.array(reference))
    means = log_means(records.time_utc, changes)
    unlogged = int(np.count_nonzero(~np.any(there, axis=1)))
    if asked.use == "off" or item.angles == "true":
        why = "attitude.use is off" if asked.use == "off" else "angles are true ones already"
        note = f"{_names(there)} are logged and not used: {why}"
        return Pointed(_noted(records.mounted(stands), note), known, means, unlogged)
    smooth = np.stack([_followed(records.time_utc, column, asked.smooth_s) for column in changes.T], axis=1)
    base = np.array([stands.heading_deg, stands.pitch_deg, stands.roll_deg])
    if asked.use == "absolute":
        base = np.where(np.isfinite(reference), reference, base)
    heading, pitch, roll = (base + np.nan_to_num(smooth)).T
    azimuth, elevation = pointing_angles(
        records.azimuth_deg,
        records.elevation_deg,
        stands,
        heading_deg=heading,
        pitch_deg=pitch,
        roll_deg=roll,
    )
    records = _noted(records.mounted(stands), _followed_note(there, reference, asked))
    return Pointed(replace(records, azimuth_deg=azimuth, elevation_deg=elevation), known, means, unlogged)


def _logged(records: Records, asked: Attitude) -> FloatArray:
    """(ray, 3) logged heading, pitch and roll in our signs; NaN where nothing is."""
    own = [getattr(records, name) for name in ATTITUDE]
    columns = [np.full(records.rays, np.nan) if values is None else values for values in own]
    if asked.path is not None:
        columns = _interpolated(records.time_utc, asked)
    factors = [asked.factors.get(name, 1.0) for name in ATTITUDE]
    return np.stack([factor * values for factor, values in zip(factors, columns, strict=True)], axis=1)


def _interpolated(time_utc: TimeArray, asked: Attitude) -> list[FloatArray]:
    """The columns of a separate log at the times of rays; NaN before its beginning, after its end and in its gaps."""
    stamps, logged, _ = _read_log(*_log_key(asked))
    ticks = time_utc.astype(np.int64).astype(float)
    found = []
    for column in logged:
        known = np.isfinite(column)
        if not np.any(known):
            found.append(np.full(len(ticks), np.nan))
            continue
        at, even = stamps[known], np.unwrap(column[known], period=360.0)
        values = np.interp(ticks, at, even, left=np.nan, right=np.nan)
        found.append(np.where(_in_gap(at, ticks), np.nan, values))
    return found


def _in_gap(at: FloatArray, ticks: FloatArray) -> BoolArray:
    """Which times (ray,) lie between two entries that are farther apart than a log's usual step allows."""
    step = np.diff(at)
    if not len(step):
        return np.zeros(len(ticks), dtype=bool)
    after = np.clip(np.searchsorted(at, ticks), 1, len(step))
    return np.asarray((step[after - 1] > LONGEST_GAP * np.median(step)) & (ticks < at[after]))


def _log_key(asked: Attitude) -> tuple[str, str, tuple[str, str, str], str, int]:
    """What `_read_log` is asked with; a file that has been written since is read again."""
    path, names = asked.path or "", (asked.heading, asked.pitch, asked.roll)
    written = Path(path).stat().st_mtime_ns if Path(path).is_file() else 0
    return path, asked.time, names, asked.separator, written


@lru_cache(maxsize=8)
def _read_log(
    path: str,
    time: str,
    names: tuple[str, str, str],
    separator: str,
    written: int,  # noqa: ARG001 - part of the key
) -> tuple[FloatArray, tuple[FloatArray, ...], str]:
    """Times [ns since 1970], rising, heading, pitch and roll of a CSV, and what of it was lost, in words.

    A column that it does not have is NaN.
    """
    import pandas as pd

    try:
        frame = pd.read_csv(Path(path), sep=separator, skipinitialspace=True)
    except (OSError, ValueError) as error:
        raise InputError(f"attitude log {path} cannot be read as CSV ({error})") from error
    if time not in frame.columns or not set(names) & set(frame.columns):
        have = ", ".join(map(str, frame.columns))
        raise InputError(
            f"attitude log {path} has the columns {have}; needed are {time} and one of {', '.join(names)}: give the "
            "names under `attitude`"
        )
    stamps = pd.to_datetime(frame[time], utc=True, errors="coerce", format="ISO8601")
    timeless = int(stamps.isna().sum())
    frame = frame[stamps.notna()].assign(**{time: stamps[stamps.notna()]}).sort_values(time, kind="stable")
    if frame.empty:
        raise InputError(f"attitude log {path} has no time in {time}: it has to be ISO 8601, UTC")
    ticks = (
        frame[time].dt.tz_localize(None).to_numpy().astype("datetime64[ns]").astype(np.int64).astype(float)
    )
    columns, wrong = [], 0
    for name in names:
        if name not in frame.columns:
            columns.append(np.full(len(frame), np.nan))
            continue
        numbers = pd.to_numeric(frame[name], errors="coerce").to_numpy(dtype=float)
        wrong += int(np.count_nonzero(~np.isfinite(numbers) & frame[name].notna().to_numpy()))
        columns.append(np.where(np.isfinite(numbers), numbers, np.nan))
    counts = {"rows without a time": timeless, "angles that are no number": wrong}
    lost = ", ".join(f"{what}: {count}" for what, count in counts.items() if count)
    return ticks, tuple(columns), f"lost: {Path(path).name}, {lost}" if lost else ""


def _reference(time_utc: TimeArray, logged: FloatArray, asked: Attitude) -> tuple[float, float, float]:
    """From where changes count: as given, or the mean over the first minutes of the log."""
    if asked.use != "absolute" and asked.reference is not None:
        given = asked.reference
        return (given.heading_deg, given.pitch_deg, given.roll_deg)
    seconds = (time_utc - time_utc[0]) / np.timedelta64(1, "s")
    begins = seconds[np.any(np.isfinite(logged), axis=1)][0]
    first = logged[(seconds >= begins) & (seconds <= begins + max(asked.smooth_s, REFERENCE_S))]
    heading, pitch, roll = (
        float(circular_mean_deg(column[np.isfinite(column)])) if np.any(np.isfinite(column)) else float("nan")
        for column in first.T
    )
    return (heading, _around_zero(pitch), _around_zero(roll))


def _around_zero(angle_deg: float) -> float:
    return angle_deg - 360.0 if angle_deg > 180.0 else angle_deg


def _followed(time_utc: TimeArray, changes_deg: FloatArray, smooth_s: float) -> FloatArray:
    """Changes for every ray: smoothed, and the nearest in time where nothing is logged; NaN where nothing ever is."""
    smooth = running_mean(time_utc, changes_deg, window_s=smooth_s)
    known = np.isfinite(smooth)
    if not np.any(known):
        return smooth
    ticks = time_utc.astype(np.int64).astype(float)
    return np.asarray(np.interp(ticks, ticks[known], smooth[known]))


def _names(there: FloatArray) -> str:
    held = [
        name.removesuffix("_deg") for name, any_ in zip(ATTITUDE, np.any(there, axis=0), strict=True) if any_
    ]
    return held[0] if len(held) == 1 else f"{', '.join(held[:-1])} and {held[-1]}"


def _followed_note(there: FloatArray, reference: tuple[float, float, float], asked: Attitude) -> str:
    held = np.any(there, axis=0)
    start = ", ".join(
        f"{name.removesuffix('_deg')} {value:.2f}°"
        for name, value, any_ in zip(ATTITUDE, reference, held, strict=True)
        if any_
    )
    mean = f"their mean over {asked.smooth_s:g} s" if asked.smooth_s else "as logged, ray by ray"
    if asked.use == "absolute":
        return f"pointing follows the logged {_names(there)} in place of the site's mounting, {mean}"
    return f"pointing follows the log's changes of {_names(there)} from {start}, {mean}"
