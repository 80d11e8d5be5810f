"""Whether this machine can draw. A missing GL library does not raise: it ends the process."""

from __future__ import annotations

import ctypes
import subprocess
import sys
from functools import cache
from importlib.util import find_spec

#: what to install where the libraries that draw are there, but cannot
REMEDY = "pictures with pyvista need GL libraries: apt-get install libgl1 libegl1 (or libosmesa6)"
#: the same where these libraries are not there
EXTRA = "pictures and films need further libraries: pip install 'flexclear[render]'"
#: what draws, and what makes films of it
LIBRARIES = ("pyvista", "imageio")

_PROBE = (
    "import pyvista; p = pyvista.Plotter(off_screen=True, window_size=(32, 32)); "
    "p.add_mesh(pyvista.Sphere()); p.screenshot(return_img=True)"
)


def state() -> str:
    """Which GL libraries are there, in a few words; quick, fit for a cache key; with none at its end, nothing draws."""
    if missing():
        return f"without {' and '.join(missing())}: none"
    if not sys.platform.startswith("linux"):
        return f"GL of {sys.platform}"
    libraries = [name for name in ("libGL.so.1", "libEGL.so.1", "libOSMesa.so.8") if _loads(name)]
    return "GL: " + (", ".join(libraries) or "none")


def missing() -> list[str]:
    """Which of the libraries that draw are not installed."""
    return [name for name in LIBRARIES if find_spec(name) is None]


def remedy() -> str:
    """What to install where nothing can be drawn."""
    return EXTRA if missing() else REMEDY


@cache
def works() -> bool:
    """True when a child process could draw off-screen; takes some seconds the first time."""
    if missing():
        return False
    try:
        done = subprocess.run([sys.executable, "-c", _PROBE], capture_output=True, timeout=120, check=False)
    except (OSError, subprocess.TimeoutExpired):
        return False
    return done.returncode == 0


def _loads(name: str) -> bool:
    try:
        ctypes.CDLL(name)
    except OSError:
        return False
    return True
