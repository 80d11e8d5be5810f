"""``flexclear cost``: error against cost of a scene, point by point from the cache, and its price list."""

from __future__ import annotations

import argparse
from pathlib import Path

from flexclear.stages import scenes
from flexclear.stages.export import as_json
from flexclear.stages.workplace import Made, open_workplace, relative, seconds
from flexclear.study.cost import BUDGET, TABLE, bring, read_peers, write_page


def arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments to its parser."""
    scenes.scene_arguments(parser, "json", "budget", budget={"default": f"{BUDGET:g}s"})
    parser.add_argument("--page", type=Path, metavar="FILE.md", help="write the studies as a page")
    parser.add_argument("--peer", type=Path, metavar="FILE.json", help="also draw these runs of another program")
    parser.add_argument(
        "--integrators", nargs="+", default=(), metavar="NAME", help="compare only these methods (default: all)"
    )


def command(options: argparse.Namespace) -> None:
    """Bring the studies up to date and print their tables."""
    if options.page is not None:
        scenes.check_target(options.page, "--page")
    peers = {} if options.peer is None else read_peers(options.peer)
    workplace, studies = open_workplace(options), {}
    budget = seconds(options.budget, "--budget")

    def first(made: Made) -> None:
        if not options.json:
            text = f"{relative(made.folder)}: first answer; continuing\n"
            print(made.text(TABLE), text, sep="\n", flush=True)

    for graph in scenes.graphs(options.scenes, options.set):
        scene, others = graph.scene, peers.get(graph.scene.name, ())
        made = bring(scene, workplace, others, options.integrators, budget=budget, answered=first)
        studies[scene.name] = made
        if not options.json:
            print(made.text(TABLE), f"figures and data: {made.folder}\n", sep="\n")
    if options.json:
        print(as_json({name: made.dataset() for name, made in studies.items()}))
    if options.page is not None:
        shown_options = f" --peer {options.peer.as_posix()}" if options.peer else ""
        shown_options += f" --integrators {' '.join(options.integrators)}" if options.integrators else ""
        shown_options += f" --budget {options.budget}"
        write_page(studies, options.page, shown_options)
