"""Reference pages of the site file and the campaign file, written from the nouns that read them.

What a key does stands under its field in the noun, as a string that ends with an example ("E.g. ..."); type, limits and
default are the field's own. `python -m planner.files.reference docs` writes both pages anew.
"""

import ast
import inspect
import sys
from collections.abc import Iterator, Sequence
from functools import lru_cache
from pathlib import Path
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, NamedTuple, Union, get_args, get_origin

from pydantic.fields import FieldInfo
from pydantic_core import PydanticUndefined

from planner.campaign import Campaign
from planner.instruments import CATALOGUE
from planner.nouns import Noun, Position
from planner.scan_plans import ScanBase
from planner.site import Site

UNITS = {  # by the end of a key, the longest first
    "_deg_per_s2": "°/s²",
    "_deg_per_s": "°/s",
    "_per_m": "1/m",
    "_per_s": "1/s",
    "_mps": "m/s",
    "_deg": "°",
    "_hz": "Hz",
    "_db": "dB",
    "_ns": "ns",
    "_m": "m",
    "_s": "s",
    "position": "m",
    "polygon": "m",
}
BOUNDS = {"gt": "> {:g}", "ge": "≥ {:g}", "lt": "< {:g}", "le": "≤ {:g}"}
MANY = 3  # choices from which on commas stand between them
PLAIN = {
    float: "number",
    int: "whole number",
    str: "text",
    bool: "`true` or `false`",
    Path: "path",
    dict: "mapping",
}
EXAMPLE = " E.g. "
SITE_TEXT = """\
# The site file

Every key that a site file may have. `lidarplan new DIR` writes a commented file to start from, and the folders of
[examples](../examples/) hold whole ones. The file is YAML 1.2 in UTF-8.

- Units stand in the names. A `position` is `[easting, northing, height]` in metres of the site's CRS; azimuths run clockwise
  ([conventions](conventions.md)).
- Names are free; things refer to each other by them. Paths count from the folder of the file.
- A key that has a default may be left out; what is assumed in its place stands in the report. **needed**: without it the file
  is refused. So is a key that is not listed here, and a name that nothing has; every fault is told at once, with its line.
- Instruments of the catalogue: {catalogue}; another one is given by its own numbers.
- Uncertainties are standard uncertainties (k = 1) as the GUM has them; turbulence, wakes and turbines are named as in IEC 61400.
"""
CAMPAIGN_TEXT = """\
# The campaign file

Every key of the file that `lidarplan retrieve` and `lidarplan compare` read: which measured rays of which scans of a
[site](site_file.md), and how they are filtered, averaged and compared. `lidarplan simulate` writes one with its data. The
file is YAML 1.2 in UTF-8; paths count from its folder; what goes for the site file goes for this one. Radial speeds are
positive away from the lidar, the `radial_velocity_of_scatterers_away_from_instrument` of the CF conventions.
"""


class Section(NamedTuple):
    """One table of the page."""

    title: str
    noun: type[Noun]
    fields: dict[str, FieldInfo]


def site_page() -> str:
    """Write the reference page of the site file."""
    return _page(SITE_TEXT.format(catalogue=", ".join(f"`{name}`" for name in CATALOGUE)), Site)


def campaign_page() -> str:
    """Write the reference page of the campaign file."""
    return _page(CAMPAIGN_TEXT, Campaign)


def told(noun: type[Noun], key: str) -> tuple[str, str]:
    """What a key does, and an example; empty where nothing is said.

    Examples
    --------
    >>> from planner.site import Weibull
    >>> told(Weibull, "shape")
    ('Shape parameter k.', '2.75')
    """
    owners = (owner for owner in noun.__mro__ if issubclass(owner, Noun))
    text = next((found for owner in owners if (found := _strings(owner).get(key))), "")
    does, _, example = text.partition(EXAMPLE)
    return does, example


def sections(root: type[Noun]) -> list[Section]:
    """The nouns of a file, each once, in the order in which they are met."""
    found = [Section("Keys of the file", root, root.model_fields)]
    seen = {root}
    for section in found:  # grows while it is walked
        for key, field in section.fields.items():
            for noun in _nouns(field.annotation):
                if noun not in seen:
                    seen.add(noun)
                    found += _sections_of(
                        noun, key if section.noun is root else f"{section.title}: {key}", seen
                    )
    return sorted(found, key=lambda section: _place(section.title, [each.title for each in found]))


def _place(title: str, titles: Sequence[str]) -> list[int]:
    """Where a section belongs: behind the one that its key is in."""
    parts = title.split(": ")
    return [titles.index(": ".join(parts[: end + 1])) for end in range(len(parts))]


def _sections_of(noun: type[Noun], title: str, seen: set[type[Noun]]) -> list[Section]:
    if not issubclass(noun, ScanBase):
        return [Section(title, noun, noun.model_fields)]
    own = {key: field for key, field in noun.model_fields.items() if key not in ScanBase.model_fields}
    kind = get_args(noun.model_fields["type"].annotation)[0]
    typed = Section(f"{title}: type {kind}", noun, own)
    if ScanBase in seen:
        return [typed]
    seen.add(ScanBase)
    return [Section(title, ScanBase, ScanBase.model_fields), typed]


