"""Tables on the terminal."""

import os
import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.table import Table

PIPE_WIDTH = 220  # columns where neither a terminal nor COLUMNS says how many there are
LEAST_FOLD = 40  # columns: text that is folded narrower than this is no pleasure to read


def print_table(
    title: str, columns: Sequence[str], rows: Sequence[Sequence[str]], *, fold: str | None = None
) -> None:
    """Print a table; numbers are given as text and stand on the right.

    Nothing is ever cut: a table that is wider than the terminal is left to the terminal to wrap.

    Parameters
    ----------
    title
        What the table says; nothing is printed for an empty one.
    columns
        Headings with their units.
    rows
        One text a cell.
    fold
        The column whose text may be folded over several lines: to what the others leave of the terminal, and to 40
        columns at least.
    """
    from rich import box
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    table = Table(
        title=Text(title, style="bold") if title else None,
        box=box.SIMPLE_HEAD,
        title_justify="left",
        pad_edge=False,
    )
    for number, name in enumerate(columns):
        numeric = name != fold and all(_is_number(row[number]) for row in rows)
        table.add_column(
            Text(name), justify="right" if numeric else "left", no_wrap=name != fold, overflow="fold"
        )
    for row in rows:
        table.add_row(*(Text(cell) for cell in row))
    fitting = Console(width=_fit(table, None if fold is None else list(columns).index(fold)))
    with fitting.capture() as printed:
        fitting.print(table)
    sys.stdout.write("".join(f"{line.rstrip()}\n" for line in printed.get().splitlines()))


def _fit(table: "Table", fold: int | None) -> int:
    """Narrow the column that may be folded; the columns that the table then needs."""
    from rich.console import Console

    endless = Console(width=1_000_000)
    needed = endless.measure(table).maximum
    if fold is None:
        return needed
    column = table.columns[fold]
    natural = max(endless.measure(cell).maximum for cell in (column.header, *column.cells))
    kept = min(natural, max(LEAST_FOLD, _available() - (needed - natural)))
    column.width = kept
    return needed - natural + kept


def _available() -> int:
    """Columns of the terminal; in a pipe what COLUMNS says, if anything."""
    from rich.console import Console

    if sys.stdout.isatty():
        return Console().width
    told = os.environ.get("COLUMNS", "")
    return int(told) if told.isdecimal() and int(told) else PIPE_WIDTH


def _is_number(text: str) -> bool:
    try:
        for part in text.removesuffix("%").replace("–", "nan").split("±"):
            float(part)
    except ValueError:
        return False
    return True
