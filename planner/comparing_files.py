"""The files of a comparison: its table as CSV and Parquet, its counts and verdicts as text, its figures."""

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Literal, get_args

import numpy as np

from planner.analysis_files import file_name
from planner.comparing import Comparison, Row
from planner.comparison_table import sentences, table_rows, verdicts
from planner.output import output_folder
from planner.scan_jobs import scan_of
from planner.wind_profile import wind_profile
from reconstruct.duck import write_parquet

if TYPE_CHECKING:
    from geometry.arrays import FloatArray
    from planner.figures.comparison import Series, SizeCurve

Kind = Literal["scatter", "turn", "time", "direction", "wind", "rose", "sizes", "profile", "animation"]
KINDS: tuple[Kind, ...] = get_args(Kind)
LEAST_FRAMES = 3  # sector sizes that are worth an animation

Figure = tuple[str, bytes]


def write_comparison(
    comparison: Comparison,
    folder: Path,
    *,
    title: str,
    kinds: Sequence[Kind] = KINDS,
    every_size: bool = False,
) -> list[Path]:
    """Write a comparison beside what was retrieved.

    Parameters
    ----------
    comparison
        What to write.
    folder
        Of the results.
    title
        The campaign's name.
    kinds
        Figures that are drawn.
    every_size
        Whether scatters are drawn of every sector size, not of the widest alone.

    Returns
    -------
    list of Path
        What was written.
    """
    import pandas as pd

    with output_folder(folder) as staging:
        frame = pd.DataFrame(table_rows(comparison))
        frame.to_csv(staging / "comparison.csv", index=False, float_format="%.6g", encoding="utf-8")
        write_parquet(frame, staging / "comparison.parquet")
        (staging / "compare.log").write_text(_log(comparison, title), encoding="utf-8")
        for name, picture in _figures(comparison, title, kinds, every_size=every_size):
            (staging / name).write_bytes(picture)
        names = sorted(path.name for path in staging.iterdir())
    return [folder / name for name in names]


def _log(comparison: Comparison, title: str) -> str:
    lines = [title, f"means over {comparison.period_s:g} s against the mast"]
    lines += [comparison.lost] if comparison.lost else []
    for row in comparison.rows:
        one = row.matched
        size = "" if one.sector_deg is None else f" {one.sector_deg:g}°"
        level = "" if one.mast_height_m is None else f", mast at {one.mast_height_m:g} m"
        counts = ", ".join(f"{step.name} {step.after} of {step.before}" for step in one.steps)
        lines.append(f"{one.scan}{size}{level}: {counts} periods")
    weibull = comparison.mast_weibull
    lines.append(f"Weibull of the mast: A {weibull.scale_mps:.2f} m/s, k {weibull.shape:.2f}")
    lines += [line for row in comparison.rows for line in sentences(row)]
    return "\n".join([*lines, *verdicts(comparison)]) + "\n"


def _figures(
    comparison: Comparison, title: str, kinds: Sequence[Kind], *, every_size: bool
) -> Iterator[Figure]:
    """The figures that are wanted, with their names."""
    from planner.figures.comparison import LEAST_PERIODS

    means = f"means over {comparison.period_s / 60:g} min"
    for scan in dict.fromkeys(row.matched.scan for row in comparison.rows):
        rows = [
            row for row in comparison.rows if row.matched.scan == scan and row.speed.pairs >= LEAST_PERIODS
        ]
        for kind in kinds if rows else ():
            yield from DRAWN[kind](rows, file_name(scan), f"{title}: {scan}, {means}", every_size)
    if "profile" in kinds:
        yield from _profile(comparison, f"{title}, {means}")


def _scatters(rows: list[Row], name: str, where: str, every_size: bool) -> Iterator[Figure]:
    from planner.figures.comparison import scatter

    for row in rows if every_size else rows[:1]:
        yield f"scatter_{name}{_size(row)}.png", scatter(_series(row), where=where)


def _turns(rows: list[Row], name: str, where: str, every_size: bool) -> Iterator[Figure]:
    from planner.figures.comparison import turn_scatter

    for row in rows if every_size else rows[:1]:
        yield f"scatter_direction_{name}{_size(row)}.png", turn_scatter(_series(row), where=where)


