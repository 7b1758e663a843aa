"""The Scotland example: its made-up terrain, and what its README says of tour, discs and sight."""

import json
import runpy
from pathlib import Path

import numpy as np
import pytest

from planner.cli import run
from planner.files.yaml_site import load_site
from planner.ground import ground_under_m, heights_of

pytest.importorskip("rasterio")

FOLDER = Path(__file__).resolve().parents[2] / "examples" / "scotland"
SITE = FOLDER / "site.yaml"


def test_the_script_makes_the_raster_that_is_shipped():
    made = runpy.run_path(str(FOLDER / "make_terrain.py"))
    heights = heights_of(load_site(SITE))
    assert heights is not None
    raster = heights.ground
    again = made["heights_m"](raster.east_m[None], raster.northing_m[:, None])
    assert np.abs(again - raster.height_m).max() < 0.06  # written to 0.1 m
    assert raster.height_datum == "above_sea_level"  # said by the file's own CRS


def test_the_ground_passes_below_heads_and_points_as_it_says():
    site = load_site(SITE)
    heads = np.array([lidar.position for lidar in site.lidars])
    assert heads[:, 2] - ground_under_m(site, heads) == pytest.approx([2.0, 2.0], abs=0.5)
    points = np.array([site.target_position_m(target) for target in site.targets])
    above = points[:, 2] - ground_under_m(site, points)
    assert above.mean() == pytest.approx(50.0, abs=1.0)
    assert np.abs(above - 50.0).max() < 7.0


def told(capsys, *arguments):
    assert run([arguments[0], str(SITE), *arguments[1:], "--json", "--quiet"]) == 0
    return json.loads(capsys.readouterr().out)


def test_what_the_readme_says_of_tour_and_discs(capsys):
    assert told(capsys, "tour")["cycle_ms"] == 13646
    assert len(told(capsys, "tour", "--cover", "500")["cover"]["discs"]) == 4


def test_one_ray_is_lost_and_its_order_is_that_of_the_tour(capsys):
    rows = told(capsys, "point")
    assert {row["terrain"] for row in rows} == {"clear", "blocked"}
    blocked = {(row["lidar"], row["target"]) for row in rows if row["terrain"] == "blocked"}
    findings = told(capsys, "check")
    lost = [item["subject"] for item in findings if item["code"] == "beam-blocked"]
    assert blocked == {("ws2", "P08")} and lost == ["tour of ws2"]
    order = [step["target"] for step in told(capsys, "tour")["steps"]]
    assert [list(scan.targets) for scan in load_site(SITE).scans] == [order, order]
