"""The files of a virtual campaign: rays in a format that the analysis reads, mast, truth, and a campaign file."""

import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Literal, get_args

import numpy as np

from geometry.errors import InputError
from planner.analysis_files import file_name, require_own_files
from planner.files.site_copy import copy_site
from planner.output import output_folder
from planner.plan import Plan
from planner.simulation import (
    PERIODS_PER_DAY,
    MastSamples,
    Options,
    Part,
    Progress,
    campaign_parts,
    joined,
    told_scans,
    true_means,
    virtual,
)
from reconstruct.averaging import period_means
from reconstruct.records import Records

if TYPE_CHECKING:
    from reconstruct.formats.aas_scenarios import Scenarios

Format = Literal["csv", "parquet", "store", "netcdf", "windscanner", "database"]
FORMATS: tuple[Format, ...] = get_args(Format)
DATABASE = "rays.sqlite"  # where no url is given

# What the campaign file says of each: kind, and the files of a scan: `s-????` does not match those of a scan `s-2`.
READ_AS: dict[Format, tuple[str, str]] = {
    "csv": ("csv", "{}-????.csv"),
    "parquet": ("parquet", "{}-????.parquet"),
    "store": ("store", "{}.duckdb"),
    "netcdf": ("cfradial", "{}-????.nc"),
    "windscanner": ("windscanner", "{}_????_wind.txt"),
    "database": ("database", DATABASE),
}

MAST_PERIOD_S = 60.0


