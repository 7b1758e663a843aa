"""Adapters: what a browser, a glTF reader and OpenGL get of the reference campaign's scene."""

import json
import os
import re
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

from geometry.errors import UnavailableError
from planner import palette
from planner.scene import beam_layers, gltf_adapter, layers, opengl, plotly_adapter, pyvista_adapter
from planner.scene.model import Label, Layer, Lines, Mesh, Points, Scene, View
from planner.scene.solids import ellipsoid
from planner.scene.structures import OVERHANG
from planner.scene.views import azimuth_of_deg, close_up, overview, project_px

MAST_M = np.array([447647.39, 6255435.76, 0.0])
HEADS_M = {
    "WS_K": np.array([447450.548, 6256541.135, 4.054]) - MAST_M,
    "WS_S": np.array([447893.983, 6256558.133, 5.078]) - MAST_M,
    "WS_W": np.array([448937.717, 6256404.894, 5.409]) - MAST_M,
}
AIM_M = np.array([0.0, 0.0, 4.836 + 120.0])
GROUND_M = 4.8
WIND_DEG = 300.0
STANDS = ["stand 2", "stand 3", "stand 4", "stand 5"]
HUBS_M, ROTORS_M = np.array([84, 95, 75, 99.5]), np.array([90, 130, 100, 113.0])


def _angles(head_m: np.ndarray) -> tuple[float, float, float]:
    east, north, up = AIM_M - head_m
    azimuth_deg = np.degrees(np.arctan2(east, north)) % 360
    return azimuth_deg, np.degrees(np.arctan2(up, np.hypot(east, north))), np.linalg.norm(AIM_M - head_m)


def _stare(name: str, index: int, first_m: float) -> Layer:
    azimuth, elevation, range_m = _angles(HEADS_M[name])
    gates = first_m + 25.0 * np.arange(41)
    return beam_layers.stare_layer(
        name,
        palette.lidar_colour(index),
        HEADS_M[name],
        azimuth,
        elevation,
        gate_ranges_m=gates,
        measured_range_m=gates[np.argmin(abs(gates - range_m))],
        probe_length_m=42.6,
        ground_m=GROUND_M + 0.8,
    )


def _sector() -> tuple[Layer, Layer]:
    azimuth, elevation, _ = _angles(HEADS_M["WS_S"])
    colour = palette.lidar_colour(1)
    rays = azimuth - 29 + 2 * np.arange(30)
    head = HEADS_M["WS_S"]
    fan = beam_layers.fan_layer(
        "WS_S", colour, head, rays, elevation, reach_m=1666, measured_range_m=1166, probe_length_m=42.6
    )
    arcs = beam_layers.range_arc_layer(
        "WS_S", colour, head, [500, 1000, 1500], from_deg=azimuth - 30, width_deg=60, ground_m=GROUND_M
    )
    return fan, arcs


def hovsore(title: str = "Høvsøre SSvsDD 2014", mast: str = "met mast") -> Scene:
    """The reference campaign; the stands are set up at equal spacing, as its description allows."""
    bases = np.array([[0, north, GROUND_M] for north in (1131, 815.7, 500.3, 185)])
    hubs = bases + HUBS_M[:, None] * [0, 0, 1]
    things = [
        _stare("WS_K", 0, 635.0),
        *_sector(),
        _stare("WS_W", 2, 1125.0),
        beam_layers.crossing_layer(
            "crossing",
            "K and W meet: 63.1°",
            AIM_M,
            AIM_M + np.array([0, 0.3, 0.3]),
            ground_m=GROUND_M,
            covariance_m2=np.diag([9.0, 4.0, 6.0]),
        ),
        layers.mast_layer([mast], [[0, 0, 4.836]], 116.5),
        layers.turbine_layer(STANDS, bases, HUBS_M, ROTORS_M, wind_from_deg=WIND_DEG),
        layers.wake_layer(
            STANDS, hubs, ROTORS_M, wind_from_deg=WIND_DEG, decay=0.075, length_m=600, ground_m=GROUND_M + 0.5
        ),
        layers.direction_layer(
            "excluded", palette.EXCLUDED, [0, 0, GROUND_M], 420, [(275, 193)], inner_m=350
        ),
        layers.direction_layer("free", palette.FREE, [0, 0, GROUND_M], 420, [(108, 167)], inner_m=350),
    ]
    base = layers.ground_layers(things, height_m=GROUND_M)
    seen = np.concatenate([line.points_m for layer in (*things, base[2]) for line in layer.lines])
    named = np.stack([label.at_m for layer in things for label in layer.labels if label.rank < 2])
    far = overview(seen, named, facing_deg=WIND_DEG)
    hidden = ("wakes, wind from 300°", "excluded", "free", "WS_S: ranges", "north and scale")
    near = close_up(AIM_M, 70.0, azimuth_of_deg(far), name="at the target, 140 m wide", without=hidden)
    return Scene(title, (*base, *things), (far, near), note="Wind from 300° · turbine stands reconstructed")


