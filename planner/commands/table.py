"""Tables on the terminal."""

import sys
from collections.abc import Sequence

PIPE_WIDTH = (
    220  # columns where nothing says how wide the terminal is: nothing is folded on its way to a file
)


def print_table(
    title: str, columns: Sequence[str], rows: Sequence[Sequence[str]], *, fold: str | None = None
) -> None:
    """Print a table; numbers are given as text and stand on the right.

    Parameters
    ----------
    title
        What the table says; nothing is printed for an empty one.
    columns
        Headings with their units.
    rows
        One text a cell.
    fold
        The column whose text may be folded over several lines.
    """
    from rich import box
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    table = Table(
        title=title or None, box=box.SIMPLE_HEAD, title_justify="left", title_style="bold", pad_edge=False
    )
    for number, name in enumerate(columns):
        numeric = name != fold and all(_is_number(row[number]) for row in rows)
        table.add_column(
            name,
            justify="right" if numeric else "left",
            no_wrap=name != fold,
            overflow="fold" if name == fold else "ellipsis",
        )
    for row in rows:
        table.add_row(*(Text(cell) for cell in row))
    console = Console() if sys.stdout.isatty() else Console(width=PIPE_WIDTH)
    console.print(table)


def _is_number(text: str) -> bool:
    try:
        float(text.removesuffix("%").replace("–", "nan"))
    except ValueError:
        return False
    return True
