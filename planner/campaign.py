"""The campaign: which measured rays, of which scans, filtered, averaged and compared how. Validated nouns only.

It holds what the configuration of the reference study's software held: where the data are, scans and gate,
sector sizes, limits, offsets, averaging, the mast's file, the output.
"""

from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import AfterValidator, BeforeValidator, Discriminator, Field, Tag, model_validator

from planner.campaign_logs import Attitude, SonicInput, TimeLag
from planner.nouns import Bearing, Count, Name, NonNegative, Noun, Number, Positive, Share, name_of_true

Kind = Literal[
    "auto", "csv", "parquet", "store", "windscanner", "cfradial", "hpl", "nacelle", "database"
]  # auto: what the file's first bytes say
Limit = Annotated[float, Field(strict=True)] | None
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
    """Our name: the file's, where they differ; needed are time_utc, azimuth_deg, elevation_deg, range_m and
    radial_speed_mps. E.g. {radial_speed_mps: RWS, cnr_db: CNR}"""
    speed_positive: Literal["away", "toward"] = "away"
    """Which radial speeds the file has positive. E.g. toward"""
    separator: Annotated[str, Field(min_length=1, max_length=1)] = ","
    """What stands between two columns. E.g. ';'"""
    decimal: Literal[".", ","] = "."
    """Decimal mark. E.g. ','"""
    time_unit: Literal["iso", "unix_s", "labview_s"] = "iso"
    """How times are written: ISO 8601, seconds since 1970 (unix_s) or since 1904 (labview_s). E.g. unix_s"""
    factors: dict[str, Number] = Field(default_factory=dict)
    """Our name: factor on the file's numbers. E.g. {range_m: 10}"""
    constants: dict[str, Number] = Field(default_factory=dict)
    """Our name: value that no column has. E.g. {elevation_deg: 0}"""


class Offsets(Noun):
    """What is added to what the file says, after the site's own offsets."""

    azimuth_deg: Number = 0.0
    """Added to the azimuth, after the site's own offset. E.g. 0.1"""
    elevation_deg: Number = 0.0
    """Added to the elevation, after the site's own offset. E.g. -0.05"""
    range_m: Number = 0.0
    """Added to the range, after the site's own offset. E.g. 3"""
    clock_s: Number = 0.0
    """Added to the file's clock, to give UTC. E.g. -3600"""


class Filters(Noun):
    """What is taken away from the rays and scans. A limit that is missing is left to the automatic filter."""

    cnr_db: Limits | None = None
    """Lowest and highest carrier-to-noise ratio that is kept; null leaves an end open. Without it: no limit.
    E.g. [-25, -5]"""
    radial_speed_mps: Limits | None = None
    """Lowest and highest radial speed that is kept; null leaves an end open. Without it: no limit. E.g. [-25, 25]"""
    automatic: Literal["auto", "on", "off"] = "auto"
    """Automatic filter against outliers: always, never, or where one of the two limits is missing (auto). E.g. on"""
    window_s: Positive = 600.0
    """Time over which it compares rays. E.g. 300"""
    distance: Positive = 5.0
    """Distance from the median beyond which a ray is an outlier, in robust standard deviations. E.g. 4"""
    ray_share: Annotated[float, Field(strict=True, gt=0, le=1)] = 1.0
    """Least share of a scan's rays that a fit needs; 1 drops every partial scan. E.g. 0.8"""
    residual_std_mps: Positive | None = None
    """Largest standard deviation of a fit's residuals. Without it: no limit. E.g. 1.5"""
    r_squared: Annotated[float, Field(strict=True, le=1)] | None = None
    """Smallest coefficient of determination of a fit. Without it: no limit. E.g. 0.5"""
    reduced_chi2: Positive | None = None
    """Largest reduced chi square of a fit. Without it: no limit. E.g. 50"""
    noise_mps: Positive = 0.1
    """Standard deviation of one radial speed, for the reduced chi square. E.g. 0.2"""


class TwoBeam(Noun):
    """Rules by which the means of a two-beam lidar are kept; the defaults are those of the WindEye test."""

    period_s: Positive = 120.0
    """Averaging period. E.g. 600"""
    least_samples: Count = 100
    """Least number of good samples of each beam in a period. E.g. 500"""
    least_speed_mps: NonNegative = 1.0
    """Least mean radial speed of each beam, without its sign. E.g. 0.5"""
    largest_angle_deg: Positive = 30.0
    """Largest angle of the wind from the lidar's axis. E.g. 20"""


