"""Test of this machine's ability to draw. A missing GL library does not raise: it ends the process."""

from __future__ import annotations

import ctypes
import subprocess
import sys
from functools import cache
from importlib.util import find_spec

#: remedy where the libraries that draw exist, but cannot draw
REMEDY = "pictures with pyvista need GL libraries: apt-get install libgl1 libegl1 (or libosmesa6)"
#: remedy where these libraries are missing
EXTRA = "pictures and films need further libraries: pip install 'flexclear[render]'"
#: libraries that draw, and that make films
LIBRARIES = ("pyvista", "imageio")

#: draws a sphere as pyvista does, whose import would take longer than the rest
_PROBE = """
import vtkmodules.vtkRenderingOpenGL2
from vtkmodules.vtkFiltersSources import vtkSphereSource
from vtkmodules.vtkRenderingCore import vtkActor, vtkPolyDataMapper, vtkRenderer, vtkRenderWindow
sphere, mapper, actor = vtkSphereSource(), vtkPolyDataMapper(), vtkActor()
renderer, window = vtkRenderer(), vtkRenderWindow()
mapper.SetInputConnection(sphere.GetOutputPort())
actor.SetMapper(mapper)
renderer.AddActor(actor)
window.SetOffScreenRendering(1)
window.AddRenderer(renderer)
window.Render()
"""


def library_state() -> str:
    """Name the GL libraries of this machine; quick, fit for a cache key; a final none: nothing can be drawn."""
    if missing_libraries():
        return f"without {' and '.join(missing_libraries())}: none"
    if not sys.platform.startswith("linux"):
        return f"GL of {sys.platform}"
    libraries = [name for name in ("libGL.so.1", "libEGL.so.1", "libOSMesa.so.8") if _is_loadable(name)]
    return "GL: " + (", ".join(libraries) or "none")


def missing_libraries() -> list[str]:
    """Return the missing ones of the libraries that draw."""
    return [name for name in LIBRARIES if find_spec(name) is None]


def remedy() -> str:
    """Return the remedy where nothing can be drawn."""
    return EXTRA if missing_libraries() else REMEDY


@cache
def can_draw() -> bool:
    """True when a child process could draw off-screen; takes some seconds the first time."""
    if missing_libraries():
        return False
    try:
        done = subprocess.run([sys.executable, "-c", _PROBE], capture_output=True, timeout=120, check=False)
    except (OSError, subprocess.TimeoutExpired):
        return False
    return done.returncode == 0


def _is_loadable(name: str) -> bool:
    try:
        ctypes.CDLL(name)
    except OSError:
        return False
    return True
