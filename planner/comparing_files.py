"""The files of a comparison: its table as CSV, its counts as text, its figures."""

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from planner.analysis_files import file_name
from planner.comparing import Comparison, Row, table_rows
from planner.output import output_folder

if TYPE_CHECKING:
    from geometry.arrays import FloatArray
    from planner.figures.comparison import Series, SizeCurve


def write_comparison(comparison: Comparison, folder: Path, *, title: str, figures: bool = True) -> list[Path]:
    """Write a comparison beside what was retrieved.

    Returns
    -------
    list of Path
        What was written.
    """
    import pandas as pd

    with output_folder(folder) as staging:
        pd.DataFrame(table_rows(comparison)).to_csv(
            staging / "comparison.csv", index=False, float_format="%.6g", encoding="utf-8"
        )
        (staging / "compare.log").write_text(_log(comparison, title), encoding="utf-8")
        if figures:
            for name, picture in _figures(comparison, title):
                (staging / name).write_bytes(picture)
        names = sorted(path.name for path in staging.iterdir())
    return [folder / name for name in names]


def _log(comparison: Comparison, title: str) -> str:
    lines = [title]
    for row in comparison.rows:
        size = "" if row.matched.sector_deg is None else f" {row.matched.sector_deg:g}°"
        counts = ", ".join(f"{step.name} {step.after} of {step.before}" for step in row.matched.steps)
        lines.append(f"{row.matched.scan}{size}: {counts} periods")
    weibull = comparison.mast_weibull
    lines.append(f"Weibull of the mast: A {weibull.scale_mps:.2f} m/s, k {weibull.shape:.2f}")
    return "\n".join(lines) + "\n"


def _figures(comparison: Comparison, title: str) -> Iterator[tuple[str, bytes]]:
    """The figures of every scan with their names."""
    from planner.figures.comparison import LEAST_PERIODS, by_direction, per_size, scatter, time_series, wind

    for scan in dict.fromkeys(row.matched.scan for row in comparison.rows):
        rows = [
            row for row in comparison.rows if row.matched.scan == scan and row.speed.pairs >= LEAST_PERIODS
        ]
        if not rows:
            continue
        name, heading = file_name(scan), f"{title}: {scan}"
        series = [_series(row) for row in rows]
        for one, row in zip(series, rows, strict=True):
            size = "" if row.matched.sector_deg is None else f"_{row.matched.sector_deg:g}"
            yield f"scatter_{name}{size}.png", scatter(one, title=heading)
        yield (
            f"time_{name}.png",
            time_series(series if len(series) < 3 else [series[0], series[-1]], title=heading),
        )
        yield f"direction_{name}.png", by_direction(series[0], title=heading)
        yield f"wind_{name}.png", wind(series[0], title=heading)
        if len(rows) > 1:
            yield f"sizes_{name}.png", per_size(_curve(rows), title=heading)


def _series(row: Row) -> "Series":
    from planner.figures.comparison import Series

    one = row.matched
    label = "whole" if one.sector_deg is None else f"{one.sector_deg:g}°"
    return Series(
        label, one.time_utc, one.lidar_mps, one.lidar_deg, one.mast_mps, one.mast_deg, row.speed.slope
    )


def _curve(rows: list[Row]) -> "SizeCurve":
    from planner.figures.comparison import SizeCurve

    def predicted(name: str) -> "FloatArray":
        values = [row.foreseen(name) for row in rows]
        return np.array([np.nan if value is None else value for value in values])

    return SizeCurve(
        sector_deg=np.array([row.matched.sector_deg for row in rows], dtype=float),
        slope=np.array([row.speed.slope for row in rows]),
        slope_standard_error=np.array([row.speed.slope_standard_error for row in rows]),
        residual_std_mps=np.array([row.speed.residual_std_mps for row in rows]),
        direction_std_deg=np.array([row.direction.residual_std_deg for row in rows]),
        predicted_slope=predicted("slope"),
        predicted_residual_std_mps=predicted("residual_std_mps"),
        predicted_direction_std_deg=predicted("direction_residual_std_deg"),
    )
