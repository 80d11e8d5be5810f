"""``flexclear new``: a commented scene to start from, with its mesh recipes, in a folder of the user's."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path

from flexclear.artifacts.paths import PACKAGE
from flexclear.scene.registry import suggestion
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


def arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments to its parser."""
    message = "; ".join(f"{name}: {text}" for name, text in KINDS.items())
    parser.add_argument("kind", nargs="?", metavar="KIND", help=message)
    parser.add_argument(
        "folder",
        nargs="?",
        type=Path,
        default=Path(),
        metavar="FOLDER",
        help="folder to write to (default: the current one)",
    )
    message = "a file of another program instead of KIND, as: flexclear new --from part.step FOLDER"
    parser.add_argument("--from", type=Path, dest="source", metavar="FILE", help=message)


def command(options: argparse.Namespace) -> None:
    """Write the files and print the next commands."""
    lost: list[str] = []
    if options.source is not None:  # KIND is then the folder
        files, lost = write_from(options.source, Path(options.kind or ""))
    elif options.kind in KINDS:
        files = write(options.kind, options.folder)
    else:
        raise InputError(
            options.kind or "new", "is not a kind of mechanism", suggestion(options.kind or "", list(KINDS))
        )
    print(f"wrote {', '.join(str(path) for path in files)}")
    scene = files[0]
    if lost:
        print("not taken over:", *(f"  {item}" for item in lost), sep="\n")
    print(
        "next:",
        f"  flexclear show {scene}        the start pose with all names, without a run",
        f"  flexclear check {scene}       all errors at once, without a run",
        f"  flexclear render {scene}      film and pictures",
        f"  flexclear report {scene}      one page with figures, compared with the ideal mechanism",
        sep="\n",
    )


def write(kind: str, folder: Path) -> list[Path]:
    """Write the files of a new mechanism and return their paths, the scene first; InputError where one exists."""
    sources = sorted(
        (TEMPLATES / kind.replace("-", "_")).glob("*.toml"), key=lambda p: "[body" not in p.read_text(encoding="utf-8")
    )
    return _write({source.name: source.read_bytes() for source in sources}, folder, f"flexclear new {kind} FOLDER")


#: ending of another program's file -> function (file, folder) that returns a scene's files, and what these leave out
SOURCES = {".step": cad_scene.files, ".stp": cad_scene.files}


def write_from(source: Path, folder: Path) -> tuple[list[Path], list[str]]:
    """Write the scene of another program's file; return its paths, the scene first, and what is not taken over.

    Raises InputError where a file exists, or for a file of an unknown kind.
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
        folder.mkdir(parents=True, exist_ok=True)
        for target, content in zip(targets, files.values(), strict=True):
            target.write_bytes(content)
    except FileExistsError:
        raise InputError(str(folder), "is a file, not a folder", "name another folder") from None
    except OSError as error:
        raise ResourceError(f"{folder}: cannot be written: {error.strerror}") from None
    return targets
