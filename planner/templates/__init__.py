"""Texts that commands start from."""

from importlib.resources import files


def site_text() -> str:
    """The commented site file that `lidarplan new` writes."""
    return files(__name__).joinpath("site.yaml").read_text(encoding="utf-8")
