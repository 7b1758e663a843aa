"""Fifty-digit answers for the extremes: each takes the very doubles that the code gets, and knows no numpy.

Nothing is imported from the packages under test.
"""

from collections.abc import Sequence

import mpmath
from mpmath import mp, mpf

DIGITS = 50
WGS84_A_M, WGS84_INVERSE_FLATTENING = mpf(6378137), "298.257223563"

Vector = list[mpf]


def digits(got: float, exact: mpf, scale: mpf | float | None = None) -> float:
    """Digits that agree: -log10 of the error over the exact value, or over a scale; 0 to 17."""
    with mp.workdps(DIGITS):
        error = abs(mpf(float(got)) - exact)
        size = abs(exact) if scale is None else abs(mpf(scale))
        if error == 0:
            return 17.0
        return float(max(0, min(17, -mpmath.log10(error / size)))) if size else 0.0


def radians(degrees: float) -> mpf:
    """Degrees in double precision to radians."""
    return mpf(float(degrees)) * mpmath.pi / 180


def unit_vector(azimuth_deg: float, elevation_deg: float) -> Vector:
    """East, north, up of a beam."""
    with mp.workdps(DIGITS):
        turn, lift = radians(azimuth_deg), radians(elevation_deg)
        return [mpmath.sin(turn) * mpmath.cos(lift), mpmath.cos(turn) * mpmath.cos(lift), mpmath.sin(lift)]


def dot(a: Sequence[mpf], b: Sequence[mpf]) -> mpf:
    """Scalar product."""
    return mpmath.fsum(x * y for x, y in zip(a, b, strict=True))


def product(a: Sequence[mpf], b: Sequence[mpf]) -> Vector:
    """Vector product."""
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def crossing(
    origin1: Sequence[float], beam1: Sequence[mpf], origin2: Sequence[float], beam2: Sequence[mpf]
) -> dict[str, mpf]:
    """Ranges, gap [m] and angle [deg] of two lines by their common perpendicular."""
    with mp.workdps(DIGITS):
        between = [mpf(float(b)) - mpf(float(a)) for a, b in zip(origin1, origin2, strict=True)]
        one, two = [mpf(x) for x in beam1], [mpf(x) for x in beam2]
        normal = product(one, two)
        square, length = dot(normal, normal), mpmath.sqrt(dot(normal, normal))
        return {
            "range1": dot(product(between, two), normal) / square * mpmath.sqrt(dot(one, one)),
            "range2": dot(product(between, one), normal) / square * mpmath.sqrt(dot(two, two)),
            "gap": abs(dot(between, normal)) / length,
            "angle": mpmath.degrees(mpmath.atan2(length, dot(one, two))),
        }


def least_squares(rows: Sequence[Sequence[mpf]], speeds: Sequence[float]) -> Vector:
    """Least-squares wind of rows and radial speeds; with 50 digits the normal equations lose nothing."""
    with mp.workdps(DIGITS):
        columns = list(zip(*rows, strict=True))
        speed = [mpf(float(v)) for v in speeds]
        matrix = mpmath.matrix([[dot(a, b) for b in columns] for a in columns])
        return list(mpmath.lu_solve(matrix, mpmath.matrix([dot(a, speed) for a in columns])))


def condition(rows: Sequence[Sequence[mpf]]) -> mpf:
    """Ratio of the singular values of rows with two columns."""
    with mp.workdps(DIGITS):
        first, second = zip(*rows, strict=True)
        a, b, c = dot(first, first), dot(first, second), dot(second, second)
        root = mpmath.sqrt(((a - c) / 2) ** 2 + b * b)
        middle = (a + c) / 2
        return mpmath.sqrt((middle + root) ** 2 / (a * c - b * b))


def sector_noise(rays: int, step_deg: float, elevation_deg: float = 0.0) -> tuple[mpf, mpf, mpf]:
    """Noise along and across the axis per m/s of white noise, and the condition, of an even sector.

    S = sin(NΔ)/(N sinΔ); along sqrt(2/(N(1+S)))/cosφ, across sqrt(2/(N(1-S)))/cosφ, sqrt((1+|S|)/(1-|S|)).
    """
    with mp.workdps(DIGITS):
        step = radians(step_deg)
        s = mpmath.sin(rays * step) / (rays * mpmath.sin(step))
        level = mpmath.cos(radians(elevation_deg))
        along, across = (mpmath.sqrt(2 / (rays * (1 + sign * s))) / level for sign in (1, -1))
        return along, across, mpmath.sqrt((1 + abs(s)) / (1 - abs(s)))


