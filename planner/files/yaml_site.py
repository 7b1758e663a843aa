"""A site file in YAML 1.2 -> `Site`, or one error that lists every fault of the file."""

import sys
from collections.abc import Iterator, Mapping
from pathlib import Path

from pydantic import ValidationError

from geometry.errors import InputError
from planner.faults import NOTHING, Fault, Loc, key_of, spelled
from planner.files.fault_words import fault_of, is_echo
from planner.files.yaml_tree import Tree, YamlFault
from planner.site import CHECKED, Area, Site
from planner.site_faults import faults_of

MAX_BYTES = 20_000_000
STANDARD_INPUT = "-"


def load_site(path: Path | str) -> Site:
    """Read a site file.

    Parameters
    ----------
    path : Path or str
        The file; `-` reads standard input. Files that it names are looked for beside it (for `-`: in the
        current folder).

    Returns
    -------
    Site
        Valid in itself; whether it is a good plan is for the checks to say.

    Raises
    ------
    InputError
        With every fault of the file: file, line, key, what came, what is allowed.
    """
    name = "standard input" if str(path) == STANDARD_INPUT else str(path)
    folder = Path() if str(path) == STANDARD_INPUT else Path(path).parent
    return parse_site(_text(path, name), name=name, folder=folder)


def parse_site(text: str, *, name: str = "site", folder: Path | None = None) -> Site:
    """Read a site from text.

    Parameters
    ----------
    text : str
        YAML 1.2.
    name : str
        What messages call the text.
    folder : Path, optional
        Where files that the site names lie; by default they are not looked for.

    Raises
    ------
    InputError
        As `load_site`.
    """
    tree = Tree(text)
    if not tree.faults and not isinstance(tree.value, Mapping):
        came = "an empty file" if tree.value is None else f"{spelled(tree.value)}"
        raise InputError(
            f"{name}: {came} came; a site file is a mapping that starts with `name:` and `crs:`.\n{_NEW}"
        )
    raw = tree.value if isinstance(tree.value, dict) else {}
    site, faults = _validated(raw) if raw else (None, [])
    faults += [*_missing_files(raw, folder), *_no_rasters(raw, folder)] if folder is not None else []
    found = tree.faults + [YamlFault(tree.line(fault.loc), fault) for fault in faults]
    if found or site is None:
        raise InputError(_report(name, found))
    return site if folder is None else _rooted(site, folder)


_NEW = "`lidarplan new DIR` writes one to start from."


def _text(path: Path | str, name: str) -> str:
    """The text of a file; every way in which it cannot be one is an InputError."""
    try:
        if str(path) == STANDARD_INPUT:
            data = sys.stdin.buffer.read(MAX_BYTES + 1)
        else:
            with Path(path).open("rb") as file:
                data = file.read(MAX_BYTES + 1)
    except FileNotFoundError:
        raise InputError(f"{name}: there is no such file. {_NEW}") from None
    except IsADirectoryError:
        inside = Path(path) / "site.yaml"
        hint = f"Did you mean {inside}?" if inside.is_file() else "Give the site file itself."
        raise InputError(f"{name}: this is a folder; a site file is needed. {hint}") from None
    except (OSError, ValueError) as error:
        raise InputError(f"{name}: cannot be read ({getattr(error, 'strerror', None) or error}).") from None
    if len(data) > MAX_BYTES:
        raise InputError(
            f"{name}: more than {MAX_BYTES // 1_000_000} MB came; a site file is a small YAML text."
        )
    if b"\0" in data:
        raise InputError(f"{name}: a binary file came; a site file is YAML text in UTF-8. {_NEW}")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data[: error.start].count(b"\n") + 1
        came = f"byte 0x{data[error.start]:02x} came, which is not UTF-8"
        raise InputError(f"{name}:{line}: {came}; allowed: text in UTF-8. Save the file as UTF-8.") from None


