"""What a beam sees of a wind: the forward model, averaging along the probe, noise."""

from collections.abc import Callable

import numpy as np

from geometry.arrays import ArrayLike, FloatArray
from geometry.beams import unit_vector
from geometry.errors import InputError
from geometry.gates import Probe
from reconstruct.wind import WindState, uv_mps


def radial_speed_mps(
    azimuth_deg: ArrayLike,
    elevation_deg: ArrayLike,
    u_mps: ArrayLike,
    v_mps: ArrayLike,
    w_mps: ArrayLike = 0.0,
) -> FloatArray:
    """Wind along a beam, positive away from the lidar.

    Parameters
    ----------
    azimuth_deg, elevation_deg : array_like
        Beam direction [degrees], clockwise from true north and above the horizontal.
    u_mps, v_mps, w_mps : array_like
        Eastward, northward and upward wind [m/s]; all are broadcast together.

    Returns
    -------
    numpy.ndarray
        v_r = u sin θ cos φ + v cos θ cos φ + w sin φ [m/s].

    Examples
    --------
    >>> u = v = np.sqrt(50.0)  # 10 m/s from 225 degrees
    >>> radial_speed_mps([75.0, 90.0, 105.0], 0.0, u, v).round(4)
    array([8.6603, 7.0711, 5.    ])
    """
    beam = unit_vector(azimuth_deg, elevation_deg)
    u, v, w = (np.asarray(a, dtype=float) for a in (u_mps, v_mps, w_mps))
    return np.asarray(beam[..., 0] * u + beam[..., 1] * v + beam[..., 2] * w)


def power_law_mps(
    height_m: ArrayLike, *, speed_mps: ArrayLike, reference_height_m: float, exponent: float
) -> FloatArray:
    """Wind speed at a height above ground by the power law V (z / z_ref)^α.

    Parameters
    ----------
    height_m : array_like
        Above ground, not above sea level [m]; below ground the answer is NaN.
    speed_mps : array_like
        Speed at the reference height [m/s].
    reference_height_m : float
        Above ground [m].
    exponent : float
        α; 0 is a wind without shear, which has no ground.

    Returns
    -------
    numpy.ndarray
        Speed [m/s].

    Raises
    ------
    InputError
        If the reference height is not above ground.

    Examples
    --------
    >>> power_law_mps([100.0, 200.0, -1.0], speed_mps=10.0, reference_height_m=100.0, exponent=0.2).round(3)
    array([10.   , 11.487,    nan])
    """
    if not reference_height_m > 0:
        raise InputError(
            f"the reference height is {reference_height_m} m above ground: it has to be above 0 m"
        )
    ratio = np.asarray(height_m, dtype=float) / reference_height_m
    if exponent == 0:
        return np.asarray(np.asarray(speed_mps, dtype=float) * np.ones_like(ratio))
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(np.asarray(speed_mps, dtype=float) * ratio**exponent)


def wind_at_mps(wind: WindState, position_m: ArrayLike) -> FloatArray:
    """Wind of a state at places around its target.

    Parameters
    ----------
    wind : WindState
        Speed at the target, shear, vertical wind and lateral gradient.
    position_m : array_like
        (..., 3) east, north, up from the target [m].

    Returns
    -------
    numpy.ndarray
        (..., 3) u, v, w [m/s]: direction times (V (1 + z/h)^α + a x), x to the right looking downwind; NaN
        below ground.

    Examples
    --------
    >>> state = WindState(speed_mps=10.0, from_deg=270.0, lateral_gradient_per_s=0.01)
    >>> wind_at_mps(state, [0.0, -100.0, 0.0]).round(3) + 0.0
    array([11.,  0.,  0.])
    """
    position = np.asarray(position_m, dtype=float)
    speed = power_law_mps(
        wind.height_m + position[..., 2],
        speed_mps=wind.speed_mps,
        reference_height_m=wind.height_m,
        exponent=wind.shear_exponent,
    )
    u, v = uv_mps(1.0, wind.from_deg)
    right = position[..., 0] * v - position[..., 1] * u
    speed = speed + wind.lateral_gradient_per_s * right
    return np.stack([speed * u, speed * v, np.full_like(speed, wind.vertical_mps)], axis=-1)


