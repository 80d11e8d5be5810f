"""``flexclear cost``: error against cost of a scene, point by point from the cache, and its price list."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from pipeline.core.scene.load import edited
from pipeline.core.workflow.task import Task
from stages import cost_design, s4_simulate
from stages.graph import Graph
from stages.run import Workplace, check

if TYPE_CHECKING:
    import xarray as xr

    from pipeline.core.scene.schema import Scene

#: tolerances at which ensembles are compared, where a scene has one
ENSEMBLES = (1e-6, 1e-8, 1e-10)
#: tables of a study, in the order in which they are printed
PRINTED = ("price.md", "causes.md", "statistics.md")


def study(scene: Scene, place: Workplace) -> Task:
    """The task of a scene's study; its points are its inputs, so that an interrupted study goes on where it was.

    Raises InputError when the scene has nothing to measure.
    """
    chosen = scene.wanted()
    designs = cost_design.runs(scene, _highest(scene, place))
    names = [quantity.name for quantity in chosen]
    points = {f"point{k}": _point(design, names) for k, design in enumerate(designs)}
    listed = [
        {"key": d.key, "group": d.group, "factors": dict(d.factors), "input": name}
        for name, d in zip(points, designs, strict=True)
    ]
    return Task(
        stage="cost",
        scene=scene.name,
        run="stages.cost_study:run",
        params={"points": listed, "quantities": [[q.owner, q.kind] for q in chosen], "title": scene.title},
        inputs=points | _ensembles(scene),
        folder=f"cost/{scene.name}",
        names={"nc": "cost.nc"},
    )


def bring(scene: Scene, place: Workplace) -> tuple[xr.Dataset, Path]:
    """The study's dataset, brought up to date, and the folder with its tables and figures."""
    task = study(scene, place)
    outcome = place.bring([task])
    check(outcome)
    return place.store.load(outcome.records[id(task)]), place.store.root / task.folder


def write_page(studies: Mapping[str, tuple[xr.Dataset, Path]], page: Path) -> None:
    """The page on accuracy, with its pictures in a folder of its name beside it.

    studies: what `bring` returned, by scene.
    """
    from pipeline.post.cost.page import Studied, markdown

    pictures = page.parent / page.stem
    pictures.mkdir(parents=True, exist_ok=True)
    found = []
    for name, (study, folder) in studies.items():
        shown = {}
        for title, stem in (("Error against cost", "work_precision"), ("Causes of the error", "causes")):
            target = pictures / f"{name.replace('/', '_')}_{stem}.png"
            target.write_bytes((folder / f"{stem}.png").read_bytes())
            shown[title] = f"{pictures.name}/{target.name}"
        tables = tuple((folder / f).read_text() for f in PRINTED if (folder / f).is_file())
        found.append(Studied(name, study, tables, shown))
    page.write_text(markdown(tuple(found), page.as_posix()))


def _highest(scene: Scene, place: Workplace) -> float | None:
    """The highest frequency in the scene's bundles [Hz]; they are made first."""
    bundles = list(Graph(scene).bundle.values())
    if not bundles:
        return None
    outcome = place.bring(bundles)
    check(outcome)
    return max(float(place.store.load(outcome.records[id(task)])["frequency"].max()) for task in bundles)


def _point(design: cost_design.Design, names: list[str]) -> Task:
    graph = Graph(design.scene, shown=False, recipe=design.recipe)
    return Task(
        stage="cost-point",
        scene=design.scene.name,
        part=design.key,
        run="stages.cost_point:run",
        params={"simulate": s4_simulate.params(design.scene), "quantities": names},
        inputs={f"bundle/{body}": task for body, task in graph.bundle.items()},
        modules=s4_simulate.modules(design.scene),
        folder="",
        exclusive=True,
    )


def _ensembles(scene: Scene) -> dict[str, Task]:
    """Ensembles at several tolerances, of a scene that has one."""
    found = {}
    for rtol in ENSEMBLES if scene.ensemble is not None else ():
        change = edited(scene, {"solver": {"rtol": rtol}, "accuracy": None})
        task = Graph(change, shown=False).ensemble
        assert task is not None
        found[f"ensemble:rtol {rtol:g}"] = task
    return found
