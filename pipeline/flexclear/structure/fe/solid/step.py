"""Solids from STEP files, by Gmsh's geometry kernel OpenCASCADE: their meshes, and what is round in them.

Every number is in SI: Gmsh converts the file's own unit. One thread makes every mesh, so that equal files give equal
bytes. Gmsh runs in a process of its own: a damaged file may end it.
"""

from __future__ import annotations

import json
import os
import pickle
import re
import subprocess
import sys
import tempfile
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from flexclear.structure.fe.solid.geometry import Geometry
from flexclear.structure.fe.solid.recipe import StepFile
from flexclear.system import machine
from flexclear.system.errors import FlexclearError, InputError
from flexclear.system.external_files import convert_reader_errors, require_file

#: Gmsh's number of each element, and its nodes in the order of VTK
ELEMENTS = {"tet4": (4, (0, 1, 2, 3)), "tet10": (11, (0, 1, 2, 3, 4, 5, 6, 7, 9, 8))}
#: memory that Gmsh needs per tetrahedron [bytes], and tetrahedra per cube of the wanted size
PER_CELL, PER_CUBE = 2000.0, 8.5
#: elements around a full circle
AROUND = 12.0
#: two cylinders have one axis when these differ by less, as a fraction of the radius; least fraction of a full turn
ALIKE, TURN = 1e-4, 0.75
#: what is no number, or none of a part, but stands where one does, outside of texts; Gmsh 4.15 may ask it for ever
NO_NUMBER = re.compile(rb"'[^']*'|[(,]\s*([+-]?(?:nan|inf|[\d.]+e\+?\d{3})\w*)\s*(?=[,)])", re.IGNORECASE)
#: longest time to read a file [s]
LONGEST = 600.0
#: what the other process runs
COMMAND = """import json, sys
sys.path[:] = json.loads(sys.argv[1])
from flexclear.structure.fe.solid.step import answer
answer(sys.argv[2])
"""


@dataclass(frozen=True)
class Round:
    """A cylindrical surface. hole: False for a shaft.  centre, axis: of its middle, and its direction; (3,).

    radius, length: along the axis, gaps between coaxial faces included [m].
    """

    hole: bool
    centre: np.ndarray
    axis: np.ndarray
    radius: float
    length: float

    def along(self, other: Round, gap: float = 0.0) -> bool:
        """Return True when two cylinders have one axis and overlap along it, or almost, by a gap [m]."""
        offset, near = other.centre - self.centre, ALIKE * max(self.radius, other.radius)
        place = float(offset @ self.axis)
        across = float(np.linalg.norm(offset - place * self.axis))
        parallel = float(np.linalg.norm(np.cross(self.axis, other.axis))) < ALIKE
        return parallel and across < near and abs(place) < 0.5 * (self.length + other.length) + gap - near


@dataclass(frozen=True)
class Solid:
    """A solid of a file: its name there, volume [m^3], centre [m], inertia about it per density [m^5], cylinders."""

    name: str
    volume: float
    centre: np.ndarray
    inertia: np.ndarray
    rounds: tuple[Round, ...]


def _apart(longest: float | None, path: Path, where: str, call: Callable[..., Any], *arguments: Any) -> Any:
    """Return what a function of this module returns in a process of its own; raise InputError where that ends.

    longest: time to wait [s].
    """
    require_file(path, where)
    machine.require_memory(20.0 * path.stat().st_size, f"{where}: '{path.name}'", "export fewer parts")
    if find_spec("gmsh") is None:
        raise InputError(where, "STEP files need Gmsh", "pip install 'flexclear[cad]'")
    text = path.read_bytes()
    if not text[:200].lstrip().startswith(b"ISO-10303-21"):
        raise InputError(where, f"'{path.name}' does not begin as a STEP file does", "export it as STEP AP214 or AP242")
    if wrong := next((found for found in NO_NUMBER.finditer(text) if found[1]), None):
        line = text.count(b"\n", 0, wrong.start(1)) + 1
        raise InputError(
            where, f"line {line} of '{path.name}': {wrong[1].decode()} is no number of a part", "export it again"
        )
    with tempfile.TemporaryDirectory() as folder:
        letter = Path(folder) / "call"
        letter.write_bytes(pickle.dumps((call, arguments)))
        command = [sys.executable, "-c", COMMAND, json.dumps([str(folder) for folder in sys.path]), str(letter)]
        with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL) as process:
            try:
                ended = f"ended with {failed}" if (failed := process.wait(longest)) else ""
            except subprocess.TimeoutExpired:
                process.kill()
                ended = f"is not ready after {longest:g} s"
        if ended:
            raise InputError(where, f"Gmsh fails at '{path.name}': it {ended}", "export it as STEP AP214 or AP242")
        result = pickle.loads(letter.read_bytes())
    if isinstance(result, FlexclearError):
        raise result
    return result


