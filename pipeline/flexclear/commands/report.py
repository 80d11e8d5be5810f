"""``flexclear report``: the page of scenes."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path

from flexclear.stages.export import as_json
from flexclear.stages.scenes import graphs
from flexclear.stages.workplace import Workplace, add_options, open_workplace, relative, seconds
from flexclear.study.report import write_report


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments to its parser."""
    parser.add_argument("scenes", nargs="+", metavar="SCENE", help="a scene file, or a name below scenes/")
    parser.add_argument(
        "--folder", action="store_true", help="write a folder with the page and its pictures, not one file"
    )
    parser.add_argument(
        "--answers",
        choices=("all", "none"),
        default="all",
        help="none omits the answers that need further runs (default all)",
    )
    add_options(parser, "usual", "budget", "json")


def run_command(options: argparse.Namespace) -> None:
    """Bring the reports up to date and print where they are."""
    workplace = open_workplace(options)
    pages: dict[str, str] = {}
    for name, path in _pages(options, workplace):
        pages[name] = str(path)
        if not options.json:
            print(relative(path))
    if options.json:
        print(as_json(pages))


def _pages(options: argparse.Namespace, workplace: Workplace) -> Iterator[tuple[str, Path]]:
    """Yield name and page of every requested report, as soon as it is written."""
    budget = None if options.budget is None else seconds(options.budget, "--budget")
    answers = options.answers != "none"
    for graph in graphs(options.scenes, options.set):
        yield graph.scene.name, write_report(graph, workplace, folder=options.folder, budget=budget, answers=answers)