class RayInput(Noun):
    """The measured rays of one scan of the site."""

    scan: Name
    """Scan of the site file. E.g. sector"""
    kind: Kind = "auto"
    """Format of the rays; auto: what the files' first bytes say. E.g. windscanner"""
    path: Annotated[str, Field(min_length=1)] | None = None
    """File, folder, or pattern of files. Without it: `url`; one of the two. E.g. rays/WS_S*.csv"""
    url: Annotated[str, Field(min_length=1)] | None = None
    """Database as SQLAlchemy writes it; variables of the environment are filled in. Without it: `path`.
    E.g. mysql+pymysql://$DB_LOGIN/campaign"""
    scenarios: tuple[Annotated[int, Field(strict=True)], ...] | None = None
    """Scenarios of the database that are read. Without it: all. E.g. [3, 5]"""
    instrument: Name | None = None
    """Instrument of a store that holds several. Without it: the only one. E.g. WS_S"""
    angles: Annotated[Literal["head", "true"], BeforeValidator(name_of_true)] = "head"
    """Whether the angles are those that the head shows, or pointing angles already (true). E.g. true"""
    gate_m: Positive | None = None
    """Range of the gate that is used. Without it: the gate at the scan's target. E.g. 1166"""
    gates_m: Annotated[tuple[Positive, ...], Field(min_length=1)] | None = None
    """Ranges of several gates, each a result of its own: a profile. Without it: one gate. E.g. [500, 1000, 1500]"""
    fit_columns: Literal[2, 3] | None = None
    """Components of this scan's fit. Without it: the campaign's `columns`. E.g. 3"""
    beam_azimuth_deg: dict[int, Number] | None = None
    """Nacelle CSV: azimuth of each line of sight by its LOSindex, from the lidar's zero. Without it: no such file can
    be read. E.g. {0: -30, 1: 30}"""
    two_beam: TwoBeam | None = None
    """Means along and across the axis of a scan of two beams, by these rules. Without it: winds alone, as of any
    sector."""
    offsets: Offsets = Offsets()
    """What is added to what the files say."""
    stamp: Literal["auto", "start", "middle", "end"] = "auto"
    """Where in the ray the files' times stand; auto: as the format is known to have it. E.g. end"""
    azimuth: Literal["auto", "scanner", "estimate", "stored"] = "auto"
    """Whence the azimuth of a WindScanner text file: its scanner file, estimated from up and down sweeps, or as
    stored; auto: the first that there is. E.g. stored"""
    azimuth_lead_deg: Annotated[float, Field(strict=True)] | Literal["estimate"] = 0.0
    """By how much the stored azimuths are ahead of the middle of the ray in the direction of the sweep; estimate: from
    up- against down-sweeps. E.g. estimate"""
    attitude: Attitude = Attitude()
    """A log of heading, pitch and roll, and what is done with it."""
    columns: Columns | None = None
    """How the columns of a plain CSV are called. Without it: as `simulate` writes them."""
    filters: Filters | None = None
    """Filters of this scan. Without it: the campaign's."""

    @model_validator(mode="after")
    def _one_place(self) -> Self:
        if (self.path is None) == (self.url is None):
            raise ValueError("either `path` (files) or `url` (a database)")
        if self.gate_m is not None and self.gates_m is not None:
            raise ValueError("either `gate_m` (one) or `gates_m` (several)")
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

    directions_deg: Directions = "site"
    """Wind directions that count, by the mast: the site file's (site), all, or sectors [from, to]. E.g. [[118, 270]]"""
    speed_mps: Limits | None = None
    """Lowest and highest mean speed that count, by the mast. Without it: the site's `speed_range_mps`. E.g. [4, 16]"""
    every_speed: bool = False
    """Whether every speed counts. E.g. true"""
    availability: Share = STUDY_AVAILABILITY
    """Least share of a period's scans that has to be valid; the default is 19 of 50. E.g. 0.8"""


class Averaging(Noun):
    """Periods are stamped at their end."""

    periods_s: Annotated[tuple[Positive, ...], Field(min_length=1)] = (60.0, 600.0)
    """Averaging periods; means are stamped at their end. E.g. [60, 600]"""
    time_shift_s: Number = 0.0
    """Added to the lidars' times before averaging. E.g. 30"""
    compare_s: Positive = 600.0
    """Averaging period of the comparison with the mast. E.g. 1800"""


