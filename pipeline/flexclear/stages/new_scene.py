"""New scenes in a folder of the user's: from a template, or from the file of another program."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping
from pathlib import Path

from flexclear.artifacts.paths import PACKAGE
from flexclear.scene.load import scene_of
from flexclear.stages import cad_scene
from flexclear.system.errors import InputError, ResourceError

TEMPLATES = PACKAGE / "stages" / "templates"
#: kinds of mechanisms -> their descriptions
KINDS = {
    "four-bar": "planar linkage of rigid bodies with one loose pin",
    "slider-crank": "flexible connecting rod, clearance at the crank pin",
    "pendulum": "one rigid body on a hinge",
    "leg": "spatial leg with a driven flexible rod and a loose ball joint",
    "empty": "the skeleton of a scene",
}


def write(kind: str, folder: Path) -> list[Path]:
    """Write the files of a new mechanism and return their paths, the scene first; InputError where one exists."""
    sources = sorted(
        (TEMPLATES / kind.replace("-", "_")).glob("*.toml"), key=lambda p: "[body" not in p.read_text(encoding="utf-8")
    )
    return _write({source.name: source.read_bytes() for source in sources}, folder, f"flexclear new {kind} FOLDER")


def _of_robot(source: Path, folder: Path) -> tuple[dict[str, bytes], list[str]]:
    """Return the scene of a URDF or MJCF file with the surfaces that it shows, and what is not taken over."""
    from flexclear.stages.robots.files import read

    robot = read(source)
    from flexclear.stages.robots.scene import scene_of as scene_of_robot  # needs MuJoCo, which `read` asks for

    stem = re.sub(r"[^\w-]+", "_", source.stem).strip("_") or "robot"
    text, surfaces, lost = scene_of_robot(robot, source, stem)
    try:
        scene_of(tomllib.loads(text))
    except InputError as error:
        raise InputError(str(source), f"its scene would be wrong: {error}", "correct the robot's file") from None
    return {f"{stem}.toml": text.encode(), **surfaces}, lost


#: ending of another program's file -> function (file, folder) that returns a scene's files, and what these leave out
SOURCES = {".urdf": _of_robot, ".xml": _of_robot, ".mjcf": _of_robot, ".step": cad_scene.files, ".stp": cad_scene.files}


def write_from(source: Path, folder: Path) -> tuple[list[Path], list[str]]:
    """Write the scene of another program's file, and the files that it needs; return their paths, the scene first.

    Returns also what is not taken over, a sentence each.  InputError where a file exists, or for one of another kind.
    """
    if source.suffix.lower() not in SOURCES:
        raise InputError(f"--from {source}", f"unknown ending '{source.suffix}'", f"known: {', '.join(SOURCES)}")
    files, lost = SOURCES[source.suffix.lower()](source, folder)
    return _write(files, folder, f"flexclear new --from {source} FOLDER"), lost


def _write(files: Mapping[str, bytes], folder: Path, otherwise: str) -> list[Path]:
    """Write files by their paths in a folder and return these, in order; otherwise: the command for another folder."""
    targets = [folder / name for name in files]
    for target in targets:
        if target.exists():
            raise InputError(str(target), "already exists and is not overwritten", f"name another folder: {otherwise}")
    try:
        for target, content in zip(targets, files.values(), strict=True):
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_bytes(content)
    except FileExistsError:
        raise InputError(str(folder), "is a file, not a folder", "name another folder") from None
    except OSError as error:
        raise ResourceError(f"{folder}: cannot be written: {error.strerror}") from None
    return targets
