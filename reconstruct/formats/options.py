"""What a reader may be told about a file that the file does not say itself."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from geometry.head import Mounting

#: Where in the ray the file's stamps stand. auto: as the kind of file is known to have it.
Stamp = Literal["auto", "start", "middle", "end"]

#: Whence the azimuth of a WindScanner ray. auto: the scanner file, else estimated, else as stored.
AzimuthSource = Literal["auto", "scanner", "estimate", "stored"]


@dataclass(frozen=True)
class ColumnMap:
    """How the columns of a plain CSV become those of a record.

    One row of the file is one ray and gate.

    Examples
    --------
    >>> ColumnMap(names={"time_utc": "t", "radial_speed_mps": "RWS"}, speed_positive="toward").separator
    ','
    """

    names: Mapping[
        str, str
    ]  # our name: the file's; time_utc, azimuth_deg, elevation_deg, range_m, radial_speed_mps needed
    speed_positive: Literal["away", "toward"] = "away"
    separator: str = ","
    decimal: str = "."
    time_unit: Literal["iso", "unix_s", "labview_s"] = "iso"
    factors: Mapping[str, float] = field(default_factory=dict)  # our name: factor on the file's numbers
    constants: Mapping[str, float] = field(default_factory=dict)  # our name: a value that no column has
    missing: tuple[float, ...] = (9999.0, -9999.0)  # numbers that stand for nothing


@dataclass(frozen=True)
class Options:
    """What a reader may be told; every reader takes what concerns it."""

    instrument: str | None = None  # name, in place of the file's
    clock_offset_s: float = 0.0  # added to the file's clock to give UTC
    stamp: Stamp = "auto"
    azimuth: AzimuthSource = "auto"  # WindScanner text files
    mounting: Mounting = field(default_factory=Mounting)  # head angles and ranges to pointing ones
    elevation_deg: float | None = None  # of files without one (nacelle lidars); default 0
    beam_azimuth_deg: Mapping[int, float] | None = None  # nacelle: line of sight number: azimuth
    attitude_limit_deg: float = 45.0  # nacelle: rays with a larger tilt or roll are dropped
    pulse_repetition_hz: float | None = None  # HALO: pulses a ray over this is the ray's duration
    columns: ColumnMap | None = None  # plain CSV
    scenario: int | None = None  # four-table database: this one only
