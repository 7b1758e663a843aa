"""Where in the ray a file's stamps stand, and rays brought to their middles."""

import re
from dataclasses import replace
from typing import Any

import numpy as np

from geometry.angles import wrap_180_deg
from geometry.arrays import FloatArray
from reconstruct.formats.options import Stamp
from reconstruct.formats.over_the_top import folded
from reconstruct.formats.text import seconds_delta
from reconstruct.records import Records

#: Larger steps from ray to ray are a head that goes to its next point, not one that sweeps while it measures
#: [deg].
LARGEST_SWEPT_DEG = 10.0

#: Words in a file's attributes by which a WindCube is known.
WINDCUBE = ("windcube", "leosphere", "wls")

#: Words in which WindCube's files say it of their times and azimuths.
_END = re.compile(r"the end of each ray|when each measurement finished")


def stamp_of(attributes: dict[str, Any], said: str, asked: Stamp) -> Stamp:
    """Where in the ray the stamps stand.

    Parameters
    ----------
    attributes : dict
        Of the file and the sweep.
    said : str
        What the file says of its times and azimuths.
    asked : str
        "auto" to find out.

    Examples
    --------
    >>> stamp_of({}, "Number of seconds between time_reference and the end of each ray measurement.", "auto")
    'end'
    """
    if asked != "auto":
        return asked
    own = attributes.get("ray_stamp")
    if own in ("start", "middle", "end"):
        return str(own)  # type: ignore[return-value]
    text = " ".join(
        str(attributes.get(name, ""))
        for name in ("title", "institution", "source", "instrument_name", "history")
    )
    known = any(word in text.lower() for word in WINDCUBE) or _END.search(said.lower()) is not None
    return "end" if known else "middle"


def to_middle(records: Records, stamp: Stamp) -> Records:
    """The same rays with time and angles of their middles."""
    if stamp in ("middle", "auto") or not records.rays:
        return replace(records, notes=(*records.notes, "times and angles as stored"))
    half = 0.5 if stamp == "start" else -0.5
    seconds = np.diff(records.time_utc) / np.timedelta64(1, "s")
    usual = float(np.median(seconds)) if len(seconds) else 0.0
    duration = np.where(np.isfinite(records.duration_s), records.duration_s, usual)
    turn, lift = _swept(records, usual)
    share = half * np.clip(duration / usual, 0.0, 1.0) if usual > 0 else np.zeros(records.rays)
    azimuth, elevation, _ = folded(records.azimuth_deg + share * turn, records.elevation_deg + share * lift)
    note = (
        f"stamps turned from the {stamp} to the middle of the ray: time by "
        f"{half * float(np.median(duration)):g} s, azimuth by "
        f"{float(np.median(np.abs(share * turn))):.3f} deg, elevation by "
        f"{float(np.median(np.abs(share * lift))):.3f} deg (median)"
    )
    if guessed := int(np.count_nonzero(~np.isfinite(records.duration_s))):
        note += (
            f"; the file states no duration of {guessed} rays: taken as their usual spacing of {usual:g} s"
        )
    time = records.time_utc + seconds_delta(half * duration)
    order = np.argsort(time, kind="stable")
    return replace(
        records.at_rays(order),
        time_utc=time[order],
        azimuth_deg=azimuth[order],
        elevation_deg=elevation[order],
        duration_s=duration[order],
        notes=(*records.notes, note),
    )


def _swept(records: Records, usual_s: float) -> tuple[FloatArray, FloatArray]:
    """(ray,) turn of azimuth and elevation from the ray before, within a sweep; 0 where the head jumps or
    stands [deg].
    """
    if records.rays < 2:
        return np.zeros(records.rays), np.zeros(records.rays)
    seconds = np.diff(records.time_utc) / np.timedelta64(1, "s")
    turn, lift = np.asarray(wrap_180_deg(np.diff(records.azimuth_deg))), np.diff(records.elevation_deg)
    sweeping = np.hypot(turn, lift) <= LARGEST_SWEPT_DEG
    usable = sweeping & (np.diff(records.sweep_id) == 0) & (seconds < 2.5 * max(usual_s, 1e-9))
    both = []
    for step in (turn, lift):
        own = np.where(usable, step, np.nan)
        before, after = (
            np.append(np.nan, own),
            np.append(own, np.nan),
        )  # the first ray of a sweep goes on as the next does
        both.append(np.nan_to_num(np.where(np.isfinite(before), before, after)))
    return both[0], both[1]
