"""Angles in degrees on the circle: wrapping, differences, means, sectors and sets of sectors.

Sectors run clockwise from one direction to another and may cross north. A set of sectors is kept normalised,
so that two sets that cover the same directions are equal, and no caller meets overlapping or touching pieces.
"""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from geometry.arrays import ArrayLike, BoolArray, FloatArray
from geometry.errors import InputError

FULL_CIRCLE_DEG = 360.0

# Pieces and gaps narrower than this are rounding, not geometry: 1e-9 degrees is half a micrometre at 30 km.
MERGE_TOLERANCE_DEG = 1e-9

# A mean of unit vectors shorter than this has no direction: 1e-9 is the rounding of a million cancelling
# terms.
MIN_RESULTANT = 1e-9


def wrap_360_deg(angle_deg: ArrayLike) -> FloatArray:
    """Bring angles into [0, 360).

    Parameters
    ----------
    angle_deg
        Angles [deg], any shape; several turns and negative values are allowed.

    Returns
    -------
    FloatArray
        The same directions in [0, 360) [deg], same shape; NaN stays NaN.

    Examples
    --------
    >>> wrap_360_deg([-90.0, 360.0, 725.0]).tolist()
    [270.0, 0.0, 5.0]
    """
    wrapped = np.fmod(np.asarray(angle_deg, dtype=np.float64), FULL_CIRCLE_DEG)
    wrapped = np.where(wrapped < 0.0, wrapped + FULL_CIRCLE_DEG, wrapped + 0.0)
    # -1e-17 + 360 rounds to 360, which is outside the half-open interval
    return np.where(wrapped >= FULL_CIRCLE_DEG, 0.0, wrapped)


def wrap_180_deg(angle_deg: ArrayLike) -> FloatArray:
    """Bring angles into [-180, 180).

    Parameters
    ----------
    angle_deg
        Angles [deg], any shape; several turns and negative values are allowed.

    Returns
    -------
    FloatArray
        The same directions in [-180, 180) [deg], same shape; NaN stays NaN. Every step is exact in floating
        point, so small angles keep all their digits.

    Examples
    --------
    >>> wrap_180_deg([190.0, -180.0, 180.0, 1e-17]).tolist()
    [-170.0, -180.0, -180.0, 1e-17]
    """
    wrapped = np.fmod(np.asarray(angle_deg, dtype=np.float64), FULL_CIRCLE_DEG)
    wrapped = np.where(wrapped >= 180.0, wrapped - FULL_CIRCLE_DEG, wrapped)
    return np.where(wrapped < -180.0, wrapped + FULL_CIRCLE_DEG, wrapped)


def difference_deg(angle_deg: ArrayLike, reference_deg: ArrayLike) -> FloatArray:
    """Signed turn from a reference to an angle, by the shorter way.

    Parameters
    ----------
    angle_deg, reference_deg
        Angles [deg], shapes that broadcast.

    Returns
    -------
    FloatArray
        ``angle - reference`` in [-180, 180) [deg]; positive where the angle lies clockwise of the reference.

    Examples
    --------
    >>> float(difference_deg(5.0, 350.0))
    15.0
    """
    turn = np.asarray(angle_deg, dtype=np.float64) - np.asarray(reference_deg, dtype=np.float64)
    return wrap_180_deg(turn)


def circular_mean_deg(
    angle_deg: ArrayLike, weights: ArrayLike | None = None, axis: int | None = None
) -> FloatArray:
    r"""Direction of the mean unit vector.

    Parameters
    ----------
    angle_deg
        Angles [deg], any shape.
    weights
        Weights without unit, not negative, that broadcast to the angles; equal if None.
    axis
        Axis to average over; all if None.

    Returns
    -------
    FloatArray
        Mean direction in [0, 360) [deg]; NaN where an angle is NaN or where the unit vectors cancel, since a
        mean direction does not exist there.

    Notes
    -----
    :math:`\bar\theta = \mathrm{atan2}(\sum w\sin\theta, \sum w\cos\theta)`: Mardia & Jupp (2000), Directional
    Statistics, chapter 2.

    Examples
    --------
    >>> round(float(circular_mean_deg([350.0, 20.0])), 9)
    5.0
    """
    angle = np.deg2rad(np.asarray(angle_deg, dtype=np.float64))
    weight = np.broadcast_to(np.asarray(1.0 if weights is None else weights, dtype=np.float64), angle.shape)
    east = np.sum(weight * np.sin(angle), axis=axis)
    north = np.sum(weight * np.cos(angle), axis=axis)
    lost = np.hypot(east, north) <= MIN_RESULTANT * np.sum(weight, axis=axis)
    return np.where(lost, np.nan, wrap_360_deg(np.rad2deg(np.arctan2(east, north))))


