"""The site: what stands where, what is to be measured and how. Validated nouns, no calculation.

Positions are (easting, northing, height) in metres of the site's projected CRS; heights follow
`height_datum`. Angles are degrees, azimuths clockwise. A field with a default may be left out of a site file;
`planner.assumptions` lists what is then taken in its place.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Literal, Protocol, Self, TypeVar

from pydantic import BeforeValidator, Discriminator, Field, Tag, ValidationInfo, model_validator

from geometry.errors import InputError
from planner.instruments import Instrument, Pulse
from planner.nouns import Name, NonNegative, Noun, Number, Positive
from planner.scan_plans import (
    GatePlan,
    PointsScan,
    PpiScan,
    RasterScan,
    RhiScan,
    ScanBase,
    ScanPlan,
    SectorScan,
    StareScan,
)
from planner.site_faults import faults_of
from planner.standing import (
    HardTarget,
    Lidar,
    Mast,
    Mounting,
    Obstacle,
    Target,
    Turbine,
    Uncertainty,
)

__all__ = [
    "Area",
    "Areas",
    "GatePlan",
    "HardTarget",
    "Instrument",
    "Lidar",
    "Mast",
    "Mounting",
    "Obstacle",
    "Pair",
    "PointsScan",
    "PpiScan",
    "Pulse",
    "RasterScan",
    "RhiScan",
    "ScanBase",
    "ScanPlan",
    "SectorScan",
    "Site",
    "StareScan",
    "Target",
    "Terrain",
    "Tolerance",
    "Turbine",
    "Turbulence",
    "Uncertainty",
    "Wakes",
    "Weibull",
    "Wind",
]

CHECKED = "checked"  # in the context of a validation: the faults between fields have been looked for already

FidelityEffect = Literal[
    "convergence",
    "scale",
    "curvature",
    "refraction",
    "geoid",
    "vertical-wind",
    "shear",
    "probe-averaging",
    "pointing-noise",
    "turbulence",
    "scan-motion",
]


class Pair(Noun):
    """Two scans (or more) whose beams meet at a target."""

    name: Name
    scans: Annotated[tuple[Name, ...], Field(min_length=2)]
    target: Name
    synchronised: bool = False


class Weibull(Noun):
    """A Weibull distribution of wind speed."""

    scale_mps: Positive
    shape: Positive


class Turbulence(Noun):
    """`length_m` is the longitudinal integral length scale, not the Kaimal length of IEC 61400-1."""

    intensity: Annotated[float, Field(strict=True, gt=0, le=1)]
    length_m: Positive
    model: Literal["von-karman"] = "von-karman"


Bearing = Annotated[float, Field(strict=True, ge=0, le=360)]


class Wind(Noun):
    """The wind that counts. Of `weibull`, `speeds_mps` and `rose` at most one."""

    weibull: Weibull | None = None
    speeds_mps: Annotated[tuple[Positive, ...], Field(min_length=1)] | None = None
    rose: Path | None = None
    reference_height_m: Positive | None = None  # above ground; default: the target's own height
    speed_range_mps: tuple[NonNegative, Positive] = (4.0, 25.0)
    directions_deg: Annotated[tuple[tuple[Bearing, Bearing], ...], Field(min_length=1)] | None = None
    turbulence: Turbulence | None = None
    shear_exponent: Number = 0.14
    vertical_mps: Number = 0.0
    lateral_gradient_per_s: Number = 0.0


class Wakes(Noun):
    """How wakes are drawn: Jensen's cone, the sectors of IEC 61400-12-1, or both."""

    model: Literal["jensen", "iec", "union"] = "union"
    decay: Positive = 0.075  # on land; 0.04 to 0.05 offshore
    max_diameters: Positive = 20.0


class Tolerance(Noun):
    """What the user can live with at the target; effects below it need no model."""

    position_m: Positive = 0.5
    angle_deg: Positive = 0.01
    speed_mps: Positive = 0.05
    slope: Positive = 0.01  # how far the regression's slope of a smaller sector may be from the widest's
    scatter_growth: Positive = 0.25  # how much more its ten-minute means may scatter, as a share


class Terrain(Noun):
    """A height model of the ground."""

    file: Path
    height_datum: Literal["above_sea_level", "ellipsoidal"] | None = (
        None  # where the file itself does not say
    )
    surface: Path | None = None  # heights of canopy and buildings above the ground, on the same cells


def _file_of_text(value: object) -> object:
    return {"file": value} if isinstance(value, str) else value


