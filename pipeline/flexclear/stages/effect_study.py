"""Stage 8: variants of a scene -> the effect size per quantity, and the effects that matter."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Hashable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from flexclear.post.plotting.table import files
from flexclear.scene.quantity import Quantity
from flexclear.scene.variants import Effect, contacts_that_stay
from flexclear.workflow.task import Task

if TYPE_CHECKING:
    import xarray as xr

    from flexclear.artifacts.points import Point
    from flexclear.scene.schema import Scene
    from flexclear.system.progress import Progress

Names = frozenset[str]


@dataclass(frozen=True)
class Integrated:
    """Runs whose distance is the error of the time integration of members.

    runs: ``own``, the scene's, and ``tight``, at a tighter tolerance (`stages.cost_point`); empty without one.
    looser: the members' tolerance as a multiple of the scene's, to which their errors are proportional.
    """

    runs: Mapping[str, Task]
    looser: float = 1.0


def task(
    scene: Scene,
    effects: Sequence[Effect],
    chosen: Sequence[Quantity],
    variants: Mapping[Names, Scene],
    watched: Mapping[Hashable, Sequence[Task]],
    members: int,
    integrated: Integrated,
) -> Task:
    """Return the task of all effect sizes. variants, watched: scenes and their tasks, by the effects that they lack."""
    params = {
        "effects": [[effect.name, effect.kind, effect.within, effect.joint] for effect in effects],
        "variants": [sorted(gone) for gone in variants],
        "owners": [_owners(variant) for variant in variants.values()],
        "members": members,
        "staying": _staying(scene, [effect.name for effect in effects]),
    }
    inputs = {f"variant{k}/{n}": one for k, gone in enumerate(variants) for n, one in enumerate(watched[gone])}
    return _task("effects", scene, chosen, params, inputs, integrated)


def ranking(
    scene: Scene,
    chosen: Sequence[Quantity],
    words: Mapping[str, str],
    variants: Mapping[str, Scene],
    tasks: Mapping[Hashable, Sequence[Task]],
    pairs: Mapping[str, int],
    undone: Sequence[str],
    integrated: Integrated,
) -> Task:
    """Return the task that ranks the effects, each removed alone.

    words: description of each effect. variants: the scene without each effect, by its name (the full scene by the empty
    name). tasks: their tasks by name (`stages.watched_quantities`). pairs: number of members with which each effect is
    compared.
    """
    params = {
        "words": dict(words),
        "pairs": dict(pairs),
        "owners": {name: _owners(made) for name, made in variants.items()},
        "undone": ", ".join(undone),
        "staying": _staying(scene, pairs),
    }
    inputs = {f"{name}/{n}": one for name in ("", *pairs) for n, one in enumerate(tasks[name])}
    return _task("effect_ranking", scene, chosen, params, inputs, integrated)


def _task(
    stage: str,
    scene: Scene,
    chosen: Sequence[Quantity],
    params: Mapping[str, Any],
    inputs: Mapping[str, Task],
    integrated: Integrated,
) -> Task:
    """Return a task of this module. stage: name of the function to call and of its files."""
    watched = {"quantities": [q.written() for q in chosen], "units": [q.unit for q in chosen]}
    outputs = {"outputs": [scene.time.start, scene.output.interval]}
    return Task(
        stage=stage,
        scene=scene.name,
        run=f"flexclear.stages.effect_study:{stage}",
        params={"title": scene.title, "looser": integrated.looser, **watched, **outputs, **params},
        inputs={**inputs, **integrated.runs},
        code=("flexclear.post",),
        folder=f"effects/{scene.name.replace('/', '_')}",
        names={"nc": f"{stage}.nc"},
    )


def _staying(scene: Scene, effects: Collection[str]) -> list[str]:
    names = contacts_that_stay({name: joint.type for name, joint in scene.joint.items()})
    return [name for name in names if f"joint.{name}" not in effects]


def _owners(scene: Scene) -> dict[str, list[str]]:
    return {kind: list(names) for kind, names in scene.owners().items()}


def effects(params: Mapping[str, Any], inputs: Mapping[str, xr.Dataset], progress: Progress) -> dict[str, Any]:
    """Assemble ``effects.nc``, its table and its chart. params: see `task`. inputs: ``variant<k>/<n>``, as in
    `watched_quantities`, and those of `Integrated`."""
    from flexclear.post.answers import effect_sizes

    all_effects = [Effect(*text) for text in params["effects"]]
    chosen = [Quantity.read(data) for data in params["quantities"]]
    points = {
        frozenset(gone): _point(inputs, f"variant{k}", params["owners"][k], chosen)
        for k, gone in enumerate(params["variants"])
    }
    progress(None, "comparing")
    times, error = _times(params["outputs"], inputs), _error_of(params, inputs)
    dataset = effect_sizes.assemble(all_effects, chosen, points, params["members"], params["units"], times, error)
    dataset.attrs["staying"] = effect_sizes.stay(params["staying"])
    result: dict[str, Any] = {"nc": dataset} | files("effects", effect_sizes.table(dataset))
    return result | effect_sizes.chart("effects", dataset, f"Effect sizes: {params['title']}")


def _point(
    inputs: Mapping[str, xr.Dataset],
    name: str,
    owners: Mapping[str, list[str]],
    chosen: Sequence[Quantity],
    members: float = math.inf,
) -> Point:
    """Return the point of a variant's first members, all by default, from the inputs ``<name>/<n>``."""
    from flexclear.artifacts.effect_size import watched

    used: list[xr.Dataset] = []
    known = 0
    while f"{name}/{len(used)}" in inputs and (known < members or not used):
        used.append(inputs[f"{name}/{len(used)}"])
        known += int(used[-1].attrs["members"])
    return watched(used, owners, chosen)


