"""The files of a virtual campaign: rays in a format that the analysis reads, mast, truth, and a campaign file."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Literal

import numpy as np

from geometry.errors import InputError
from planner.analysis import file_name
from planner.output import output_folder
from planner.plan import Plan
from planner.simulation import (
    PERIODS_PER_DAY,
    MastSamples,
    Options,
    Part,
    Progress,
    Virtual,
    campaign_parts,
    joined,
    true_means,
    virtual,
)
from reconstruct.averaging import period_means
from reconstruct.records import Records

Format = Literal["csv", "parquet", "store"]
FORMATS: tuple[Format, ...] = ("csv", "parquet", "store")
ENDINGS: dict[Format, str] = {"csv": "csv", "parquet": "parquet", "store": "duckdb"}

MAST_PERIOD_S = 60.0


def write_virtual(
    plan: Plan, site_text: str, out: Path, *, options: Options, kind: Format = "csv", progress: Progress | None = None
) -> list[Path]:
    """Simulate a campaign and write it, a file a day and scan, with mast, truth, site and campaign file.

    Parameters
    ----------
    plan
        The site.
    site_text
        The site file as it is: it is copied beside the data, for the analysis.
    out
        Folder, made when all is there.
    options
        Days, seed, share of lost rays.
    kind
        Format of the rays.
    progress
        Gets the share that is done.

    Returns
    -------
    list of Path
        The campaign file first.
    """
    campaign = virtual(plan, options)
    with output_folder(out) as folder:
        parts = _watched(campaign_parts(campaign, plan, options), len(campaign.states), progress)
        for number, day in enumerate(_days(parts)):
            for layout in campaign.layouts:
                records = joined([part.records[layout.name] for part in day])
                _write_rays(records, folder, f"{file_name(layout.name)}", number, kind)
            _append_mast(folder / "mast.csv", [part.mast for part in day])
            _append(folder / "truth.csv", [true_means(part) for part in day])
        (folder / "site.yaml").write_text(site_text, encoding="utf-8")
        (folder / "campaign.yaml").write_text(campaign_text(plan, campaign, kind), encoding="utf-8")
        names = sorted(path.relative_to(folder) for path in folder.rglob("*") if path.is_file())
    return [out / "campaign.yaml", *(out / name for name in names if name.name != "campaign.yaml")]


def campaign_text(plan: Plan, campaign: Virtual, kind: Format) -> str:
    """The campaign file that goes with the data."""
    ending = ENDINGS[kind]
    where = {
        layout.name: f"{file_name(layout.name)}.duckdb" if kind == "store" else f"{file_name(layout.name)}-*.{ending}"
        for layout in campaign.layouts
    }
    inputs = "\n".join(
        f"  - {{scan: {_quoted(name)}, kind: {kind}, path: {_quoted(path)}}}" for name, path in where.items()
    )
    pairs = [pair for pair in plan.site.pairs if len(pair.scans) == 2 and set(pair.scans) <= set(where)]
    lines = [
        "# A virtual campaign: `lidarplan retrieve` this file, then `lidarplan compare` it.",
        f"name: {_quoted(plan.site.name)}",
        "site: site.yaml",
        f"inputs:                          # angles are the head's; the site file's offsets turn them\n{inputs}",
    ]
    if pairs:
        lines.append(f"pairs: [{', '.join(_quoted(pair.name) for pair in pairs)}]")
    lines += [
        "filters: {automatic: on}         # limits, such as cnr_db: [-25, -5], would take the automatic filter's place",
        "selection:                       # every period was drawn from the wind that counts: nothing more is left out",
        "  directions_deg: all",
        "  every_speed: true",
        "averaging: {periods_s: [60, 600]}",
        "mast: {path: mast.csv}",
        "output: results",
    ]
    return "\n".join(lines) + "\n"


def _quoted(text: str) -> str:
    """A text as YAML takes it, whatever is in it."""
    import json

    return json.dumps(text, ensure_ascii=False)


def _watched(parts: Iterator[Part], count: int, progress: Progress | None) -> Iterator[Part]:
    for number, part in enumerate(parts):
        yield part
        if progress is not None:
            progress((number + 1) / count)


def _days(parts: Iterator[Part]) -> Iterator[list[Part]]:
    """Parts, a day of them at a time."""
    day: list[Part] = []
    for part in parts:
        day.append(part)
        if len(day) == PERIODS_PER_DAY:
            yield day
            day = []
    if day:
        yield day


def _write_rays(records: Records, folder: Path, name: str, number: int, kind: Format) -> None:
    from reconstruct.record_tables import to_long, write_parquet
    from reconstruct.store import write_store

    path = folder / f"{name}-{number:04d}.{ENDINGS[kind]}"
    if kind == "csv":
        to_long(records).to_csv(path, index=False, float_format="%.6f", encoding="utf-8")
    elif kind == "parquet":
        write_parquet(records, path)
    elif kind == "store":
        write_store(folder / f"{name}.duckdb", records)
    else:
        raise InputError(f"--format {kind} came; allowed: {', '.join(FORMATS)}")


def _append_mast(path: Path, samples: Sequence[MastSamples]) -> None:
    """Add one-minute means of cup and vane, stamped at the end of the minute."""
    time = np.concatenate([each.time_utc for each in samples])
    wind = np.concatenate([each.uv_mps for each in samples])
    means = period_means(time, wind[:, 0], wind[:, 1], period_s=MAST_PERIOD_S)
    rows = zip(means.time_utc, means.speed_mps, means.vane_deg, strict=True)
    _append(path, [{"time_utc": when, "speed_mps": speed, "from_deg": angle} for when, speed, angle in rows])


def _append(path: Path, rows: Sequence[dict[str, object]]) -> None:
    import pandas as pd

    frame = pd.DataFrame(rows)
    frame.to_csv(path, mode="a", header=not path.exists(), index=False, float_format="%.5f", encoding="utf-8")
