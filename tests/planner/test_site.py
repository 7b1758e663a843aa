"""The nouns: unchangeable, strict, and with their defaults resolved."""

from pathlib import Path

import pytest
from pydantic import ValidationError

from geometry.errors import InputError
from planner.assumptions import assumptions
from planner.files.yaml_site import load_site
from planner.site import Lidar, Mast, Site, Target, Turbine, Wind

ROOT = Path(__file__).resolve().parents[2]


def site(**fields: object) -> Site:
    return Site.model_validate({"name": "Moor", "crs": "EPSG:25832", **fields})


def test_nouns_cannot_be_changed() -> None:
    with pytest.raises(ValidationError):
        site().name = "other"


def test_a_site_made_in_python_is_checked_for_references_too() -> None:
    with pytest.raises(ValidationError, match="the name of a mast"):
        site(targets=[{"name": "cup", "mast": "none", "height_m": 3}])


def test_a_target_on_a_mast_stands_at_the_masts_base_plus_its_height() -> None:
    made = Site(
        name="Moor",
        crs="EPSG:25832",
        masts=(Mast(name="m", position=(500000.0, 5700000.0, 20.0), height_m=100.0),),
        targets=(
            Target(name="t", mast="m", height_m=80.0),
            Target(name="p", position=(500100.0, 5700000.0, 7.0)),
        ),
    )
    assert made.target_position_m("t") == (500000.0, 5700000.0, 100.0)
    assert made.target_position_m(made.target("p")) == (500100.0, 5700000.0, 7.0)


def test_a_hard_target_without_height_is_the_masts_top() -> None:
    made = site(
        masts=[{"name": "m", "position": [500000, 5700000, 20], "height_m": 100}],
        hard_targets=[{"name": "tip", "on": "m", "shape": "tip", "size_m": 0.1, "uncertainty_m": 0.2}],
    )
    assert made.target_position_m("tip") == (500000.0, 5700000.0, 120.0)


def test_ground_not_given_is_the_lowest_thing_that_stands() -> None:
    lidars = (Lidar(name="a", position=(500000.0, 5700000.0, 30.0), instrument="windscanner-200s"),)
    made = Site(name="Moor", crs="EPSG:25832", lidars=lidars)
    assert made.ground_m == 30.0
    with pytest.raises(InputError, match="ground_height_m"):
        _ = site().ground_m


def test_the_noise_is_the_sites_then_the_instruments_then_an_assumption() -> None:
    def lidar(name: str, **uncertainty: float) -> Lidar:
        fields = {"name": "a", "position": (0.0, 0.0, 0.0), "instrument": name, "uncertainty": uncertainty}
        return Lidar.model_validate(fields)

    assert lidar("halo-streamline-xr", radial_speed_mps=0.3).radial_speed_noise_mps == 0.3
    assert lidar("halo-streamline-xr").radial_speed_noise_mps == 0.05
    assert lidar("halo-streamline").radial_speed_noise_mps == 0.1


def test_an_unknown_name_says_which_there_are() -> None:
    with pytest.raises(InputError, match="no lidar is called 'Z'; allowed: none is declared"):
        site().lidar("Z")


def test_assumptions_name_what_is_missing_and_only_that() -> None:
    kassel = assumptions(load_site(ROOT / "examples/kassel/site.yaml"))
    assert any("ground height" in text for text in kassel)
    assert any("No wind is given" in text for text in kassel)
    assert assumptions(load_site(ROOT / "examples/hovsore/site.yaml")) == ()


def test_the_wind_of_a_site_without_one_is_stated_in_one_place() -> None:
    assert site().assumed_wind == Wind(speeds_mps=(10.0,))


def test_hovsore_stands_where_the_study_says() -> None:
    """Grid distances from the published table; the stands are spaced evenly between 185 and 1131 m."""
    hovsore = load_site(ROOT / "examples/hovsore/site.yaml")
    east, north, _ = hovsore.mast("mast").position
    for name, distance_m in (("WS_K", 1122.76), ("WS_S", 1149.14), ("WS_W", 1613.74)):
        position = hovsore.lidar(name).position
        assert abs(complex(position[0] - east, position[1] - north)) == pytest.approx(distance_m, abs=0.01)
    for stand, distance_m in (("stand 5", 185), ("stand 4", 500.3), ("stand 3", 815.7), ("stand 2", 1131)):
        turbine: Turbine = hovsore.turbine(stand)
        assert turbine.position[0] == east
        assert turbine.position[1] - north == pytest.approx(distance_m, abs=0.001)


def test_hovsore_gates_have_the_stated_distance_in_their_middle() -> None:
    hovsore = load_site(ROOT / "examples/hovsore/site.yaml")
    for scan, stated_m in (("sector", 1166), ("stare K", 1135), ("stare W", 1625)):
        gates = hovsore.scan(scan).gates
        assert gates is not None
        assert gates.count == 41
        assert gates.first_m + 20 * gates.spacing_m == stated_m
