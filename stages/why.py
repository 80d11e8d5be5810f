"""``flexclear why``: for each stage of scenes, fresh, or why it would run again."""

from __future__ import annotations

import argparse

from flexclear.pipeline.core.workflow.execute import states
from flexclear.stages import run
from flexclear.stages.graph import STAGES


def arguments(parser: argparse.ArgumentParser) -> None:
    """What the command takes."""
    run.scene_arguments(parser)
    parser.add_argument("--to", choices=STAGES, default="post", metavar="STAGE", help="last stage")


def command(options: argparse.Namespace) -> None:
    """Print the state of every stage."""
    place = run.workplace(options)
    for graph in run.graphs(options.scenes, options.set):
        print(graph.scene.name)
        for state in states(graph.up_to(options.to), place.store, place.sources):
            lines = list(state.why) or ["fresh"]
            print(f"  {state.task.label:<16} {lines[0]}", *(f"  {'':<16} {line}" for line in lines[1:]), sep="\n")
