"""``flexclear compare``: scenes next to each other or their ideal mechanisms: differences, and each run's own error."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from flexclear.artifacts.store import publish
from flexclear.post.pages import Part, page
from flexclear.scene.schema import Scene
from flexclear.scene.variants import EFFECTS, ideal_scene, idealised_effects
from flexclear.stages.graph import Graph
from flexclear.stages.scenes import joint_folder_name, pictures, tables
from flexclear.stages.workplace import Made, Workplace, check, open_workplace
from flexclear.study import members
from flexclear.system.errors import InputError, of_trial
from flexclear.workflow.task import Task

if TYPE_CHECKING:
    import xarray as xr

#: what `--ideal` removes: everything at once, one effect, or one after the other
IDEAL = ("both", *EFFECTS, "each")
#: files that the page of a comparison shows: pictures with their captions, then tables
PICTURES = {"compare.png": ("Watched quantities, and their distance from the reference",)}
TABLES = ("differences.md", "costs.md")


def compare_scenes(scenes: list[Scene], workplace: Workplace, without: str | None = None) -> Made:
    """Run scenes, their ideal mechanisms, and all of these at tighter tolerances; return the comparison and its page.

    without: one of IDEAL, or None for the scenes alone.  Raises InputError.
    """
    sides = [side for scene in scenes for side in (*ideal_scenes(scene, without), scene)] if without else scenes
    if len(sides) < 2:
        raise InputError(
            sides[0].name if sides else "compare",
            "a single scene has no other to compare with",
            "name several, or compare it with its ideal mechanism: --ideal",
        )
    names = [side.name for side in sides]
    labels = [name if names.count(name) == 1 else f"{name} ({k + 1})" for k, name in enumerate(names)]
    graphs = {label: Graph(side, shown=side in scenes) for label, side in zip(labels, sides, strict=True)}
    runs = workplace.bring([graph.simulate for graph in graphs.values()])
    check(runs)
    chosen = [q for side in sides for q in side.watched_quantities()]
    tight = dict[str, Task]()
    for label, graph in graphs.items():
        task = members.tighter_run(graph.scene, members.setting_of(graph.scene, workplace), chosen)
        if task is not None:
            tight[label] = task
    outcome = workplace.bring(list(tight.values()))
    refused = {
        task: str(made.dataset().attrs.get("refused", "")) for task, made in workplace.artifacts(outcome).items()
    }
    for message in (*(failure.message for failure in outcome.failures), *filter(None, refused.values())):
        workplace.monitor.say(f"no error can be determined: {of_trial(message)}")
    (made,) = workplace.made(_task(graphs, {label: task for label, task in tight.items() if refused.get(task) == ""}))
    title = f"Compared: {', '.join(graphs)}"
    publish(made.folder / "index.html", page(title, "The first run is the reference.", parts(made)))
    return made


def dataset(scenes: list[Scene], without: str | None = None) -> xr.Dataset:
    """Return the comparison that `compare_scenes` makes, as a dataset that shows it in a notebook."""
    from flexclear.post.answers.answered import with_answer

    made = compare_scenes(scenes, open_workplace(), without)
    data, picture = made.dataset(), next(iter(PICTURES))
    names = ", ".join(map(str, data["run"].values))
    drawn = made.read(picture) if picture in made.record.files else None
    return with_answer(data, f"Compared: {names}", drawn, tables(made, *TABLES))


def ideal_scenes(scene: Scene, without: str) -> list[Scene]:
    """Return the scene without the effects of `without`, the most ideal one first; InputError where nothing can go."""
    sets = {"both": (tuple(EFFECTS),), "each": (tuple(EFFECTS), *((effect,) for effect in EFFECTS))}
    ideals: list[Scene] = []
    for effects in sets.get(without, ((without,),)):
        if idealised_effects(scene, effects) or not ideals:
            made = ideal_scene(scene, effects)
            same = any(made.model_dump() == other.model_dump() for other in ideals)
            made._name = f"{scene.name} {'ideal' if len(effects) == len(EFFECTS) else EFFECTS[effects[0]]}"
            ideals += [] if same else [made]
    return ideals


def parts(made: Made) -> list[Part]:
    """Return the sections of a page that show a comparison."""
    return [
        Part("differences", "Differences and errors", tables(made, *TABLES)),
        Part("runs", "Side by side", pictures(made, PICTURES)),
    ]


def _task(graphs: Mapping[str, Graph], tight: Mapping[str, Task]) -> Task:
    quantities = {q.name: q.to_json() for graph in graphs.values() for q in graph.scene.watched_quantities()}
    labels = list(graphs)
    inputs = {f"run{k}": graphs[label].simulate for k, label in enumerate(labels)}
    inputs |= {f"tight{k}": tight[label] for k, label in enumerate(labels) if label in tight}
    params, folder = {"labels": labels, "quantities": list(quantities.values())}, joint_folder_name(labels)
    return members.comparing_task("compare", labels[-1], params, inputs, "evaluation:comparison", folder)
