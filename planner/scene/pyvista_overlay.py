"""What lies flat over a drawn scene: names with leader lines, symbols, title, legend, in pixels of a panel.

All sizes are multiplied by `OVERSAMPLE`, as the picture is drawn larger and averaged down.
"""

from __future__ import annotations

import importlib.util
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from geometry.arrays import FloatArray, IntArray
from planner import palette
from planner.scene.model import Label, Scene, View
from planner.scene.placement import leader_end_px, place_names
from planner.scene.views import drawn_px, project_px

if TYPE_CHECKING:
    import pyvista

OVERSAMPLE = 2


def packed_cells(indices: IntArray) -> IntArray:
    """Write index rows the way VTK stores cells: the count before each row."""
    counted = np.concatenate([np.full((len(indices), 1), indices.shape[1]), indices], axis=1)
    return np.asarray(counted.ravel(), dtype=np.intp)


def _text(text: str, size_px: float, colour: str, *, bold: bool = False) -> Any:
    """Make a text at a pixel position; a dollar sign is a dollar sign, not the start of a formula."""
    from vtkmodules.vtkRenderingCore import vtkTextActor

    actor = vtkTextActor()
    actor.SetInput(text.replace("$", "\\$"))
    style = actor.GetTextProperty()
    style.SetFontSize(round(size_px))
    style.SetColor(*palette.rgb(colour))
    style.SetVerticalJustificationToCentered()
    font = _font_file(bold)
    if font is None:
        style.SetFontFamilyToArial()
        style.SetBold(bold)
    else:
        style.SetFontFamily(4)  # VTK_FONT_FILE
        style.SetFontFile(str(font))
    return actor


def _font_file(bold: bool) -> Path | None:
    """Find the DejaVu Sans that matplotlib carries, without importing it: it has accents and Greek."""
    spec = importlib.util.find_spec("matplotlib")
    if spec is None or spec.origin is None:
        return None
    name = "DejaVuSans-Bold.ttf" if bold else "DejaVuSans.ttf"
    font = Path(spec.origin).parent / "mpl-data" / "fonts" / "ttf" / name
    return font if font.is_file() else None


def _text_size_px(actor: Any) -> FloatArray:
    from vtkmodules.vtkRenderingFreeType import vtkFreeTypeTools

    box = [0, 0, 0, 0]
    tools = vtkFreeTypeTools.GetInstance()
    tools.GetBoundingBox(actor.GetTextProperty(), actor.GetInput(), 72, box)
    return np.array([box[1] - box[0] + 1.0, box[3] - box[2] + 1.0])


def add_names(
    plotter: pyvista.Plotter, scene: Scene, view: View, size_px: tuple[float, float], *, caption: bool
) -> None:
    """Place the names that this view shows and draw them with their leader lines."""
    labels = [label for _, label in scene.names]
    room = OVERSAMPLE * 10.0
    bounds = (room, room, size_px[0] - room, size_px[1] - (OVERSAMPLE * 40.0 if caption else room))
    if caption:
        heading = _text(view.name, OVERSAMPLE * palette.LEGEND_PX, palette.INK, bold=True)
        heading.SetPosition(OVERSAMPLE * 14.0, size_px[1] - OVERSAMPLE * 22.0)
        plotter.renderer.AddViewProp(heading)
    if not labels:
        return
    seen_px = project_px(view, np.stack([label.at_m for label in labels]), *size_px)
    inside = [
        _is_inside(spot, bounds) and (label.rank < 2 or not caption)
        for label, spot in zip(labels, seen_px, strict=True)
    ]
    shown = [label for label, here in zip(labels, inside, strict=True) if here]
    if not shown:
        return
    anchors = seen_px[inside][:, :2] / OVERSAMPLE
    actors = [_name(label) for label in shown]
    sizes = (np.stack([_text_size_px(actor) for actor in actors])) / OVERSAMPLE + np.array([14.0, 9.0])
    middles = place_names(
        anchors,
        sizes,
        (bounds[0] / OVERSAMPLE, bounds[1] / OVERSAMPLE, bounds[2] / OVERSAMPLE, bounds[3] / OVERSAMPLE),
        ranks=[label.rank for label in shown],
        busy_px=drawn_px(scene, view, size_px[0] / OVERSAMPLE, size_px[1] / OVERSAMPLE),
    )
    for actor, anchor, middle, size in zip(actors, anchors, middles, sizes, strict=True):
        _add_name(plotter, actor, anchor * OVERSAMPLE, middle * OVERSAMPLE, size * OVERSAMPLE)


def _is_inside(spot: FloatArray, bounds: tuple[float, float, float, float]) -> bool:
    return bool(bounds[0] <= spot[0] <= bounds[2] and bounds[1] <= spot[1] <= bounds[3])


