"""Wakes for very many measurements at once: the directions that disturb each, in whole degrees."""

from typing import Literal

import numpy as np

from geometry.arrays import ArrayLike, BoolArray, IntArray
from geometry.disturbed import touch_iec, touch_jensen
from geometry.errors import InputError
from geometry.volumes import Touch
from geometry.wakes import DECAY_ONSHORE, IEC_FARTHEST_DIAMETERS, Rotors

WakeModel = Literal["jensen", "iec"]

BINS = 360  # one degree each, the first centred on north
FULL_TURN_DEG = 360.0


def disturbed_bins(
    rotors: Rotors,
    samples_m: ArrayLike,
    *,
    model: WakeModel,
    decay: float = DECAY_ONSHORE,
    max_diameters: float = IEC_FARTHEST_DIAMETERS,
) -> BoolArray:
    """Wind directions from which some wake touches some sample of each measurement.

    Parameters
    ----------
    rotors
        The rotors, in the frame of the samples.
    samples_m
        Points of each measurement: east, north, up [m], shape (measurement, sample, 3). Nothing is filled in between:
        they have to lie so close that their sectors overlap (`geometry.disturbed` fills in, one volume at a time).
    model
        `jensen` or `iec`.
    decay, max_diameters
        As for `geometry.disturbed.jensen_excluded`.

    Returns
    -------
    BoolArray
        (measurement, 360), True from 0, 1, ... 359 degrees; an edge is right to half a degree.

    Raises
    ------
    InputError
        If the samples have another shape.

    Examples
    --------
    >>> stand = Rotors([[0.0, 185.0, 99.5]], 113.0, 0.8)
    >>> found = disturbed_bins(stand, [[[0.0, 0.0, 116.5]]], model="jensen")
    >>> np.flatnonzero(found[0])[[0, 21, 22, -1]].tolist()
    [0, 21, 339, 359]
    """
    samples = np.asarray(samples_m, dtype=np.float64)
    if samples.ndim != 3 or samples.shape[-1] != 3:
        raise InputError(
            f"samples of shape {samples.shape} came; allowed is (measurement, sample, 3) in metres"
        )
    points, count = samples.reshape(-1, 3), samples.shape[0]
    owner = np.repeat(np.arange(count), samples.shape[1])
    steps = np.zeros((count, 2 * BINS + 1), dtype=np.intp)
    margin = np.zeros(len(points))
    for hub, diameter in zip(rotors.hub_m, rotors.diameter_m, strict=True):
        size = float(diameter)
        if model == "jensen":
            touch = touch_jensen(hub, size, decay, max_diameters * size, points, margin)
        else:
            touch = touch_iec(hub, size, max_diameters, points, margin)
        _mark(steps, owner, touch)
    covered = np.cumsum(steps[:, :-1], axis=1) > 0
    return np.asarray(covered[:, :BINS] | covered[:, BINS:])


def _mark(steps: IntArray, owner: IntArray, touch: Touch) -> None:
    """Add the beginnings and ends of the touched directions to (measurement, bin) steps of two turns."""
    found = ~np.isnan(touch.outer_deg)
    who, middle = owner[found], touch.middle_deg[found] % FULL_TURN_DEG
    inner, outer = touch.inner_deg[found], touch.outer_deg[found]
    for low, high in ((middle - outer, middle - inner), (middle + inner, middle + outer)):
        turns = np.floor(low / FULL_TURN_DEG) * FULL_TURN_DEG
        first = np.ceil(low - turns).astype(np.intp)
        last = np.minimum(np.floor(high - turns).astype(np.intp), first + BINS - 1)
        kept = last >= first
        row = who[kept] * steps.shape[1]
        steps += np.bincount(row + first[kept], minlength=steps.size).reshape(steps.shape)
        steps -= np.bincount(row + last[kept] + 1, minlength=steps.size).reshape(steps.shape)
