"""``flexclear why``: for each stage of scenes, fresh, or why it would run again."""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence

from flexclear.pipeline.core.errors import shown
from flexclear.pipeline.core.workflow.execute import states
from flexclear.stages import as_json, run
from flexclear.stages.graph import STAGES
from flexclear.stages.workplace import open_workplace


def arguments(parser: argparse.ArgumentParser) -> None:
    """What the command takes."""
    run.scene_arguments(parser, "json")
    parser.add_argument("--to", choices=STAGES, default="post", metavar="STAGE", help="last stage")


def command(options: argparse.Namespace) -> None:
    """Print the state of every stage."""
    workplace, reasons = open_workplace(options), dict[str, dict[str, list[str]]]()
    for graph in run.graphs(options.scenes, options.set):
        stages = states(graph.up_to(options.to), workplace.store, workplace.sources)
        reasons[graph.scene.name] = {state.task.label: list(state.why) for state in stages}
    print(as_json.as_json(reasons) if options.json else text(reasons))


def text(reasons: Mapping[str, Mapping[str, Sequence[str]]]) -> str:
    """For each scene its stages, and why each would run again."""
    lines = []
    for scene, stages in reasons.items():
        lines.append(scene)
        for label, why in stages.items():
            first, *others = map(shown, why or ["fresh"])
            lines += [f"  {label:<16} {first}", *(f"  {'':<16} {line}" for line in others)]
    return "\n".join(lines)
