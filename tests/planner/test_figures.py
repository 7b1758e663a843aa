"""The figures: they draw any name as it stands, keep names apart, and leave out what nothing is known of."""

from io import BytesIO
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

from planner.figures.canvas import canvas
from planner.figures.map_layers import most_lost
from planner.figures.map_layers import scans as scan_layers
from planner.figures.names import Name, draw_names, shown
from planner.figures.sector_error import TierCurve, sector_error
from planner.figures.site_map import site_map
from planner.figures.tradeoff import tradeoff_figure
from planner.figures.wake_rose import rings, wake_rose
from planner.palette import EXCLUDED, rgb
from planner.plan import Plan
from planner.site import Site
from planner.tradeoff import Trade

EVIL = r"$\frac{$ <b>&amp;</b> 風 _x"


def pixels(png: bytes) -> np.ndarray:
    return np.asarray(Image.open(BytesIO(png)).convert("RGB"))


def near(image: np.ndarray, colour: str, off: int = 12) -> int:
    """Number of pixels of about a colour."""
    wanted = np.array(rgb(colour)) * 255
    return int((np.abs(image.astype(float) - wanted).max(axis=-1) <= off).sum())


def evil_site() -> Site:
    """A small site with a name of all kinds of trouble in every place."""
    base = (448000.0, 6256000.0, 5.0)
    return Site.model_validate(
        {
            "name": EVIL,
            "crs": "EPSG:32632",
            "lidars": [
                {"name": f"l1{EVIL}", "position": base, "instrument": "windscanner-200s"},
                {
                    "name": f"_l2{EVIL}",
                    "position": (449000.0, 6256000.0, 5.0),
                    "instrument": "windscanner-200s",
                },
            ],
            "masts": [{"name": f"m{EVIL}", "position": (448400.0, 6256700.0, 5.0), "height_m": 80.0}],
            "turbines": [
                {
                    "name": f"t{EVIL}",
                    "position": (448400.0, 6257300.0, 5.0),
                    "hub_height_m": 90.0,
                    "rotor_diameter_m": 110.0,
                }
            ],
            "obstacles": [
                {
                    "name": f"o{EVIL}",
                    "position": (448100.0, 6256300.0, 5.0),
                    "width_m": 20.0,
                    "length_m": 30.0,
                    "height_m": 9.0,
                }
            ],
            "targets": [{"name": f"p{EVIL}", "mast": f"m{EVIL}", "height_m": 90.0}],
            "scans": [
                {
                    "name": f"_s1{EVIL}",
                    "lidar": f"l1{EVIL}",
                    "target": f"p{EVIL}",
                    "type": "sector",
                    "sector_deg": 30.0,
                    "step_deg": 2.0,
                    "accumulation_s": 0.5,
                },
                {
                    "name": f"s2{EVIL}",
                    "lidar": f"_l2{EVIL}",
                    "target": f"p{EVIL}",
                    "type": "stare",
                    "accumulation_s": 0.5,
                },
            ],
            "pairs": [{"name": f"d{EVIL}", "scans": [f"_s1{EVIL}", f"s2{EVIL}"], "target": f"p{EVIL}"}],
            "wind": {"directions_deg": [[150, 300]]},
        }
    )


def test_the_map_shows_lost_rays_and_excluded_directions_in_their_colour(hovsore: Plan, kassel: Plan) -> None:
    assert near(pixels(site_map(hovsore)), EXCLUDED) > 500
    assert near(pixels(site_map(kassel)), EXCLUDED) == 0


