"""A fault of a site, and how it is told: key, what came, what is allowed, what to do."""

import math
from collections.abc import Iterator, Mapping
from typing import NamedTuple

Loc = tuple[str | int, ...]
Raw = Mapping[str, object]

NOTHING = object()  # for a fault about what is not there


class Fault(NamedTuple):
    """One fault of a site: where, what came (NOTHING: it is missing), what is allowed, what to do.

    Without `allowed`, `hint` says it all.
    """

    loc: Loc
    came: object
    allowed: str
    hint: str = ""

    def __str__(self) -> str:
        came = "nothing" if self.came is NOTHING else spelled(self.came)
        told = f"{came} came; allowed: {self.allowed}" if self.allowed else ""
        hint = f". {self.hint}" if told and self.hint else self.hint
        return f"{key_of(self.loc)}: {told}{hint}"


def key_of(loc: Loc) -> str:
    """`("lidars", 0, "position")` as people write it: lidars[0].position."""
    text = ""
    for part in loc:
        text += f"[{part}]" if isinstance(part, int) else f".{part}" if text else part
    return text or "the site"


def spelled(value: object) -> str:
    """A value as a site file would spell it, on one line and not too long."""
    if value is None:
        text = "null (an empty value)"
    elif isinstance(value, bool):
        text = str(value).lower()
    elif isinstance(value, float) and not math.isfinite(value):
        text = ".nan" if math.isnan(value) else ".inf" if value > 0 else "-.inf"
    elif isinstance(value, str):
        text = repr(value)
    elif isinstance(value, list | tuple):
        text = "[" + ", ".join(spelled(v) for v in value) + "]"
    elif isinstance(value, Mapping):
        text = "{" + ", ".join(f"{k}: {spelled(v)}" for k, v in value.items()) + "}"
    else:
        text = str(value)
    return text if len(text) <= 90 else text[:87] + "..."


def did_you_mean(word: str, known: list[str]) -> str:
    """A question after a misspelt word, or nothing."""
    import difflib

    close = difflib.get_close_matches(word.lower(), [k.lower() for k in known], n=1, cutoff=0.6)
    match = next((k for k in known if close and k.lower() == close[0]), None)
    return f"Did you mean '{match}'?" if match else ""


def entries(raw: Raw, key: str) -> Iterator[tuple[int, Raw]]:
    """The mappings of a list, with their places; what is no list or no mapping is for another check."""
    items = raw.get(key)
    for index, item in enumerate(items if isinstance(items, list | tuple) else ()):
        if isinstance(item, Mapping):
            yield index, item


def number(value: object) -> float | None:
    """The value if it is a finite number."""
    if not isinstance(value, int | float) or isinstance(value, bool):
        return None
    try:
        as_float = float(value)
    except OverflowError:  # a whole number of more than 308 digits
        return None
    return as_float if math.isfinite(as_float) else None
