"""How much the gates' unknown places add to the scatter of ten-minute means of the Høvsøre pair.

Ranging and pointing errors last all campaign: each lidar measures a few metres beside the target, where the
eddies are others. The prediction takes the planned places; this draws them from the site file's uncertainties.

Run from the root of the project: python tests/benchmarks/displaced_gates.py [--draws 40] [--seed 1]
"""

import argparse
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT))

from geometry.angles import SectorSet  # noqa: E402
from planner.files.yaml_site import load_site  # noqa: E402
from planner.plan import Plan  # noqa: E402
from planner.wind_climate import climate_at, state_like  # noqa: E402
from reconstruct.campaign import predict_campaign  # noqa: E402
from reconstruct.ray_fit import ray_fit  # noqa: E402
from reconstruct.uncertainty import ErrorSources  # noqa: E402


def main() -> None:
    """Print the residual as planned and over the draws."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--draws", type=int, default=40)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    plan = Plan(load_site(ROOT / "examples/hovsore/site.yaml"))
    (air,) = (air for name, _, air in plan.predicted.declared_airs if name == "dual")
    climate, like = climate_at(plan.site, "cup", SectorSet.empty()), state_like(plan.site, "cup")
    unsure = plan.site.lidars[0].uncertainty  # the same for all three
    draw = np.random.default_rng(options.seed).normal
    noise = tuple(ErrorSources(radial_speed_mps=each.radial_speed_mps) for each in air.sources)

    def residuals(rays, sources):
        shown = predict_campaign(
            rays, climate, air.turbulence, like=like, sources=sources, gains=ray_fit(air.rays).gain
        )
        return float(shown.speed.residual_std_mps), float(shown.direction.residual_std_deg)

    turned = (
        np.hypot(unsure.azimuth_deg, unsure.heading_deg),
        np.hypot(unsure.elevation_deg, unsure.levelling_deg),
    )
    found = [
        residuals(
            replace(
                air.rays,
                range_m=air.rays.range_m + draw(0.0, unsure.range_m, 2),
                azimuth_deg=air.rays.azimuth_deg + draw(0.0, turned[0], 2),
                elevation_deg=air.rays.elevation_deg + draw(0.0, turned[1], 2),
            ),
            air.sources,
        )
        for _ in range(options.draws)
    ]
    for number, unit in enumerate(("m/s", "deg")):
        each = np.array(found)[:, number]
        print(
            f"residual [{unit}]: noise and turbulence {residuals(air.rays, noise)[number]:.4f}, with errors that last "
            f"{residuals(air.rays, air.sources)[number]:.4f}, gates displaced by them too {np.sqrt(np.mean(each**2)):.4f} "
            f"(single campaigns {each.min():.4f} to {each.max():.4f})"
        )


if __name__ == "__main__":
    main()
