"""Set the turbulent tier beside the Monte Carlo judge on many scenes and print the table of
docs/tier_comparison.md.

Run from the root of the project: python tests/benchmarks/compare_judge.py [--fields 200] [--seed 1]
"""

import argparse
import sys
import time
from pathlib import Path
from typing import NamedTuple

import numpy as np

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT))

from geometry.beams import unit_vector  # noqa: E402
from geometry.gates import Probe  # noqa: E402
from reconstruct.monte_carlo import Scene, Settings, simulate_scenes  # noqa: E402
from reconstruct.periods import TEN_MINUTES_S  # noqa: E402
from reconstruct.rays import Rays  # noqa: E402
from reconstruct.spectra import Turbulence  # noqa: E402
from reconstruct.ten_minute import predict_ten_minute  # noqa: E402
from reconstruct.turbulent import predict_turbulent  # noqa: E402
from reconstruct.uncertainty import ErrorSources  # noqa: E402
from reconstruct.verdict import judge  # noqa: E402
from reconstruct.wind import WindState  # noqa: E402

SHORT, LONG = Probe(pulse_ns=200, window_ns=256), Probe(pulse_ns=400, window_ns=512)
AGREED_ERRORS, AGREED_SHARE = 3.0, 0.02  # three standard errors or two per cent
NAMES = (
    "var across",
    "var along",
    "speed std",
    "speed bias",
    "dir std",
    "10' bias",
    "10' std",
    "10' dir std",
)


def sector(rays: int, step_deg: float, *, back_and_forth: bool = True, range_m: float = 1160.0) -> Rays:
    """A sector scan towards the north, its middle through the target, 0.4 s a ray."""
    azimuth = step_deg * (np.arange(rays) - 0.5 * (rays - 1))
    return Rays(
        azimuth_deg=azimuth,
        elevation_deg=np.full(rays, 6.0),
        range_m=np.full(rays, range_m),
        head_m=np.tile(-range_m * unit_vector(0.0, 6.0), (rays, 1)),
        lidar=np.zeros(rays, dtype=np.intp),
        time_s=0.4 * (np.arange(rays) + 0.5),
        duration_s=np.full(rays, 0.4),
        swept_azimuth_deg=np.full(rays, step_deg),
        probes=(SHORT,),
        period_s=0.4 * rays + 0.8,
        back_and_forth=back_and_forth,
    )


def dual(crossing_deg: float, probes: tuple[Probe, Probe], range_m: float = 1500.0) -> Rays:
    """Two lidars, the first looking north and the second turned from it, that stare at the target."""
    azimuth, elevation = np.array([0.0, crossing_deg]), np.full(2, 4.0)
    return Rays(
        azimuth_deg=azimuth,
        elevation_deg=elevation,
        range_m=np.full(2, range_m),
        head_m=-range_m * unit_vector(azimuth, elevation),
        lidar=np.arange(2),
        time_s=np.full(2, 0.25),
        duration_s=np.full(2, 0.5),
        swept_azimuth_deg=np.zeros(2),
        probes=probes,
        period_s=2.0,
    )


class Air(NamedTuple):
    """Scenes that fly through the same fields."""

    turbulence: Turbulence
    speed_mps: float
    noise_mps: float
    cells_per_length: float
    scenes: dict[str, tuple[Rays, float]]  # name: rays, where the wind is from


AIRS = (
    Air(
        Turbulence(0.09, 170.0),
        8.0,
        0.0,
        6.0,
        {
            "60°, along": (sector(30, 2.0), 0.0),
            "60°, 45° off": (sector(30, 2.0), 45.0),
            "60°, across": (sector(30, 2.0), 90.0),
            "60°, 45° off, one way": (sector(30, 2.0, back_and_forth=False), 45.0),
            "30°, along": (sector(15, 2.0), 180.0),
            "14°, along": (sector(7, 2.0), 180.0),
            "8°, across": (sector(4, 2.0), 90.0),
        },
    ),
    Air(
        Turbulence(0.20, 60.0),
        10.0,
        0.2,
        5.0,
        {
            "60° at 500 m, along": (sector(30, 2.0, range_m=500.0), 0.0),
            "30° at 500 m, 45° off": (sector(15, 2.0, range_m=500.0), 135.0),
            "30° at 500 m, across, one way": (sector(15, 2.0, back_and_forth=False, range_m=500.0), 90.0),
        },
    ),
    Air(
        Turbulence(0.15, 120.0),
        8.0,
        0.0,
        7.0,
        {
            "dual 90°": (dual(90.0, (SHORT, SHORT)), 300.0),
            "dual 63°": (dual(63.0, (SHORT, SHORT)), 300.0),
            "dual 20°, probes 43 and 85 m": (dual(20.0, (SHORT, LONG)), 300.0),
        },
    ),
    Air(
        Turbulence(0.05, 300.0),
        5.0,
        0.1,
        7.5,
        {
            "60°, along": (sector(30, 2.0), 0.0),
            "30°, 45° off": (sector(15, 2.0), 45.0),
        },
    ),
    Air(
        Turbulence(0.09, 170.0, "mann"),
        8.0,
        0.0,
        8.0,
        {
            "60°, along, Mann": (sector(30, 2.0), 0.0),
            "60°, across, Mann": (sector(30, 2.0), 90.0),
            "14°, 45° off, Mann": (sector(7, 2.0), 45.0),
        },
    ),
)


