"""The one table of measured rays that every reader makes and every analysis reads.

Arrays (ray, gate) inside; tables and files at the border, see `reconstruct.record_tables` and
`reconstruct.store`.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from geometry.arrays import BoolArray, FloatArray, IntArray
from geometry.errors import InputError
from geometry.head import Mounting
from reconstruct.losses import Loss, merged_losses
from reconstruct.sweep_ids import sweep_ids

TimeArray = NDArray[np.datetime64]

#: Fields with one value per ray, in the order of tables. The first six are always there.
RAY_FIELDS = (
    "time_utc",
    "duration_s",
    "azimuth_deg",
    "elevation_deg",
    "scan_id",
    "sweep_id",
    "heading_deg",
    "pitch_deg",
    "roll_deg",
)

#: Fields with one value per ray and gate, in the order of tables. The first two are always there.
GATE_FIELDS = ("radial_speed_mps", "cnr_db", "spectral_width_mps", "quality")

_INTEGERS = ("scan_id", "sweep_id")

#: A gap this many times the usual interval between rays ends a sweep where two files meet.
JOINT_GAP = 5.0


@dataclass(frozen=True, eq=False)
class Records:
    """Rays of one instrument with one set of range gates, in the order they were measured.

    Raises
    ------
    InputError
        If the shapes do not belong together, times or ranges run backwards, or an angle is out of its range.

    Examples
    --------
    >>> records = Records(time_utc=np.array(["2014-05-01T00:00:00", "2014-05-01T00:00:01"], "datetime64[ns]"),
    ...     duration_s=np.full(2, 0.4), azimuth_deg=np.array([358.0, 0.0]), elevation_deg=np.full(2, 5.96),
    ...     scan_id=np.zeros(2, int), sweep_id=np.zeros(2, int), range_m=np.array([1141.0, 1166.0]),
    ...     radial_speed_mps=np.array([[5.0, 5.1], [5.2, np.nan]]), cnr_db=np.full((2, 2), -12.0))
    >>> records.rays, records.gates
    (2, 2)
    >>> records.radial_speed_mps[:, records.gate_at(1150.0)]
    array([5. , 5.2])
    """

    time_utc: TimeArray  # (ray,) middle of the ray, UTC, not decreasing
    duration_s: FloatArray  # (ray,) accumulation; NaN where unknown
    azimuth_deg: (
        FloatArray  # (ray,) middle of the ray, [0, 360), clockwise from the instrument's zero direction
    )
    elevation_deg: FloatArray  # (ray,) middle of the ray, [-90, 90]
    scan_id: IntArray  # (ray,) as the instrument numbers its scans; 0 where it does not
    sweep_id: IntArray  # (ray,) passes through the pattern, counted from 0
    range_m: FloatArray  # (gate,) slant range of the gates' centres, positive, not decreasing
    radial_speed_mps: FloatArray  # (ray, gate) positive away from the lidar; NaN where missing
    cnr_db: FloatArray  # (ray, gate) carrier-to-noise ratio; NaN where unknown
    spectral_width_mps: FloatArray | None = None  # (ray, gate)
    quality: FloatArray | None = None  # (ray, gate) as the instrument grades it, larger is better
    heading_deg: FloatArray | None = None  # (ray,) logged attitude of the instrument, as its file has it
    pitch_deg: FloatArray | None = None  # (ray,)
    roll_deg: FloatArray | None = None  # (ray,)
    instrument: str = ""
    notes: tuple[str, ...] = ()  # what a reader turned
    losses: tuple[Loss, ...] = ()  # what could not be read

    def __post_init__(self) -> None:
        object.__setattr__(self, "time_utc", np.asarray(self.time_utc, dtype="datetime64[ns]"))
        for name in ("range_m", *RAY_FIELDS[1:], *GATE_FIELDS):
            value = getattr(self, name)
            if value is not None:
                kind = np.intp if name in _INTEGERS else np.float64
                object.__setattr__(self, name, np.asarray(value, dtype=kind))
        _check_shapes(self)
        _check_axes(self)
        _check_angles(self)

    @property
    def rays(self) -> int:
        """Number of rays."""
        return len(self.time_utc)

    @property
    def gates(self) -> int:
        """Number of range gates."""
        return len(self.range_m)

    def ray_fields(self) -> dict[str, Any]:
        """The arrays with one value per ray that are there, by name."""
        return {name: getattr(self, name) for name in RAY_FIELDS if getattr(self, name) is not None}

    def gate_fields(self) -> dict[str, Any]:
        """The arrays (ray, gate) that are there, by name."""
        return {name: getattr(self, name) for name in GATE_FIELDS if getattr(self, name) is not None}

    def gate_at(self, range_m: float) -> int:
        """Index of the gate whose centre is nearest to a slant range [m]."""
        if not self.gates:
            raise InputError("these records have no range gates: there is nothing to choose from")
        return int(np.argmin(np.abs(self.range_m - range_m)))

    def at_rays(self, rays: IntArray | BoolArray | slice) -> "Records":
        """The same records with some of their rays only, in the order of time."""
        chosen = {name: values[rays] for name, values in {**self.ray_fields(), **self.gate_fields()}.items()}
        return replace(self, **chosen)

    def at_gates(self, gates: IntArray | BoolArray | slice) -> "Records":
        """The same records with some of their gates only."""
        chosen = {name: values[:, gates] for name, values in self.gate_fields().items()}
        return replace(self, range_m=self.range_m[gates], **chosen)

    def mounted(self, mounting: Mounting) -> "Records":
        """The same records with head angles and ranges turned into pointing ones.

        Parameters
        ----------
        mounting : geometry.head.Mounting
            How the head stands and what its readings are off by: pointing angle = head angle + offset, after
            the rotation; true range = range + offset.

        Returns
        -------
        Records
            With a note of what was turned.
        """
        if mounting == Mounting():
            return self
        azimuth, elevation = mounting.to_true(self.azimuth_deg, self.elevation_deg)
        stated = ", ".join(
            f"{f.name} {getattr(mounting, f.name):g}" for f in fields(mounting) if getattr(mounting, f.name)
        )
        return replace(
            self,
            azimuth_deg=azimuth,
            elevation_deg=elevation,
            range_m=mounting.true_range_m(self.range_m),
            notes=(*self.notes, f"head angles and ranges turned into pointing ones: {stated}"),
        )


def join(parts: Sequence[Records]) -> Records:
    """Records of one instrument from several files, in the order of time.

    Sweeps are numbered through; one that a file's end cut in two is whole again. Optional fields stay where
    every part has them; where one lacks them they are dropped, with a note.

    Raises
    ------
    InputError
        If there is nothing to join, or the instruments or gates differ.
    """
    if not parts:
        raise InputError("there are no records to join: name at least one file that has rays")
    if len(parts) == 1:
        return parts[0]
    first, *others = parts
    for other in others:
        if other.instrument != first.instrument or not same_gates(first, other):
            raise InputError(
                f"records of {first.instrument or 'one instrument'} with {first.gates} gates and of "
                f"{other.instrument or 'one instrument'} with {other.gates} gates do not make one table: "
                "read them one by one, or name the kind and the files"
            )
    parts = sorted((part for part in parts if part.rays), key=lambda part: part.time_utc[0]) or list(
        parts[:1]
    )
    names = {**first.ray_fields(), **first.gate_fields()}
    kept = [name for name in names if all(getattr(part, name) is not None for part in parts)]
    dropped = sorted({n for part in parts for n in {**part.ray_fields(), **part.gate_fields()}} - set(kept))
    arrays: dict[str, Any] = {name: np.concatenate([getattr(part, name) for part in parts]) for name in kept}
    arrays["sweep_id"] = sweeps_through(parts)
    order = np.argsort(arrays["time_utc"], kind="stable")
    notes = list(dict.fromkeys(note for part in parts for note in part.notes))
    if dropped:
        notes.append(f"left out, because not every file has it: {', '.join(dropped)}")
    return Records(
        range_m=first.range_m,
        instrument=first.instrument,
        notes=tuple(notes),
        losses=merged_losses(loss for part in parts for loss in part.losses),
        **{name: values[order] for name, values in arrays.items()},
    )


def same_gates(first: Records, second: Records) -> bool:
    """Whether two tables have the same range gates."""
    return first.gates == second.gates and bool(np.allclose(first.range_m, second.range_m, rtol=0, atol=1e-3))


def sweeps_through(parts: Sequence[Records]) -> IntArray:
    """(ray,) sweep numbers of all parts, one after the other, whole where a file's end cut a sweep."""
    numbers: list[IntArray] = []
    highest = -1
    for index, part in enumerate(parts):
        own = part.sweep_id - (int(part.sweep_id.min()) if part.rays else 0)
        start = highest if index and _goes_on(parts[index - 1], part) else highest + 1
        numbers.append(own + start)
        highest = max(highest, int(numbers[-1].max(initial=highest)))
    return np.concatenate(numbers)


