"""``flexclear render``: pictures, film and interactive page of scenes."""

from __future__ import annotations

import argparse

from stages import run


def arguments(parser: argparse.ArgumentParser) -> None:
    """What the command takes."""
    parser.add_argument("scenes", nargs="+", metavar="SCENE")


def command(options: argparse.Namespace) -> None:
    """Bring them up to date."""
    graphs = run.graphs(options.scenes)
    run.check(run.workplace().bring([graph.render for graph in graphs]))
