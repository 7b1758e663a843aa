"""The error of each size by the closed forms: noise, linear and turbulent tier, and the ten-minute means."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from planner.error_model import REFERENCE, Model
from planner.error_nouns import MEAN_FIELDS, SCAN_FIELDS, Size, SizeError
from planner.fidelity_wind import POINT_PROBE
from reconstruct.campaign import predict_campaign
from reconstruct.climate import Climate
from reconstruct.prediction import (
    NEEDS_TURBULENCE,
    RANK_SHORT,
    ScanPrediction,
    predict_linear,
    predict_noise,
)
from reconstruct.rays import Rays
from reconstruct.ten_minute import subset_gains
from reconstruct.turbulent import predict_turbulent
from reconstruct.wind import WindState


def closed_form_errors(sizes: list[Size], model: Model) -> tuple[SizeError, ...]:
    """Predict the error of each size by the model's tier."""
    if model.point_probe:
        sizes = [replace(size, rays=_pointlike(size.rays), whole=_pointlike(size.whole)) for size in sizes]
    means = _campaign_means(sizes, model)
    return tuple(_size_error(size, model, mean) for size, mean in zip(sizes, means, strict=True))


def _pointlike(rays: Rays) -> Rays:
    return replace(rays, probes=(POINT_PROBE,) * len(rays.probes))


def _size_error(size: Size, model: Model, mean: Mapping[str, float] | None) -> SizeError:
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
        range_m=float(np.mean(size.rays.range_m)),
        condition=condition if np.isfinite(condition) else None,
        values=values,
        reasons=reasons,
    )


def _predict(rays: Rays, state: WindState, model: Model) -> ScanPrediction:
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


def _campaign_means(sizes: list[Size], model: Model) -> list[Mapping[str, float] | None]:
    """What the ten-minute means of a campaign would show, for each size; None without turbulence."""
    if model.eddies is None:
        return [None] * len(sizes)
    if all(size.whole is sizes[0].whole for size in sizes):
        return list(_regressed(sizes, model))
    return [mean for size in sizes for mean in _regressed([size], model)]


def _regressed(sizes: list[Size], model: Model) -> Iterator[dict[str, float]]:
    """Ten-minute means of sizes that share a scan, regressed over the climate."""
    whole = sizes[0].whole
    if model.eddies is None:
        raise ValueError("ten-minute means need turbulence")
    campaign = predict_campaign(
        whole,
        model.climate,
        model.eddies,
        like=model.states[0],
        sources=model.sources,
        gains=subset_gains(whole, [size.kept for size in sizes]),
        reference=REFERENCE,
        sweep=model.sweep,
    )
    speed, direction = campaign.speed, campaign.direction
    spread = np.stack([mean.direction_std_deg for mean in campaign.means])  # (state, size)
    for number in range(len(sizes)):
        yield {
            "mean10_speed_bias_mps": float(speed.bias_mps[number]),
            "mean10_speed_std_mps": float(speed.std_mps[number]),
            "mean10_direction_std_deg": float(np.sqrt(model.climate.mean(spread[:, number] ** 2))),
            "slope": float(speed.slope[number]),
            "slope_std": float(campaign.slope_std[number]),
            "residual_std_mps": float(speed.residual_std_mps[number]),
            "direction_residual_std_deg": float(direction.residual_std_deg[number]),
            "direction_offset_std_deg": float(campaign.direction_offset_std_deg[number]),
        }
