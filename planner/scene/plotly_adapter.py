"""A scene as a page for the browser: one file, no network, no OpenGL on the machine that writes it.

Each layer is one entry of the legend and switches all its parts, names included. Names in a scene come from a
site file and are untrusted: everything that reaches the page is escaped, and the page's content security
policy forbids loading.
"""

import html
from pathlib import Path
from typing import Any

import numpy as np

from geometry.arrays import FloatArray
from planner import palette
from planner.scene.model import Layer, Lines, Mesh, Points, Scene, View
from planner.scene.placement import place_names
from planner.scene.views import default_view, drawn_px, project_px

HEIGHT_PX = 720
DRAWN_PX = (1180.0, 620.0)  # about what is left for the drawing on a common screen: names are placed for that
MARKER_SHARE = 0.35  # plotly's 3-D markers are larger than their size says
PLOTLY_FIELD_DEG = 45.0  # vertical field of view of plotly's camera
POLICY = (  # nothing may be loaded; plotly's 3-D needs eval
    "default-src 'none'; script-src 'unsafe-inline' 'unsafe-eval'; style-src 'unsafe-inline'; "
    "img-src data: blob:; font-src data:"
)

# names are annotations, which plotly's legend does not switch: follow the traces of their layers
FOLLOW_LEGEND = """
(function () {
  var plot = document.getElementById('{plot_id}');
  plot.on('plotly_restyle', function () {
    var shown = {};
    plot.data.forEach(function (trace) { shown[trace.legendgroup] = trace.visible !== 'legendonly'; });
    var notes = plot.layout.scene.annotations || [];
    var change = {};
    notes.forEach(function (note, i) {
      var on = shown[note.name] !== false;
      if ((note.visible !== false) !== on) { change['scene.annotations[' + i + '].visible'] = on; }
    });
    if (Object.keys(change).length) { Plotly.relayout(plot, change); }
  });
})();
"""


def write_html(scene: Scene, path: Path) -> None:
    """Write a scene as a self-contained page (about 5 MB: it carries the drawing library).

    Parameters
    ----------
    scene
        What to draw. Its first view is where the reader starts.
    path
        File to write.
    """
    path.write_text(page(scene), encoding="utf-8")


def page(scene: Scene) -> str:
    """Give the whole page of `write_html`."""
    title = html.escape(scene.title)
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{title}</title>\n"
        f"<style>body {{ margin: 0; font-family: {palette.FONT_FAMILY}; color: {palette.INK}; }}</style>\n"
        f"</head>\n<body>\n{div(scene, height='100vh')}\n</body>\n</html>\n"
    )


def div(
    scene: Scene, *, with_library: bool = True, name: str = "scene-3d", height: str = f"{HEIGHT_PX}px"
) -> str:
    """Give a scene as a `<div>` with its script, for a page of one's own.

    Parameters
    ----------
    scene
        What to draw.
    with_library
        Include plotly's script (5 MB); False where the page has it already.
    name
        The element's id: one of its own for each scene on a page.
    height
        As a style sheet writes it.

    Returns
    -------
    str
        HTML that loads nothing. The script needs `'unsafe-eval'` in the page's content security policy.
    """
    import plotly.io

    return str(
        plotly.io.to_html(
            figure(scene),
            config={"displaylogo": False, "responsive": True, "scrollZoom": True},
            include_plotlyjs=with_library,
            full_html=False,
            div_id=name,
            default_height=height,
            post_script=FOLLOW_LEGEND,
        )
    )


def figure(scene: Scene) -> dict[str, Any]:
    """Give a scene as plotly's own description: `data` and `layout`, plain values.

    Examples
    --------
    >>> from planner.scene.model import Label
    >>> layer = Layer("a&b", "#000000", (Points([[0, 0, 0], [1, 1, 1]]), Label("<i>", [0, 0, 1])))
    >>> drawn = figure(Scene("<b>", (layer,)))
    >>> drawn["data"][1]["name"], drawn["layout"]["scene"]["annotations"][0]["text"]
    ('a&amp;b', '&lt;i&gt;')
    """
    traces = [trace for layer in scene.layers for trace in _traces(layer)]
    return {"data": [_room(scene), *traces], "layout": _layout(scene)}


