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
