"""Bias and spread of speed and direction when the error of the wind vector is a two-dimensional Gaussian.

Speed and direction are not linear in the wind: once the error is a good part of the wind, |V| comes out too
high and the direction spreads beyond any first-order value, so both are integrated over the Gaussian.
"""

from functools import cache
from typing import NamedTuple

import numpy as np

from geometry.arrays import ArrayLike, FloatArray
from geometry.errors import InputError

NARROW = 0.125
"""Up to this ratio of error to wind, eight standard deviations from the calm, the Gauss-Hermite product rule
is as exact as the polar one (tested).
"""

HERMITE_NODES = 12
LEGENDRE_NODES = 80
FLATTEST = 1e-8
"""The short axis of the error is taken as at least this share of the long one or of the wind: it keeps the
scaled angle finite.
"""

LOST = 1e-12
"""A mean unit vector shorter than this is the rounding of the sum that made it: no direction is known."""

CHUNK = 4096
"""Wind states that are integrated over the angle at once: some tens of megabytes."""


class WindMoments(NamedTuple):
    """Errors of a retrieved wind, retrieved - true, of any shape (...,)."""

    speed_bias_mps: FloatArray
    speed_std_mps: FloatArray
    direction_bias_deg: FloatArray  # circular mean of the difference; NaN in a calm, or drowned by the error
    direction_std_deg: FloatArray  # root mean square of the wrapped difference from that mean; NaN likewise


def wind_moments(
    wind_mps: ArrayLike, covariance_m2s2: ArrayLike, *, mean_error_mps: ArrayLike = (0.0, 0.0)
) -> WindMoments:
    """Moments of speed and direction of true wind + mean error + Gaussian error.

    Where the error is under NARROW of the wind: a Gauss-Hermite product rule over the two axes of the error,
    on the differences |V| - |V0| and the angle between V and V0, so that nothing cancels. Elsewhere, calm
    included: polar coordinates of the scaled error, its radius in closed form (the projected normal
    distribution: Jammalamadaka & SenGupta 2001, Topics in Circular Statistics, section 2.2.4), its angle by Gauss-Legendre
    rules that crowd where the integrand turns sharply.

    Parameters
    ----------
    wind_mps : array_like
        (..., 2) true u, v [m/s].
    covariance_m2s2 : array_like
        (..., 2, 2) covariance of the error of u, v [m²/s²].
    mean_error_mps : array_like
        (..., 2) mean error of u, v [m/s].

    Returns
    -------
    WindMoments
        NaN where an input is NaN.

    Raises
    ------
    InputError
        If the last axes are not 2 and (2, 2).

    Examples
    --------
    >>> calm = wind_moments([0.0, 0.0], np.eye(2))
    >>> round(float(calm.speed_bias_mps), 6)  # Rayleigh: sqrt(pi / 2)
    1.253314
    >>> round(float(wind_moments([0.0, -10.0], np.diag([1.0, 0.0])).direction_std_deg), 2)
    5.67
    """
    wind, covariance, error = (
        np.asarray(a, dtype=float) for a in (wind_mps, covariance_m2s2, mean_error_mps)
    )
    if wind.shape[-1:] != (2,) or error.shape[-1:] != (2,) or covariance.shape[-2:] != (2, 2):
        raise InputError(
            f"wind {wind.shape}, covariance {covariance.shape} and mean error {error.shape}: "
            "their last axes have to be (2,), (2, 2) and (2,)"
        )
    lead = np.broadcast_shapes(wind.shape[:-1], error.shape[:-1], covariance.shape[:-2])
    wind = np.broadcast_to(wind, (*lead, 2)).reshape(-1, 2)
    error = np.broadcast_to(error, (*lead, 2)).reshape(-1, 2)
    covariance = np.broadcast_to(covariance, (*lead, 2, 2)).reshape(-1, 2, 2)
    out = np.full((4, len(wind)), np.nan)
    known = np.flatnonzero(np.isfinite(wind.sum(-1) + error.sum(-1) + covariance.sum((-2, -1))))
    for start in range(0, len(known), CHUNK):
        part = known[start : start + CHUNK]
        out[:, part] = _moments(wind[part], error[part], covariance[part])
    out[2:, np.hypot(wind[:, 0], wind[:, 1]) == 0] = np.nan
    return WindMoments(*(values.reshape(lead) for values in out))


