"""Sizes of geometric effects: against published sizes and against the earth models that have or lack them."""

import numpy as np
import pytest

from geometry.effects import effect_sizes_m
from geometry.frames import SiteFrame

UTM32 = SiteFrame("EPSG:32632")
HEAD_M = np.array([448937.717, 6256404.894, 5.409])


def at(distance: float, azimuth: float = 233.0) -> np.ndarray:
    """A point at a grid distance and grid azimuth from the head, at its height."""
    turn = np.deg2rad(azimuth)
    return HEAD_M + distance * np.array([np.sin(turn), np.cos(turn), 0.0])


def test_published_sizes() -> None:
    """0.69 degrees is 36 m at 3 km; at 6 km curvature is 2.83 m, with refraction 2.46, 30 arc seconds 0.9."""
    assert float(effect_sizes_m(UTM32, HEAD_M, at(3000.0)).convergence_m) == pytest.approx(
        3000 * np.deg2rad(0.690), abs=0.05
    )
    sizes = effect_sizes_m(UTM32, HEAD_M, at(6000.0))
    assert round(float(sizes.curvature_m), 2) == 2.83
    assert round(float(sizes.curvature_m - sizes.refraction_m), 2) == 2.46
    assert round(float(sizes.deflection_of_vertical_m), 1) == 0.9
    assert float(sizes.geoid_m) == pytest.approx(6000.0 * 6.3e-6, abs=1e-3)


@pytest.mark.parametrize("distance", [1000.0, 10000.0])
def test_sizes_are_what_the_models_differ_by(distance: float) -> None:
    """Grid to flat is convergence and scale, flat to curved the drop, curved to refracted the lift."""
    sizes = effect_sizes_m(UTM32, HEAD_M, at(distance))
    grid, flat, curved, refracted = (
        UTM32.enu_m(HEAD_M, at(distance), model=model)
        for model in ("flat-grid", "flat", "curved", "refracted")
    )
    both = np.hypot(sizes.convergence_m, sizes.scale_m)
    assert np.linalg.norm(flat - grid) == pytest.approx(float(both), rel=1e-3)
    assert flat[2] - curved[2] == pytest.approx(float(sizes.curvature_m), rel=5e-3)
    assert refracted[2] - curved[2] == pytest.approx(float(sizes.refraction_m), rel=5e-3)


def test_a_high_site_stretches_the_ground() -> None:
    """At 2 km altitude 10 grid kilometres are 4 m longer by the scale and 3.1 m by the height."""
    head = np.array([500000.0, 5000000.0, 2000.0])
    sizes = effect_sizes_m(UTM32, head, head + np.array([0.0, 10000.0, 0.0]))
    assert float(sizes.scale_m) == pytest.approx(10000.0 * (1 / 0.9996 - 1 + 2000.0 / 6371000.0), abs=0.01)


def test_geoid_is_measured_by_raising_the_site() -> None:
    """An undulation costs what positions change by without it; ellipsoidal heights have none to lose."""
    stated = SiteFrame("EPSG:32632", geoid_undulation_m=47.0)
    change = np.linalg.norm(stated.enu_m(HEAD_M, at(8000.0)) - UTM32.enu_m(HEAD_M, at(8000.0)))
    assert float(effect_sizes_m(stated, HEAD_M, at(8000.0)).geoid_m) == pytest.approx(change, rel=5e-3)
    ellipsoidal = SiteFrame("EPSG:32632", height_datum="ellipsoidal")
    assert float(effect_sizes_m(ellipsoidal, HEAD_M, at(8000.0)).geoid_m) == 0.0


def test_sizes_keep_leading_axes() -> None:
    """Every size has the shape of the points."""
    sizes = effect_sizes_m(UTM32, HEAD_M, np.stack([[at(500.0), at(0.0)]] * 3))
    assert [size.shape for size in sizes] == [(3, 2)] * 7
    assert all(float(size[0, 1]) == pytest.approx(0.0, abs=1e-8) for size in sizes)