def utm(
    longitude_deg: float, latitude_deg: float, *, meridian_deg: float, south: bool
) -> tuple[mpf, mpf, mpf, mpf]:
    """Easting, northing [m], convergence [deg] and scale of UTM on WGS 84, by the definition.

    The transverse Mercator is the meridian arc continued to complex latitudes: the complex latitude φ' has
    the isometric latitude ψ + iλ, and northing + i easting is the arc from the equator to φ'. The derivative
    gives scale and convergence (Lee 1976, Cartographica monograph 16).
    """
    with mp.workdps(DIGITS):
        e2 = _eccentricity_squared()
        e, a, k0 = mpmath.sqrt(e2), WGS84_A_M, mpf("0.9996")
        turn = (mpf(float(longitude_deg)) - mpf(float(meridian_deg)) + 180) % 360 - 180
        latitude, lam = radians(latitude_deg), turn * mpmath.pi / 180

        def isometric(phi: mpf) -> mpf:
            sine = mpmath.sin(phi)
            return mpmath.atanh(sine) - e * mpmath.atanh(e * sine)

        def slope(phi: mpf) -> mpf:
            return (1 - e2) / ((1 - e2 * mpmath.sin(phi) ** 2) * mpmath.cos(phi))

        wanted = isometric(latitude) + 1j * lam
        phi = 2 * mpmath.atan(mpmath.exp(wanted)) - mpmath.pi / 2
        for _ in range(60):
            step = (isometric(phi) - wanted) / slope(phi)
            phi -= step
            if abs(step) < mpf(10) ** (-DIGITS + 6):
                break

        def arc(p: mpf) -> mpf:
            return a * (1 - e2) * (1 - e2 * mpmath.sin(p) ** 2) ** mpf("-1.5")

        plane = k0 * mpmath.quad(arc, [0, phi / 2, phi])
        # d(plane)/d(ψ + iλ) over the same at the real latitude: radius of the parallel
        rate = k0 * arc(phi) / slope(phi)
        parallel = a * mpmath.cos(latitude) / mpmath.sqrt(1 - e2 * mpmath.sin(latitude) ** 2)
        northing = plane.real + (10_000_000 if south else 0)
        # true north runs along +ψ; its image lies arg(rate) clockwise of grid north
        return plane.imag + 500_000, northing, -mpmath.degrees(mpmath.arg(rate)), abs(rate) / parallel


def enu(head: Sequence[float], point: Sequence[float]) -> Vector:
    """East, north, up [m] of one (longitude, latitude [deg], height [m]) from another on WGS 84."""
    with mp.workdps(DIGITS):
        x, y, z = (p - h for p, h in zip(_ecef(point), _ecef(head), strict=True))
        lam, phi = radians(head[0]), radians(head[1])
        outward = mpmath.cos(lam) * x + mpmath.sin(lam) * y
        return [
            -mpmath.sin(lam) * x + mpmath.cos(lam) * y,
            -mpmath.sin(phi) * outward + mpmath.cos(phi) * z,
            mpmath.cos(phi) * outward + mpmath.sin(phi) * z,
        ]


def karman(distance: mpf, eddy_length: mpf) -> tuple[mpf, mpf]:
    """Longitudinal f and lateral g of von Kármán turbulence."""
    third = mpf(1) / 3
    x = mpf(distance) / eddy_length
    if x == 0:
        return mpf(1), mpf(1)
    c = 2 ** (2 * third) / mpmath.gamma(third)
    f = c * x**third * mpmath.besselk(third, x)
    return f, f - c / 2 * x ** (4 * third) * mpmath.besselk(2 * third, x)


def eddy_length(length_m: float) -> mpf:
    """l of the longitudinal integral length scale L: l = L Γ(1/3)/(√π Γ(5/6))."""
    third = mpf(1) / 3
    return mpf(length_m) * mpmath.gamma(third) / (mpmath.sqrt(mpmath.pi) * mpmath.gamma(mpf(5) / 6))


def _eccentricity_squared() -> mpf:
    flattening = 1 / mpf(WGS84_INVERSE_FLATTENING)
    return flattening * (2 - flattening)


def _ecef(place: Sequence[float]) -> Vector:
    lam, phi, height = radians(place[0]), radians(place[1]), mpf(float(place[2]))
    e2 = _eccentricity_squared()
    prime = WGS84_A_M / mpmath.sqrt(1 - e2 * mpmath.sin(phi) ** 2)
    level = (prime + height) * mpmath.cos(phi)
    return [level * mpmath.cos(lam), level * mpmath.sin(lam), (prime * (1 - e2) + height) * mpmath.sin(phi)]
