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
    pitch_deg: Number = 0.0
    roll_deg: Number = 0.0
    range_offset_m: Number = 0.0


class Uncertainty(Noun):
    """Standard deviations (k = 1) of one lidar; a correlation is the one between the rays of a scan."""

    position_m: NonNegative = 0.1  # differential GPS
    heading_deg: NonNegative = 0.05  # after hard-target mapping
    levelling_deg: NonNegative = 0.03
    azimuth_deg: NonNegative = 0.05
    elevation_deg: NonNegative = 0.05
    range_m: NonNegative = 5.0
    radial_speed_mps: NonNegative | None = None  # default: the instrument's
    radial_speed_relative: NonNegative = 0.0
    clock_s: NonNegative = 0.0  # against the other lidars of a pair
    azimuth_correlation: Share = 0.0
    elevation_correlation: Share = 0.0
    range_correlation: Share = 0.0
    radial_speed_correlation: Share = 0.0


class Signal(Noun):
    """How strong the echo is: CNR of one pulse at one range, in the site's air. Noise then follows from range and pulses."""

    cnr_db: Number
    range_m: Positive
    pulse_ns: Positive | None = None  # with which it was seen; default: the scan's own
    extinction_per_m: NonNegative = 1e-4  # clear lowland air, 40 km visibility
    least_cnr_db: Number = (
        -25.0
    )  # below it a ray is thrown away; the usual filter of the reference study's scanners
    spread_db: Positive = 3.0  # of the CNR from hour to hour


def _instrument_tag(value: object) -> str:
    return "<catalogue>" if isinstance(value, str) else "<inline>"


class Lidar(Noun):
    """A scanning lidar on its spot; pointing angle = head angle + offset, after the mounting rotation."""

    name: Name
    position: Position  # of the scanner head
    instrument: Annotated[
        Annotated[Name, Tag("<catalogue>")] | Annotated[Instrument, Tag("<inline>")],
        Discriminator(_instrument_tag),
    ]
    north: North = "true"  # where the head's zero points before heading and offset
    azimuth_offset_deg: Number = 0.0
    elevation_offset_deg: Number = 0.0
    mounting: Mounting = Mounting()
    uncertainty: Uncertainty = Uncertainty()
    signal: Signal | None = None

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
    position: Position
    height_m: Positive
    width_m: Positive = 1.0
    speed_uncertainty_mps: NonNegative | None = (
        None  # of its ten-minute means (k = 1), for the uncertainty budget
    )
    direction_uncertainty_deg: NonNegative | None = None


class Turbine(Noun):
    """A wind turbine; `position` is its base."""

    name: Name
    position: Position
    hub_height_m: Positive
    rotor_diameter_m: Positive
    tower_diameter_m: Positive = 4.0
    thrust_coefficient: Annotated[float, Field(strict=True, ge=0, lt=1)] = 0.8


class Obstacle(Noun):
    """A building or a row of trees: a box on its base."""

    name: Name
    position: Position  # centre of the base
    width_m: Positive
    length_m: Positive
    height_m: Positive
    azimuth_deg: Number = 0.0  # of its length, clockwise from grid north


class HardTarget(Noun):
    """Something solid to find the pointing offsets with: on a mast, or at a position of its own."""

    name: Name
    on: Name | None = None
    position: Position | None = None
    height_m: NonNegative | None = None  # above the mast's base; default: the mast's top
    shape: Literal["tip", "boom", "mast"]
    size_m: Positive
    uncertainty_m: NonNegative


class Target(Noun):
    """A point to be measured: at a height above a mast's base, or at a position of its own."""

    name: Name
    mast: Name | None = None
    height_m: NonNegative | None = None
    position: Position | None = None
