"""Rays in the order of time -> scans: a row for each pass, a column for each direction, clockwise."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from geometry.angles import circular_mean_deg, difference_deg
from geometry.arrays import ArrayLike, FloatArray, IntArray
from geometry.beams import unit_vector
from geometry.errors import InputError
from reconstruct.filters import Step
from reconstruct.records import Records

TimeArray = NDArray[np.datetime64]

LOOKED_AT = 3000  # rays that show where the fan is
SHARED_GEOMETRY_DEG = 0.005  # rays that differ less from scan to scan share one fit: 0.1 m at 1 km


@dataclass(frozen=True, eq=False)
class ScanGrid:
    """Scans of one gate. Missing: NaN, and NaT."""

    time_utc: TimeArray  # (scan, ray)
    azimuth_deg: FloatArray  # (scan, ray)
    elevation_deg: FloatArray  # (scan, ray)
    radial_speed_mps: FloatArray  # (scan, ray) positive away
    cnr_db: FloatArray  # (scan, ray)

    @property
    def scans(self) -> int:
        """Number of scans."""
        return len(self.radial_speed_mps)

    @property
    def middle_utc(self) -> TimeArray:
        """(scan,) middle between the first and the last ray that is there."""
        known = ~np.isnat(self.time_utc)
        ticks = self.time_utc.astype("datetime64[ns]").astype(np.int64)
        ends = np.iinfo(np.int64)
        first = np.min(ticks, axis=1, where=known, initial=ends.max)
        last = np.max(ticks, axis=1, where=known, initial=ends.min)
        return np.asarray((first + (last - first) // 2).astype("datetime64[ns]"))

    @property
    def geometry(self) -> tuple[FloatArray, FloatArray]:
        """Azimuths and elevations that the fits are made with: (ray,) where all scans share them, else (scan, ray)."""
        azimuth = np.asarray(circular_mean_of(self.azimuth_deg))
        elevation = _mean(self.elevation_deg)
        off = np.abs(np.asarray(difference_deg(self.azimuth_deg, azimuth)))
        apart = np.fmax(off, np.abs(self.elevation_deg - elevation))
        if np.max(apart, initial=0.0, where=np.isfinite(apart)) <= SHARED_GEOMETRY_DEG:
            return azimuth, elevation
        return self.azimuth_deg, self.elevation_deg


class Gridded(NamedTuple):
    """Scans, and what did not fit among them."""

    grid: ScanGrid
    step: Step
    offset_deg: float  # of the measured azimuths from the planned ones


def scan_grid(records: Records, planned_azimuth_deg: FloatArray, *, step_deg: float) -> Gridded:
    """Sort the rays of one gate into scans.

    Parameters
    ----------
    records : Records
        With one gate; pointing angles.
    planned_azimuth_deg : numpy.ndarray
        (ray,) in clockwise order [deg].
    step_deg : float
        Angle between them [deg].

    Returns
    -------
    Gridded
        The whole fan is moved first to where most of the rays are. Rays that are then further than half a step
        from every column, and second rays in a column of one pass, are counted as lost.

    Raises
    ------
    InputError
        If there is not exactly one gate.

    Examples
    --------
    >>> records = Records(time_utc=np.arange(4).astype("datetime64[s]"), duration_s=np.ones(4),
    ...     azimuth_deg=np.array([359.0, 1.0, 1.0, 359.0]), elevation_deg=np.zeros(4), scan_id=np.zeros(4, int),
    ...     sweep_id=np.array([0, 0, 1, 1]), range_m=np.array([1000.0]), radial_speed_mps=np.arange(4.0)[:, None],
    ...     cnr_db=np.zeros((4, 1)))
    >>> scan_grid(records, np.array([359.0, 1.0]), step_deg=2.0).grid.radial_speed_mps
    array([[0., 1.],
           [3., 2.]])
    """
    column, offset = _columns(records.azimuth_deg, planned_azimuth_deg, step_deg)
    grid, left = _gridded(records, column, len(planned_azimuth_deg))
    return Gridded(grid, Step("in the scan", records.rays, left), offset)


def plane_grid(records: Records, planned_deg: FloatArray, *, axis_deg: float, step_deg: float) -> Gridded:
    """Sort the rays of one gate of a vertical slice (RHI) into scans, by their angle in its plane.

    Parameters
    ----------
    records : Records
        With one gate; pointing angles.
    planned_deg : numpy.ndarray
        (ray,) angles in the plane of the slice, see `plane_angle_deg`.
    axis_deg : float
        Azimuth of the slice.
    step_deg : float
        Angle between rays [deg].

    Returns
    -------
    Gridded
        As `scan_grid`; the offset is one of elevation.

    Raises
    ------
    InputError
        If there is not exactly one gate.
    """
    angle = np.asarray(plane_angle_deg(records.azimuth_deg, records.elevation_deg, axis_deg=axis_deg))
    column, offset = _columns(np.mod(angle, 360.0), planned_deg, step_deg)
    grid, left = _gridded(records, column, len(planned_deg))
    return Gridded(grid, Step("in the scan", records.rays, left), offset)


def plane_angle_deg(azimuth_deg: ArrayLike, elevation_deg: ArrayLike, *, axis_deg: float) -> FloatArray:
    """Angle of beams in a vertical plane, from its axis up and over the top [deg].

    Examples
    --------
    >>> plane_angle_deg([10.0, 10.0, 190.0], [-5.0, 80.0, 80.0], axis_deg=10.0).round(6)
    array([ -5.,  80., 100.])
    """
    up = np.radians(np.asarray(elevation_deg, dtype=float))
    ahead = np.cos(up) * np.cos(np.radians(np.asarray(difference_deg(azimuth_deg, axis_deg))))
    return np.asarray(np.degrees(np.arctan2(np.sin(up), ahead)))


def direction_grid(
    records: Records, azimuth_deg: FloatArray, elevation_deg: FloatArray, *, within_deg: float
) -> Gridded:
    """Sort the rays of one gate of a raster or a list of points into scans, by the planned direction nearest to each.

    Parameters
    ----------
    records : Records
        With one gate; pointing angles.
    azimuth_deg, elevation_deg : numpy.ndarray
        (ray,) planned [deg].
    within_deg : float
        Rays farther than this from every planned direction are counted as lost [deg].

    Raises
    ------
    InputError
        If there is not exactly one gate.
    """
    column = nearest_direction(records, azimuth_deg, elevation_deg, within_deg=within_deg)
    grid, left = _gridded(records, column, len(azimuth_deg))
    off = np.asarray(difference_deg(records.azimuth_deg, azimuth_deg[column]))[column >= 0]
    return Gridded(grid, Step("in the scan", records.rays, left), float(np.median(off)) if left else 0.0)


def nearest_direction(
    records: Records, azimuth_deg: FloatArray, elevation_deg: FloatArray, *, within_deg: float
) -> IntArray:
    """(ray,) index of the planned direction nearest to each ray, -1 where none is within an angle [deg].

    Examples
    --------
    >>> records = Records(time_utc=np.arange(3).astype("datetime64[s]"), duration_s=np.ones(3),
    ...     azimuth_deg=np.array([359.9, 10.0, 50.0]), elevation_deg=np.array([5.0, 20.1, 5.0]),
    ...     scan_id=np.zeros(3, int), sweep_id=np.zeros(3, int), range_m=np.array([1000.0]),
    ...     radial_speed_mps=np.zeros((3, 1)), cnr_db=np.zeros((3, 1)))
    >>> nearest_direction(records, np.array([0.0, 10.0]), np.array([5.0, 20.0]), within_deg=1.0)
    array([ 0,  1, -1])
    """
    from scipy.spatial import cKDTree

    beams = unit_vector(records.azimuth_deg, records.elevation_deg)
    chord = 2 * np.sin(np.radians(min(within_deg, 180.0)) / 2)
    tree = cKDTree(np.atleast_2d(unit_vector(azimuth_deg, elevation_deg)))
    away, found = tree.query(beams)
    return np.where(away <= chord * (1 + 1e-12), found, -1).astype(np.intp)


def angle_between_deg(
    azimuth_deg: ArrayLike, elevation_deg: ArrayLike, other_azimuth_deg: float, other_elevation_deg: float
) -> FloatArray:
    """Angle between beams and one other beam [deg].

    Examples
    --------
    >>> angle_between_deg([0.0, 90.0, 1.0], [0.0, 0.0, 89.0], 0.0, 0.0).round(3)
    array([ 0., 90., 89.])
    """
    beams = unit_vector(np.asarray(azimuth_deg, dtype=float), np.asarray(elevation_deg, dtype=float))
    other = unit_vector(other_azimuth_deg, other_elevation_deg)
    across = np.linalg.norm(np.cross(beams, other), axis=-1)
    return np.asarray(np.degrees(np.arctan2(across, beams @ other)))


def _gridded(records: Records, column: IntArray, columns: int) -> tuple[ScanGrid, int]:
    """Rays in their columns, a row for each pass, and how many there are; column -1 is none."""
    if records.gates != 1:
        raise InputError(f"records with {records.gates} gates came: choose one with at_gates first")
    _, row = np.unique(records.sweep_id, return_inverse=True)
    rows = int(row.max(initial=-1)) + 1
    cell = row * columns + column
    _, first = np.unique(cell[column >= 0], return_index=True)
    kept = np.flatnonzero(column >= 0)[first]
    place = cell[kept]

    def gridded(values: FloatArray) -> FloatArray:
        out = np.full(rows * columns, np.nan)
        out[place] = values[kept]
        return out.reshape(rows, columns)

    time = np.full(rows * columns, np.datetime64("NaT", "ns"))
    time[place] = records.time_utc[kept]
    grid = ScanGrid(
        time.reshape(rows, columns),
        gridded(records.azimuth_deg),
        gridded(records.elevation_deg),
        gridded(records.radial_speed_mps[:, 0]),
        gridded(records.cnr_db[:, 0]),
    )
    return grid, len(kept)


def alternating_passes(azimuth_deg: FloatArray, time_utc: TimeArray, *, longest_s: float) -> IntArray:
    """Number the passes of a scan of two directions, of which angles alone cannot tell where one begins.

    Parameters
    ----------
    azimuth_deg : numpy.ndarray
        (ray,) in the order of time [deg].
    time_utc : numpy.ndarray of datetime64
        (ray,).
    longest_s : float
        Two rays farther apart than this are of two passes [s].

    Returns
    -------
    numpy.ndarray
        (ray,) A pass ends where its direction comes again: every ray stands in one wind.

    Examples
    --------
    >>> seconds = np.array([0, 1, 2, 3, 4, 60]).astype("datetime64[s]")
    >>> alternating_passes(np.array([330.0, 30.0, 330.0, 30.0, 30.0, 330.0]), seconds, longest_s=2.0)
    array([0, 0, 1, 1, 2, 3])
    """
    if not len(azimuth_deg):
        return np.empty(0, dtype=np.intp)
    other = np.abs(np.asarray(difference_deg(azimuth_deg[1:], azimuth_deg[:-1]))) > SHARED_GEOMETRY_DEG * 100
    gap_s = np.diff(time_utc) / np.timedelta64(1, "s")
    runs = np.concatenate([[0], np.flatnonzero(~other | (gap_s > longest_s)) + 1])
    length = np.diff(np.append(runs, len(azimuth_deg)))
    place = np.arange(len(azimuth_deg)) - np.repeat(runs, length)
    return np.asarray(np.cumsum(place % 2 == 0) - 1, dtype=np.intp)


def circular_mean_of(angle_deg: FloatArray) -> FloatArray:
    """(column,) circular means of what is there [deg]."""
    known = np.isfinite(angle_deg)
    return circular_mean_deg(np.where(known, angle_deg, 0.0), weights=known.astype(float), axis=0)


def _columns(azimuth_deg: FloatArray, planned_deg: FloatArray, step_deg: float) -> tuple[IntArray, float]:
    """Column of each ray, -1 where none is near, and how far the fan was moved [deg]."""
    if not len(azimuth_deg):
        return np.empty(0, dtype=np.intp), 0.0
    sample = azimuth_deg[:: max(len(azimuth_deg) // LOOKED_AT, 1)]
    fine = float(np.median(_nearest(sample, planned_deg)[1]))
    fine -= step_deg * round(fine / step_deg)
    shifts = fine + step_deg * np.arange(-len(planned_deg), len(planned_deg) + 1)
    shifts = shifts[np.argsort(np.abs(shifts), kind="stable")]  # of two as good the smaller
    counts = [
        np.count_nonzero(np.abs(_nearest(sample, planned_deg + shift)[1]) <= 0.5 * step_deg)
        for shift in shifts
    ]
    offset = float(shifts[int(np.argmax(counts))])
    nearest, off = _nearest(azimuth_deg, planned_deg + offset)
    return np.where(np.abs(off) <= 0.5 * step_deg, nearest, -1), offset


def _nearest(azimuth_deg: FloatArray, planned_deg: FloatArray) -> tuple[IntArray, FloatArray]:
    """Index of the planned direction nearest to each ray, and the turn from it."""
    turn = np.mod(planned_deg, 360.0)
    order = np.argsort(turn)
    ring = np.concatenate([[turn[order[-1]] - 360.0], turn[order], [turn[order[0]] + 360.0]])
    index = np.concatenate([[order[-1]], order, [order[0]]])
    right = np.clip(np.searchsorted(ring, azimuth_deg), 1, len(ring) - 1)
    closer = np.where(azimuth_deg - ring[right - 1] <= ring[right] - azimuth_deg, right - 1, right)
    found = index[closer]
    return found.astype(np.intp), np.asarray(difference_deg(azimuth_deg, planned_deg[found]))


def _mean(values: FloatArray) -> FloatArray:
    known = np.isfinite(values)
    count = np.count_nonzero(known, axis=0)
    total = np.sum(values, axis=0, where=known)
    return np.asarray(total / np.where(count > 0, count, np.nan))
