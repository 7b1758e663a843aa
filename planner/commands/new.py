"""`lidarplan new DIR`: a commented site file to start from."""

from pathlib import Path
from typing import Annotated

import typer

from planner.commands.options import JsonOption, QuietOption, remark, say, say_json

FolderArgument = Annotated[Path, typer.Argument(metavar="DIR", help="Folder for site.yaml; made if need be.")]


def register(app: typer.Typer) -> None:
    """Add the command to the application."""
    app.command("new")(new)


def new(folder: FolderArgument, json: JsonOption = False, quiet: QuietOption = False) -> None:
    """Write a commented site file to start from.

    The file is DIR/site.yaml; one that exists is never touched.
    """
    from planner.output import new_text
    from planner.templates import site_text

    path = folder / "site.yaml"
    new_text(path, site_text())
    if json:
        say_json({"site": str(path)})
    else:
        say(str(path))
    remark("Put in your own positions, scans and wind; every key has its comment.", quiet=quiet)
