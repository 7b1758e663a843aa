"""CfRadial and its kin in netCDF: WindCube (flat or with a group for each sweep), ARM Doppler lidar, and our
own files.

WindCube stamps time, azimuth and elevation at the **end** of the ray: they are moved to its middle, by half a
ray of time and by half of what the head turns in it. Other files are taken as stored, unless `stamp` says
otherwise.
"""

import re
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from geometry.arrays import FloatArray, IntArray
from geometry.errors import InputError, UnavailableError
from reconstruct.formats.gate_union import on_one_set_of_gates
from reconstruct.formats.netcdf_classic import missing_bytes
from reconstruct.formats.netcdf_gates import in_units, read_gates
from reconstruct.formats.netcdf_names import (
    AZIMUTH,
    DURATION,
    ELEVATION,
    HEADING,
    PITCH,
    RANGE,
    ROLL,
    SWEEP,
    TIME,
    find,
    find_speed,
    floats,
    times,
    to_number,
)
from reconstruct.formats.options import Options
from reconstruct.formats.over_the_top import folded
from reconstruct.formats.own_netcdf import MARK, own_records
from reconstruct.formats.ray_stamps import stamp_of, to_middle
from reconstruct.formats.text import read_bytes, seconds_delta
from reconstruct.formats.time_order import time_order
from reconstruct.losses import Loss, losses_text, merged_losses
from reconstruct.records import Records, join
from reconstruct.sweep_ids import sweep_ids

if TYPE_CHECKING:
    import xarray as xr


#: A file is filled up to a multiple of four bytes: so many more than its numbers need are no damage.
PADDING = 3

#: First bytes of files that gzip has packed, and of netCDF-4.
GZIP, HDF5 = b"\x1f\x8b", b"\x89HDF"


def read_cfradial(path: Path, options: Options | None = None) -> Records:
    """Rays of a netCDF file of a Doppler lidar.

    Parameters
    ----------
    path : Path
    options : Options, optional
        `stamp`: where in the ray the file's stamps stand ("middle" takes them as stored; "auto" knows
        WindCube's end); `clock_offset_s`, `mounting`, `instrument`.

    Returns
    -------
    Records

    Raises
    ------
    UnavailableError
        If the extra `data` is not installed.
    InputError
        If the file is no netCDF, or lacks times, angles, ranges or radial speeds.
    """
    options = options or Options()
    datasets = _datasets(path)
    if MARK in datasets[0][1]:
        return _own(datasets[0][0], path, options)
    parts, losses = [], []
    for data, root in datasets:
        try:
            parts.append(_sweep(data, root, path, options))
        except InputError as error:
            if len(datasets) == 1:
                raise
            losses.append(Loss(path.name, f"a sweep: {str(error).removeprefix(f'{path}: ')}"))
    if not parts:
        raise InputError(f"{path}: no sweep can be read:\n{losses_text(merged_losses(losses))}")
    records = join(on_one_set_of_gates(parts))
    return replace(records, losses=merged_losses([*losses, *records.losses])).mounted(options.mounting)


def _own(data: "xr.Dataset", path: Path, options: Options) -> Records:
    """Records of a file that `own_netcdf` wrote: nothing has to be turned."""
    records = own_records(data, path)
    time = records.time_utc + seconds_delta(options.clock_offset_s)
    instrument = options.instrument or records.instrument
    return replace(records, time_utc=time, instrument=instrument).mounted(options.mounting)


def _datasets(path: Path) -> "list[tuple[xr.Dataset, dict[str, Any]]]":
    """Every dataset of a file that holds rays, with the attributes of the whole file."""
    try:
        import netCDF4
        import xarray as xr
    except ImportError as error:
        raise UnavailableError(
            "netCDF files need the extra 'data' (xarray, netCDF4): pip install '.[data]'"
        ) from error
    _whole(path)
    try:
        with netCDF4.Dataset(str(path)) as file:
            root = {name: file.getncattr(name) for name in file.ncattrs()}
            groups = [None, *_groups(file)]
        opened = [
            xr.load_dataset(path, group=group, decode_times=False, engine="netcdf4") for group in groups
        ]
    except Exception as error:  # of a damaged file the libraries raise whatever breaks first
        raise InputError(f"{path}: cannot be read as netCDF ({error})") from error
    held = [data for data in opened if find_speed(data) is not None and find(data, AZIMUTH) is not None]
    if not held:
        raise InputError(
            f"{path}: holds no radial speeds with azimuths; it has "
            f"{', '.join(map(str, opened[0].variables)) or 'nothing'}"
        )
    if "time_reference" in opened[0].variables:
        root["time_reference"] = opened[0]["time_reference"].values
    return [(data, root) for data in held]


def _whole(path: Path) -> None:
    """Refuse a file that is cut off or shifted where the library would read zeros and other numbers."""
    try:
        with path.open("rb") as file:
            start = file.read(4)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error})") from error
    if start[:2] == GZIP:
        raise InputError(
            f"{path}: is netCDF packed with gzip, which its library cannot open: unpack it first (gunzip)"
        )
    if start == HDF5:
        return
    raw = read_bytes(path)
    missing = missing_bytes(raw) if raw[:3] == b"CDF" else 0
    if missing is not None and not -PADDING <= missing <= 0:
        way = "fewer" if missing > 0 else "more"
        raise InputError(
            f"{path}: cannot be read as netCDF: it has {abs(missing)} bytes {way} than its header tells, so it "
            "is cut off or damaged: fetch it again"
        )


