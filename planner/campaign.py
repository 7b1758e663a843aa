"""The campaign: which measured rays, of which scans, filtered, averaged and compared how. Validated nouns only.

It holds what the configuration of the reference study's software held: where the data are, scans and gate,
sector sizes, limits, offsets, averaging, the mast's file, the output.
"""

from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import AfterValidator, BeforeValidator, Discriminator, Field, Tag, model_validator

from planner.nouns import Count, Name, NonNegative, Noun, Number, Positive, Share

Kind = Literal[
    "auto", "csv", "parquet", "store", "windscanner", "cfradial", "hpl", "nacelle", "database"
]  # auto: what the file's first bytes say
Limit = Annotated[float, Field(strict=True)] | None
Bearing = Annotated[float, Field(strict=True, ge=0, le=360)]
Size = Annotated[float, Field(strict=True, gt=0, le=360)]
STUDY_AVAILABILITY = 0.38  # 19 of 50 scans in ten minutes
CNR_DB = (-25.0, -5.0)  # a usual range of the device


def _rising(limits: tuple[Limit, Limit]) -> tuple[Limit, Limit]:
    low, high = limits
    if low is not None and high is not None and low >= high:
        raise ValueError(f"[{low:g}, {high:g}] runs backwards: the lower limit comes first")
    return limits


Limits = Annotated[tuple[Limit, Limit], AfterValidator(_rising)]


class Columns(Noun):
    """How the columns of a plain CSV are called; a name that is left out is ours."""

    names: dict[str, Name] = Field(default_factory=dict)
    speed_positive: Literal["away", "toward"] = "away"
    separator: Annotated[str, Field(min_length=1, max_length=1)] = ","
    decimal: Literal[".", ","] = "."
    time_unit: Literal["iso", "unix_s", "labview_s"] = "iso"
    factors: dict[str, Number] = Field(default_factory=dict)
    constants: dict[str, Number] = Field(default_factory=dict)


class Offsets(Noun):
    """What is added to what the file says, after the site's own offsets."""

    azimuth_deg: Number = 0.0
    elevation_deg: Number = 0.0
    range_m: Number = 0.0
    clock_s: Number = 0.0


class Filters(Noun):
    """What is taken away from the rays and scans. A limit that is missing is left to the automatic filter."""

    cnr_db: Limits | None = None
    radial_speed_mps: Limits | None = None
    automatic: Literal["auto", "on", "off"] = "auto"  # auto: where a limit is missing
    window_s: Positive = 600.0  # of the automatic filter
    distance: Positive = 5.0  # robust standard deviations
    ray_share: Annotated[float, Field(strict=True, gt=0, le=1)] = (
        1.0  # of a scan's rays; 1 drops every partial scan
    )
    residual_std_mps: Positive | None = None  # largest
    r_squared: Annotated[float, Field(strict=True, le=1)] | None = None  # smallest
    reduced_chi2: Positive | None = None  # largest
    noise_mps: Positive = 0.1  # of one radial speed, for the reduced chi square


class RayInput(Noun):
    """The measured rays of one scan of the site."""

    scan: Name
    kind: Kind = "auto"
    path: Annotated[str, Field(min_length=1)] | None = (
        None  # a file, a folder, or a pattern such as rays/WS_S*.csv
    )
    url: Annotated[str, Field(min_length=1)] | None = None  # of a database
    scenarios: tuple[Annotated[int, Field(strict=True)], ...] | None = None  # of a database: these only
    instrument: Name | None = None  # of a store that holds several
    angles: Literal["head", "true"] = "head"  # as the instrument shows them, or pointing angles already
    gate_m: Positive | None = None  # default: the gate at the scan's target
    offsets: Offsets = Offsets()
    stamp: Literal["auto", "start", "middle", "end"] = "auto"
    azimuth: Literal["auto", "scanner", "estimate", "stored"] = "auto"  # WindScanner text files
    columns: Columns | None = None
    filters: Filters | None = None  # of this scan, in place of the campaign's

    @model_validator(mode="after")
    def _one_place(self) -> Self:
        if (self.path is None) == (self.url is None):
            raise ValueError("either `path` (files) or `url` (a database)")
        return self


Sectors = tuple[tuple[Bearing, Bearing], ...]


def _which_tag(value: object) -> str:
    return "<word>" if isinstance(value, str) else "<pairs>"


Directions = Annotated[
    Annotated[Literal["site", "all"], Tag("<word>")]
    | Annotated[Sectors, Field(min_length=1), Tag("<pairs>")],
    Discriminator(_which_tag),
]


class Selection(Noun):
    """Which period means count in the comparison; directions and speeds are the mast's."""

    directions_deg: Directions = "site"  # those that the site file wants, or leaves free of wakes
    speed_mps: Limits | None = None  # default: the site's speed range
    every_speed: bool = False
    availability: Share = STUDY_AVAILABILITY


class Averaging(Noun):
    """Periods are stamped at their end."""

    periods_s: Annotated[tuple[Positive, ...], Field(min_length=1)] = (60.0, 600.0)
    time_shift_s: Number = 0.0  # added to the lidars' times before averaging
    compare_s: Positive = 600.0


class MastInput(Noun):
    """A mast's CSV, its columns, and where in the period its stamps stand."""

    path: Annotated[str, Field(min_length=1)]
    time: Name = "time_utc"
    speed: Name = "speed_mps"
    direction: Name = "from_deg"
    stamp: Literal["start", "end"] = "end"
    interval_s: Positive | None = None  # default: the usual step of the file
    clock_s: Number = 0.0
    direction_offset_deg: Number = 0.0
    separator: Annotated[str, Field(min_length=1, max_length=1)] = ","
    missing: tuple[Number, ...] = (9999.0, -9999.0)


class PairInput(Noun):
    """A pair of the site to be retrieved as dual Doppler."""

    pair: Name
    gap_s: NonNegative | None = None  # default: half a ray where synchronised, else the study's best, 5 s
    compare_gaps_s: tuple[NonNegative, ...] = ()


def _text_of_pair(value: object) -> object:
    return {"pair": value} if isinstance(value, str) else value


class Campaign(Noun):
    """One run of the analysis."""

    name: Name
    site: Path
    inputs: Annotated[tuple[RayInput, ...], Field(min_length=1)]
    pairs: tuple[Annotated[PairInput, BeforeValidator(_text_of_pair)], ...] = ()
    sizes_deg: Annotated[tuple[Size, ...], Field(min_length=1)] | None = (
        None  # default: the scan's and the usual smaller ones
    )
    columns: Literal[2, 3] = 2  # of the fit: u and v, or w too
    filters: Filters = Filters()
    selection: Selection = Selection()
    averaging: Averaging = Averaging()
    mast: MastInput | None = None
    output: Path = Path("results")
    chunk_rays: Count = 500_000  # of a store or database that are worked on at once
