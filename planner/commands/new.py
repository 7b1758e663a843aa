"""`lidarplan new DIR`: a commented site file to start from, or one made from a layout."""

from pathlib import Path
from typing import Annotated

import typer

from planner.commands.options import JsonOption, QuietOption, remark, say, say_json

FolderArgument = Annotated[Path, typer.Argument(metavar="DIR", help="Folder for site.yaml; made if need be.")]
LayoutOption = Annotated[
    Path | None,
    typer.Option(
        "--from",
        metavar="LAYOUT",
        help="Points with a `role` column (lidar, mast, turbine, target): CSV, GeoJSON, GeoPackage, KML, KMZ, Shapefile.",
    ),
]
CrsOption = Annotated[
    str | None,
    typer.Option(
        "--crs",
        metavar="EPSG:...",
        help="Projected CRS of the site. [default: the layout's, or its UTM zone]",
    ),
]
LayoutCrsOption = Annotated[
    str | None,
    typer.Option("--layout-crs", metavar="EPSG:...", help="CRS of a layout that does not say it."),
]
NameOption = Annotated[
    str | None, typer.Option("--name", help="Name of the site. [default: that of the layout's file]")
]


def register(app: typer.Typer) -> None:
    """Add the command to the application."""
    app.command("new", short_help="Write a site file to start from.")(new)


def new(
    folder: FolderArgument,
    layout: LayoutOption = None,
    crs: CrsOption = None,
    layout_crs: LayoutCrsOption = None,
    name: NameOption = None,
    json: JsonOption = False,
    quiet: QuietOption = False,
) -> None:
    """Write a site file to start from: a commented one, or one with the positions of a layout.

    The file is DIR/site.yaml; one that exists is never touched.
    """
    from geometry.errors import InputError
    from planner.output import new_text

    if folder.suffix.lower() in (".yaml", ".yml") and not folder.is_dir():
        raise InputError(
            f"{folder} came; DIR is wanted, a folder in which site.yaml is made: give {folder.parent}"
        )
    path = folder / "site.yaml"
    text, notes = (
        _template(crs, layout_crs, name) if layout is None else _of_layout(layout, crs, layout_crs, name)
    )
    new_text(path, text)
    if json:
        say_json({"site": str(path), **({} if layout is None else {"notes": list(notes)})})
    else:
        say(str(path))
    for note in notes:
        remark(note, quiet=quiet)


def _template(*given: str | None) -> tuple[str, tuple[str, ...]]:
    from geometry.errors import InputError
    from planner.templates import site_text

    if any(given):
        raise InputError(
            "--crs, --layout-crs and --name go with --from LAYOUT; a new file has its own to edit"
        )
    return site_text(), ("Put in your own positions, scans and wind; each key in it has its comment.",)


def _of_layout(
    layout: Path, crs: str | None, layout_crs: str | None, name: str | None
) -> tuple[str, tuple[str, ...]]:
    from planner.files.layout import load_layout
    from planner.files.layout_yaml import layout_text

    read = load_layout(layout, crs=crs, layout_crs=layout_crs)
    text = layout_text(layout, read, name or layout.stem)
    return text, (*read.notes, "Positions are in; scans and wind are still to be given.")
