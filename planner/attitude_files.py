"""What the attitude logs of a run showed: a table, and sentences."""

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np

from reconstruct.attitude import Drift, LogMeans, add_log_means, drifts


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
    ['logged heading: mean change +0.50°; drift +1.000 ± 0.012° a day over 144 means of ten minutes (significant at 5 %)',
     'rays without a logged attitude, which take the nearest one: 3']
    """
    lines = []
    for name, drift in log.drifts.items():
        angle = f"logged {name.removesuffix('_deg')}: mean change {round(drift.change_deg, 2) + 0.0:+.2f}°"
        if np.isnan(drift.standard_error_deg):
            lines.append(
                f"{angle}; {drift.means} mean{'s' * (drift.means != 1)} of ten minutes, too few to tell a drift"
            )
            continue
        verdict = f"{'' if drift.significant else 'not '}significant at 5 %"
        slope = f"{drift.per_day_deg:+.3f} ± {drift.standard_error_deg:.3f}° a day"
        lines.append(f"{angle}; drift {slope} over {drift.means} means of ten minutes ({verdict})")
    if log.unlogged:
        lines.append(f"rays without a logged attitude, which take the nearest one: {log.unlogged}")
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
