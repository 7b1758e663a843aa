"""What could not be read, and why: lost data is a count in a report, never a silent filter."""

from collections.abc import Iterable
from typing import NamedTuple

#: Losses that are listed one by one in a text before the rest is only counted.
SHOWN = 5


class Loss(NamedTuple):
    """Something of a file or table that was left out."""

    where: str  # file or table
    what: str  # what came and what is allowed
    line: int | None = None  # first line it happened in, counted from 1
    times: int = 1  # how many lines, rays or values were lost this way

    def __str__(self) -> str:
        place = self.where if self.line is None else f"{self.where}, line {self.line}"
        times = "" if self.times == 1 else f" ({self.times} times)"
        return f"{place}: {self.what}{times}"


def losses_text(losses: Iterable[Loss]) -> str:
    """One line for each of the first losses, and a count of the rest.

    Examples
    --------
    >>> print(losses_text([Loss("a.txt", "5 fields where 8 are needed", line=3, times=2)]))
    a.txt, line 3: 5 fields where 8 are needed (2 times)
    """
    every = list(losses)
    lines = [str(loss) for loss in every[:SHOWN]]
    if len(every) > SHOWN:
        lines.append(f"and {len(every) - SHOWN} more")
    return "\n".join(lines)


def merged_losses(losses: Iterable[Loss]) -> tuple[Loss, ...]:
    """The same losses with those of one place and one reason counted together, at their first line.

    Examples
    --------
    >>> merged_losses([Loss("a", "cut", line=4), Loss("a", "cut", line=2), Loss("b", "cut")])
    (Loss(where='a', what='cut', line=2, times=2), Loss(where='b', what='cut', line=None, times=1))
    """
    found: dict[tuple[str, str], Loss] = {}
    for loss in losses:
        before = found.get((loss.where, loss.what))
        if before is not None:
            lines = [line for line in (before.line, loss.line) if line is not None]
            loss = loss._replace(line=min(lines, default=None), times=before.times + loss.times)
        found[loss.where, loss.what] = loss
    return tuple(found.values())
