"""``flexclear compare``: scenes next to each other or their ideal mechanisms: differences, and each run's own error."""

from __future__ import annotations

import argparse

from flexclear.scene.variants import EFFECTS
from flexclear.stages.export import as_json
from flexclear.stages.scenes import graphs, print_files, scene_arguments
from flexclear.stages.workplace import open_workplace
from flexclear.study.compare import IDEAL, TABLES, compare_scenes


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments to its parser."""
    scene_arguments(parser, "json")
    parser.add_argument(
        "--ideal",
        nargs="?",
        choices=IDEAL,
        const="both",
        metavar="WHAT",
        help="compare with the scene without clearance and flexibility (both), without one of them "
        f"({', '.join(EFFECTS)}), or with each of these (each)",
    )


def run_command(options: argparse.Namespace) -> None:
    """Bring the comparison up to date, print its tables and where its files are."""
    workplace = open_workplace(options)
    made = compare_scenes([graph.scene for graph in graphs(options.scenes, options.set)], workplace, options.ideal)
    if options.json:
        print(as_json(made.dataset()))
        return
    print(*map(made.text, TABLES), sep="\n")
    print_files(made.folder, {"index.html": "the page", "compare.nc": "all series", "compare.png": "the figure"})
