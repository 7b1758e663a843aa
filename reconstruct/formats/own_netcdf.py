"""Records as netCDF with CF names, and back without a loss.

Any program that knows CF reads the file; what CF has no place for (nanoseconds, notes, losses) stands beside it.
"""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from geometry.errors import InputError, UnavailableError
from reconstruct.record_tables import TOLD, once_told, told_once
from reconstruct.records import GATE_FIELDS, Records

if TYPE_CHECKING:
    import xarray as xr

#: The global attribute by which a file of ours is known.
MARK = f"lidarplan_{TOLD}"

#: Our field: name in the file, attributes.
_VARIABLES: dict[str, tuple[str, dict[str, str]]] = {
    "time_utc": ("time_utc_ns", {"long_name": "time since 1970-01-01T00:00:00Z", "units": "1e-9 s"}),
    "azimuth_deg": ("azimuth", {"standard_name": "ray_azimuth_angle", "units": "degrees"}),
    "elevation_deg": ("elevation", {"standard_name": "ray_elevation_angle", "units": "degrees"}),
    "duration_s": ("ray_accumulation_time", {"units": "s"}),
    "scan_id": ("ray_scan_id", {"units": "1"}),
    "sweep_id": ("ray_sweep_number", {"units": "1"}),
    "heading_deg": ("heading", {"standard_name": "platform_yaw", "units": "degrees"}),
    "pitch_deg": ("pitch", {"standard_name": "platform_pitch", "units": "degrees"}),
    "roll_deg": ("roll", {"standard_name": "platform_roll", "units": "degrees"}),
    "radial_speed_mps": (
        "radial_wind_speed",
        {"standard_name": "radial_velocity_of_scatterers_away_from_instrument", "units": "m s-1"},
    ),
    "cnr_db": ("cnr", {"standard_name": "carrier_to_noise_ratio", "units": "dB"}),
    "spectral_width_mps": (
        "doppler_spectrum_width",
        {"standard_name": "doppler_spectrum_width", "units": "m s-1"},
    ),
    "quality": ("quality", {"units": "1"}),
}


def write_netcdf(records: Records, path: Path) -> None:
    """Write records as one netCDF file with CF names, stamps at the middle of the ray.

    Raises
    ------
    UnavailableError
        If the extra `data` is not installed.
    """
    start = (
        records.time_utc[0].astype("datetime64[s]") if records.rays else np.datetime64("1970-01-01T00:00:00")
    )
    seconds = (records.time_utc - start) / np.timedelta64(1, "s")
    variables = {}
    for name, values in {**records.ray_fields(), **records.gate_fields()}.items():
        own, attributes = _VARIABLES[name]
        stored = values.astype(np.int64) if values.dtype.kind == "M" else values
        variables[own] = (("time", "range")[: values.ndim], stored, attributes)
    axes = {
        "time": ("time", seconds, {"standard_name": "time", "units": f"seconds since {start}Z"}),
        "range": ("range", records.range_m, {"standard_name": "projection_range_coordinate", "units": "m"}),
    }
    attributes = {
        "Conventions": "CF-1.8",
        "instrument_name": records.instrument,
        "ray_stamp": "middle",
        "comment": "; ".join(records.notes),
        MARK: told_once(records),
    }
    _xarray().Dataset(variables, axes, attributes).to_netcdf(path, engine="netcdf4")


def own_records(data: "xr.Dataset", path: Path) -> Records:
    """Records of a dataset that `write_netcdf` wrote (its attributes hold `MARK`), as they were.

    Raises
    ------
    InputError
        If a variable has been taken out of the file.
    """
    held = {name: own for name, (own, _) in _VARIABLES.items() if own in data.variables}
    fields: dict[str, Any] = {name: data[own].to_numpy() for name, own in held.items()}
    needed = (
        "time_utc",
        "duration_s",
        "azimuth_deg",
        "elevation_deg",
        "scan_id",
        "sweep_id",
        *GATE_FIELDS[:2],
    )
    if missing := [_VARIABLES[name][0] for name in needed if name not in fields]:
        raise InputError(f"{path}: written by lidarplan, but {', '.join(missing)} has been taken out since")
    fields["time_utc"] = fields["time_utc"].astype("datetime64[ns]")
    return Records(**once_told(data.attrs[MARK]), **fields)


def _xarray() -> Any:
    try:
        import netCDF4  # noqa: F401
        import xarray
    except ImportError as error:
        raise UnavailableError(
            "netCDF files need the extra 'data' (xarray, netCDF4): pip install '.[data]'"
        ) from error
    return xarray
