"""The arguments and options that commands share, and how they print."""

from pathlib import Path
from typing import Annotated

import typer

DEFAULT_OUT = Path("lidarplan-out")

SiteArgument = Annotated[str, typer.Argument(metavar="SITE", help="Site file, or - for standard input.")]
JsonOption = Annotated[
    bool, typer.Option("--json", help="One JSON document on standard output, for machines.")
]
OutOption = Annotated[
    Path, typer.Option("--out", metavar="DIR", help="Folder for the files that are written.")
]
QuietOption = Annotated[
    bool, typer.Option("--quiet", "-q", help="No progress and no remarks on standard error.")
]

FidelityOption = Annotated[
    str | None,
    typer.Option(
        "--fidelity",
        metavar="auto|all|NAME,...",
        help="Effects to model. [default: the site file's `fidelity`, else auto]",
    ),
]


def names_in(text: str | None) -> tuple[str, ...]:
    """The names of a list with commas; none without it."""
    return () if text is None else tuple(part.strip() for part in text.split(","))


def say(text: str) -> None:
    """Print a result on standard output."""
    typer.echo(text)


def remark(text: str, *, quiet: bool) -> None:
    """Print something about the work, not of it, on standard error."""
    if not quiet:
        typer.echo(text, err=True)


def say_json(document: object) -> None:
    """Print one JSON document; an unknown number is null, so NaN in it is a defect and raises ValueError."""
    import json

    typer.echo(json.dumps(document, ensure_ascii=False, indent=2, allow_nan=False))
