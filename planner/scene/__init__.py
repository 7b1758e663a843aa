"""The 3-D scene of a campaign: a neutral model in local metres, and adapters that draw it.

`layers` and `beam_layers` make named layers out of arrays, `views` the cameras, `model.Scene` holds them. `pyvista_adapter`
draws a PNG or a window (needs OpenGL: `opengl` asks first), `plotly_adapter` writes a self-contained page
(needs none), `gltf_adapter` a 3-D file. Axes are east, north, up; true proportions unless the scene was
exaggerated. Nothing heavy is imported here.
"""

from planner.scene.model import Label, Layer, Lines, Mesh, Points, Scene, View

__all__ = ["Label", "Layer", "Lines", "Mesh", "Points", "Scene", "View"]
