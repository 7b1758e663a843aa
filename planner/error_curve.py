"""The predicted error of each scan and pair, over the site's wind: one curve over sector sizes, one point for a pair."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from geometry.angles import SectorSet
from geometry.errors import InputError
from planner.exclusion import Exclusion
from planner.places import Places
from planner.fidelity import POINT_PROBE, Air
from planner.ray_sets import own_scan, pair_rays, sector_rays, subset_of
from planner.scan_layout import ScanLayout
from planner.scan_plans import SectorScan
from planner.site import Lidar, Pair, Site
from planner.wind_climate import climate_at, error_sources, state_like, turbulence
from reconstruct.climate import Climate
from reconstruct.persistence import split_covariance
from reconstruct.prediction import (
    NEEDS_TURBULENCE,
    RANK_SHORT,
    ScanPrediction,
    Tier,
    predict_linear,
    predict_noise,
)
from reconstruct.rays import Rays
from reconstruct.regression import regress_direction, regress_speed
from reconstruct.spectra import Turbulence
from reconstruct.ten_minute import AVERAGING_S, Reference, TenMinute, predict_ten_minute, subset_gains
from reconstruct.turbulent import predict_turbulent
from reconstruct.uncertainty import ErrorSources, mean_errors_mps
from reconstruct.wind import WindState

SizesFrom = Literal["own", "subset"]

REFERENCE: Reference = "scalar"  # a cup
DEFAULT_SIZES_DEG = (360, 180, 120, 90, 60, 50, 44, 38, 30, 22, 14, 8, 4)  # the study's, and wider

SCAN_FIELDS = ("speed_bias_mps", "speed_std_mps", "direction_bias_deg", "direction_std_deg")
MEAN_FIELDS = (
    "mean10_speed_bias_mps",
    "mean10_speed_std_mps",
    "mean10_direction_std_deg",
    "slope",
    "residual_std_mps",
    "direction_residual_std_deg",
)


@dataclass(frozen=True)
class SizeError:
    """What one sector size, or one pair, will measure; a number that the tier cannot know is None, with its reason."""

    sector_deg: float | None  # None for a pair
    rays: int
    scans_per_10min: int
    period_s: float
    condition: float | None
    values: Mapping[str, float | None]  # SCAN_FIELDS and MEAN_FIELDS
    reasons: Mapping[str, str] = field(default_factory=dict)

    def as_dict(self) -> dict[str, object]:
        """The numbers by name, as `lidarplan errors --json` prints them."""
        return {
            "sector_deg": self.sector_deg,
            "rays": self.rays,
            "scans_per_10min": self.scans_per_10min,
            "condition": self.condition,
            **self.values,
            "reasons": dict(self.reasons),
        }


@dataclass(frozen=True)
class ErrorCurve:
    """The predicted error of one scan (or pair) at one target, by one tier."""

    scan: str  # the scan's name, or the pair's
    lidar: str | None  # None for a pair
    target: str
    tier: Tier
    reference: str
    states: int
    sizes: tuple[SizeError, ...]  # widest first


@dataclass(frozen=True)
class _Size:
    """One size: its rays, and which rays of which whole scan they are."""

    sector_deg: float | None
    rays: Rays
    whole: Rays
    kept: slice
    scans: int


@dataclass(frozen=True)
class _Model:
    """How the error is predicted: wind, errors and air, with the effects that are left out already gone."""

    tier: Tier
    climate: Climate
    states: tuple[WindState, ...]
    sources: tuple[ErrorSources, ...]
    eddies: Turbulence | None
    sweep: bool
    point_probe: bool

    @classmethod
    def of(
        cls,
        site: Site,
        target: str,
        excluded: SectorSet,
        lidars: Sequence[Lidar],
        tier: Tier,
        left_out: frozenset[str],
    ) -> "_Model":
        climate = climate_at(site, target, excluded)
        like = state_like(site, target)
        if "shear" in left_out:
            like = replace(like, shear_exponent=0.0)
        if "vertical-wind" in left_out:
            like = replace(like, vertical_mps=0.0)
        sources = [error_sources(lidar) for lidar in lidars]
        if "pointing-noise" in left_out:
            sources = [ErrorSources(radial_speed_mps=each.radial_speed_mps) for each in sources]
        return cls(
            tier=tier,
            climate=climate,
            states=tuple(climate.states(like)),
            sources=tuple(sources),
            eddies=_required_turbulence(site, tier),
            sweep="scan-motion" not in left_out,
            point_probe="probe-averaging" in left_out,
        )


def sector_curve(
    places: Places,
    layout: ScanLayout,
    exclusion: Exclusion,
    *,
    tier: Tier,
    sizes_deg: Sequence[float] | None = None,
    sizes_from: SizesFrom = "own",
    left_out: frozenset[str] = frozenset(),
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
    model = _Model.of(places.site, target, exclusion.excluded, [layout.lidar], tier, left_out)
    return _curve(layout.name, layout.lidar.name, target, model, sizes)


def pair_curve(
    places: Places,
    pair: Pair,
    layouts: tuple[ScanLayout, ...],
    excluded: SectorSet,
    *,
    tier: Tier,
    left_out: frozenset[str] = frozenset(),
) -> ErrorCurve:
    """Predict the error of two or three beams that meet, over the declared directions, else all but the excluded ones."""
    rays = pair_rays(places, layouts, pair.target)
    size = _Size(None, rays, rays, slice(None), int(AVERAGING_S / rays.period_s))
    model = _Model.of(
        places.site, pair.target, excluded, [layout.lidar for layout in layouts], tier, left_out
    )
    return _curve(pair.name, None, pair.target, model, [size])


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


def _own_size(places: Places, layout: ScanLayout, target: str, size_deg: float) -> _Size:
    scan = own_scan(layout, size_deg)
    rays = sector_rays(places, layout, scan, target)
    return _Size(size_deg, rays, rays, slice(None), scan.scans_in(AVERAGING_S))


def _subset_sizes(places: Places, layout: ScanLayout, target: str, wanted: Sequence[float]) -> list[_Size]:
    """Sizes that share the declared scan's rays, so that its turbulence is worked out once for all of them."""
    whole, sizes = sector_rays(places, layout, layout.scan, target), []
    for size_deg in wanted:
        kept = subset_of(layout, size_deg)
        rays = sector_rays(places, layout, layout.scan.subset(kept), target)
        sizes.append(_Size(size_deg, rays, whole, kept, layout.scan.scans_in(AVERAGING_S)))
    return sizes


