"""The reference pages of the site file and the campaign file: complete, up to date, and each example valid."""

import re
from pathlib import Path
from typing import get_args

import pytest
from pydantic import TypeAdapter
from pydantic.fields import FieldInfo
from ruamel.yaml import YAML

from planner.campaign import Campaign
from planner.files.reference import campaign_page, sections, site_page, told
from planner.nouns import Noun
from planner.site import Site
from planner.templates import site_text

DOCS = Path(__file__).parents[2] / "docs"
PAGES = {"site_file.md": site_page, "campaign_file.md": campaign_page}
KEYS = [
    pytest.param(section.noun, key, field, id=f"{section.title}: {key}")
    for root in (Site, Campaign)
    for section in sections(root)
    for key, field in section.fields.items()
]


def has_keys_of_its_own(field: FieldInfo) -> bool:
    """A mapping, or a list of mappings, whose keys have a table."""
    return bool(re.search(r"\.(?!Path)[A-Z]\w+", str(field.annotation).replace("typing.", "")))


@pytest.mark.parametrize("name", PAGES)
def test_page_is_what_the_nouns_say_now(name: str) -> None:
    """Types, limits, defaults and words."""
    same = (DOCS / name).read_text(encoding="utf-8") == PAGES[name]()
    assert same, "a noun has changed: write the pages anew by `python -m planner.files.reference docs`"


@pytest.mark.parametrize(("noun", "key", "field"), KEYS)
def test_key_is_described(noun: type[Noun], key: str, field: FieldInfo) -> None:
    """One sentence or more; a key that may be missing says what is then taken; a value has an example."""
    does, example = told(noun, key)
    without = not field.is_required() and field.get_default() is None
    assert does.endswith("."), "a string under the field has to say what it does"
    assert "Without it: " in does or not without, "a key without a default says what is taken without it"
    assert example or has_keys_of_its_own(field) or len(get_args(field.annotation)) == 1, (
        "an example is missing"
    )


@pytest.mark.parametrize(("noun", "key", "field"), KEYS)
def test_example_is_taken(noun: type[Noun], key: str, field: FieldInfo) -> None:
    """YAML makes of it what the field allows."""
    _, example = told(noun, key)
    if example:
        TypeAdapter(field.rebuild_annotation()).validate_python(YAML(typ="safe").load(example))


def test_every_key_of_the_template_is_on_the_page() -> None:
    """Nothing that `lidarplan new` writes is left to guess, what it has in comments included."""
    prose = {"default", "metres", "not"}  # words of its comments that have a colon behind them
    keys = set(re.findall(r"(?:^|[\s{,])([a-z][a-z0-9_]*): ", site_text(), re.MULTILINE)) - prose
    page = site_page()
    assert {"name", "signal", "radial_speed_mps", "hard_target", "scatter_growth"} <= keys
    assert not {key for key in keys if f"| `{key}` |" not in page}


@pytest.mark.parametrize("name", PAGES)
def test_every_link_of_the_page_leads_somewhere(name: str) -> None:
    """Anchors are headings of the page, files are there."""
    page = PAGES[name]()
    anchors = {
        heading.replace(":", "").replace(" ", "-") for heading in re.findall(r"^#+ (.+)$", page, re.MULTILINE)
    }
    for link in re.findall(r"\]\(([^)]+)\)", page):
        assert link[1:] in anchors if link.startswith("#") else (DOCS / link).exists(), link
