"""What an unfinished run has done so far: the result of each part of the data, as a file of plain arrays."""

import io
import json
from dataclasses import fields
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from planner.output import write_bytes
from planner.pointing_log import NOTHING_KNOWN, Known
from planner.scan_retrieval import ScanPart
from reconstruct.attitude import LogMeans
from reconstruct.automatic_filter import Agreement
from reconstruct.averaging import PeriodSums
from reconstruct.beam_means import BeamSums
from reconstruct.filters import Step
from reconstruct.losses import Loss
from reconstruct.pairing import RaySeries
from reconstruct.records import Records

Arrays = dict[str, NDArray[Any]]


class Kept(NamedTuple):
    """The result of one part."""

    part: ScanPart
    pending: Records | None  # the last pass, which the next part may go on with
    notes: tuple[str, ...]
    losses: tuple[Loss, ...] = ()  # what of the part could not be read
    known: Known = NOTHING_KNOWN  # of the instrument, for the next part
    log: LogMeans | None = None  # of the attitude
    unlogged: int = 0  # rays without an attitude while others have one


def write_kept(place: Path, mark: str, kept: Kept) -> None:
    """Keep the result of a part, whole or not at all.

    Parameters
    ----------
    place
        Its file.
    mark
        What it was made of: `read_kept` gives it back for the same mark alone.
    kept
        The result.
    """
    part = kept.part
    head = {
        "mark": mark,
        "notes": kept.notes,
        "losses": kept.losses,
        "steps": [list(step) for step in part.steps],
        "agreement": list(part.agreement),
        "offset_deg": part.offset_deg,
        "sums": [list(key) for key in part.sums],
        "lost": part.lost,
        "instrument": None if kept.pending is None else kept.pending.instrument,
        "known": kept.known,
        "unlogged": kept.unlogged,
    }
    arrays: Arrays = {"head": np.frombuffer(json.dumps(head).encode(), dtype=np.uint8)}
    arrays["gates_m"] = part.gates_m
    arrays |= {f"fast {name}": values for name, values in part.fast.items()}
    arrays |= {f"series {name}": values for name, values in part.series._asdict().items()}
    for number, sums in enumerate(part.sums.values()):
        arrays |= {
            f"sums {number} {field.name}": np.asarray(getattr(sums, field.name)) for field in fields(sums)
        }
    for period_s, beams in part.beams.items():
        arrays |= {f"beams {period_s!r} {name}": values for name, values in _numbers_of(beams).items()}
    if kept.log is not None:
        arrays |= {f"log {field.name}": getattr(kept.log, field.name) for field in fields(kept.log)}
    if kept.pending is not None:
        rays = kept.pending
        arrays |= {
            f"pending {name}": values for name, values in {**rays.ray_fields(), **rays.gate_fields()}.items()
        }
        arrays["pending range_m"] = rays.range_m
    buffer = io.BytesIO()
    np.savez(buffer, allow_pickle=False, **arrays)
    write_bytes(place, buffer.getvalue())


def read_kept(place: Path, mark: str) -> Kept | None:
    """The result of a part; None where there is none, or it was made of other data or settings."""
    if not place.is_file():
        return None
    with np.load(place, allow_pickle=False) as file:
        arrays: Arrays = dict(file.items())
    head = json.loads(arrays.pop("head").tobytes())
    if head["mark"] != mark:
        return None
    sums = {tuple(key): _sums(arrays, number) for number, key in enumerate(head["sums"])}
    part = ScanPart(
        fast=_named(arrays, "fast "),
        sums=sums,
        beams=_beams(arrays),
        gates_m=arrays["gates_m"],
        series=RaySeries(**_named(arrays, "series ")),
        steps=tuple(Step(*step) for step in head["steps"]),
        lost=head["lost"],
        agreement=Agreement(*head["agreement"]),
        offset_deg=head["offset_deg"],
    )
    waiting = _named(arrays, "pending ")
    pending = Records(instrument=head["instrument"], **waiting) if waiting else None
    logged = _named(arrays, "log ")
    return Kept(
        part,
        pending,
        tuple(head["notes"]),
        tuple(Loss(*loss) for loss in head["losses"]),
        Known(*(None if each is None else tuple(each) for each in head["known"])),
        LogMeans(**logged) if logged else None,
        head["unlogged"],
    )


def read_series(place: Path) -> RaySeries:
    """Only the rays at the target of a kept part."""
    with np.load(place, allow_pickle=False) as file:
        return RaySeries(*(file[f"series {name}"] for name in RaySeries._fields))


def _numbers_of(beams: BeamSums) -> Arrays:
    return {field.name: getattr(beams, field.name) for field in fields(beams) if field.name != "period_s"}


def _beams(arrays: Arrays) -> dict[float, BeamSums]:
    periods = {name.split()[1] for name in arrays if name.startswith("beams ")}
    return {
        float(text): BeamSums(float(text), **_named(arrays, f"beams {text} ")) for text in sorted(periods)
    }


def _named(arrays: Arrays, start: str) -> dict[str, Any]:
    """The arrays of one kind, by their own names."""
    return {name.removeprefix(start): values for name, values in arrays.items() if name.startswith(start)}


def _sums(arrays: Arrays, number: int) -> PeriodSums:
    found = _named(arrays, f"sums {number} ")
    return PeriodSums(period_s=float(found.pop("period_s")), **found)