@dataclass(frozen=True)
class Sector:
    """Directions from one bearing clockwise over a width; may cross north.

    Parameters
    ----------
    from_deg
        Where the sector begins [deg]; stored in [0, 360).
    width_deg
        How far it runs clockwise [deg], 0 < width <= 360.

    Raises
    ------
    InputError
        If a number is not finite or the width is outside (0, 360].

    Examples
    --------
    >>> sector = Sector(350.0, 20.0)
    >>> sector.to_deg, sector.middle_deg, bool(sector.contains(5.0))
    (10.0, 0.0, True)
    """

    from_deg: float
    width_deg: float

    def __post_init__(self) -> None:
        if not (np.isfinite(self.from_deg) and 0.0 < self.width_deg <= FULL_CIRCLE_DEG):
            raise InputError(
                f"a sector from {self.from_deg}° with width {self.width_deg}° came; allowed is a finite "
                "beginning and a width over 0 up to 360°. Give the width clockwise, 360 for the full circle."
            )
        object.__setattr__(self, "from_deg", float(wrap_360_deg(self.from_deg)))
        object.__setattr__(self, "width_deg", float(self.width_deg))

    @classmethod
    def between(cls, from_deg: float, to_deg: float) -> "Sector":
        """Make the sector that runs clockwise from one bearing to another.

        Parameters
        ----------
        from_deg, to_deg
            Bearings of the two ends [deg]. Ends a whole positive turn apart (0 and 360) are the full circle.

        Returns
        -------
        Sector
            The sector.

        Raises
        ------
        InputError
            If the ends are equal, which could mean nothing or everything.

        Examples
        --------
        >>> Sector.between(270.0, 90.0)
        Sector(from_deg=270.0, width_deg=180.0)
        """
        if from_deg == to_deg:
            raise InputError(
                f"a sector from {from_deg}° to {to_deg}° came; its ends must differ. "
                "Write 0 to 360 for the full circle, and leave the sector out for none."
            )
        width = float(wrap_360_deg(to_deg - from_deg))
        return cls(from_deg, width if width > 0.0 else FULL_CIRCLE_DEG)

    @property
    def to_deg(self) -> float:
        """Where the sector ends [deg], in [0, 360)."""
        return float(wrap_360_deg(self.from_deg + self.width_deg))

    @property
    def middle_deg(self) -> float:
        """Bearing of the sector's middle [deg], in [0, 360)."""
        return float(wrap_360_deg(self.from_deg + 0.5 * self.width_deg))

    def contains(self, angle_deg: ArrayLike) -> BoolArray:
        """Tell which directions lie in the sector, both ends included.

        Parameters
        ----------
        angle_deg
            Directions [deg], any shape.

        Returns
        -------
        BoolArray
            True inside and up to `MERGE_TOLERANCE_DEG` beside it, same shape; NaN is in no sector.

        Examples
        --------
        >>> Sector.between(118.0, 270.0).contains([117.9, 118.0, 270.0]).tolist()
        [False, True, True]
        """
        turn = wrap_360_deg(np.asarray(angle_deg, dtype=np.float64) - self.from_deg)
        # 218.4 - 118.3 is not 100.1 in floating point, and yet the end of a sector is in it
        after = turn <= self.width_deg + MERGE_TOLERANCE_DEG
        return np.asarray(after | (turn >= FULL_CIRCLE_DEG - MERGE_TOLERANCE_DEG))


