"""A campaign file in YAML 1.2 -> `Campaign` and its `Site`, or one error that lists every fault of the file."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import NamedTuple, TypeVar

from pydantic import ValidationError

from geometry.errors import InputError
from planner.campaign import Campaign
from planner.faults import Fault, entries, key_of, spelled
from planner.files.fault_words import fault_of, is_echo
from planner.files.yaml_site import load_site
from planner.files.yaml_tree import Tree, YamlFault
from planner.nouns import Noun
from planner.site import Site

Placed = TypeVar("Placed", bound=Noun)

MAX_BYTES = 5_000_000
PATTERN = "*?["  # a path with one of these stands for many files


class Loaded(NamedTuple):
    """A campaign with the site that it was measured at."""

    campaign: Campaign  # paths as seen from the current folder
    site: Site
    path: Path
    as_written: Campaign  # the same with the paths of its file


def load_campaign(path: Path | str) -> Loaded:
    """Read a campaign file and the site file that it names.

    Parameters
    ----------
    path : Path or str
        The file; what it names is looked for beside it.

    Raises
    ------
    InputError
        With every fault of the file: file, line, key, what came, what is allowed.
    """
    path = Path(path)
    text = _text(path)
    tree = Tree(text)
    if not tree.faults and not isinstance(tree.value, Mapping):
        came = "an empty file" if tree.value is None else spelled(tree.value)
        raise InputError(
            f"{path}: {came} came; a campaign file is a mapping with `name:`, `site:` and `inputs:`"
        )
    raw = tree.value if isinstance(tree.value, dict) else {}
    campaign, faults = _validated(raw)
    site, told = _site(raw, path.parent)
    faults += told
    faults += list(_missing(raw, path.parent))
    if site is not None:
        faults += list(_unknown_names(raw, site))
    found = tree.faults + [YamlFault(tree.line(fault.loc), fault) for fault in faults]
    if found or campaign is None or site is None:
        raise InputError(_report(str(path), found))
    return Loaded(_rooted(campaign, path.parent), site, path, campaign)


def _text(path: Path) -> str:
    try:
        data = path.read_bytes()
    except FileNotFoundError:
        raise InputError(
            f"{path}: there is no such file; `lidarplan simulate SITE` writes one to start from"
        ) from None
    except IsADirectoryError:
        raise InputError(f"{path}: this is a folder; did you mean {path / 'campaign.yaml'}?") from None
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error})") from None
    if len(data) > MAX_BYTES or b"\0" in data:
        raise InputError(f"{path}: a campaign file is a small YAML text in UTF-8, and something else came")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data[: error.start].count(b"\n") + 1
        raise InputError(f"{path}:{line}: a byte that is not UTF-8 came: save the file as UTF-8") from None


def _validated(raw: dict[str, object]) -> tuple[Campaign | None, list[Fault]]:
    try:
        return Campaign.model_validate(raw), []
    except ValidationError as error:
        found = [details for details in error.errors(include_url=False) if not is_echo(details)]
        faults = [fault_of(details, raw, root=Campaign) for details in found]
        return None, [fault._replace(allowed=fault.allowed.removeprefix("Value error, ")) for fault in faults]


def _site(raw: Mapping[str, object], folder: Path) -> tuple[Site | None, list[Fault]]:
    """The site; None where it is at fault, which is then told as one fault of the campaign."""
    name = raw.get("site")
    if not isinstance(name, str):
        return None, []  # told already
    if not (folder / name).is_file():
        return None, [Fault(("site",), name, f"a site file that exists (looked for {folder / name})")]
    try:
        return load_site(folder / name), []
    except InputError as error:
        return None, [Fault(("site",), name, "a site file without faults", str(error))]


def _missing(raw: Mapping[str, object], folder: Path) -> Iterator[Fault]:
    """Files that the campaign names and that are not there."""
    logs = [(("inputs", index, "attitude"), item.get("attitude")) for index, item in entries(raw, "inputs")]
    sonics = [(("sonics", index), item) for index, item in entries(raw, "sonics")]
    for where, item in (*logs, *sonics):
        name = item.get("path") if isinstance(item, Mapping) else None
        if isinstance(name, str) and not (folder / name).is_file():
            yield Fault((*where, "path"), name, f"a file that exists (looked for {folder / name})")
    for index, item in entries(raw, "inputs"):
        name = item.get("path")
        if isinstance(name, str) and not (
            _matches(folder, name) if _is_pattern(name) else (folder / name).exists()
        ):
            yield Fault(("inputs", index, "path"), name, f"files that exist (looked for {folder / name})")
    mast = raw.get("mast")
    if (
        isinstance(mast, Mapping)
        and isinstance(name := mast.get("path"), str)
        and not (folder / name).is_file()
    ):
        yield Fault(("mast", "path"), name, f"a file that exists (looked for {folder / name})")


def _is_pattern(name: str) -> bool:
    return any(letter in name for letter in PATTERN)


def _matches(folder: Path, pattern: str) -> bool:
    anchor = Path(pattern).anchor
    root, rest = (Path(anchor), pattern[len(anchor) :]) if anchor else (folder, pattern)
    return next(root.glob(rest), None) is not None


def _unknown_names(raw: Mapping[str, object], site: Site) -> Iterator[Fault]:
    """Scans and pairs that the site does not have, and scans named twice."""
    scans, pairs = [scan.name for scan in site.scans], [pair.name for pair in site.pairs]
    read: list[object] = []
    for index, item in entries(raw, "inputs"):
        name = item.get("scan")
        if isinstance(name, str) and name not in scans:
            yield Fault(
                ("inputs", index, "scan"), name, f"a scan of the site: {', '.join(scans) or 'it has none'}"
            )
        if name in read:
            yield Fault(("inputs", index, "scan"), name, "each scan once; name several files by one pattern")
        read.append(name)
    for index, item in entries(raw, "sonics"):
        name = item.get("scan")
        if isinstance(name, str) and name not in read:
            told = f"a scan that is an input: {', '.join(str(each) for each in read) or 'there is none'}"
            yield Fault(("sonics", index, "scan"), name, told)
    lag = raw.get("time_lag")
    if isinstance(lag, Mapping) and lag.get("against") == "mast" and not raw.get("mast"):
        yield Fault(("time_lag", "against"), "mast", "none, or give `mast: {path: ...}` too")
    listed = raw.get("pairs")
    for index, item in enumerate(listed if isinstance(listed, list) else ()):
        name = item.get("pair") if isinstance(item, Mapping) else item
        if not isinstance(name, str):
            continue
        if name not in pairs:
            yield Fault(("pairs", index), name, f"a pair of the site: {', '.join(pairs) or 'it has none'}")
        elif absent := [scan for scan in site.pair(name).scans if scan not in read]:
            yield Fault(("pairs", index), name, f"a pair whose scans are inputs; {', '.join(absent)} is not")


def _report(name: str, found: list[YamlFault]) -> str:
    unique = sorted({(item.line or 0, key_of(item.fault.loc), str(item.fault)) for item in found})
    head = f"{name}: {len(unique)} fault{'s' if len(unique) > 1 else ''} in this campaign file; nothing was done."
    return "\n".join([head, *(f"  {name}{f':{line}' if line else ''}: {text}" for line, _, text in unique)])


def _rooted(campaign: Campaign, folder: Path) -> Campaign:
    """The campaign with its paths as seen from the current folder."""
    inputs = tuple(
        _placed(item, folder).model_copy(update={"attitude": _placed(item.attitude, folder)})
        for item in campaign.inputs
    )
    mast = campaign.mast
    update: dict[str, object] = {
        "inputs": inputs,
        "sonics": tuple(_placed(sonic, folder) for sonic in campaign.sonics),
        "site": folder / campaign.site,
        "output": folder / campaign.output,
    }
    if mast is not None:
        update["mast"] = mast.model_copy(update={"path": str(folder / mast.path)})
    return campaign.model_copy(update=update)


def _placed(noun: "Placed", folder: Path) -> "Placed":
    """The noun with its path as seen from the current folder."""
    path = getattr(noun, "path", None)
    return noun if path is None else noun.model_copy(update={"path": str(folder / path)})
