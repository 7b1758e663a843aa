"""What a box of some size does to the variances that the judge finds: the exact sum over the waves of the box,
without drawing any. Prints the table of docs/decisions/judge-field.md.

Run from the root of the project: python tests/benchmarks/box_waves.py
"""

import importlib.util
import sys
from pathlib import Path
from typing import NamedTuple

import numpy as np

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT))

from geometry.arrays import FloatArray  # noqa: E402
from reconstruct.field import MARGIN_LENGTHS, subgrid_covariance  # noqa: E402
from reconstruct.flight import beams, carried_mps, reach_m, to_wind_frame  # noqa: E402
from reconstruct.rays import Rays  # noqa: E402
from reconstruct.retrieval import gain, rows  # noqa: E402
from reconstruct.spectra import Turbulence, spectral_tensor  # noqa: E402
from reconstruct.ten_minute import predict_ten_minute  # noqa: E402
from reconstruct.wind import WindState  # noqa: E402

PERIOD_S = 600.0
FINEST_PER_M = (0.012, 0.05, 0.05)  # along the wind, to the left, up: what ten minutes and a wide scan leave
FINEST_LENGTHS = 8.0  # wavenumber times L: what one scan leaves in the mean along its axis
REPAIRED = 2.0  # wavenumber times L under which the field gets back the variance that the box lost


class Scatter(NamedTuple):
    """Standard deviations of the mean direction over ten minutes [degrees], to first order."""

    lidar: float
    target: float
    difference: float


def waves(size_m: FloatArray, finest_per_m: tuple[float, float, float]) -> FloatArray:
    """Wave vectors (3, wave) of a periodic box [rad/m], both signs."""
    steps = 2 * np.pi / size_m
    axes = [
        step * np.arange(-int(end / step), int(end / step) + 1)
        for end, step in zip(finest_per_m, steps, strict=True)
    ]
    every = np.stack(np.meshgrid(*axes, indexing="ij")).reshape(3, -1)
    return every[:, np.any(every != 0, axis=0)]


def repair(air: Turbulence, size_m: FloatArray) -> float:
    """Factor on the variance of the long waves by which the field makes up for its box."""
    limit = REPAIRED / air.length_m
    inside = waves(size_m, (6 * limit,) * 3)
    number = np.linalg.norm(inside, axis=0)
    inside, number = inside[:, number < 6 * limit], number[number < 6 * limit]
    power = np.sum(spectral_tensor(air, inside)[:3], axis=0) * np.prod(2 * np.pi / size_m)
    wanted = 3 - float(np.trace(subgrid_covariance(air, 6 * limit)))
    return float(1 + (wanted - np.sum(power)) / np.sum(power[number < limit]))


def seen_of_scan(rays: Rays, wind: WindState, wave: FloatArray, fit: FloatArray, *, odd: bool) -> FloatArray:
    """Wind (wave, 3), by one row of a fit, that a wave's three components give one scan; odd scans run back."""
    velocity = carried_mps(wind)
    beam = beams(rays.azimuth_deg, rays.elevation_deg, wind.from_deg)
    centre = to_wind_frame(rays.centre_m, wind.from_deg)
    out = np.zeros((wave.shape[1], 3), dtype=complex)
    for ray, time_s in enumerate(rays.times_s(2)[int(odd)]):
        swept = np.radians(rays.swept_azimuth_deg[ray]) * (-1 if odd else 1) * rays.range_m[ray]
        way = swept * np.array([beam[ray, 1], -beam[ray, 0], 0.0]) - rays.duration_s[ray] * velocity
        seen = np.exp(1j * (centre[ray] - velocity * time_s) @ wave) * np.sinc(way @ wave / (2 * np.pi))
        out += (seen * rays.probes[0].transfer(beam[ray] @ wave) * fit[ray])[:, None] * beam[ray]
    return out


