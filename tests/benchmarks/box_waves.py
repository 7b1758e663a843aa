"""What box and single waves of the judge together leave of the variances that a scan and ten minutes have: exact
sums over the waves of the box, and integrals over the spectrum for the rest, without drawing any amplitude.
Prints the table of docs/decisions/judge-field.md.

Run from the root of the project: python tests/benchmarks/box_waves.py
"""

import importlib.util
import sys
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT))

from geometry.arrays import FloatArray  # noqa: E402
from reconstruct.field import MARGIN_LENGTHS  # noqa: E402
from reconstruct.flight import beams, carried_mps, reach_m, to_wind_frame  # noqa: E402
from reconstruct.rays import Rays  # noqa: E402
from reconstruct.retrieval import gain, rows  # noqa: E402
from reconstruct.spectra import Turbulence, spectral_tensor  # noqa: E402
from reconstruct.ten_minute import predict_ten_minute  # noqa: E402
from reconstruct.turbulent import turbulence_covariance  # noqa: E402
from reconstruct.waves import long_share  # noqa: E402
from reconstruct.wind import WindState  # noqa: E402

PERIOD_S = 600.0
OF_PERIOD = (2.0, 10.0, 10.0)  # wavenumber times L up to which the box is summed, along the wind, left, up
OF_SCAN = (14.0, 14.0, 14.0)
LONGEST_M, SHORTEST_M = 6e5, 4.0  # of the integrals over the spectrum, 2 pi over the wavenumber
DRAWN = 100_000  # waves of those integrals
CHUNK = 20_000

Seen = Callable[[FloatArray], FloatArray]  # (wave, 3) by which a wave's three components count


class Share(NamedTuple):
    """A variance by box and waves over that by the whole spectrum, and the latter [(m/s)² for 1 m/s]."""

    share: float
    whole: float