def _goes_on(before: Records, after: Records) -> bool:
    """Whether the first sweep of a part continues the last one of the part before."""
    tail = before.sweep_id >= before.sweep_id[-1] - 1
    head = after.sweep_id <= after.sweep_id[0] + 1
    time = np.concatenate([before.time_utc[tail], after.time_utc[head]])
    gap_s = (time[tail.sum()] - time[tail.sum() - 1]) / np.timedelta64(1, "s")
    usual_s = float(np.median(np.diff(time) / np.timedelta64(1, "s")))
    if before.scan_id[-1] != after.scan_id[0] or not 0 < gap_s <= JOINT_GAP * usual_s:
        return False
    azimuth = np.concatenate([before.azimuth_deg[tail], after.azimuth_deg[head]])
    elevation = np.concatenate([before.elevation_deg[tail], after.elevation_deg[head]])
    found = sweep_ids(azimuth, elevation)
    return bool(found[tail.sum()] == found[tail.sum() - 1]) and bool(found[-1] > 0)


def _check_shapes(records: Records) -> None:
    rays, gates = np.shape(records.time_utc), np.shape(records.range_m)
    if len(rays) != 1 or len(gates) != 1:
        raise InputError(f"time_utc has the shape {rays} and range_m {gates}: (ray,) and (gate,) are needed")
    for names, wanted in ((RAY_FIELDS, rays), (GATE_FIELDS, rays + gates)):
        for name in names:
            value = getattr(records, name)
            if value is not None and value.shape != wanted:
                raise InputError(f"{name} of the records has the shape {value.shape}: {wanted} is needed")