def _ranges_m(scene: Scene) -> FloatArray:
    """(3, 2) the axes, with a metre of room: plotly leaves out a name at the very edge."""
    return np.asarray((scene.extent_m + np.array([[-1.0], [1.0]])).T, dtype=np.float64)


def _room(scene: Scene) -> dict[str, Any]:
    """Make an unseen trace as large as the axes: plotly takes its proportions from the data."""
    unseen = {"size": 1, "opacity": 0.0}
    corners = _columns(_ranges_m(scene).T)
    return {
        "type": "scatter3d",
        "mode": "markers",
        **corners,
        "marker": unseen,
        "hoverinfo": "skip",
        "showlegend": False,
    }


def _traces(layer: Layer) -> list[dict[str, Any]]:
    traces = [_mesh(layer, mesh) for mesh in layer.meshes]
    traces += [_lines(layer, lines) for lines in layer.lines]
    traces += [_points(layer, points) for points in layer.points]
    common = {"name": html.escape(layer.name, quote=False), "legendgroup": layer.name, "showlegend": False}
    traces = [{**trace, **common} for trace in traces]
    if layer.in_legend:
        traces.append({**_legend_entry(layer), **common, "showlegend": True})
    return traces


def _legend_entry(layer: Layer) -> dict[str, Any]:
    """Make an empty trace whose square stands in the legend: surfaces have no sign of their own there."""
    marker = {"size": 9, "color": layer.colour, "symbol": "square"}
    return {"type": "scatter3d", "mode": "markers", "x": [None], "y": [None], "z": [None], "marker": marker}


def _columns(points_m: FloatArray) -> dict[str, list[float]]:
    rounded = points_m.round(2)  # centimetres: the page stays small
    return {axis: rounded[:, i].tolist() for i, axis in enumerate("xyz")}


def _hover(text: str) -> dict[str, Any]:
    return (
        {"hoverinfo": "text", "hovertext": html.escape(text, quote=False)} if text else {"hoverinfo": "skip"}
    )


def _mesh(layer: Layer, mesh: Mesh) -> dict[str, Any]:
    opacity = layer.opacity * mesh.opacity
    shaded = mesh.shaded and opacity > 0.9
    corners = {axis: mesh.triangles[:, i].tolist() for i, axis in enumerate("ijk")}
    light = {"ambient": 0.6, "diffuse": 0.6} if shaded else {"ambient": 1.0, "diffuse": 0.0, "specular": 0.0}
    return {
        "type": "mesh3d",
        **_columns(mesh.vertices_m),
        **corners,
        "color": layer.colour,
        "opacity": opacity,
        "flatshading": shaded,
        "lighting": {**light, "fresnel": 0.0},
        **_hover(mesh.hover),
    }


def _lines(layer: Layer, lines: Lines) -> dict[str, Any]:
    gap = np.full((len(lines.segments), 1, 3), np.nan)
    broken = np.concatenate([lines.points_m[lines.segments], gap], axis=1).reshape(-1, 3)
    columns = {axis: [None if v != v else v for v in values] for axis, values in _columns(broken).items()}
    return {
        "type": "scatter3d",
        "mode": "lines",
        **columns,
        "line": {
            "color": palette.mixed(layer.colour, layer.opacity * lines.opacity),
            "width": 1.4 * lines.width_px,
        },
        **_hover(lines.hover),
    }


def _points(layer: Layer, points: Points) -> dict[str, Any]:
    hover: dict[str, Any] = {"hoverinfo": "skip"}
    if points.hover:
        hover = {"hoverinfo": "text", "hovertext": [html.escape(text, quote=False) for text in points.hover]}
    return {
        "type": "scatter3d",
        "mode": "markers",
        **_columns(points.points_m),
        "marker": {
            "color": layer.colour,
            "size": MARKER_SHARE * points.size_px,
            "opacity": layer.opacity * points.opacity,
        },
        **hover,
    }


