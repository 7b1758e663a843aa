"""A site file somewhere else, with the files that it names: heights, canopy, wind rose, areas."""

import shutil
from collections.abc import Iterator, Mapping
from io import StringIO
from pathlib import Path

from geometry.errors import InputError
from planner.faults import Loc
from planner.files.yaml_edit import round_trip
from planner.files.yaml_site import named_files
from planner.files.yaml_tree import Tree

ASIDE = "site_files"  # for what cannot lie under its own name
# What stands beside a Shapefile or a raster and belongs to it.
COMPANIONS = (".shx", ".dbf", ".prj", ".cpg", ".tfw", ".wld", ".hdr", ".aux.xml", ".ovr", ".msk")


def copy_site(text: str, source: Path, folder: Path) -> None:
    """Write a site file as `site.yaml` into a folder, with copies of the files that it names.

    Parameters
    ----------
    text
        Of a valid site file.
    source
        Folder that its relative paths start from.
    folder
        Where the copies go: a relative path stays as it is; a file that lies outside of the source, or whose
        name is taken, goes into `site_files`, and the copy of the site file names it there.

    Raises
    ------
    InputError
        If a file cannot be copied.
    """
    raw = Tree(text).value
    moved: dict[Loc, str] = {}
    places: dict[str, str] = {}  # by the name in the site file: a file named twice is copied once
    for loc, name in named_files(raw if isinstance(raw, Mapping) else {}):
        if name not in places:
            places[name] = _free_place(name, folder)
            _copy(source / name, folder / places[name])
        if places[name] != name:
            moved[loc] = places[name]
    (folder / "site.yaml").write_text(_renamed(text, moved) if moved else text, encoding="utf-8")


def _free_place(name: str, folder: Path) -> str:
    """Where in the folder a file can lie: under its own name, if that leads into it and nothing is there."""
    path = Path(name)
    inside = not path.is_absolute() and ".." not in path.parts
    taken = name in ("site.yaml", "campaign.yaml") or (folder / path).exists()
    if inside and not taken:
        return name
    places = _places_aside(path.name)
    return next(place for place in places if not (folder / place).exists())


def _places_aside(name: str) -> Iterator[str]:
    yield f"{ASIDE}/{name}"
    number = 2
    while True:
        yield f"{ASIDE}/{number}/{name}"
        number += 1


def _copy(file: Path, place: Path) -> None:
    """A file with what belongs to it."""
    try:
        place.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(file, place)
        for other in file.parent.iterdir():
            tail = other.name.removeprefix(file.stem)
            own = tail != other.name and tail.removeprefix(file.suffix).lower() in COMPANIONS
            if own and other != file and other.is_file():
                shutil.copyfile(other, place.with_name(other.name))
    except OSError as error:
        raise InputError(
            f"{file}, which the site file names, cannot be copied ({error.strerror or error})"
        ) from error


def _renamed(text: str, names: Mapping[Loc, str]) -> str:
    """The text of a site file with other names at some places; comments and order stay."""
    yaml = round_trip()
    document = yaml.load(text)
    for (*way, last), name in names.items():
        place = document
        for part in way:
            place = place[part]
        place[last] = name
    out = StringIO()
    yaml.dump(document, out)
    return out.getvalue()
