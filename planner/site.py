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
from planner.nouns import Bearing, Name, NonNegative, Noun, Number, Positive
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
    """Two scans, or more, whose beams meet at a target: dual or triple Doppler."""

    name: Name
    """Name of the pair. E.g. dual"""
    scans: Annotated[tuple[Name, ...], Field(min_length=2)]
    """Scans of different lidars whose beams meet: two for dual, three for triple Doppler. E.g. [stare K, stare W]"""
    target: Name
    """Target at which they meet. E.g. cup"""
    synchronised: bool = False
    """Whether the rays of all start at the same moments; if not, rays are paired by their times. E.g. true"""
    columns: Literal[2, 3] | None = None
    """Components of the wind that are fitted: 2, u and v; 3, u, v and w. Without it: 3 from three scans on. E.g. 2"""

    @property
    def fit_columns(self) -> Literal[2, 3]:
        """Columns of the fit."""
        return self.columns or (3 if len(self.scans) > 2 else 2)


class Weibull(Noun):
    """A Weibull distribution of wind speed."""

    scale_mps: Positive
    """Scale parameter A of the ten-minute mean speed. E.g. 8.9"""
    shape: Positive
    """Shape parameter k. E.g. 2.75"""


class Turbulence(Noun):
    """`length_m` is the longitudinal integral length scale, not the Kaimal length of IEC 61400-1."""

    intensity: Annotated[float, Field(strict=True, gt=0, le=1)]
    """Turbulence intensity: standard deviation over mean of the longitudinal wind speed in ten minutes. E.g. 0.09"""
    length_m: Positive
    """Longitudinal integral length scale; the Kaimal length of IEC 61400-1 is 2.33 times as long. E.g. 170"""
    model: Literal["von-karman", "kaimal", "mann"] = "von-karman"
    """Spectral model of the turbulence: isotropic von Kármán, IEC Kaimal with coherence, or Mann's uniform shear. E.g.
    von-karman"""
    gamma: Annotated[float, Field(strict=True, ge=0, le=5)] = 3.9
    """Shear distortion Γ of the Mann model; 0 is isotropic, and the other models have none. E.g. 3.9"""


class Wind(Noun):
    """The wind that counts. Of `weibull`, `speeds_mps` and `rose` at most one."""

    weibull: Weibull | None = None
    """Weibull distribution of the ten-minute mean speed, the same for all directions. Without it: `rose` or
    `speeds_mps`."""
    speeds_mps: Annotated[tuple[Positive, ...], Field(min_length=1)] | None = None
    """Speeds that count alike. Without it: `weibull` or `rose`; without all three every speed of the range counts
    alike. E.g. [6, 8, 10]"""
    rose: Path | None = None
    """CSV of the wind rose: direction_deg, share and, if known, weibull_scale_mps and weibull_shape, a row a sector.
    Without it: directions count alike. E.g. rose.csv"""
    reference_height_m: Positive | None = None
    """Height above the ground at which the speeds hold. Without it: the target's own height. E.g. 116.5"""
    speed_range_mps: tuple[NonNegative, Positive] = (4.0, 25.0)
    """Lowest and highest speed that count. E.g. [4, 25]"""
    directions_deg: Annotated[tuple[tuple[Bearing, Bearing], ...], Field(min_length=1)] | None = None
    """Sectors of wind direction that count, each [from, to] clockwise from true north, where the wind comes from.
    Without it: all that wakes leave free. E.g. [[118, 270]]"""
    turbulence: Turbulence | None = None
    """Turbulence at the target. Without it: errors that need it are not predicted."""
    shear_exponent: Number = 0.14
    """Exponent of the power-law wind profile. E.g. 0.2"""
    vertical_mps: Number = 0.0
    """Mean vertical wind, positive upward. E.g. 0.1"""
    lateral_gradient_per_s: Number = 0.0
    """Growth of the wind speed per metre to the right, looking downwind. E.g. 0.001"""


class Wakes(Noun):
    """How wakes are drawn: Jensen's cone, the sectors of IEC 61400-12-1, or both."""

    model: Literal["jensen", "iec", "union"] = "union"
    """What a direction is excluded by: Jensen's wake (jensen), the disturbed sector of IEC 61400-12-1 (iec), or either
    (union). E.g. iec"""
    decay: Positive = 0.075
    """Wake decay constant k, growth of the wake's radius over distance: 0.075 on land, 0.04 to 0.05 offshore.
    E.g. 0.04"""
    max_diameters: Positive = 20.0
    """Distance in rotor diameters beyond which a wake does not count. E.g. 15"""


