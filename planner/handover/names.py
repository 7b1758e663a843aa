"""File names out of names in a site file, which are untrusted text."""

import re
import unicodedata
from collections.abc import Iterable

LONGEST = 48  # characters: paths on the computers of instruments are short
UNNAMED = "unnamed"

# Letters that Unicode does not take apart into a Latin one and a mark.
SPELLED = str.maketrans(
    {"ø": "oe", "Ø": "Oe", "æ": "ae", "Æ": "Ae", "ß": "ss", "đ": "d", "Đ": "D", "ł": "l", "Ł": "L"}
)

# Names that Windows keeps for devices: most instruments are driven from it.
DEVICES = re.compile(r"(con|prn|aux|nul|com\d|lpt\d)", re.IGNORECASE)


def file_stem(name: str) -> str:
    """Make a file name without ending out of any text: ASCII letters, digits, underscore and hyphen.

    Examples
    --------
    >>> file_stem("stare K"), file_stem("../../etc/passwd"), file_stem("Høvsøre Košava"), file_stem("風"), file_stem("nul")
    ('stare_K', 'etc_passwd', 'Hoevsoere_Kosava', 'unnamed', 'nul_')
    """
    plain = unicodedata.normalize("NFKD", name.translate(SPELLED)).encode("ascii", "ignore").decode()
    stem = re.sub(r"[^A-Za-z0-9_-]+", "_", plain).strip("_-")[:LONGEST].strip("_-") or UNNAMED
    return f"{stem}_" if DEVICES.fullmatch(stem) else stem


def file_stems(names: Iterable[str]) -> dict[str, str]:
    """Give each name a stem of its own, different also where upper and lower case are one.

    Examples
    --------
    >>> file_stems(["a b", "A_b", "c"])
    {'a b': 'a_b', 'A_b': 'A_b_2', 'c': 'c'}
    """
    stems: dict[str, str] = {}
    taken: set[str] = set()
    for name in names:
        base = stem = file_stem(name)
        number = 2
        while stem.lower() in taken:
            stem, number = f"{base}_{number}", number + 1
        taken.add(stem.lower())
        stems[name] = stem
    return stems
