"""The error of each size by the judge: random fields, rays and the real retrieval."""

from collections.abc import Callable

import numpy as np

from planner.error_model import REFERENCE, Model
from planner.error_nouns import MEAN_FIELDS, SCAN_FIELDS, Size, SizeError
from reconstruct.monte_carlo import Scene, Settings, simulate_scenes
from reconstruct.prediction import RANK_SHORT
from reconstruct.verdict import judge_campaign

Progress = Callable[[float], None]

SEED = 1
DRAWN_ANEW = "this tier draws lasting errors anew for every period: they are in its scatter"
REALISATIONS = 8  # ten-minute periods of every state and size


def simulated_errors(sizes: list[Size], model: Model, progress: Progress | None) -> tuple[SizeError, ...]:
    """Simulate every size in every state, all through the same random fields."""

    def told(number: int) -> Progress | None:
        return None if progress is None else lambda share: progress((number + share) / len(sizes))

    return tuple(_simulated(size, model, told(number)) for number, size in enumerate(sizes))


def _simulated(size: Size, model: Model, progress: Progress | None) -> SizeError:
    simulations = simulate_scenes(
        [Scene(size.rays, state) for state in model.states],
        rng=np.random.default_rng(SEED),
        sources=model.sources,
        turbulence=model.eddies,
        settings=Settings(realisations=REALISATIONS, flights_per_field=1),
        progress=progress,
    )
    verdict = judge_campaign(simulations, model.climate.weight, reference=REFERENCE)._asdict()
    known = {name: estimate.value for name, estimate in verdict.items() if np.isfinite(estimate.value)}
    condition = simulations[0].condition
    return SizeError(
        sector_deg=size.sector_deg,
        rays=size.rays.count,
        scans_per_10min=size.scans,
        period_s=size.rays.period_s,
        range_m=float(np.mean(size.rays.range_m)),
        condition=condition if np.isfinite(condition) else None,
        values={name: known.get(name) for name in (*SCAN_FIELDS, *MEAN_FIELDS)},
        reasons={
            name: RANK_SHORT if name in verdict else DRAWN_ANEW
            for name in (*SCAN_FIELDS, *MEAN_FIELDS)
            if name not in known
        },
        standard_errors={
            name: estimate.standard_error for name, estimate in verdict.items() if name in known
        },
    )
