"""Where a head found hard targets, and what that tells of how it stands: residuals, their weights, what they leave open."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations
from typing import Literal, NamedTuple

import numpy as np

from geometry.angles import difference_deg
from geometry.arrays import FloatArray, IntArray
from geometry.beams import beam_to, unit_vector
from geometry.errors import InputError
from geometry.head import Mounting

Angle = Literal["heading_deg", "azimuth_offset_deg", "elevation_offset_deg", "pitch_deg", "roll_deg"]

# Heading and azimuth offset do the same to a head that is nearly level: the offset is solved for, the heading
# stays as it is.
ANGLES: tuple[Angle, ...] = ("azimuth_offset_deg", "elevation_offset_deg", "pitch_deg", "roll_deg")

TURNS: tuple[Angle, ...] = ("heading_deg", "azimuth_offset_deg")  # told by azimuths; the others by elevations

# Singular values under this share of the largest: what is solved for cannot be told apart at all.
RANK_SHARE = 1e-6

# Dilution of precision: how many times worse an angle comes out than the best azimuth (or, of a tilt, elevation) is
# measured, by the bearings alone (the notion is that of satellite positioning: Langley 1999, GPS World 10 (5), 52-59).
# ASSUMED: up to 5 is called good there by rule of thumb. Bearings of 0, 30 and 60 degrees have 8, of 0, 45 and 90 have
# 3.4, all around 0.8, three in a line infinity.
GOOD_DILUTION = 5.0


class Sighting(NamedTuple):
    """One target: where it is, and where the head found it. An unknown measured angle has std NaN."""

    name: str
    enu_m: FloatArray  # (3,) from the head, about the axes that the mounting's zero counts from
    azimuth_head_deg: float
    elevation_head_deg: float
    range_head_m: float
    azimuth_std_deg: float
    elevation_std_deg: float
    range_std_m: float
    position_std_m: float  # of the target itself, each coordinate


def _pointed(sightings: Sequence[Sighting], mounting: Mounting) -> FloatArray:
    """(target, 3) where the head pointed, by exact rotation of the corrected head angles."""
    from scipy.spatial.transform import Rotation

    turns = [-mounting.heading_deg, mounting.pitch_deg, mounting.roll_deg]  # about up, right, front
    azimuth = np.array([item.azimuth_head_deg for item in sightings]) + mounting.azimuth_offset_deg
    elevation = np.array([item.elevation_head_deg for item in sightings]) + mounting.elevation_offset_deg
    return np.asarray(Rotation.from_euler("ZXY", turns, degrees=True).apply(unit_vector(azimuth, elevation)))


def angles_left(sightings: Sequence[Sighting], mounting: Mounting) -> FloatArray:
    """(target, 2) angles from where the head pointed to the target, across and upward [deg]."""
    pointed = beam_to(_pointed(sightings, mounting))
    true = beam_to(np.array([item.enu_m for item in sightings]))
    across = difference_deg(true.azimuth_deg, pointed.azimuth_deg) * np.cos(np.deg2rad(true.elevation_deg))
    return np.stack([across, true.elevation_deg - pointed.elevation_deg], axis=1)


def _sides(item: Sighting) -> FloatArray:
    """(2, 3) what a shift of the target changes: angle across and upward [deg/m]."""
    beam = beam_to(item.enu_m)
    right = unit_vector(float(beam.azimuth_deg) + 90.0, 0.0)
    upward = unit_vector(float(beam.azimuth_deg), float(beam.elevation_deg) + 90.0)
    return np.asarray(np.rad2deg(np.stack([right, upward]) / float(beam.range_m)))


def whitening(
    sightings: Sequence[Sighting], kept: list[int], head_std_m: float
) -> tuple[IntArray, FloatArray]:
    """Places of the known angles in (target, 2), flat, and the Cholesky factor of their covariance [deg]."""
    items = [sightings[number] for number in kept]
    cosine = np.cos(np.deg2rad([float(beam_to(item.enu_m).elevation_deg) for item in items]))
    measured = np.array([(item.azimuth_std_deg, item.elevation_std_deg) for item in items])
    measured[:, 0] *= cosine
    sides = np.concatenate([_sides(item) for item in items])  # (target·2, 3)
    covariance = head_std_m**2 * sides @ sides.T
    for place, item in enumerate(items):
        own = slice(2 * place, 2 * place + 2)
        covariance[own, own] += item.position_std_m**2 * sides[own] @ sides[own].T
    covariance += np.diag(measured.ravel() ** 2)
    known = np.flatnonzero(np.isfinite(measured.ravel()))
    if not np.all(np.diag(covariance)[known] > 0):
        raise InputError("a measured angle has no uncertainty: give a standard deviation greater than 0")
    return known, np.asarray(np.linalg.cholesky(covariance[np.ix_(known, known)]))


def whitened(
    values: FloatArray,
    items: list[Sighting],
    start: Mounting,
    solve: tuple[Angle, ...],
    white: tuple[IntArray, FloatArray],
) -> FloatArray:
    """Residuals in standard deviations, independent of each other."""
    mounting = replace(start, **dict(zip(solve, values.tolist(), strict=True)))
    known, factor = white
    return np.asarray(np.linalg.solve(factor, angles_left(items, mounting).ravel()[known]), dtype=np.float64)


def undetermined(
    sightings: Sequence[Sighting],
    *,
    start: Mounting | None = None,
    solve: tuple[Angle, ...] = ANGLES,
    head_std_m: float = 0.0,
) -> tuple[Angle, ...]:
    """Angles that targets leave open: empty where they determine all.

    Judged by the bearings alone, as if all targets stood at the horizon: tilt then shows in elevations only, Δel = o +
    pitch cosγ - roll sinγ. A target at elevation φ tells tilt by its azimuth as well, tan φ as much, which would
    pass off three steep targets in a line for a good choice.

    Examples
    --------
    >>> def at(name, azimuth_deg):
    ...     return Sighting(name, 900 * unit_vector(azimuth_deg, 3.0), azimuth_deg, 3.0, 900.0, .01, .01, .1, .1)
    >>> undetermined([at("a", 10.0), at("b", 130.0), at("c", 250.0)])
    ()
    >>> undetermined([at("a", 0.0), at("b", 0.0), at("c", 180.0)])
    ('roll_deg',)
    """
    if not sightings:
        return solve
    level = [_at_horizon(item, start or Mounting()) for item in sightings]
    stds = predicted_std_deg(level, start=start, solve=solve, head_std_m=head_std_m)
    known, factor = whitening(level, list(range(len(level))), head_std_m)
    measured = np.linalg.norm(factor, axis=1)
    across, upward = (min(measured[known % 2 == axis].tolist(), default=0.0) for axis in (0, 1))
    best = {angle: across if angle in TURNS else upward for angle in solve}
    return tuple(
        angle for angle, std in zip(solve, stds, strict=True) if not std <= GOOD_DILUTION * best[angle]
    )


def solvable(
    sightings: Sequence[Sighting],
    *,
    start: Mounting | None = None,
    solve: tuple[Angle, ...] = ANGLES,
    head_std_m: float = 0.0,
) -> tuple[Angle, ...]:
    """As many of the angles as targets determine together, where the others are taken as they are; offsets first.

    Examples
    --------
    >>> one = Sighting("a", 900 * unit_vector(40.0, 3.0), 40.0, 3.0, 900.0, .01, .01, .1, .1)
    >>> solvable([one])
    ('azimuth_offset_deg', 'elevation_offset_deg')
    """
    for count in range(len(solve), 0, -1):
        for some in combinations(solve, count):
            if not undetermined(sightings, start=start, solve=some, head_std_m=head_std_m):
                return some
    return ()


def _at_horizon(item: Sighting, mounting: Mounting) -> Sighting:
    """A target at the same bearing and distance in plan, at the height of the head."""
    there = item.enu_m * np.array([1.0, 1.0, 0.0])
    azimuth, elevation = mounting.to_head(beam_to(there).azimuth_deg, 0.0)
    return item._replace(enu_m=there, azimuth_head_deg=float(azimuth), elevation_head_deg=float(elevation))


def predicted_std_deg(
    sightings: Sequence[Sighting],
    *,
    start: Mounting | None = None,
    solve: tuple[Angle, ...] = ANGLES,
    head_std_m: float = 0.0,
) -> FloatArray:
    """(angle,) standard deviation [deg] that targets would give each angle; infinite where they tell nothing.

    Needs no measurement: head angles that are only expected will do.
    """
    slopes = design(sightings, start=start or Mounting(), solve=solve, head_std_m=head_std_m)
    _, size, turn = np.linalg.svd(slopes, full_matrices=True)
    full = np.zeros(len(solve))
    full[: size.size] = size
    sound = full > RANK_SHARE * full.max()
    variance = (turn[sound].T ** 2 / full[sound] ** 2).sum(axis=1)
    lost = (turn[~sound] ** 2).sum(axis=0) > RANK_SHARE
    return np.asarray(np.where(lost, np.inf, np.sqrt(variance)))


def design(
    sightings: Sequence[Sighting], *, start: Mounting, solve: tuple[Angle, ...], head_std_m: float
) -> FloatArray:
    """(known angle, solved angle) derivatives of the whitened residuals [1/deg]: what targets tell of what."""
    white = whitening(sightings, list(range(len(sightings))), head_std_m)
    begin = np.array([getattr(start, angle) for angle in solve], dtype=np.float64)
    small = 1e-4
    columns = [
        whitened(begin + small * unit, list(sightings), start, solve, white)
        - whitened(begin - small * unit, list(sightings), start, solve, white)
        for unit in np.eye(len(solve))
    ]
    return np.asarray(np.stack(columns, axis=1) / (2.0 * small))
