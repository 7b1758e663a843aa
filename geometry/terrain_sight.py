"""Beams over a height raster: how far they clear the ground, and where they are not known to.

Over the raster a beam is straight but for the Earth, whose surface falls away under it, and for refraction, which bends
it back. What lies outside the raster, or in a hole of it, is unknown, never clear.
"""

from typing import NamedTuple

import numpy as np

from geometry.arrays import ArrayLike, BoolArray, FloatArray
from geometry.earth import EARTH_RADIUS_M, REFRACTION_COEFFICIENT
from geometry.errors import InputError
from geometry.terrain import HeightRaster

CHUNK = 2**20  # samples that are worked on at once


class TerrainSight(NamedTuple):
    """How beams clear the ground."""

    clearance_m: FloatArray  # (..., gate) least height above the ground from the head to the gate; negative: through it
    distance_m: FloatArray  # (..., gate) level distance from the head where it is least
    blocked: BoolArray  # (..., gate) the ground is in the way
    unknown: BoolArray  # (..., gate) not blocked as far as is known, but part of the way has no height
    entry_m: FloatArray  # (..., gate) level distance from the head where it first meets the ground; NaN if it does not
    pass_m: FloatArray  # (..., gate) height above the ground where, up to the gate, it passes it nearest as seen from the head


class Pass(NamedTuple):
    """Where beams come nearest to the ground, as seen from the head."""

    clearance_m: FloatArray  # (...,) height above the ground there; negative: below it
    distance_m: FloatArray  # (...,) level distance from the head


def beam_height_m(
    head_height_m: ArrayLike,
    elevation_deg: ArrayLike,
    distance_m: ArrayLike,
    *,
    refraction: float = REFRACTION_COEFFICIENT,
) -> FloatArray:
    """Height of a beam above the datum.

    Parameters
    ----------
    head_height_m
        Height of the scanner head above the datum [m].
    elevation_deg
        Elevation of the beam where it leaves the head [deg].
    distance_m
        Level distance from the head [m]; the shapes broadcast.
    refraction
        Share of the Earth's curvature by which the beam bends down; 0 for a straight line.

    Returns
    -------
    FloatArray
        Height [m].

    Notes
    -----
    h + d tan φ + (1 - k) d²/2R: `geometry.earth.curvature_drop_m` less `refraction_lift_m`.

    Examples
    --------
    >>> beam_height_m(0.0, 0.0, [1000.0, 6000.0]).round(2).tolist()
    [0.07, 2.46]
    """
    distance = np.asarray(distance_m, dtype=np.float64)
    rise = np.tan(np.deg2rad(np.asarray(elevation_deg, dtype=np.float64)))
    return np.asarray(np.asarray(head_height_m, np.float64) + distance * rise + bulge_m(distance, refraction))