class MastLevel(Noun):
    """A height of the mast with instruments of its own."""

    height_m: Positive
    """Height above the ground. E.g. 60"""
    speed: Name
    """Column of the wind speed there. E.g. WSP060"""
    direction: Name | None = None
    """Column of the direction there. Without it: the mast's `direction`. E.g. WDIR060"""


class MastInput(Noun):
    """A mast's CSV, its columns, and where in the period its stamps stand."""

    path: Annotated[str, Field(min_length=1)]
    """CSV with the mast's wind. E.g. mast.csv"""
    time: Name = "time_utc"
    """Column of the times, ISO 8601 in UTC. E.g. TIMESTAMP"""
    speed: Name = "speed_mps"
    """Column of the wind speed. E.g. WSP116"""
    direction: Name = "from_deg"
    """Column of the direction that the wind comes from. E.g. WDIR100"""
    stamp: Literal["start", "end"] = "end"
    """Where in a period its times stand. E.g. start"""
    interval_s: Positive | None = None
    """Length of its periods. Without it: the usual step of the file. E.g. 600"""
    clock_s: Number = 0.0
    """Added to its times, to give UTC. E.g. -3600"""
    direction_offset_deg: Number = 0.0
    """Added to its directions. E.g. 1.5"""
    separator: Annotated[str, Field(min_length=1, max_length=1)] = ","
    """What stands between two columns. E.g. ';'"""
    missing: tuple[Number, ...] = (9999.0, -9999.0)
    """Numbers that stand for nothing. E.g. [-999]"""
    levels: tuple[MastLevel, ...] = ()
    """Heights of the mast: each scan is compared with the one nearest to it, and a profile is drawn. Without it:
    `speed` and `direction` for every scan."""

    def at_level(self, level: MastLevel) -> "MastInput":
        """The same file with the columns of one of its heights."""
        return self.model_copy(
            update={"speed": level.speed, "direction": level.direction or self.direction, "levels": ()}
        )


class PairInput(Noun):
    """A pair of the site to be retrieved, as dual or triple Doppler."""

    pair: Name
    """Pair of the site file; a pair without further keys may be its name alone. E.g. dual"""
    gap_s: NonNegative | None = None
    """Longest time between the rays of a pair. Without it: half a ray where synchronised, else 5 s. E.g. 2"""
    compare_gaps_s: tuple[NonNegative, ...] | None = None
    """Further times, whose pairs are counted for comparison. Without it: 0.5, 2, 5 and 8 s where not synchronised.
    E.g. [1, 3]"""


def _text_of_pair(value: object) -> object:
    return {"pair": value} if isinstance(value, str) else value


class Campaign(Noun):
    """One run of the analysis."""

    name: Name
    """Name of the run, in tables and figures. E.g. May"""
    site: Path
    """Site file, beside the campaign file. E.g. site.yaml"""
    inputs: Annotated[tuple[RayInput, ...], Field(min_length=1)]
    """The measured rays, an entry for each scan."""
    pairs: tuple[Annotated[PairInput, BeforeValidator(_text_of_pair)], ...] = ()
    """Pairs of the site file that are retrieved, as dual or triple Doppler. E.g. [dual]"""
    sizes_deg: Annotated[tuple[Size, ...], Field(min_length=1)] | None = None
    """Sector sizes that are retrieved, as middle rays of the scan. Without it: the scan's and the usual smaller ones.
    E.g. [60, 30, 8]"""
    columns: Literal[2, 3] = 2
    """Components of the fit: 2, u and v; 3, u, v and w. E.g. 3"""
    weights: Literal["equal", "cnr"] = "equal"
    """Weights of the rays in a fit: all alike, or by the noise that the CNR of each lets expect (cnr), which pays where
    noise is larger than turbulence. E.g. cnr"""
    filters: Filters = Filters()
    """What is taken away from rays and scans."""
    selection: Selection = Selection()
    """Which period means count in the comparison."""
    averaging: Averaging = Averaging()
    """Period means."""
    time_lag: TimeLag = TimeLag()
    """Clocks set by correlation with the mast."""
    sonics: tuple[SonicInput, ...] = ()
    """Sonics whose orientation is trimmed by the lidars' beams."""
    mast: MastInput | None = None
    """The mast's data. Without it: nothing is compared."""
    output: Path = Path("results")
    """Folder of the results, beside the campaign file. E.g. results"""
    chunk_rays: Count = 200_000
    """Rays of a store or database that are worked on at once. E.g. 100000"""
