"""A scene as a file: page, picture or model."""

from pathlib import Path

from geometry.errors import InputError, UnavailableError
from planner.scene.model import Scene


def write(scene: Scene, folder: Path, kind: str) -> Path:
    """Write a scene as `scene.html`, `scene.png` or `scene.glb` into a folder.

    Raises
    ------
    UnavailableError
        If the machine cannot draw (png) or an extra is missing (glb).
    InputError
        If the kind is none of the three.
    """
    path = folder / f"scene.{kind}"
    if kind == "html":
        from planner.scene.plotly_adapter import write_html

        write_html(scene, path)
    elif kind == "png":
        from planner.scene.pyvista_adapter import write_png

        write_png(scene, path)
    elif kind == "glb":
        from planner.scene.gltf_adapter import write_glb

        write_glb(scene, path)
    else:
        raise InputError(f"a scene as {kind} was asked for; allowed: html, png, glb")
    return path


def left_out_png() -> str | None:
    """Why this machine can draw no picture; None where it can."""
    from planner.scene.opengl import require_off_screen

    try:
        require_off_screen()
    except UnavailableError as error:
        return str(error)
    return None
