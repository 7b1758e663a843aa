"""How many digits survive where: prints the table of docs/digits.md.

Run from the root of the project: python tests/extremes/digits.py. Every number is measured against 50-digit
arithmetic or a closed form; 17 stands for no error at all.
"""

import sys
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import mpmath
import numpy as np
from mpmath import mp, mpf

sys.path.insert(0, str(Path(__file__).parents[2]))

from geometry.beams import beam_to, point_at, unit_vector
from geometry.crossing import cross
from geometry.frames import SiteFrame
from geometry.gates import Probe
from geometry.head import HeadLimits
from geometry.scans import sector
from reconstruct.correlation import correlation
from reconstruct.covariance import lag_covariance
from reconstruct.lidar_map import pair_map
from reconstruct.moments import wind_moments
from reconstruct.prediction import predict_noise
from reconstruct.rays import Rays
from reconstruct.retrieval import condition, rows, solve
from reconstruct.spectra import Turbulence
from reconstruct.uncertainty import ErrorSources
from reconstruct.wind import WindState
from tests.extremes import oracle
from tests.extremes.oracle import digits

PROBE = Probe(pulse_ns=200, window_ns=256)
HEAD = HeadLimits(50, 50, 100, 100)


class Row(NamedTuple):
    """One line of the table."""

    quantity: str
    where: str
    digits: float | None  # None: the answer is NaN or None, with a reason
    condition: float | None = None


def table() -> list[Row]:
    """Measure every row."""
    parts = (_beams, _frames, _crossings, _retrievals, _noise, _moments, _turbulence, _maps)
    return [row for part in parts for row in part()]


def markdown(lines: list[Row]) -> str:
    """Table as it stands in the document."""
    out = ["| what | where | digits | condition |", "|---|---|---|---|"]
    for line in lines:
        known = "NaN" if line.digits is None else f"{line.digits:.0f}"
        number = (
            "" if line.condition is None else f"{line.condition:.1e}".replace("e+0", "e").replace("e+", "e")
        )
        out.append(f"| {line.quantity} | {line.where} | {known} | {number} |")
    return "\n".join(out)


def ray_set(
    width_deg: float,
    count: int,
    *,
    elevation_deg: float = 0.0,
    range_m: float = 1000.0,
    axis_deg: float = 0.0,
) -> Rays:
    """A sector of that width around an axis, its target in the middle."""
    step = width_deg / count
    return Rays(
        azimuth_deg=axis_deg + step * (np.arange(count) - 0.5 * (count - 1)),
        elevation_deg=np.full(count, elevation_deg),
        range_m=np.full(count, range_m),
        head_m=np.tile(-point_at(axis_deg, elevation_deg, range_m), (count, 1)),
        lidar=np.zeros(count, dtype=np.intp),
        time_s=12.0 / count * (np.arange(count) + 0.5),
        duration_s=np.full(count, 12.0 / count),
        swept_azimuth_deg=np.full(count, step),
        probes=(PROBE,),
        period_s=12.5,
    )


def stare(length_m: float) -> tuple[float, mpf]:
    """Variance of one resting ray over that of a point: measured, and the integral of the correlation."""
    one = ray_set(0.0, 1)
    slow = WindState(speed_mps=1.0, from_deg=0.0)
    got = float(lag_covariance(one, slow, Turbulence(1.0, length_m), sweep=False)[0, 0, 0, 0])
    return got, _probe_average(length_m)


def _probe_average(length_m: float) -> mpf:
    """Double integral of the weighting with f: the offset of two places has a normal and a triangular part."""
    with mp.workdps(20):
        std, window = mpf(PROBE.pulse_std_m), mpf(PROBE.window_m)
        eddy = oracle.eddy_length(length_m)

        def density(r: mpf) -> mpf:
            """Of the offset: second difference of the twice integrated normal density of variance 2σ²."""
            s = std * mpmath.sqrt(2)

            def ramp(x: mpf) -> mpf:
                return x * mpmath.ncdf(x / s) + s * mpmath.npdf(x / s)

            return (ramp(r + window) - 2 * ramp(r) + ramp(r - window)) / window**2

        end = window + 12 * std
        # in the cube root of the offset, in which the correlation is smooth at 0
        cuts = [mpf(0), *(mpmath.cbrt(x) for x in sorted({min(eddy, end), min(6 * eddy, end), end}))]
        return 2 * mpmath.quad(lambda x: 3 * x**2 * density(x**3) * oracle.karman(x**3, eddy)[0], cuts)


