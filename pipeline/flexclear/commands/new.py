"""``flexclear new``: a commented scene to start from, with its mesh recipes or surfaces, in a folder of the user's."""

from __future__ import annotations

import argparse
from pathlib import Path

from flexclear.scene.registry import suggestion
from flexclear.stages.new_scene import KINDS, write, write_from
from flexclear.stages.new_scene import TEMPLATES as TEMPLATES
from flexclear.system.errors import InputError


def add_arguments(parser: argparse.ArgumentParser) -> None:
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
    message = "another program's file instead of KIND (URDF, MJCF, STEP): flexclear new --from robot.urdf FOLDER"
    parser.add_argument("--from", type=Path, dest="source", metavar="FILE", help=message)


def run_command(options: argparse.Namespace) -> None:
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
    several = f" and {len(files) - 4} more" if len(files) > 4 else ""
    print(f"wrote {', '.join(str(path) for path in files[:4])}{several}")
    scene = files[0]
    if lost:
        print(f"not taken over, as the head of {scene.name} lists:", *(f"  {item}" for item in lost), sep="\n")
    print(
        "next:",
        f"  flexclear show {scene}        the start pose with all names, without a run",
        f"  flexclear check {scene}       all errors at once, without a run",
        f"  flexclear render {scene}      film and pictures",
        f"  flexclear report {scene}      one page with figures, compared with the ideal mechanism",
        sep="\n",
    )
