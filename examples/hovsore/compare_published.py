"""Set the predicted errors of the Høvsøre sector scans beside the published ones: prints the tables of the
docs, and draws their figure.

Run from the root of the project: python examples/hovsore/compare_published.py [docs/hovsore_comparison.png]
"""

import sys
from collections.abc import Sequence
from pathlib import Path

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
STATED_SLOPE = {4: 1 / 1.4}  # in words: at 4 degrees the lidar reads 40 % too high
RESIDUAL_ROUNDING_M2S2 = 0.05  # the published residuals are roots of variances that are rounded to 0.1
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
    heads = ("setting", *(f"{size}°" for size in SIZES_DEG), "RMS of four")
    lines += ["", _row(heads), _row(["---"] * len(heads))]
    for name, (speed, _) in sensitivities().items():
        lines.append(_row([name, *(float(slope) for slope in speed.slope), misfit(speed)]))
    print("\n".join(lines))  # noqa: T201


def misfit(speed: SpeedRegression) -> float:
    """Root mean square of predicted less published slope, at 60, 30, 8 and 4 degrees."""
    known = PUBLISHED_SLOPE | STATED_SLOPE
    off = [float(speed.slope[SIZES_DEG.index(size)]) - slope for size, slope in known.items()]
    return float(np.sqrt(np.mean(np.square(off))))


def settings() -> dict[str, tuple[SpeedRegression, DirectionRegression]]:
    """The three settings of noise and ray sweep that were weighed."""
    return {
        "A: noise 0.2 m/s, ray sweep (as above)": curve(),
        "B: noise 0.1 m/s, ray sweep": curve(noise_mps=0.1),
        "C: noise 0.1 m/s, no ray sweep": curve(noise_mps=0.1, sweep=False),
    }


def sensitivities() -> dict[str, tuple[SpeedRegression, DirectionRegression]]:
    """The curve with one setting changed at a time."""
    return settings() | {
        "length 150 m": curve(Turbulence(0.09, 150.0)),
        "length 190 m": curve(Turbulence(0.09, 190.0)),
        "intensity 0.08": curve(Turbulence(0.08, 170.0)),
        "intensity 0.10": curve(Turbulence(0.10, 170.0)),
        "Kaimal, same subrange": curve(Turbulence(0.09, 170.0, model="kaimal")),
        "Mann, Γ 3.9, same subrange": curve(Turbulence(0.09, 170.0, model="mann")),
        "85 % of the scans": curve(scan_share=0.85),
        "160 states": curve(states=climate(8, 20)),
    }


def draw(path: Path, curves: dict[str, tuple[SpeedRegression, DirectionRegression]]) -> None:
    """Draw slope and residual scatter against sector size: curves predicted (see `settings`), points
    published.
    """
    import matplotlib as mpl

    mpl.use("Agg")
    from matplotlib import pyplot as plt

    figure, (left, right) = plt.subplots(1, 2, figsize=(10.0, 4.2), layout="constrained")
    looks = (("#0b5394", "-", 2.0), ("#cc6600", "--", 1.4), ("#555555", ":", 1.6))
    for (name, (speed, _)), (colour, dash, width) in zip(curves.items(), looks, strict=True):
        look = {
            "color": colour,
            "linestyle": dash,
            "linewidth": width,
            "label": name.replace(" (as above)", ""),
        }
        left.plot(SIZES_DEG, speed.slope, **look)
        right.plot(SIZES_DEG, speed.residual_std_mps, **look)
    point = {"color": "black", "linestyle": "none", "zorder": 3}
    left.plot(*_sides(PUBLISHED_SLOPE), marker="o", label="published", **point)
    left.plot(*_sides(STATED_SLOPE), marker="o", markerfacecolor="none", label="published in words", **point)
    sizes, residual = (np.array(side) for side in _sides(PUBLISHED_RESIDUAL_MPS))
    ends = np.sqrt(np.round(residual**2, 1) + RESIDUAL_ROUNDING_M2S2 * np.array([[-1.0], [1.0]]))
    right.errorbar(
        sizes,
        residual,
        np.abs(ends - residual),
        fmt="o",
        capsize=3,
        label="published, with rounding",
        **point,
    )
    left.set(
        ylabel="slope of mast = slope · lidar", title="Speed regression through the origin", ylim=(0.65, 1.03)
    )
    right.set(
        ylabel="standard deviation of the residuals [m/s]",
        title="Scatter of ten-minute means",
        ylim=(0, 0.85),
    )
    for axes in (left, right):
        axes.set(xscale="log", xlabel="sector [°]", xlim=(3.6, 67))
        axes.set_xticks(SIZES_DEG, [str(size) for size in SIZES_DEG])
        axes.minorticks_off()
        axes.grid(color="#dddddd", linewidth=0.6)
        axes.legend(frameon=False, fontsize=8)
    figure.savefig(path, dpi=130)
    plt.close(figure)


def _sides(values: dict[int, float]) -> tuple[list[int], list[float]]:
    return list(values), list(values.values())


if __name__ == "__main__":
    main()
    if len(sys.argv) > 1:
        draw(Path(sys.argv[1]), settings())