def _beams() -> Iterator[Row]:
    for range_m in (1.0, 1e5):
        for elevation in (0.0, 45.0, 89.999999):
            enu = point_at(217.3, elevation, range_m)
            with mp.workdps(oracle.DIGITS):
                e, n, u = (mpf(float(x)) for x in enu)
                level = mpmath.hypot(e, n)
                exact = (
                    mpmath.degrees(mpmath.atan2(e, n)) % 360,
                    mpmath.degrees(mpmath.atan2(u, level)),
                    mpmath.hypot(level, u),
                )
            found = beam_to(enu)
            worst = min(
                digits(float(g), x, s) for g, x, s in zip(found, exact, (360, 90, range_m), strict=True)
            )
            yield Row(
                "azimuth, elevation, range of a point", f"{range_m:g} m, elevation {elevation:.9g}°", worst
            )
    scan = sector(217.3, 0.0, sector_deg=0.001, step_deg=1e-8, accumulation_s=0.1, head=HEAD)
    with mp.workdps(oracle.DIGITS):
        start = mpf(217.3) - mpf(0.001) / 2
        step = mpf(0.001) / 100_000
        worst = min(
            digits(scan.azimuth_deg[i], start + (i + mpf(0.5)) * step, step) for i in range(0, 100_000, 997)
        )
    yield Row("place of a ray, in steps", "100,000 rays in 0.001°", worst)


#: name, CRS, longitude, latitude, central meridian, south
PLACES = (
    ("zone edge, 60° N", "EPSG:32632", 6.0, 60.0, 9.0, False),
    ("two zones off, 60° N", "EPSG:32632", 20.0, 60.0, 9.0, False),
    ("beside the equator", "EPSG:32632", 11.9, 0.001, 9.0, False),
    ("84° N, zone edge", "EPSG:32633", 12.0, 84.0, 15.0, False),
    ("80° S, zone edge", "EPSG:32760", 174.0, -80.0, 177.0, True),
    ("antimeridian from the west", "EPSG:32760", 179.99999, -17.0, 177.0, True),
    ("antimeridian from the east", "EPSG:32601", -179.99999, 65.0, -177.0, False),
)


def frame_errors(
    crs: str, longitude: float, latitude: float, meridian: float, south: bool, range_m: float
) -> tuple[mpf, float, float]:
    """Error of a position in east, north, up [m], digits of convergence and of scale."""
    turn = np.degrees(range_m / 6.4e6)
    ends = (
        (longitude, latitude, 5.0),
        (
            longitude + 0.6 * turn / np.cos(np.radians(latitude)),
            latitude - 0.8 * turn,
            105.0,
        ),
    )
    plane = [oracle.utm(*end[:2], meridian_deg=meridian, south=south) for end in ends]
    grid = [[float(e), float(n), h[2]] for (e, n, _, _), h in zip(plane, ends, strict=True)]
    frame, exact = SiteFrame(crs), oracle.enu(*ends)
    got = frame.enu_m(grid[0], grid[1])
    error = max(abs(mpf(float(g)) - x) for g, x in zip(got, exact, strict=True))
    convergence, scale = plane[0][2:]
    return (
        error,
        digits(float(frame.convergence_deg(grid[0])), convergence, 1),
        digits(float(frame.scale_factor(grid[0])), scale),
    )


def _frames() -> Iterator[Row]:
    for name, *place in PLACES:
        for range_m in (1.0, 1e5):
            error, turn, scale = frame_errors(*place, range_m=range_m)
            size = float(max(0, min(17, -mpmath.log10(error / range_m)))) if error else 17.0
            yield Row(f"position at {range_m / 1000:g} km, of the range", name, size)
        yield Row("convergence (of 1°) and point scale", name, min(turn, scale))
    frame = SiteFrame("EPSG:32760")
    head, point = [500_000.4, 9_999_999.7, 5.0], [500_800.1, 9_999_399.2, 105.0]
    exact = frame.enu_m(head, point)
    off = np.abs(frame.enu_m(np.float32(head), np.float32(point)) - exact).max()
    yield Row(
        "position at 1 km, of the range", "coordinates of 1e7 m in float32", float(-np.log10(off / 1000.0))
    )


