"""WindScanner's scanner file: where the head was, by the counter that it shares with the wind file."""

from pathlib import Path
from typing import NamedTuple

import numpy as np

from geometry.angles import wrap_180_deg
from geometry.arrays import BoolArray, FloatArray
from reconstruct.formats.text import lines_of, number_tables
from reconstruct.formats.time_order import forward
from reconstruct.losses import Loss

#: A sample further than this from both of its neighbours, which agree, is damage: a head that turns its
#: fastest, 100 degrees a second, comes 2 degrees further from sample to sample [deg].
SPIKE_DEG = 10.0

#: Share of a ray that the scanner file has to cover for its positions to count.
LEAST_COVER = 0.9

#: The head stands when it turns less than this in the last fifth of a ray [deg].
STANDING_DEG = 0.05


class Positions(NamedTuple):
    """Log of the scanner head."""

    id: FloatArray  # (sample,) rising
    azimuth_deg: FloatArray  # (sample,) without jumps at 360
    elevation_deg: FloatArray  # (sample,)


class RayPositions(NamedTuple):
    """What the log says about each ray."""

    azimuth_deg: FloatArray  # (ray,) may hold several turns
    elevation_deg: FloatArray  # (ray,) may pass 90
    covered: BoolArray  # (ray,) the log covers the ray
    standing: bool  # the head goes and then stands: angles are those it stands at


def read_positions(path: Path) -> tuple[Positions, list[Loss]]:
    """Positions of a `scanner.txt`, in the order of its counter, and what was lost."""
    tables, losses = number_tables(lines_of(path), path.name)
    values = [t.values[:, :3] for t in tables if t.values.shape[1] >= 3]
    rows = np.concatenate(values) if values else np.empty((0, 3))
    rows = rows[np.all(np.isfinite(rows), axis=1)]
    runs = forward(rows[:, 0].astype("int64"))  # a counter that begins again would mix two times
    if not runs.all():
        losses.append(Loss(path.name, "a position whose counter runs backwards", times=int(np.sum(~runs))))
    rows = rows[runs]
    _, first = np.unique(rows[:, 0], return_index=True)
    rows = rows[first]
    spikes = _spikes(rows[:, 1]) | _spikes(rows[:, 2])
    if spikes.any():
        text = f"a position {SPIKE_DEG:g} degrees or more off those before and after"
        losses.append(Loss(path.name, text, times=int(spikes.sum())))
    rows = rows[~spikes]
    azimuth = np.unwrap(rows[:, 1], period=360.0) if len(rows) else rows[:, 1]
    return Positions(rows[:, 0], azimuth, rows[:, 2]), losses


def _spikes(angle_deg: FloatArray) -> BoolArray:
    """(sample,) that stand alone."""
    out = np.zeros(len(angle_deg), dtype=bool)
    before, own, after = angle_deg[:-2], angle_deg[1:-1], angle_deg[2:]
    off = np.minimum(*(np.abs(wrap_180_deg(own - other)) for other in (before, after)))
    out[1:-1] = (off > SPIKE_DEG) & (np.abs(wrap_180_deg(after - before)) < SPIKE_DEG)
    return out


def ray_positions(log: Positions, start_id: FloatArray, stop_id: FloatArray) -> RayPositions:
    """Mean position of the head in each ray, or where it came to stand.

    A head that is still turning when the ray ends is sweeping: the beam's angles are the means over the ray
    (the integral over the counter, which runs evenly in time). A head that stands at the end of most rays has
    gone to a point and measures there: the angles are the last ones.

    Parameters
    ----------
    log : Positions
    start_id, stop_id : numpy.ndarray
        (ray,) counter at the start and the end of each ray.

    Returns
    -------
    RayPositions
    """
    length = np.maximum(stop_id - start_id, 1.0)
    inside = np.searchsorted(log.id, stop_id, "right") - np.searchsorted(log.id, start_id, "left")
    first, last = (log.id[0], log.id[-1]) if len(log.id) else (np.inf, -np.inf)
    reach = (np.minimum(stop_id, last) - np.maximum(start_id, first)) / length
    covered = (reach >= LEAST_COVER) & (inside >= 2) & forward(start_id.astype("int64"))
    if not np.any(covered):
        blank = np.full(len(start_id), np.nan)
        return RayPositions(blank, blank, covered, standing=False)
    late = stop_id - length / 5
    turned = [np.abs(_at(log, axis, stop_id) - _at(log, axis, late))[covered] for axis in (1, 2)]
    standing = bool(np.mean((turned[0] < STANDING_DEG) & (turned[1] < STANDING_DEG)) > 0.5)
    angles = [_at(log, k, stop_id) if standing else _mean(log, k, start_id, stop_id) for k in (1, 2)]
    return RayPositions(angles[0], angles[1], covered, standing)


def _at(log: Positions, axis: int, ids: FloatArray) -> FloatArray:
    return np.asarray(np.interp(ids, log.id, log[axis]))


def _mean(log: Positions, axis: int, start: FloatArray, stop: FloatArray) -> FloatArray:
    """Integral of an angle between two counts over their difference; the part outside the log does not
    count.
    """
    start, stop = np.clip(start, log.id[0], log.id[-1]), np.clip(stop, log.id[0], log.id[-1])
    angle = log[axis]
    area = np.concatenate([[0.0], np.cumsum(np.diff(log.id) * (angle[1:] + angle[:-1]) / 2)])

    def upto(ids: FloatArray) -> FloatArray:
        """Integral from the first sample; exact between samples too, where the angle runs straight."""
        k = np.clip(np.searchsorted(log.id, ids, "right") - 1, 0, len(log.id) - 2)
        part = ids - log.id[k]
        slope = (angle[k + 1] - angle[k]) / (log.id[k + 1] - log.id[k])
        return np.asarray(area[k] + part * (angle[k] + slope * part / 2))

    return np.asarray((upto(stop) - upto(start)) / np.maximum(stop - start, 1e-9))
