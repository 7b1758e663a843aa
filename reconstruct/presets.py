"""Turbulence from the stability of the air, by the similarity of the surface layer: where nothing better is
known.

Surface-layer similarity holds to about a tenth of the boundary layer, 100 m on an ordinary day and less in
stable air; above that it is an extrapolation. A measured intensity and length are always better.
"""

import math
from typing import Literal

from geometry.errors import InputError
from reconstruct.spectra import EDDY_LENGTH_RATIO, Turbulence, TurbulenceModel

Stability = Literal["very unstable", "unstable", "neutral", "stable", "very stable"]

# One over the Obukhov length [1/m], near the middle of the classes of Gryning et al. (2007), Boundary-Layer
# Meteorol. 124, 251-268, doi:10.1007/s10546-007-9166-9 (of its seven, the two near neutral are left out).
INVERSE_OBUKHOV_PER_M: dict[Stability, float] = {
    "very unstable": -1 / 75,
    "unstable": -1 / 150,
    "neutral": 0.0,
    "stable": 1 / 125,
    "very stable": 1 / 30,
}
KARMAN = 0.4
KOLMOGOROV = 0.55  # of the longitudinal spectrum over k > 0: Kaimal & Finnigan (1994); 18/55 of the 1.7 of the energy spectrum


def stability_turbulence(
    stability: Stability,
    speed_mps: float,
    *,
    height_m: float,
    roughness_m: float,
    boundary_layer_m: float = 1000.0,
    model: TurbulenceModel = "von-karman",
) -> Turbulence:
    """Turbulence of a class of stability.

    Parameters
    ----------
    stability
        Class of the air.
    speed_mps
        Mean wind speed at the height [m/s], above 0.
    height_m
        Height above ground [m].
    roughness_m
        Roughness length of the ground [m], above 0 and below the height: .0002 the sea, .03 grass, .5 bushes.
    boundary_layer_m
        Height of the mixed layer [m]; acts in unstable air.
    model
        Model that carries on with intensity and length.

    Returns
    -------
    Turbulence
        Intensity limited to 1.

    Raises
    ------
    InputError
        If the class is unknown, the speed not above 0, or the heights are not in order.

    Notes
    -----
    u* = 0.4 V / (ln(z/z0) - psi), psi of Dyer (1974), Boundary-Layer Meteorol. 7, 363-372,
    doi:10.1007/BF00240838; sigma_u = u* (12 - 0.5 z_i/L)^(1/3): Panofsky et al. (1977),
    Boundary-Layer Meteorol. 11, 355-361, doi:10.1007/BF02186086, for unstable air; its neutral 12^(1/3) is
    kept in stable air; dissipation u*³ phi/(0.4 z), phi =
    (1 + 0.5 |z/L|^(2/3))^(3/2) or 1 + 5 z/L: Kaimal & Finnigan (1994), Atmospheric Boundary Layer Flows,
    chapter 1. The length gives the inertial subrange of that dissipation.

    Examples
    --------
    >>> for name in ("unstable", "neutral", "stable"):
    ...     air = stability_turbulence(name, 8.0, height_m=100.0, roughness_m=0.03)
    ...     print(name, round(air.intensity, 3), round(air.length_m))
    unstable 0.138 227
    neutral 0.113 288
    stable 0.076 58
    """
    if stability not in INVERSE_OBUKHOV_PER_M:
        raise InputError(f"stability {stability!r} came; allowed are {', '.join(INVERSE_OBUKHOV_PER_M)}")
    if not (speed_mps > 0 and 0 < roughness_m < height_m and boundary_layer_m > 0):
        raise InputError(
            f"speed {speed_mps} m/s, roughness {roughness_m} m, height {height_m} m and boundary layer "
            f"{boundary_layer_m} m came: all have to be above 0, the roughness below the height"
        )
    inverse = INVERSE_OBUKHOV_PER_M[stability]
    friction = KARMAN * speed_mps / (math.log(height_m / roughness_m) - _psi(height_m * inverse))
    ratio = (12 - 0.5 * boundary_layer_m * min(inverse, 0.0)) ** (1 / 3)
    dissipation = friction**3 * _dissipation(height_m * inverse) / (KARMAN * height_m)
    std = friction * ratio
    # (2/pi) sigma² L l^(-5/3) = 0.55 dissipation^(2/3), l = 1.339 L
    level = KOLMOGOROV * dissipation ** (2 / 3) * math.pi / 2 * EDDY_LENGTH_RATIO ** (5 / 3)
    length = (std**2 / level) ** 1.5
    return Turbulence(min(std / speed_mps, 1.0), length, model=model)


def _psi(zeta: float) -> float:
    """Stability correction of the logarithmic profile (Dyer 1974, integrated by Paulson 1970)."""
    if zeta >= 0:
        return -5 * zeta
    x = (1 - 16 * zeta) ** 0.25
    return 2 * math.log((1 + x) / 2) + math.log((1 + x * x) / 2) - 2 * math.atan(x) + math.pi / 2


def _dissipation(zeta: float) -> float:
    if zeta >= 0:
        return 1 + 5 * zeta
    return float((1 + 0.5 * abs(zeta) ** (2 / 3)) ** 1.5)
