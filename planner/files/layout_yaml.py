"""A layout as the text of a site file to go on from."""

from io import StringIO
from pathlib import Path
from typing import Any

from planner.files.layout import Layout, layout_site, site_mapping

HEAD = (
    "# A site file for lidarplan, made from a layout. Positions are [easting, northing, height] in metres.\n"
)

# What a layout does not hold; `lidarplan new DIR` writes a file with every key and its comment.
TAIL = """
# Still to be given: scans, and, for errors and wakes, wind. For example
# scans:
#   - {{name: stare, lidar: {lidar}, target: {target}, type: stare, accumulation_s: 0.5,
#      gates: {{first_m: 600, spacing_m: 25, count: 41}}}}
# wind: {{weibull: {{scale_mps: 9, shape: 2.2}}, turbulence: {{intensity: 0.1, length_m: 150}}}}
"""


def layout_text(path: Path, layout: Layout, name: str) -> str:
    """Write the site file of a layout.

    Parameters
    ----------
    path
        Where the layout came from, for messages.
    layout
        As read.
    name
        Of the site.

    Returns
    -------
    str
        YAML 1.2; names, which are untrusted text, are quoted where they need it.

    Raises
    ------
    InputError
        If the layout makes no valid site.
    """
    layout_site(path, layout, name)
    mapping = site_mapping(layout, name)
    first = {key: _dumped(entries[0]["name"]).strip() for key, entries in layout.pieces.items()}
    return (
        HEAD
        + _dumped(mapping)
        + TAIL.format(lidar=first.get("lidars", "..."), target=first.get("targets", "..."))
    )


def _dumped(value: Any) -> str:
    from ruamel.yaml import YAML

    yaml = YAML(typ="safe", pure=True)
    yaml.default_flow_style = None  # lists and mappings of plain values on one line
    yaml.sort_base_mapping_type_on_output = False  # type: ignore[assignment]
    yaml.allow_unicode = True
    yaml.width = 10_000
    out = StringIO()
    yaml.dump(value, out)
    return out.getvalue().removesuffix("...\n")
