"""``flexclear cost``: error against cost of a scene, point by point from the cache, and its price list."""

from __future__ import annotations

import argparse
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from flexclear.pipeline.core.artifacts.disk import disk_limits, publish
from flexclear.pipeline.core.scene.load import edited
from flexclear.pipeline.core.workflow.task import Task
from flexclear.stages import as_json, cost_design, cost_peers, kernels, run, s4_simulate
from flexclear.stages.cost_peers import Track
from flexclear.stages.graph import Graph
from flexclear.stages.run import Workplace, bundles, check
from flexclear.stages.workplace import open_workplace

if TYPE_CHECKING:
    import xarray as xr

    from flexclear.pipeline.core.scene.schema import Scene
    from flexclear.pipeline.post.cost.page import Studied

#: tolerances at which ensembles are compared, where a scene has one
ENSEMBLES = (1e-6, 1e-8, 1e-10)
#: tables of a study, in the order in which they are printed
PRINTED = ("price.md", "quantities.md", "causes.md", "statistics.md")
#: figures of a study and their titles
FIGURES = {
    "work_precision": "Error against cost",
    "causes": "Causes of the error",
    "statistics": "Error of ensemble means against cost",
}


def arguments(parser: argparse.ArgumentParser) -> None:
    """What the command takes."""
    run.scene_arguments(parser)
    parser.add_argument("--page", type=Path, metavar="FILE.md", help="write what the studies say as a page")
    as_json.json_argument(parser)
    parser.add_argument("--peer", type=Path, metavar="FILE.json", help="runs of another program, drawn next to ours")
    parser.add_argument(
        "--integrators", nargs="+", default=(), metavar="NAME", help="compare only these (default: all)"
    )


def command(options: argparse.Namespace) -> None:
    """Bring the studies up to date and print their tables."""
    if options.page is not None:
        run.check_target(options.page, "--page")
    peers = {} if options.peer is None else cost_peers.read(options.peer)
    workplace, studies = open_workplace(options), {}
    for graph in run.graphs(options.scenes, options.set):
        scene, others = graph.scene, peers.get(graph.scene.name, ())
        if not options.integrators and not options.json:
            # the points of the scene's own method come first: a table within a minute, of which the whole study is more
            _, folder = bring(scene, workplace, others, [scene.solver.integrator])
            print(
                (folder / PRINTED[0]).read_text(encoding="utf-8"),
                f"so far {scene.solver.integrator} alone; going on\n",
                sep="\n",
            )
        studies[scene.name] = _, folder = bring(scene, workplace, others, options.integrators)
        if not options.json:
            print(
                *((folder / name).read_text(encoding="utf-8") for name in PRINTED if (folder / name).is_file()),
                sep="\n",
            )
            print(f"figures and data: {folder}\n")
    if options.json:
        print(as_json.as_json({name: one for name, (one, _) in studies.items()}))
    if options.page is not None:
        said = f" --peer {options.peer.as_posix()}" if options.peer else ""
        said += f" --integrators {' '.join(options.integrators)}" if options.integrators else ""
        write_page(studies, options.page, said)


def study(scene: Scene, workplace: Workplace, peers: Sequence[Track] = (), integrators: Collection[str] = ()) -> Task:
    """The task of a scene's study; its points are its inputs, so that an interrupted study goes on where it was.

    peers: runs of other programs, see `stages.cost_peers`.  integrators: see `cost_design.runs`.
    Raises InputError when the scene has nothing to measure.
    """
    chosen = scene.requested()
    designs = cost_design.runs(scene, _highest(scene, workplace), integrators)
    names = [quantity.name for quantity in chosen]
    compiled, more = _kernels(designs), {"quantities": names}
    points = {f"point{k}": _measured(design, "run", more, compiled) for k, design in enumerate(designs)}
    listed = [
        {"key": d.key, "group": d.group, "factors": dict(d.factors), "input": name}
        for name, d in zip(points, designs, strict=True)
    ]
    return Task(
        stage="cost",
        scene=scene.name,
        run="flexclear.stages.cost_study:run",
        params={
            "points": listed,
            "quantities": [[q.owner, q.kind] for q in chosen],
            "title": scene.title,
            "peers": list(peers),
        },
        inputs=points | _ensembles(scene, names, compiled),
        folder=f"cost/{scene.name}",
        names={"nc": "cost.nc"},
    )