def _validated(raw: dict[str, object]) -> tuple[Site | None, list[Fault]]:
    faults = faults_of(raw)
    try:
        return Site.model_validate(raw, context=CHECKED), faults
    except ValidationError as error:
        found = error.errors(include_url=False)
        return None, _merged([fault_of(details, raw) for details in found if not is_echo(details)], faults)


def _merged(fields: list[Fault], faults: list[Fault]) -> list[Fault]:
    """Both kinds; where a field is at fault in itself, what other fields say about it adds nothing."""
    locs = {fault.loc for fault in fields}
    return fields + [fault for fault in faults if fault.loc not in locs]


def _report(name: str, found: list[YamlFault]) -> str:
    unique = sorted({(item.line or 0, key_of(item.fault.loc), str(item.fault)) for item in found})
    head = f"{name}: {len(unique)} fault{'s' if len(unique) > 1 else ''} in this site file; nothing was done."
    return "\n".join([head, *(f"  {name}{f':{line}' if line else ''}: {text}" for line, _, text in unique)])


# Files that a site names, looked for beside it


def named_files(raw: Mapping[str, object]) -> Iterator[tuple[Loc, str]]:
    """Every file that a site names, with its place in the site file."""
    for key, field in (("wind", "rose"), ("terrain", "file"), ("terrain", "surface")):
        part = raw.get(key)
        if isinstance(part, Mapping) and isinstance(name := part.get(field), str):
            yield (key, field), name
    areas = raw.get("areas")
    if not isinstance(areas, Mapping):
        return
    for key in ("allowed", "forbidden"):
        listed = areas.get(key)
        for index, area in enumerate(listed if isinstance(listed, list) else ()):
            if isinstance(area, str):
                yield ("areas", key, index), area
            elif isinstance(area, Mapping) and isinstance(name := area.get("file"), str):
                yield ("areas", key, index, "file"), name


def _missing_files(raw: Mapping[str, object], folder: Path) -> list[Fault]:
    missing = [(loc, name) for loc, name in named_files(raw) if not (folder / name).is_file()]
    return [Fault(loc, name, f"a file that exists (looked for {folder / name})") for loc, name in missing]


def _no_rasters(raw: Mapping[str, object], folder: Path) -> Iterator[Fault]:
    """Files of a terrain that are there but no rasters."""
    for loc, name in named_files(raw):
        if loc[0] == "terrain" and (folder / name).is_file():
            from planner.files.raster import fault_of_datum, fault_of_raster

            terrain = raw["terrain"]
            declared = terrain.get("height_datum") if isinstance(terrain, Mapping) else None
            if why := fault_of_raster(folder / name):
                yield Fault(loc, name, "a raster of heights with its CRS, such as a GeoTIFF", why)
            elif loc[1] == "file" and (why := fault_of_datum(folder / name, declared)):
                came = NOTHING if declared is None else declared
                allowed = "what the raster's heights count from: above_sea_level or ellipsoidal"
                yield Fault(("terrain", "height_datum"), came, allowed, why)


def _rooted(site: Site, folder: Path) -> Site:
    """The site with the files that it names as seen from the current folder."""

    def area(item: Area) -> Area:
        return item if item.file is None else item.model_copy(update={"file": folder / item.file})

    update: dict[str, object] = {}
    if site.wind and site.wind.rose:
        update["wind"] = site.wind.model_copy(update={"rose": folder / site.wind.rose})
    if site.terrain:
        surface = None if site.terrain.surface is None else folder / site.terrain.surface
        rooted = {"file": folder / site.terrain.file, "surface": surface}
        update["terrain"] = site.terrain.model_copy(update=rooted)
    if site.areas.allowed or site.areas.forbidden:
        allowed, forbidden = (
            tuple(area(item) for item in items) for items in (site.areas.allowed, site.areas.forbidden)
        )
        update["areas"] = site.areas.model_copy(update={"allowed": allowed, "forbidden": forbidden})
    return site.model_copy(update=update) if update else site
