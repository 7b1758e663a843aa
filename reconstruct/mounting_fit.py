"""How a head stands, from where it found several hard targets: heading, pitch, roll, offsets, with covariance."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
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

# Singular values under this share of the largest: what is solved for cannot be told apart at all.
RANK_SHARE = 1e-6

# An angle counts as undetermined where it comes out four times worse than the best target is measured: every
# error of a map or a survey would be that much larger in it. Three targets in a line with the lidar tell the
# tilt across that line by their azimuths alone, 10 times worse at 3° elevation and 4 at 8°; targets at 0, 30
# and 60° reach 7, at 0, 45 and 90° 3, all around 0.8.
WEAKENING = 4.0

OUTLIER_CHANCE = 1e-3  # residuals that good data have less often than this are called an outlier's
SIGNIFICANT_CHANCE = 0.05  # two-sided


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

    def is_significant(self, angle: Angle, than_deg: float = 0.0) -> bool:
        """Whether a solved angle differs from another value at the 5 % level.

        The few angles left over are all that checks the stated uncertainties: the coverage factor is
        Student's with that freedom (GUM, JCGM 100:2008, G.3), 4.3 for 2 and 12.7 for 1 or none.
        """
        from scipy.special import stdtrit

        factor = float(stdtrit(max(self.freedom, 1), 1.0 - 0.5 * SIGNIFICANT_CHANCE))
        return bool(abs(getattr(self.mounting, angle) - than_deg) > factor * self.std_deg(angle))


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
        freedom = _whitening(sightings, kept, head_std_m)[0].size - len(solve)
        if _chance(chi_square, freedom) > OUTLIER_CHANCE:
            break
        kept.remove(_worst(sightings, kept, start, solve, head_std_m))
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


def _pointed(sightings: Sequence[Sighting], mounting: Mounting) -> FloatArray:
    """(target, 3) where the head pointed, by exact rotation of the corrected head angles."""
    from scipy.spatial.transform import Rotation

    turns = [-mounting.heading_deg, mounting.pitch_deg, mounting.roll_deg]  # about up, right, front
    azimuth = np.array([item.azimuth_head_deg for item in sightings]) + mounting.azimuth_offset_deg
    elevation = np.array([item.elevation_head_deg for item in sightings]) + mounting.elevation_offset_deg
    return np.asarray(Rotation.from_euler("ZXY", turns, degrees=True).apply(unit_vector(azimuth, elevation)))


def _angles_left(sightings: Sequence[Sighting], mounting: Mounting) -> FloatArray:
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


def _whitening(
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


def _whitened(
    values: FloatArray,
    items: list[Sighting],
    start: Mounting,
    solve: tuple[Angle, ...],
    white: tuple[IntArray, FloatArray],
) -> FloatArray:
    """Residuals in standard deviations, independent of each other."""
    mounting = replace(start, **dict(zip(solve, values.tolist(), strict=True)))
    known, factor = white
    return np.asarray(np.linalg.solve(factor, _angles_left(items, mounting).ravel()[known]), dtype=np.float64)


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
    white = _whitening(sightings, kept, head_std_m)
    begin = np.array([getattr(start, angle) for angle in solve], dtype=np.float64)
    arguments = (items, start, solve, white)
    begin = begin + _turned(items, start, solve)
    robust = least_squares(_whitened, begin, args=arguments, loss="soft_l1", x_scale=0.1)
    exact = least_squares(_whitened, robust.x, args=arguments, x_scale=0.1, xtol=1e-12, ftol=1e-12)
    slopes = np.asarray(exact.jac, dtype=np.float64)
    return np.asarray(exact.x), slopes.T @ slopes, float(2.0 * exact.cost)


def _turned(items: list[Sighting], start: Mounting, solve: tuple[Angle, ...]) -> FloatArray:
    """A first turn about up [deg], the median of all, so that a head set up anyhow is found as well."""
    across = _angles_left(items, start)[:, 0]
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
        raise InputError(
            f"{len(kept)} hard target(s) ({named}) do not determine {', '.join(open_angles)}: needed are three "
            "or more whose bearings differ widely, not one, and not in a line with the lidar. Add targets, or "
            "solve for less"
        )


def undetermined(
    sightings: Sequence[Sighting],
    *,
    start: Mounting | None = None,
    solve: tuple[Angle, ...] = ANGLES,
    head_std_m: float = 0.0,
) -> tuple[Angle, ...]:
    """Angles that targets leave open: empty where they determine all.

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
    stds = predicted_std_deg(sightings, start=start, solve=solve, head_std_m=head_std_m)
    factor = _whitening(sightings, list(range(len(sightings))), head_std_m)[1]
    measured_deg = float(np.linalg.norm(factor, axis=1).min())
    limit_deg = WEAKENING * measured_deg
    return tuple(angle for angle, std in zip(solve, stds, strict=True) if not std <= limit_deg)


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
    white = _whitening(sightings, list(range(len(sightings))), head_std_m)
    begin = np.array([getattr(start, angle) for angle in solve], dtype=np.float64)
    small = 1e-4
    columns = [
        _whitened(begin + small * unit, list(sightings), start, solve, white)
        - _whitened(begin - small * unit, list(sightings), start, solve, white)
        for unit in np.eye(len(solve))
    ]
    return np.asarray(np.stack(columns, axis=1) / (2.0 * small))


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
        freedom = _whitening(sightings, others, head_std_m)[0].size - len(solve)
        if freedom > 0:
            chi_square = _solved(sightings, others, start, solve, head_std_m)[2]
            agreed.append((_chance(chi_square, freedom), number))
    agreed.sort(reverse=True)
    named = ", ".join(sightings[number].name for number in kept)
    clear = [number for chance, number in agreed if chance > OUTLIER_CHANCE]
    if not agreed or len(clear) > 1:
        which = ", ".join(sightings[number].name for number in clear) or "which one cannot be told"
        raise InputError(
            f"the hard targets {named} contradict each other beyond their uncertainties, and one of them is "
            f"wrong ({which}). Check positions and maps, or add a target"
        )
    return agreed[0][1]


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
    across, upward = _angles_left([item], mounting)[0]
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
