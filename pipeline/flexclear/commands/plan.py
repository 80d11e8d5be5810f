"""``flexclear plan``: effects, modes and tolerance that a scene's requested accuracy requires, with the evidence."""

from __future__ import annotations

import argparse
from pathlib import Path

from flexclear.artifacts.store import publish
from flexclear.stages import export, scenes
from flexclear.stages.workplace import open_workplace, seconds
from flexclear.study.plan import BUDGET, LEVEL, make_plan, verify


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments to its parser."""
    scenes.scene_arguments(parser, "json", "budget", budget={"default": f"{BUDGET:g}s"})
    parser.add_argument("--out", type=Path, metavar="FILE.toml", help="also write the planned scene here (one scene)")
    parser.add_argument(
        "--verify", action="store_true", help="also run the full scene, and report the plan's true error"
    )
    parser.add_argument(
        "--accuracy",
        metavar="FRACTION",
        help="accuracy of all watched quantities, as a fraction of their sizes, in place of [accuracy] "
        f"(without it {LEVEL.replace('%', '%%')})",
    )


def run_command(options: argparse.Namespace) -> None:
    """Plan scenes, print the decisions and the planned scenes' files; with `--verify` print their true errors."""
    scenes.check_out(options.out, options.scenes, endings=(".toml",))
    workplace = open_workplace(options)
    missed, plans = list[str](), dict[str, object]()
    budget = seconds(options.budget, "--budget")
    for graph in scenes.graphs(options.scenes, options.set):
        planned = make_plan(graph.scene, workplace, options.accuracy)
        plans[graph.scene.name] = planned.made.dataset() if options.json else None
        if not options.json:
            print(planned.made.text("plan.md"))
        if options.out is not None:
            publish(options.out, planned.file(options.out))
        if options.verify:
            missed += verify(planned, workplace, budget)
        if not options.json:
            files = {planned.target.name: "the planned scene", "plan.nc": "all effect sizes", "plan.png": "the chart"}
            scenes.print_files(planned.made.folder, files)
    if options.json:
        print(export.as_json(plans))
    if missed:
        raise scenes.MissedAccuracyError("\n".join(missed))