def _moments(wind: FloatArray, error: FloatArray, covariance: FloatArray) -> FloatArray:
    """(4, state) moments; the frame is turned to the principal axes of the error, longest first."""
    variances, axes = np.linalg.eigh(covariance)
    std = np.sqrt(np.clip(variances[:, ::-1], 0.0, None))
    longest = axes[:, :, 1]
    axes = np.stack([longest, np.stack([-longest[:, 1], longest[:, 0]], axis=-1)], axis=-1)  # right-handed
    truth, mean = (np.einsum("sij,si->sj", axes, a) for a in (wind, wind + error))
    narrow = std[:, 0] <= NARROW * np.hypot(*mean.T)
    if np.all(narrow):
        return _narrow(truth, mean, std)
    out = np.empty((4, len(wind)))
    for method, where in ((_narrow, narrow), (_wide, ~narrow)):
        if np.any(where):
            out[:, where] = method(truth[where], mean[where], std[where])
    return out


def _narrow(truth: FloatArray, mean: FloatArray, std: FloatArray) -> FloatArray:
    """Gauss-Hermite over the plane, on differences from the mean wind."""
    nodes, weights = _hermite()
    weight = np.outer(weights, weights).ravel()
    dx = std[:, :1] * np.repeat(nodes, len(nodes))
    dy = std[:, 1:] * np.tile(nodes, len(nodes))
    x, y = mean[:, :1], mean[:, 1:]
    speed = np.hypot(x, y)
    with np.errstate(invalid="ignore"):
        longer = (2 * (x * dx + y * dy) + dx**2 + dy**2) / (np.hypot(x + dx, y + dy) + speed)
    longer = np.where(speed > 0, longer, 0.0)  # a calm without error
    angle = np.arctan2(y * dx - x * dy, speed**2 + x * dx + y * dy)  # clockwise from the mean wind
    offset = _difference(mean, truth)
    longer_mean = longer @ weight
    turn_mean = np.arctan2(np.sin(angle) @ weight, np.cos(angle) @ weight)  # circular, as beyond NARROW
    speed_std = np.sqrt(((longer - longer_mean[:, None]) ** 2) @ weight)
    turn_std = np.sqrt(((angle - turn_mean[:, None]) ** 2) @ weight)
    bias = np.degrees(offset[1] + turn_mean)
    return np.stack([offset[0] + longer_mean, speed_std, (bias + 180) % 360 - 180, np.degrees(turn_std)])


