"""What else was measured beside the rays, and what it is used for: attitude logs, sonics, clocks. Validated nouns only."""

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from planner.nouns import Name, NonNegative, Noun, Number, Positive

Angle = Literal["heading_deg", "pitch_deg", "roll_deg"]


class AttitudeReference(Noun):
    """What the log showed while the mounting of the site file held, such as during the hard-target mapping."""

    heading_deg: Number = 0.0
    """Logged heading. E.g. 321.4"""
    pitch_deg: Number = 0.0
    """Logged pitch. E.g. 0.1"""
    roll_deg: Number = 0.0
    """Logged roll. E.g. -0.05"""


class Attitude(Noun):
    """How the lidar stood while it measured: a log of heading, pitch and roll, of the rays' own files or of another."""

    use: Literal["changes", "absolute", "off"] = "changes"
    """What turns the rays: the log's changes from its reference, on top of the site's mounting; the logged angles in
    place of the mounting's (heading from true north); or nothing (off). E.g. absolute"""
    smooth_s: NonNegative = 600.0
    """Running mean of the log: a compass scatters by a degree from sample to sample. 0: as logged, for a lidar that
    moves. E.g. 0"""
    reference: AttitudeReference | None = None
    """From where changes count. Without it: the log's first ten minutes, or `smooth_s` if that is longer."""
    factors: dict[Angle, Number] = Field(default_factory=dict)
    """Factors on what is logged, where its sign is another: heading is clockwise, pitch nose up, roll right side down.
    E.g. {pitch_deg: -1}"""
    path: Annotated[str, Field(min_length=1)] | None = None
    """CSV of the log. Without it: what the rays' files hold. E.g. inclinometer.csv"""
    time: Name = "time_utc"
    """Column of the log's times, ISO 8601 in UTC. E.g. TIMESTAMP"""
    heading: Name = "heading_deg"
    """Column of the heading; one of the three is needed. E.g. Yaw"""
    pitch: Name = "pitch_deg"
    """Column of the pitch. E.g. Tilt"""
    roll: Name = "roll_deg"
    """Column of the roll. E.g. Roll"""
    separator: Annotated[str, Field(min_length=1, max_length=1)] = ","
    """What stands between two columns. E.g. ';'"""


class TimeLag(Noun):
    """Clocks set by correlation: each lidar's rays are moved to where they agree best with a mast's wind."""

    against: Literal["mast", "none"] = "none"
    """What the lidars are compared with. E.g. mast"""
    longest_s: Positive = 60.0
    """Longest lag that is looked for, either way. E.g. 300"""


class SonicInput(Noun):
    """A sonic where a scan's beam meets its target: its orientation is trimmed by what the beam measured."""

    name: Name
    """Of the sonic, in tables. E.g. right"""
    scan: Name
    """Scan whose rays it is compared with. E.g. beam right"""
    path: Annotated[str, Field(min_length=1)]
    """CSV of its wind: eastward and northward, or speed and direction. E.g. sonic_right.csv"""
    time: Name = "time_utc"
    """Column of the times, ISO 8601 in UTC. E.g. TIMESTAMP"""
    east: Name | None = None
    """Column of the eastward wind. Without it: `speed` and `direction`. E.g. u"""
    north: Name | None = None
    """Column of the northward wind. Without it: `speed` and `direction`. E.g. v"""
    speed: Name = "speed_mps"
    """Column of the speed. E.g. U"""
    direction: Name = "from_deg"
    """Column of the direction that the wind comes from. E.g. dir"""
    separator: Annotated[str, Field(min_length=1, max_length=1)] = ","
    """What stands between two columns. E.g. ';'"""
    longest_lag_s: NonNegative = 10.0
    """Longest lag of its clock that is looked for before it is compared. E.g. 60"""

    @model_validator(mode="after")
    def _both_components(self) -> Self:
        if (self.east is None) != (self.north is None):
            raise ValueError("both `east` and `north`, or `speed` and `direction`")
        return self