class Area(Noun):
    """Where lidars may stand or may not: a GIS file, or a polygon of (easting, northing)."""

    name: Name | None = None
    file: Path | None = None
    polygon: Annotated[tuple[tuple[Number, Number], ...], Field(min_length=3)] | None = None


AreaList = tuple[Annotated[Area, BeforeValidator(_file_of_text)], ...]


class Areas(Noun):
    """Allowed and forbidden ground."""

    allowed: AreaList = ()
    forbidden: AreaList = ()


def _fidelity_tag(value: object) -> str:
    return "<word>" if isinstance(value, str) else "<effects>"


Fidelity = Annotated[
    Annotated[Literal["auto", "all"], Tag("<word>")]
    | Annotated[tuple[FidelityEffect, ...], Tag("<effects>")],
    Discriminator(_fidelity_tag),
]


class _Named(Protocol):
    @property
    def name(self) -> str: ...


N = TypeVar("N", bound=_Named)


def _named(items: Sequence[N], name: str, kind: str) -> N:
    for item in items:
        if item.name == name:
            return item
    raise InputError(
        f"no {kind} is called '{name}'; allowed: {', '.join(i.name for i in items) or 'none is declared'}"
    )


class Site(Noun):
    """A measurement site as its planner wrote it down."""

    name: Name
    crs: Name
    height_datum: Literal["above_sea_level", "ellipsoidal"] = "above_sea_level"
    geoid_undulation_m: Number | None = None
    ground_height_m: Number | None = None
    terrain: Terrain | None = None
    lidars: tuple[Lidar, ...] = ()
    masts: tuple[Mast, ...] = ()
    turbines: tuple[Turbine, ...] = ()
    obstacles: tuple[Obstacle, ...] = ()
    hard_targets: tuple[HardTarget, ...] = ()
    targets: tuple[Target, ...] = ()
    scans: tuple[ScanPlan, ...] = ()
    pairs: tuple[Pair, ...] = ()
    wind: Wind | None = None
    wakes: Wakes = Wakes()
    areas: Areas = Areas()
    tolerance: Tolerance = Tolerance()
    fidelity: Fidelity = "auto"

    @model_validator(mode="after")
    def _consistent(self, info: ValidationInfo) -> Self:
        faults = [] if info.context == CHECKED else faults_of(self.model_dump())
        if faults:
            raise ValueError("; ".join(str(fault) for fault in faults))
        return self

    def lidar(self, name: str) -> Lidar:
        return _named(self.lidars, name, "lidar")

    def mast(self, name: str) -> Mast:
        return _named(self.masts, name, "mast")

    def turbine(self, name: str) -> Turbine:
        return _named(self.turbines, name, "turbine")

    def target(self, name: str) -> Target:
        return _named(self.targets, name, "target")

    def hard_target(self, name: str) -> HardTarget:
        return _named(self.hard_targets, name, "hard target")

    def scan(self, name: str) -> ScanPlan:
        return _named(self.scans, name, "scan")

    def pair(self, name: str) -> Pair:
        return _named(self.pairs, name, "pair")

    def target_position_m(self, target: Target | HardTarget | str) -> tuple[float, float, float]:
        """Where a target is (easting, northing, height), a mast's height added to its base.

        A name is looked up among the targets, then among the hard targets.
        """
        if isinstance(target, str):
            is_target = any(item.name == target for item in self.targets)
            target = self.target(target) if is_target else self.hard_target(target)
        if target.position is not None:
            return target.position
        mast = self.mast(str(target.mast if isinstance(target, Target) else target.on))
        easting_m, northing_m, base_m = mast.position
        return easting_m, northing_m, base_m + (mast.height_m if target.height_m is None else target.height_m)

    @property
    def ground_m(self) -> float:
        """Height of the ground, one level for the site: as declared, else that of the lowest base or head."""
        if self.ground_height_m is not None:
            return self.ground_height_m
        positions = [
            *(lidar.position for lidar in self.lidars),
            *(mast.position for mast in self.masts),
            *(turbine.position for turbine in self.turbines),
            *(obstacle.position for obstacle in self.obstacles),
        ]
        if not positions:
            raise InputError(
                "the ground's height is not known: nothing stands on the site; give `ground_height_m`"
            )
        return min(height_m for _, _, height_m in positions)

    @property
    def assumed_wind(self) -> Wind:
        """The declared wind, else one of 10 m/s, from everywhere alike, without turbulence."""
        return self.wind if self.wind is not None else Wind(speeds_mps=(10.0,))

    def pulse_of(self, scan: ScanPlan) -> Pulse | None:
        """The pulse mode that a scan uses; None where its instrument has no such pulse."""
        return self.lidar(scan.lidar).device.pulse(scan.pulse_ns)