def answer(letter: str) -> None:
    """Call the function that a file names, with its arguments, and write what it returns or refuses to the file."""
    threading.Thread(target=_follow_parent, daemon=True).start()
    call, arguments = pickle.loads(Path(letter).read_bytes())
    try:
        result = call(*arguments)
    except FlexclearError as error:
        result = error
    Path(letter).write_bytes(pickle.dumps(result))


def _follow_parent() -> None:
    os.read(0, 1)
    os._exit(1)


@contextmanager
def open_step(path: Path, where: str) -> Iterator[Any]:
    """Yield Gmsh with the solids of a STEP file; raise InputError, in words, without Gmsh or without any solid."""
    try:
        gmsh = import_module("gmsh")  # its version is in the keys of these meshes only
    except (ImportError, OSError) as error:
        raise InputError(where, f"STEP files need Gmsh ({error})", "pip install 'flexclear[cad]'") from None
    gmsh.initialize([], readConfigFiles=False, run=False, interruptible=False)
    try:
        for option, value in (("General.Terminal", 0), ("General.NumThreads", 1), ("General.AbortOnError", 2)):
            gmsh.option.setNumber(option, value)
        gmsh.option.setString("Geometry.OCCTargetUnit", "M")
        with convert_reader_errors(path, where, f"Gmsh cannot read '{path.name}'", "export it as STEP AP214 or AP242"):
            gmsh.model.occ.importShapes(str(path), format="step")
            gmsh.model.occ.synchronize()
        if not gmsh.model.getEntities(3):
            raise InputError(where, f"'{path.name}' has no solid", "export solids, not surfaces or wires")
        yield gmsh
    finally:
        gmsh.finalize()


def mesh_step_file(shape: StepFile, folder: Path, where: str) -> Geometry:
    """Mesh a solid of a STEP file; raise InputError for a file without it, ResourceError for too fine a mesh."""
    found: Geometry = _apart(None, folder / shape.file, where, _mesh, shape, folder / shape.file, where)
    return found


def _mesh(shape: StepFile, path: Path, where: str) -> Geometry:
    """Mesh a solid of a STEP file in this process."""
    with open_step(path, where) as gmsh:
        tags = [tag for _, tag in gmsh.model.getEntities(3)]
        if not 1 <= shape.solid <= len(tags):
            raise InputError(where, f"'{path.name}' has {len(tags)} solids, no solid {shape.solid}", "count from 1")
        mine = tags[shape.solid - 1]
        cells = PER_CUBE * float(gmsh.model.occ.getMass(3, mine)) / shape.size**3
        machine.require_memory(PER_CELL * cells, f"{where}: a mesh of {cells:.3g} cells", "a larger size")
        gmsh.model.removeEntities([(3, tag) for tag in tags if tag != mine], recursive=True)
        order = 2 if shape.element == "tet10" else 1
        options = {"MeshSizeMax": shape.size, "MeshSizeFromCurvature": AROUND, "ElementOrder": order}
        for option, value in {**options, "HighOrderOptimize": order - 1, "RandomSeed": 1}.items():
            gmsh.option.setNumber(f"Mesh.{option}", value)
        with convert_reader_errors(
            path, where, f"Gmsh cannot mesh '{path.name}'", "a smaller size, or repair the solid"
        ):
            gmsh.model.mesh.generate(3)
        number, vtk = ELEMENTS[shape.element]
        _, nodes = gmsh.model.mesh.getElementsByType(number, mine)
        labels, points, _ = gmsh.model.mesh.getNodes()
    place = np.argsort(labels)
    corners = np.searchsorted(labels[place], nodes).reshape(-1, len(vtk))[:, vtk]
    used, inverse = np.unique(place[corners], return_inverse=True)
    cell = inverse.reshape(corners.shape)
    return Geometry(shape.element, points.reshape(-1, 3)[used], cell, {}, {"body": np.arange(len(cell))})