def _groups(file: Any, above: str = "") -> list[str]:
    """Paths of all groups of a netCDF file."""
    out = []
    for name, group in file.groups.items():
        out += [f"{above}{name}", *_groups(group, f"{above}{name}/")]
    return out


def _sweep(data: "xr.Dataset", root: dict[str, Any], path: Path, options: Options) -> Records:
    """Records of one dataset."""
    needed = {"times": TIME, "elevations": ELEVATION, "ranges": RANGE}
    missing = [name for name, names in needed.items() if find(data, names) is None]
    if missing:
        raise InputError(f"{path}: holds radial speeds but no {' and no '.join(missing)}")
    time = times(data, root, path)
    if not len(time):
        raise InputError(f"{path}: holds no ray")
    azimuth, elevation = (_angle(data, names, len(time), path) for names in (AZIMUTH, ELEVATION))
    gates = read_gates(data, len(time), path)
    known = np.isfinite(azimuth[0]) & (np.abs(elevation[0]) <= 360.0)
    lost = int(np.sum(~known))
    losses = [Loss(path.name, "a ray without azimuth or elevation", times=lost)] if lost else []
    sorted_ = time_order(time[known], path.name)
    order = np.flatnonzero(known)[sorted_.order]
    if not len(order):
        raise InputError(f"{path}: no ray has a time and angles")
    azimuth_deg, elevation_deg, turned = folded(azimuth[0][order], elevation[0][order])
    attributes = {**root, **data.attrs}
    said = attributes.get("instrument_name") or attributes.get("serial_number") or _named(path)
    records = Records(
        time_utc=time[order] + seconds_delta(options.clock_offset_s),
        duration_s=_durations(data, len(time), path)[order],
        azimuth_deg=azimuth_deg,
        elevation_deg=elevation_deg,
        scan_id=np.full(len(order), to_number(attributes.get("scan_id"))),
        sweep_id=_sweep_numbers(data, order, azimuth_deg, elevation_deg),
        range_m=gates.range_m,
        instrument=options.instrument or str(said),
        notes=(*gates.notes, *azimuth[1], *elevation[1], *turned, *sorted_.notes),
        losses=merged_losses([*losses, *gates.losses, *sorted_.losses]),
        **{name: grid[order] for name, grid in gates.values.items()},
        **_attitude(data, order, len(time)),
    )
    comments = " ".join(str(data[find(data, names)].attrs) for names in (TIME, AZIMUTH))
    return to_middle(records, stamp_of(attributes, comments, options.stamp))


def _named(path: Path) -> str:
    """The instrument by the file's name without its date, or by its folder.

    Examples
    --------
    >>> _named(Path("rt1.lidar.z02.b0.20230801.000001.user1.nc")), _named(Path("mast_A/20230801_0100.nc"))
    ('rt1.lidar.z02.b0', 'mast_A')
    """
    return re.split(r"[._-]?\d{6,}", path.stem)[0] or path.parent.name


def _angle(data: "xr.Dataset", names: tuple[str, ...], rays: int, path: Path) -> tuple[FloatArray, list[str]]:
    """(ray,) azimuth or elevation [degrees], and what was turned."""
    values, notes = in_units(data, find(data, names), "degrees")
    return _per_ray(values, str(find(data, names)), rays, path), notes


def _per_ray(values: FloatArray, name: str, rays: int, path: Path) -> FloatArray:
    """(ray,) numbers of a variable that has one for each ray or one for all."""
    if values.size not in (1, rays):
        raise InputError(f"{path}: {name} has {values.size} values where there are {rays} rays")
    return np.array(np.broadcast_to(values.ravel(), (rays,)))


def _attitude(data: "xr.Dataset", order: IntArray, rays: int) -> dict[str, Any]:
    """Heading, pitch and roll of each ray, where the file logs them."""
    names = {"heading_deg": HEADING, "pitch_deg": PITCH, "roll_deg": ROLL}
    logged = {own: floats(data, name) for own, names_ in names.items() if (name := find(data, names_))}
    return {
        own: values.ravel()[order]
        for own, values in logged.items()
        if values.size == rays and np.any(np.isfinite(values))
    }


def _durations(data: "xr.Dataset", rays: int, path: Path) -> FloatArray:
    """(ray,) accumulation [s]; NaN where the file does not say."""
    name = find(data, DURATION)
    if name is None:
        return np.full(rays, np.nan)
    values = _per_ray(in_units(data, name, "s")[0], name, rays, path)
    return np.where(values > 0, values, np.nan)


def _sweep_numbers(
    data: "xr.Dataset", order: IntArray, azimuth: FloatArray, elevation: FloatArray
) -> IntArray:
    """(ray,) as the file numbers its sweeps, where it has several; else from the angles."""
    own = find(data, SWEEP)
    if own is not None and data[own].values.ndim == 1 and len(data[own].values) > int(order.max()):
        numbers = floats(data, own)[order]
        if np.all(np.isfinite(numbers)):
            return numbers.astype(np.intp)
    if "sweep_start_ray_index" in data:
        starts = floats(data, "sweep_start_ray_index").ravel()
        starts = starts[np.isfinite(starts)]
        if len(starts) > 1:
            return np.asarray(np.searchsorted(np.sort(starts), order, "right") - 1, dtype=np.intp)
    return sweep_ids(azimuth, elevation)
