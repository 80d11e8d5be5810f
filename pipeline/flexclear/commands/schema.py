"""``flexclear schema``: JSON schemas of scene files, mesh recipes and sweeps."""

from __future__ import annotations

import argparse
import json

KINDS = ("scene", "recipe", "sweep")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments to its parser."""
    parser.add_argument(
        "kind", nargs="?", choices=KINDS, default="scene", metavar="KIND", help="scene (default), recipe or sweep"
    )


def run_command(options: argparse.Namespace) -> None:
    """Print the JSON schema of a kind of file."""
    if options.kind == "scene":
        from flexclear.scene.json_schema import scene_schema as schema
    elif options.kind == "sweep":
        from flexclear.scene.json_schema import sweep_schema as schema
    else:
        from flexclear.structure.fe.recipe import recipe_schema as schema
    print(json.dumps(schema(), indent=2))
