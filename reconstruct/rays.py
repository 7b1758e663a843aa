"""The rays that one retrieval combines into one wind vector: a sector scan, or the stares of two or three lidars."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from geometry.arrays import FloatArray, IntArray
from geometry.beams import unit_vector
from geometry.errors import InputError
from geometry.gates import Probe

_FLOATS = (
    "azimuth_deg",
    "elevation_deg",
    "range_m",
    "head_m",
    "time_s",
    "duration_s",
    "swept_azimuth_deg",
)


@dataclass(frozen=True)
class Rays:
    """Rays that one least-squares fit combines, seen from the target.

    The frame is east, north, up in metres with its origin at the target, the place whose wind is wanted. Azimuths are
    clockwise from true north, elevations above the horizontal at the head, ranges slant from the head.

    Raises
    ------
    InputError
        If the arrays do not have one finite value per ray, there is no ray, or a lidar has no probe.

    Examples
    --------
    >>> rays = Rays(azimuth_deg=np.array([85.0, 90.0, 95.0]), elevation_deg=np.zeros(3), range_m=np.full(3, 1000.0),
    ...             head_m=np.tile([-1000.0, 0.0, 0.0], (3, 1)), lidar=np.zeros(3, dtype=int), time_s=np.array([0.2, 0.6, 1.0]),
    ...             duration_s=np.full(3, 0.4), swept_azimuth_deg=np.full(3, 5.0), probes=(Probe(pulse_ns=200, window_ns=256),),
    ...             period_s=1.2)
    >>> rays.centre_m.round(1) + 0.0
    array([[ -3.8,  87.2,   0. ],
           [  0. ,   0. ,   0. ],
           [ -3.8, -87.2,   0. ]])
    """

    azimuth_deg: FloatArray  # (ray,)
    elevation_deg: FloatArray  # (ray,)
    range_m: FloatArray  # (ray,) centre of the gate that is used
    head_m: FloatArray  # (ray, 3) scanner head of each ray, relative to the target
    lidar: IntArray  # (ray,) index of the lidar: rays of one lidar share its heading, levelling and position errors
    time_s: FloatArray  # (ray,) middle of the ray since the start of the scan
    duration_s: FloatArray  # (ray,) accumulation
    swept_azimuth_deg: FloatArray  # (ray,) how far the head turns during the ray, signed, clockwise positive; 0 when it stands
    probes: tuple[Probe, ...]  # one for each lidar
    period_s: float  # from the start of one scan to the start of the next
    back_and_forth: bool = False  # every second scan runs through the same azimuths in reverse
    sweep_s: float | None = (
        None  # of the whole pass, start to end, rays left out included; default: these rays
    )
    columns: Literal[2, 3] = 2  # of the fit: u and v, or w too

    def __post_init__(self) -> None:
        shapes = {name: np.shape(getattr(self, name))[:1] for name in (*_FLOATS, "lidar")}
        if len(set(shapes.values())) != 1:
            raise InputError(f"every array of Rays needs one value per ray, but their lengths are {shapes}")
        if shapes["lidar"] == (0,):
            raise InputError("Rays came without any ray: give one at least")
        for name in _FLOATS:  # widened, so that float32 loses nothing more
            values = np.asarray(getattr(self, name), dtype=float)
            if not np.all(np.isfinite(values)):
                raise InputError(
                    f"{name} of Rays holds a number that is not finite: leave a ray out that is missing"
                )
            object.__setattr__(self, name, values)
        if int(np.max(self.lidar)) >= len(self.probes):
            raise InputError(
                f"Rays name lidar {int(np.max(self.lidar))}, but there are {len(self.probes)} probes: "
                "give one probe for each lidar"
            )

    @property
    def count(self) -> int:
        """Number of rays."""
        return len(self.azimuth_deg)

    @property
    def centre_m(self) -> FloatArray:
        """(ray, 3) centre of each ray's gate, relative to the target [m]."""
        return self.head_m + self.range_m[:, None] * unit_vector(self.azimuth_deg, self.elevation_deg)

    @property
    def reversed_time_s(self) -> FloatArray:
        """(ray,) middle time of each ray in a pass that runs backwards, since the start of that pass [s]."""
        kept_only = float(np.min(self.time_s) + np.max(self.time_s))
        return (kept_only if self.sweep_s is None else self.sweep_s) - self.time_s

    def times_s(self, scans: int) -> FloatArray:
        """(scan, ray) middle time of each ray in that many consecutive scans [s].

        Columns stay in the order of the first scan's azimuths; in a back-and-forth scan the odd rows run backwards, a
        mirror of the whole pass: the turn-round that follows is inside `period_s`. Where only some of the rays of a pass
        are kept, `sweep_s` says how long the whole pass is: the mirror is not in the middle of those kept.
        """
        odd = (np.arange(scans) % 2 == 1) & self.back_and_forth
        one_scan = np.where(odd[:, None], self.reversed_time_s, self.time_s)
        return np.asarray(one_scan + self.period_s * np.arange(scans)[:, None])
