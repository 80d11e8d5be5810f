"""``flexclear mass``: mass of the rigid bodies of scenes."""

from __future__ import annotations

import argparse

from flexclear.stages import scenes


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments to its parser."""
    parser.add_argument("scenes", nargs="+", metavar="SCENE")


def run_command(options: argparse.Namespace) -> None:
    """Print a line for each scene."""
    for graph in scenes.graphs(options.scenes):
        total = sum(body.mass for body in graph.scene.rigid().values())
        print(f"{graph.scene.name}: {total:.6g} kg")
