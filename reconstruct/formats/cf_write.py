"""Records as netCDF with CF names; `reconstruct.formats.cfradial` reads them back."""

from pathlib import Path

import numpy as np

from geometry.errors import UnavailableError
from reconstruct.records import Records

#: Our field: name in the file, dimensions, attributes.
_VARIABLES = {
    "azimuth_deg": ("azimuth", {"standard_name": "ray_azimuth_angle", "units": "degrees"}),
    "elevation_deg": ("elevation", {"standard_name": "ray_elevation_angle", "units": "degrees"}),
    "duration_s": ("ray_accumulation_time", {"units": "s"}),
    "scan_id": ("ray_scan_id", {"units": "1"}),
    "sweep_id": ("ray_sweep_number", {"units": "1"}),
    "heading_deg": ("heading", {"units": "degrees"}),
    "pitch_deg": ("pitch", {"units": "degrees"}),
    "roll_deg": ("roll", {"units": "degrees"}),
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
    try:
        import netCDF4  # noqa: F401
        import xarray as xr
    except ImportError as error:
        raise UnavailableError(
            "netCDF files need the extra 'data' (xarray, netCDF4): pip install '.[data]'"
        ) from error
    start = (
        records.time_utc[0].astype("datetime64[s]") if records.rays else np.datetime64("1970-01-01T00:00:00")
    )
    seconds = (records.time_utc - start) / np.timedelta64(1, "s")
    units = f"seconds since {start}Z"
    variables = {}
    for name, values in {**records.ray_fields(), **records.gate_fields()}.items():
        if name in _VARIABLES:
            own, attributes = _VARIABLES[name]
            variables[own] = (("time", "range")[: values.ndim], values, attributes)
    axes = {
        "time": ("time", seconds, {"standard_name": "time", "units": units}),
        "range": ("range", records.range_m, {"standard_name": "projection_range_coordinate", "units": "m"}),
    }
    attributes = {
        "Conventions": "CF-1.8",
        "instrument_name": records.instrument,
        "ray_stamp": "middle",
        "comment": "; ".join(records.notes),
    }
    xr.Dataset(variables, axes, attributes).to_netcdf(path, engine="netcdf4")
