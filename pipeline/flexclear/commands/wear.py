"""``flexclear wear``: gap, clearance and forces of loose joints over many cycles of wear."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from flexclear.stages import scenes
from flexclear.stages.export import as_json
from flexclear.stages.workplace import open_workplace, relative
from flexclear.study.wear import TOLERANCE, wear_surfaces

if TYPE_CHECKING:
    import xarray as xr

#: columns of the table: variable, heading, factor of its unit
COLUMNS = (
    ("worn_gap", "largest gap (um)", 1e6),
    ("worn_clearance", "clearance (um)", 1e6),
    ("peak_force", "largest force (N)", 1.0),
    ("run_volume", "worn per run (mm^3)", 1e9),
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments to its parser."""
    scenes.scene_arguments(parser, "json")
    parser.add_argument("--cycles", type=float, required=True, metavar="N", help="number of cycles, such as 1e6")
    parser.add_argument("--per-run", type=float, default=1.0, metavar="N", help="cycles of the scene's run (default 1)")
    parser.add_argument(
        "--tolerance",
        type=float,
        default=TOLERANCE,
        metavar="X",
        help=f"error of the depths of a step, as fraction of the clearance (default {TOLERANCE:g})",
    )


def run_command(options: argparse.Namespace) -> None:
    """Bring the wear of each scene up to date, and print it."""
    workplace, worn = open_workplace(options), {}
    for graph in scenes.graphs(options.scenes, options.set):
        made = wear_surfaces(
            graph.scene, workplace, options.cycles, per_run=options.per_run, tolerance=options.tolerance
        )
        data = worn[graph.scene.name] = made.dataset()
        if not options.json:
            print(text(graph.scene.name, data), f"figure and data: {relative(made.folder)}\n", sep="\n")
    if options.json:
        print(as_json(worn))


def text(name: str, data: xr.Dataset) -> str:
    """Return the wear of a scene over the cycles, joint by joint (schema WEAR)."""
    lines = [f"{name}: {data.sizes['step']} runs"]
    for joint in data["worn"].values:
        one = data.sel(worn=joint)
        lines.append(f"  {joint:<10}" + "".join(f"{heading:>22}" for _, heading, _ in COLUMNS))
        for k, cycles in enumerate(data["cycles"].values):
            lines.append(f"  {cycles:<10.4g}" + "".join(f"{f * one[n].values[k]:22.4g}" for n, _, f in COLUMNS))
    return "\n".join(lines)