def _check_axes(records: Records) -> None:
    """Times and ranges that run forward."""
    if np.any(np.isnat(records.time_utc)):
        raise InputError("a ray of the records has no time: leave rays without a time out")
    if np.any(np.diff(records.time_utc) < np.timedelta64(0)):
        raise InputError("the times of the records run backwards: sort the rays by time first")
    ranges = records.range_m
    if not np.all(np.isfinite(ranges) & (ranges >= 0)) or np.any(np.diff(ranges) < 0):
        raise InputError("the ranges of the records have to be finite, not negative and in rising order [m]")


def _check_angles(records: Records) -> None:
    azimuth, elevation = records.azimuth_deg, records.elevation_deg
    if not np.all((azimuth >= 0) & (azimuth < 360)):
        raise InputError(
            f"azimuths of the records run from {azimuth.min(initial=np.inf):g} to "
            f"{azimuth.max(initial=-np.inf):g}: "
            "they have to be finite and in [0, 360) degrees, take them modulo 360"
        )
    if not np.all(np.abs(elevation) <= 90):
        raise InputError(
            f"elevations of the records run from {elevation.min(initial=np.inf):g} to "
            f"{elevation.max(initial=-np.inf):g}: they have to be finite and in [-90, 90] degrees, fold "
            "those over the top"
        )
    for name, values in records.gate_fields().items():
        if np.any(np.isinf(values)):
            raise InputError(f"{name} of the records holds an infinite value: use NaN where nothing is known")
