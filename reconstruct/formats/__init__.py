"""One module a kind of file or database: each turns its own convention into ours and says what it turned.

Ours: UTC at the middle of the ray, azimuth clockwise from the instrument's zero in [0, 360), elevation in
[-90, 90], slant ranges of gate centres in metres, radial speed positive away from the lidar.
"""

from reconstruct.formats.options import ColumnMap, Options
from reconstruct.formats.reading import Kind, Reading, detect, read, read_all

__all__ = ["ColumnMap", "Kind", "Options", "Reading", "detect", "read", "read_all"]
