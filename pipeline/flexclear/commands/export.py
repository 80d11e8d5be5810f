"""``flexclear export``: a scene in the form of another program."""

from __future__ import annotations

import argparse
from pathlib import Path

from flexclear.stages import formats, scenes
from flexclear.stages.workplace import add_options, open_workplace


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments to its parser."""
    parser.add_argument("scene", metavar="SCENE", help="a scene file, or a name below scenes/")
    parser.add_argument("--format", required=True, metavar="FORMAT", help=", ".join(formats.FORMATS))
    endings = "; ".join(f"{name}: {', '.join(one.endings)}" for name, one in formats.FORMATS.items())
    parser.add_argument("--out", type=Path, metavar="FILE", help=f"file to write, named like the scene ({endings})")
    parser.add_argument("--at", metavar="TIME", help="pose of the drives, or time of constant loads, such as '90 ms'")
    parser.add_argument(
        "--held", action="store_true", help="state-space: hold the drives instead of freeing their forces"
    )
    parser.add_argument("--fmi", metavar="VERSION", help="fmu: version of the standard, 2 or 3 (default)")
    parser.add_argument("--body", metavar="NAME", help="loads: the flexible body, if there are several")
    add_options(parser, "usual")


def run_command(options: argparse.Namespace) -> None:
    """Write the file and print what it holds."""
    (graph,) = scenes.graphs([options.scene], options.set)
    given = {"at": scenes.moment(options.at), "held": options.held or None, "body": options.body, "fmi": options.fmi}
    asked = {name: value for name, value in given.items() if value is not None}
    print(formats.write(graph.scene, options.format, options.out, asked, open_workplace(options)))