def _crossings() -> Iterator[Row]:
    heads = [0.0, 0.0, 0.0], [1000.0, -1000.0, 5.0]
    for angle in (1e-9, 1e-6, 1e-3, 1.0, 90.0, 179.999, 180 - 1e-9, 180.0):
        beams = unit_vector(33.0, 2.0), unit_vector(33.0 + angle, 2.0 if angle < 90 else -2.0)
        got = cross(heads[0], beams[0], heads[1], beams[1])
        if np.isnan(got.range1_m):
            yield Row("range of a crossing", f"{angle:.12g}°", None, np.inf)
            continue
        asked = [oracle.unit_vector(33.0, 2.0), oracle.unit_vector(33.0 + angle, 2.0 if angle < 90 else -2.0)]
        for name, given in (("its vectors", beams), ("its degrees", asked)):
            exact = oracle.crossing(heads[0], list(given[0]), heads[1], list(given[1]))
            worst = min(
                digits(float(got.range1_m), exact["range1"]), digits(float(got.angle_deg), exact["angle"])
            )
            number = 1 / float(mpmath.sin(mpmath.radians(exact["angle"])))
            yield Row(f"range and angle of a crossing, of {name}", f"{angle:.12g}°", worst, number)


def wind_digits(azimuth_deg: np.ndarray, elevation_deg: float) -> tuple[float | None, float]:
    """Digits of a wind of 3, -9 m/s that fits exactly, and the condition."""
    beams = [oracle.unit_vector(float(a), elevation_deg)[:2] for a in azimuth_deg]
    speed = [float(3 * s - 9 * c) for s, c in beams]
    fit = solve(rows(azimuth_deg, elevation_deg), speed)
    if int(fit.status):
        return None, float(fit.condition)
    exact = oracle.least_squares(beams, speed)
    size = mpmath.hypot(*exact)
    return min(digits(g, x, size) for g, x in zip(fit.wind_mps, exact, strict=True)), float(fit.condition)


def _retrievals() -> Iterator[Row]:
    for width, count in ((0.001, 2), (0.001, 30), (0.1, 30), (8.0, 5), (60.0, 30), (360.0, 3), (360.0, 30)):
        found = wind_digits(217.3 + width / count * np.arange(count), 3.0)
        yield Row("wind of a sector", f"{width:g}°, {count} rays", *found)
    yield Row("wind of a sector", "360°, 2 rays", *wind_digits(np.array([37.3, 217.3]), 3.0))
    yield Row(
        "wind of a sector", "60°, 30 rays, elevation 89.999°", *wind_digits(30 + 2 * np.arange(30.0), 89.999)
    )
    yield Row("wind of a sector", "60°, 30 rays, elevation 90°", *wind_digits(30 + 2 * np.arange(30.0), 90.0))
    for angle in (1e-11, 1e-9, 1e-6, 90.0, 180 - 1e-9, 180.0):
        found = wind_digits(np.array([33.0, 33.0 + angle]), 0.0)
        yield Row("wind of two beams", f"crossing at {angle:.12g}°", *found)
    for width in (0.001, 360.0):
        azimuth = width / 100_000 * (np.arange(100_000) - 49_999.5)
        exact = oracle.sector_noise(100_000, width / 100_000)[2]
        number = float(condition(rows(azimuth, 0.0)))
        yield Row("condition", f"{width:g}°, 100,000 rays", digits(number, exact, max(exact, 1)), number)


def noise_digits(width_deg: float, count: int) -> tuple[float, float]:
    """Digits of the standard deviations along and across a sector to the north, and the condition."""
    got = predict_noise(ray_set(width_deg, count), WindState(10.0, 0.0), 0.1)
    along, across, _ = oracle.sector_noise(count, width_deg / count)
    std = np.sqrt(np.diagonal(got.covariance_m2s2))
    return min(digits(std[0], across / 10), digits(std[1], along / 10)), got.condition


def _noise() -> Iterator[Row]:
    for width, count in ((0.001, 2), (0.001, 30), (0.001, 100_000), (60.0, 30), (360.0, 3), (360.0, 100_000)):
        yield Row("noise of the wind", f"{width:g}°, {count:,} rays", *noise_digits(width, count))


