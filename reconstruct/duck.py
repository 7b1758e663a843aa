"""DuckDB with a bound on its memory: what does not fit goes to the disk."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import duckdb
    import pandas as pd

#: Of the pages, sorts and row groups that DuckDB holds; by itself it takes 80 % of the machine's memory.
MEMORY = "128MB"

#: Each thread holds a row group of its own while it writes.
MOST_THREADS = 4


@contextmanager
def bounded_duck(
    path: Path | None = None, *, read_only: bool = False, spill: Path | None = None
) -> "Iterator[duckdb.DuckDBPyConnection]":
    """Open a connection that holds no more than 128 MB.

    Parameters
    ----------
    path : Path, optional
        The database's file; without it one in memory.
    read_only : bool
        Of a file that is there.
    spill : Path, optional
        Folder for what does not fit in memory; default: beside the file, or the current folder.

    Yields
    ------
    duckdb.DuckDBPyConnection
        Closed at the end.

    Examples
    --------
    >>> with bounded_duck() as connection:
    ...     connection.execute("SELECT current_setting('memory_limit')").fetchall()
    [('122.0 MiB',)]
    """
    import duckdb

    config: dict[str, str | bool | int | float | list[str]] = {
        "memory_limit": MEMORY,
        "threads": min(os.cpu_count() or 1, MOST_THREADS),
    }
    if spill is not None:
        config["temp_directory"] = str(spill)
    connection = duckdb.connect(":memory:" if path is None else str(path), read_only=read_only, config=config)
    try:
        connection.execute(
            "SET enable_progress_bar = false"
        )  # it would stand among the results on standard output
        yield connection
    finally:
        connection.close()


def write_parquet(frame: "pd.DataFrame", path: Path) -> None:
    """Write a table as Parquet.

    Parameters
    ----------
    frame : DataFrame
        One row a record.
    path : Path
        The file; one that is there is replaced.
    """
    with bounded_duck(spill=path.parent) as connection:
        connection.register("frame", frame)
        connection.execute(f"COPY frame TO {quoted(path)} (FORMAT parquet)")


def quoted(path: Path | str) -> str:
    """A path or text as SQL takes it.

    Examples
    --------
    >>> quoted("o'clock.csv")
    "'o''clock.csv'"
    """
    text = str(path).replace("'", "''")
    return f"'{text}'"
