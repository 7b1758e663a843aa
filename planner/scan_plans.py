"""How a lidar scans: one noun for each type of scan, told apart by `type`."""

from typing import Annotated, Literal, get_args

from pydantic import Discriminator, Field, Tag

from geometry.sweeps import Motion, Sweep
from planner.nouns import Count, Name, Noun, Positive

Return = Literal["back_and_forth", "reset"]  # what cannot go round on
ScanType = Literal["sector", "ppi", "rhi", "stare", "raster", "points"]

Elevation = Annotated[float, Field(strict=True, ge=-90, le=180)]  # past 90°: over the top
Turn = Annotated[float, Field(strict=True, ge=-720, le=720)]  # heads count several turns
Sweepable = Annotated[float, Field(strict=True, gt=0, le=360)]


class GatePlan(Noun):
    """The range gates of a scan; `first_m` is the centre of gate 0."""

    first_m: Positive
    """Range of the centre of gate 0. E.g. 666"""
    spacing_m: Positive
    """Distance between the centres of gates. E.g. 25"""
    count: Count
    """Number of gates. E.g. 41"""


class ScanBase(Noun):
    """What every scan says.

    A scan points at its `target`. `azimuth_head_deg` and `elevation_head_deg`, where given, win over it: they
    are what the instrument shows, so that a head that was pointed wrongly shows as such. For a sector and a
    raster they are those of the middle.
    """

    name: Name
    """Name of the scan. E.g. sector"""
    lidar: Name
    """Lidar that scans. E.g. WS_S"""
    target: Name | None = None
    """Target that the scan is centred on. Without it: head angles, or what the type of scan has in its place. E.g. cup"""
    accumulation_s: Positive
    """Time over which the pulses of one ray are averaged. E.g. 0.4"""
    period_s: Positive | None = None
    """Time from the start of one scan to the next; declared, it wins. Without it: what rays and head take. E.g. 12"""
    pulse_ns: Positive | None = None
    """Pulse length, full width at half maximum. Without it: the instrument's default, else 200 ns. E.g. 200"""
    fft_points: Count | None = None
    """Samples of one gate (FFT points). Without it: the pulse mode's, else 64. E.g. 64"""
    gates: GatePlan | None = None
    """Range gates. Without it: which gate hits the target is not told."""
    azimuth_head_deg: Turn | None = None
    """Azimuth that the instrument shows, of the middle of a sector or raster; wins over the target. Without it: the
    target's. E.g. 179"""
    elevation_head_deg: Elevation | None = None
    """Elevation that the instrument shows; wins over the target. Without it: the target's. E.g. 5.36"""


class SectorScan(ScanBase):
    """An arc at one elevation, centred on its target; `sector_deg` is what the beam sweeps."""

    type: Literal["sector"]
    """Plan position indicator (PPI) over an arc."""
    sector_deg: Sweepable
    """Angle that the beam sweeps, centred on the target. E.g. 60"""
    step_deg: Positive
    """Angle from one ray to the next; a whole number of steps makes the sector. E.g. 2"""
    motion: Motion = "continuous"
    """Whether the head turns on while a ray accumulates, or stops for it (step-stare). E.g. step"""
    sweep: Sweep = "back_and_forth"
    """Next scan: the other way round (back_and_forth), on (forward), or from the start again (reset). E.g. reset"""


class PpiScan(ScanBase):
    """The full circle at one elevation."""

    type: Literal["ppi"]
    """Plan position indicator (PPI) over the full circle."""
    step_deg: Positive
    """Angle from one ray to the next. E.g. 2"""
    motion: Motion = "continuous"
    """Whether the head turns on while a ray accumulates, or stops for it (step-stare). E.g. step"""
    sweep: Sweep = "forward"
    """Next circle: on in the same sense (forward), the other way round, or from the start again (reset). E.g. reset"""


class RhiScan(ScanBase):
    """A vertical slice at one azimuth, between two elevations above the horizontal (not head elevations)."""

    type: Literal["rhi"]
    """Range height indicator (RHI): a vertical slice."""
    elevation_from_deg: Elevation
    """Elevation at which it begins, above the horizontal; past 90: over the top. E.g. 0"""
    elevation_to_deg: Elevation
    """Elevation at which it ends. E.g. 30"""
    step_deg: Positive
    """Angle from one ray to the next. E.g. 1"""
    motion: Motion = "continuous"
    """Whether the head turns on while a ray accumulates, or stops for it (step-stare). E.g. step"""
    sweep: Return = "back_and_forth"
    """Next slice: the other way round, or from the start again. E.g. reset"""


class StareScan(ScanBase):
    """One direction, ray after ray."""

    type: Literal["stare"]
    """Line of sight (LOS): one direction, ray after ray."""


class RasterScan(ScanBase):
    """A window of azimuth x elevation around a target or a hard target, row by row from below."""

    type: Literal["raster"]
    """Window of azimuths and elevations, row by row from below: a CNR map."""
    hard_target: Name | None = None
    """Hard target that it is centred on. Without it: `target`, or head angles. E.g. tip"""
    width_deg: Annotated[float, Field(strict=True, gt=0, lt=360)]
    """Width of the window in azimuth. E.g. 1"""
    height_deg: Annotated[float, Field(strict=True, gt=0, le=180)]
    """Height of the window in elevation. E.g. 1"""
    step_deg: Positive
    """Angle from one ray to the next, in azimuth. E.g. 0.1"""
    elevation_step_deg: Positive | None = None
    """Angle from one row to the next. Without it: `step_deg`. E.g. 0.05"""
    motion: Motion = "step"
    """Whether the head turns on while a ray accumulates, or stops for it (step-stare). E.g. continuous"""
    sweep: Return = "back_and_forth"
    """Next row: the other way round, or from the start again. E.g. reset"""


class PointsScan(ScanBase):
    """A list of targets, one after the other, staring at each for one ray."""

    type: Literal["points"]
    """Targets one after the other, a ray at each."""
    targets: Annotated[tuple[Name, ...], Field(min_length=1)]
    """Targets in their order. E.g. [hub, field]"""
    sweep: Return = "reset"
    """After the last: back through them, or to the first again. E.g. back_and_forth"""


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
