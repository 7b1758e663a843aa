"""From a command's SITE argument to a Plan."""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from planner.plan import Plan


def load_plan(site: str, fidelity: str | None = None) -> "Plan":
    """Read a site file (or standard input) and plan it.

    Parameters
    ----------
    site
        Path of a site file, or - for standard input.
    fidelity
        What `--fidelity` said: wins over the site file's.

    Raises
    ------
    InputError
        With every fault of the site file, or if a named effect is unknown.
    """
    from planner.files.yaml_site import load_site
    from planner.plan import Plan

    read = load_site(site)
    return Plan(read if fidelity is None else read.model_copy(update={"fidelity": _effects(fidelity)}))


def _effects(text: str) -> str | tuple[str, ...]:
    """`auto`, `all`, or names of effects with commas between them."""
    from typing import get_args

    from planner.commands.choices import chosen
    from planner.site import FidelityEffect

    if text in ("auto", "all"):
        return text
    allowed: tuple[str, ...] = get_args(FidelityEffect)
    return tuple(chosen("--fidelity", name.strip(), ("auto", "all", *allowed)) for name in text.split(","))
