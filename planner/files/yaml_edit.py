"""Change some numbers of a lidar in a site file: comments, order and the spelling of the rest stay."""

from collections.abc import Mapping
from io import StringIO
from pathlib import Path
from typing import TYPE_CHECKING

from geometry.errors import InputError
from planner.files.yaml_site import load_site, parse_site
from planner.output import write_text
from planner.site import Site

if TYPE_CHECKING:
    from ruamel.yaml import YAML

WIDE = 100_000  # columns: nothing is folded anew


def round_trip() -> "YAML":
    """A reader and writer of YAML that keeps comments, order and quotes."""
    from ruamel.yaml import YAML

    yaml = YAML(typ="rt")
    yaml.preserve_quotes = True
    yaml.width = WIDE
    yaml.indent(mapping=2, sequence=4, offset=2)
    return yaml


def edited_lidar(text: str, lidar: str, values: Mapping[str, float]) -> str:
    """The text of a site file with other numbers for one lidar.

    Parameters
    ----------
    text : str
        YAML of a valid site.
    lidar : str
        Its name.
    values : mapping of key to number
        A dot leads into a mapping: `mounting.pitch_deg`. Keys that are not there are added.

    Returns
    -------
    str

    Raises
    ------
    InputError
        If there is no such lidar.

    Examples
    --------
    >>> print(edited_lidar("lidars:  # two\\n  - {name: a, azimuth_offset_deg: 1.0}  # by hand\\n", "a",
    ...     {"azimuth_offset_deg": 1.25, "mounting.pitch_deg": 0.03}), end="")
    lidars:  # two
      - {name: a, azimuth_offset_deg: 1.25, mounting: {pitch_deg: 0.03}} # by hand
    """
    from ruamel.yaml.comments import CommentedMap

    yaml = round_trip()
    document = yaml.load(text)
    entry = next((item for item in document.get("lidars", []) if item.get("name") == lidar), None)
    if entry is None:
        raise InputError(f"the site file has no lidar called '{lidar}'")
    for key, value in values.items():
        *way, last = key.split(".")
        place = entry
        for part in way:
            if place.get(part) is None:
                inner = CommentedMap()
                inner.fa.set_flow_style()
                place[part] = inner
            place = place[part]
        place[last] = value
    out = StringIO()
    yaml.dump(document, out)
    return out.getvalue()


def write_lidar(path: Path, lidar: str, values: Mapping[str, float]) -> Site:
    """Write new numbers of a lidar into a site file, whole or not at all.

    Returns
    -------
    Site
        As the file now has it.

    Raises
    ------
    InputError
        If the file is not a valid site, before or after, or cannot be written; it then stays as it was.
    """
    before = load_site(path)
    text = edited_lidar(path.read_text(encoding="utf-8-sig"), lidar, values)
    after = parse_site(text, name=f"{path} with the new offsets", folder=path.parent)
    others = {"lidars": tuple(item for item in after.lidars if item.name != lidar)}
    if after.model_copy(update=others) != before.model_copy(
        update={"lidars": tuple(item for item in before.lidars if item.name != lidar)}
    ):
        raise InputError(
            f"{path}: more than the offsets would change; the file stays as it is. Edit it by hand"
        )
    write_text(path, text)
    return after
