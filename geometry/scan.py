"""One scan, ray by ray: directions and times of its first pass, how passes follow, and its middle rays."""

import math
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from geometry.angles import wrap_360_deg
from geometry.arrays import FloatArray
from geometry.errors import InputError
from geometry.gates import require_positive
from geometry.sweeps import Motion, whole_steps

Kind = Literal["sector", "ppi", "rhi", "stare", "raster", "points"]

#: The fields of a scan that hold one number per ray.
_PER_RAY = ("azimuth_deg", "elevation_deg", "time_s", "swept_azimuth_deg", "swept_elevation_deg")


@dataclass(frozen=True, eq=False)
class Scan:
    """One pass of a scan, ray by ray, and how passes follow each other.

    Made by `sector`, `ppi`, `rhi`, `stare`, `raster` and `points`. The arrays are read-only.

    Raises
    ------
    InputError
        If the arrays are not one finite value per ray, or a duration is not positive.
    """

    kind: Kind
    azimuth_deg: FloatArray  # (ray,) middle of the ray, [0, 360), in the order of the first pass
    elevation_deg: FloatArray  # (ray,) middle of the ray, [-90, 90]
    time_s: FloatArray  # (ray,) middle of the ray since the start of the first pass
    swept_azimuth_deg: FloatArray  # (ray,) turn during the ray, signed, first pass; 0 where the head stands
    swept_elevation_deg: FloatArray  # (ray,) the same upwards
    accumulation_s: float  # duration of one ray
    period_s: float  # from the start of one pass to the start of the next: as declared, else as measured
    measured_period_s: float  # what head and accumulation give
    sweep_s: float  # from the start of the first ray to the end of the last one of a whole pass
    back_and_forth: bool = False  # odd passes run in reverse

    def __post_init__(self) -> None:
        for name in _PER_RAY:
            values = np.array(getattr(self, name), dtype=np.float64)
            if values.ndim != 1 or len(values) == 0 or not np.all(np.isfinite(values)):
                raise InputError(f"{name} of a scan must hold one finite number per ray and at least one ray")
            values.flags.writeable = False
            object.__setattr__(self, name, values)
        if len({len(getattr(self, name)) for name in _PER_RAY}) != 1:
            raise InputError("directions, times and sweeps of a scan must be equally many: one for each ray")
        for name in ("accumulation_s", "period_s", "measured_period_s", "sweep_s"):
            require_positive(name, getattr(self, name), "seconds")

    @property
    def count(self) -> int:
        """Number of rays of one pass."""
        return len(self.azimuth_deg)

    @property
    def asked_speed_deg_per_s(self) -> tuple[float, float]:
        """Azimuth and elevation speed that a ray's sweep within its accumulation asks of the head [deg/s].

        Where this is above what the head can do, the rays take longer than the accumulation.
        """
        azimuth = float(np.max(np.abs(self.swept_azimuth_deg))) / self.accumulation_s
        elevation = float(np.max(np.abs(self.swept_elevation_deg))) / self.accumulation_s
        return azimuth, elevation

    @property
    def azimuth_arc_deg(self) -> tuple[float, float]:
        """Start in [0, 360) and clockwise width of the smallest arc that the beam sweeps in plan [deg]."""
        starts = np.asarray(wrap_360_deg(self.azimuth_deg - 0.5 * np.abs(self.swept_azimuth_deg)))
        order = np.argsort(starts, kind="stable")
        starts, widths = starts[order], np.abs(self.swept_azimuth_deg)[order]
        reach = np.maximum.accumulate(starts + widths)
        reach = np.maximum(reach, reach[-1] - 360.0)  # a last ray that runs over north covers the first ones
        holes = np.append(starts[1:], starts[0] + 360.0) - reach
        widest = int(np.argmax(holes))
        width = min(360.0, 360.0 - float(holes[widest]))
        return float(starts[(widest + 1) % len(starts)]), width

    def ray_times_s(self, scans: int) -> FloatArray:
        """Give the middle time of every ray in consecutive passes.

        Parameters
        ----------
        scans : int
            Number of passes, at least 1.

        Returns
        -------
        array (scan, ray)
            Seconds since the start of the first pass. A column is one direction in every pass: in the
            reverse passes of a back-and-forth scan the times run backwards along the row.

        Raises
        ------
        InputError
            If the number of passes is under 1.

        Examples
        --------
        >>> from geometry.head import HeadLimits
        >>> from geometry.scans import sector
        >>> head = HeadLimits(50, 50, 100, 100)
        >>> scan = sector(0, 5, sector_deg=6, step_deg=2, accumulation_s=0.5, period_s=2, head=head)
        >>> scan.ray_times_s(3)
        array([[0.25, 0.75, 1.25],
               [3.25, 2.75, 2.25],
               [4.25, 4.75, 5.25]])
        """
        if scans < 1:
            raise InputError(f"{scans} passes of a scan were asked for: give 1 or more")
        passes = np.arange(scans)[:, None]
        reverse = (passes % 2 == 1) & self.back_and_forth
        return np.asarray(np.where(reverse, self.sweep_s - self.time_s, self.time_s) + self.period_s * passes)

    def scans_in(self, duration_s: float) -> int:
        """Number of whole periods in a time [s], for example in the 600 s of a ten-minute mean."""
        require_positive("duration_s", duration_s, "seconds")
        return math.floor(duration_s / self.period_s * (1.0 + 1e-12))  # 600 s hold 6000 periods of 0.1 s

    def subset(self, rays: slice) -> "Scan":
        """Keep some of the rays with their directions and times; period and turn-round stay the parent's.

        Raises
        ------
        InputError
            If no ray is left.
        """
        return replace(self, **{name: getattr(self, name)[rays] for name in _PER_RAY})