def gradient_per_s(wind: WindState, position_m: ArrayLike) -> FloatArray:
    """How the wind of a state changes from place to place.

    Parameters
    ----------
    wind : WindState
    position_m : array_like
        (..., 3) east, north, up from the target [m].

    Returns
    -------
    numpy.ndarray
        (..., 3, 3) ∂(u, v, w)/∂(east, north, up) [1/s]; ∂V/∂z = α V(z) / z of the power law, z above ground.

    Examples
    --------
    >>> state = WindState(speed_mps=10.0, from_deg=270.0, shear_exponent=0.2, height_m=100.0)
    >>> gradient_per_s(state, [0.0, 0.0, 0.0])[0].round(4) + 0.0
    array([0.  , 0.  , 0.02])
    """
    position = np.asarray(position_m, dtype=float)
    height = wind.height_m + position[..., 2]
    speed = power_law_mps(
        height, speed_mps=wind.speed_mps, reference_height_m=wind.height_m, exponent=wind.shear_exponent
    )
    along = np.append(np.stack(uv_mps(1.0, wind.from_deg)), 0.0)
    right = np.array([along[1], -along[0], 0.0])
    out = np.zeros((*position.shape, 3))
    out += wind.lateral_gradient_per_s * np.outer(along, right)
    if wind.shear_exponent != 0:
        with np.errstate(invalid="ignore", divide="ignore"):
            out[..., :, 2] += (wind.shear_exponent * speed / height)[..., None] * along
    return out


def probe_average_mps(
    wind_mps: Callable[[FloatArray], FloatArray],
    head_m: ArrayLike,
    azimuth_deg: ArrayLike,
    elevation_deg: ArrayLike,
    range_m: ArrayLike,
    *,
    probe: Probe,
    nodes: int = 9,
) -> FloatArray:
    """Radial speed averaged along the probe with the pulse's own weighting.

    Parameters
    ----------
    wind_mps : callable
        Takes (..., 3) places [m] and gives (..., 3) winds [m/s].
    head_m : array_like
        (..., 3) scanner head [m].
    azimuth_deg, elevation_deg, range_m : array_like
        (...,) beams [degrees] and centres of their gates [m].
    probe : Probe
        Pulse and window that make the weighting.
    nodes : int
        Points along the probe.

    Returns
    -------
    numpy.ndarray
        (...,) radial speed [m/s], positive away.

    Examples
    --------
    >>> uniform = lambda place: np.broadcast_to([3.0, 4.0, 0.0], place.shape)
    >>> seen = probe_average_mps(uniform, [0.0, 0.0, 0.0], 0.0, 0.0, 500.0, probe=Probe(pulse_ns=200,
    ...     window_ns=256))
    >>> round(float(seen), 6)
    4.0
    """
    offset, weight = probe.nodes(nodes)
    beam = unit_vector(azimuth_deg, elevation_deg)
    along = np.asarray(range_m, dtype=float)[..., None] + offset
    place = np.asarray(head_m, dtype=float)[..., None, :] + along[..., None] * beam[..., None, :]
    seen = np.einsum("...nk,...k->...n", wind_mps(place), beam)
    return np.asarray(seen @ weight / np.sum(weight))


def with_noise_mps(
    radial_speed_mps: ArrayLike, std_mps: ArrayLike, *, rng: np.random.Generator
) -> FloatArray:
    """Radial speeds [m/s] with white Gaussian noise of a standard deviation [m/s] added.

    Examples
    --------
    >>> with_noise_mps([1.0, 2.0], 0.0, rng=np.random.default_rng(1))
    array([1., 2.])
    """
    speed = np.asarray(radial_speed_mps, dtype=float)
    return np.asarray(speed + np.asarray(std_mps, dtype=float) * rng.standard_normal(speed.shape))
