"""``flexclear new``: a commented scene to start from, with its mesh recipes, in a folder of the user's."""

from __future__ import annotations

import argparse
from pathlib import Path

from flexclear.artifacts.paths import PACKAGE
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
    parser.add_argument("kind", choices=list(KINDS), metavar="KIND", help=message)
    parser.add_argument(
        "folder",
        nargs="?",
        type=Path,
        default=Path(),
        metavar="FOLDER",
        help="folder to write to (default: the current one)",
    )


def command(options: argparse.Namespace) -> None:
    """Write the files and print the next commands."""
    files = write(options.kind, options.folder)
    print(f"wrote {', '.join(str(path) for path in files)}")
    scene = files[0]
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
    targets = [folder / source.name for source in sources]
    for target in targets:
        if target.exists():
            raise InputError(
                str(target),
                "already exists and is not overwritten",
                f"name another folder: flexclear new {kind} FOLDER",
            )
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for source, target in zip(sources, targets, strict=True):
            target.write_bytes(source.read_bytes())
    except FileExistsError:
        raise InputError(str(folder), "is a file, not a folder", "name another folder") from None
    except OSError as error:
        raise ResourceError(f"{folder}: cannot be written: {error.strerror}") from None
    return targets
