"""``flexclear export``: a scene in the form of another program."""

from __future__ import annotations

import argparse
from pathlib import Path

from flexclear.stages import formats, scenes
from flexclear.stages.workplace import add_options, open_workplace


def arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments to its parser."""
    parser.add_argument("scene", metavar="SCENE", help="a scene file, or a name below scenes/")
    parser.add_argument("--format", required=True, metavar="FORMAT", help=", ".join(formats.FORMATS))
    endings = "; ".join(f"{name}: {', '.join(one.endings)}" for name, one in formats.FORMATS.items())
    parser.add_argument("--out", type=Path, metavar="FILE", help=f"file to write, named like the scene ({endings})")
    parser.add_argument("--fmi", metavar="VERSION", help="fmu: version of the standard, 2 or 3 (default)")
    add_options(parser, "usual")


def command(options: argparse.Namespace) -> None:
    """Write the file and print what it holds."""
    (graph,) = scenes.graphs([options.scene], options.set)
    asked = {name: value for name, value in {"fmi": options.fmi}.items() if value is not None}
    print(formats.write(graph.scene, options.format, options.out, asked, open_workplace(options)))
