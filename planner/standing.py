"""What stands on a site or is to be measured there: lidars, masts, turbines, obstacles, targets."""

from typing import Annotated, Literal

from pydantic import Discriminator, Field, Tag

from planner.instruments import Instrument
from planner.instruments import instrument as catalogued
from planner.nouns import Name, NonNegative, North, Noun, Number, Position, Positive, Share

DEFAULT_RADIAL_SPEED_NOISE_MPS = 0.1  # assumed where neither the site nor the instrument says


class Mounting(Noun):
    """How the head stands: turned about up, nose up, right side down; and what its range is off by."""

    heading_deg: Number = 0.0
    """Turn of the head's zero from `north`, clockwise. E.g. 45"""
    pitch_deg: Number = 0.0
    """Tilt forward or back, nose up positive. E.g. 0.12"""
    roll_deg: Number = 0.0
    """Tilt to the side, right side down positive. E.g. -0.05"""
    range_offset_m: Number = 0.0
    """Added to the ranges that the instrument shows. E.g. -3"""


class Uncertainty(Noun):
    """Standard deviations (k = 1) of one lidar; a correlation is the one between the rays of a scan."""

    position_m: NonNegative = 0.1
    """Position of the head, in each direction; differential GNSS reaches 0.1. E.g. 0.05"""
    heading_deg: NonNegative = 0.05
    """Heading, the same for all rays; 0.05 after mapping hard targets. E.g. 0.1"""
    levelling_deg: NonNegative = 0.03
    """Levelling, the same for all rays. E.g. 0.02"""
    azimuth_deg: NonNegative = 0.05
    """Azimuth of a ray. E.g. 0.02"""
    elevation_deg: NonNegative = 0.05
    """Elevation of a ray. E.g. 0.02"""
    range_m: NonNegative = 5.0
    """Range of a gate. E.g. 2"""
    radial_speed_mps: NonNegative | None = None
    """Radial speed of one ray, at good signal. Without it: from `signal`, else the instrument's, else 0.1 m/s.
    E.g. 0.2"""
    radial_speed_relative: NonNegative = 0.0
    """Calibration of the radial speed, as a share of it, the same for all rays. E.g. 0.002"""
    clock_s: NonNegative = 0.0
    """Clock against the other lidars of a pair. E.g. 0.1"""
    azimuth_correlation: Share = 0.0
    """Correlation of the azimuth error between the rays of a scan. E.g. 0.5"""
    elevation_correlation: Share = 0.0
    """Correlation of the elevation error between the rays of a scan. E.g. 0.5"""
    range_correlation: Share = 0.0
    """Correlation of the range error between the rays of a scan. E.g. 1"""
    radial_speed_correlation: Share = 0.0
    """Correlation of the radial speed's error between the rays of a scan. E.g. 0.2"""


class Signal(Noun):
    """How strong the echo is: CNR of one pulse at one range, in the site's air. Noise then follows from range and pulses."""

    cnr_db: Number
    """Carrier-to-noise ratio (CNR) of one pulse at `range_m`. E.g. -12"""
    range_m: Positive
    """Range at which it was seen. E.g. 1000"""
    pulse_ns: Positive | None = None
    """Pulse with which it was seen. Without it: the scan's own. E.g. 200"""
    extinction_per_m: NonNegative = 1e-4
    """Extinction of the air; 1e-4 is 40 km of visibility. E.g. 2.0e-4"""
    least_cnr_db: Number = -25.0
    """CNR below which a ray is thrown away. E.g. -22"""
    spread_db: Positive = 3.0
    """Standard deviation of the CNR from hour to hour. E.g. 4"""


def _instrument_tag(value: object) -> str:
    return "<catalogue>" if isinstance(value, str) else "<inline>"