def _required_turbulence(site: Site, tier: Tier) -> Turbulence | None:
    if tier in ("noise", "linear"):
        return None
    eddies = turbulence(site)
    if eddies is None:
        raise InputError(
            f"the {tier} tier needs the turbulence of the air, and the site does not give it: add "
            "wind.turbulence {intensity, length_m}, or take --tier linear"
        )
    return eddies


def _curve(name: str, lidar: str | None, target: str, model: _Model, sizes: list[_Size]) -> ErrorCurve:
    if model.point_probe:
        sizes = [replace(size, rays=_pointlike(size.rays), whole=_pointlike(size.whole)) for size in sizes]
    means = _campaign_means(sizes, model)
    found = tuple(_size_error(size, model, mean) for size, mean in zip(sizes, means, strict=True))
    return ErrorCurve(name, lidar, target, model.tier, REFERENCE, model.climate.count, found)


def _pointlike(rays: Rays) -> Rays:
    return replace(rays, probes=(POINT_PROBE,) * len(rays.probes))


def _size_error(size: _Size, model: _Model, mean: Mapping[str, float] | None) -> SizeError:
    predictions = [_predict(size.rays, state, model) for state in model.states]
    values, reasons = _over_climate(model.climate, predictions)
    for name in MEAN_FIELDS:
        value = None if mean is None else mean[name]
        values[name] = None if value is None or not np.isfinite(value) else value
        if values[name] is None:
            reasons[name] = NEEDS_TURBULENCE if mean is None else RANK_SHORT
    condition = predictions[0].condition
    return SizeError(
        sector_deg=size.sector_deg,
        rays=size.rays.count,
        scans_per_10min=size.scans,
        period_s=size.rays.period_s,
        condition=condition if np.isfinite(condition) else None,
        values=values,
        reasons=reasons,
    )


def _predict(rays: Rays, state: WindState, model: _Model) -> ScanPrediction:
    if model.tier == "noise":
        noise = np.array([each.radial_speed_mps for each in model.sources])
        return predict_noise(rays, state, noise[rays.lidar])
    if model.eddies is None:
        return predict_linear(rays, state, model.sources)
    return predict_turbulent(rays, state, model.eddies, model.sources, sweep=model.sweep)


