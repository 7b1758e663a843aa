"""The predicted error of each scan and pair, over the site's wind: one curve over sector sizes, one point for a pair."""

from collections.abc import Sequence
from typing import Literal

from geometry.angles import SectorSet
from geometry.errors import InputError
from planner.error_closed_form import closed_form_errors
from planner.error_model import REFERENCE, Model
from planner.error_nouns import ErrorCurve, Size
from planner.error_simulated import Progress, simulated_errors
from planner.exclusion import Exclusion
from planner.places import Places
from planner.ray_sets import own_scan, pair_rays, sector_rays, subset_of
from planner.scan_layout import ScanLayout
from planner.scan_plans import SectorScan
from planner.site import Pair, Site
from planner.wind_climate import turbulence
from reconstruct.periods import TEN_MINUTES_S, scans_in
from reconstruct.prediction import Tier

SizesFrom = Literal["own", "subset"]

DEFAULT_SIZES_DEG = (360, 180, 120, 90, 60, 50, 44, 38, 30, 22, 14, 8, 4)  # the study's, and wider


def sector_curve(
    places: Places,
    layout: ScanLayout,
    exclusion: Exclusion,
    *,
    tier: Tier,
    sizes_deg: Sequence[float] | None = None,
    sizes_from: SizesFrom = "own",
    left_out: frozenset[str] = frozenset(),
    progress: Progress | None = None,
) -> ErrorCurve:
    """Predict a sector scan's error for each size.

    Parameters
    ----------
    places, layout
        The site and the scan in it.
    exclusion
        Of this scan at the target in question: without declared directions, the climate is what it leaves free.
    tier
        How to predict.
    sizes_deg
        Sector sizes [deg]; default: the declared one and the usual smaller ones.
    sizes_from
        "own": each size is a scan of its own, with its own period; "subset": the middle rays of the declared scan, at
        its timing.
    left_out
        Effects that are not modelled, from `planner.fidelity`.
    progress
        Gets the share of the work that is done, in the Monte Carlo tier.

    Raises
    ------
    InputError
        If a size does not fit the scan, or the site does not say what the tier needs.
    """
    target = exclusion.target
    wanted = sorted(sizes_deg or default_sizes(layout), reverse=True)
    if sizes_from == "own":
        sizes = [_own_size(places, layout, target, size_deg) for size_deg in wanted]
    else:
        sizes = _subset_sizes(places, layout, target, wanted)
    model = Model.of(places.site, target, exclusion.excluded, [layout], tier, left_out)
    return _curve(layout.name, layout.lidar.name, target, model, sizes, progress)


def pair_curve(
    places: Places,
    pair: Pair,
    layouts: tuple[ScanLayout, ...],
    excluded: SectorSet,
    *,
    tier: Tier,
    left_out: frozenset[str] = frozenset(),
    progress: Progress | None = None,
) -> ErrorCurve:
    """Predict the error of two or three beams that meet, over the declared directions, else all but the excluded ones."""
    rays = pair_rays(places, layouts, pair.target, columns=pair.fit_columns)
    size = Size(None, rays, rays, slice(None), scans_in(rays.period_s))
    model = Model.of(places.site, pair.target, excluded, layouts, tier, left_out)
    return _curve(pair.name, None, pair.target, model, [size], progress)


def default_sizes(layout: ScanLayout) -> tuple[float, ...]:
    """The declared size and the usual smaller ones that are whole numbers of its steps.

    Raises
    ------
    InputError
        If the scan is no sector.
    """
    spec = layout.spec
    if not isinstance(spec, SectorScan):
        raise InputError(f"scan '{layout.name}' is a {spec.type}; only a sector has sizes")
    steps = [(float(size), size / spec.step_deg) for size in DEFAULT_SIZES_DEG if size < spec.sector_deg]
    return (
        spec.sector_deg,
        *(size for size, count in steps if count >= 2 and abs(count - round(count)) < 1e-9),
    )


def default_tier(site: Site, left_out: frozenset[str] = frozenset()) -> Tier:
    """The turbulent tier where the site declares turbulence that matters, else the linear one."""
    return "linear" if turbulence(site) is None or "turbulence" in left_out else "turbulent"


def _own_size(places: Places, layout: ScanLayout, target: str, size_deg: float) -> Size:
    scan = own_scan(layout, size_deg)
    rays = sector_rays(places, layout, scan, target)
    return Size(size_deg, rays, rays, slice(None), scan.scans_in(TEN_MINUTES_S))


def _subset_sizes(places: Places, layout: ScanLayout, target: str, wanted: Sequence[float]) -> list[Size]:
    """Sizes that share the declared scan's rays, so that its turbulence is worked out once for all of them."""
    whole, sizes = sector_rays(places, layout, layout.scan, target), []
    for size_deg in wanted:
        kept = subset_of(layout, size_deg)
        rays = sector_rays(places, layout, layout.scan.subset(kept), target)
        sizes.append(Size(size_deg, rays, whole, kept, layout.scan.scans_in(TEN_MINUTES_S)))
    return sizes


def _curve(
    name: str, lidar: str | None, target: str, model: Model, sizes: list[Size], progress: Progress | None
) -> ErrorCurve:
    if model.tier == "monte-carlo":
        errors = simulated_errors(sizes, model, progress)
    else:
        errors = closed_form_errors(sizes, model)
    return ErrorCurve(name, lidar, target, model.tier, REFERENCE, model.climate.count, errors)
