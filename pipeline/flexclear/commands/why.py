"""``flexclear why``: for each stage of scenes, fresh, or why it would run again."""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence

from flexclear.stages import scenes
from flexclear.stages.export import as_json
from flexclear.stages.graph import STAGES
from flexclear.stages.workplace import open_workplace
from flexclear.system.errors import shown
from flexclear.workflow.execute import states


def arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments to its parser."""
    scenes.scene_arguments(parser, "json")
    parser.add_argument("--to", choices=STAGES, default="post", metavar="STAGE", help="last stage")


def command(options: argparse.Namespace) -> None:
    """Print the state of every stage."""
    workplace, reasons = open_workplace(options), dict[str, dict[str, list[str]]]()
    for graph in scenes.graphs(options.scenes, options.set):
        stages = states(graph.up_to(options.to), workplace.store, workplace.sources)
        reasons[graph.scene.name] = {state.task.label: list(state.why) for state in stages}
    print(as_json(reasons) if options.json else text(reasons))


def text(reasons: Mapping[str, Mapping[str, Sequence[str]]]) -> str:
    """Return for each scene its stages, and why each would run again."""
    lines = []
    for scene, stages in reasons.items():
        lines.append(scene)
        for label, why in stages.items():
            first, *more = map(shown, why or ["fresh"])
            lines += [f"  {label:<16} {first}", *(f"  {'':<16} {line}" for line in more)]
    return "\n".join(lines)
