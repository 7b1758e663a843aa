"""The quantities of a netCDF file on its rays and gates, in our units and with our sign."""

import re
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from geometry.arrays import FloatArray
from geometry.errors import InputError
from reconstruct.formats.carrier_to_noise import cnr_from_intensity
from reconstruct.formats.gate_union import GateBlock, common_gates
from reconstruct.formats.hpl_header import overlapping
from reconstruct.formats.netcdf_names import (
    CNR,
    INTENSITY,
    QUALITY,
    RANGE,
    TIME,
    WIDTH,
    find,
    find_speed,
    floats,
)
from reconstruct.losses import Loss

if TYPE_CHECKING:
    import xarray as xr

_METRES = {"m": 1.0, "meter": 1.0, "metre": 1.0, "km": 1e3, "kilometer": 1e3, "kilometre": 1e3}
_SPEEDS = {
    "m/s": 1.0,
    "ms-1": 1.0,
    "m*s-1": 1.0,
    "meter/second": 1.0,
    "metre/second": 1.0,
    "cm/s": 0.01,
    "cm*s-1": 0.01,
}
_SPEEDS |= {"km/h": 1 / 3.6, "km*h-1": 1 / 3.6, "kt": 1852 / 3600, "knot": 1852 / 3600}
_DEGREES = {"degree": 1.0, "deg": 1.0, "°": 1.0, "rad": 180 / np.pi, "radian": 180 / np.pi}
_DEGREES |= {"degree_north": 1.0, "degree_true": 1.0, "degree_from_north": 1.0, "degree_from_true_north": 1.0}
_SECONDS = {"s": 1.0, "sec": 1.0, "second": 1.0, "ms": 1e-3, "msec": 1e-3, "millisecond": 1e-3}

#: What a quantity is counted in, and the factors from other units.
UNITS = {"m": _METRES, "m/s": _SPEEDS, "degrees": _DEGREES, "s": _SECONDS}

#: A ratio of powers, not its logarithm, has one of these for its units.
LINEAR = ("1", "ratio", "linear", "unitless", "dimensionless", "none", "-")

#: A sign and a way, by which a file says in words what its speeds mean.
_SIGN, _WAY = re.compile(r"\b(positive|negative)"), re.compile(r"\b(toward|away)")


class Gates(NamedTuple):
    """Quantities of a dataset."""

    range_m: FloatArray  # (gate,)
    values: dict[str, FloatArray]  # our name: (ray, gate)
    notes: list[str]
    losses: list[Loss]


def in_units(data: "xr.Dataset", name: str | None, wanted: str) -> tuple[FloatArray, list[str]]:
    """Numbers of a variable in the units wanted, and what was turned or taken for granted.

    Parameters
    ----------
    data : xarray.Dataset
    name : str
        Of a variable that is there.
    wanted : str
        A key of UNITS.
    """
    stated = str(data[name].attrs.get("units", "")).strip()
    plain = stated.lower().replace("^", "").replace(" per ", "/").replace("_per_", "/")
    plain = re.sub(r"[ .*·]+", "*", plain)
    plain = re.sub(r"s(?=[/*_]|$)", "", plain) if len(plain) > 4 else plain  # plural
    factor = UNITS[wanted].get(plain)
    values = floats(data, name)
    if factor is None:
        return values, [f"{name} taken to be in {wanted}: its units are {stated!r}"] if stated else []
    return values * factor, [] if factor == 1 else [f"{name} turned from {stated} to {wanted}"]


def read_gates(data: "xr.Dataset", rays: int, path: Path) -> Gates:
    """Ranges and quantities of a dataset with so many rays.

    Raises
    ------
    InputError
        If a quantity has another shape than rays and gates.
    """
    ranges, notes = _ranges(data, path)
    found = {"spectral_width_mps": WIDTH, "quality": QUALITY}
    values = {"radial_speed_mps": _speed(data, rays, ranges, path, notes)}
    values["cnr_db"] = _cnr(data, rays, ranges, path, notes)
    for own, names in found.items():
        if find(data, names):
            values[own] = _grid(data, find(data, names), rays, ranges, path)
    if ranges.ndim == 2:
        if ranges.shape[0] != rays:
            raise InputError(f"{path}: ranges of the shape {ranges.shape} do not belong to {rays} rays")
        known = np.all(np.isfinite(ranges) & (ranges >= 0), axis=1)
        block = GateBlock(ranges[known], np.stack(list(values.values()), axis=-1)[known])
        if not known.any():
            raise InputError(f"{path}: no ray has all its ranges")
        range_m, grids = common_gates([block])
        placed = [np.full((rays, len(range_m)), np.nan) for _ in grids]
        for whole, grid in zip(placed, grids, strict=True):
            whole[known] = grid
        lost = int(np.sum(~known))
        losses = [Loss(path.name, "a ray without ranges", times=lost)] if lost else []
        return Gates(range_m, dict(zip(values, placed, strict=True)), notes, losses)
    order = np.argsort(ranges, kind="stable")
    order = order[np.isfinite(ranges[order]) & (ranges[order] >= 0)]
    lost = len(ranges) - len(order)
    losses = [Loss(path.name, "a gate without a range, or behind the lidar", times=lost)] if lost else []
    return Gates(ranges[order], {name: grid[:, order] for name, grid in values.items()}, notes, losses)