def responses(rays: Rays, wind: WindState, wave: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Mean wind to the left (wave, 3) that a wave's three components give the lidar and the target."""
    angle = np.radians(wind.from_deg)
    left = np.array([np.cos(angle), -np.sin(angle)]) @ gain(rows(rays.azimuth_deg, rays.elevation_deg))
    scans, turning = int(PERIOD_S / rays.period_s), carried_mps(wind) @ wave
    lidar = np.zeros((wave.shape[1], 3), dtype=complex)
    for odd in (False, True):
        starts = rays.period_s * np.arange(0, scans - odd, 2)
        repeated = np.exp(-1j * np.outer(turning, starts)).sum(axis=1) / scans
        lidar += repeated[:, None] * seen_of_scan(rays, wind, wave, left, odd=odd)
    middle = np.exp(-0.5j * turning * PERIOD_S) * np.sinc(turning * PERIOD_S / (2 * np.pi))
    return lidar, middle[:, None] * np.array([0.0, 1.0, 0.0])


def power_of(air: Turbulence, wave: FloatArray, size_m: FloatArray) -> FloatArray:
    """(3, 3, wave) covariance that each wave of the box has, long ones repaired."""
    c11, c22, c33, c12, c13, c23 = spectral_tensor(air, wave)
    tensor = np.array([[c11, c12, c13], [c12, c22, c23], [c13, c23, c33]])
    long_waves = np.linalg.norm(wave, axis=0) < REPAIRED / air.length_m
    return tensor * np.prod(2 * np.pi / size_m) * np.where(long_waves, repair(air, size_m), 1.0)


def carried(seen: FloatArray, power: FloatArray) -> float:
    """Variance that the waves give what is seen of them."""
    return float(np.einsum("wk,klw,wl->", seen, power, seen.conj(), optimize=True).real)


def scatter(rays: Rays, wind: WindState, air: Turbulence, margin_lengths: FloatArray) -> Scatter:
    """Scatter of a back-and-forth scan and of the target in a box that is (3,) lengths larger than what they
    meet.
    """
    size = reach_m(rays, wind, PERIOD_S) + margin_lengths * air.length_m
    wave = waves(size, FINEST_PER_M)
    power = power_of(air, wave, size)
    lidar, target = responses(rays, wind, wave)
    degrees = np.degrees(air.intensity)  # of a standard deviation across the mean wind
    found = [degrees * np.sqrt(carried(seen, power)) for seen in (lidar, target, lidar - target)]
    return Scatter(*(float(value) for value in found))


def along_axis(rays: Rays, wind: WindState, air: Turbulence, margin_lengths: FloatArray) -> float:
    """Variance of the first scan along a sector's axis, of waves down to `FINEST_LENGTHS` [m2/s2]."""
    size = reach_m(rays, wind, PERIOD_S) + margin_lengths * air.length_m
    wave = waves(size, (FINEST_LENGTHS / air.length_m,) * 3)
    middle = np.radians(np.mean(rays.azimuth_deg))
    axis = np.array([np.sin(middle), np.cos(middle)])
    fit = axis @ gain(rows(rays.azimuth_deg, rays.elevation_deg))
    found = carried(seen_of_scan(rays, wind, wave, fit, odd=False), power_of(air, wave, size))
    return found * air.std_mps(wind.speed_mps) ** 2


def hovsore() -> Rays:
    """The scan of the Høvsøre example."""
    path = ROOT / "examples" / "hovsore" / "compare_published.py"
    spec = importlib.util.spec_from_file_location("compare_published", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.scan()


def main() -> None:
    """Print the table."""
    rays, air = hovsore(), Turbulence(0.09, 170.0)
    print(
        "| wind | margin | one scan along its axis, over 14 L | lidar ° | target ° | difference ° | closed form ° |"
    )
    print("| --- | --- | --- | --- | --- | --- | --- |")
    for name, from_deg in (("along", 192.0), ("45° off", 237.0), ("across", 282.0)):
        wind = WindState(8.0, from_deg)
        closed = float(predict_ten_minute(rays, wind, air).direction_std_deg)
        large = along_axis(rays, wind, air, np.full(3, 14.0))
        for margin in (np.full(3, 5.0), np.full(3, 7.0), MARGIN_LENGTHS, np.full(3, 14.0)):
            found = scatter(rays, wind, air, margin)
            size = " x ".join(f"{length:g}" for length in np.unique(margin))
            numbers = " | ".join(f"{value:.3f}" for value in (*found, closed))
            print(f"| {name} | {size} L | {along_axis(rays, wind, air, margin) / large:.3f} | {numbers} |")


if __name__ == "__main__":
    main()
