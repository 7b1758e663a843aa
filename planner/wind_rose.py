"""How often the wind comes from where: uniform, or a rose that was measured."""

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np

from geometry.angles import FULL_CIRCLE_DEG, Sector, SectorSet, circular_mean_deg
from geometry.arrays import FloatArray
from geometry.errors import InputError
from planner.site import Site

# Directions that add up to less than this share of a full resultant have no mean worth naming.
UNIFORM_RESULTANT = 0.05

WEIBULL_COLUMNS = ("weibull_scale_mps", "weibull_shape")
# Shares are rounded; a sum farther off is a lost row or another quantity.
SUM_TOLERANCE = 0.01

COLUMNS = "direction_deg, share and, optionally, weibull_scale_mps with weibull_shape"


@dataclass(frozen=True, eq=False)
class Rose:
    """Equal sectors around the circle, the first centred on its direction; shares add up to 1."""

    direction_deg: FloatArray  # (sector,) middles, ascending
    share: FloatArray  # (sector,)
    weibull_scale_mps: FloatArray | None = None  # (sector,)
    weibull_shape: FloatArray | None = None  # (sector,)

    @property
    def sectors(self) -> tuple[Sector, ...]:
        """The sectors themselves."""
        width = FULL_CIRCLE_DEG / len(self.share)
        return tuple(Sector((middle - width / 2) % FULL_CIRCLE_DEG, width) for middle in self.direction_deg)


def share_within(site: Site, directions: SectorSet) -> float:
    """Share of the wind that comes from some directions: by the site's rose, else uniform; 0 to 1.

    Examples
    --------
    >>> site = Site(name="Moor", crs="EPSG:32632")
    >>> round(share_within(site, SectorSet.of([Sector.between(350.0, 26.0)])), 3)
    0.1
    """
    if site.wind is None or site.wind.rose is None:
        return directions.width_deg / FULL_CIRCLE_DEG
    rose = load_rose(site.wind.rose)
    inside = [
        directions.intersection(SectorSet.of([sector])).width_deg / sector.width_deg
        for sector in rose.sectors
    ]
    return float(np.dot(inside, rose.share))


def load_rose(path: Path) -> Rose:
    """Read a wind rose; a file that has not changed is read once.

    Parameters
    ----------
    path
        A CSV of direction_deg (middles of equal sectors), share (parts of 1, or per cent) and,
        optionally, weibull_scale_mps with weibull_shape.

    Returns
    -------
    Rose
        Sectors in ascending order.

    Raises
    ------
    InputError
        If the file cannot be read, a column is missing, the directions are not equal sectors around the whole
        circle, the shares add up neither to 1 nor to 100, or a number is negative or missing.
    """
    try:
        state = path.stat()
        return _read_rose(path, state.st_mtime_ns, state.st_size)
    except OSError as error:
        raise _unreadable(path, error) from error


@lru_cache(maxsize=8)
def _read_rose(path: Path, _changed_ns: int, _size: int) -> Rose:
    """Read and check a rose; when it was changed last is part of what it is known by."""
    import pandas as pd

    try:
        table = pd.read_csv(path, skipinitialspace=True)
    except ValueError as error:
        raise _unreadable(path, error) from error
    _check_columns(path, list(map(str, table.columns)))
    try:
        table = table.astype(float).sort_values("direction_deg")
    except ValueError as error:
        raise InputError(f"wind rose {path} holds something that is no number: {error}") from error
    directions, share = table["direction_deg"].to_numpy(), table["share"].to_numpy()
    scale_mps, shape = (table[name].to_numpy() if name in table else None for name in WEIBULL_COLUMNS)
    _check_directions(path, directions)
    _check_numbers(path, share, scale_mps, shape)
    return Rose(directions, share / share.sum(), scale_mps, shape)


def _unreadable(path: Path, error: Exception) -> InputError:
    return InputError(f"wind rose {path} cannot be read ({error}); it has to be a CSV of {COLUMNS}")


def _check_columns(path: Path, columns: list[str]) -> None:
    wanted = {"direction_deg", "share"}
    if not wanted.union(WEIBULL_COLUMNS).isdisjoint(set(columns) - wanted):
        wanted.update(WEIBULL_COLUMNS)  # one of the two says nothing
    missing = sorted(wanted - set(columns))
    if missing:
        raise InputError(
            f"wind rose {path} has the columns {', '.join(columns)}; {', '.join(missing)} is missing: "
            f"it has to be a CSV of {COLUMNS}"
        )


def _check_directions(path: Path, directions: FloatArray) -> None:
    steps = np.diff(np.append(directions, directions[:1] + FULL_CIRCLE_DEG))
    if len(directions) < 2 or not np.allclose(steps, FULL_CIRCLE_DEG / len(directions), atol=1e-6):
        raise InputError(
            f"wind rose {path}: the directions {directions.tolist()} are not equal sectors around the whole "
            "circle; give, for example, 0, 30 ... 330"
        )


def _check_numbers(
    path: Path, share: FloatArray, scale_mps: FloatArray | None, shape: FloatArray | None
) -> None:
    if not (np.isfinite(share).all() and (share >= 0).all() and share.sum() > 0):
        raise InputError(
            f"wind rose {path}: the shares {share.tolist()} have to be numbers, 0 or larger, and not all 0"
        )
    total = float(share.sum())
    if min(abs(total - 1.0), abs(total / 100.0 - 1.0)) > SUM_TOLERANCE:
        raise InputError(
            f"wind rose {path}: the shares add up to {total:g}; they have to add up to 1, or to 100 as per cent, "
            f"within {SUM_TOLERANCE:.0%}: look for a missing sector, or divide by {total:g}"
        )
    for name, values in zip(WEIBULL_COLUMNS, (scale_mps, shape), strict=True):
        if values is not None and not (np.isfinite(values).all() and (values > 0).all()):
            raise InputError(
                f"wind rose {path}: {name} {values.tolist()} has to be a number above 0 everywhere"
            )


def prevailing_deg(site: Site, wanted: SectorSet) -> float:
    """Where the wanted wind mostly comes from.

    Parameters
    ----------
    site
        With its wind rose; without one the wind is uniform.
    wanted
        The directions that count.

    Returns
    -------
    float
        Mean direction, weighted by frequency [deg]; NaN where the wind comes from everywhere alike, or from
        nowhere.

    Examples
    --------
    >>> site = Site(name="Moor", crs="EPSG:32632")
    >>> round(prevailing_deg(site, SectorSet.of([Sector.between(118.0, 270.0)])), 1)
    194.0
    """
    middles = np.arange(0.5, FULL_CIRCLE_DEG)
    cells = [SectorSet.of([Sector(float(middle) - 0.5, 1.0)]).intersection(wanted) for middle in middles]
    weights = np.array([share_within(site, cell) for cell in cells])
    resultant = np.sum(weights * np.exp(1j * np.deg2rad(middles)))
    if abs(resultant) <= UNIFORM_RESULTANT * np.sum(weights):
        return float("nan")
    return float(circular_mean_deg(middles, weights))
