"""Rays as the reconstruction gets them, against PROJ's topocentric frames."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from pyproj import Transformer

from geometry.arrays import FloatArray
from geometry.errors import InputError
from planner.plan import Plan
from planner.ray_sets import own_scan, pair_rays, sector_rays, subset_of
from planner.scan_layout import ScanLayout

Moor = Callable[..., Plan]


def topocentric(plan: Plan, position_m: tuple[float, float, float]) -> Transformer:
    """Earth-centred coordinates to east, north, up at a position of the site."""
    to_degrees = Transformer.from_crs(plan.site.crs, "EPSG:4326", always_xy=True)
    longitude, latitude = to_degrees.transform(*position_m[:2])
    frame = f"+proj=topocentric +ellps=WGS84 +lon_0={longitude} +lat_0={latitude} +h_0={position_m[2]}"
    return Transformer.from_pipeline(frame)


def gates_m(plan: Plan, layout: ScanLayout, target: str) -> FloatArray:
    """Gate of each ray (ray, 3), east, north, up from the target, through the Earth's centre."""
    azimuth, elevation = np.deg2rad([layout.scan.azimuth_deg, layout.scan.elevation_deg])
    unit = [np.sin(azimuth) * np.cos(elevation), np.cos(azimuth) * np.cos(elevation), np.sin(elevation)]
    reach = layout.measured_range_m(layout.range_to_m(target))
    ecef = topocentric(plan, layout.lidar.position).transform(
        *(reach * each for each in unit), direction="INVERSE"
    )
    return np.stack(topocentric(plan, plan.site.target_position_m(target)).transform(*ecef), axis=-1)


def test_gates_of_the_sector_are_where_proj_puts_them(hovsore: Plan) -> None:
    layout = hovsore.layout["sector"]
    rays = sector_rays(hovsore.exact_places, layout, layout.scan, "cup")
    assert rays.centre_m == pytest.approx(gates_m(hovsore, layout, "cup"), abs=0.001)
    assert rays.period_s == 12.0
    assert rays.back_and_forth
    assert rays.time_s == pytest.approx(layout.scan.time_s)
    assert rays.probes == (layout.probe,)


def test_the_middle_of_the_sector_is_the_gate_behind_the_target(hovsore: Plan) -> None:
    """The gate is 10.2 m behind the cup: so far the two middle rays' mean direction passes it."""
    layout = hovsore.layout["sector"]
    rays = sector_rays(hovsore.exact_places, layout, layout.scan, "cup")
    ends = rays.centre_m[14:16].mean(axis=0)
    assert np.linalg.norm(ends) == pytest.approx(1166 - layout.range_to_m("cup"), abs=0.2)


def test_beams_of_a_pair_meet_at_the_target(hovsore: Plan) -> None:
    """One ray a lidar; each gate's centre is its offset away from the cup."""
    layouts = tuple(hovsore.layout[name] for name in ("stare K", "stare W"))
    rays = pair_rays(hovsore.exact_places, layouts, "cup")
    offsets = [
        layout.measured_range_m(layout.range_to_m("cup")) - layout.range_to_m("cup") for layout in layouts
    ]
    assert np.linalg.norm(rays.centre_m, axis=1) == pytest.approx(np.abs(offsets), abs=0.001)
    assert rays.lidar.tolist() == [0, 1]
    assert rays.swept_azimuth_deg.tolist() == [0.0, 0.0]
    assert rays.period_s == 0.5


def test_the_slowest_scan_of_a_pair_counts(moor: Moor) -> None:
    stare: dict[str, Any] = {"target": "T", "type": "stare"}
    scans = [
        {"name": "a", "lidar": "A", "accumulation_s": 0.5, **stare},
        {"name": "b", "lidar": "B", "accumulation_s": 2.0, **stare},
    ]
    plan = moor(scans=scans)
    rays = pair_rays(plan.places, plan.layouts, "T")
    assert rays.period_s == 2.0
    assert rays.time_s.tolist() == [0.25, 1.0]


def test_own_scans_have_their_own_period(hovsore: Plan) -> None:
    """15 rays of 0.4 s and 0.1 s to turn round; the declared size keeps the declared 12 s."""
    layout = hovsore.layout["sector"]
    assert own_scan(layout, 30).count == 15
    assert own_scan(layout, 30).period_s == pytest.approx(15 * 0.4 + 0.1)
    assert own_scan(layout, 60).period_s == 12.0
    assert own_scan(layout, 30).azimuth_deg.mean() == pytest.approx(layout.axis_azimuth_deg)


def test_subsets_are_the_studys_middle_rays(hovsore: Plan) -> None:
    """Simon (2015): 60, 50, 44, 38, 30, 22, 14, 8, 4° with 30, 26, 23, 20, 16, 12, 8, 5, 3 rays."""
    layout = hovsore.layout["sector"]
    kept = [subset_of(layout, size) for size in (60, 50, 44, 38, 30, 22, 14, 8, 4)]
    assert [rays.stop - rays.start for rays in kept] == [30, 26, 23, 20, 16, 12, 8, 5, 3]


def test_only_a_sector_has_sizes(hovsore: Plan) -> None:
    with pytest.raises(InputError, match="scan 'stare K' is of type stare"):
        own_scan(hovsore.layout["stare K"], 30)
