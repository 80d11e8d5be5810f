"""``flexclear cost``: error against cost of a scene, point by point from the cache, and its price list."""

from __future__ import annotations

import argparse

from flexclear.stages import scenes
from flexclear.stages.export import as_json
from flexclear.stages.workplace import Made, open_workplace, relative, seconds
from flexclear.study.cost import BUDGET, TABLE, measure_costs


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments to its parser."""
    scenes.scene_arguments(parser, "json", "budget", budget={"default": f"{BUDGET:g}s"})
    parser.add_argument(
        "--integrators", nargs="+", default=(), metavar="NAME", help="compare only these methods (default: all)"
    )


def run_command(options: argparse.Namespace) -> None:
    """Bring the studies up to date and print their tables."""
    workplace, studies = open_workplace(options), {}
    budget = seconds(options.budget, "--budget")

    def first(made: Made) -> None:
        if not options.json:
            text = f"{relative(made.folder)}: first answer; continuing\n"
            print(made.text(TABLE), text, sep="\n", flush=True)

    for graph in scenes.graphs(options.scenes, options.set):
        made = measure_costs(graph.scene, workplace, integrators=options.integrators, budget=budget, first_answer=first)
        studies[graph.scene.name] = made.dataset()
        if not options.json:
            print(made.text(TABLE), f"figures and data: {made.folder}\n", sep="\n")
    if options.json:
        print(as_json(studies))
