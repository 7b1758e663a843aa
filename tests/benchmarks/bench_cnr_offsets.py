"""Rehearse the hard-target test of Høvsøre 200 times: how far the offsets come back off, and how often inside two sigma.

Run from the project's root: ``python -m tests.benchmarks.bench_cnr_offsets [RUNS]``. Head and targets stand off their
survey anew in every run. The exit code is 1 where an offset comes back off by more than 0.01°, or one of them is inside
two standard deviations in fewer than 91 or more than 99 % of the runs.
"""

import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from geometry.errors import InputError
from planner.cnr_fit import fit_head
from planner.cnr_simulate import rehearse
from planner.files.yaml_site import load_site
from planner.places import Places

SITE = Path(__file__).resolve().parents[2] / "examples" / "hovsore" / "hard_target_test.yaml"
TIPS = ("tip of the mast", "tip of tower N", "tip of tower S", "tip at stand 2")
PLANTED = {"azimuth_offset_deg": 0.05, "elevation_offset_deg": 0.0, "pitch_deg": 0.03, "roll_deg": -0.03}
RUNS = 200
LIMIT_DEG = 0.01
LEAST, MOST = 0.91, 0.99
MOST_REFUSED = 0.02


def offsets(places: Places, seed: int) -> tuple[list[float], list[float]]:
    """Errors and standard deviations of the offsets of one rehearsal, in the order of `PLANTED` [deg]."""
    done = rehearse(places, "WS_S", TIPS, rng=np.random.default_rng(seed), planted=PLANTED)
    found = fit_head(places, "WS_S", done.maps, probe=done.plans[0].probe).fit
    errors = [getattr(found.mounting, name) - getattr(done.mounting, name) for name in PLANTED]
    return errors, [found.std_deg(name) for name in found.solved]


def main() -> int:
    """Print a line an offset; 1 if a limit is passed."""
    runs = int(sys.argv[1]) if len(sys.argv) > 1 else RUNS
    places = Places(load_site(SITE))
    found, refused = [], 0
    for seed in range(runs):
        try:
            found.append(offsets(places, seed))
        except InputError:  # targets that contradict each other: one in 1000 good tests is called so
            refused += 1
    errors, stds = np.array(found).transpose(1, 0, 2)
    inside = np.abs(errors) < 2 * stds
    failed = refused > MOST_REFUSED * runs
    print(f"{runs} runs, {refused} refused as contradicting; errors in degrees")
    for number, name in enumerate(PLANTED):
        error, share = errors[:, number], inside[:, number].mean()
        failed |= not (np.abs(error).max() < LIMIT_DEG and LEAST <= share <= MOST)
        print(
            f"{name:<21} rms {np.sqrt((error**2).mean()):.5f}, stated {stds[:, number].mean():.5f}, largest "
            f"{np.abs(error).max():.5f}; inside two sigma {100 * share:.1f} %"
        )
    print(f"all offsets: inside two sigma {100 * inside.mean():.1f} % (95.4 % expected)")
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