def box_waves(size_m: FloatArray, finest_per_m: FloatArray) -> Iterator[FloatArray]:
    """Wave vectors (3, wave) of a periodic box [rad/m], both signs, some at a time."""
    steps = 2 * np.pi / size_m
    x, y, z = (
        step * np.arange(-int(end / step), int(end / step) + 1)
        for end, step in zip(finest_per_m, steps, strict=True)
    )
    rows_at_once = max(1, CHUNK // (len(y) * len(z)))
    for start in range(0, len(x), rows_at_once):
        every = np.stack(np.meshgrid(x[start : start + rows_at_once], y, z, indexing="ij")).reshape(3, -1)
        yield every[:, np.any(every != 0, axis=0)]


def drawn_waves(rng: np.random.Generator) -> Iterator[tuple[FloatArray, FloatArray]]:
    """Wave vectors (3, wave) of all lengths [rad/m], crowding across the wind, and the space that each stands for."""
    low, high = np.log(2 * np.pi / LONGEST_M), np.log(2 * np.pi / SHORTEST_M)
    for start in range(0, DRAWN, CHUNK):
        strata = (start + np.arange(CHUNK) + rng.uniform(size=CHUNK)) / DRAWN
        wavenumber = np.exp(low + (high - low) * strata)
        root, turn = rng.uniform(-1, 1, CHUNK), rng.uniform(0, 2 * np.pi, CHUNK)
        level = np.sqrt(1 - root**6)
        direction = np.stack([root**3, level * np.cos(turn), level * np.sin(turn)])
        yield wavenumber * direction, 12 * np.pi * root**2 * wavenumber**3 * ((high - low) / DRAWN)


def power(air: Turbulence, wave: FloatArray, seen: FloatArray) -> FloatArray:
    """(wave,) density that waves give what is seen of them."""
    c11, c22, c33, c12, c13, c23 = spectral_tensor(air, wave)
    tensor = np.array([[c11, c12, c13], [c12, c22, c23], [c13, c23, c33]])
    return np.asarray(np.einsum("wk,klw,wl->w", seen, tensor, seen.conj(), optimize=True).real)


def kept(air: Turbulence, size_m: FloatArray, lengths: tuple[float, float, float], seen: Seen) -> Share:
    """Share of a variance that box and single waves leave."""
    finest = np.array(lengths) / air.length_m
    inside = 0.0
    for wave in box_waves(size_m, finest):
        boxed = 1 - long_share(air, np.linalg.norm(wave, axis=0))
        inside += float(np.sum(boxed * power(air, wave, seen(wave)))) * float(np.prod(2 * np.pi / size_m))
    edge = (np.floor(finest * size_m / (2 * np.pi)) + 0.5) * 2 * np.pi / size_m  # of the outermost cells
    whole = outside = 0.0
    for wave, space in drawn_waves(np.random.default_rng(1)):
        each = space * power(air, wave, seen(wave))
        whole += float(np.sum(each))
        summed = np.all(np.abs(wave) < edge[:, None], axis=0)
        outside += float(np.sum(each * np.where(summed, long_share(air, np.linalg.norm(wave, axis=0)), 1.0)))
    return Share((inside + outside) / whole, whole)


def seen_of_scan(rays: Rays, wind: WindState, wave: FloatArray, fit: FloatArray, *, odd: bool) -> FloatArray:
    """Wind (wave, 3), by one row of a fit, that a wave's three components give one scan; odd scans run back."""
    velocity = carried_mps(wind)
    beam = beams(rays.azimuth_deg, rays.elevation_deg, wind.from_deg)
    centre = to_wind_frame(rays.centre_m, wind.from_deg)
    out = np.zeros((wave.shape[1], 3), dtype=complex)
    for ray, time_s in enumerate(rays.times_s(2)[int(odd)] - rays.period_s * odd):
        swept = np.radians(rays.swept_azimuth_deg[ray]) * (-1 if odd else 1) * rays.range_m[ray]
        way = swept * np.array([beam[ray, 1], -beam[ray, 0], 0.0]) - rays.duration_s[ray] * velocity
        seen = np.exp(1j * (centre[ray] - velocity * time_s) @ wave) * np.sinc(way @ wave / (2 * np.pi))
        out += (seen * rays.probes[0].transfer(beam[ray] @ wave) * fit[ray])[:, None] * beam[ray]
    return out


def component(rays: Rays, toward_deg: float) -> FloatArray:
    """(ray,) row of the fit that gives the wind toward a direction."""
    angle = np.radians(toward_deg)
    return np.asarray(
        np.array([np.sin(angle), np.cos(angle)]) @ gain(rows(rays.azimuth_deg, rays.elevation_deg))
    )


def seen_in_ten_minutes(rays: Rays, wind: WindState, wave: FloatArray) -> FloatArray:
    """Mean wind to the left (wave, 3) that a wave's three components give the lidar, less that of the target."""
    left = component(rays, wind.from_deg + 90.0)
    scans, turning = int(PERIOD_S / rays.period_s), carried_mps(wind) @ wave
    lidar = np.zeros((wave.shape[1], 3), dtype=complex)
    for odd in (False, True):
        starts = rays.period_s * np.arange(int(odd), scans, 2)
        repeated = np.exp(-1j * np.outer(turning, starts)).sum(axis=1) / scans
        lidar += repeated[:, None] * seen_of_scan(rays, wind, wave, left, odd=odd)
    middle = np.exp(-0.5j * turning * PERIOD_S) * np.sinc(turning * PERIOD_S / (2 * np.pi))
    return np.asarray(lidar - middle[:, None] * np.array([0.0, 1.0, 0.0]))


def along_axis(rays: Rays, wind: WindState, air: Turbulence, margin_lengths: FloatArray) -> Share:
    """Variance along a sector's axis of a scan that runs forward."""
    size = reach_m(rays, wind, PERIOD_S) + margin_lengths * air.length_m
    fit = component(rays, float(np.mean(rays.azimuth_deg)))
    return kept(air, size, OF_SCAN, lambda wave: seen_of_scan(rays, wind, wave, fit, odd=False))


def ten_minutes(rays: Rays, wind: WindState, air: Turbulence, margin_lengths: FloatArray) -> Share:
    """Variance of the mean wind across in ten minutes, scan less target."""
    size = reach_m(rays, wind, PERIOD_S) + margin_lengths * air.length_m
    return kept(air, size, OF_PERIOD, lambda wave: seen_in_ten_minutes(rays, wind, wave))


def hovsore() -> Rays:
    """The scan of the Høvsøre example."""
    path = ROOT / "examples" / "hovsore" / "compare_published.py"
    spec = importlib.util.spec_from_file_location("compare_published", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.scan()


def main() -> None:
    """Print the table."""
    rays = hovsore()
    axis = np.radians(np.mean(rays.azimuth_deg))
    toward = np.array([np.sin(axis), np.cos(axis)])
    print(
        "| spectrum | wind | margin | along the axis: kept | spectrum (m/s)² | tier | 10': kept | spectrum ° | tier ° |"
    )
    print("| --- " * 9 + "|")
    for air in (Turbulence(0.09, 170.0), Turbulence(0.09, 170.0, "mann")):
        for name, from_deg in (("along", 192.0), ("45° off", 237.0), ("across", 282.0)):
            wind = WindState(8.0, from_deg)
            forward = replace(rays, back_and_forth=False)
            variance = float(toward @ turbulence_covariance(forward, wind, air) @ toward)
            direction = float(predict_ten_minute(rays, wind, air).direction_std_deg)
            for lengths in (2.0, float(MARGIN_LENGTHS[0])):
                margin = np.full(3, lengths)
                one, ten = (measure(rays, wind, air, margin) for measure in (along_axis, ten_minutes))
                size = f"{one.whole * air.std_mps(8.0) ** 2:.4f} | {variance:.4f}"
                degrees = np.degrees(air.intensity * np.sqrt(ten.whole))
                print(
                    f"| {air.model} | {name} | {lengths:g} L | {one.share:.3f} | {size} | {ten.share:.3f} "
                    f"| {degrees:.3f} | {direction:.3f} |",
                    flush=True,
                )


if __name__ == "__main__":
    main()
