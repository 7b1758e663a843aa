"""How a head stands, from where it found several hard targets: heading, pitch, roll, offsets, with covariance."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from geometry.angles import difference_deg
from geometry.arrays import FloatArray
from geometry.beams import beam_to
from geometry.errors import InputError
from geometry.head import Mounting
from reconstruct.sightings import (
    ANGLES,
    Angle,
    Sighting,
    angles_left,
    solvable,
    undetermined,
    whitened,
    whitening,
)

OUTLIER_CHANCE = 1e-3  # residuals that good data have less often than this are called an outlier's
SIGNIFICANT_CHANCE = 0.05  # two-sided
STEEPEST_DEG = 80.0  # pitch or roll of a head that measures anything


class Residual(NamedTuple):
    """What is left of one target: true less fitted, and what was expected of it (k = 1); NaN where unknown."""

    name: str
    azimuth_deg: float
    elevation_deg: float
    range_m: float
    azimuth_std_deg: float
    elevation_std_deg: float
    range_std_m: float
    outlier: bool


@dataclass(frozen=True, eq=False)
class MountingFit:
    """The mounting that brings the sightings to where their targets are."""

    mounting: Mounting
    solved: tuple[Angle, ...]
    covariance_deg2: FloatArray  # (angle, angle) of `solved`
    range_std_m: float  # of the range offset; NaN where no range was known
    residuals: tuple[Residual, ...]
    chi_square: float  # of the angles of those kept
    freedom: int  # measured angles kept, less those solved for

    @property
    def outliers(self) -> tuple[str, ...]:
        """Targets that were left out."""
        return tuple(item.name for item in self.residuals if item.outlier)

    def std_deg(self, angle: Angle) -> float:
        """Standard deviation of a solved angle [deg]."""
        place = self.solved.index(angle)
        return float(np.sqrt(self.covariance_deg2[place, place]))

    @property
    def coverage_factor(self) -> float:
        """Standard deviations from which on a change is significant at the 5 % level, by Student's distribution.

        The stated uncertainties of maps and survey are estimates themselves, and the angles left over are all that
        checks them. The factor is therefore Student's with that freedom (GUM, JCGM 100:2008, G.3): 4.3 for 2 angles
        left over, 12.7 for 1 or none, as in a least-squares fit that states no uncertainties. Taken for exact,
        they would call a roll of 3.4 standard deviations significant that three elevations give for three
        unknowns; the case that is published so calls the elevation offset alone significant.
        """
        from scipy.special import stdtrit

        return float(stdtrit(max(self.freedom, 1), 1.0 - 0.5 * SIGNIFICANT_CHANCE))

    def is_significant(self, angle: Angle, than_deg: float = 0.0) -> bool:
        """Whether a solved angle differs from another value by more than the coverage factor says."""
        moved = abs(getattr(self.mounting, angle) - than_deg)
        return bool(moved > self.coverage_factor * self.std_deg(angle))


def fit_mounting(
    sightings: Sequence[Sighting],
    *,
    start: Mounting | None = None,
    solve: tuple[Angle, ...] = ANGLES,
    head_std_m: float = 0.0,
) -> MountingFit:
    r"""Solve for how the head stands.

    Parameters
    ----------
    sightings : sequence of Sighting
        Targets at different bearings.
    start : Mounting
        Where to begin; what is not solved for stays as it is there.
    solve : tuple of angle names
        What to solve for.
    head_std_m : float
        Standard deviation of each coordinate of the head [m]: it moves all targets together.

    Returns
    -------
    MountingFit
        With targets left out whose residuals good data would hardly have (`outliers`), where the others still
        determine everything.

    Raises
    ------
    InputError
        If the targets do not determine what is solved for (one target, all in a line, too few), or contradict
        each other without telling which is wrong.

    Notes
    -----
    Exact rotations: :math:`u = H P Q\, b(\theta_h + o_\theta, \phi_h + o_\phi)`. Residuals are the angles
    from there to the target, across and upward, whitened with the covariance of map, target and head
    (generalised least squares); first with a soft :math:`\ell_1` loss, so that one wrong target cannot drag
    the others, then without those that are named. Covariance :math:`(J^T C^{-1} J)^{-1}`. Small angles:
    Δel = o + pitch cosγ - roll sinγ. The range offset is the weighted mean of true less measured ranges.

    Examples
    --------
    >>> from geometry.beams import unit_vector
    >>> true = Mounting(azimuth_offset_deg=12.31, elevation_offset_deg=0.6, pitch_deg=0.03)
    >>> def seen(name, azimuth_deg):
    ...     azimuth, elevation = true.to_head(azimuth_deg, 5.0)
    ...     at = 1000 * unit_vector(azimuth_deg, 5.0)
    ...     return Sighting(name, at, float(azimuth), float(elevation), 1003.0, .002, .002, .1, 0.0)
    >>> found = fit_mounting([seen("a", 10.0), seen("b", 130.0), seen("c", 250.0)])
    >>> round(found.mounting.azimuth_offset_deg, 3), round(found.mounting.pitch_deg, 3)
    (12.31, 0.03)
    >>> round(found.mounting.range_offset_m, 3), found.outliers
    (-3.0, ())
    """
    start = start or Mounting()
    doubles = sorted({name for name in solve if solve.count(name) > 1})
    if not solve or doubles:
        raise InputError(f"solve for {', '.join(solve) or 'nothing'} came; allowed: each angle once")
    kept = list(range(len(sightings)))
    _refuse_undetermined(sightings, kept, start, solve, head_std_m)
    while True:
        values, normal, chi_square = _solved(sightings, kept, start, solve, head_std_m)
        freedom = whitening(sightings, kept, head_std_m)[0].size - len(solve)
        if _chance(chi_square, freedom) > OUTLIER_CHANCE:
            break
        kept.remove(_worst(sightings, kept, start, solve, head_std_m))
        if 2 * len(kept) <= len(sightings):
            raise _contradiction(sightings, list(range(len(sightings))), "no majority of them agrees")
    mounting = replace(start, **dict(zip(solve, values.tolist(), strict=True)))
    offset_m, range_std_m = _range_offset(sightings, kept, head_std_m, start.range_offset_m)
    mounting = replace(mounting, range_offset_m=offset_m)
    residuals = tuple(
        _residual(item, mounting, head_std_m, number not in kept) for number, item in enumerate(sightings)
    )
    return MountingFit(
        mounting,
        solve,
        np.asarray(np.linalg.inv(normal), dtype=np.float64),
        range_std_m,
        residuals,
        chi_square,
        freedom,
    )


def _solved(
    sightings: Sequence[Sighting],
    kept: list[int],
    start: Mounting,
    solve: tuple[Angle, ...],
    head_std_m: float,
) -> tuple[FloatArray, FloatArray, float]:
    """Values [deg], normal matrix [1/deg²] and chi square of the kept sightings."""
    from scipy.optimize import least_squares

    items = [sightings[number] for number in kept]
    white = whitening(sightings, kept, head_std_m)
    begin = np.array([getattr(start, angle) for angle in solve], dtype=np.float64)
    arguments = (items, start, solve, white)
    begin = begin + _turned(items, start, solve)
    most = np.array([STEEPEST_DEG if angle in ("pitch_deg", "roll_deg") else np.inf for angle in solve])
    inside = (-most, most)  # far from the solution a step may be wild
    robust = least_squares(whitened, begin, args=arguments, loss="soft_l1", x_scale=0.1, bounds=inside)
    exact = least_squares(
        whitened, robust.x, args=arguments, x_scale=0.1, xtol=1e-12, ftol=1e-12, bounds=inside
    )
    slopes = np.asarray(exact.jac, dtype=np.float64)
    return np.asarray(exact.x), slopes.T @ slopes, float(2.0 * exact.cost)


def _turned(items: list[Sighting], start: Mounting, solve: tuple[Angle, ...]) -> FloatArray:
    """A first turn about up [deg], the median of all, so that a head set up anyhow is found as well."""
    true = beam_to(np.array([item.enu_m for item in items]))
    across = angles_left(items, start)[:, 0] / np.cos(np.deg2rad(true.elevation_deg))
    first = np.zeros(len(solve))
    for angle in ("azimuth_offset_deg", "heading_deg"):
        if angle in solve:
            first[solve.index(angle)] = float(np.median(difference_deg(across, across[0]))) + across[0]
            break
    return first


def _refuse_undetermined(
    sightings: Sequence[Sighting],
    kept: list[int],
    start: Mounting,
    solve: tuple[Angle, ...],
    head_std_m: float,
) -> None:
    """Say which angles the targets leave open."""
    open_angles = undetermined(sightings, start=start, solve=solve, head_std_m=head_std_m)
    if open_angles:
        named = ", ".join(sightings[number].name for number in kept) or "none"
        fewer = ",".join(solvable(sightings, start=start, solve=solve, head_std_m=head_std_m))
        less = f"solve for what they do determine (--solve {fewer})" if fewer else "solve for other angles"
        raise InputError(
            f"{len(kept)} hard target(s) ({named}) do not determine {', '.join(open_angles)}: needed are three "
            f"or more whose bearings differ widely, not one, and not in a line with the lidar. Add targets, or {less}"
        )


def _chance(chi_square: float, freedom: int) -> float:
    """How often good data have residuals as large; 1 where nothing is left over to tell."""
    from scipy.special import chdtrc

    return float(chdtrc(freedom, chi_square)) if freedom > 0 else 1.0


def _worst(
    sightings: Sequence[Sighting],
    kept: list[int],
    start: Mounting,
    solve: tuple[Angle, ...],
    head_std_m: float,
) -> int:
    """The one target without which the others agree best."""
    agreed: list[tuple[float, int]] = []
    for number in kept:
        others = [other for other in kept if other != number]
        left = [sightings[other] for other in others]
        if undetermined(left, start=start, solve=solve, head_std_m=head_std_m):
            continue
        freedom = whitening(sightings, others, head_std_m)[0].size - len(solve)
        if freedom > 0:
            chi_square = _solved(sightings, others, start, solve, head_std_m)[2]
            agreed.append((_chance(chi_square, freedom), number))
    agreed.sort(reverse=True)
    clear = [number for chance, number in agreed if chance > OUTLIER_CHANCE]
    if not agreed or len(clear) > 1:
        which = " or ".join(sightings[number].name for number in clear)
        raise _contradiction(
            sightings, kept, f"one of them is wrong: {which}" if which else "which is wrong cannot be told"
        )
    return agreed[0][1]


def _contradiction(sightings: Sequence[Sighting], kept: list[int], verdict: str) -> InputError:
    named = ", ".join(sightings[number].name for number in kept)
    return InputError(
        f"the hard targets {named} contradict each other beyond their uncertainties, and {verdict}. Check positions "
        "and maps, or add a target"
    )


def _range_offset(
    sightings: Sequence[Sighting], kept: list[int], head_std_m: float, declared_m: float
) -> tuple[float, float]:
    """Weighted mean of true less measured range, and its standard deviation [m]."""
    items = [sightings[number] for number in kept if np.isfinite(sightings[number].range_std_m)]
    if not items:
        return declared_m, float("nan")
    along = np.array([item.enu_m / np.linalg.norm(item.enu_m) for item in items])
    left = np.array([float(np.linalg.norm(item.enu_m)) - item.range_head_m for item in items])
    variance = np.array([item.range_std_m**2 + item.position_std_m**2 for item in items])
    covariance = np.diag(variance) + head_std_m**2 * along @ along.T
    weight = np.linalg.solve(covariance, np.ones(len(items)))
    return float(weight @ left / weight.sum()), float(weight.sum() ** -0.5)


def _residual(item: Sighting, mounting: Mounting, head_std_m: float, outlier: bool) -> Residual:
    across, upward = angles_left([item], mounting)[0]
    beam = beam_to(item.enu_m)
    cosine = float(np.cos(np.deg2rad(beam.elevation_deg)))
    place_deg = float(np.rad2deg(np.hypot(item.position_std_m, head_std_m) / beam.range_m))
    known = [np.isfinite(std) for std in (item.azimuth_std_deg, item.elevation_std_deg, item.range_std_m)]
    range_left = float(beam.range_m) - float(mounting.true_range_m(item.range_head_m))
    return Residual(
        item.name,
        float(across) / cosine if known[0] else float("nan"),
        float(upward) if known[1] else float("nan"),
        range_left if known[2] else float("nan"),
        float(np.hypot(item.azimuth_std_deg, place_deg / cosine)),
        float(np.hypot(item.elevation_std_deg, place_deg)),
        float(np.linalg.norm([item.range_std_m, item.position_std_m, head_std_m])),
        outlier,
    )
