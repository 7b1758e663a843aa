"""Sums over periods, kept on the disk while a run works: a year of one-minute means of nine sizes would fill a third of a GB."""

from collections.abc import Iterator
from dataclasses import fields
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from reconstruct.averaging import PeriodSums, add_sums

_COLUMNS = tuple(field.name for field in fields(PeriodSums) if field.name != "period_s")


class Key(NamedTuple):
    """Whose sums they are."""

    name: str  # of a scan or pair
    sector_deg: float  # NaN where there is no size
    period_s: float


class SumFiles:
    """Sums of parts, appended to a file a key; read back whole, a key at a time."""

    def __init__(self, folder: Path) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        for old in folder.glob("*.sums"):  # of a run that broke off
            old.unlink()
        self._folder = folder
        self._places: dict[str, tuple[Key, Path]] = {}

    def add(self, key: Key, sums: PeriodSums) -> None:
        """Append the sums of a part."""
        known = self._places.setdefault(repr(key), (key, self._folder / f"{len(self._places):06d}.sums"))
        rows = np.stack([np.asarray(getattr(sums, name), dtype=float) for name in _COLUMNS], axis=1)
        with known[1].open("ab") as file:
            rows.tofile(file)

    def totals(self, period_s: float) -> Iterator[tuple[Key, PeriodSums]]:
        """The sums of the whole for each key of a period, in the order in which they came first."""
        for key, place in list(self._places.values()):
            if key.period_s == period_s:
                rows = np.fromfile(place).reshape(-1, len(_COLUMNS))
                columns: dict[str, Any] = dict(zip(_COLUMNS, rows.T, strict=True))
                columns |= {name: columns[name].astype(np.intp) for name in ("number", "count")}
                yield key, add_sums([PeriodSums(period_s=period_s, **columns)])
