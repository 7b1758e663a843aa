"""WindScanner text files: `wind.txt` with `scanner.txt` and `system.txt` beside it.

A line of the wind file is one ray: scan_id; los_id; start_id; stop_id; t_start; t_stop; azimuth; elevation
(some units leave the first two out), then range; radial speed; CNR; dispersion for each gate. Radial speeds
are positive away. Times are seconds since 1904-01-01 of the unit's own clock. **The azimuth of a sweeping ray
is not its middle**: on one unit it leads by nearly a step, and up- and down-sweeps then disagree by 3.5
degrees in wind direction. The middle comes from the scanner file, or is estimated from up- against
down-sweeps.
"""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TypeVar

import numpy as np

from geometry.arrays import FloatArray
from geometry.errors import InputError
from reconstruct.formats.head_positions import RayPositions, ray_positions, read_positions
from reconstruct.formats.options import Options
from reconstruct.formats.over_the_top import folded
from reconstruct.formats.system_log import read_system
from reconstruct.formats.text import seconds_delta, utc_from_labview
from reconstruct.formats.wind_lines import WindLines, read_wind_lines
from reconstruct.losses import Loss, merged_losses
from reconstruct.records import Records
from reconstruct.sweep_ids import sweep_ids
from reconstruct.sweep_lag import estimate_lead, evened, sweep_rate, without_lead

T = TypeVar("T")


def read_windscanner(path: Path, options: Options | None = None) -> Records:
    """Rays of a WindScanner wind file, with the head's positions from the scanner file beside it.

    Parameters
    ----------
    path : Path
        `wind.txt` or `NAME_wind.txt`; `scanner.txt` and `system.txt` are looked for under the same name.
    options : Options, optional
        `azimuth` (scanner, estimate, stored; auto takes the first that can be had), `clock_offset_s`,
        `mounting`, `instrument`.

    Returns
    -------
    Records
        Times at the middle of the ray; azimuth modulo 360, elevation over 90 folded. Damaged lines are in
        `losses`.

    Raises
    ------
    InputError
        If the file holds no ray, or the azimuths asked for cannot be had.
    """
    options = options or Options()
    lines = read_wind_lines(path)
    records = _pointed(path, lines.header, _stored(path, lines, options), options)
    return replace(records, losses=merged_losses(records.losses)).mounted(options.mounting)


def companion(path: Path, kind: str) -> Path | None:
    """The `scanner` or `system` file that belongs to a wind file, if it is there."""
    head, found, tail = path.name.rpartition("wind")
    beside = path.with_name(f"{head}{kind}{tail}") if found else None
    return beside if beside is not None and beside.is_file() else None


def _stored(path: Path, lines: WindLines, options: Options) -> Records:
    """Records with the angles as the wind file has them."""
    header = lines.header
    start, stop = header[:, 4], header[:, 5]
    azimuth, elevation, note = folded(header[:, 6], header[:, 7])
    time = utc_from_labview((start + stop) / 2) + seconds_delta(options.clock_offset_s)
    notes = ["times turned from seconds since 1904 to UTC at the middle of the ray", *note, *lines.notes]
    if options.clock_offset_s:
        notes.append(f"clock moved by {options.clock_offset_s:g} s")
    speed, cnr, width = lines.gates
    return Records(
        time_utc=time,
        duration_s=stop - start,
        azimuth_deg=azimuth,
        elevation_deg=elevation,
        scan_id=header[:, 0].astype(np.intp),
        sweep_id=sweep_ids(azimuth, elevation),
        range_m=lines.range_m,
        radial_speed_mps=speed,
        cnr_db=cnr,
        spectral_width_mps=width,
        instrument=options.instrument or _unit(path),
        notes=tuple(notes),
        losses=lines.losses,
    )


def _unit(path: Path) -> str:
    """Name of the unit: what stands before the first underscore of the file's name unless it is a date
    (`20161110233000_wind.txt`), or its folder.
    """
    head, found, _ = path.name.partition("_")
    return head if found and not head.isdigit() else path.parent.name


