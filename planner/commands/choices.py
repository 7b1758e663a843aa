"""Words and lists of numbers given as options, checked at the door."""

import math
from typing import TypeVar

from geometry.errors import InputError

Word = TypeVar("Word", bound=str)


def chosen(option: str, value: str, allowed: tuple[Word, ...]) -> Word:
    """Give the allowed word that was chosen.

    Raises
    ------
    InputError
        If it is none of them.
    """
    for word in allowed:
        if word == value:
            return word
    raise InputError(f"{option} {value} came; allowed: {', '.join(allowed)}")


def within(
    option: str,
    value: float | None,
    least: float = -math.inf,
    most: float = math.inf,
    *,
    open_below: bool = False,
) -> None:
    """Refuse a number that is outside its limits, or no finite number; None is what was not given.

    Parameters
    ----------
    option
        Its name, for the message.
    value
        What came.
    least, most
        Limits, which are allowed themselves.
    open_below
        Whether the lower limit itself is refused.

    Raises
    ------
    InputError
        With what is allowed.
    """
    if value is None or (
        math.isfinite(value) and least <= value <= most and not (open_below and value == least)
    ):
        return
    start = f"more than {least:g}" if open_below else f"{least:g} or more"
    end = f", at most {most:g}" if most < math.inf else ""
    raise InputError(f"{option} {value:g} came; allowed: a number, {start}{end}")


def numbers(option: str, text: str) -> list[float]:
    """Read a list such as 60,30,8.

    Raises
    ------
    InputError
        If a part of it is no positive number, or one comes twice.
    """
    try:
        values = [float(part) for part in text.split(",")]
    except ValueError:
        values = []
    if not values or not all(math.isfinite(value) and value > 0 for value in values):
        raise InputError(
            f"{option} {text} came; allowed: positive numbers with commas between them, such as 60,30,8"
        )
    if len(set(values)) < len(values):
        raise InputError(f"{option} {text} names a size twice; give each once")
    return values