class Tags(HTMLParser):
    """Tags, their attributes, and the title's text."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.title = ""
        self.inside = ""
        self.feed(page)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))
        self.inside = tag

    def handle_endtag(self, tag: str) -> None:  # noqa: ARG002
        self.inside = ""

    def handle_data(self, data: str) -> None:
        if self.inside == "title":
            self.title += data


def test_the_page_loads_nothing() -> None:
    """No tag names another file, and the page's own policy forbids loading."""
    parsed = Tags(plotly_adapter.page(hovsore()))
    assert not [attributes for _, attributes in parsed.tags if {"src", "href", "data"} & set(attributes)]
    policies = [a["content"] for tag, a in parsed.tags if a.get("http-equiv") == "Content-Security-Policy"]
    assert len(policies) == 1 and str(policies[0]).startswith("default-src 'none'")
    assert "http" not in str(policies[0])


EVIL = "</title></script><script>alert(1)</script><img src=x onerror=alert(1)> & $x$ %{y}"


def test_names_from_a_site_file_stay_text() -> None:
    """A hostile name adds no tag, and the title shows it letter for letter."""
    harmless, hostile = (Tags(plotly_adapter.page(hovsore(name, name))) for name in ("plain", EVIL))
    assert [tag for tag, _ in hostile.tags] == [tag for tag, _ in harmless.tags]
    assert hostile.title == EVIL
    drawn = json.dumps(plotly_adapter.figure(hovsore(EVIL, EVIL)), ensure_ascii=False)
    assert "<script" not in drawn and "<img" not in drawn and "&lt;img" in drawn


def test_the_page_has_true_proportions_and_says_when_it_has_not() -> None:
    """Aspect by data; an exaggerated scene tells its factor in the title."""
    true, tall = (plotly_adapter.figure(scene)["layout"] for scene in (hovsore(), hovsore().exaggerated(3.0)))
    assert true["scene"]["aspectmode"] == tall["scene"]["aspectmode"] == "data"
    assert "true proportions" in true["title"]["text"] and "heights × 3" in tall["title"]["text"]
    height = [np.ptp(layout["scene"]["zaxis"]["range"]) - 2 for layout in (true, tall)]
    assert height[1] == pytest.approx(3 * height[0])


def test_each_layer_is_one_legend_entry_that_switches_all_its_traces() -> None:
    """Groups are layers; names belong to groups too; hover texts stand on beams."""
    scene = hovsore()
    figure = plotly_adapter.figure(scene)
    entries = [trace["legendgroup"] for trace in figure["data"] if trace["showlegend"]]
    assert entries == [layer.name for layer in scene.layers if layer.in_legend]
    assert {trace["legendgroup"] for trace in figure["data"][1:]} == {layer.name for layer in scene.layers}
    notes = figure["layout"]["scene"]["annotations"]
    assert {note["name"] for note in notes} <= {layer.name for layer in scene.layers}
    assert sum("gate at" in t or "measures at 1135.0 m" in t for t in map(str, figure["data"])) >= 1


def test_the_data_fill_the_axes() -> None:
    """Plotly takes its proportions from the data: were the axes longer, heights would be squeezed."""
    figure = plotly_adapter.figure(hovsore())
    for axis in "xyz":
        values = [v for trace in figure["data"] for v in trace[axis] if v is not None]
        assert [min(values), max(values)] == pytest.approx(
            figure["layout"]["scene"][f"{axis}axis"]["range"], abs=0.01
        )


def test_every_name_lies_within_the_axes() -> None:
    """Plotly leaves out a name at or beyond the edge of its axes."""
    layout = plotly_adapter.figure(hovsore())["layout"]["scene"]
    for axis in "xyz":
        low, high = layout[f"{axis}axis"]["range"]
        assert all(low < note[axis] < high for note in layout["annotations"])


def test_the_page_starts_at_the_overview() -> None:
    """Plotly's camera, brought back to metres, looks along the view's line and shows as much at the focus."""
    scene = hovsore()
    layout = plotly_adapter.figure(scene)["layout"]["scene"]
    ranges = np.array([layout[f"{axis}axis"]["range"] for axis in "xyz"])
    scale = np.cbrt(np.prod(np.ptp(ranges, axis=1)))  # plotly: the sides' product is 1
    eye, centre = (
        np.array([layout["camera"][k][a] for a in "xyz"]) * scale + ranges.mean(axis=1)
        for k in ("eye", "center")
    )
    view = scene.views[0]
    np.testing.assert_allclose(centre, view.focus_m, atol=0.1)
    looks, wanted = eye - centre, view.position_m - view.focus_m
    assert np.linalg.norm(np.cross(looks, wanted)) / np.linalg.norm(looks) / np.linalg.norm(wanted) < 1e-4
    half = [np.linalg.norm(looks) * np.tan(np.radians(22.5)), np.linalg.norm(wanted) * np.tan(np.radians(15))]
    assert half[0] == pytest.approx(half[1], rel=1e-4)


