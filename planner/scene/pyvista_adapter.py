"""A scene as a picture (PNG, drawn off screen) and as an interactive window, through pyvista.

The picture has a title, the overview, a close-up if the scene has one, and a legend. Everything is drawn at
twice the size and averaged down: thin lines stay smooth on every kind of OpenGL.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from geometry.errors import UnavailableError
from planner import palette
from planner.scene.model import Layer, Scene, View
from planner.scene.opengl import drawing_off_screen, require_off_screen
from planner.scene.pyvista_overlay import (
    OVERSAMPLE,
    add_legend,
    add_names,
    add_symbols,
    add_title,
    packed_cells,
)
from planner.scene.views import default_view

if TYPE_CHECKING:
    import pyvista

TITLE_HEIGHT = 0.075  # shares of the picture
SIDE_WIDTH = 0.3
CLOSE_UP_HEIGHT = 0.53
LEGEND_WIDTH_ALONE = 0.23
PEELS = 8  # layers of transparency that are sorted exactly

Viewport = tuple[float, float, float, float]


def render_image(scene: Scene, *, width_px: int = 1600, height_px: int = 1000) -> NDArray[np.uint8]:
    """Draw a scene off screen.

    Parameters
    ----------
    scene
        What to draw. Its first view is the overview, its second the close-up; without views one is chosen.
    width_px, height_px
        Size of the picture.

    Returns
    -------
    NDArray[np.uint8]
        (height, width, 3) red, green, blue from 0 to 255.

    Raises
    ------
    UnavailableError
        If the machine has no OpenGL.
    """
    with drawing_off_screen():
        import pyvista

        size = [OVERSAMPLE * width_px, OVERSAMPLE * height_px]
        panels = _panels(scene)
        plotter = pyvista.Plotter(off_screen=True, shape=(1, 2 + len(panels)), border=False, window_size=size)
        # with multisampling on, sorted transparency loses what is seen through
        _window_of(plotter).SetMultiSamples(0)
        try:
            _draw(plotter, scene, panels, size)
            large = np.asarray(plotter.screenshot(return_img=True), dtype=np.uint16)[..., :3]
        finally:
            plotter.close()
    tiles = [large[i::OVERSAMPLE, j::OVERSAMPLE] for i in range(OVERSAMPLE) for j in range(OVERSAMPLE)]
    return np.asarray(sum(tiles) // len(tiles), dtype=np.uint8)


def write_png(scene: Scene, path: Path, *, width_px: int = 1600, height_px: int = 1000) -> None:
    """Draw a scene into a PNG file; the parameters and errors are those of `render_image`."""
    image = render_image(scene, width_px=width_px, height_px=height_px)
    from PIL import Image

    Image.fromarray(image).save(path, format="PNG", optimize=True)


def show(scene: Scene) -> None:
    """Open an interactive window on a scene and wait until it is closed.

    Raises
    ------
    UnavailableError
        If the machine has no OpenGL or no display.
    """
    window = require_off_screen()
    if window in ("vtkEGLRenderWindow", "vtkOSOpenGLRenderWindow"):
        raise UnavailableError(
            "no window: this machine can draw but has no display. Write a PNG or the HTML page instead"
        )
    import pyvista

    plotter = pyvista.Plotter(title=scene.title)
    _window_of(plotter).SetMultiSamples(0)
    plotter.renderer.set_background(palette.SKY)
    for layer in scene.layers:
        _add_layer(plotter, layer, 1)
    labels = [label for _, label in scene.names]
    if labels:
        plotter.add_point_labels(
            np.stack([label.at_m for label in labels]),
            [label.text for label in labels],
            font_size=palette.LABEL_PX,
            text_color=palette.INK,
            shape_color=palette.PAPER,
            shape_opacity=0.7,
            always_visible=True,
            show_points=False,
        )
    _aim(plotter, scene.views[0] if scene.views else default_view(scene))
    _sort_transparency(plotter)
    plotter.show()


def _panels(scene: Scene) -> list[tuple[View, Viewport]]:
    views = scene.views[:2] or (default_view(scene),)
    top = 1 - TITLE_HEIGHT
    if len(views) == 1:
        return [(views[0], (0.0, 0.0, 1 - LEGEND_WIDTH_ALONE, top))]
    split = 1 - SIDE_WIDTH
    return [(views[0], (0.0, 0.0, split, top)), (views[1], (split, top * (1 - CLOSE_UP_HEIGHT), 1.0, top))]


def _draw(
    plotter: pyvista.Plotter, scene: Scene, panels: list[tuple[View, Viewport]], size: list[int]
) -> None:
    for index, (view, viewport) in enumerate(panels):
        plotter.subplot(0, index)
        plotter.renderer.SetViewport(*viewport)
        plotter.renderer.set_background(palette.SKY)
        shown = replace(
            scene, layers=tuple(layer for layer in scene.layers if layer.name not in view.without)
        )
        for layer in shown.layers:
            _add_layer(plotter, layer, OVERSAMPLE)
        _aim(plotter, view)
        _sort_transparency(plotter)
        panel_px = (_width(viewport, size), _height(viewport, size))
        add_symbols(plotter, shown, view, panel_px)
        add_names(plotter, shown, view, panel_px, caption=index > 0)
    main = panels[0][1]
    side: Viewport = (main[2], 0.0, 1.0, panels[-1][1][1] if len(panels) > 1 else main[3])
    plotter.subplot(0, len(panels))
    plotter.renderer.SetViewport(0.0, main[3], 1.0, 1.0)
    plotter.renderer.set_background(palette.PAPER)
    add_title(plotter, scene, _height((0.0, main[3], 1.0, 1.0), size))
    plotter.subplot(0, len(panels) + 1)
    plotter.renderer.SetViewport(*side)
    plotter.renderer.set_background(palette.PAPER)
    add_legend(plotter, scene, _height(side, size))


def _width(viewport: Viewport, size: list[int]) -> float:
    return (viewport[2] - viewport[0]) * size[0]


def _height(viewport: Viewport, size: list[int]) -> float:
    return (viewport[3] - viewport[1]) * size[1]


def _aim(plotter: pyvista.Plotter, view: View) -> None:
    camera = plotter.renderer.camera
    camera.position, camera.focal_point, camera.up = (
        tuple(view.position_m),
        tuple(view.focus_m),
        (0.0, 0.0, 1.0),
    )
    camera.view_angle = view.view_angle_deg
    plotter.renderer.reset_camera_clipping_range()


def _window_of(plotter: pyvista.Plotter) -> Any:
    return plotter.render_window


def _sort_transparency(plotter: pyvista.Plotter) -> None:
    plotter.renderer.SetUseDepthPeeling(True)
    plotter.renderer.SetMaximumNumberOfPeels(PEELS)


def _add_layer(plotter: pyvista.Plotter, layer: Layer, scale: int) -> None:
    import pyvista

    for mesh in layer.meshes:
        opacity = layer.opacity * mesh.opacity
        surface = pyvista.PolyData(np.array(mesh.vertices_m), faces=packed_cells(mesh.triangles))
        shaded = mesh.shaded and opacity > 0.9  # what is seen through is not: its colour then tells the layer
        light = {"ambient": 0.35, "diffuse": 0.7} if shaded else {"lighting": False}
        plotter.add_mesh(surface, color=layer.colour, opacity=opacity, reset_camera=False, **light)
    for lines in layer.lines:
        drawn = pyvista.PolyData(np.array(lines.points_m), lines=packed_cells(lines.segments))
        opacity = layer.opacity * lines.opacity
        width = scale * lines.width_px
        plotter.add_mesh(
            drawn, color=layer.colour, opacity=opacity, line_width=width, lighting=False, reset_camera=False
        )
    for points in layer.points:
        if scale == OVERSAMPLE and points.is_symbol:
            continue  # drawn flat by add_symbols: half a sphere would sink into the ground
        plotter.add_points(
            np.array(points.points_m),
            color=layer.colour,
            opacity=layer.opacity * points.opacity,
            point_size=scale * points.size_px,
            render_points_as_spheres=True,
            lighting=False,
            reset_camera=False,
        )
