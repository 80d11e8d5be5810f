"""``flexclear sweep``: many points of one scene, each stored as soon as it is done."""

from __future__ import annotations

import argparse
from pathlib import Path

import xarray as xr

from flexclear.artifacts.store import disk_limits, publish
from flexclear.scene.load import scene_name
from flexclear.stages import export, scenes
from flexclear.stages.export import as_json
from flexclear.stages.sweeps import sweep_large, sweep_plan
from flexclear.stages.sweeps.sweep_engine import engine
from flexclear.stages.workplace import add_options, open_workplace
from flexclear.study.sweep import NAME, read, run_sweep, summary, width
from flexclear.system.errors import InputError, SolverError


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments to its parser."""
    parser.add_argument("sweeps", nargs="+", metavar="SWEEP", help="a sweep file, or a name below scenes/")
    add_options(parser, "usual", "json")
    parser.add_argument("--scheduler", metavar="ADDRESS", help="run on the Dask cluster with this scheduler instead")
    parser.add_argument(
        "--out", type=Path, metavar="FILE", help=f"copy the dataset here (one sweep): {export.KNOWN}, .zarr"
    )


def run_command(options: argparse.Namespace) -> None:
    """Bring sweeps up to date: dataset and figures below results/sweeps, a summary on the screen."""
    if options.out is not None and len(options.sweeps) == 1 and options.out.suffix == sweep_large.SUFFIX:
        sweep_large.require_zarr(f"--out {options.out}")
    else:
        scenes.check_out(options.out, options.sweeps, "sweep", (*export.NEEDS, sweep_large.SUFFIX))
    workplace = open_workplace(options)
    paths = [scenes.find_scene(name) for name in options.sweeps]
    requested = [
        sweep_plan.plan(sweep, scene, str(path)) for path in paths for sweep, scene in [read(path, options.set)]
    ]
    if options.out is not None and options.out.suffix != sweep_large.SUFFIX and sweep_large.is_large(requested[0]):
        raise InputError(f"--out {options.out}", "the dataset is larger than memory", "let its name end in .zarr")
    made = {}
    with engine(width(options.jobs), options.scheduler) as workers, workplace.time_limit():
        for path, plan in zip(paths, requested, strict=True):
            name = scenes.with_edits(scene_name(path).removeprefix("sweeps/"), options.set)
            made[name] = run_sweep(plan, workers, workplace, folder := workplace.store.root / "sweeps" / name)
            _show(plan, made[name], folder, options.out, quiet=options.json)
    if options.json:
        print(as_json(made))


def _show(plan: sweep_plan.Plan, result: xr.Dataset, folder: Path, out: Path | None, *, quiet: bool = False) -> None:
    """Write figures next to the dataset, and print a summary unless `quiet`."""
    from flexclear.post.overview.sweep_figures import figures

    file = next(
        path for path in (folder / f"{NAME}{suffix}" for suffix in (sweep_large.SUFFIX, ".nc")) if path.exists()
    )
    drawn = figures(result) if file.suffix != sweep_large.SUFFIX else {}
    for name, content in drawn.items():
        publish(folder / name, content)
    for path in folder.glob(f"{NAME}.*g"):
        if path.name not in drawn:  # from an earlier state of the sweep
            path.unlink()
    if out is not None and out.suffix == sweep_large.SUFFIX:
        sweep_large.write_copy(out, result)
    elif out is not None:
        with disk_limits(out.parent):
            export.write(result, out, result["status"].dims)
    if not quiet:
        print("\n".join(summary(plan, result, file)))
    if not (result["status"] == 0).any():
        raise SolverError(f"{plan.sweep.name}: every point was refused; see the reasons above")
