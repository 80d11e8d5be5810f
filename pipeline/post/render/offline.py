"""A scene as one HTML file that can be turned in the browser, without a server and without the net.

pyvista's own export starts a local web server, and with it a download where some optional packages
are installed; here the same scene description is written straight into the same viewer page.
"""

from __future__ import annotations

import io
import json
import re
import zipfile
from typing import Any

import pyvista as pv

#: how the description refers to VTK objects: by their addresses, quoted or as ${address}
_ADDRESS = re.compile(r"(?<=[\"{])[0-9a-f]{16}(?=[\"}-])")
_MTIME = re.compile(r'("mtime": )\d+')
_WINDOW = "window"


def page(scene: pv.Plotter) -> bytes:
    """Self-contained page with the plotter's scene; equal scenes give equal bytes."""
    from trame_vtk.tools.vtksz2html import write_html  # type: ignore[import-untyped]

    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        # a fixed date: the archive must not tell when it was written
        entry = zipfile.ZipInfo("index.json", (1980, 1, 1, 0, 0, 0))
        archive.writestr(entry, _plain(json.dumps(_state(scene))), zipfile.ZIP_DEFLATED)
    text = io.StringIO()
    write_html(buffer.getvalue(), text)
    return text.getvalue().encode()


def _state(scene: pv.Plotter) -> dict[str, Any]:
    """The scene's description for vtk.js: instances, and the arrays that they name by hash."""
    from trame_vtk.modules.vtk import serializers  # type: ignore[import-untyped]

    scene.render()
    window = scene.render_window
    serializers.initialize_serializers()
    context = serializers.SynchronizationContext()
    context.set_ignore_last_dependencies(True)
    description = serializers.serialize(None, window, _WINDOW, context, 1)
    camera = window.GetRenderers().GetFirstRenderer().GetActiveCamera()
    description["extra"] = {
        "vtkRefId": _WINDOW,
        "centerOfRotation": camera.GetFocalPoint(),
        "camera": serializers.reference_id(camera),
    }
    arrays = {
        entry["hash"]: {**entry, "content": context.get_cached_data_array(entry["hash"], False)}
        for entry in serializers.extract_array_hash(description)
    }
    return {"hashes": arrays, "scene": description}


def _plain(text: str) -> str:
    """Addresses numbered in their order, and no modification times: both differ from process to process."""
    known: dict[str, str] = {}
    numbered = _ADDRESS.sub(lambda found: known.setdefault(found[0], f"{len(known) + 1:016x}"), text)
    return _MTIME.sub(r"\g<1>1", numbered)
