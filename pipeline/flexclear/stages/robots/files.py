"""Robots' files as compiled models: checks before MuJoCo reads a file, and errors in words where it refuses one.

Nothing in a file is executed: no plugin is loaded, entities are refused, and sizes that a file only announces are
limited before memory is taken for them.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from flexclear.system.errors import InputError
from flexclear.system.external_files import require_file

#: largest size of a file without its meshes [bytes], and largest number of files that it includes
LARGEST_FILE, MOST_FILES = 32 << 20, 200
#: elements of which a file announces copies, those of which it announces entries, with the attributes, and the largest
#: products that are read
COPIED, SIZED = ("replicate", "composite", "flexcomp"), {"hfield": ("nrow", "ncol"), "texture": ("width", "height")}
MOST_COPIES, MOST_ENTRIES = 2000, 20_000_000
#: numbers of values of one user's object, or of keyframes
MOST_VALUES = 10_000
#: endings of surfaces that MuJoCo reads
SURFACES = (".stl", ".obj", ".msh")
#: attributes that are text even where they look like a number
TEXT = {"name", "class", "childclass", "file", "filename", "content", "data"}
#: attributes that may be infinite, besides those whose names end with "range"
BOUNDS = {"lower", "upper", "effort", "velocity"}
#: elements of URDF that MuJoCo does not read, with what they mean
UNREAD = {
    "transmission": "transmissions of actuators",
    "gazebo": "extensions for Gazebo",
    "safety_controller": "safety controllers",
    "calibration": "calibrations",
    "sensor": "sensors",
}


@dataclass
class Robot:
    """A compiled model. kind: URDF or MJCF.  lost: what was left out before it was compiled, a sentence each."""

    model: Any
    kind: str
    version: str
    lost: list[str] = field(default_factory=list)


def read(path: Path) -> Robot:
    """Return the compiled model of a URDF or MJCF file; raise InputError with the file, the record and a remedy."""
    try:
        import mujoco
    except ImportError:
        raise InputError(
            str(path), "robots' files are read by MuJoCo, which is not installed", "pip install 'flexclear[robots]'"
        ) from None
    read_files: dict[Path, ElementTree.Element] = {}
    root = _checked_root(path, path.parent, read_files)
    _require_ordinary(path, read_files.values())
    if root.tag not in ("mujoco", "robot"):
        problem = f"is neither a URDF nor an MJCF: its outermost element is <{root.tag}>, not <robot> or <mujoco>"
        raise InputError(str(path), problem, "name the robot's own file")
    robot = Robot(None, "MJCF" if root.tag == "mujoco" else "URDF", mujoco.__version__)
    before = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(robot.lost.append)
    try:
        if robot.kind == "URDF":
            robot.lost += _prepare(root, path)
            spec = mujoco.MjSpec.from_string(ElementTree.tostring(root, encoding="unicode"))
        else:
            spec = mujoco.MjSpec.from_file(str(path))
            spec.memory, spec.nuserdata, spec.njmax, spec.nconmax = -1, 0, -1, -1  # for simulations by MuJoCo
            spec.compiler.LRopt.mode = mujoco.mjtLRMode.mjLRMODE_NONE  # lengths of muscles, which it would simulate
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of attributes that later releases of MuJoCo will not have
            robot.model = spec.compile()
    except (ValueError, TypeError, RuntimeError, MemoryError, mujoco.FatalError) as error:
        reason = " ".join(str(error).split()) or type(error).__name__
        problem = f"MuJoCo does not compile it: {reason}"
        raise InputError(str(path), problem, "correct the file, or export it again") from None
    finally:
        mujoco.set_mju_user_warning(before)
    return robot


def _checked_root(path: Path, folder: Path, seen: dict[Path, ElementTree.Element]) -> ElementTree.Element:
    """Return the root of a file after checks of it and of all that it includes; folder: of the outermost file."""
    require_file(path, str(path))
    if path.stat().st_size > LARGEST_FILE or len(seen) > MOST_FILES:
        raise InputError(str(path), f"is larger than {LARGEST_FILE >> 20} MB or includes more than {MOST_FILES} files")
    text = path.read_bytes()
    if b"<!ENTITY" in text or b"<!DOCTYPE" in text or b"\0" in text:
        raise InputError(str(path), "declares entities or is not text in UTF-8", "write it without <!DOCTYPE ...>")
    try:
        root = ElementTree.fromstring(text)
        if root.tag != "robot":  # MuJoCo takes the bytes of names as they are
            text.decode()
    except (ElementTree.ParseError, ValueError) as error:
        raise InputError(str(path), f"is not complete XML: {error}", "export or copy it again") from None
    seen[path.resolve()] = root
    for element, copies in _elements_with_copies(root):
        _check(path, element, copies)
        if element.tag in ("include", "model") and (name := element.get("file")) is not None:
            inner = next((f for f in (folder / name, path.parent / name) if f.is_file()), None)
            if inner is None:
                raise InputError(str(path), f'<{element.tag} file="{name}">: there is no such file', "put it there")
            if inner.resolve() not in seen:
                _checked_root(inner, folder, seen)
    return root


def _require_ordinary(path: Path, roots: Iterable[ElementTree.Element]) -> None:
    """Raise InputError for a device or pipe among the files that the elements name: reading it may never end."""
    elements = [element for root in roots for element in root.iter()]
    folders = {e.get(key, "") for e in elements for key in ("meshdir", "texturedir", "assetdir")}
    for name in {e.get(key, "") for e in elements for key in ("file", "filename")} - {""}:
        for place in (path.parent / folder / name for folder in folders):
            if place.exists() and not place.is_file():
                raise InputError(str(path), f"names {place}, which is not an ordinary file", "name a file")


def _elements_with_copies(root: ElementTree.Element) -> Iterator[tuple[ElementTree.Element, float]]:
    """Yield all elements, each with the number of copies that the elements around it and itself ask for."""
    waiting = [(root, 1.0)]
    while waiting:
        element, copies = waiting.pop()
        if element.tag in COPIED:
            copies *= math.prod(_numbers(element.get("count")) or [1.0])
        yield element, copies
        waiting += [(inner, copies) for inner in element]


def _check(path: Path, element: ElementTree.Element, copies: float) -> None:
    """Raise InputError for numbers that are not finite, and for numbers of copies or entries that are too large."""
    for key, text in element.items():
        without = math.isnan if key in BOUNDS or key.endswith("range") else lambda number: not math.isfinite(number)
        if key not in TEXT and any(without(number) for number in _numbers(text)):
            where = f'<{element.tag} name="{element.get("name", "")}"> {key}="{text}"'
            raise InputError(str(path), f"{where} is not a finite number", "write a number there")
    values = max([0.0, *(n for k, text in element.items() for n in _numbers(text) if k.startswith(("nuser_", "nkey")))])
    entries = math.prod(n for key in SIZED.get(element.tag, ()) for n in _numbers(element.get(key)) or [1.0])
    for count, most in ((copies, MOST_COPIES), (entries, MOST_ENTRIES), (values, MOST_VALUES)):
        if count > most:
            raise InputError(str(path), f"<{element.tag}> asks for {count:.3g} entries, more than {most}", "use fewer")


def _numbers(text: str | None) -> list[float]:
    """Return the numbers of an attribute, none where it is text."""
    try:
        return [float(word) for word in (text or "").split()]
    except ValueError:
        return []


def _prepare(root: ElementTree.Element, path: Path) -> list[str]:
    """Let MuJoCo keep fixed links and what pictures show; name meshes by full paths. Return what is left out."""
    options = root.find("mujoco")
    options = ElementTree.SubElement(root, "mujoco") if options is None else options
    compiler = options.find("compiler")
    compiler = ElementTree.SubElement(options, "compiler") if compiler is None else compiler
    meshdir = path.parent / compiler.attrib.pop("meshdir", ".")
    compiler.attrib |= {"fusestatic": "false", "discardvisual": "false", "strippath": "false"}
    lost = [f"{text}: {n}" for tag, text in UNREAD.items() if (n := len(list(root.iter(tag))))]
    if any(float(limit.get("velocity") or 0.0) > 0.0 for limit in root.iter("limit")):
        lost.append("limits of the joints' speeds")
    unread: dict[str, list[str]] = {}
    for link in root.iter("link"):
        for shape in [*link.findall("visual"), *link.findall("collision")]:
            mesh = shape.find("geometry/mesh")
            if mesh is None:
                continue
            name = mesh.get("filename", "")
            file = _find(name, meshdir)
            if file is not None and file.suffix.lower() in SURFACES:
                mesh.set("filename", str(file))
                continue
            if link.find("inertial") is None and shape.tag == "collision":
                problem = f'the mass of <link name="{link.get("name")}"> follows from "{name}", which cannot be read'
                raise InputError(str(path), problem, "put the mesh there, or give the link an <inertial>")
            why = "there is no such file" if file is None else f"only {', '.join(SURFACES)} are read"
            unread.setdefault(f"{shape.tag} surfaces ({why})", []).append(f"{link.get('name')}: {name}")
            link.remove(shape)
    return [*lost, *(f"{what} of {', '.join(names)}" for what, names in unread.items())]


def _find(name: str, folder: Path) -> Path | None:
    """Return the file of a mesh, of a package's in any folder above that holds it; None where there is none."""
    scheme, _, rest = name.rpartition("://")
    places = [folder / rest, *(above / rest for above in folder.resolve().parents)]
    if scheme == "package":  # the package's own folder may have another name
        places += [above / rest.partition("/")[2] for above in (folder.resolve(), *folder.resolve().parents)]
    try:
        return next((place.resolve() for place in places[: None if scheme else 1] if place.is_file()), None)
    except (OSError, ValueError):
        return None