def bring(
    scene: Scene, workplace: Workplace, peers: Sequence[Track] = (), integrators: Collection[str] = ()
) -> tuple[xr.Dataset, Path]:
    """The study's dataset, brought up to date, and the folder with its tables and figures; arguments as of `study`."""
    task = study(scene, workplace, peers, integrators)
    outcome = workplace.bring([task])
    check(outcome)
    return workplace.store.load(outcome.records[id(task)]), workplace.store.root / task.folder


def figures_and_tables(name: str, study: xr.Dataset, folder: Path, pictures: str) -> tuple[Studied, dict[str, Path]]:
    """What a page says of a scene, and the files of its pictures, by path relative to the page.

    study, folder: as `bring` returned them.  pictures: folder for them next to the page.
    """
    from flexclear.pipeline.post.cost.page import Studied, advice

    tables = tuple((folder / file).read_text(encoding="utf-8") for file in PRINTED if (folder / file).is_file())
    files = {stem: folder / f"{stem}.png" for stem in FIGURES}
    shown = {stem: f"{pictures}/{name.replace('/', '_')}_{stem}.png" for stem, file in files.items() if file.is_file()}
    said = Studied(name, advice(study, tables), tables, {FIGURES[stem]: path for stem, path in shown.items()})
    return said, {path: files[stem] for stem, path in shown.items()}


def write_page(studies: Mapping[str, tuple[xr.Dataset, Path]], page: Path, options: str = "") -> None:
    """The page on accuracy, with its pictures in a folder of its name next to it.

    studies: what `bring` returned, by scene.  options: the command's other options.
    """
    from flexclear.pipeline.post.cost.page import markdown

    sections = []
    with disk_limits(page.parent):
        (page.parent / page.stem).mkdir(parents=True, exist_ok=True)
        for name, (study, folder) in studies.items():
            said, pictures = figures_and_tables(name, study, folder, page.stem)
            sections.append(said)
            for path, file in pictures.items():
                publish(page.parent / path, file.read_bytes())
        publish(page, markdown(tuple(sections), f"{page.as_posix()}{options}").encode())


def _highest(scene: Scene, workplace: Workplace) -> float | None:
    """The highest frequency in the scene's bundles [Hz]; they are made first."""
    reduced = bundles(scene, workplace, jobs=None)
    return max((float(bundle["frequency"].max()) for bundle in reduced.values()), default=None)


def _kernels(designs: list[cost_design.Design]) -> dict[tuple[str, ...], Task]:
    """One task for each set of kernels that the points need; compiled side by side."""
    tasks: dict[tuple[str, ...], Task] = {}
    for design in designs:
        if kernels.shared(design.scene) not in tasks:
            tasks[kernels.shared(design.scene)] = kernels.task(design.scene, _bundles(design))
    return tasks


def _bundles(design: cost_design.Design) -> dict[str, Task]:
    return Graph(design.scene, shown=False, recipe=design.recipe).bodies()


def _measured(
    design: cost_design.Design, function: str, more: Mapping[str, object], compiled: Mapping[tuple[str, ...], Task]
) -> Task:
    """A task of `stages.cost_point` on a design's scene."""
    ensemble = design.scene.ensemble is not None
    return Task(
        stage="cost-ensemble" if ensemble else "cost-point",
        scene=design.scene.name,
        part=design.key,
        run=f"flexclear.stages.cost_point:{function}",
        params={"simulate": s4_simulate.params(design.scene, ensemble=ensemble), **more},
        inputs={**_bundles(design), "kernels": compiled[kernels.shared(design.scene)]},
        modules=s4_simulate.modules(design.scene),
        folder="",
        exclusive=True,
    )


def _ensembles(scene: Scene, names: list[str], compiled: Mapping[tuple[str, ...], Task]) -> dict[str, Task]:
    """Ensembles at several tolerances, of a scene that has one."""
    ensembles = {}
    for rtol in ENSEMBLES if scene.ensemble is not None else ():
        change = edited(scene, {"solver.rtol": rtol, "accuracy": None})
        design = cost_design.Design(f"ensemble, rtol {rtol:g}", "ensemble", {}, change)
        ensembles[f"ensemble:rtol {rtol:g}"] = _measured(design, "run_ensemble", {"quantities": names}, compiled)
    return ensembles
