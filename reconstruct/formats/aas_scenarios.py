"""Scenarios that are written one after the other into a database of the reference study's kind, in one transaction."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from reconstruct.formats.aas_tables import connected, create_tables, held_columns, select
from reconstruct.formats.aas_write import ScanType, append_aas
from reconstruct.records import Records

if TYPE_CHECKING:
    import sqlalchemy as sa


class Scenarios:
    """An open transaction that takes scenarios."""

    def __init__(self, connection: "sa.Connection") -> None:
        self._connection = connection

    def write(self, records: Records, *, scan_type: ScanType, pulse_ns: float, fft_points: int) -> int:
        """Add records, whatever their scan ids, as one scenario; the number that it got, the first that is free."""
        number = self._free()
        one = replace(records, scan_id=np.full(records.rays, number))
        append_aas(self._connection, one, scan_type=scan_type, pulse_ns=pulse_ns, fft_points=fft_points)
        return number

    def _free(self) -> int:
        import sqlalchemy as sa

        held = held_columns(self._connection)
        clause, _ = select("control", held["control"])
        column = clause.c[held["control"]["scn_id"]]
        highest = self._connection.execute(sa.select(sa.func.max(column))).scalar()
        return 1 if highest is None else int(highest) + 1


@contextmanager
def scenarios_of(place: str | Path) -> Iterator[Scenarios]:
    """Scenarios that are all there when the block ends, and none of them if it fails or is interrupted.

    Parameters
    ----------
    place : str or Path
        SQLAlchemy's URL, or an SQLite file; the tables are made where they are not there, and stay.

    Raises
    ------
    InputError
        If the database refuses.
    """
    with connected(
        place, write=True
    ) as connection:  # apart: MariaDB ends a transaction where a table is made
        create_tables(connection)
    with connected(place, write=True) as connection:
        yield Scenarios(connection)
