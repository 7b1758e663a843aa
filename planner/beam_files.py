"""Tables of what one lidar knows by itself: period means of radial speeds, of every beam and gate."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from geometry.angles import difference_deg
from geometry.arrays import FloatArray
from geometry.errors import InputError
from planner.analysis_files import file_name
from planner.campaign import TwoBeam
from planner.places import Places
from planner.scan_jobs import ScanJob
from reconstruct.averaging import expected_count
from reconstruct.beam_means import BeamSums, add_beam_sums, along_beam_mps, beam_means
from reconstruct.duck import write_parquet
from reconstruct.filters import Step
from reconstruct.two_beam_means import TwoBeamMeans, trusted_means

if TYPE_CHECKING:
    import pandas as pd

BeamParts = dict[tuple[str, float], list[tuple[BeamSums, FloatArray]]]
"""Sums of the parts of a scan with the ranges of their gates, by its name and period."""


def write_beams(
    folder: Path, places: Places, jobs: Mapping[str, ScanJob], parts: BeamParts
) -> dict[str, tuple[Step, ...]]:
    """Write `beams_<scan>_<period>s` as CSV and Parquet for every scan that is no fan, or has two beams.

    Of two beams the winds along and across the axis are written too, as `two_beam_...`.

    Returns
    -------
    dict
        What the rules of two beams took away, by scan.

    Raises
    ------
    InputError
        If the gates of a scan change between its files.
    """
    steps: dict[str, tuple[Step, ...]] = {}
    for (name, period_s), found in parts.items():
        job, tail = jobs[name], f"{file_name(name)}_{period_s:g}s.csv"
        _write(beam_table(places, job, found), folder / f"beams_{tail}")
        if job.two_beam is not None:
            means = two_beam_means_of(job, job.two_beam, [sums for sums, _ in found])
            _write(_two_beam_table(means), folder / f"two_beam_{tail}")
            steps[name] = means.steps
    return steps


def _write(frame: "pd.DataFrame", path: Path) -> None:
    """A table as CSV, and as Parquet beside it."""
    frame.to_csv(path, index=False, float_format="%.5f", encoding="utf-8")
    write_parquet(frame, path.with_suffix(".parquet"))


def two_beam_means_of(job: ScanJob, rules: TwoBeam, parts: Sequence[BeamSums]) -> TwoBeamMeans:
    """Winds relative to the axis between two beams, of the periods that pass every rule; left is the first clockwise."""
    sums = add_beam_sums(parts)
    means = beam_means(sums)
    ends, place = np.unique(means.time_utc, return_inverse=True)
    count, mean = np.zeros((len(ends), 2), dtype=np.intp), np.full((len(ends), 2), np.nan)
    count[place, means.cell], mean[place, means.cell] = means.count, means.radial_speed_mps
    scan = job.layout.scan
    opening = float(np.asarray(difference_deg(scan.azimuth_deg[1], scan.azimuth_deg[0])))
    return trusted_means(
        ends,
        count,
        mean,
        half_angle_deg=opening / 2,
        elevation_deg=float(np.mean(scan.elevation_deg)),
        least_samples=rules.least_samples,
        least_speed_mps=rules.least_speed_mps,
        largest_angle_deg=rules.largest_angle_deg,
    )


def _two_beam_table(means: TwoBeamMeans) -> "pd.DataFrame":
    import pandas as pd

    left, right = means.samples.T
    wind = means.wind._asdict()
    return pd.DataFrame({"time_utc": means.time_utc, "samples_left": left, "samples_right": right, **wind})


def beam_table(places: Places, job: ScanJob, parts: list[tuple[BeamSums, FloatArray]]) -> "pd.DataFrame":
    """Period means of a scan's radial speeds: one row for each period, beam and gate.

    Heights are above the ground level of the site. `along_beam_mps` is the horizontal wind along the beam's azimuth,
    away from the lidar, if the air does not rise; it is missing where the beam is steeper than 60°.
    """
    import pandas as pd

    gates_m = _gates(job, [gates for _, gates in parts])
    sums = add_beam_sums(each for each, _ in parts)
    means = beam_means(sums)
    ray, gate = np.divmod(means.cell, len(gates_m))
    if job.kind == "beam":
        ray = np.full(len(ray), job.target_column or 0)
    azimuth, elevation = job.layout.scan.azimuth_deg[ray], job.layout.scan.elevation_deg[ray]
    range_m = gates_m[gate]
    end = places.beam_local_m(job.layout.lidar, azimuth, elevation, range_m)
    head = places.local_m(job.layout.lidar.position)
    expected = expected_count(sums.period_s, job.layout.scan.period_s)
    return pd.DataFrame(
        {
            "time_utc": means.time_utc,
            "azimuth_deg": np.mod(np.round(azimuth, 5), 360.0),  # as it is written: 0 and not 360.00000
            "elevation_deg": elevation,
            "range_m": range_m,
            "distance_m": np.hypot(*(end - head)[:, :2].T),
            "height_m": end[:, 2],
            "count": means.count,
            "radial_speed_mps": means.radial_speed_mps,
            "radial_speed_std_mps": means.radial_speed_std_mps,
            "along_beam_mps": along_beam_mps(means.radial_speed_mps, elevation),
            "availability": np.minimum(means.count / expected, 1.0),
        }
    )


def _gates(job: ScanJob, each: list[FloatArray]) -> FloatArray:
    """True ranges of the gates that the cells count."""
    if job.kind != "grid":
        return np.array([job.range_m], dtype=float)
    known = [gates for gates in each if len(gates)]
    if any(len(gates) != len(known[0]) or np.max(np.abs(gates - known[0])) > 1.0 for gates in known):
        raise InputError(
            f"scan '{job.layout.name}' has other range gates in some of its files: give those as a scan of their own"
        )
    return known[0] if known else np.array([np.nan])
