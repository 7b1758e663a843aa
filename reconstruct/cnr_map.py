"""A map of carrier-to-noise ratio around a hard target: rays over azimuth and elevation, gates 1 m apart."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from geometry.angles import circular_mean_deg, difference_deg, wrap_360_deg
from geometry.arrays import FloatArray
from geometry.errors import InputError
from reconstruct.records import Records

MIN_RAYS = 9  # three by three: less has no inside
MIN_GATES = 5

# Angles of one row or column differ by less than this part of the window; farther apart is the next one. Many rays lie
# closer than that without sharing any angle (42,525 staggered ones: 2e-5): a tenth of their even spacing is the same then.
SAME_SHARE = 1e-4
SAME_SPACING = 0.1

ROW_RAYS = 3  # rows and columns are told by angles that so many rays share


@dataclass(frozen=True, eq=False)
class CnrMap:
    """Carrier-to-noise ratio of many rays, in the angles and ranges that the instrument states.

    Raises
    ------
    InputError
        If the shapes do not belong together, or the map has too few rays or gates to have an inside.

    Examples
    --------
    >>> azimuth_deg, elevation_deg = (each.ravel() for each in np.meshgrid([359.0, 0.0, 1.0], [4.0, 5.0, 6.0]))
    >>> found = CnrMap(azimuth_deg, elevation_deg, np.arange(990.0, 1011.0), np.full((9, 21), -25.0))
    >>> found.middle_deg, found.step_deg
    ((0.0, 5.0), (1.0, 1.0))
    """

    azimuth_deg: FloatArray  # (ray,) as the head counts, any number of turns
    elevation_deg: FloatArray  # (ray,)
    range_m: FloatArray  # (gate,) increasing, as the instrument states it
    cnr_db: FloatArray  # (ray, gate); NaN where missing

    def __post_init__(self) -> None:
        for name in ("azimuth_deg", "elevation_deg", "range_m", "cnr_db"):
            object.__setattr__(self, name, np.asarray(getattr(self, name), dtype=np.float64))
        rays, gates = self.azimuth_deg.size, self.range_m.size
        shapes = (self.azimuth_deg.shape, self.elevation_deg.shape, self.range_m.shape, self.cnr_db.shape)
        if shapes != ((rays,), (rays,), (gates,), (rays, gates)):
            raise InputError(
                f"a CNR map with arrays of {shapes} came; allowed: (ray,), (ray,), (gate,), (ray, gate)"
            )
        if rays < MIN_RAYS or gates < MIN_GATES:
            raise InputError(
                f"a CNR map of {rays} rays and {gates} gates came; allowed: {MIN_RAYS} rays and {MIN_GATES} "
                "gates or more"
            )
        angles_known = np.all(np.isfinite(self.azimuth_deg)) and np.all(np.isfinite(self.elevation_deg))
        if not (angles_known and np.all(np.diff(self.range_m) > 0)):
            raise InputError("a CNR map needs finite angles and ranges that increase from gate to gate")

    @cached_property
    def middle_deg(self) -> tuple[float, float]:
        """Azimuth in [0, 360) and elevation in the middle of the window [deg]."""
        mean_deg = float(circular_mean_deg(self.azimuth_deg))
        aside = difference_deg(self.azimuth_deg, mean_deg)
        middle = float(wrap_360_deg(mean_deg + 0.5 * (aside.min() + aside.max())))
        return middle, float(0.5 * (self.elevation_deg.min() + self.elevation_deg.max()))

    @cached_property
    def aside_deg(self) -> tuple[FloatArray, FloatArray]:
        """(ray,) azimuth and elevation less those of the middle [deg]."""
        azimuth, elevation = self.middle_deg
        return np.asarray(difference_deg(self.azimuth_deg, azimuth)), self.elevation_deg - elevation

    @cached_property
    def step_deg(self) -> tuple[float, float]:
        """Usual distance between neighbouring columns and rows [deg]; of staggered rays what a ray has to itself."""
        across, up = self.aside_deg
        (wide, columns), (high, rows) = _step(across), _step(up)
        rays, spans = across.size, (float(np.ptp(across)), float(np.ptp(up)))
        if columns * ROW_RAYS > rays and rows * ROW_RAYS > rays:  # no ray shares an angle with another
            flat = float(np.cos(np.deg2rad(self.middle_deg[1])))
            step = _even_step(spans[0] * flat, spans[1], rays)
            return step / flat, step
        if columns * ROW_RAYS > rays:
            return spans[0] / max(rays / rows - 1.0, 1.0), high
        if rows * ROW_RAYS > rays:
            return wide, spans[1] / max(rays / columns - 1.0, 1.0)
        return wide, high

    @property
    def gate_m(self) -> float:
        """Distance from gate to gate [m]."""
        return float(np.median(np.diff(self.range_m)))

    def between_m(self, near_m: float, far_m: float) -> "CnrMap":
        """The same map with the gates between two ranges only."""
        kept = (self.range_m >= near_m) & (self.range_m <= far_m)
        return CnrMap(self.azimuth_deg, self.elevation_deg, self.range_m[kept], self.cnr_db[:, kept])


def map_of(records: Records) -> CnrMap:
    """Take the map out of measured rays, in the head's own angles.

    Raises
    ------
    InputError
        If no CNR is known.
    """
    if not np.any(np.isfinite(records.cnr_db)):
        raise InputError("these rays have no CNR: a hard target cannot be found by radial speed")
    return CnrMap(records.azimuth_deg, records.elevation_deg, records.range_m, records.cnr_db)


def _step(angle_deg: FloatArray) -> tuple[float, int]:
    """Median distance between neighbouring values, and how many there are; those of one row are taken for one."""
    ordered = np.unique(angle_deg)
    span = float(ordered[-1] - ordered[0])
    gaps = np.diff(ordered)
    gaps = gaps[gaps > min(SAME_SHARE, SAME_SPACING / angle_deg.size) * span]
    return (float(np.median(gaps)) if gaps.size else 0.0), gaps.size + 1


def _even_step(width_deg: float, height_deg: float, rays: int) -> float:
    """The step with which so many rays fill a window evenly: (width + step)(height + step) = rays step²."""
    half = 0.5 * (width_deg + height_deg) / (rays - 1)
    return float(half + np.sqrt(half**2 + width_deg * height_deg / (rays - 1)))