def add_symbols(plotter: pyvista.Plotter, scene: Scene, view: View, size_px: tuple[float, float]) -> None:
    """Draw lidars and the like as discs that nothing hides, in a panel of a size [px]."""
    turn = 2 * np.pi * np.arange(32) / 32
    circle = np.stack([np.cos(turn), np.sin(turn)], axis=1)
    symbols = [(layer, points) for layer in scene.layers for points in layer.points if points.is_symbol]
    for layer, points in symbols:
        radius = OVERSAMPLE * points.size_px / 2
        for spot in project_px(view, points.points_m, *size_px):
            for colour, size in ((palette.PAPER, radius + OVERSAMPLE * 2.0), (layer.colour, radius)):
                if np.isfinite(spot).all():
                    _add_flat(plotter, spot[:2] + size * circle, [list(range(32))], colour, 1.0, 1.0)


def _name(label: Label) -> Any:
    small = label.rank >= 2
    size = palette.NOTE_PX if small else palette.LABEL_PX
    return _text(
        label.text, OVERSAMPLE * size, palette.INK_SOFT if small else palette.INK, bold=label.rank == 0
    )


def _add_name(
    plotter: pyvista.Plotter, actor: Any, anchor: FloatArray, middle: FloatArray, size: FloatArray
) -> None:
    half = size / 2
    end = leader_end_px(anchor, middle, size)
    _add_flat(plotter, np.stack([anchor, end]), [[0, 1]], palette.INK_SOFT, 0.9, OVERSAMPLE * 1.2)
    corners = middle + half * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    _add_flat(plotter, corners, [[0, 1, 2, 3]], palette.PAPER, 0.78, 1.0)
    actor.GetTextProperty().SetJustificationToCentered()
    actor.SetPosition(*middle)
    plotter.renderer.AddViewProp(actor)


def _add_flat(
    plotter: pyvista.Plotter,
    points_px: FloatArray,
    cells: list[list[int]],
    colour: str,
    opacity: float,
    width: float,
) -> None:
    """Draw a line (cells of two points) or a surface in pixels of the panel, over the 3-D view."""
    import pyvista
    from vtkmodules.vtkRenderingCore import vtkActor2D, vtkPolyDataMapper2D

    points = np.concatenate([points_px, np.zeros((len(points_px), 1))], axis=1)
    packed = packed_cells(np.array(cells, dtype=np.intp))
    data = (
        pyvista.PolyData(points, lines=packed)
        if len(cells[0]) == 2
        else pyvista.PolyData(points, faces=packed)
    )
    mapper = vtkPolyDataMapper2D()
    mapper.SetInputData(data)
    actor = vtkActor2D()
    actor.SetMapper(mapper)
    actor.GetProperty().SetColor(*palette.rgb(colour))
    actor.GetProperty().SetOpacity(opacity)
    actor.GetProperty().SetLineWidth(width)
    plotter.renderer.AddViewProp(actor)


def add_title(plotter: pyvista.Plotter, scene: Scene, height_px: float) -> None:
    """Write title, note and proportions into a panel of a height [px]."""
    stretched = scene.vertical_exaggeration != 1
    proportions = f"heights × {scene.vertical_exaggeration:g}" if stretched else "true proportions"
    title = _text(scene.title, OVERSAMPLE * palette.TITLE_PX, palette.INK, bold=True)
    note = _text(
        " · ".join(filter(None, [scene.note, proportions])), OVERSAMPLE * palette.NOTE_PX, palette.INK_SOFT
    )
    title.SetPosition(OVERSAMPLE * 18.0, 0.63 * height_px)
    note.SetPosition(OVERSAMPLE * 18.0, 0.22 * height_px)
    plotter.renderer.AddViewProp(title)
    plotter.renderer.AddViewProp(note)


def add_legend(plotter: pyvista.Plotter, scene: Scene, height_px: float) -> None:
    """List the layers with their colours in a panel of a height [px]; what a sign means is said once."""
    entries = [layer for layer in scene.layers if layer.in_legend]
    line = OVERSAMPLE * min(38.0, (height_px / OVERSAMPLE - 16.0) / max(len(entries), 1))
    explained: set[str] = set()
    for index, layer in enumerate(entries):
        middle = height_px - OVERSAMPLE * 12.0 - (index + 0.5) * line
        half = OVERSAMPLE * np.array([11.0, 8.0])
        centre = np.array([OVERSAMPLE * 30.0, middle])
        corners = centre + half * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
        _add_flat(plotter, corners, [[0, 1, 2, 3]], layer.colour, max(layer.opacity, 0.35), 1.0)
        text = _text(layer.name, min(OVERSAMPLE * palette.LEGEND_PX, 0.5 * line), palette.INK)
        text.SetPosition(
            OVERSAMPLE * 54.0, middle + (0.2 * line if layer.about and layer.about not in explained else 0.0)
        )
        plotter.renderer.AddViewProp(text)
        if layer.about and layer.about not in explained:
            explained.add(layer.about)
            about = _text(layer.about, min(OVERSAMPLE * palette.NOTE_PX, 0.4 * line), palette.INK_SOFT)
            about.SetPosition(OVERSAMPLE * 54.0, middle - 0.25 * line)
            plotter.renderer.AddViewProp(about)