def _pointed(path: Path, header: FloatArray, records: Records, options: Options) -> Records:
    """Records with the angles of the middle of the ray, and with the attitude, where that can be had."""
    records = _with_system(records, companion(path, "system"), header)
    if options.azimuth == "stored":
        return _noted(records, "azimuths as stored, which may lead the middle of the ray by up to a step")
    scanner = companion(path, "scanner")
    if options.azimuth in ("auto", "scanner") and scanner is not None:
        log, lost = _if_readable(read_positions, scanner)
        records = replace(records, losses=(*records.losses, *lost))
        found = ray_positions(log, header[:, 2], header[:, 3]) if log is not None else None
        if found is not None and np.any(found.covered):
            return _from_positions(records, found)
    if options.azimuth == "scanner":
        raise InputError(
            f"{path}: the scanner file is missing or covers none of the rays: put it beside the wind file, "
            "or take the "
            "azimuths 'estimate' or 'stored'"
        )
    return _from_estimate(records, options)


def _with_system(records: Records, system: Path | None, header: FloatArray) -> Records:
    """Records with the logged attitude, and with what the GPS says of the clock."""
    if system is None:
        return records
    log, lost = _if_readable(read_system, system)
    records = replace(records, losses=(*records.losses, *lost))
    if log is None:
        return records
    attitude = log.attitude_at(header[:, 2], header[:, 3])
    return _noted(replace(records, **attitude), *log.clock_notes(header[:, 2:6]))  # type: ignore[arg-type]


def _if_readable(reader: Callable[[Path], tuple[T, list[Loss]]], path: Path) -> tuple[T | None, list[Loss]]:
    """A file beside the wind file, or the loss of it: the wind file is read without."""
    try:
        return reader(path)
    except InputError as error:
        return None, [Loss(path.name, str(error).removeprefix(f"{path}: "))]


def _from_positions(records: Records, found: RayPositions) -> Records:
    """Angles of the head's log; rays that it misses are turned back by the usual lead."""
    azimuth, elevation, _ = folded(
        np.where(found.covered, found.azimuth_deg, 0.0), np.where(found.covered, found.elevation_deg, 0.0)
    )
    way = np.sign(sweep_rate(records))
    difference = np.mod(records.azimuth_deg - azimuth + 180.0, 360.0) - 180.0
    leads = (difference * way)[found.covered & (way != 0)]
    lead = 0.0 if found.standing or not len(leads) else float(np.median(leads))
    usual = without_lead(records, lead)
    azimuth = np.where(found.covered, azimuth, usual.azimuth_deg)
    elevation = np.where(found.covered, elevation, records.elevation_deg)
    what = "where the head came to stand" if found.standing else "the mean over the ray"
    note = f"angles from the scanner file: {what}; the stored azimuths lead by {lead:.2f} deg (median)"
    missed = int(np.sum(~found.covered))
    if missed:
        note += f"; of {missed} of {records.rays} rays it has nothing: they are turned back by the median"
    turned = replace(
        records, azimuth_deg=azimuth, elevation_deg=elevation, sweep_id=sweep_ids(azimuth, elevation)
    )
    return _noted(turned, note)


def _from_estimate(records: Records, options: Options) -> Records:
    """Azimuths turned back by the lead that up- against down-sweeps show."""
    even, moved = evened(records)
    try:
        found = estimate_lead(even)
    except InputError as error:
        if options.azimuth == "estimate":
            raise
        return _noted(records, f"azimuths as stored: there is no scanner file, and {error}")
    note = (
        f"there is no scanner file: azimuths turned back by {found.lead_deg:.2f} +- {found.std_deg:.2f} deg, "
        f"the lead that up- against down-sweeps show ({found.sweeps} sweeps); rays off the even "
        f"motion of their sweep and brought onto it: {moved}"
    )
    return _noted(without_lead(even, found.lead_deg), note)


def _noted(records: Records, *notes: str) -> Records:
    return replace(records, notes=(*records.notes, *notes))
