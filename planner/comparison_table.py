"""The comparison as a table for files and machines, and in plain words."""

from collections.abc import Callable

from planner.comparing import Comparison, Row
from reconstruct.agreement import AGREES, Difference

FORESEEN = (
    "slope",
    "slope_std",
    "residual_std_mps",
    "mean10_speed_bias_mps",
    "mean10_speed_std_mps",
    "direction_residual_std_deg",
)  # numbers of the prediction that stand in the table

FEW_PERIODS = 50  # of fewer a jackknife's standard error is itself uncertain

JUDGED: tuple[tuple[str, Callable[[Row], Difference | None]], ...] = (
    ("slope", lambda row: row.slope_beside),
    ("scatter of speed", lambda row: row.scatter_beside),
    ("scatter of direction", lambda row: row.direction_beside),
)  # measured numbers that have a predicted one beside them


def table_rows(comparison: Comparison) -> list[dict[str, object]]:
    """The comparison as rows of a table, one for each scan and size."""
    rows: list[dict[str, object]] = []
    for row in comparison.rows:
        one = row.matched
        told: dict[str, object] = {"scan": one.scan, "sector_deg": one.sector_deg, "rays": one.rays}
        told |= {"height_m": one.height_m, "mast_height_m": one.mast_height_m}
        told |= row.speed._asdict()
        told |= {
            f"direction_{name}": value for name, value in row.direction._asdict().items() if name != "pairs"
        }
        told |= {
            f"direction_plain_{name}": getattr(row.plainly, name)
            for name in ("slope", "intercept_deg", "r_squared")
        }
        told |= {"weibull_scale_mps": row.weibull.scale_mps, "weibull_shape": row.weibull.shape}
        told |= {f"predicted_{name}": row.foreseen(name) for name in FORESEEN}
        for name, beside in (
            ("slope", row.slope_beside),
            ("residual_std", row.scatter_beside),
            ("direction_residual_std", row.direction_beside),
        ):
            told[f"{name}_apart"] = None if beside is None else beside.apart
            told[f"{name}_apart_standard_error"] = None if beside is None else beside.standard_error
            told[f"{name}_agrees"] = None if beside is None else beside.agrees
        rows.append(told)
    return rows


def name_of(row: Row) -> str:
    """A row's scan and sector size."""
    size = row.matched.sector_deg
    return row.matched.scan if size is None else f"{row.matched.scan} {size:g}°"


def verdicts(comparison: Comparison) -> list[str]:
    """Whether measurement and prediction agree, a sentence for each number; nothing where nothing was predicted."""
    told = []
    for what, beside in JUDGED:
        known = [(row, found) for row in comparison.rows if (found := beside(row)) is not None]
        judged = [(row, found) for row, found in known if found.agrees is not None]
        if not judged:
            continue
        off = [(row, found) for row, found in judged if not found.agrees]
        head = (
            f"{what}: measured and predicted agree within {AGREES:g} standard errors in "
            f"{len(judged) - len(off)} of {len(judged)} rows"
        )
        apart = ", ".join(f"{name_of(row)} ({found.ratio:+.1f})" for row, found in off)
        told.append(f"{head}; not in {apart}" if off else head)
    fewest = min((row.speed.pairs for row in comparison.rows if row.slope_beside is not None), default=0)
    if told and fewest < FEW_PERIODS:
        told.append(f"with as few as {fewest} periods the standard errors themselves are rough")
    return told


def sentences(row: Row) -> list[str]:
    """One row's slope against its prediction, in words."""
    found = row.slope_beside
    if found is None:
        return []
    measured = f"{row.speed.slope:.4f} ± {row.speed.slope_standard_error:.4f}"
    lasting = row.foreseen("slope_std")
    sure = "" if lasting is None else f" ± {lasting:.4f}"
    judged = "" if found.agrees is None else ", which agrees" if found.agrees else ", which does not agree"
    return [
        f"{name_of(row)}: slope {measured} measured, {row.foreseen('slope'):.4f}{sure} predicted: apart by "
        f"{found.apart:+.4f} ± {found.standard_error:.4f}{judged}"
    ]