def test_the_north_arrow_points_up(kassel: Plan) -> None:
    """From the tip downwards it widens, then only the thin shaft is left."""
    image = pixels(site_map(kassel))
    height, width = image.shape[:2]
    strip = image[: height // 16, int(0.97 * width) :].max(axis=-1) < 120
    widths = strip.sum(axis=1)[strip.any(axis=1)]
    widest = int(np.argmax(widths))
    assert widths[0] < widths[widest] / 3
    assert np.median(widths[widest + 3 :]) < widths[widest] / 3


@pytest.mark.parametrize("draw", [site_map, wake_rose])
def test_any_name_is_drawn_as_it_stands(draw) -> None:
    """Mathtext would raise on half a formula, a missing letter would warn, and warnings are errors here."""
    picture = draw(Plan(evil_site()))
    assert picture is not None and len(np.unique(pixels(picture))) > 20


def test_no_rose_where_no_wake_reaches_anything(kassel: Plan) -> None:
    assert wake_rose(kassel) is None
    assert most_lost(kassel) == []


def test_a_rose_has_only_the_rings_of_the_sites_model() -> None:
    site = evil_site().model_copy(update={"wakes": evil_site().wakes.model_copy(update={"model": "iec"})})
    names = [ring.name for ring in rings(Plan(site).exclusions[0])]
    assert names == ["wind that counts", "disturbed (IEC 61400-12-1)", "counts and is free"]


@settings(max_examples=15, deadline=None, derandomize=True)
@given(st.lists(st.tuples(st.floats(0, 10), st.floats(0, 10)), min_size=2, max_size=9))
def test_names_neither_cover_each_other_nor_leave_the_axes(places) -> None:
    with canvas(7, 5) as figure:
        axes = figure.add_subplot()
        axes.set_xlim(0, 10)
        axes.set_ylim(0, 10)
        names = [Name(f"stand {i}", np.array(place), "#000000") for i, place in enumerate(places)]
        texts = draw_names(axes, names, np.empty((0, 2)))
        frame, boxes = axes.get_window_extent(), [text.get_window_extent() for text in texts]
        assert not any(a.overlaps(b) for i, a in enumerate(boxes) for b in boxes[:i])
        assert all(
            frame.x0 <= box.x0 and box.x1 <= frame.x1 and frame.y0 <= box.y0 and box.y1 <= frame.y1
            for box in boxes
        )


def test_long_and_foreign_names_are_made_to_fit() -> None:
    assert shown("x" * 100) == "x" * 31 + "…"
    assert shown("Ærø $5$") == "Ærø $5$"


def curve(tier: str = "noise", **known: list[float]) -> TierCurve:
    nothing = np.full(3, np.nan)
    return TierCurve(
        tier,
        np.array([60.0, 30.0, 8.0]),
        *(np.array(known.get(f, nothing), dtype=float) for f in TierCurve._fields[2:]),
    )


def test_panels_of_which_nothing_is_known_are_left_out() -> None:
    one = pixels(sector_error([curve(speed_std_mps=[0.1, 0.2, 0.9])], title=EVIL))
    four = pixels(
        sector_error(
            [curve(**{field: [1, 2, 3] for field in TierCurve._fields[2:]})], title=EVIL, recommended_deg=30.0
        )
    )
    assert four.shape[1] > 1.5 * one.shape[1] and four.shape[0] > 1.5 * one.shape[0]
    assert sector_error([curve()], title="nothing") is None


def test_a_points_scan_has_its_rays_and_nothing_between_them() -> None:
    """Its layer names the points, and no area of it is filled."""
    site = evil_site()
    far = {"name": "far", "position": (448900.0, 6256300.0, 90.0)}
    scan = {"name": "tour", "lidar": site.lidars[0].name, "type": "points", "accumulation_s": 1.0}
    more = {
        "targets": [*site.model_dump()["targets"], far],
        "scans": [{**scan, "targets": [site.targets[0].name, "far"]}],
        "pairs": [],
    }
    plan = Plan(Site.model_validate({**site.model_dump(exclude_none=True), **more}))
    with canvas(5, 5) as figure:
        axes = figure.add_subplot()
        layers = list(scan_layers(plan, axes))
        assert not axes.patches and len(axes.lines) >= 4
    assert next(text.split(" ")[0] for layer in layers for _, text in layer.legend) == "points"


@pytest.mark.parametrize("times_s", [(4.0, 4.1), (1e-8, 10.0)])
def test_times_that_are_close_or_far_apart_have_labels_that_stay_apart(times_s, monkeypatch) -> None:
    """Every label of the axis of times ends before the next begins, and none is a bare power."""
    seen = []

    def kept(figure):
        figure.canvas.draw()
        boxes = [text.get_window_extent() for text in figure.axes[0].get_xticklabels() if text.get_text()]
        seen.extend(sorted((box.x0, box.x1) for box in boxes))
        return b""

    monkeypatch.setattr("planner.figures.tradeoff.image", kept)
    tradeoff_figure([Trade("geometry", f"way {i}", time, 0.1, "m") for i, time in enumerate(times_s)])
    assert len(seen) >= 2
    assert all(first[1] < second[0] for first, second in pairwise(seen))