def write_virtual(
    plan: Plan,
    site_text: str,
    out: Path,
    *,
    options: Options,
    beside: Path | None = None,
    kind: Format = "csv",
    url: str | None = None,
    progress: Progress | None = None,
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
    beside
        Folder of the site file: what it names there is copied too. Without it: the current folder.
    kind
        Format of the rays.
    url
        Of a database, as SQLAlchemy writes it, variables of the environment included; default: an SQLite file
        in the folder. It gets all scenarios of the run in one transaction, or none.
    progress
        Gets the share that is done.

    Returns
    -------
    list of Path
        The campaign file first.

    Raises
    ------
    InputError
        If a url is given for files, two scans would share a file, or a database refuses.
    """
    if url is not None and kind != "database":
        raise InputError(f"--url came with --format {kind}: it belongs to --format database")
    campaign = virtual(plan, options)
    require_own_files(layout.name for layout in campaign.layouts)
    with output_folder(out) as folder:
        parts = _watched(campaign_parts(campaign, plan, options), len(campaign.states), progress)
        with _ray_writer(plan, folder, kind, url) as rays:
            for day in _days(parts):
                for layout in campaign.layouts:
                    rays.write(layout.name, joined([part.records[layout.name] for part in day]))
                _append_mast(folder / "mast.csv", [part.mast for part in day])
                _append(folder / "truth.csv", [true_means(part) for part in day])
        _write_site(site_text, Path() if beside is None else beside, folder, out)
        text = campaign_text(plan, {layout.name: rays.told(layout.name) for layout in campaign.layouts})
        (folder / "campaign.yaml").write_text(text, encoding="utf-8")
        names = sorted(path.relative_to(folder) for path in folder.rglob("*") if path.is_file())
    return [out / "campaign.yaml", *(out / name for name in names if name.name != "campaign.yaml")]


def _write_site(text: str, source: Path, folder: Path, out: Path) -> None:
    """The site file with what it names; where the campaign is written beside it, all that is there already."""
    if out.resolve() == source.resolve():
        (folder / "site.yaml").write_text(text, encoding="utf-8")
    else:
        copy_site(text, source, folder)


def campaign_text(plan: Plan, inputs: Mapping[str, str]) -> str:
    """The campaign file that goes with the data; `inputs` tells of each scan where its rays are."""
    listed = "\n".join(f"  - {{scan: {_quoted(name)}, {told}}}" for name, told in inputs.items())
    notes = [f"# {note}" for note in told_scans(plan)]
    pairs = [pair for pair in plan.site.pairs if set(pair.scans) <= set(inputs)]
    lines = [
        "# A virtual campaign: `lidarplan retrieve` this file, then `lidarplan compare` it.",
        *notes,
        f"name: {_quoted(plan.site.name)}",
        "site: site.yaml",
        f"inputs:                          # angles are the head's; the site file's offsets turn them\n{listed}",
    ]
    if pairs:
        lines.append(f"pairs: [{', '.join(_quoted(pair.name) for pair in pairs)}]")
    lines += [
        "filters: {automatic: on}         # limits, such as cnr_db: [-25, -5], can be given beside it",
        "selection:                       # every period was drawn from the wind that counts: nothing more is left out",
        "  directions_deg: all",
        "  every_speed: true",
        "averaging: {periods_s: [60, 600]}",
        "mast: {path: mast.csv}",
        "output: results",
    ]
    return "\n".join(lines) + "\n"


@contextmanager
def _ray_writer(plan: Plan, folder: Path, kind: Format, url: str | None) -> "Iterator[_RayWriter]":
    """Open what the rays go into; a database gets all of them when the block ends, or none."""
    if kind != "database":
        yield _RayWriter(plan, folder, kind, url, None)
        return
    from reconstruct.formats.aas_scenarios import scenarios_of

    with scenarios_of(folder / DATABASE if url is None else os.path.expandvars(url)) as scenarios:
        yield _RayWriter(plan, folder, kind, url, scenarios)


class _RayWriter:
    """Writes rays in one format, and knows how the campaign file has to tell of them."""

    def __init__(
        self, plan: Plan, folder: Path, kind: Format, url: str | None, scenarios: "Scenarios | None"
    ) -> None:
        self._plan, self._folder, self._kind, self._url = plan, folder, kind, url
        self._scenarios = scenarios
        self._days: dict[str, int] = {}
        self._numbers: dict[str, list[int]] = {}

    def write(self, scan: str, records: Records) -> None:
        """Write the rays of one scan and day."""
        from reconstruct.formats.own_netcdf import write_netcdf
        from reconstruct.formats.windscanner_write import write_windscanner
        from reconstruct.record_tables import to_long, write_parquet
        from reconstruct.store import write_store

        number = self._days.setdefault(scan, 0)
        self._days[scan] += 1
        name = READ_AS[self._kind][1].format(file_name(scan)).replace("????", f"{number:04d}")
        path = self._folder / name
        match self._kind:
            case "csv":
                to_long(records).to_csv(path, index=False, float_format="%.6f", encoding="utf-8")
            case "parquet":
                write_parquet(records, path)
            case "store":
                write_store(path, records)
            case "netcdf":
                write_netcdf(records, path)
            case "windscanner":
                path.write_text(write_windscanner(records), encoding="utf-8")
            case "database":
                self._write_scenario(scan, records)

    def told(self, scan: str) -> str:
        """What the campaign file says of a scan's rays, after its name."""
        kind, pattern = READ_AS[self._kind]
        if self._kind != "database":
            stored = ", azimuth: stored" if kind == "windscanner" else ""
            return f"kind: {kind}, path: {_quoted(pattern.format(file_name(scan)))}{stored}"
        where = f"path: {DATABASE}" if self._url is None else f"url: {_quoted(self._url)}"
        return f"kind: database, {where}, scenarios: {self._numbers[scan]}"

    def _write_scenario(self, scan: str, records: Records) -> None:
        if self._scenarios is None:
            raise ValueError("no database is open")
        layout = self._plan.layout[scan]
        number = self._scenarios.write(
            records,
            scan_type="LOS" if layout.spec.type == "stare" else "PPI",
            pulse_ns=layout.probe.pulse_ns,
            fft_points=round(layout.probe.window_ns / layout.lidar.device.sample_ns),
        )
        self._numbers.setdefault(scan, []).append(number)


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