@dataclass(frozen=True)
class SectorSet:
    """A set of directions as disjoint sectors, sorted by where they begin.

    Overlapping and touching sectors are merged when the set is made; pieces and gaps narrower than
    `MERGE_TOLERANCE_DEG` do not survive. Unions, intersections and complements are sets of directions up to
    their end points, which have no width.

    Parameters
    ----------
    sectors
        Any sectors; normalised on the way in.

    Examples
    --------
    >>> blocked = SectorSet.of([Sector.between(317.0, 43.0), Sector.between(20.0, 60.0)])
    >>> blocked.pairs(), blocked.complement().pairs()
    ([(317.0, 60.0)], [(60.0, 317.0)])
    """

    sectors: tuple[Sector, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "sectors", _normalised(self.sectors))

    @classmethod
    def of(cls, sectors: Iterable[Sector]) -> "SectorSet":
        """Make the set that any sectors cover together."""
        return cls(tuple(sectors))

    @classmethod
    def full(cls) -> "SectorSet":
        """Make the set of all directions."""
        return cls((Sector(0.0, FULL_CIRCLE_DEG),))

    @classmethod
    def empty(cls) -> "SectorSet":
        """Make the set of no direction."""
        return cls(())

    @property
    def width_deg(self) -> float:
        """Total width [deg], 0 to 360."""
        return float(sum(sector.width_deg for sector in self.sectors))

    def pairs(self) -> list[tuple[float, float]]:
        """List the ends (from, to) [deg]: (0, 360) is the full circle, from > to crosses north."""
        return [
            (0.0, FULL_CIRCLE_DEG)
            if sector.width_deg == FULL_CIRCLE_DEG
            else (sector.from_deg, sector.to_deg)
            for sector in self.sectors
        ]

    def contains(self, angle_deg: ArrayLike) -> BoolArray:
        """Tell which directions [deg] lie in the set, ends included; same shape as the argument."""
        inside = np.zeros(np.shape(angle_deg), dtype=np.bool_)
        for sector in self.sectors:
            inside = inside | sector.contains(angle_deg)
        return np.asarray(inside)

    def union(self, other: "SectorSet") -> "SectorSet":
        """Directions in either set."""
        return SectorSet(self.sectors + other.sectors)

    def complement(self) -> "SectorSet":
        """Directions that are not in the set.

        Examples
        --------
        >>> SectorSet.of([Sector.between(339.0, 21.0)]).complement().pairs()
        [(21.0, 339.0)]
        """
        if not self.sectors:
            return SectorSet.full()
        gaps = []
        for sector, following in zip(self.sectors, self.sectors[1:] + self.sectors[:1], strict=True):
            gap = float(wrap_360_deg(following.from_deg - sector.to_deg))
            if gap > MERGE_TOLERANCE_DEG and sector.width_deg < FULL_CIRCLE_DEG:
                gaps.append(Sector(sector.to_deg, gap))
        return SectorSet(tuple(gaps))

    def intersection(self, other: "SectorSet") -> "SectorSet":
        """Directions in both sets.

        Examples
        --------
        >>> wanted = SectorSet.of([Sector.between(118.0, 270.0)])
        >>> wanted.intersection(SectorSet.of([Sector.between(200.0, 150.0)])).pairs()
        [(118.0, 150.0), (200.0, 270.0)]
        """
        return self.complement().union(other.complement()).complement()

    def difference(self, other: "SectorSet") -> "SectorSet":
        """Directions in this set that are not in the other."""
        return self.intersection(other.complement())


def _normalised(sectors: tuple[Sector, ...]) -> tuple[Sector, ...]:
    """Sort, merge what overlaps or touches, and drop slivers; the last may swallow the first across north."""
    merged: list[list[float]] = []  # [from, to] with to possibly past 360
    for sector in sorted(sectors, key=lambda each: each.from_deg):
        end = sector.from_deg + sector.width_deg
        if sector.width_deg <= MERGE_TOLERANCE_DEG:
            continue
        if merged and sector.from_deg <= merged[-1][1] + MERGE_TOLERANCE_DEG:
            merged[-1][1] = max(merged[-1][1], end)
        else:
            merged.append([sector.from_deg, end])
    reach = max((end for _, end in merged), default=0.0) - FULL_CIRCLE_DEG
    while len(merged) > 1 and merged[0][0] <= reach + MERGE_TOLERANCE_DEG:
        first = merged.pop(0)
        merged[-1][1] = max(merged[-1][1], first[1] + FULL_CIRCLE_DEG)
    if any(end - begin >= FULL_CIRCLE_DEG - MERGE_TOLERANCE_DEG for begin, end in merged):
        return (Sector(0.0, FULL_CIRCLE_DEG),)
    return tuple(Sector(begin, end - begin) for begin, end in merged)
