"""Write the made-up terrain of the Scotland example: `python examples/scotland/make_terrain.py` writes terrain.tif beside it.

No height model of the place is used. The ground is a sum of round hills whose heights are fitted so that it passes near
what the site file says: 2 m below the heads of the lidars, `UNDER_TARGETS_M` below the points. A seeded ripple of a few
metres makes it less smooth than any formula. WGS 84 / UTM zone 30N with heights above mean sea level (ODN, Newlyn).
"""

import sys
from pathlib import Path

import numpy as np
from ruamel.yaml import YAML

from geometry.arrays import FloatArray
from planner.files.raster import write_geotiff

HERE = Path(__file__).resolve().parent
CRS = (
    "EPSG:32630+5701"  # UTM 30N with Ordnance Datum Newlyn: the file says itself what its heights count from
)
WEST_M, EAST_M, SOUTH_M, NORTH_M, CELL_M = 533_500.0, 538_500.0, 6_181_000.0, 6_186_000.0, 25.0

UNDER_HEADS_M = 2.0
UNDER_TARGETS_M = 50.0  # assumed: nothing says how high above the ground the points are
HILL_M = 450.0  # standard width of a hill
LOOSE = (
    0.05  # how loosely the ground follows the points, as a share of a hill's height squared; the heads firmly
)
RIPPLES, RIPPLE_M, SEED = 60, 2.5, 30


def anchors_m() -> tuple[FloatArray, FloatArray]:
    """Points (n, 3) that the ground should pass, and how loosely (n,)."""
    site = YAML(typ="safe").load(HERE / "site.yaml")  # not as a site: that one asks for the raster
    heads = np.array([lidar["position"] for lidar in site["lidars"]]) - [0.0, 0.0, UNDER_HEADS_M]
    points = np.array([target["position"] for target in site["targets"]]) - [0.0, 0.0, UNDER_TARGETS_M]
    return np.vstack([heads, points]), np.repeat([1e-6, LOOSE], [len(heads), len(points)])


def ripple_m(east_m: FloatArray, north_m: FloatArray) -> FloatArray:
    """Waves of 150 to 800 m in all directions, of `RIPPLE_M` standard deviation together [m]."""
    rng = np.random.default_rng(SEED)
    length, turn, phase = rng.uniform([150, 0, 0], [800, np.pi, 2 * np.pi], (RIPPLES, 3)).T
    total = np.zeros(np.broadcast_shapes(east_m.shape, north_m.shape))
    for wave, angle, start in zip(2 * np.pi / length, turn, phase, strict=True):
        along = (east_m - WEST_M) * np.sin(angle) + (north_m - SOUTH_M) * np.cos(angle)
        total += np.cos(wave * along + start)
    return np.asarray(RIPPLE_M * np.sqrt(2 / RIPPLES) * total)


def heights_m(east_m: FloatArray, north_m: FloatArray) -> FloatArray:
    """The ground [m] at places of broadcast shapes."""
    anchors, loose = anchors_m()

    def hills(east: FloatArray, north: FloatArray) -> FloatArray:
        apart = [(east[..., None] - anchors[:, 0]) ** 2, (north[..., None] - anchors[:, 1]) ** 2]
        return np.asarray(np.exp(-sum(apart) / (2 * HILL_M**2)))

    base = anchors[:, 2].min()
    wanted = anchors[:, 2] - base - ripple_m(*anchors[:, :2].T)
    weight = np.linalg.solve(hills(*anchors[:, :2].T) + np.diag(loose), wanted)
    return np.asarray(base + hills(east_m, north_m) @ weight + ripple_m(east_m, north_m))


def main() -> int:
    """Write the raster; tell how near it passes."""
    east, north = (
        np.arange(low + CELL_M / 2, high, CELL_M) for low, high in ((WEST_M, EAST_M), (SOUTH_M, NORTH_M))
    )
    north = north[::-1]
    ground = heights_m(east[None], north[:, None]).round(1)
    write_geotiff(HERE / "terrain.tif", {"height": ground}, east, north, CRS)
    anchors, _ = anchors_m()
    off = heights_m(*anchors[:, :2].T) - anchors[:, 2]
    sys.stdout.write(
        f"terrain.tif: {ground.shape[0]} x {ground.shape[1]} cells of {CELL_M:g} m, {ground.min():.0f} to "
        f"{ground.max():.0f} m; off the points by {off.std():.1f} m (standard deviation), {np.abs(off).max():.1f} m at most\n"
    )
    return 0


if __name__ == "__main__":
    sys.exit(main())