def _difference(mean: FloatArray, truth: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Speed of one wind less that of another, and the clockwise angle from the other to it [rad]."""
    (x, y), (x0, y0) = mean.T, truth.T
    total = np.hypot(x, y) + np.hypot(x0, y0)
    longer = ((x - x0) * (x + x0) + (y - y0) * (y + y0)) / np.where(total > 0, total, 1.0)
    return longer, np.arctan2(y0 * x - x0 * y, x * x0 + y * y0)


def _wide(truth: FloatArray, mean: FloatArray, std: FloatArray) -> FloatArray:
    """Polar coordinates of the error scaled to a circle."""
    floor = FLATTEST * np.maximum(std[:, 0], np.hypot(*mean.T))
    std = np.maximum(std, floor[:, None])
    scaled = mean / std
    peak = np.arctan2(scaled[:, 1], scaled[:, 0])
    turn0 = np.arctan2(truth[:, 1], truth[:, 0])
    edges = np.stack(
        [peak, peak + np.pi, *(np.full_like(peak, a) for a in (0.0, np.pi / 2, np.pi, -np.pi / 2))], -1
    )
    finest = _finest(scaled, std)
    angle, weight = _angles(edges, finest)
    direction, length, density = _polar(angle, scaled, std)
    weight = weight * density[0]
    total = np.sum(weight, -1)
    first = np.sum(weight * length * density[1], -1) / total
    second = np.sum(std**2 + mean**2, -1)
    turn = direction - turn0[:, None]
    across, ahead = np.sum(weight * np.sin(turn), -1), np.sum(weight * np.cos(turn), -1)
    bias = np.arctan2(across, ahead)
    bias[np.hypot(across, ahead) <= LOST * total] = np.nan
    spread = _angular_std(edges, turn0 + bias, scaled, std)
    speed_std = np.sqrt(np.clip(second - first**2, 0.0, None))
    return np.stack([first - np.hypot(*truth.T), speed_std, -np.degrees(bias), np.degrees(spread)])


def _angular_std(edges: FloatArray, centre: FloatArray, scaled: FloatArray, std: FloatArray) -> FloatArray:
    """Root mean square of the wrapped difference from an angle: the rule is cut where the difference
    jumps.
    """
    jump = np.arctan2(-np.sin(centre) * std[:, 0], -np.cos(centre) * std[:, 1])
    angle, weight = _angles(np.concatenate([edges, jump[:, None]], -1), _finest(scaled, std))
    direction, _, density = _polar(angle, scaled, std)
    turn = (direction - centre[:, None] + np.pi) % (2 * np.pi) - np.pi
    weight = weight * density[0]
    return np.asarray(np.sqrt(np.sum(weight * turn**2, -1) / np.sum(weight, -1)))


def _finest(scaled: FloatArray, std: FloatArray) -> FloatArray:
    """Smallest scaled angle over which anything happens: across a flat error, or across a distant peak."""
    return np.asarray(np.minimum(std[:, 1] / std[:, 0], 1 / np.maximum(1.0, np.hypot(*scaled.T))))


def _polar(
    angle: FloatArray, scaled: FloatArray, std: FloatArray
) -> tuple[FloatArray, FloatArray, tuple[FloatArray, FloatArray]]:
    """Real angle, length per unit of scaled radius, density of the angle and mean scaled radius there.

    With b = m cos(angle - peak) and d = m sin(angle - peak), the integrals over the radius r of exp(-(r² - 2
    b r + m²)/2) times r and r² are exp(-d²/2) [exp(-b²/2) + b S] and exp(-d²/2) [b exp(-b²/2) + (1 + b²) S],
    S = sqrt(pi/2) erfc(-b/√2).
    """
    from scipy.special import erfcx

    cosine, sine = np.cos(angle), np.sin(angle)
    b = scaled[:, :1] * cosine + scaled[:, 1:] * sine
    d = scaled[:, 1:] * cosine - scaled[:, :1] * sine
    # divided by exp(-b²/2) for b < 0, where S is small: erfcx keeps its digits
    tail = np.sqrt(np.pi / 2) * erfcx(np.abs(b) / np.sqrt(2))
    gauss = np.exp(-0.5 * (b**2 + d**2))
    upper = np.sqrt(2 * np.pi) * np.exp(-0.5 * d**2)
    area = np.where(b < 0, gauss * tail, upper - gauss * tail)
    density = np.clip(gauss + b * area, 0.0, None)
    moment = np.clip(b * gauss + (1 + b**2) * area, 0.0, None)
    x, y = std[:, :1] * cosine, std[:, 1:] * sine
    radius = moment / np.where(density > 0, density, 1.0)
    return np.arctan2(y, x), np.hypot(x, y), (density, radius)


def _angles(edges: FloatArray, finest: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(state, node) angles and weights around the circle, crowding at sorted edges down to the finest angle.

    On each half of each stretch, of length L, the angle from its edge is L sinh(T x) / sinh(T), sinh(T) = L /
    finest, with x the Gauss-Legendre nodes on (0, 1).
    """
    nodes, weights = _legendre()
    edges = np.sort(edges % (2 * np.pi), -1)
    edges = np.concatenate([edges, edges[:, :1] + 2 * np.pi], -1)
    half = 0.5 * np.diff(edges, axis=-1)[..., None]
    reach = np.arcsinh(half / finest[:, None, None])
    away = finest[:, None, None] * np.sinh(reach * nodes)
    weight = finest[:, None, None] * reach * np.cosh(reach * nodes) * weights
    angle = np.concatenate([edges[:, :-1, None] + away, edges[:, 1:, None] - away], -1)
    return angle.reshape(len(edges), angle[0].size), np.concatenate([weight, weight], -1).reshape(
        len(edges), angle[0].size
    )


@cache
def _hermite() -> tuple[FloatArray, FloatArray]:
    """Nodes and weights for the mean over a standard normal variable."""
    nodes, weights = np.polynomial.hermite_e.hermegauss(HERMITE_NODES)
    return nodes, weights / np.sqrt(2 * np.pi)


@cache
def _legendre() -> tuple[FloatArray, FloatArray]:
    """Gauss-Legendre nodes and weights on (0, 1)."""
    nodes, weights = np.polynomial.legendre.leggauss(LEGENDRE_NODES)
    return 0.5 * (nodes + 1), 0.5 * weights