class Lidar(Noun):
    """A scanning lidar on its spot; pointing angle = head angle + offset, after the mounting rotation."""

    name: Name
    """Name of the lidar. E.g. WS_K"""
    position: Position
    """Position of the scanner head. E.g. [447450.548, 6256541.135, 4.054]"""
    instrument: Annotated[
        Annotated[Name, Tag("<catalogue>")] | Annotated[Instrument, Tag("<inline>")],
        Discriminator(_instrument_tag),
    ]
    """Name of a catalogued lidar, or a mapping with the instrument's own numbers. E.g. windscanner-200s"""
    north: North = "true"
    """North from which the head's azimuth counts, before heading and offset. E.g. grid"""
    azimuth_offset_deg: Number = 0.0
    """Pointing azimuth less head azimuth, as mapping hard targets gives it. E.g. 3.46"""
    elevation_offset_deg: Number = 0.0
    """Pointing elevation less head elevation. E.g. 0.78"""
    mounting: Mounting = Mounting()
    """How the head stands."""
    uncertainty: Uncertainty = Uncertainty()
    """Standard uncertainties (k = 1)."""
    signal: Signal | None = None
    """How strong the echo is. Without it: noise does not change with range, and no ray is lost to a weak signal."""

    @property
    def device(self) -> Instrument:
        """The instrument's numbers, from the catalogue or from the site file."""
        return catalogued(self.instrument) if isinstance(self.instrument, str) else self.instrument

    @property
    def radial_speed_noise_mps(self) -> float:
        """Standard deviation of one radial speed: the lidar's own, else the instrument's, else 0.1 m/s."""
        known = (self.uncertainty.radial_speed_mps, self.device.radial_speed_noise_mps)
        return next((value for value in known if value is not None), DEFAULT_RADIAL_SPEED_NOISE_MPS)


class Mast(Noun):
    """A met mast; `position` is its base."""

    name: Name
    """Name of the mast. E.g. mast"""
    position: Position
    """Position of the base. E.g. [447647.39, 6255435.76, 4.836]"""
    height_m: Positive
    """Height above the base. E.g. 116.5"""
    width_m: Positive = 1.0
    """Width, for what it blocks. E.g. 1.2"""
    speed_uncertainty_mps: NonNegative | None = None
    """Standard uncertainty (k = 1) of its ten-minute mean speed. Without it: the uncertainty budget has no reference.
    E.g. 0.1"""
    direction_uncertainty_deg: NonNegative | None = None
    """Standard uncertainty (k = 1) of its ten-minute mean direction. Without it: as above. E.g. 2"""


class Turbine(Noun):
    """A wind turbine; `position` is its base."""

    name: Name
    """Name of the turbine. E.g. stand 5"""
    position: Position
    """Position of the tower's base. E.g. [447647.39, 6255620.76, 4.836]"""
    hub_height_m: Positive
    """Hub height above the base. E.g. 99.5"""
    rotor_diameter_m: Positive
    """Rotor diameter. E.g. 113"""
    tower_diameter_m: Positive = 4.0
    """Tower diameter, for what it blocks. E.g. 5"""
    thrust_coefficient: Annotated[float, Field(strict=True, ge=0, lt=1)] = 0.8
    """Thrust coefficient, for the wind speed deficit of its wake. E.g. 0.75"""


class Obstacle(Noun):
    """A building or a row of trees: a box on its base."""

    name: Name
    """Name of the obstacle. E.g. barn"""
    position: Position
    """Centre of the base. E.g. [447600, 6255900, 12]"""
    width_m: Positive
    """Width. E.g. 12"""
    length_m: Positive
    """Length. E.g. 30"""
    height_m: Positive
    """Height above the base. E.g. 8"""
    azimuth_deg: Number = 0.0
    """Direction of the length, clockwise from grid north. E.g. 20"""


class HardTarget(Noun):
    """Something solid to find the pointing offsets with: on a mast, or at a position of its own."""

    name: Name
    """Name of the hard target. E.g. tip"""
    on: Name | None = None
    """Mast on which it is. Without it: `position`; one of the two. E.g. mast"""
    position: Position | None = None
    """Position of its middle or tip. Without it: `on`. E.g. [448100, 6256900, 45]"""
    height_m: NonNegative | None = None
    """Height above the mast's base. Without it: the mast's top. E.g. 60"""
    shape: Literal["tip", "boom", "mast"]
    """What the beam sees of it: the tip or the shaft of a mast, or a boom. E.g. tip"""
    size_m: Positive
    """Thickness across the beam. E.g. 0.1"""
    uncertainty_m: NonNegative
    """Standard uncertainty (k = 1) of its position. E.g. 0.2"""


class Target(Noun):
    """A point to be measured: at a height above a mast's base, or at a position of its own."""

    name: Name
    """Name of the target. E.g. cup"""
    mast: Name | None = None
    """Mast above whose base it is. Without it: `position`; one of the two. E.g. mast"""
    height_m: NonNegative | None = None
    """Height above the mast's base; goes with `mast`. Without it: `position`. E.g. 120"""
    position: Position | None = None
    """Position of the target itself. Without it: `mast` and `height_m`. E.g. [447900, 6255300, 107]"""
