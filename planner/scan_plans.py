"""How a lidar scans: one noun for each type of scan, told apart by `type`."""

from typing import Annotated, Literal, get_args

from pydantic import Discriminator, Field, Tag

from planner.nouns import Count, Name, Noun, Positive

Motion = Literal["continuous", "step"]
Sweep = Literal["back_and_forth", "forward", "reset"]
Return = Literal["back_and_forth", "reset"]  # what cannot go round on
ScanType = Literal["sector", "ppi", "rhi", "stare", "raster", "points"]

Elevation = Annotated[float, Field(strict=True, ge=-90, le=180)]  # past 90°: over the top
Turn = Annotated[float, Field(strict=True, ge=-720, le=720)]  # heads count several turns
Sweepable = Annotated[float, Field(strict=True, gt=0, le=360)]


class GatePlan(Noun):
    """The range gates of a scan; `first_m` is the centre of gate 0."""

    first_m: Positive
    spacing_m: Positive
    count: Count


class ScanBase(Noun):
    """What every scan says.

    A scan points at its `target`. `azimuth_head_deg` and `elevation_head_deg`, where given, win over it: they
    are what the instrument shows, so that a head that was pointed wrongly shows as such. For a sector and a
    raster they are those of the middle.
    """

    name: Name
    lidar: Name
    target: Name | None = None
    accumulation_s: Positive  # of one ray
    period_s: Positive | None = None  # start to start; declared, it wins over what head and accumulation give
    pulse_ns: Positive | None = None  # default: the instrument's `default_pulse_ns`
    fft_points: Count | None = None  # default: that of the pulse
    gates: GatePlan | None = None
    azimuth_head_deg: Turn | None = None
    elevation_head_deg: Elevation | None = None


class SectorScan(ScanBase):
    """An arc at one elevation, centred on its target; `sector_deg` is what the beam sweeps."""

    type: Literal["sector"]
    sector_deg: Sweepable
    step_deg: Positive
    motion: Motion = "continuous"
    sweep: Sweep = "back_and_forth"


class PpiScan(ScanBase):
    """The full circle at one elevation."""

    type: Literal["ppi"]
    step_deg: Positive
    motion: Motion = "continuous"
    sweep: Sweep = "forward"


class RhiScan(ScanBase):
    """A vertical slice at one azimuth, between two elevations above the horizontal (not head elevations)."""

    type: Literal["rhi"]
    elevation_from_deg: Elevation
    elevation_to_deg: Elevation
    step_deg: Positive
    motion: Motion = "continuous"
    sweep: Return = "back_and_forth"


class StareScan(ScanBase):
    """One direction, ray after ray."""

    type: Literal["stare"]


class RasterScan(ScanBase):
    """A window of azimuth x elevation around a target or a hard target, row by row from below."""

    type: Literal["raster"]
    hard_target: Name | None = None
    width_deg: Annotated[float, Field(strict=True, gt=0, lt=360)]
    height_deg: Annotated[float, Field(strict=True, gt=0, le=180)]
    step_deg: Positive
    elevation_step_deg: Positive | None = None  # default: step_deg
    motion: Motion = "step"
    sweep: Return = "back_and_forth"


class PointsScan(ScanBase):
    """A list of targets, one after the other, staring at each for one ray."""

    type: Literal["points"]
    targets: Annotated[tuple[Name, ...], Field(min_length=1)]
    sweep: Return = "reset"


def _scan_tag(value: object) -> str | None:
    kind = value.get("type") if isinstance(value, dict) else getattr(value, "type", None)
    return f"<{kind}>" if isinstance(kind, str) and kind in get_args(ScanType) else None


ScanPlan = Annotated[
    Annotated[SectorScan, Tag("<sector>")]
    | Annotated[PpiScan, Tag("<ppi>")]
    | Annotated[RhiScan, Tag("<rhi>")]
    | Annotated[StareScan, Tag("<stare>")]
    | Annotated[RasterScan, Tag("<raster>")]
    | Annotated[PointsScan, Tag("<points>")],
    Discriminator(_scan_tag),
]
"""Any scan; `isinstance` or `.type` tells which."""