def _over_climate(
    climate: Climate, predictions: Sequence[ScanPrediction]
) -> tuple[dict[str, float | None], dict[str, str]]:
    """Mean bias and root-mean-square scatter over the states; None where some state does not know it."""
    values: dict[str, float | None] = {}
    reasons: dict[str, str] = {}
    for name in SCAN_FIELDS:
        each = [getattr(prediction, name) for prediction in predictions]
        if any(value is None for value in each):
            values[name] = None
            reasons[name] = next(p.reasons[name] for p in predictions if getattr(p, name) is None)
        else:
            scatter = name.endswith(("std_mps", "std_deg"))
            values[name] = float(np.sqrt(climate.mean(np.square(each)))) if scatter else climate.mean(each)
    return values, reasons


def _campaign_means(sizes: list[_Size], model: _Model) -> list[Mapping[str, float] | None]:
    """What the ten-minute means of a campaign would show, for each size; None without turbulence."""
    if model.eddies is None:
        return [None] * len(sizes)
    if all(size.whole is sizes[0].whole for size in sizes):
        return list(_regressed(sizes, model))
    return [mean for size in sizes for mean in _regressed([size], model)]


def _regressed(sizes: list[_Size], model: _Model) -> Iterator[dict[str, float]]:
    """Ten-minute means of sizes that share a scan, regressed over the climate."""
    means = [_ten_minute(sizes, state, model) for state in model.states]
    speed, direction = regress_speed(model.climate, means), regress_direction(model.climate, means)
    spread = np.stack([mean.direction_std_deg for mean in means])  # (state, size)
    for number in range(len(sizes)):
        yield {
            "mean10_speed_bias_mps": float(speed.bias_mps[number]),
            "mean10_speed_std_mps": float(speed.std_mps[number]),
            "mean10_direction_std_deg": float(np.sqrt(model.climate.mean(spread[:, number] ** 2))),
            "slope": float(speed.slope[number]),
            "residual_std_mps": float(speed.residual_std_mps[number]),
            "direction_residual_std_deg": float(direction.residual_std_deg[number]),
        }


def _ten_minute(sizes: list[_Size], state: WindState, model: _Model) -> TenMinute:
    whole, eddies = sizes[0].whole, model.eddies
    if eddies is None:
        raise ValueError("ten-minute means need turbulence")
    gains = subset_gains(whole, [size.kept for size in sizes])
    errors = split_covariance(whole, state, model.sources)
    offsets = [np.sum(list(mean_errors_mps(fit, whole, state).values()), axis=0) for fit in gains]
    return predict_ten_minute(
        whole,
        state,
        eddies,
        gains=gains,
        random_m2s2=errors.random_m2s2,
        persistent_m2s2=errors.persistent_m2s2,
        mean_error_mps=np.stack(offsets),
        reference=REFERENCE,
        sweep=model.sweep,
    )


def airs_of_scan(places: Places, layout: ScanLayout, exclusion: Exclusion) -> tuple[Air, ...]:
    """What the size of an effect on a scan is judged with: its widest and its narrowest size, which feels it most."""
    sizes = default_sizes(layout)
    scans = [own_scan(layout, size_deg) for size_deg in sorted({max(sizes), min(sizes)}, reverse=True)]
    return tuple(
        _air(
            places.site,
            exclusion.target,
            exclusion.excluded,
            sector_rays(places, layout, scan, exclusion.target),
            [layout.lidar],
        )
        for scan in scans
    )


def air_of_pair(places: Places, pair: Pair, layouts: tuple[ScanLayout, ...], excluded: SectorSet) -> Air:
    """What the size of an effect on a pair is judged with."""
    rays = pair_rays(places, layouts, pair.target)
    return _air(places.site, pair.target, excluded, rays, [layout.lidar for layout in layouts])


def _air(site: Site, target: str, excluded: SectorSet, rays: Rays, lidars: Sequence[Lidar]) -> Air:
    """The climate's mean speed from each of its directions."""
    climate = climate_at(site, target, excluded)
    like = replace(state_like(site, target), speed_mps=climate.mean(climate.speed_mps))
    states = [replace(like, from_deg=float(angle)) for angle in np.unique(climate.from_deg)]
    return Air(rays, states, [error_sources(lidar) for lidar in lidars], turbulence(site))