def _times(outputs: Sequence[float], inputs: Mapping[str, xr.Dataset]) -> list[float]:
    """Return the times of the outputs [s]. outputs: the first one and their interval."""
    start, interval = outputs
    return [
        start + interval * k for k in range(max((int(one.sizes.get("time", 0)) for one in inputs.values()), default=0))
    ]


def _error_of(params: Mapping[str, Any], inputs: Mapping[str, xr.Dataset]) -> Callable[[Quantity, float], float]:
    """Return the function that estimates the error of a member's time integration in a quantity up to a time [s]."""
    from flexclear.artifacts import quantities

    def error(quantity: Quantity, until: float) -> float:
        own, tight = inputs.get("own"), inputs.get("tight")
        if own is None or tight is None or not quantities.has(own, quantity) or not quantities.has(tight, quantity):
            return 0.0
        return float(params["looser"]) * quantities.error(own, tight, quantity, until)

    return error


def effect_ranking(params: Mapping[str, Any], inputs: Mapping[str, xr.Dataset], progress: Progress) -> dict[str, Any]:
    """Assemble ``effect_ranking.nc``, table and chart. params: see `ranking`. inputs: ``<effect>/<n>``, and
    those of `Integrated`."""
    from flexclear.post.answers import effect_ranking as ranked
    from flexclear.post.answers import effect_sizes

    chosen = [Quantity.read(data) for data in params["quantities"]]

    def point(name: str, members: int) -> Point:
        return _point(inputs, name, params["owners"][name], chosen, members)

    pairs = {name: ranked.Pair(point("", n), point(name, n), n) for name, n in params["pairs"].items()}

    times, error = _times(params["outputs"], inputs), _error_of(params, inputs)
    results = ranked.assemble(pairs, params["words"], chosen, params["units"], params["undone"], times, error)
    results.attrs["staying"] = effect_sizes.stay(params["staying"])
    result: dict[str, Any] = {"nc": results} | files("effect_ranking", ranked.table(results))
    listed = results.isel(effect=[k for k, words in enumerate(results["words"].values) if words])
    shown = listed.assign_coords(effect=listed["words"].values)
    return result | effect_sizes.chart("effect_ranking", shown, f"Effect sizes: {params['title']}")
