"""``flexclear effects``: effect size of each part of a scene on each quantity, by removal, alone and in pairs."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from flexclear.stages.export import as_json
from flexclear.stages.scenes import graphs, print_files, scene_arguments
from flexclear.stages.workplace import open_workplace, seconds
from flexclear.study.answers import answer_of, shown_answer
from flexclear.study.members import MEMBERS
from flexclear.system.errors import InputError

if TYPE_CHECKING:
    import xarray as xr


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments to its parser."""
    scene_arguments(parser, "json", "budget")
    parser.add_argument(
        "--members",
        type=int,
        metavar="N",
        help=f"number of starts of each variant that has contacts (default {MEMBERS[0]}); "
        "more of them resolve smaller differences; --budget chooses them itself",
    )
    parser.add_argument(
        "--of",
        nargs="+",
        default=(),
        metavar="PLACE",
        help="examine only these, by name or part: joint.pin, load.spring, gear.pair; only so the effects of bushings "
        "(against an ideal joint), springs, forces, gears and balls on planes",
    )


def run_command(options: argparse.Namespace) -> None:
    """Bring the tables up to date, print them and where their files are."""
    budget = None if options.budget is None else seconds(options.budget, "--budget")
    if budget is not None and options.members is not None:
        raise InputError("--members", "is chosen by --budget", "leave one of them out")
    workplace, members = open_workplace(options), options.members or MEMBERS[0]
    datasets: dict[str, xr.Dataset] = {}
    for graph in graphs(options.scenes, options.set):
        made = answer_of("effects", graph.scene, workplace, budget, options.of, members)
        if options.json:
            datasets[graph.scene.name] = made.dataset()
            continue
        print(f"{shown_answer('effects', made, graph.scene).text}\n")
        print(made.text("effects.md"))
        print_files(made.folder, {"effects.nc": "all effect sizes", "effects.png": "the chart"})
    if options.json:
        print(as_json(datasets))
