"""What a plan looks like in 3-D: rays of their own, and what they lose."""

from collections.abc import Callable

import numpy as np
import pytest

from planner.plan import Plan
from planner.plan_scene import plan_scene
from planner.scene.model import Layer


def layer(plan: Plan, name: str) -> Layer:
    return next(item for item in plan_scene(plan).layers if item.name == name)


def test_points_are_rays_with_nothing_between_them(moor: Callable[..., Plan]) -> None:
    """Two targets 1 km and 2 km north: two probes, no surface, each gate at its own target."""
    targets = [
        {"name": "T", "position": [500000, 6251000, 110]},
        {"name": "U", "position": [500000, 6252000, 110]},
    ]
    tour = {"name": "tour", "lidar": "A", "type": "points", "targets": ["T", "U"], "accumulation_s": 1.0}
    drawn = layer(moor(targets=targets, scans=[tour], pairs=[]), "A: tour")
    assert not drawn.meshes
    gates = next(points.points_m for points in drawn.points if len(points.points_m) == 2)
    apart_m = np.linalg.norm(gates[1] - gates[0])
    assert apart_m == pytest.approx(1000.0, rel=1e-3)  # scale factor .9996 at the central meridian


def test_a_ray_behind_a_block_is_lost_from_there_to_its_gate(moor: Callable[..., Plan]) -> None:
    """Half way the beam is at 60 m: a block of 30 m leaves it free, one of 100 m takes the second half of it."""
    block = {"name": "block", "position": [500000, 6250500, 10], "width_m": 40, "length_m": 40}
    free = plan_scene(moor(obstacles=[{**block, "height_m": 30.0}]))
    assert "lost" not in [item.name for item in free.layers]
    plan = moor(obstacles=[{**block, "height_m": 100.0}])
    (lines,) = layer(plan, "lost").lines
    start_m, end_m = lines.points_m[lines.segments][0] - plan.places.local_m(plan.site.lidars[0].position)
    assert start_m == pytest.approx([0.0, 500.0, 50.0], abs=20.0)
    assert end_m[1] == pytest.approx(1000.0 + plan.layout["a"].probe.length_m / 2, rel=2e-3)