def _ranges(data: "xr.Dataset", path: Path) -> tuple[FloatArray, list[str]]:
    """Ranges (gate,) or (ray, gate) [m], and what was turned."""
    name = find(data, RANGE)
    if "distance_overlapped" in data.variables and overlapping(str(data.attrs.get("Scan type", ""))):
        name = "distance_overlapped"  # beside `distance` in files of the Wind Data Hub
    ranges, notes = in_units(data, name, "m")
    numbered = ranges.ndim == 1 and len(ranges) > 3 and np.all(np.diff(ranges) == 1) and ranges[0] in (0, 1)
    if numbered and not data[name].attrs.get("units"):
        raise InputError(f"{path}: {name} numbers the gates and gives no ranges: ranges in metres are needed")
    return _rays_first(ranges, data, str(name)), notes


def _rays_first(values: FloatArray, data: "xr.Dataset", name: str) -> FloatArray:
    """The same numbers with the dimension of the times first."""
    ray = data[find(data, TIME)].dims[:1]
    return values.T if values.ndim == 2 and data[name].dims[1:] == ray else values


def _speed(data: "xr.Dataset", rays: int, ranges: FloatArray, path: Path, notes: list[str]) -> FloatArray:
    """(ray, gate) radial speed [m/s], positive away."""
    name = find_speed(data)
    speed, said = in_units(data, name, "m/s")
    notes += said
    attributes = data[name].attrs
    words = " ".join(str(attributes.get(key, "")) for key in ("long_name", "comment", "comments")).lower()
    stated = f"{attributes.get('standard_name', '')} {attributes.get('positive', '')}".lower()
    speed = _placed(speed, data, str(name), ranges, rays, path)
    if "away" in stated or ("toward" not in stated and not positive_toward(words)):
        return speed
    notes.append("radial speeds turned from positive toward to positive away")
    return -speed


def positive_toward(words: str) -> bool:
    """Whether a text says that a positive speed comes nearer: the first part of a sentence, else the first sentence,
    that has both a sign and a way decides.

    Examples
    --------
    >>> positive_toward("positive values are towards the lidar."), positive_toward("positive away, negative toward")
    (True, False)
    """
    for part in (*re.split("[.;,]", words), *re.split("[.;]", words)):
        sign, way = _SIGN.search(part), _WAY.search(part)
        if sign is not None and way is not None:
            return (sign[1] == "positive") == (way[1] == "toward")
    return False


def _cnr(data: "xr.Dataset", rays: int, ranges: FloatArray, path: Path, notes: list[str]) -> FloatArray:
    """(ray, gate) carrier-to-noise ratio [dB]; NaN where the file has none."""
    name, intensity = find(data, CNR), find(data, INTENSITY)
    if name is not None:
        ratio = _grid(data, name, rays, ranges, path)
        if str(data[name].attrs.get("units", "")).strip().lower() not in LINEAR:
            return ratio
        notes.append(f"{name}, a ratio, turned into decibels")
        return np.asarray(10.0 * np.log10(np.where(ratio > 0, ratio, np.nan)))
    if intensity is not None:
        notes.append("intensity turned into CNR = 10 log10(intensity - 1)")
        return cnr_from_intensity(_grid(data, intensity, rays, ranges, path))
    return np.full((rays, ranges.shape[-1]), np.nan)


def _grid(data: "xr.Dataset", name: str | None, rays: int, ranges: FloatArray, path: Path) -> FloatArray:
    """(ray, gate) of a variable."""
    return _placed(floats(data, name), data, str(name), ranges, rays, path)


def _placed(
    values: FloatArray, data: "xr.Dataset", name: str, ranges: FloatArray, rays: int, path: Path
) -> FloatArray:
    """(ray, gate) transposed or unpacked where it has to be."""
    gates, values = ranges.shape[-1], _rays_first(values, data, name)
    if values.shape == (rays, gates):
        return values
    if values.shape == (gates, rays):  # neither dimension is that of the times
        return values.T
    if values.ndim == 1 and "ray_n_gates" in data and "ray_start_index" in data:
        counts, starts = floats(data, "ray_n_gates"), floats(data, "ray_start_index")
        sound = counts.shape == starts.shape == (rays,) and np.all(np.isfinite(counts + starts))
        if sound and np.all(
            (starts >= 0) & (counts >= 0) & (counts <= gates) & (starts + counts <= len(values))
        ):
            out = np.full((rays, gates), np.nan)
            for ray, (start, count) in enumerate(zip(starts.astype(int), counts.astype(int), strict=True)):
                out[ray, :count] = values[start : start + count]
            return out
        raise InputError(
            f"{path}: ray_start_index and ray_n_gates point outside of the {len(values)} values of {name}"
        )
    raise InputError(
        f"{path}: {name} has the shape {values.shape} where {rays} rays and {gates} gates were expected"
    )