def _page(text: str, root: type[Noun]) -> str:
    tables = sections(root)
    titles = {section.noun: section.title for section in tables}
    return "\n".join([text, *(_table(section, titles) for section in tables)])


def _table(section: Section, titles: dict[type[Noun], str]) -> str:
    level = "##" if ":" not in section.title else "###"
    head = [f"{level} {section.title}", "", _first(section.noun), ""]
    head += ["| key | type | unit | default | what it does | example |", "|---|---|---|---|---|---|"]
    return (
        "\n".join([*head, *(_row(section.noun, key, field, titles) for key, field in section.fields.items())])
        + "\n"
    )


def _row(noun: type[Noun], key: str, field: FieldInfo, titles: dict[type[Noun], str]) -> str:
    does, example = told(noun, key)
    unit = next((unit for end, unit in UNITS.items() if key.endswith(end)), "")
    kind = _words(_without_none(field.annotation), field.metadata, titles)
    shown = f"`{example}`" if example else ""
    return f"| `{key}` | {kind} | {unit} | {_default(field)} | {does} | {shown} |"


def _words(annotation: Any, limits: Sequence[Any], titles: dict[type[Noun], str]) -> str:
    """A type in words."""
    origin, parts = get_origin(annotation), get_args(annotation)
    if annotation == Position:
        return "[easting, northing, height]"
    if origin is Annotated:
        return _words(parts[0], [*limits, *parts[1:]], titles)
    if origin in (Union, UnionType):
        kinds = ["`null`" if part is NoneType else _words(part, limits, titles) for part in parts]
        return " or ".join(dict.fromkeys(kinds))
    if origin is Literal:
        return (", " if len(parts) > MANY else " or ").join(f"`{choice}`" for choice in parts)
    if origin is tuple and parts[-1] is Ellipsis:
        return f"list of {_words(parts[0], [], titles)}"
    if origin is tuple:
        return f"[{', '.join(_words(part, [], titles) for part in parts)}]"
    if isinstance(annotation, type) and issubclass(annotation, Noun):
        title = titles[ScanBase if issubclass(annotation, ScanBase) else annotation]
        return f"[{title}](#{title.replace(':', '').replace(' ', '-')})"
    return PLAIN[origin or annotation] + _range(limits)


def _bounds(limits: Sequence[Any]) -> dict[str, float]:
    """The limits of a number, wherever they stand in its metadata."""
    found: dict[str, float] = {}
    for limit in limits:
        inner = _bounds(limit.metadata) if isinstance(limit, FieldInfo) else {}
        found |= inner or {key: bound for key in BOUNDS if (bound := getattr(limit, key, None)) is not None}
    return found


def _range(limits: Sequence[Any]) -> str:
    """The limits of a number in words."""
    bounds = _bounds(limits)
    if {"ge", "le"} <= bounds.keys():
        return f" {bounds['ge']:g} to {bounds['le']:g}"
    text = " and ".join(BOUNDS[key].format(bound) for key, bound in bounds.items())
    return f" {text}" if text else ""


def _without_none(annotation: Any) -> Any:
    """The type of a key that is given."""
    parts = [part for part in get_args(annotation) if part is not NoneType]
    return Union[tuple(parts)] if get_origin(annotation) in (Union, UnionType) else annotation  # noqa: UP007


def _default(field: FieldInfo) -> str:
    value = field.get_default(call_default_factory=True)
    if value is PydanticUndefined:
        return "**needed**"
    if value is None:
        return "–"
    if isinstance(value, Noun):
        return "see there"
    return f"`{_spelled(value)}`" if value not in ((), {}) else "none"


def _spelled(value: object) -> str:
    """A value as YAML writes it."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, float):
        return f"{value:g}"
    if isinstance(value, tuple):
        return f"[{', '.join(_spelled(part) for part in value)}]"
    return str(value)


def _nouns(annotation: Any) -> Iterator[type[Noun]]:
    """The nouns inside an annotation."""
    if isinstance(annotation, type) and issubclass(annotation, Noun):
        yield annotation
    for part in get_args(annotation):
        yield from _nouns(part)


def _first(noun: type[Noun]) -> str:
    """The first paragraph of a noun's docstring, on one line."""
    return " ".join((inspect.getdoc(noun) or "").split("\n\n")[0].split())


@lru_cache
def _strings(noun: type[Noun]) -> dict[str, str]:
    """The string under each field of a class, on one line."""
    (body,) = [node for node in ast.parse(inspect.getsource(noun)).body if isinstance(node, ast.ClassDef)]
    return {
        field.target.id: " ".join(ast.literal_eval(text.value).split())
        for field, text in zip(body.body, body.body[1:], strict=False)
        if isinstance(field, ast.AnnAssign) and isinstance(field.target, ast.Name)
        if isinstance(text, ast.Expr) and isinstance(text.value, ast.Constant)
    }


def write_pages(folder: Path) -> None:
    """Write both pages into a folder."""
    (folder / "site_file.md").write_text(site_page(), encoding="utf-8")
    (folder / "campaign_file.md").write_text(campaign_page(), encoding="utf-8")


if __name__ == "__main__":
    write_pages(Path(sys.argv[1]))
