"""The kinds of scan: sector, full PPI, RHI, stare, raster and list of points, each as a `Scan`.

A scan's first pass runs clockwise (an RHI from its first elevation to its second). What follows it is its
`sweep`:

- `back_and_forth`: the next pass measures the same rays in reverse; a moving head turns round in between;
- `reset`: the head runs back at full speed and the next pass is a copy of the first;
- `forward`: the head goes round on, clockwise, at full speed to where the scan began.

A `continuous` scan turns at constant speed while it measures: a sector of Φ in steps of Δ has Φ/Δ rays, their
middles half a step inside the ends. A `step` scan stands still for each ray: Φ/Δ + 1 rays with one at each
end.
"""

from geometry.scan import Kind, Scan, middle_rays, subset_rays
from geometry.scan_fans import ppi, rhi, sector
from geometry.scan_grids import points, raster, stare
from geometry.sweeps import Motion, Sweep

__all__ = [
    "Kind",
    "Motion",
    "Scan",
    "Sweep",
    "middle_rays",
    "points",
    "ppi",
    "raster",
    "rhi",
    "sector",
    "stare",
    "subset_rays",
]
