"""Whether a file in netCDF's classic format is whole: the library reads zeros where it has been cut off.

The format is that of the NetCDF User's Guide, "File Format Specifications": a header that lists dimensions,
attributes and variables, each variable with the place where its numbers begin.
"""

import struct
from typing import NamedTuple

#: Bytes of a number of each type, by its code.
SIZES = {1: 1, 2: 1, 3: 2, 4: 4, 5: 4, 6: 8, 7: 1, 8: 2, 9: 4, 10: 8, 11: 8}

#: The number of records while a file is still being written.
STREAMING = (0xFFFFFFFF, 0xFFFFFFFFFFFFFFFF)


class _Variable(NamedTuple):
    begin: int
    size: int  # of all its numbers, or of those of one record
    record: bool


class _Header:
    """A reader of the header's numbers, one after the other."""

    def __init__(self, raw: bytes) -> None:
        self.raw, self.at = raw, 4
        self.count_size = 8 if raw[3] == 5 else 4
        self.begin_size = 4 if raw[3] == 1 else 8

    def integer(self, size: int) -> int:
        self.at += size
        return int(struct.unpack_from(">I" if size == 4 else ">Q", self.raw, self.at - size)[0])

    def count(self) -> int:
        return self.integer(self.count_size)

    def skip(self, size: int) -> None:
        self.at += -(-size // 4) * 4  # padded to four bytes
        if self.at > len(self.raw):
            raise struct.error("the header ends early")

    def items(self) -> range:
        self.integer(4)  # which list this is
        return range(self.count())

    def attributes(self) -> None:
        for _ in self.items():
            self.skip(self.count())
            kind = self.integer(4)
            self.skip(self.count() * SIZES[kind])


def missing_bytes(raw: bytes) -> int | None:
    """How many bytes fewer a classic netCDF file has than its header tells; negative if it has more.

    Returns
    -------
    int or None
        None if the header itself cannot be followed, or the file does not tell how many records it has.

    Examples
    --------
    >>> import struct
    >>> name = struct.pack(">I4s", 1, b"x")
    >>> header = b"CDF\\x01" + struct.pack(">5I", 0, 10, 1, 1, ord("x") << 24) + struct.pack(">I", 3)
    >>> header += bytes(8) + struct.pack(">2I", 11, 1) + name + struct.pack(">2I", 1, 0) + bytes(8)
    >>> file = header + struct.pack(">3I", 5, 12, len(header) + 12) + bytes(12)
    >>> missing_bytes(file), missing_bytes(file[:-5])
    (0, 5)
    """
    try:
        header = _Header(raw)
        records = header.count()
        lengths = []
        for _ in header.items():
            header.skip(header.count())
            lengths.append(header.count())
        header.attributes()
        variables = [_variable(header, lengths) for _ in header.items()]
    except (struct.error, KeyError, IndexError, OverflowError):
        return None
    return None if records in STREAMING else _end(variables, records) - len(raw)


def _variable(header: _Header, lengths: list[int]) -> _Variable:
    header.skip(header.count())
    dimensions = [lengths[header.count()] for _ in range(header.count())]
    header.attributes()
    size = SIZES[header.integer(4)]
    header.count()  # the padded size, which may not fit in its field
    begin = header.integer(header.begin_size)
    record = bool(dimensions) and dimensions[0] == 0
    for length in dimensions[1:] if record else dimensions:
        size *= length
    return _Variable(begin, size, record)


def _end(variables: list[_Variable], records: int) -> int:
    """Where the last number ends."""
    growing = [variable for variable in variables if variable.record]
    padded = sum(-(-variable.size // 4) * 4 for variable in growing)
    step = growing[0].size if len(growing) == 1 else padded  # a single one is not padded
    ends = [variable.begin + variable.size for variable in variables if not variable.record]
    ends += [variable.begin + (records - 1) * step + variable.size for variable in growing if records]
    return max(ends, default=0)
