"""Whether this machine can draw: asked of a child process, as VTK kills the process without OpenGL.

The child draws a tiny red picture off screen and reads it back, with VTK's default window, then EGL, then
OSMesa. The answer is kept for the life of this process.
"""

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from functools import lru_cache

from geometry.errors import UnavailableError

WINDOW_VARIABLE = "VTK_DEFAULT_OPENGL_WINDOW"  # read by VTK's object factory, since VTK 9.4
CANDIDATES = ("", "vtkEGLRenderWindow", "vtkOSOpenGLRenderWindow")  # "" is VTK's own choice
TIMEOUT_S = 60.0  # a cold disk needs some seconds to load VTK; a working probe takes about .7 s warm

PROBE = """
import vtkmodules.vtkRenderingOpenGL2
from vtkmodules.vtkCommonCore import vtkUnsignedCharArray
from vtkmodules.vtkRenderingCore import vtkRenderer, vtkRenderWindow
window, renderer, pixels = vtkRenderWindow(), vtkRenderer(), vtkUnsignedCharArray()
window.SetOffScreenRendering(1)
window.SetSize(8, 8)
renderer.SetBackground(1.0, 0.0, 0.0)
window.AddRenderer(renderer)
window.Render()
window.GetPixelData(0, 0, 7, 7, 0, pixels, 0)
red = pixels.GetNumberOfTuples() == 64 and pixels.GetTuple3(27) == (255.0, 0.0, 0.0)
print("drew", window.GetClassName() if red else "nothing", flush=True)
"""


@lru_cache(maxsize=1)
def off_screen_window() -> str | None:
    """Give the class of the VTK window that draws off screen here, or None where none does.

    Each kind is tried in its own child process, started with this interpreter; what the child says on its
    error stream is dropped, a crash or silence counts as no.
    """
    kinds = (
        ("",) if os.environ.get(WINDOW_VARIABLE) else CANDIDATES
    )  # the user's choice is the only one tried
    for kind in kinds:
        drawn = _try(kind)
        if drawn:
            return drawn
    return None


def _try(kind: str) -> str | None:
    environment = {**os.environ, WINDOW_VARIABLE: kind} if kind else dict(os.environ)
    try:
        done = subprocess.run(
            [sys.executable, "-P", "-c", PROBE],
            env=environment,
            capture_output=True,
            timeout=TIMEOUT_S,
            check=False,
            text=True,
        )
    except subprocess.TimeoutExpired:
        return None
    words = done.stdout.split()
    drew = done.returncode == 0 and words[-2:-1] == ["drew"] and words[-1] != "nothing"
    return words[-1] if drew else None


def require_off_screen() -> str:
    """Give the class of the VTK window that draws here.

    Raises
    ------
    UnavailableError
        If none does: the text names the Debian packages and the page that needs no OpenGL.
    """
    window = off_screen_window()
    if window is None:
        raise UnavailableError(
            "no picture: this machine has no OpenGL that VTK can draw with (tried the default window, EGL, "
            "OSMesa). On Debian or Ubuntu install the packages libgl1 and libegl1, or ask for the HTML page, "
            "which is drawn by the browser and needs no OpenGL here"
        )
    return window


@contextmanager
def drawing_off_screen() -> Iterator[None]:
    """Let VTK make the window that the probe found, and nothing else, while inside.

    Raises
    ------
    UnavailableError
        Where no window draws.
    """
    before = os.environ.get(WINDOW_VARIABLE)
    os.environ[WINDOW_VARIABLE] = require_off_screen()
    try:
        yield
    finally:
        if before is None:
            del os.environ[WINDOW_VARIABLE]
        else:
            os.environ[WINDOW_VARIABLE] = before
