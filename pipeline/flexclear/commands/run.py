"""``flexclear run``: scenes brought up to date."""

from __future__ import annotations

import argparse
from pathlib import Path

from flexclear.stages import export
from flexclear.stages.export import as_json
from flexclear.stages.graph import STAGES, Graph
from flexclear.stages.scenes import (
    FACTS,
    check_out,
    claim,
    conclude,
    copy_run,
    deficits,
    graphs,
    print_files,
    scene_arguments,
)
from flexclear.stages.simulation import check_run
from flexclear.stages.workplace import Workplace, check, open_workplace
from flexclear.study import plan
from flexclear.system.errors import InputError
from flexclear.workflow.schedule import Outcome


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments to its parser."""
    scene_arguments(parser, "json")
    parser.add_argument(
        "--to", choices=STAGES, default="post", metavar="STAGE", help=f"last stage: {', '.join(STAGES)}"
    )
    parser.add_argument(
        "--out",
        type=Path,
        metavar="FILE",
        help=f"write the run to this file: {export.KNOWN}",
    )
    parser.add_argument("--planned", action="store_true", help="run the scene that `flexclear plan` selects")
    parser.add_argument(
        "--verify", action="store_true", help="with --planned: also run the full scene, and report the true error"
    )


def run_command(options: argparse.Namespace) -> None:
    """Bring scenes up to date; print the deficits of their bundles where those are the last stage."""
    check_out(options.out, options.scenes)
    if options.verify and not options.planned:
        raise InputError("--verify", "reports the true error of a plan, but no plan is requested", "add --planned")
    requested = graphs(options.scenes, options.set)
    workplace = open_workplace(options)
    plans = [plan.make_plan(graph.scene, workplace) for graph in requested] if options.planned else []
    print(*(f"{one.made.text('plan.md')}\n" for one in plans), sep="", end="")
    requested = [Graph(one.planned) for one in plans] or requested
    for graph in requested:
        check_run(graph.scene, workplace.store.root)
        taken = claim(graph.scene, workplace.store)
        if taken is not None:
            workplace.monitor.say(taken)
    outcome = workplace.bring([task for graph in requested for task in graph.up_to(options.to)])
    check(outcome)
    if options.to == "bundle" and not options.json:
        print("\n\n".join(filter(None, (deficits(graph, workplace) for graph in requested))))
    if options.out is not None:
        copy_run(requested[0], workplace, options.out)
    if options.json:
        print(as_json({graph.scene.name: _result(graph, workplace, outcome) for graph in requested}))
    for graph in requested if options.to in ("simulate", "ensemble", "post") and not options.json else ():
        print_files(workplace.store.root / graph.simulate.folder, {"run.nc": "the run", "post.nc": "derived from it"})
    missed = [text for one in plans if options.verify for text in plan.verify(one, workplace)]
    conclude(requested, workplace, outcome, missed)


def _result(graph: Graph, workplace: Workplace, outcome: Outcome) -> dict[str, object]:
    """Return the JSON record of a scene: its shown files, warnings, and the verdict on its accuracy."""
    folder, record = workplace.store.root / graph.simulate.folder, outcome.records.get(graph.simulate)
    reported = {} if record is None else record.said
    return {
        "files": [str(path) for path in sorted(folder.rglob("*")) if path.is_file() and FACTS not in path.parts],
        "warnings": [text for text in reported.get("warnings", "").split("\n") if text],
        "accuracy": reported.get("accuracy_verdict"),
    }