def terrain_sight(
    raster: HeightRaster,
    head_m: ArrayLike,
    end_m: ArrayLike,
    *,
    shares: ArrayLike = (1.0,),
    refraction: float = REFRACTION_COEFFICIENT,
) -> TerrainSight:
    """Clearance of beams above the ground, from the head to each of some gates on the way.

    Parameters
    ----------
    raster
        Heights of the ground, with what stands on it where that counts.
    head_m
        Heads, easting, northing, height [m], shape (..., 3), in the raster's CRS and datum.
    end_m
        Far ends of the beams, the same; the shapes broadcast.
    shares
        (gate,) where the gates are, as ascending shares of the level distance to the end; 1 is the end.
    refraction
        Share of the Earth's curvature by which the beam bends down.

    Returns
    -------
    TerrainSight
        Of shape (..., gate). Clearance is NaN where no height is known on the whole way.

    Raises
    ------
    InputError
        If the shares are not ascending between 0 and 1.

    Notes
    -----
    Between head and end the straight line lies d (D - d) (1 - k) / 2R lower over the curved datum than the chord of the
    two heights. The ground is bilinear between the middles of cells, and sampled wherever a beam
    crosses a line through them, and half way between: its ridges are met exactly. In between it may bulge above what is
    sampled by up to a sixteenth of a cell's twist, the height of one corner over the plane of the other three.

    Examples
    --------
    A wall 20 m high half way between two points 10 m above the plain.

    >>> ground = np.zeros((3, 11))
    >>> ground[:, 5] = 20.0
    >>> wall = HeightRaster(ground, 0.0, 300.0, 100.0, 100.0, "above_sea_level")
    >>> sight = terrain_sight(wall, [50.0, 150.0, 10.0], [1050.0, 150.0, 10.0], shares=[0.3, 1.0])
    >>> sight.clearance_m.round(1).tolist(), sight.blocked.tolist()
    ([10.0, -10.0], [False, True])
    >>> sight.entry_m.round(0).tolist()
    [nan, 450.0]
    >>> terrain_sight(wall, [50.0, 150.0, 99.0], [2000.0, 150.0, 99.0]).unknown.tolist()
    [True]
    """
    gates = np.asarray(shares, dtype=np.float64)
    if gates.ndim != 1 or gates.size == 0 or np.any(np.diff(gates) < 0) or gates[0] <= 0 or gates[-1] > 1:
        raise InputError(
            f"gates at the shares {gates.tolist()} came; allowed are ascending shares over 0, up to 1"
        )
    head, end = np.broadcast_arrays(np.asarray(head_m, np.float64), np.asarray(end_m, np.float64))
    shape = head.shape[:-1]
    head, end = head.reshape(-1, 3), end.reshape(-1, 3)
    step = max(CHUNK // max(int(np.sum(_cells_crossed(raster, head, end)).max(initial=1)), 1), 1)
    slices = [slice(start, start + step) for start in range(0, max(len(head), 1), step)]
    parts = [_sight(raster, head[part], end[part], gates, refraction) for part in slices]
    joined = (np.concatenate([part[i] for part in parts]).reshape(*shape, gates.size) for i in range(5))
    least, where, complete, entry, passed = joined
    blocked = np.asarray(least < 0.0)
    return TerrainSight(least, where, blocked, ~blocked & ~complete.astype(bool), entry, passed)


def nearest_pass(
    raster: HeightRaster, head_m: ArrayLike, end_m: ArrayLike, *, refraction: float = REFRACTION_COEFFICIENT
) -> Pass:
    """Find where beams come nearest to the ground, as an angle seen from the head.

    Every beam is near to the ground where it leaves a head that stands on it; what tells whether a ridge is
    in the way, and how much higher the beam would have to be aimed, is that angle.

    Parameters
    ----------
    raster, head_m, end_m, refraction
        As for `terrain_sight`; shapes (..., 3).

    Returns
    -------
    Pass
        Of shape (...,); NaN where no height is known.

    Examples
    --------
    >>> ground = np.zeros((3, 11))
    >>> ground[:, 5] = 20.0
    >>> wall = HeightRaster(ground, 0.0, 300.0, 100.0, 100.0, "above_sea_level")
    >>> near = nearest_pass(wall, [50.0, 150.0, 2.0], [1050.0, 150.0, 62.0])
    >>> near.clearance_m.round(1).tolist(), near.distance_m.round(0).tolist()
    (12.0, 500.0)
    """
    head, end = np.broadcast_arrays(np.asarray(head_m, np.float64), np.asarray(end_m, np.float64))
    shape = head.shape[:-1]
    share, above, span = _heights_above(
        raster, head.reshape(-1, 3), end.reshape(-1, 3), np.ones(1), refraction
    )
    distance = share * span[:, None]
    slope = _slope(above, distance)
    nearest = np.argmin(slope, axis=1)[:, None]
    clear, where = (np.take_along_axis(values, nearest, axis=1)[:, 0] for values in (above, distance))
    return Pass(clear.reshape(shape), np.where(np.isnan(clear), np.nan, where).reshape(shape))


def _slope(above: FloatArray, distance: FloatArray) -> FloatArray:
    """How steeply the ground lies below samples of beams, as seen from the head: tangents; inf where it is not known."""
    with np.errstate(divide="ignore", invalid="ignore"):
        slope = above / distance  # a head on the ground itself: 0/0
    return np.where(np.isnan(slope), np.inf, slope)


def _sight(
    raster: HeightRaster, head: FloatArray, end: FloatArray, gates: FloatArray, refraction: float
) -> tuple[FloatArray, FloatArray, BoolArray, FloatArray, FloatArray]:
    """Least clearance, where, whether every height is known, where the ground is met, nearest pass: (beam, gate) each."""
    share, above, span = _heights_above(raster, head, end, gates, refraction)
    entry = span * _first_below(share, above)
    least, where, complete, passed = (np.empty((len(head), gates.size)) for _ in range(4))
    slope = _slope(above, share * span[:, None])
    for number, gate in enumerate(gates):
        upto = np.where((share <= gate) & ~np.isnan(above), above, np.inf)
        lowest = np.argmin(upto, axis=1)[:, None]
        least[:, number] = np.take_along_axis(upto, lowest, axis=1)[:, 0]
        where[:, number] = span * np.take_along_axis(share, lowest, axis=1)[:, 0]
        complete[:, number] = ~np.any((share <= gate) & np.isnan(above), axis=1)
        nearest = np.argmin(np.where(share <= gate, slope, np.inf), axis=1)[:, None]
        passed[:, number] = np.take_along_axis(above, nearest, axis=1)[:, 0]
    met = np.where(least < 0.0, entry[:, None], np.nan)
    return np.where(np.isinf(least), np.nan, least), where, complete.astype(bool), met, passed


def _heights_above(
    raster: HeightRaster, head: FloatArray, end: FloatArray, gates: FloatArray, refraction: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Ascending shares of the way and heights above the ground there (beam, sample), and the level distance (beam,)."""
    share = _crossings(raster, head, end, gates)
    points = head[:, None] + share[..., None] * (end - head)[:, None]
    span = np.hypot(*(end - head)[:, :2].T)
    bulge = 4.0 * share * (1.0 - share) * bulge_m(0.5 * span, refraction)[:, None]
    return share, points[..., 2] - bulge - raster.heights_m(points[..., 0], points[..., 1]), span


def _first_below(share: FloatArray, above: FloatArray) -> FloatArray:
    """(beam,) share of the way where the beam first goes below the ground, linear between samples; NaN if nowhere."""
    below = above < 0.0
    first = np.argmax(below, axis=1)[:, None]
    before = np.maximum(first - 1, 0)
    (low, high), (up, down) = (
        tuple(np.take_along_axis(values, index, axis=1)[:, 0] for index in (before, first))
        for values in (share, above)
    )
    with np.errstate(divide="ignore", invalid="ignore"):
        part = np.where(np.isfinite(up) & (up > down), np.clip(up / (up - down), 0.0, 1.0), 1.0)
    return np.where(below.any(axis=1), low + part * (high - low), np.nan)


def _cells_crossed(raster: HeightRaster, head: FloatArray, end: FloatArray) -> FloatArray:
    """(2, beam) how many lines through the middles of cells each beam crosses, running north and running east."""
    east, north = np.abs(end - head)[:, :2].T
    return np.asarray(np.ceil(np.stack([east / raster.cell_east_m, north / raster.cell_north_m])) + 1.0)


def _crossings(raster: HeightRaster, head: FloatArray, end: FloatArray, gates: FloatArray) -> FloatArray:
    """(beam, sample) ascending shares of the way: both ends, the gates, every line through the middles of cells, halves.

    On those lines lie the edges of the bilinear ground, and so its ridges.
    """
    counts = _cells_crossed(raster, head, end).max(axis=1, initial=1).astype(int)
    shares = [np.zeros((len(head), 1)), np.broadcast_to(gates, (len(head), gates.size))]
    sizes, corner = (raster.cell_east_m, -raster.cell_north_m), (raster.west_m, raster.north_m)
    for axis, (size, first, count) in enumerate(zip(sizes, corner, counts, strict=True)):
        start = (head[:, axis] - first) / size - 0.5
        along = (end[:, axis] - head[:, axis]) / size
        forward = np.sign(along)
        lines = np.where(forward > 0, np.floor(start), np.ceil(start))[:, None] + forward[:, None] * (
            1 + np.arange(count)
        )
        with np.errstate(divide="ignore", invalid="ignore"):
            share = (lines - start[:, None]) / along[:, None]
        shares.append(np.where((share > 0.0) & (share < gates[-1]), share, gates[-1]))
    crossed = np.sort(np.concatenate(shares, axis=1), axis=1)
    halves = 0.5 * (crossed[:, 1:] + crossed[:, :-1])
    return np.sort(np.concatenate([crossed, halves], axis=1), axis=1)


def bulge_m(distance_m: ArrayLike, refraction: float) -> FloatArray:
    """How far the datum falls away under a beam [m]: (1 - k) d²/2R."""
    distance = np.asarray(distance_m, dtype=np.float64)
    return np.asarray((1.0 - refraction) * distance * distance / (2.0 * EARTH_RADIUS_M))
