"""The states of the wind that a campaign meets: speeds, directions and how often."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from geometry.arrays import ArrayLike, FloatArray
from geometry.errors import InputError
from reconstruct.wind import WindState

Sectors = Sequence[tuple[float, float]]

SPEEDS = 5
DIRECTIONS = 8
FINE = 4000  # slices of a distribution that a Gauss rule is made from
ALL_DIRECTIONS: Sectors = ((0.0, 360.0),)


@dataclass(frozen=True)
class Climate:
    """States of the wind with their weights.

    Raises
    ------
    InputError
        If the arrays differ in length, hold no state, or a weight is negative or all are 0.

    Examples
    --------
    >>> climate = Climate(np.array([6.0, 10.0]), np.array([180.0, 270.0]), np.array([1.0, 3.0]))
    >>> climate.weight, round(climate.mean(climate.speed_mps), 1)
    (array([0.25, 0.75]), 9.0)
    """

    speed_mps: FloatArray  # (state,)
    from_deg: FloatArray  # (state,) where the wind blows from
    weight: FloatArray  # (state,) made to sum to 1

    def __post_init__(self) -> None:
        shapes = {np.shape(part) for part in (self.speed_mps, self.from_deg, self.weight)}
        if len(shapes) != 1 or len(next(iter(shapes))) != 1 or next(iter(shapes)) == (0,):
            raise InputError(
                f"a climate needs speeds, directions and weights, one each per state; shapes {shapes} came"
            )
        values = np.stack([self.speed_mps, self.from_deg, self.weight])
        if not np.all(np.isfinite(values)) or np.any(self.speed_mps < 0) or np.any(self.weight < 0):
            raise InputError(
                "a state of the climate is not a finite number, or a speed or weight is negative"
            )
        total = float(np.sum(self.weight))
        if total == 0:
            raise InputError("every state of the climate has weight 0: nothing is left to average over")
        object.__setattr__(self, "weight", np.asarray(self.weight, dtype=float) / total)

    @property
    def count(self) -> int:
        """Number of states."""
        return len(self.speed_mps)

    def mean(self, values: ArrayLike) -> float:
        """Mean over the climate of one value a state."""
        return float(np.sum(self.weight * np.asarray(values, dtype=float)))

    def states(self, like: WindState) -> list[WindState]:
        """Wind states with everything but speed and direction taken from `like`."""
        pairs = zip(self.speed_mps, self.from_deg, strict=True)
        return [replace(like, speed_mps=float(speed), from_deg=float(angle)) for speed, angle in pairs]


def weibull_climate(
    scale_mps: float,
    shape: float,
    *,
    speed_range_mps: tuple[float, float] = (0.0, np.inf),
    directions_deg: Sectors = ALL_DIRECTIONS,
    speeds: int = SPEEDS,
    directions: int = DIRECTIONS,
) -> Climate:
    """Climate of Weibull speeds and directions that are uniform within sectors.

    Parameters
    ----------
    scale_mps, shape
        A [m/s] and k of the Weibull distribution, above 0.
    speed_range_mps
        Lowest and highest speed that counts [m/s].
    directions_deg
        Sectors (from, to) clockwise [degrees]; they may cross north.
    speeds, directions
        Number of speeds and of directions: the Gauss rule of the distribution, exact for polynomials of the
        speed up to degree 2 speeds - 1, and directions equally spaced over the sectors.

    Returns
    -------
    Climate
        speeds x directions states.

    Raises
    ------
    InputError
        If scale or shape is not above 0, the range holds no wind, or there is no sector.

    Notes
    -----
    F(V) = 1 - exp(-(V/A)^k). The rule comes from the three-term recurrence of the distribution (Golub &
    Welsch 1969, Math. Comp. 23, 221-230, doi:10.1090/S0025-5718-69-99647-1).

    Examples
    --------
    >>> climate = weibull_climate(8.9, 2.75, speed_range_mps=(4.0, 25.0), directions_deg=[(118.0, 270.0)])
    >>> climate.count, climate.speed_mps[::8].round(2), climate.from_deg[:2]
    (40, array([ 4.7 ,  7.09, 10.33, 14.  , 18.07]), array([127.5, 146.5]))
    """
    if not (scale_mps > 0 and shape > 0):
        raise InputError(f"Weibull scale {scale_mps} m/s and shape {shape} came; both have to be above 0")
    low, high = (float(-np.expm1(-((limit / scale_mps) ** shape))) for limit in speed_range_mps)
    if not high > low:
        raise InputError(
            f"no wind of that climate is between {speed_range_mps[0]} and {speed_range_mps[1]} m/s"
        )
    # the middle of each of many slices of equal probability stands for it
    probability = low + (high - low) * (np.arange(FINE) + 0.5) / FINE
    values = scale_mps * (-np.log1p(-probability)) ** (1 / shape)
    speed, weight = _gauss_rule(values, speeds)
    return _product(speed, weight, spread_directions(directions_deg, directions))


def listed_climate(
    speeds_mps: ArrayLike, *, directions_deg: Sectors = ALL_DIRECTIONS, directions: int = DIRECTIONS
) -> Climate:
    """Climate of given speeds [m/s], equally often, from directions that are uniform within sectors
    [degrees].

    Examples
    --------
    >>> listed_climate([8.0], directions_deg=[(350.0, 10.0)], directions=2).from_deg
    array([355.,   5.])
    """
    values = np.atleast_1d(np.asarray(speeds_mps, dtype=float))
    return _product(values, np.ones(len(values)), spread_directions(directions_deg, directions))


def rose_climate(
    speed_mps: ArrayLike,
    from_deg: ArrayLike,
    frequency: ArrayLike,
    *,
    speed_range_mps: tuple[float, float] = (0.0, np.inf),
    directions_deg: Sectors = ALL_DIRECTIONS,
) -> Climate:
    """Climate of a wind rose: bins within the speed range and the sectors, weighted by their frequency.

    Parameters
    ----------
    speed_mps, from_deg, frequency
        (bin,) middle speed [m/s], middle direction [degrees] and frequency in any unit.
    speed_range_mps, directions_deg
        What counts; see `weibull_climate`.

    Raises
    ------
    InputError
        If no bin is left.

    Examples
    --------
    >>> rose_climate([8.0, 8.0, 3.0], [0.0, 180.0, 180.0], [5, 1, 1], speed_range_mps=(4, 25)).weight.round(3)
    array([0.833, 0.167])
    """
    speed, angle, weight = (np.asarray(part, dtype=float) for part in (speed_mps, from_deg, frequency))
    inside = np.zeros(angle.shape, dtype=bool)
    for start, width in _widths(directions_deg):
        inside |= np.mod(angle - start, 360.0) <= width
    inside &= (speed >= speed_range_mps[0]) & (speed <= speed_range_mps[1])
    if not np.any(inside):
        raise InputError("no bin of the wind rose lies within the speed range and the allowed directions")
    return Climate(speed[inside], angle[inside], weight[inside])


def spread_directions(directions_deg: Sectors, count: int) -> FloatArray:
    """Spread directions [degrees] evenly over some sectors, half a step inside the ends."""
    widths = _widths(directions_deg)
    ends = np.cumsum([width for _, width in widths])
    place = (np.arange(count) + 0.5) * ends[-1] / count
    sector = np.minimum(np.searchsorted(ends, place, side="right"), len(ends) - 1)
    starts = np.array([start for start, _ in widths])
    before = np.concatenate([[0.0], ends[:-1]])
    return np.asarray(np.mod(starts[sector] + place - before[sector], 360.0))


def _gauss_rule(values: FloatArray, count: int) -> tuple[FloatArray, FloatArray]:
    """Nodes and weights of the Gauss rule of equally likely values, by the Lanczos process."""
    scale = float(np.max(np.abs(values)))
    before, now = np.zeros(len(values)), np.full(len(values), len(values) ** -0.5)
    diagonal, beside = np.zeros(count), np.zeros(count)
    for k in range(count):
        ahead = values / scale * now
        diagonal[k] = now @ ahead
        ahead = ahead - diagonal[k] * now - (beside[k - 1] * before if k else 0.0)
        beside[k] = np.linalg.norm(ahead)
        before, now = now, ahead / beside[k]
    matrix = np.diag(diagonal) + np.diag(beside[:-1], 1) + np.diag(beside[:-1], -1)
    node, vector = np.linalg.eigh(matrix)
    return scale * node, vector[0] ** 2


def _widths(directions_deg: Sectors) -> list[tuple[float, float]]:
    """Start and width of each sector; equal ends modulo 360 are the whole circle if they differ by it."""
    if not len(directions_deg):
        raise InputError("no wind direction is allowed: the climate is empty")
    out = []
    for start, end in directions_deg:
        width = (end - start) % 360.0
        out.append((float(start), 360.0 if width == 0 and end != start else float(width)))
    return out


def _product(speed_mps: FloatArray, weight: FloatArray, from_deg: FloatArray) -> Climate:
    speeds, angles = np.meshgrid(speed_mps, from_deg, indexing="ij")
    return Climate(speeds.ravel(), angles.ravel(), np.repeat(weight, len(from_deg)))
