"""Where things stand: one frame, north, the area of use, distances."""

from collections.abc import Callable

import numpy as np
import pytest
from pyproj import Geod, Transformer

from geometry.errors import InputError
from planner.places import Places
from planner.plan import Plan
from planner.site import Site

Moor = Callable[..., Plan]
WGS84 = Geod(ellps="WGS84")


def test_the_origin_is_in_the_middle_of_lidars_and_targets_on_the_ground(moor: Moor) -> None:
    assert moor().places.origin_m.tolist() == [500500.0, 6250500.0, 10.0]


def test_a_site_of_nothing_has_no_origin() -> None:
    with pytest.raises(InputError, match="nothing in it"):
        _ = Places(Site(name="Moor", crs="EPSG:32632", ground_height_m=0.0)).origin_m


def test_local_north_is_true_north(hovsore: Plan) -> None:
    """Azimuth from the mast to WS_K in the local frame against the geodesic's: both 0.7° off the grid's."""
    site = hovsore.site
    ends = [site.mast("mast").position, site.lidar("WS_K").position]
    lonlat = [Transformer.from_crs(site.crs, "EPSG:4326", always_xy=True).transform(*end[:2]) for end in ends]
    azimuth_deg, _, distance_m = WGS84.inv(*lonlat[0], *lonlat[1])
    east, north, _ = np.diff(hovsore.exact_places.local_m(ends), axis=0)[0]
    assert np.rad2deg(np.arctan2(east, north)) % 360 == pytest.approx(azimuth_deg % 360, abs=0.01)
    assert np.hypot(east, north) == pytest.approx(distance_m, abs=0.01)


def test_a_point_of_a_lidars_frame_is_the_same_place_in_the_sites(hovsore: Plan) -> None:
    places, lidar = hovsore.exact_places, hovsore.site.lidar("WS_W")
    cup = hovsore.site.target_position_m("cup")
    seen = places.frame.enu_m(lidar.position, cup)
    assert places.from_lidar_m(lidar, seen) == pytest.approx(places.local_m(cup), abs=1e-4)
    row = next(row for row in hovsore.pointings if row.lidar == "WS_W")
    along = places.beam_local_m(lidar, row.azimuth_true_deg, row.elevation_deg, row.range_m)
    assert along == pytest.approx(places.local_m(cup), abs=1e-4)


def test_a_head_at_grid_north_is_turned_by_the_convergence(kassel: Plan) -> None:
    """Convergence by the series of the transverse Mercator, Δλ·sin φ, good to 1e-4° here."""
    for lidar in kassel.site.lidars:
        to_degrees = Transformer.from_crs(kassel.site.crs, "EPSG:4258", always_xy=True)
        longitude, latitude = to_degrees.transform(*lidar.position[:2])
        expected = (longitude - 9.0) * np.sin(np.deg2rad(latitude))
        assert kassel.places.mounting(lidar).heading_deg == pytest.approx(expected, abs=1e-4)


def test_rotors_stand_hub_height_above_their_base(hovsore: Plan) -> None:
    """84, 95, 75 and 99.5 m, less the few centimetres that the Earth falls away."""
    up_m = hovsore.exact_places.hubs_m[:, 2]
    base_m = 4.836 - 4.8
    assert up_m == pytest.approx(np.array([84, 95, 75, 99.5]) + base_m, abs=0.1)


@pytest.mark.parametrize(("east_m", "outside_deg"), [(500000, 0.0), (690000, 0.0972), (310000, 0.0972)])
def test_how_far_a_site_is_out_of_its_zone(moor: Moor, east_m: float, outside_deg: float) -> None:
    """EPSG:32632 is for 6 to 12° E; the inverse projection tells where the points are."""
    lidar = {"name": "A", "position": [east_m, 6250000, 10], "instrument": "windscanner-200s"}
    places = moor(
        lidars=[lidar], targets=[{"name": "T", "position": [east_m, 6250100, 10]}], scans=[], pairs=[]
    ).places
    to_degrees = Transformer.from_crs("EPSG:32632", "EPSG:4326", always_xy=True)
    longitude = max(abs(to_degrees.transform(east_m, north)[0] - 9.0) for north in (6250000, 6250100))
    assert places.outside_area_deg == pytest.approx(max(0.0, longitude - 3.0), abs=1e-9)
    assert (places.outside_area_deg or 0.0) > 0 or outside_deg == 0.0


def test_distances_are_between_things_of_one_kind(moor: Moor) -> None:
    (apart,) = moor().places.distances
    assert apart == ("lidars", "A", "B", pytest.approx(1000 * 2**0.5))


def test_height_above_ground(moor: Moor) -> None:
    assert moor().places.height_above_ground_m("T") == 100.0
