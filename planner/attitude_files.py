"""What the attitude logs of a run showed: a table, and sentences."""

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import NamedTuple

from reconstruct.attitude import Drift, LogMeans, add_log_means, drifts

#: Two independent means and a line leave nothing to judge the line by.
TOO_SHORT = "too short or too even a log to tell its standard error"


class Logged(NamedTuple):
    """The log of one scan's rays."""

    drifts: dict[str, Drift]  # by angle
    unlogged: int  # rays without an entry; they take the nearest one


def logged(parts: Iterable[LogMeans], unlogged: int) -> Logged | None:
    """The drift of a whole log from the sums of its parts; None where nothing is logged."""
    found = list(parts)
    return Logged(drifts(add_log_means(found)), unlogged) if found else None


def told_drifts(log: Logged) -> list[str]:
    """A sentence for each angle.

    Examples
    --------
    >>> told_drifts(Logged({"heading_deg": Drift(0.5, 0.1, 1.0, 0.012, True, 144, 90.0)}, 3))
    ['logged heading: 1.000 ± 0.012° a day over 144 means of ten minutes (significant at 5 %), mean change +0.50°',
     '3 rays have no logged attitude: they take the nearest one']
    """
    lines = []
    for name, drift in log.drifts.items():
        told = f"{drift.per_day_deg:.3f} ± {drift.standard_error_deg:.3f}° a day over {drift.means} means of ten minutes"
        verdict = f"({'' if drift.significant else 'not '}significant at 5 %)"
        if drift.standard_error_deg != drift.standard_error_deg:
            told, verdict = f"its drift is not known, {TOO_SHORT}", f"({drift.means} means of ten minutes)"
        change = f"mean change {drift.change_deg:+.2f}°"
        lines.append(f"logged {name.removesuffix('_deg')}: {told} {verdict}, {change}")
    if log.unlogged:
        lines.append(f"{log.unlogged} rays have no logged attitude: they take the nearest one")
    return lines


def write_drifts(folder: Path, logs: Mapping[str, Logged]) -> None:
    """Write `attitude.csv`, a row for each scan and angle; nothing where nothing is logged."""
    import pandas as pd

    rows = [
        {"scan": scan, "angle": name, **drift._asdict()}
        for scan, log in logs.items()
        for name, drift in log.drifts.items()
    ]
    if rows:
        pd.DataFrame(rows).to_csv(folder / "attitude.csv", index=False, float_format="%.6g", encoding="utf-8")