def _layout(scene: Scene) -> dict[str, Any]:
    ranges = _ranges_m(scene)
    view = scene.views[0] if scene.views else default_view(scene)
    hidden = {"visible": False, "showspikes": False}
    axes = {f"{axis}axis": {**hidden, "range": r} for axis, r in zip("xyz", ranges.tolist(), strict=True)}
    return {
        "title": {"text": _title(scene), "x": 0.01, "xanchor": "left"},
        "font": {"family": palette.FONT_FAMILY, "color": palette.INK, "size": 13},
        "paper_bgcolor": palette.PAPER,
        "margin": {"l": 0, "r": 0, "t": 70, "b": 0},
        "legend": {
            "itemsizing": "constant",
            "groupclick": "togglegroup",
            "x": 1.0,
            "font": {"size": palette.LEGEND_PX},
        },
        "hoverlabel": {"align": "left"},
        "scene": {
            "bgcolor": palette.SKY,
            "aspectmode": "data",  # true proportions, of the heights as they are in the scene
            "dragmode": "turntable",
            "camera": _camera(view, ranges),
            "annotations": _annotations(scene, view),
            **axes,
        },
    }


def _title(scene: Scene) -> str:
    stretched = scene.vertical_exaggeration != 1
    proportions = f"heights × {scene.vertical_exaggeration:g}" if stretched else "true proportions"
    note = " · ".join(filter(None, [scene.note, proportions, "drag to turn, scroll to come nearer"]))
    return f"<b>{html.escape(scene.title, quote=False)}</b><br><sup>{html.escape(note, quote=False)}</sup>"


def _camera(view: View, ranges_m: FloatArray) -> dict[str, Any]:
    """Turn a view into plotly's camera.

    Plotly scales the scene so that the product of its sides is 1, and puts the middle of the ranges at the
    origin. Its field of view is fixed: the camera comes nearer until the focus is as large as in the view.
    """
    sides = ranges_m[:, 1] - ranges_m[:, 0]
    scale = 1 / np.cbrt(np.prod(sides))
    nearer = np.tan(np.radians(view.view_angle_deg / 2)) / np.tan(np.radians(PLOTLY_FIELD_DEG / 2))
    centre = (view.focus_m - ranges_m.mean(axis=1)) * scale
    eye = centre + (view.position_m - view.focus_m) * nearer * scale
    return {
        "center": dict(zip("xyz", centre.round(5).tolist(), strict=True)),
        "eye": dict(zip("xyz", eye.round(5).tolist(), strict=True)),
        "up": {"x": 0, "y": 0, "z": 1},
    }


def _annotations(scene: Scene, view: View) -> list[dict[str, Any]]:
    """Give each name its arrow; where the box goes is chosen for the starting view."""
    named = scene.names
    if not named:
        return []
    seen_px = project_px(view, np.stack([label.at_m for _, label in named]), *DRAWN_PX)[:, :2]
    seen_px = np.where(np.isfinite(seen_px), seen_px, 0.0)
    sizes = np.array(
        [
            [0.62 * _font_px(label.rank) * len(label.text) + 10, 1.5 * _font_px(label.rank)]
            for _, label in named
        ]
    )
    busy_px = drawn_px(scene, view, *DRAWN_PX)
    ranks = [label.rank for _, label in named]
    middles = place_names(seen_px, sizes, (0.0, 0.0, *DRAWN_PX), ranks=ranks, busy_px=busy_px)
    return [
        {
            "name": layer.name,
            "text": html.escape(label.text, quote=False),
            **dict(zip("xyz", label.at_m.round(2).tolist(), strict=True)),
            "ax": float(round(offset[0])),
            "ay": float(-round(offset[1])),
            "font": {
                "size": _font_px(label.rank),
                "color": palette.INK if label.rank < 2 else palette.INK_SOFT,
            },
            "bgcolor": palette.css(palette.PAPER, 0.8),
            "borderpad": 2,
            "arrowwidth": 1.2,
            **_arrow_end(layer, label.at_m),
        }
        for (layer, label), offset in zip(named, middles - seen_px, strict=True)
    ]


def _arrow_end(layer: Layer, at_m: FloatArray) -> dict[str, Any]:
    """End an arrow at a symbol with a disc of its colour: seen even where the ground hides the marker."""
    symbols = [points.points_m for points in layer.points if points.is_symbol]
    if any(np.any(np.all(places == at_m, axis=1)) for places in symbols):
        return {"arrowhead": 6, "arrowsize": 2.5, "arrowcolor": layer.colour}
    return {"arrowhead": 0, "arrowcolor": palette.INK_SOFT}


def _font_px(rank: int) -> int:
    return palette.LEGEND_PX if rank < 2 else palette.NOTE_PX - 1
