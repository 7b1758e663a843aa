"""Set the predicted errors of the Høvsøre sector scans beside the published ones: prints the tables of the
docs.

Run from the root of the project: python examples/hovsore/compare_published.py
"""

from collections.abc import Sequence

import numpy as np

from geometry.beams import beam_to
from geometry.frames import SiteFrame
from geometry.gates import Gates, Probe, window_ns
from geometry.scan import middle_rays
from reconstruct.climate import Climate, weibull_climate
from reconstruct.rays import Rays
from reconstruct.regression import DirectionRegression, SpeedRegression, regress_direction, regress_speed
from reconstruct.spectra import Turbulence
from reconstruct.ten_minute import predict_ten_minute, subset_gains
from reconstruct.wind import WindState

SCANNER_M = (447893.983, 6256558.133, 5.078)  # WS_S: easting, northing, height
TARGET_M = (447647.39, 6255435.76, 4.836 + 120.0)  # 120 m above the base of the mast
GATES = Gates(first_m=666.0, spacing_m=25.0, count=41)  # the 21st at 1166 m
SIZES_DEG = (60, 50, 44, 38, 30, 22, 14, 8, 4)
RAYS = (30, 26, 23, 20, 16, 12, 8, 5, 3)
STEP_DEG, RAY_S, PERIOD_S, SCAN_RAYS = 2.0, 0.4, 12.0, 30
PUBLISHED_SLOPE = {60: 0.998046, 30: 0.985658, 8: 0.863839}
PUBLISHED_RESIDUAL_MPS = {60: 0.32, 30: 0.55, 8: 0.55}
PUBLISHED_R2 = {60: 0.9977, 30: 0.9959, 8: 0.9851}
AIR = Turbulence(intensity=0.09, length_m=170.0)
NOISE_MPS = 0.2


def scan() -> Rays:
    """The 60 degree scan as declared, centred on the target: 30 rays of 0.4 s every 12 s, back and forth."""
    frame = SiteFrame("EPSG:32632")
    to_target = frame.enu_m(SCANNER_M, TARGET_M)
    beam = beam_to(to_target)
    index, _ = GATES.nearest(beam.range_m)
    order = np.arange(SCAN_RAYS)
    return Rays(
        azimuth_deg=beam.azimuth_deg + STEP_DEG * (order - 0.5 * (SCAN_RAYS - 1)),
        elevation_deg=np.full(SCAN_RAYS, beam.elevation_deg),
        range_m=np.full(SCAN_RAYS, GATES.centres_m[index]),
        head_m=np.tile(-to_target, (SCAN_RAYS, 1)),
        lidar=np.zeros(SCAN_RAYS, dtype=np.intp),
        time_s=RAY_S * (order + 0.5),
        duration_s=np.full(SCAN_RAYS, RAY_S),
        swept_azimuth_deg=np.full(SCAN_RAYS, STEP_DEG),
        probes=(Probe(pulse_ns=200, window_ns=window_ns(64)),),
        period_s=PERIOD_S,
        back_and_forth=True,
    )


def climate(speeds: int = 5, directions: int = 8) -> Climate:
    """Forty states: Weibull speeds within 4 to 25 m/s, directions uniform over 118 to 270 degrees."""
    return weibull_climate(
        8.9,
        2.75,
        speed_range_mps=(4.0, 25.0),
        directions_deg=[(118.0, 270.0)],
        speeds=speeds,
        directions=directions,
    )


def curve(
    air: Turbulence = AIR,
    noise_mps: float = NOISE_MPS,
    *,
    sweep: bool = True,
    scan_share: float = 1.0,
    states: Climate | None = None,
) -> tuple[SpeedRegression, DirectionRegression]:
    """Regression of every sector size over the climate."""
    rays, wind = scan(), states or climate()
    gains = subset_gains(rays, [middle_rays(SCAN_RAYS, count) for count in RAYS])
    means = [
        predict_ten_minute(
            rays,
            state,
            air,
            gains=gains,
            random_m2s2=noise_mps**2,
            sweep=sweep,
            scan_share=scan_share,
        )
        for state in wind.states(WindState(speed_mps=8.0, from_deg=0.0, height_m=116.5))
    ]
    return regress_speed(wind, means), regress_direction(wind, means)


def _row(cells: Sequence[object]) -> str:
    return "| " + " | ".join(f"{cell:.4f}" if isinstance(cell, float) else str(cell) for cell in cells) + " |"


def main() -> None:
    """Print the comparison and the sensitivities as Markdown."""
    with_sweep, direction = curve()
    without, _ = curve(sweep=False)
    heads = (
        "sector °",
        "rays",
        "slope published",
        "slope",
        "slope without ray sweep",
        "residual published m/s",
        "residual m/s",
        "without sweep m/s",
        "r² uncentred published",
        "r² uncentred",
        "direction residual °",
    )
    lines = [_row(heads), _row(["---"] * len(heads))]
    for index, (size, rays) in enumerate(zip(SIZES_DEG, RAYS, strict=True)):
        cells = (
            size,
            rays,
            PUBLISHED_SLOPE.get(size, ""),
            float(with_sweep.slope[index]),
            float(without.slope[index]),
            PUBLISHED_RESIDUAL_MPS.get(size, ""),
            float(with_sweep.residual_std_mps[index]),
            float(without.residual_std_mps[index]),
            PUBLISHED_R2.get(size, ""),
            float(with_sweep.r_squared_uncentred[index]),
            float(direction.residual_std_deg[index]),
        )
        lines.append(_row(cells))
    lines += [
        "",
        _row(["setting", *(f"{size}°" for size in SIZES_DEG)]),
        _row(["---"] * (len(SIZES_DEG) + 1)),
    ]
    for name, (speed, _) in sensitivities().items():
        lines.append(_row([name, *(float(slope) for slope in speed.slope)]))
    print("\n".join(lines))  # noqa: T201


def sensitivities() -> dict[str, tuple[SpeedRegression, DirectionRegression]]:
    """The curve with one setting changed at a time."""
    return {
        "as above": curve(),
        "noise 0.1 m/s": curve(noise_mps=0.1),
        "noise 0.1 m/s, no ray sweep": curve(noise_mps=0.1, sweep=False),
        "length 150 m": curve(Turbulence(0.09, 150.0)),
        "length 190 m": curve(Turbulence(0.09, 190.0)),
        "intensity 0.08": curve(Turbulence(0.08, 170.0)),
        "intensity 0.10": curve(Turbulence(0.10, 170.0)),
        "Kaimal, same subrange": curve(Turbulence(0.09, 170.0, model="kaimal")),
        "Mann, Γ 3.9, same subrange": curve(Turbulence(0.09, 170.0, model="mann")),
        "85 % of the scans": curve(scan_share=0.85),
        "160 states": curve(states=climate(8, 20)),
    }


if __name__ == "__main__":
    main()
