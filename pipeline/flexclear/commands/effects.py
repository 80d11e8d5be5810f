"""``flexclear effects``: effect size of each part of a scene on each quantity, by removal, alone and in pairs."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from flexclear.stages import watched_quantities
from flexclear.stages.export import as_json
from flexclear.stages.scenes import graphs, print_files, scene_arguments
from flexclear.stages.workplace import open_workplace
from flexclear.study.effects import bring

if TYPE_CHECKING:
    import xarray as xr


def arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments to its parser."""
    scene_arguments(parser, "json")
    parser.add_argument(
        "--members",
        type=int,
        default=watched_quantities.MEMBERS,
        metavar="N",
        help=f"number of starts of each variant that has contacts (default {watched_quantities.MEMBERS}); "
        "more of them resolve smaller differences",
    )


def command(options: argparse.Namespace) -> None:
    """Bring the tables up to date, print them and where their files are."""
    workplace = open_workplace(options)
    datasets: dict[str, xr.Dataset] = {}
    for graph in graphs(options.scenes, options.set):
        made = bring(graph.scene, workplace, options.members)
        if options.json:
            datasets[graph.scene.name] = made.dataset()
            continue
        print(made.text("effects.md"))
        files = {"index.html": "the page", "effects.nc": "all effect sizes", "effects.png": "the chart"}
        print_files(made.folder, files)
    if options.json:
        print(as_json(datasets))
