"""CfRadial and its kin in netCDF: WindCube (flat or with a group for each sweep), ARM Doppler lidar, and our
own files.

WindCube stamps time, azimuth and elevation at the **end** of the ray: they are moved to its middle, by half a
ray of time and by half of what the head turns in it. Other files are taken as stored, unless `stamp` says
otherwise.
"""

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from geometry.angles import wrap_180_deg
from geometry.arrays import FloatArray, IntArray
from geometry.errors import InputError, UnavailableError
from reconstruct.formats.carrier_to_noise import cnr_from_intensity
from reconstruct.formats.gate_union import GateBlock, common_gates
from reconstruct.formats.netcdf_names import (
    AZIMUTH,
    CNR,
    DURATION,
    ELEVATION,
    INTENSITY,
    QUALITY,
    RANGE,
    SPEED,
    SWEEP,
    TIME,
    WIDTH,
    find,
    floats,
    times,
    to_number,
)
from reconstruct.formats.options import Options, Stamp
from reconstruct.formats.over_the_top import folded
from reconstruct.formats.text import read_bytes, seconds_delta
from reconstruct.losses import Loss, merged_losses
from reconstruct.records import Records, join
from reconstruct.sweep_ids import sweep_ids

if TYPE_CHECKING:
    import xarray as xr

#: Larger steps from ray to ray are a head that goes to its next point, not one that sweeps while it measures
#: [deg].
LARGEST_SWEPT_DEG = 10.0

#: Words in a file's attributes by which a WindCube is known.
WINDCUBE = ("windcube", "leosphere", "wls")


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
    parts = [_sweep(data, root, path, options) for data, root in _datasets(path)]
    return replace(join(parts), losses=merged_losses(loss for part in parts for loss in part.losses)).mounted(
        options.mounting
    )


def _datasets(path: Path) -> "list[tuple[xr.Dataset, dict[str, Any]]]":
    """Every dataset of a file that holds rays, with the attributes of the whole file."""
    try:
        import netCDF4
        import xarray as xr
    except ImportError as error:
        raise UnavailableError(
            "netCDF files need the extra 'data' (xarray, netCDF4): pip install '.[data]'"
        ) from error
    read_bytes(path)
    try:
        with netCDF4.Dataset(str(path)) as file:
            root = {name: file.getncattr(name) for name in file.ncattrs()}
            groups = [None, *_groups(file)]
        opened = [
            xr.load_dataset(path, group=group, decode_times=False, engine="netcdf4") for group in groups
        ]
    except (OSError, RuntimeError, ValueError, AttributeError) as error:
        raise InputError(f"{path}: cannot be read as netCDF ({error})") from error
    held = [data for data in opened if find(data, SPEED) is not None and find(data, AZIMUTH) is not None]
    if not held:
        raise InputError(
            f"{path}: holds no radial speeds with azimuths; it has "
            f"{', '.join(map(str, opened[0].variables)) or 'nothing'}"
        )
    if "time_reference" in opened[0].variables:
        root["time_reference"] = opened[0]["time_reference"].values
    return [(data, root) for data in held]


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
    azimuth, elevation = (_per_ray(data, names, len(time)) for names in (AZIMUTH, ELEVATION))
    range_m, values, notes = _gates(data, len(time), path)
    known = ~np.isnat(time) & np.isfinite(azimuth) & np.isfinite(elevation)
    losses = (
        ()
        if np.all(known)
        else (Loss(path.name, "a ray without a time or an angle", times=int(np.sum(~known))),)
    )
    order = np.flatnonzero(known)[np.argsort(time[known], kind="stable")]
    if not len(order):
        raise InputError(f"{path}: no ray has a time and angles")
    azimuth, elevation, turned = folded(azimuth[order], elevation[order])
    attributes = {**root, **data.attrs}
    said = attributes.get("instrument_name") or attributes.get("serial_number") or path.stem.split(".")[0]
    records = Records(
        time_utc=time[order] + seconds_delta(options.clock_offset_s),
        duration_s=_durations(data, len(time))[order],
        azimuth_deg=azimuth,
        elevation_deg=elevation,
        scan_id=np.full(len(order), to_number(attributes.get("scan_id"))),
        sweep_id=_sweep_numbers(data, order, azimuth, elevation),
        range_m=range_m,
        instrument=options.instrument or str(said),
        notes=(*notes, *turned),
        losses=losses,
        **{name: grid[order] for name, grid in values.items()},
    )
    return _to_middle(records, _stamp(attributes, options.stamp))


