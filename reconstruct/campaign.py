"""What a whole campaign of sector scans would show: every state of its climate, all errors, and the
regression.

Errors that stay for the campaign (heading, levelling, position, calibration) tilt and shift the line through
its points, by an amount that is known in size only: `slope_std` and `direction_offset_std_deg`. What they do to
the wind depends on its direction, so that they also scatter the points about that line.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from geometry.arrays import FloatArray
from reconstruct.climate import Climate
from reconstruct.clocks import clock_std_s
from reconstruct.periods import TEN_MINUTES_S
from reconstruct.persistence import random_variance
from reconstruct.ray_fit import ray_fit
from reconstruct.rays import Rays
from reconstruct.regression import (
    DirectionRegression,
    SpeedRegression,
    regress_direction,
    regress_speed,
    unwrapped_deg,
)
from reconstruct.spectra import Turbulence
from reconstruct.ten_minute import Reference, TenMinute, predict_ten_minutes
from reconstruct.uncertainty import ErrorSources, mean_errors_mps, ray_errors
from reconstruct.wind import WindState


class Campaign(NamedTuple):
    """Prediction for a campaign; (...) is the axis of sector sizes."""

    means: list[TenMinute]  # one a state
    speed: SpeedRegression
    direction: DirectionRegression
    slope_std: FloatArray  # (...) of the slope, from errors that stay for the campaign
    direction_offset_std_deg: FloatArray  # (...) of the mean direction, from the same


def predict_campaign(
    rays: Rays,
    climate: Climate,
    turbulence: Turbulence,
    *,
    like: WindState,
    sources: ErrorSources | Sequence[ErrorSources] | None = None,
    gains: FloatArray | None = None,
    reference: Reference = "scalar",
    averaging_s: float = TEN_MINUTES_S,
    scan_share: float = 1.0,
    sweep: bool = True,
) -> Campaign:
    """Predict the ten-minute means of every state of a climate and the regression against the mast.

    Parameters
    ----------
    rays
        Rays of one scan.
    climate
        States with weights.
    turbulence
        Model, intensity and length, the same in all states.
    like
        Everything of the wind but speed and direction: shear, height, vertical wind, gradient.
    sources
        Errors of the lidars; none without.
    gains
        (size, 2, ray) fits, see `ten_minute.subset_gains`; without it the whole scan.
    reference, averaging_s, scan_share, sweep
        See `ten_minute.predict_ten_minute`.

    Returns
    -------
    Campaign

    Examples
    --------
    >>> from geometry.gates import Probe
    >>> from reconstruct.climate import listed_climate
    >>> azimuth = np.arange(-29.0, 30.0, 2.0)
    >>> scan = Rays(azimuth_deg=azimuth, elevation_deg=np.zeros(30), range_m=np.full(30, 1000.0),
    ...     head_m=np.tile([0.0, -1000.0, 0.0], (30, 1)), lidar=np.zeros(30, int),
    ...     time_s=0.4 * np.arange(30) + 0.2,
    ...     duration_s=np.full(30, 0.4), swept_azimuth_deg=np.full(30, 2.0), probes=(Probe(200, 256),),
    ...     period_s=12.0)
    >>> states = listed_climate([6.0, 10.0], directions_deg=[(150.0, 210.0)], directions=2)
    >>> shown = predict_campaign(scan, states, Turbulence(0.09, 170.0), like=WindState(8.0, 0.0),
    ...     sources=ErrorSources(radial_speed_mps=0.1, radial_speed_relative=0.01))
    >>> round(float(shown.speed.slope), 2), round(float(shown.slope_std), 3)
    (1.0, 0.01)
    """
    fits = ray_fit(rays).gain if gains is None else gains
    states = climate.states(like)
    means = predict_ten_minutes(
        rays,
        states,
        turbulence,
        gains=fits,
        random_m2s2=[0.0 if sources is None else random_variance(rays, state, sources) for state in states],
        mean_error_mps=[sum(mean_errors_mps(fits, rays, state).values()) for state in states],
        reference=reference,
        averaging_s=averaging_s,
        scan_share=scan_share,
        sweep=sweep,
        clock_s=clock_std_s(rays, sources),
    )
    lasting = _lasting(rays, climate, states, means, fits, sources)
    speed = regress_speed(climate, means, lasting_m2s2=lasting.residual_m2s2)
    direction = regress_direction(climate, means, lasting_deg2=lasting.residual_deg2)
    return Campaign(means, speed, direction, lasting.slope_std, lasting.offset_std_deg)


class _Lasting(NamedTuple):
    """What errors that stay for the campaign do to its regression; (...) is the axis of sector sizes."""

    slope_std: FloatArray
    offset_std_deg: FloatArray  # of the mean direction
    residual_m2s2: FloatArray  # expected variance about the line through the origin
    residual_deg2: FloatArray  # the same about the line of the directions


def _lasting(
    rays: Rays,
    climate: Climate,
    states: list[WindState],
    means: list[TenMinute],
    fits: FloatArray,
    sources: ErrorSources | Sequence[ErrorSources] | None,
) -> _Lasting:
    """Moments over what the errors that stay may be, to first order.

    With a = E[mast · lidar]/E[lidar²] a change d of the lidar changes a by δ = E[(mast - 2 a lidar) d]/E[lidar²],
    and the residual by -(a d + δ lidar).
    """
    shape = fits.shape[:-2]
    if sources is None:
        return _Lasting(*(np.zeros(shape) for _ in _Lasting._fields))
    weight = climate.weight
    along, across = _shifts(rays, states, fits, sources)  # (state, draw, ...)
    slope = regress_speed(climate, means).slope
    lidar = np.stack([mean.lidar_mean_mps for mean in means])
    mast = np.stack([mean.reference_mean_mps for mean in means])
    variance = np.stack([mean.lidar_variance_m2s2 for mean in means])
    square = np.tensordot(weight, lidar**2 + variance, axes=1)
    change = np.tensordot(weight, (mast - 2 * slope * lidar)[:, None] * along, axes=1) / square
    left = slope * along + change * lidar[:, None]
    offset = np.tensordot(weight, across, axes=1)
    return _Lasting(
        np.sqrt(np.sum(change**2, axis=0)),
        np.sqrt(np.sum(offset**2, axis=0)),
        np.sum(_variance_about_line(left, np.zeros(len(states)), weight), axis=0),
        np.sum(_variance_about_line(across, unwrapped_deg(climate.from_deg, weight), weight), axis=0),
    )


def _variance_about_line(values: FloatArray, place: FloatArray, weight: FloatArray) -> FloatArray:
    """Weighted variance (...) of values (state, ...) about a line over places (state,); about their mean if all are one."""
    centred = values - np.tensordot(weight, values, axes=1)
    away = place - weight @ place
    spread, joint = weight @ away**2, np.tensordot(weight * away, centred, axes=1)
    explained = joint**2 / spread if spread > 0 else 0.0
    return np.asarray(np.tensordot(weight, centred**2, axes=1) - explained)


def _shifts(
    rays: Rays, states: list[WindState], fits: FloatArray, sources: ErrorSources | Sequence[ErrorSources]
) -> tuple[FloatArray, FloatArray]:
    """Change of speed [m/s] and direction [degrees], (state, draw, ...), for one std of each draw."""
    along, across = [], []
    for state in states:
        downwind = state.uv_mps / state.speed_mps if state.speed_mps > 0 else np.zeros(2)
        right = np.array([downwind[1], -downwind[0]])  # a wind turned clockwise has grown to the right
        shared = [
            np.where(rays.lidar == lidar, error.response_mps * np.sqrt(error.correlation), 0.0)
            for error in ray_errors(rays, state, sources)
            for lidar in range(len(rays.probes))
        ]
        moved = np.moveaxis(fits @ np.reshape(shared, (-1, rays.count)).T, -1, 0)  # (draw, ..., 2)
        along.append(moved @ downwind)
        across.append(np.degrees(moved @ right) / max(state.speed_mps, 1e-9))
    return np.stack(along), np.stack(across)
