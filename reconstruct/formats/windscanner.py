"""WindScanner text files: `wind.txt` with `scanner.txt` and `system.txt` beside it.

A line of the wind file is one ray: scan_id; los_id; start_id; stop_id; t_start; t_stop; azimuth; elevation
(some units leave the first two out), then range; radial speed; CNR; dispersion for each gate. Radial speeds
are positive away. Times are seconds since 1904-01-01 of the unit's own clock. **The azimuth of a sweeping ray
is not its middle**: on one unit it leads by nearly a step, and up- and down-sweeps then disagree by 3.5
degrees in wind direction. The middle comes from the scanner file, or is estimated from up- against
down-sweeps.
"""

from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from geometry.arrays import BoolArray, FloatArray, IntArray
from geometry.errors import InputError
from reconstruct.formats.gate_union import GateBlock, common_gates
from reconstruct.formats.head_positions import RayPositions, ray_positions, read_attitude, read_positions
from reconstruct.formats.options import Options
from reconstruct.formats.over_the_top import folded
from reconstruct.formats.text import Table, lines_of, number_tables, seconds_delta, utc_from_labview
from reconstruct.losses import Loss, merged_losses
from reconstruct.records import Records
from reconstruct.sweep_ids import sweep_ids
from reconstruct.sweep_lag import estimate_lead, evened, sweep_rate, without_lead

#: Header fields of one ray; units without scan_id and los_id write the last six.
LONG_HEADER, SHORT_HEADER = 8, 6

#: Numbers of one gate: range, radial speed, CNR, dispersion.
GATE_NUMBERS = 4

#: Seconds since 1904 of any lidar campaign lie above this (1967-05), below it is no time.
EARLIEST_S = 2.0e9

#: They lie below this (2126).
LATEST_S = 7.0e9


class _Wind(NamedTuple):
    header: FloatArray  # (ray, 8)
    block: GateBlock
    line: IntArray  # (ray,)


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
    tables, losses = number_tables(lines_of(path), path.name)
    split = [_split(table, path, losses) for table in tables]
    winds = [wind for wind in split if wind is not None and len(wind.line)]
    if not winds:
        raise InputError(
            f"{path}: no line is a ray: {SHORT_HEADER} or {LONG_HEADER} header fields and {GATE_NUMBERS} "
            "numbers for each "
            "gate are needed, separated by ';'"
        )
    header = np.concatenate([wind.header for wind in winds])
    range_m, gates = common_gates([wind.block for wind in winds])
    order = np.argsort(header[:, 4] + header[:, 5], kind="stable")
    records = _stored(path, header[order], range_m, [values[order] for values in gates], options)
    records = _pointed(path, header[order], replace(records, losses=tuple(losses)), options)
    return replace(records, losses=merged_losses(records.losses)).mounted(options.mounting)


def companion(path: Path, kind: str) -> Path | None:
    """The `scanner` or `system` file that belongs to a wind file, if it is there."""
    head, found, tail = path.name.rpartition("wind")
    beside = path.with_name(f"{head}{kind}{tail}") if found else None
    return beside if beside is not None and beside.is_file() else None


def _split(table: Table, path: Path, losses: list[Loss]) -> _Wind | None:
    """Header and gates of lines of one width; None, with the loss, if they are no rays."""
    width = table.values.shape[1]
    for size in (LONG_HEADER, SHORT_HEADER):
        if (
            width <= size
            or (width - size) % GATE_NUMBERS
            or np.mean(_is_time(table.values[:, size - 4])) < 0.5
        ):
            continue
        header = table.values[:, :size]
        if size == SHORT_HEADER:
            header = np.column_stack([np.zeros(len(header)), np.arange(len(header)), header])
        gates = table.values[:, size:].reshape(len(header), -1, GATE_NUMBERS)
        whole = (
            _is_time(header[:, 4])
            & _is_time(header[:, 5])
            & np.all(np.isfinite(header), axis=1)
            & np.all(np.isfinite(gates[..., 0]), axis=1)
        )
        if not np.all(whole):
            text = "an empty field, or a time that is none, in the header or among the ranges"
            losses.append(Loss(path.name, text, int(table.line[~whole][0]), int(np.sum(~whole))))
        return _Wind(header[whole], GateBlock(gates[whole, :, 0], gates[whole, :, 1:]), table.line[whole])
    text = f"{width} fields are no ray: 6 or 8 header fields and 4 numbers for each gate are needed"
    losses.append(Loss(path.name, text, int(table.line[0]), len(table.line)))
    return None


def _is_time(seconds: FloatArray) -> BoolArray:
    """Whether numbers can be times of a campaign in seconds since 1904."""
    return np.asarray((seconds > EARLIEST_S) & (seconds < LATEST_S))


def _stored(
    path: Path, header: FloatArray, range_m: FloatArray, gates: list[FloatArray], options: Options
) -> Records:
    """Records with the angles as the wind file has them."""
    start, stop = header[:, 4], header[:, 5]
    azimuth, elevation, note = folded(header[:, 6], header[:, 7])
    time = utc_from_labview(start) + seconds_delta((stop - start) / 2 + options.clock_offset_s)
    notes = ["times turned from seconds since 1904 to UTC at the middle of the ray", *note]
    if options.clock_offset_s:
        notes.append(f"clock moved by {options.clock_offset_s:g} s")
    speed, cnr, width = gates
    return Records(
        time_utc=time,
        duration_s=np.maximum(stop - start, 0.0),
        azimuth_deg=azimuth,
        elevation_deg=elevation,
        scan_id=header[:, 0].astype(np.intp),
        sweep_id=sweep_ids(azimuth, elevation),
        range_m=range_m,
        radial_speed_mps=speed,
        cnr_db=cnr,
        spectral_width_mps=width,
        instrument=options.instrument or _unit(path),
        notes=tuple(notes),
    )


def _unit(path: Path) -> str:
    """Name of the unit: what stands before the first underscore of the file's name, or its folder."""
    head, found, _ = path.name.partition("_")
    return head if found else path.parent.name


def _pointed(path: Path, header: FloatArray, records: Records, options: Options) -> Records:
    """Records with the angles of the middle of the ray, and with the attitude, where that can be had."""
    system = companion(path, "system")
    if system is not None:
        attitude, lost = read_attitude(system, header[:, 2], header[:, 3])
        records = replace(records, losses=(*records.losses, *lost), **attitude)
    if options.azimuth == "stored":
        return _noted(records, "azimuths as stored, which may lead the middle of the ray by up to a step")
    scanner = companion(path, "scanner")
    if options.azimuth in ("auto", "scanner") and scanner is not None:
        log, lost = read_positions(scanner)
        found = ray_positions(log, header[:, 2], header[:, 3])
        records = replace(records, losses=(*records.losses, *lost))
        if np.any(found.covered):
            return _from_positions(records, found)
    if options.azimuth == "scanner":
        raise InputError(
            f"{path}: the scanner file is missing or covers none of the rays: put it beside the wind file, "
            "or take the "
            "azimuths 'estimate' or 'stored'"
        )
    return _from_estimate(records, options)


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
        note += f"; {missed} rays are not in it and are turned back by the median"
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
        f"the lead that up- against down-sweeps show ({found.sweeps} sweeps); {moved} rays off the even "
        "motion "
        "of their sweep were brought onto it"
    )
    return _noted(without_lead(even, found.lead_deg), note)


def _noted(records: Records, note: str) -> Records:
    return replace(records, notes=(*records.notes, note))