def test_the_page_is_written_whole(tmp_path: Path) -> None:
    """UTF-8, one document, the Danish letters in it."""
    plotly_adapter.write_html(hovsore(), tmp_path / "scene.html")
    text = (tmp_path / "scene.html").read_text(encoding="utf-8")
    assert (
        text.startswith("<!DOCTYPE html>") and text.rstrip().endswith("</html>") and "<title>Høvsøre" in text
    )
    assert re.search(r"plotly.{0,10}v\d", text[:6000])


def test_a_div_without_its_library_is_small() -> None:
    """For a report that has the library once."""
    assert len(plotly_adapter.div(hovsore(), with_library=False, name="a")) < 1_000_000


def test_gltf_is_read_back_with_names_sizes_and_axes() -> None:
    """trimesh reads what was written: a node for each item, y up, metres, the rotor of stand 3 130 m wide."""
    trimesh = pytest.importorskip("trimesh", reason="extra gltf is not installed")
    scene = hovsore()
    read = trimesh.load_scene(trimesh.util.wrap_as_stream(gltf_adapter.to_glb(scene)), file_type="glb")
    prefixes = {name.rsplit("/", 1)[0] for name in read.geometry}
    assert prefixes == {layer.name for layer in scene.layers}
    low, high = scene.extent_m
    np.testing.assert_allclose(
        read.bounds, [[low[0], low[2], -high[1]], [high[0], high[2], -low[1]]], atol=0.01
    )
    solids = [
        read.geometry[f"turbines/{index}"] for index in (1, 4)
    ]  # discs: items 0 solid, 1 disc, 2 rim, then next
    widths = [np.linalg.norm(np.ptp(disc.vertices, axis=0)[[0, 2]]) for disc in solids]
    assert widths == pytest.approx([90.0, 130.0], rel=0.002)
    material = read.geometry["turbines/1"].visual.material
    assert material.alphaMode == "BLEND" and material.doubleSided


def test_gltf_without_its_extra_names_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """The user learns what to install."""
    monkeypatch.setattr("importlib.util.find_spec", lambda _: None)
    with pytest.raises(UnavailableError, match=r"'\.\[gltf\]'"):
        gltf_adapter.to_glb(hovsore())


def test_gltf_is_written_to_its_file(tmp_path: Path) -> None:
    """The magic of a binary glTF file, specification 2.0, 4.4.2."""
    pytest.importorskip("trimesh", reason="extra gltf is not installed")
    gltf_adapter.write_glb(hovsore(), tmp_path / "scene.glb")
    assert (tmp_path / "scene.glb").read_bytes()[:4] == b"glTF"


CRASH = "import os, signal; os.kill(os.getpid(), signal.SIGSEGV)"


@pytest.mark.parametrize(
    "probe", [CRASH, "import time; time.sleep(30)", "print('drew nothing')", "raise SystemExit(3)"]
)
def test_a_machine_that_cannot_draw_is_told_so(monkeypatch: pytest.MonkeyPatch, probe: str) -> None:
    """A crash, silence, a black picture, a failure of the child: one clear error, and this process lives."""
    monkeypatch.setattr(opengl, "PROBE", probe)
    monkeypatch.setattr(opengl, "TIMEOUT_S", 0.4)
    monkeypatch.setattr(opengl, "off_screen_window", opengl.off_screen_window.__wrapped__)
    with pytest.raises(UnavailableError, match=r"libgl1 and libegl1.*HTML"):
        pyvista_adapter.render_image(hovsore())


def test_the_second_kind_of_window_is_tried_when_the_first_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    """The child learns the kind through VTK's variable; the environment is afterwards as it was."""
    monkeypatch.delenv(opengl.WINDOW_VARIABLE, raising=False)
    egl = "vtkEGLRenderWindow"
    only_egl = f"import os; assert os.environ['VTK_DEFAULT_OPENGL_WINDOW'] == '{egl}'; print('drew', '{egl}')"
    monkeypatch.setattr(opengl, "PROBE", only_egl)
    monkeypatch.setattr(opengl, "off_screen_window", opengl.off_screen_window.__wrapped__)
    with opengl.drawing_off_screen():
        assert os.environ[opengl.WINDOW_VARIABLE] == "vtkEGLRenderWindow"
    assert opengl.WINDOW_VARIABLE not in os.environ


