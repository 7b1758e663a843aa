"""What is predicted: the error of each sector size, or of a pair."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from reconstruct.prediction import Tier
from reconstruct.rays import Rays

SCAN_FIELDS = ("speed_bias_mps", "speed_std_mps", "direction_bias_deg", "direction_std_deg")
MEAN_FIELDS = (
    "mean10_speed_bias_mps",
    "mean10_speed_std_mps",
    "mean10_direction_std_deg",
    "slope",
    "slope_std",  # of the slope, from errors that stay for the whole campaign
    "residual_std_mps",
    "direction_residual_std_deg",
    "direction_offset_std_deg",  # from errors that stay for the whole campaign
)


@dataclass(frozen=True)
class SizeError:
    """What one sector size, or one pair, will measure; a number that the tier cannot know is None, with its reason."""

    sector_deg: float | None  # None for a pair
    rays: int
    scans_per_10min: int
    period_s: float
    range_m: float  # of the gate at the target
    condition: float | None
    values: Mapping[str, float | None]  # SCAN_FIELDS and MEAN_FIELDS
    reasons: Mapping[str, str] = field(default_factory=dict)
    standard_errors: Mapping[str, float] = field(default_factory=dict)  # of values drawn by chance

    def as_dict(self) -> dict[str, object]:
        """The numbers by name, as `lidarplan errors --json` prints them."""
        return {
            "sector_deg": self.sector_deg,
            "rays": self.rays,
            "scans_per_10min": self.scans_per_10min,
            "condition": self.condition,
            **self.values,
            "reasons": dict(self.reasons),
            **({"standard_errors": dict(self.standard_errors)} if self.standard_errors else {}),
        }


@dataclass(frozen=True)
class ErrorCurve:
    """The predicted error of one scan (or pair) at one target, by one tier."""

    scan: str  # the scan's name, or the pair's
    lidar: str | None  # None for a pair
    target: str
    tier: Tier
    reference: str
    states: int
    sizes: tuple[SizeError, ...]  # widest first


@dataclass(frozen=True)
class Size:
    """One size: its rays, and which rays of which whole scan they are."""

    sector_deg: float | None
    rays: Rays
    whole: Rays
    kept: slice
    scans: int
