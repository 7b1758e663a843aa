"""Wind roses: what is read, what is refused, shares and means."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from geometry.angles import Sector, SectorSet
from geometry.errors import InputError
from planner.plan import Plan
from planner.site import Site
from planner.wind_climate import climate_at, largest_gust_mps
from planner.wind_rose import load_rose, prevailing_deg, share_within

Moor = Callable[..., Plan]
FOUR = "direction_deg,share\n0,10\n90,20\n180,30\n270,40\n"


def rose_file(folder: Path, text: str) -> Path:
    path = folder / "rose.csv"
    path.write_text(text, encoding="utf-8")
    return path


def site_with(moor: Moor, **wind: Any) -> Site:
    return moor(wind=wind).site


def between(start: float, stop: float) -> SectorSet:
    return SectorSet.of([Sector.between(start, stop)])


def test_shares_add_up_to_one_in_ascending_order(tmp_path: Path) -> None:
    rose = load_rose(rose_file(tmp_path, "share, direction_deg\n40,270\n10,0\n30,180\n20,90\n"))
    assert rose.direction_deg.tolist() == [0, 90, 180, 270]
    assert rose.share.tolist() == [0.1, 0.2, 0.3, 0.4]
    assert rose.weibull_scale_mps is None
    assert [sector.from_deg for sector in rose.sectors] == [315, 45, 135, 225]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("direction_deg\n0\n180\n", "share is missing"),
        ("direction_deg,share,weibull_shape\n0,1,2\n180,1,2\n", "weibull_scale_mps is missing"),
        ("direction_deg,share\n0,1\n100,1\n", "not equal sectors"),
        ("direction_deg,share\n0,1\n", "not equal sectors"),
        ("direction_deg,share\n0,-1\n180,1\n", "0 or larger"),
        ("direction_deg,share\n0,0\n180,0\n", "not all 0"),
        ("direction_deg,share\n0,\n180,1\n", "have to be numbers"),
        ("direction_deg,share\n0,some\n180,1\n", "no number"),
        ("direction_deg,share,weibull_scale_mps,weibull_shape\n0,0.5,0,2\n180,0.5,8,2\n", "above 0"),
        ("", "cannot be read"),
    ],
)
def test_what_is_no_rose_is_refused(tmp_path: Path, text: str, said: str) -> None:
    with pytest.raises(InputError, match=said):
        load_rose(rose_file(tmp_path, text))


def test_a_rose_that_is_not_there_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="cannot be read"):
        load_rose(tmp_path / "none.csv")


def test_shares_by_hand(moor: Moor, tmp_path: Path) -> None:
    """The sector about 0° has 10 %, half of it east of north; a third of the one about 90° is 30° wide."""
    site = site_with(moor, rose=str(rose_file(tmp_path, FOUR)))
    assert share_within(site, SectorSet.full()) == pytest.approx(1.0)
    assert share_within(site, between(0, 45)) == pytest.approx(0.05)
    assert share_within(site, between(45, 75)) == pytest.approx(0.2 / 3)
    assert share_within(site, between(300, 20)) == pytest.approx(0.4 * 15 / 90 + 0.1 * 65 / 90)


def test_without_a_rose_every_direction_is_alike(moor: Moor) -> None:
    assert share_within(moor().site, between(350, 26)) == pytest.approx(0.1)


def test_the_prevailing_direction_is_the_mean_of_the_wanted_ones(moor: Moor, tmp_path: Path) -> None:
    """Uniform: the middle. With a rose: by symmetry 270, and the vector sum of four sectors by hand."""
    assert prevailing_deg(moor().site, between(118, 270)) == pytest.approx(194.0, abs=0.01)
    assert prevailing_deg(moor().site, between(350, 20)) == pytest.approx(5.0, abs=0.01)
    site = site_with(moor, rose=str(rose_file(tmp_path, "direction_deg,share\n0,20\n90,0\n180,20\n270,60\n")))
    assert prevailing_deg(site, SectorSet.full()) == pytest.approx(270.0, abs=0.01)
    site = site_with(moor, rose=str(rose_file(tmp_path, FOUR)))
    assert prevailing_deg(site, SectorSet.full()) == pytest.approx(225.0, abs=0.01)  # (-0.2, -0.2)


def test_a_wind_from_everywhere_prevails_from_nowhere(moor: Moor) -> None:
    assert prevailing_deg(moor().site, SectorSet.full()) != prevailing_deg(moor().site, SectorSet.full())
    assert moor().axis_from_wind_deg(moor().layouts[0]) is None


def test_gusts_are_three_standard_deviations_above_the_fastest_wind(moor: Moor) -> None:
    air = {"intensity": 0.1, "length_m": 100}
    assert largest_gust_mps(site_with(moor, speed_range_mps=[4, 20], turbulence=air)) == pytest.approx(26.0)
    assert largest_gust_mps(site_with(moor, speeds_mps=[8, 12])) == 12.0


def test_gusts_grow_with_height_as_the_wind_does(moor: Moor) -> None:
    """20 m/s at 10 m is 20·10^0.2 at 100 m above the ground."""
    site = site_with(moor, speed_range_mps=[4, 20], reference_height_m=10, shear_exponent=0.2)
    assert largest_gust_mps(site, ["T"]) == pytest.approx(20 * 10**0.2)
    assert largest_gust_mps(site) == 20.0


def test_the_climate_of_a_rose_keeps_its_shares(moor: Moor, tmp_path: Path) -> None:
    """Shares of the four quarters come back as weights of the states within them."""
    climate = climate_at(site_with(moor, rose=str(rose_file(tmp_path, FOUR))), "T", SectorSet.empty())
    for middle, share in ((0, 0.1), (90, 0.2), (180, 0.3), (270, 0.4)):
        inside = Sector((middle - 45) % 360, 90).contains(climate.from_deg)
        assert climate.weight[inside].sum() == pytest.approx(share)


def test_the_climate_leaves_out_what_wakes_take_unless_directions_are_declared(moor: Moor) -> None:
    taken = between(90, 180)
    assert not taken.contains(climate_at(site_with(moor, speeds_mps=[8]), "T", taken).from_deg).any()
    declared = site_with(moor, speeds_mps=[8], directions_deg=[[100, 170]])
    assert taken.contains(climate_at(declared, "T", taken).from_deg).all()
    with pytest.raises(InputError, match="no wind direction is free"):
        climate_at(site_with(moor, speeds_mps=[8]), "T", SectorSet.full())


def test_speeds_are_carried_to_the_target(moor: Moor) -> None:
    """The power law on height above ground: 100 m against 50 m, exponent 0.14."""
    site = site_with(moor, speeds_mps=[8], reference_height_m=50)
    assert climate_at(site, "T", SectorSet.empty()).speed_mps == pytest.approx(8 * 2**0.14)