class Row(NamedTuple):
    """One number of one scene by both."""

    scene: str
    name: str
    tier: float
    judge: float
    standard_error: float

    @property
    def errors(self) -> float:
        """Difference in standard errors of the judge."""
        return (self.tier - self.judge) / self.standard_error

    @property
    def share(self) -> float:
        """Difference over the judge's value."""
        return self.tier / self.judge - 1

    @property
    def agrees(self) -> bool:
        """Whether within three standard errors or two per cent."""
        return abs(self.errors) <= AGREED_ERRORS or abs(self.share) <= AGREED_SHARE


def predicted(rays: Rays, wind: WindState, air: Air, averaging_s: float) -> list[float]:
    """Numbers of the turbulent tier, in the order of NAMES."""
    scan = predict_turbulent(
        rays, wind, air.turbulence, ErrorSources(radial_speed_mps=air.noise_mps), reference="vector"
    )
    mean = predict_ten_minute(
        rays, wind, air.turbulence, random_m2s2=air.noise_mps**2, averaging_s=averaging_s
    )
    ten = (mean.speed_bias_mps, mean.speed_std_mps, mean.direction_std_deg)
    across, along = np.diag(scan.covariance_m2s2)
    one = (across, along, scan.speed_std_mps, scan.speed_bias_mps, scan.direction_std_deg)
    return [float(value) for value in (*one, *ten)]


def compare(
    air: Air,
    *,
    fields: int,
    seed: int,
    cells_per_length: float | None = None,
    averaging_s: float = TEN_MINUTES_S,
) -> list[Row]:
    """Rows of all scenes of one air: one flight of ten minutes through each field."""
    winds = {name: WindState(air.speed_mps, from_deg) for name, (_, from_deg) in air.scenes.items()}
    found = simulate_scenes(
        [Scene(rays, winds[name]) for name, (rays, _) in air.scenes.items()],
        rng=np.random.default_rng(seed),
        sources=ErrorSources(radial_speed_mps=air.noise_mps),
        turbulence=air.turbulence,
        settings=Settings(
            realisations=fields,
            flights_per_field=1,
            averaging_s=averaging_s,
            spacing_m=min(air.turbulence.length_m / (cells_per_length or air.cells_per_length), 40.0),
        ),
    )
    out = []
    for (name, (rays, _)), simulation in zip(air.scenes.items(), found, strict=True):
        ruled = judge(simulation)
        across, _, along = ruled.covariance_m2s2
        theirs = (across, along, ruled.speed_std_mps, ruled.speed_bias_mps, ruled.direction_std_deg)
        means = (ruled.mean10_speed_bias_mps, ruled.mean10_speed_std_mps, ruled.mean10_direction_std_deg)
        label = (
            f"{name}; TI {air.turbulence.intensity:g}, L {air.turbulence.length_m:g} m, {air.speed_mps:g} m/s"
        )
        ours = predicted(rays, winds[name], air, averaging_s)
        for what, one, other in zip(NAMES, ours, (*theirs, *means), strict=True):
            out.append(Row(label, what, one, other.value, other.standard_error))
    return out


def markdown(rows: list[Row]) -> str:
    """Print a line a scene: tier / judge ± standard error; what does not agree is marked."""
    lines = ["| scene | " + " | ".join(NAMES) + " |", "| --- " * (len(NAMES) + 1) + "|"]
    for scene in dict.fromkeys(row.scene for row in rows):
        cells = [
            f"{row.tier:.3f} / {row.judge:.3f} ± {row.standard_error:.3f}" + ("" if row.agrees else " **no**")
            for row in rows
            if row.scene == scene
        ]
        lines.append(f"| {scene} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def main() -> None:
    """Print the table and what does not agree."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--fields", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--cells", type=float, help="cells per length; finer where it matters")
    given = parser.parse_args()
    start, rows = time.perf_counter(), []
    for number, air in enumerate(AIRS):
        rows += compare(air, fields=given.fields, seed=given.seed + number, cells_per_length=given.cells)
        print(f"air {number + 1} of {len(AIRS)}: {time.perf_counter() - start:.0f} s", file=sys.stderr)
    print(markdown(rows))
    errors = np.array([row.errors for row in rows])
    share = np.mean(np.abs(errors) < 1)
    print(f"\n{len(rows)} numbers of {len({row.scene for row in rows})} scenes, {given.fields} fields each:")
    print(f"{np.sum([row.agrees for row in rows])} agree; {share:.0%} within one standard error,", end=" ")
    print(f"mean {np.mean(errors):+.2f} and root mean square {np.sqrt(np.mean(errors**2)):.2f} of them")
    for row in rows:
        if not row.agrees:
            print(f"- {row.scene}, {row.name}: {row.errors:+.1f} standard errors, {row.share:+.1%}")


if __name__ == "__main__":
    main()