def across_mean(speed: float, std: float) -> mpf:
    """Mean of |V| when the error lies across the wind alone: √2 σ U(-1/2, 0, V²/2σ²)."""
    with mp.workdps(oracle.DIGITS):
        z = mpf(speed) ** 2 / (2 * mpf(std) ** 2)
        return mpmath.sqrt(2) * std * mpmath.hyperu(mpf(-1) / 2, 0, z)


def rice_mean(speed: float, std: float) -> mpf:
    """Mean of |V| when both components err alike."""
    with mp.workdps(oracle.DIGITS):
        x = mpf(speed) ** 2 / (2 * mpf(std) ** 2)
        bessel = (1 + x) * mpmath.besseli(0, x / 2) + x * mpmath.besseli(1, x / 2)
        return std * mpmath.sqrt(mpmath.pi / 2) * mpmath.exp(-x / 2) * bessel


def _moments() -> Iterator[Row]:
    for std in (0.001, 1.0, 100.0, 16_205.0):
        got = wind_moments([0.0, -10.0], np.diag([std**2, 0.0]))
        exact = across_mean(10.0, std)
        yield Row(
            "mean speed", f"10 m/s, error of {std:g} m/s across alone", digits(10 + got.speed_bias_mps, exact)
        )
        yield Row(
            "bias of the speed",
            f"10 m/s, error of {std:g} m/s across alone",
            digits(got.speed_bias_mps, exact - 10),
        )
    for speed in (0.0, 1e-3, 10.0):
        got = wind_moments([0.0, -speed], np.diag([100.0, 100.0]))
        yield Row(
            "mean speed",
            f"{speed:g} m/s, error of 10 m/s each way",
            digits(speed + got.speed_bias_mps, rice_mean(speed, 10)),
        )
    lost = wind_moments([0.0, -1e-12], np.diag([100.0, 100.0])).direction_bias_deg
    yield Row("mean direction", "1e-12 m/s, error of 10 m/s each way", None if np.isnan(lost) else 0.0)


def _turbulence() -> Iterator[Row]:
    for length in (1.0, 170.0, 1e4):
        worst = 17.0
        for ratio in (1e-6, 1e-3, 0.1, 1.0, 5.0):
            apart = np.array([ratio * length, 0.0, 0.0])
            f, g = oracle.karman(mpf(ratio * length), oracle.eddy_length(length))
            tensor = correlation(Turbulence(0.1, length))
            for axis, exact in zip(np.eye(3)[:2], (f, g), strict=True):
                worst = min(worst, digits(float(tensor(apart, axis, axis)), exact, 1))
        yield Row("correlation at 0.000001 to 5 lengths, of 1", f"length {length:g} m", worst)
        yield Row("variance of a resting ray", f"length {length:g} m, probe 43 m", digits(*stare(length)))


def _maps() -> Iterator[Row]:
    noise = ErrorSources(radial_speed_mps=0.1)
    wind = WindState(10.0, 0.0)
    scenes = (
        ("1 m", 1.0, 0.0, 0.5),
        ("100 km", 1e5, 0.0, 0.5),
        ("1 km, coordinates of 1e7 m", 1000.0, 1e7, 0.5),
        ("baseline 1 km, 1e-9° off it", 1000.0, 0.0, 0.5e-11),
        ("baseline 1 km, on it", 1000.0, 0.0, 0.0),
    )
    for name, size, origin, side in scenes:
        heads = np.array([[origin, 0.0, 0.0], [origin + size, 0.0, 0.0]])
        target = [origin + 0.4 * size, side * size, 0.1 * size if side > 0.1 else 0.0]
        got = pair_map(heads, *target, wind, noise)
        if np.isnan(got.speed_std_mps):
            yield Row("error of two lidars", name, None, float(got.condition))
            continue
        with mp.workdps(oracle.DIGITS):
            beams = [
                [mpf(float(t)) - mpf(float(h)) for t, h in zip(target, head, strict=True)] for head in heads
            ]
            a, b = ([x / mpmath.sqrt(oracle.dot(beam, beam)) for x in beam] for beam in beams)
            exact = mpmath.hypot(a[0], b[0]) / abs(a[0] * b[1] - a[1] * b[0]) / 10
        yield Row("error of two lidars", name, digits(got.speed_std_mps, exact), float(got.condition))


if __name__ == "__main__":
    sys.stdout.write(markdown(table()) + "\n")
