"""Stage 8: variants of a scene -> the effect size per quantity, and the effects that matter."""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from flexclear.post.plotting.table import Table, files
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
    stage: str,
    scene: Scene,
    chosen: Sequence[Quantity],
    variants: Mapping[Names, Scene],
    watched: Mapping[Hashable, Sequence[Task]],
    integrated: Integrated,
    **params: Any,
) -> Task:
    """Return a task of this module.

    stage: name of its function, `effects` or `effect_ranking`, and of its files.  variants, watched: scenes and their
    tasks (`stages.watched_quantities`), by the effects that they lack.  params: those of the function.
    """
    gone = frozenset[str]().union(*variants)
    types = {name: joint.type for name, joint in scene.joint.items()}
    shared = {
        "title": scene.title,
        "looser": integrated.looser,
        "quantities": [q.to_json() for q in chosen],
        "units": [q.unit for q in chosen],
        "outputs": [scene.time.start, scene.output.interval],
        "variants": [sorted(names) for names in variants],
        "owners": [{kind: list(names) for kind, names in made.owners().items()} for made in variants.values()],
        "staying": [name for name in contacts_that_stay(types) if f"joint.{name}" not in gone],
    }
    inputs = {f"variant{k}/{n}": one for k, names in enumerate(variants) for n, one in enumerate(watched[names])}
    return Task(
        stage=stage,
        scene=scene.name,
        run=f"flexclear.stages.effect_study:{stage}",
        params=shared | params,
        inputs={**inputs, **integrated.runs},
        code=("flexclear.post",),
        folder=f"effects/{scene.name.replace('/', '_')}",
        names={"nc": f"{stage}.nc"},
    )


def effects(params: Mapping[str, Any], inputs: Mapping[str, xr.Dataset], progress: Progress) -> dict[str, Any]:
    """Assemble ``effects.nc``, its table and its chart: each effect alone and in pairs.

    params: those of `task`; `effects` (name, kind, within, joint) and the number of `members`. inputs:
    ``variant<k>/<n>``, as in `watched_quantities`, and those of `Integrated`.
    """
    from flexclear.post.answers import effect_sizes

    chosen = [Quantity.from_json(data) for data in params["quantities"]]
    every = [frozenset(names) for names in params["variants"]]
    points = {gone: _point(params, inputs, gone, chosen) for gone in every}
    progress(None, "comparing")
    dataset = effect_sizes.assemble(
        [Effect(*text) for text in params["effects"]],
        chosen,
        points,
        params["members"],
        params["units"],
        _times(params["outputs"], inputs),
        _error_of(params, inputs),
    )
    return _files("effects", dataset, effect_sizes.table, dataset, params)


def effect_ranking(params: Mapping[str, Any], inputs: Mapping[str, xr.Dataset], progress: Progress) -> dict[str, Any]:
    """Assemble ``effect_ranking.nc``, table and chart: each effect removed alone.

    params: those of `task`; `removed`, the effects that go with each one; `pairs`, the number of members with which
    each one is compared; `words` of each; those `undone`, in words. inputs: as of `effects`.
    """
    from flexclear.post.answers import effect_ranking as ranked

    chosen = [Quantity.from_json(data) for data in params["quantities"]]

    def pair(name: str, members: int) -> ranked.Pair:
        gone = frozenset(params["removed"][name])
        full, without = (_point(params, inputs, names, chosen, members) for names in (frozenset[str](), gone))
        return ranked.Pair(full, without, members)

    results = ranked.assemble(
        {name: pair(name, members) for name, members in params["pairs"].items()},
        params["words"],
        chosen,
        params["units"],
        params["undone"],
        _times(params["outputs"], inputs),
        _error_of(params, inputs),
    )
    listed = results.isel(effect=[k for k, words in enumerate(results["words"].values) if words])
    shown = listed.assign_coords(effect=listed["words"].values)
    return _files("effect_ranking", results, ranked.table, shown, params)


def _files(
    name: str,
    dataset: xr.Dataset,
    table: Callable[[xr.Dataset], Table],
    shown: xr.Dataset,
    params: Mapping[str, Any],
) -> dict[str, Any]:
    """Return the files of a result. shown: the dataset of the chart."""
    from flexclear.post.answers.effect_sizes import chart, staying_contacts_sentence

    dataset.attrs["staying"] = staying_contacts_sentence(params["staying"])
    return {"nc": dataset} | files(name, table(dataset)) | chart(name, shown, f"Effect sizes: {params['title']}")


def _point(
    params: Mapping[str, Any],
    inputs: Mapping[str, xr.Dataset],
    gone: Names,
    chosen: Sequence[Quantity],
    members: float = math.inf,
) -> Point:
    """Return the point of the first members, all by default, of the variant without some effects."""
    from flexclear.artifacts.effect_size import point_of_members

    k = [frozenset(names) for names in params["variants"]].index(gone)
    used: list[xr.Dataset] = []
    known = 0
    while f"variant{k}/{len(used)}" in inputs and (known < members or not used):
        used.append(inputs[f"variant{k}/{len(used)}"])
        known += int(used[-1].attrs["members"])
    return point_of_members(used, params["owners"][k], chosen)


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
        if (
            own is None
            or tight is None
            or not quantities.has_quantity(own, quantity)
            or not quantities.has_quantity(tight, quantity)
        ):
            return 0.0
        return float(params["looser"]) * quantities.largest_distance(own, tight, quantity, until)

    return error
