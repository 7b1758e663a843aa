"""A scene as glTF (`.glb`), for viewers, slides and other 3-D programs, through trimesh (extra `gltf`).

glTF has its own axes: x east, y up, z south; metres stay metres. It knows no text: the names of layers become
the names of nodes, and labels are left out.
"""

import importlib
import importlib.util
from pathlib import Path
from typing import Any

import numpy as np

from geometry.arrays import FloatArray
from geometry.errors import UnavailableError
from planner import palette
from planner.scene.model import Item, Label, Layer, Mesh, Points, Scene


def to_glb(scene: Scene) -> bytes:
    """Give a scene as the bytes of a binary glTF file.

    Raises
    ------
    UnavailableError
        If trimesh is not installed.
    """
    trimesh = _trimesh()
    world = trimesh.Scene()
    for layer in scene.layers:
        for index, item in enumerate(item for item in layer.items if not isinstance(item, Label)):
            name = f"{layer.name}/{index}"
            world.add_geometry(_geometry(layer, item), geom_name=name, node_name=name)
    return bytes(world.export(file_type="glb"))


def write_glb(scene: Scene, path: Path) -> None:
    """Write a scene as a binary glTF file; the errors are those of `to_glb`."""
    path.write_bytes(to_glb(scene))


def gltf_axes_m(points_m: FloatArray) -> FloatArray:
    """Turn east, north, up (n, 3) into glTF's axes: x east, y up, z south [m].

    Examples
    --------
    >>> gltf_axes_m(np.array([[1.0, 2.0, 3.0]]))
    array([[ 1.,  3., -2.]])
    """
    return np.asarray(points_m[:, [0, 2, 1]] * np.array([1.0, 1.0, -1.0]), dtype=np.float64)


def _geometry(layer: Layer, item: Item) -> Any:
    trimesh = _trimesh()
    opacity = 1.0 if isinstance(item, Label) else layer.opacity * item.opacity
    colour = [round(255 * part) for part in (*palette.rgb(layer.colour), opacity)]
    if isinstance(item, Mesh):
        material = trimesh.visual.material.PBRMaterial(
            baseColorFactor=colour,
            alphaMode="BLEND" if opacity < 1 else "OPAQUE",
            doubleSided=True,
            metallicFactor=0.0,
            roughnessFactor=0.9,
        )
        visual = trimesh.visual.TextureVisuals(material=material)
        return trimesh.Trimesh(gltf_axes_m(item.vertices_m), item.triangles, visual=visual, process=False)
    if isinstance(item, Points):
        return trimesh.PointCloud(gltf_axes_m(item.points_m), colors=colour)
    assert not isinstance(item, Label)
    path = trimesh.load_path(gltf_axes_m(item.points_m)[item.segments])
    path.colors = np.tile(np.array(colour, dtype=np.uint8), (len(path.entities), 1))
    return path


def _trimesh() -> Any:
    if importlib.util.find_spec("trimesh") is None:
        raise UnavailableError(
            "no glTF: the package trimesh is not installed. Install the extra with pip install "
            "'.[gltf]'; the picture and the HTML page need no extra"
        )
    return importlib.import_module("trimesh")