def middle_rays(count: int, keep: int) -> slice:
    """Give the middle rays of a scan in clockwise order; an extra ray is on the clockwise side.

    Raises
    ------
    InputError
        Unless 1 <= keep <= count.

    Examples
    --------
    >>> middle_rays(30, 5)
    slice(13, 18, None)
    """
    if not 1 <= keep <= count:
        raise InputError(f"{keep} middle rays of {count} were asked for: give 1 to {count}")
    start = (count - keep + 1) // 2
    return slice(start, start + keep)


def subset_rays(
    parent_rays: int, step_deg: float, sector_deg: float, *, motion: Motion = "continuous"
) -> slice:
    """Give the middle rays of a sector scan that stand for a smaller sector.

    Parameters
    ----------
    parent_rays : int
        Number of rays of the whole scan.
    step_deg : float
        Angle from one ray to the next [deg].
    sector_deg : float
        Size of the smaller sector [deg], a whole number of steps, at most the whole scan.
    motion : "continuous" or "step"
        How the parent moves: a continuous scan of N rays sweeps N steps, a step-stare scan N - 1.

    Returns
    -------
    slice
        Φ/Δ + 1 rays (the whole scan has no more than it has), the extra ray on the clockwise side.

    Raises
    ------
    InputError
        If the sector is no whole number of steps or larger than the scan.

    References
    ----------
    Simon, E. (2015), MSc thesis, DTU/Uppsala: sizes 60, 50 ... 4° as 30, 26 ... 3 middle rays of one scan.

    Examples
    --------
    >>> sizes = (60, 50, 44, 38, 30, 22, 14, 8, 4)
    >>> rays = [subset_rays(30, 2, size) for size in sizes]
    >>> [r.stop - r.start for r in rays]
    [30, 26, 23, 20, 16, 12, 8, 5, 3]
    """
    steps = whole_steps("sector_deg", sector_deg, step_deg)
    largest = parent_rays if motion == "continuous" else parent_rays - 1
    if steps > largest:
        scan_deg = largest * step_deg
        raise InputError(
            f"a sector of {sector_deg:g}° is larger than the scan of {scan_deg:g}°: give a smaller one"
        )
    return middle_rays(parent_rays, min(parent_rays, steps + 1))
