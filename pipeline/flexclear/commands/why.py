"""``flexclear why``: for each stage of scenes, fresh, or why it would run again."""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence

from flexclear.artifacts.store import Record
from flexclear.stages import scenes
from flexclear.stages.export import as_json
from flexclear.stages.graph import STAGES
from flexclear.stages.workplace import open_workplace
from flexclear.system.errors import terminal_text
from flexclear.system.machine import instruction_set
from flexclear.workflow.execute import states


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments to its parser."""
    scenes.scene_arguments(parser, "json")
    parser.add_argument("--to", choices=STAGES, default="post", metavar="STAGE", help="last stage")


def run_command(options: argparse.Namespace) -> None:
    """Print the state of every stage."""
    workplace, reasons, others = open_workplace(options), dict[str, dict[str, list[str]]](), dict[str, list[str]]()
    for graph in scenes.graphs(options.scenes, options.set):
        stages = states(graph.up_to(options.to), workplace.store, workplace.sources)
        reasons[graph.scene.name] = {state.task.label: list(state.why) for state in stages}
        others[graph.scene.name] = [text for state in stages for text in notes(state.task.label, state.record)]
    print(as_json(reasons) if options.json else text(reasons, others))


def notes(label: str, record: Record | None) -> list[str]:
    """Return a note on a fresh result that other instructions than this process's computed: rounding differs."""
    stored = record.computed_by if record is not None else {}
    here = instruction_set() if stored else {}
    names = [name for name in {**stored, **here} if stored.get(name) != here.get(name)]
    changes = ", ".join(f"{name} {stored.get(name, '(none)')}, here {here.get(name, '(none)')}" for name in names)
    return [f"{label}: other processor instructions, numbers differ by rounding: {changes}"] if names else []


def text(reasons: Mapping[str, Mapping[str, Sequence[str]]], others: Mapping[str, Sequence[str]]) -> str:
    """Return for each scene its stages, why each would run again, and notes on results of other instructions."""
    lines = []
    for scene, stages in reasons.items():
        lines += [scene, *(f"  note: {terminal_text(note)}" for note in others.get(scene, ()))]
        for label, why in stages.items():
            first, *more = map(terminal_text, why or ["fresh"])
            lines += [f"  {label:<16} {first}", *(f"  {'':<16} {line}" for line in more)]
    return "\n".join(lines)
