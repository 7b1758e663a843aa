"""Tables of the report: each column once, for the page (sensible digits) and for CSV (all of them)."""

import csv
import math
from collections.abc import Iterable, Sequence
from io import StringIO
from typing import NamedTuple

Value = str | float | int | bool | None

DASH = "–"  # on the page, where nothing is known; a CSV cell stays empty
MINUS = "−"
CSV_DIGITS = 10  # significant: a tenth of a millimetre in ten thousand kilometres

# A spreadsheet takes text that begins so for a formula: it gets an apostrophe in front.
FORMULA_STARTS = ("=", "+", "-", "@", "\t", "\r")


class Column(NamedTuple):
    """One column."""

    key: str  # heading in the CSV file, unit included
    heading: str  # on the page
    unit: str = ""
    digits: int | None = None  # after the decimal point; None for text
    signed: bool = False  # write the plus sign
    on_page: bool = True
    in_file: bool = True

    @property
    def numeric(self) -> bool:
        """Whether it holds numbers, which stand on the right."""
        return self.digits is not None


class Table(NamedTuple):
    """A table of the report."""

    name: str  # of the CSV file, without its ending
    caption: str
    columns: tuple[Column, ...]
    rows: tuple[tuple[Value, ...], ...]

    @property
    def page_columns(self) -> tuple[Column, ...]:
        """The columns that stand on the page."""
        return tuple(column for column in self.columns if column.on_page)

    @property
    def page_rows(self) -> list[list[str]]:
        """The cells of the page, as text."""
        return [
            [cell(column, value) for column, value in zip(self.columns, row, strict=True) if column.on_page]
            for row in self.rows
        ]

    @property
    def file_columns(self) -> tuple[Column, ...]:
        """The columns that stand in the CSV file."""
        return tuple(column for column in self.columns if column.in_file)

    @property
    def file_rows(self) -> list[tuple[Value, ...]]:
        """The values of the CSV file."""
        return [
            tuple(value for column, value in zip(self.columns, row, strict=True) if column.in_file)
            for row in self.rows
        ]


def cell(column: Column, value: Value) -> str:
    """Write a value as it stands on the page.

    Examples
    --------
    >>> cell(Column("gap_m", "gap", "m", 2), 0.256), cell(Column("gap_m", "gap", "m", 2), None)
    ('0.26', '–')
    >>> cell(Column("bias", "bias", "m/s", 1, signed=True), -0.44)
    '−0.4'
    """
    if value is None or (isinstance(value, float) and not math.isfinite(value)):
        return DASH
    if column.digits is None or isinstance(value, str):
        return str(value)
    return fixed(float(value), column.digits, signed=column.signed)


def fixed(value: float, digits: int, *, signed: bool = False) -> str:
    """Write a number with so many decimals, a true minus sign, and never a negative nothing.

    Examples
    --------
    >>> fixed(-0.001, 2), fixed(-3.14159, 2), fixed(2.0, 0, signed=True)
    ('0.00', '−3.14', '+2')
    """
    rounded = round(value, digits) + 0.0  # -0.0 + 0.0 is 0.0
    text = f"{rounded:+.{digits}f}" if signed and rounded else f"{rounded:.{digits}f}"
    return text.replace("-", MINUS)


def sensible(value: float | None) -> str:
    """Write a number with three digits that count, more only before the point.

    Examples
    --------
    >>> sensible(0.14035), sensible(1133.02), sensible(12), sensible(None), sensible(-0.0004567)
    ('0.14', '1133', '12', '–', '−0.000457')
    """
    if value is None or not math.isfinite(value):
        return DASH
    if value == 0:
        return "0"
    digits = max(2 - math.floor(math.log10(abs(value))), 0)
    text = fixed(value, digits)
    return text.rstrip("0").rstrip(".") if "." in text else text


def quantity(value: float | None, unit: str) -> str:
    """Write a finding's number with its unit; a share as a percentage.

    Examples
    --------
    >>> quantity(0.1404, "share"), quantity(63.21, "deg"), quantity(12.1, "s"), quantity(None, "m")
    ('14 %', '63.2°', '12.1 s', '–')
    """
    if value is None or not math.isfinite(value):
        return DASH
    if unit == "share":
        return percent(value)
    if unit.startswith("deg"):
        return f"{sensible(value)}°{unit.removeprefix('deg')}"
    return f"{sensible(value)} {unit}".rstrip()


def percent(share: float) -> str:
    """Write a share as a percentage; what is not nothing is not written as 0 %.

    Examples
    --------
    >>> percent(0.1404), percent(0.004), percent(0.0), percent(1.0), percent(0.9996)
    ('14 %', '0.4 %', '0 %', '100 %', '99.96 %')
    """
    value = 100 * share
    if value in (0.0, 100.0) or 1 <= value <= 99:
        return f"{value:.0f} %"
    return (
        f"{value:.2f}".rstrip("0").rstrip(".") + " %"
        if 0.005 <= value < 99.995
        else "< 0.01 %"
        if value < 1
        else "> 99.99 %"
    )


def spans(pairs: Iterable[tuple[float, float]]) -> str:
    """Write directions as spans; the whole circle is `all`, nothing is `none`.

    Examples
    --------
    >>> spans([(118.2, 270.0)]), spans([]), spans([(0.0, 0.0)]), spans([(340.0, 20.0), (90.0, 100.0)])
    ('118–270°', 'none', 'all', '340–20°, 90–100°')
    """
    texts = ["all" if (stop - start) % 360.0 == 0 else f"{start:.0f}–{stop:.0f}°" for start, stop in pairs]
    return ", ".join(texts) or "none"


def csv_text(columns: Sequence[Column], rows: Iterable[Sequence[Value]]) -> str:
    """Write a table as CSV (RFC 4180, numbers with a point, empty where nothing is known).

    Text that a spreadsheet would take for a formula gets an apostrophe in front.

    Examples
    --------
    >>> columns = [Column("name", "name"), Column("gap_m", "gap", "m", 2)]
    >>> print(csv_text(columns, [("=1+1", 0.256), ("a,b", None)]), end="")
    name,gap_m
    '=1+1,0.256
    "a,b",
    """
    out = StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow([column.key for column in columns])
    writer.writerows([_raw(value) for value in row] for row in rows)
    return out.getvalue()


def _raw(value: Value) -> str:
    if value is None or (isinstance(value, float) and not math.isfinite(value)):
        return ""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, float):
        return f"{value:.{CSV_DIGITS}g}"
    return f"'{value}" if isinstance(value, str) and value.startswith(FORMULA_STARTS) else str(value)
