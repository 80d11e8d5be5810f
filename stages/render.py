"""``flexclear render``: pictures, film and interactive page of scenes."""

from __future__ import annotations

import argparse

from flexclear.stages import run

#: what is told of the files that are made
FILES = {
    "film.mp4": "the film",
    "film.gif": "the film",
    "mechanism.png": "the mechanism",
    "run.nc": "the run",
}


def arguments(parser: argparse.ArgumentParser) -> None:
    """What the command takes."""
    run.scene_arguments(parser)


def command(options: argparse.Namespace) -> None:
    """Bring them up to date."""
    graphs, place = run.graphs(options.scenes, options.set), run.workplace(options)
    run.check(place.bring([graph.render for graph in graphs]))
    for graph in graphs:
        run.told(place.store.root / graph.render.folder, FILES)