def test_nothing_heavy_is_imported_with_the_adapters() -> None:
    """The command line starts at once: drawing libraries come inside functions."""
    code = (
        "import sys; from planner.scene import gltf_adapter, layers, plotly_adapter, pyvista_adapter; "
        "heavy = {'pyvista', 'vtkmodules', 'plotly', 'trimesh', 'matplotlib', 'PIL', 'scipy'}; "
        "print(heavy & set(sys.modules))"
    )
    root = Path(__file__).parents[2]
    done = subprocess.run([sys.executable, "-c", code], cwd=root, capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "set()"


@pytest.fixture(scope="module")
def opengl_here() -> None:
    """Ask once; the answer is kept for the run."""
    if opengl.off_screen_window() is None:
        pytest.skip("this machine has no OpenGL: libgl1 and libegl1 are not installed")


def _share_near(image: np.ndarray, colour: str, within: float = 12.0) -> float:
    apart = np.abs(image.astype(float) - 255 * np.array(palette.rgb(colour))).max(axis=-1)
    return float((apart < within).mean())


@pytest.mark.usefixtures("opengl_here")
def test_the_picture_shows_every_lidar_in_its_colour(tmp_path: Path) -> None:
    """Size as asked, soft ground, all three lidars' colours, nothing black behind."""
    pyvista_adapter.write_png(hovsore(), tmp_path / "scene.png", width_px=1200, height_px=750)
    from PIL import Image

    with Image.open(tmp_path / "scene.png") as picture:
        image = np.asarray(picture)
    assert image.shape == (750, 1200, 3)
    assert all(_share_near(image, colour) > 2e-4 for colour in palette.LIDARS[:3])
    assert _share_near(image, palette.GROUND) > 0.1 and _share_near(image, "#000000") < 0.01


@pytest.mark.usefixtures("opengl_here")
def test_vtk_draws_where_the_projection_says() -> None:
    """A ball off the axis: the middle of its pixels is where names are placed, within a pixel and a half."""
    ball = Layer(
        "ball",
        "#d40000",
        (ellipsoid([40.0, 30.0, 20.0], 4.0 * np.eye(3)), Label("$2 & α$", [-60.0, 0.0, 0.0])),
    )
    frame = Layer("frame", "#0000d4", (Lines([[-80, -80, 0], [80, 80, 0]], [[0, 1]]), Points([[0, 0, 0]])))
    view = View("v", [150.0, -220.0, 120.0], [0.0, 0.0, 0.0], 40.0)
    image = pyvista_adapter.render_image(Scene("ball", (ball, frame), (view,)), width_px=500, height_px=400)
    width = 500 * (1 - pyvista_adapter.LEGEND_WIDTH_ALONE)  # the rest is legend and title
    height = 400 * (1 - pyvista_adapter.TITLE_HEIGHT)
    panel = image[round(400 - height) :, : round(width)].astype(int)
    rows, columns = np.nonzero((panel[..., 0] > 110) & (panel[..., 1:].max(axis=-1) < 70))
    expected = project_px(view, [[40.0, 30.0, 20.0]], width, height)[0]
    assert abs(columns.mean() + 0.5 - expected[0]) < 1.5
    assert abs(height - (rows.mean() + 0.5) - expected[1]) < 1.5


@pytest.mark.usefixtures("opengl_here")
def test_a_window_needs_a_display(monkeypatch: pytest.MonkeyPatch) -> None:
    """With off-screen OpenGL alone, the user is sent to the picture or the page."""
    monkeypatch.setattr(pyvista_adapter, "require_off_screen", lambda: "vtkEGLRenderWindow")
    with pytest.raises(UnavailableError, match="no display"):
        pyvista_adapter.show(hovsore())


def test_a_scene_without_views_or_names_can_be_drawn() -> None:
    """The page chooses a camera of its own."""
    bare = Scene("bare", (Layer("one", "#123456", (Mesh([[0, 0, 0], [9, 0, 0], [0, 9, 1]], [[0, 1, 2]]),)),))
    layout = plotly_adapter.figure(bare)["layout"]["scene"]
    assert layout["annotations"] == [] and np.isfinite(list(layout["camera"]["eye"].values())).all()


def test_rotors_stand_in_front_of_their_towers() -> None:
    """The drawn hub is off the tower by the stated share of the diameter: the picture's only liberty."""
    turbines = next(layer for layer in hovsore().layers if layer.name == "turbines")
    offset = turbines.labels[0].at_m - np.array([0, 1131, GROUND_M + 84])
    assert np.linalg.norm(offset) == pytest.approx(OVERHANG * 90)
