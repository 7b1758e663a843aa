"""The names under which netCDF files of Doppler lidars keep their quantities, and their times."""

import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from geometry.arrays import FloatArray
from geometry.errors import InputError
from reconstruct.formats.text import seconds_delta
from reconstruct.records import TimeArray

if TYPE_CHECKING:
    import xarray as xr

#: Each quantity: names of variables, most telling first, then standard names.
TIME = ("time", "timestamp", "time_offset")
AZIMUTH = ("azimuth", "azi", "azimuth_angle", "sensor_azimuth_angle", "ray_azimuth_angle")
ELEVATION = ("elevation", "ele", "elevation_angle", "sensor_elevation_angle", "ray_elevation_angle")
RANGE = ("range", "distance", "radial_distance", "gate_range", "range_gate", "projection_range_coordinate")
SPEED = (
    "radial_wind_speed",
    "radial_velocity",
    "velocity",
    "doppler_velocity",
    "VEL",
    "VR",
    "VRADH",
    "VRAD",
    "radial_speed",
    "v",
    "dv",
    "radial_velocity_of_scatterers_away_from_instrument",
    "radial_velocity_of_scatterers_toward_instrument",
)
CNR = ("cnr", "CNR", "carrier_to_noise_ratio", "snr", "SNR", "signal_to_noise_ratio")
INTENSITY = ("intensity",)
WIDTH = ("doppler_spectrum_width", "spectrum_width", "spectral_width", "WIDTH", "dispersion")
QUALITY = ("radial_wind_speed_ci", "radial_wind_speed_status", "quality")
DURATION = ("ray_accumulation_time", "accumulation_time", "ray_duration")
SWEEP = ("ray_sweep_number",)
HEADING = ("heading", "platform_yaw", "platform_orientation")
PITCH = ("pitch", "platform_pitch", "platform_pitch_fore_up")
ROLL = ("roll", "platform_roll", "platform_roll_starboard_down")

_SINCE = re.compile(
    r"(?P<unit>\w+)\s+since\s+(?P<date>\d{4}-\d{1,2}-\d{1,2})"
    r"(?:[T ]+(?P<clock>\d{1,2}:\d{2}(?::\d{2}(?:\.\d+)?)?))?"
    r"\s*(?:Z|UTC|(?P<way>[-+])?(?P<ahead_h>\d{1,2}):?(?P<ahead_min>\d{2}))?"
)

_SECONDS = {
    "s": 1.0,
    "sec": 1.0,
    "second": 1.0,
    "seconds": 1.0,
    "ms": 1e-3,
    "milliseconds": 1e-3,
    "minutes": 60.0,
    "hours": 3600.0,
    "days": 86400.0,
    "microseconds": 1e-6,
    "nanoseconds": 1e-9,
}


def find(data: "xr.Dataset", names: tuple[str, ...]) -> str | None:
    """Name of the first variable that is there under one of these names, or with one of them as its standard
    name.
    """
    for name in names:
        if name in data.variables:
            return name
    for variable in data.variables:
        if data[variable].attrs.get("standard_name") in names:
            return str(variable)
    return None


def find_speed(data: "xr.Dataset") -> str | None:
    """Name of the variable with the radial speeds.

    A `wind_speed` is one beside a signal strength: so the files of the Wind Data Hub call it, that
    github.com/StefanoWind/FIEXTA (lidargo) makes of HALO's.
    """
    named = find(data, SPEED)
    if named is None and "wind_speed" in data.variables and data["wind_speed"].ndim == 2:
        return "wind_speed" if find(data, (*CNR, *INTENSITY)) else None
    return named


def floats(data: "xr.Dataset", name: str | None) -> FloatArray:
    """A variable's numbers; what a damaged file holds instead of numbers becomes NaN."""
    with np.errstate(invalid="ignore"):  # signalling NaN
        values = np.asarray(data[name].to_numpy(), dtype=float)
    return np.where(np.isfinite(values), values, np.nan)


def times(data: "xr.Dataset", root: dict[str, Any], path: Path) -> TimeArray:
    """(ray,) UTC of the file's times; NaT where it has none.

    Raises
    ------
    InputError
        If the file does not say since when it counts.
    """
    variable = data[find(data, TIME)]
    values = np.asarray(variable)
    if values.dtype.kind in "SUO":
        words = [_text(value) for value in values.ravel()]
        parsed = pd.to_datetime(words, utc=True, errors="coerce", format="ISO8601")
        return np.asarray(parsed.tz_localize(None), dtype="datetime64[ns]")
    reference = (
        data["time_reference"].to_numpy()
        if "time_reference" in data.variables
        else root.get("time_reference")
    )
    units = str(variable.attrs.get("units", ""))
    found = _SINCE.match(units)
    if found is None and reference is not None:
        found = _SINCE.match(f"{units.split()[0] if units.split() else 'seconds'} since {_text(reference)}")
    if found is None or found["unit"] not in _SECONDS:
        raise InputError(
            f"{path}: the times count in {units!r}: 'seconds since 2021-06-30T15:20:22Z' or the like is "
            "needed"
        )
    year, month, day = found["date"].split("-")
    hour, _, rest = (found["clock"] or "00:00").partition(":")
    try:
        start = np.datetime64(f"{year}-{int(month):02d}-{int(day):02d}T{int(hour):02d}:{rest}", "ns")
    except ValueError:
        raise InputError(f"{path}: the times count in {units!r}, which is no date") from None
    ahead_s = 3600.0 * int(found["ahead_h"] or 0) + 60.0 * int(found["ahead_min"] or 0)
    ahead_s *= -1.0 if found["way"] == "-" else 1.0
    seconds = floats(data, find(data, TIME)) * _SECONDS[found["unit"]] - ahead_s  # a zone ahead of UTC
    known = np.isfinite(seconds)
    return np.where(known, start + seconds_delta(np.where(known, seconds, 0.0)), np.datetime64("NaT", "ns"))


def to_number(value: object) -> int:
    """A file's number as an integer; 0 where it has none or it is no number."""
    found = re.fullmatch(r"\s*(\d+)\s*", str(value))
    return int(found[1]) if found else 0


def _text(value: object) -> str:
    item = np.ravel(np.asarray(value))[0]
    return item.decode() if isinstance(item, bytes) else str(item)
