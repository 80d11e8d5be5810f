"""Stage 8: variants of a scene -> the effect size per quantity, and the effects that matter."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from flexclear.post.plotting.table import files
from flexclear.scene.quantity import Quantity
from flexclear.scene.variants import Effect, staying
from flexclear.workflow.task import Task

if TYPE_CHECKING:
    import xarray as xr

    from flexclear.artifacts.points import Point
    from flexclear.scene.schema import Scene
    from flexclear.system.progress import Progress

Names = frozenset[str]


def task(
    scene: Scene,
    effects: Sequence[Effect],
    chosen: Sequence[Quantity],
    variants: Mapping[Names, Scene],
    watched: Mapping[Names, Task],
    members: int,
) -> Task:
    """Return the task of all effect sizes. variants, watched: scenes and their tasks, by the effects that they lack."""
    params = {
        "effects": [[effect.name, effect.kind, effect.within, effect.joint] for effect in effects],
        "variants": [sorted(gone) for gone in watched],
        "owners": [_owners(variant) for variant in variants.values()],
        "members": members,
        "staying": _staying(scene, [effect.name for effect in effects]),
    }
    return _task("effects", scene, chosen, params, {f"variant{k}": made for k, made in enumerate(watched.values())})


def ranking(
    scene: Scene,
    chosen: Sequence[Quantity],
    words: Mapping[str, str],
    variants: Mapping[str, Scene],
    tasks: Mapping[tuple[str, int], Task],
    pairs: Mapping[str, int],
    undone: Sequence[str],
) -> Task:
    """Return the task that ranks the effects, each removed alone.

    words: description of each effect. variants: the scene without each effect, by its name (the full scene by the empty
    name). tasks: their tasks by name and number of members (`stages.watched_quantities`). pairs: number of members with
    which each effect is compared.
    """
    params = {
        "words": dict(words),
        "pairs": dict(pairs),
        "owners": {name: _owners(made) for name, made in variants.items()},
        "undone": ", ".join(undone),
        "staying": _staying(scene, pairs),
    }
    used = sorted({("", members) for members in pairs.values()} | set(pairs.items()))
    return _task(
        "effect_ranking", scene, chosen, params, {f"{name}:{members}": tasks[name, members] for name, members in used}
    )


def _task(
    stage: str, scene: Scene, chosen: Sequence[Quantity], params: Mapping[str, Any], inputs: Mapping[str, Task]
) -> Task:
    """Return a task of this module. stage: name of the function to call and of its files."""
    watched = {"quantities": [q.written() for q in chosen], "units": [q.unit for q in chosen]}
    return Task(
        stage=stage,
        scene=scene.name,
        run=f"flexclear.stages.effect_study:{stage}",
        params={"title": scene.title, **watched, **params},
        inputs=inputs,
        code=("flexclear.post",),
        folder=f"effects/{scene.name.replace('/', '_')}",
        names={"nc": f"{stage}.nc"},
    )


def _staying(scene: Scene, effects: Collection[str]) -> list[str]:
    names = staying({name: joint.type for name, joint in scene.joint.items()})
    return [name for name in names if f"joint.{name}" not in effects]


def _owners(scene: Scene) -> dict[str, list[str]]:
    return {kind: list(names) for kind, names in scene.owners().items()}


def effects(params: Mapping[str, Any], inputs: Mapping[str, xr.Dataset], progress: Progress) -> dict[str, Any]:
    """Assemble ``effects.nc``, its table and its chart. params: see `task`. inputs: ``variant<k>``, as in
    `watched_quantities`."""
    from flexclear.artifacts.effect_size import watched
    from flexclear.post.answers import effect_sizes

    all_effects = [Effect(*text) for text in params["effects"]]
    chosen = [Quantity.read(data) for data in params["quantities"]]
    points = {
        frozenset(gone): watched(inputs[f"variant{k}"], params["owners"][k], chosen)
        for k, gone in enumerate(params["variants"])
    }
    progress(None, "comparing")
    dataset = effect_sizes.assemble(all_effects, chosen, points, params["members"], params["units"])
    dataset.attrs["staying"] = effect_sizes.stay(params["staying"])
    result: dict[str, Any] = {"nc": dataset} | files("effects", effect_sizes.table(dataset))
    return result | effect_sizes.chart("effects", dataset, f"Effect sizes: {params['title']}")


def effect_ranking(params: Mapping[str, Any], inputs: Mapping[str, xr.Dataset], progress: Progress) -> dict[str, Any]:
    """Assemble ``effect_ranking.nc``, table and chart. params: see `ranking`. inputs: ``<effect>:<members>``."""
    from flexclear.artifacts.effect_size import watched
    from flexclear.post.answers import effect_ranking as ranked
    from flexclear.post.answers import effect_sizes

    chosen = [Quantity.read(data) for data in params["quantities"]]

    def point(name: str, members: int) -> Point:
        return watched(inputs[f"{name}:{members}"], params["owners"][name], chosen)

    pairs = {name: ranked.Pair(point("", n), point(name, n), n) for name, n in params["pairs"].items()}
    results = ranked.assemble(pairs, params["words"], chosen, params["units"], params["undone"])
    results.attrs["staying"] = effect_sizes.stay(params["staying"])
    result: dict[str, Any] = {"nc": results} | files("effect_ranking", ranked.table(results))
    listed = results.isel(effect=[k for k, words in enumerate(results["words"].values) if words])
    shown = listed.assign_coords(effect=listed["words"].values)
    return result | effect_sizes.chart("effect_ranking", shown, f"Effect sizes: {params['title']}")