def solids(path: Path, where: str) -> list[Solid]:
    """Return the solids of a STEP file in its order; raise InputError for a file without any."""
    found: list[Solid] = _apart(LONGEST, path, where, _solids, path, where)
    return found


def _solids(path: Path, where: str) -> list[Solid]:
    """Return the solids of a STEP file in its order, as `open_step` reads them in this process."""
    with open_step(path, where) as gmsh:
        found = []
        for dim, tag in gmsh.model.getEntities(3):
            faces = [f for _, f in gmsh.model.getBoundary([(dim, tag)], oriented=False)]
            pieces = [_piece(gmsh, tag, f) for f in faces if gmsh.model.getType(2, f) == "Cylinder"]
            found.append(
                Solid(
                    str(gmsh.model.getEntityName(dim, tag)),
                    float(gmsh.model.occ.getMass(dim, tag)),
                    np.array(gmsh.model.occ.getCenterOfMass(dim, tag)),
                    np.array(gmsh.model.occ.getMatrixOfInertia(dim, tag)).reshape(3, 3),
                    tuple(_merge_cylinders(pieces)),
                )
            )
    return found


def _piece(gmsh: Any, solid: int, face: int) -> tuple[Round, float]:
    """Return the cylinder of a face, and the face's area."""
    low, high = gmsh.model.getParametrizationBounds(2, face)

    def at(u: float, v: float) -> np.ndarray:
        return np.array(gmsh.model.getValue(2, face, [u, v]))

    # half a turn further, whatever part of it the face has: the surface goes on beyond its edges
    first, half = at(low[0], low[1]), at(low[0] + np.pi, low[1])
    middle, end = 0.5 * (first + half), at(low[0], high[1])
    length, radius = float(np.linalg.norm(end - first)), float(np.linalg.norm(first - middle))
    axis = (end - first) / length
    inner, inside = middle + 0.5 * (end - first), 0
    for k in range(
        8
    ):  # outside of a shaft is material where something is attached, none of a hole where another crosses
        u = low[0] + (k + 0.5) / 8.0 * (high[0] - low[0])
        surface = at(u, 0.5 * (low[1] + high[1]))
        for side in (1.0, -1.0):
            inside += int(side) * gmsh.model.isInside(3, solid, (surface + side * 1e-3 * (surface - inner)).tolist())
    axis = axis * np.sign(axis[np.argmax(np.abs(axis))])
    return Round(inside > 0, inner, axis, radius, length), float(gmsh.model.occ.getMass(2, face))


def _merge_cylinders(pieces: list[tuple[Round, float]]) -> Iterator[Round]:
    """Yield each cylinder once, with the coaxial faces of its radius; those of less than `TURN` are left out."""
    rest = list(pieces)
    while rest:
        first = rest[0][0]
        mine = [one for one in rest if _is_same_cylinder(first, one[0])]
        rest = [one for one in rest if not _is_same_cylinder(first, one[0])]
        ends = np.array(
            [float((r.centre - first.centre) @ first.axis) + h * r.length for r, _ in mine for h in (-0.5, 0.5)]
        )
        faces = {tuple(np.round([(r.centre - first.centre) @ first.axis, r.length], 12)) for r, _ in mine}
        whole = 2.0 * np.pi * first.radius * sum(length for _, length in faces)
        if sum(area for _, area in mine) >= TURN * whole:
            middle = first.centre + 0.5 * (ends.min() + ends.max()) * first.axis
            yield Round(first.hole, middle, first.axis, first.radius, float(np.ptp(ends)))


def _is_same_cylinder(a: Round, b: Round) -> bool:
    offset = b.centre - a.centre
    across = np.linalg.norm(offset - (offset @ a.axis) * a.axis)
    near = ALIKE * a.radius
    alike = a.hole == b.hole and abs(a.radius - b.radius) < near and across < near
    return bool(alike and np.linalg.norm(np.cross(a.axis, b.axis)) < ALIKE)