def _times(rows: list[Row], name: str, where: str, _: bool) -> Iterator[Figure]:
    """More than the widest and the narrowest size would cover each other."""
    from planner.figures.comparison import time_series

    shown = rows if len(rows) < 3 else [rows[0], rows[-1]]
    yield f"time_{name}.png", time_series([_series(row) for row in shown], where=where)


def _by_direction(rows: list[Row], name: str, where: str, every_size: bool) -> Iterator[Figure]:
    from planner.figures.comparison import by_direction

    for row in rows if every_size else rows[:1]:
        size = "" if row is rows[0] else _size(row)
        yield f"direction_{name}{size}.png", by_direction(_series(row), where=where)


def _winds(rows: list[Row], name: str, where: str, _: bool) -> Iterator[Figure]:
    from planner.figures.winds import densities

    yield f"wind_{name}.png", densities(_series(rows[0]), where=where)


def _roses(rows: list[Row], name: str, where: str, _: bool) -> Iterator[Figure]:
    from planner.figures.winds import roses

    yield f"rose_{name}.png", roses(_series(rows[0]), where=where)


def _sizes(rows: list[Row], name: str, where: str, _: bool) -> Iterator[Figure]:
    from planner.figures.comparison import per_size

    if len(rows) > 1:
        yield f"sizes_{name}.png", per_size(_curve(rows), where=where)


def _animations(rows: list[Row], name: str, where: str, _: bool) -> Iterator[Figure]:
    """Scatters from the widest to the narrowest size, on the same axes."""
    from planner.figures.animation import animated
    from planner.figures.comparison import scatter

    if len(rows) < LEAST_FRAMES:
        return
    series = [_series(row) for row in rows]
    top = 1.05 * max(float(max(np.max(one.lidar_mps), np.max(one.mast_mps))) for one in series)
    yield f"sizes_{name}.gif", animated([scatter(one, where=where, top_mps=top) for one in series])


def _nothing(*_: object) -> Iterator[Figure]:
    """A figure of all scans together is drawn once."""
    return iter(())


DRAWN: dict[Kind, Callable[[list[Row], str, str, bool], Iterator[Figure]]] = {
    "scatter": _scatters,
    "turn": _turns,
    "time": _times,
    "direction": _by_direction,
    "wind": _winds,
    "rose": _roses,
    "sizes": _sizes,
    "profile": _nothing,
    "animation": _animations,
}


def _profile(comparison: Comparison, where: str) -> Iterator[Figure]:
    from planner.figures.winds import profile

    widest = {row.matched.scan: row.matched for row in reversed(comparison.rows)}
    series = {name: scan_of(name) for name in widest}
    found = wind_profile(tuple(reversed(widest.values())), comparison.levels, series)
    if found is not None:
        shown = [(one.name, one.height_m, one.speed_mps, one.from_deg) for one in found.levels]
        periods = f"{found.periods} period{'' if found.periods == 1 else 's'}"
        yield "profile.png", profile(shown, where=f"{where}, {periods}")


def _size(row: Row) -> str:
    return "" if row.matched.sector_deg is None else f"_{row.matched.sector_deg:g}"


def _series(row: Row) -> "Series":
    from planner.figures.comparison import Series

    one = row.matched
    return Series(
        label="all rays" if one.sector_deg is None else f"{one.sector_deg:g}° sector",
        time_utc=one.time_utc,
        lidar_mps=one.lidar_mps,
        lidar_deg=one.lidar_deg,
        mast_mps=one.mast_mps,
        mast_deg=one.mast_deg,
        slope=row.speed.slope,
        turn=(row.direction.slope, row.direction.intercept_deg),
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
        residual_std_standard_error_mps=np.array([row.speed.residual_std_standard_error_mps for row in rows]),
        direction_std_deg=np.array([row.direction.residual_std_deg for row in rows]),
        direction_std_standard_error_deg=np.array(
            [row.direction.residual_std_standard_error_deg for row in rows]
        ),
        predicted_slope=predicted("slope"),
        predicted_residual_std_mps=predicted("residual_std_mps"),
        predicted_direction_std_deg=predicted("direction_residual_std_deg"),
    )