def _stamp(attributes: dict[str, Any], asked: Stamp) -> Stamp:
    """Where in the ray the stamps stand."""
    if asked != "auto":
        return asked
    own = attributes.get("ray_stamp")
    if own in ("start", "middle", "end"):
        return str(own)  # type: ignore[return-value]
    text = " ".join(
        str(attributes.get(name, ""))
        for name in ("title", "institution", "source", "instrument_name", "history")
    )
    return "end" if any(word in text.lower() for word in WINDCUBE) else "middle"


def _to_middle(records: Records, stamp: Stamp) -> Records:
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


def _per_ray(data: "xr.Dataset", names: tuple[str, ...], rays: int) -> FloatArray:
    values = floats(data, find(data, names)).ravel()
    return values if len(values) == rays else np.full(rays, values[0] if len(values) else np.nan)


def _durations(data: "xr.Dataset", rays: int) -> FloatArray:
    """(ray,) accumulation [s]; NaN where the file does not say."""
    name = find(data, DURATION)
    if name is None:
        return np.full(rays, np.nan)
    milli = str(data[name].attrs.get("units", "s")).strip().lower() in ("ms", "milliseconds", "millisecond")
    values = _per_ray(data, DURATION, rays) * (1e-3 if milli else 1.0)
    return np.where(values > 0, values, np.nan)


def _sweep_numbers(
    data: "xr.Dataset", order: IntArray, azimuth: FloatArray, elevation: FloatArray
) -> IntArray:
    """(ray,) as the file numbers its sweeps, where it has several; else from the angles."""
    own = find(data, SWEEP)
    if own is not None and data[own].values.ndim == 1 and len(data[own].values) == len(order):
        return np.asarray(data[own].values[order], dtype=np.intp)
    if "sweep_start_ray_index" in data:
        starts = floats(data, "sweep_start_ray_index").ravel()
        starts = starts[np.isfinite(starts)]
        if len(starts) > 1:
            return np.asarray(np.searchsorted(np.sort(starts), order, "right") - 1, dtype=np.intp)
    return sweep_ids(azimuth, elevation)


def _gates(data: "xr.Dataset", rays: int, path: Path) -> tuple[FloatArray, dict[str, FloatArray], list[str]]:
    """Ranges (gate,), quantities (ray, gate) and what was turned."""
    ranges = floats(data, find(data, RANGE))
    speed_name = find(data, SPEED)
    toward = "toward" in str(data[speed_name].attrs.get("standard_name", ""))
    found = {"radial_speed_mps": SPEED, "cnr_db": CNR, "spectral_width_mps": WIDTH, "quality": QUALITY}
    values = {
        own: _grid(data, find(data, names), rays, ranges, path)
        for own, names in found.items()
        if find(data, names)
    }
    notes = []
    if toward:
        values["radial_speed_mps"] = -values["radial_speed_mps"]
        notes.append("radial speeds turned from positive toward to positive away")
    if "cnr_db" not in values:
        intensity = find(data, INTENSITY)
        shape = values["radial_speed_mps"].shape
        values["cnr_db"] = np.full(shape, np.nan)
        if intensity:
            values["cnr_db"] = cnr_from_intensity(_grid(data, intensity, rays, ranges, path))
            notes.append("intensity turned into CNR = 10 log10(intensity - 1)")
    if ranges.ndim == 2:
        full = ranges if ranges.shape[0] == rays else ranges.T
        block = GateBlock(full, np.stack(list(values.values()), axis=-1))
        ranges, grids = common_gates([block])
        return ranges, dict(zip(values, grids, strict=True)), notes
    order = np.argsort(ranges, kind="stable")
    return ranges[order], {name: grid[:, order] for name, grid in values.items()}, notes


def _grid(data: "xr.Dataset", name: str | None, rays: int, ranges: FloatArray, path: Path) -> FloatArray:
    """(ray, gate) of a variable, transposed or unpacked where it has to be."""
    values = floats(data, name)
    gates = ranges.shape[-1] if ranges.ndim == 1 or ranges.shape[0] == rays else ranges.shape[0]
    if values.shape == (rays, gates):
        return values
    if values.shape == (gates, rays):
        return values.T
    if values.ndim == 1 and "ray_n_gates" in data and "ray_start_index" in data:
        out = np.full((rays, gates), np.nan)
        counts, starts = (
            np.asarray(data[key].values, dtype=np.intp) for key in ("ray_n_gates", "ray_start_index")
        )
        for ray in range(rays):
            out[ray, : counts[ray]] = values[starts[ray] : starts[ray] + counts[ray]]
        return out
    raise InputError(
        f"{path}: {name} has the shape {values.shape} where {rays} rays and {gates} gates were expected"
    )