class Tolerance(Noun):
    """What the user can live with at the target; effects below it need no model."""

    position_m: Positive = 0.5
    """Shift of the measured point below which a geometric effect is not modelled. E.g. 1"""
    angle_deg: Positive = 0.01
    """The same for effects that turn the beam or the wind direction. E.g. 0.05"""
    speed_mps: Positive = 0.05
    """The same for effects on the wind speed. E.g. 0.1"""
    slope: Positive = 0.01
    """How far the regression slope of a smaller sector may be from that of the widest, for the recommended size.
    E.g. 0.02"""
    scatter_growth: Positive = 0.25
    """How much more ten-minute means of a smaller sector may scatter than those of the widest, as a share. E.g. 0.5"""


class Terrain(Noun):
    """A height model of the ground, as `terrain: {file: dem.tif, height_datum: above_sea_level}`. Reading it needs rasterio:
    `pip install '.[terrain]'`."""

    file: Path
    """Raster of ground heights, such as a GeoTIFF, in any CRS that it states. E.g. dem.tif"""
    height_datum: Literal["above_sea_level", "ellipsoidal"] | None = None
    """What the raster's heights count from. Without it: what the raster itself says; most say nothing, and then it has to
    be given. E.g. above_sea_level"""
    surface: Path | None = None
    """Raster of the heights of canopy and buildings above the ground, on the same cells. Without it: only bare ground
    blocks a beam. E.g. canopy.tif"""


def _file_of_text(value: object) -> object:
    return {"file": value} if isinstance(value, str) else value


class Area(Noun):
    """Where lidars may stand or may not: a GIS file, or a polygon of (easting, northing)."""

    name: Name | None = None
    """What messages call the area. Without it: it has no name. E.g. pond"""
    file: Path | None = None
    """GIS file with polygons: GeoPackage, GeoJSON or Shapefile. Without it: `polygon`; one of the two.
    E.g. fields.geojson"""
    polygon: Annotated[tuple[tuple[Number, Number], ...], Field(min_length=3)] | None = None
    """Corners in order, each [easting, northing]. Without it: `file`.
    E.g. [[447700, 6255900], [447800, 6255900], [447800, 6256000]]"""


AreaList = tuple[Annotated[Area, BeforeValidator(_file_of_text)], ...]


class Areas(Noun):
    """Allowed and forbidden ground."""

    allowed: AreaList = ()
    """Ground on which lidars may stand; empty: everywhere. E.g. [fields.geojson]"""
    forbidden: AreaList = ()
    """Ground on which they may not. E.g. [{name: pond, file: pond.gpkg}]"""


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
    """Name of the campaign; the report's title. E.g. Høvsøre SSvsDD 2014"""
    crs: Name
    """Projected CRS of every easting and northing, in metres; usually the site's UTM zone. E.g. EPSG:32632"""
    height_datum: Literal["above_sea_level", "ellipsoidal"] = "above_sea_level"
    """What all heights count from: sea level (the geoid), or the ellipsoid, as satellite receivers give them.
    E.g. ellipsoidal"""
    geoid_undulation_m: Number | None = None
    """Height of the geoid above the ellipsoid at the site. Without it: heights above sea level are taken as
    ellipsoidal, 6 ppm of a distance for 40 m. E.g. 40.5"""
    ground_height_m: Number | None = None
    """Height of flat ground. Without it: `terrain`, else the height of what stands lowest. E.g. 4.8"""
    terrain: Terrain | None = None
    """Height model of ground that is not flat; needs the extra `.[terrain]`. Without it: flat ground."""
    lidars: tuple[Lidar, ...] = ()
    """The scanning lidars."""
    masts: tuple[Mast, ...] = ()
    """Met masts: where targets hang, and what the lidars are compared with."""
    turbines: tuple[Turbine, ...] = ()
    """Wind turbines, whose wakes disturb and whose rotors and towers block beams."""
    obstacles: tuple[Obstacle, ...] = ()
    """Buildings and rows of trees, which block beams; they count in the disturbed sectors of IEC 61400-12-1."""
    hard_targets: tuple[HardTarget, ...] = ()
    """Solid things by whose echo pointing offsets are found."""
    targets: tuple[Target, ...] = ()
    """What is to be measured."""
    scans: tuple[ScanPlan, ...] = ()
    """How the lidars scan."""
    pairs: tuple[Pair, ...] = ()
    """Scans whose beams meet, for dual and triple Doppler."""
    wind: Wind | None = None
    """The wind that counts. Without it: 10 m/s from all directions alike, without turbulence."""
    wakes: Wakes = Wakes()
    """How wakes are drawn."""
    areas: Areas = Areas()
    """Where lidars may stand, for `lidarplan place`."""
    tolerance: Tolerance = Tolerance()
    """What you can live with at the target: effects below it are not modelled."""
    fidelity: Fidelity = "auto"
    """Effects that are modelled: those over the tolerance (auto), every one (all), or the listed ones.
    E.g. [convergence, curvature, turbulence]"""

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
