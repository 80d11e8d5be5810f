"""Stage 8: variants of a scene -> the effect size per quantity, and the effects that matter."""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Mapping, Sequence
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

    runs: ``own``, the scene's, and ``tight``, at a tighter tolerance (`variant_runs.measure`); empty without one.
    looser: the members' tolerance as a multiple of the scene's, to which their errors are proportional.
    """

    runs: Mapping[str, Task]
    looser: float = 1.0


def task(
    scene: Scene,
    chosen: Sequence[Quantity],
    variants: Mapping[Names, Scene],
    watched: Mapping[Hashable, Sequence[Task]],
    integrated: Integrated,
    **params: Any,
) -> Task:
    """Return the task of `run`.

    variants, watched: scenes and their tasks (`stages.variant_runs`), by the effects that they lack.  params:
    other ones of `run`.
    """
    gone = frozenset[str]().union(*variants)
    types = {name: joint.type for name, joint in scene.joint.items()}
    shared = {
        "title": scene.title,
        "looser": integrated.looser,
        "quantities": [q.written() for q in chosen],
        "units": [q.unit for q in chosen],
        "outputs": [scene.time.start, scene.output.interval],
        "variants": [sorted(names) for names in variants],
        "owners": [{kind: list(names) for kind, names in made.owners().items()} for made in variants.values()],
        "staying": [name for name in contacts_that_stay(types) if f"joint.{name}" not in gone],
    }
    inputs = {f"variant{k}/{n}": one for k, names in enumerate(variants) for n, one in enumerate(watched[names])}
    return Task(
        stage="effects",
        scene=scene.name,
        run="flexclear.stages.effect_study:run",
        params=shared | params,
        inputs={**inputs, **integrated.runs},
        code=("flexclear.post",),
        folder=f"effects/{scene.name.replace('/', '_')}",
        names={"nc": "effects.nc"},
    )


def run(params: Mapping[str, Any], inputs: Mapping[str, xr.Dataset], progress: Progress) -> dict[str, Any]:
    """Assemble ``effects.nc``, table and chart.

    params: those of `task`; `removed`, the effects that go with each one; `members`, their number with which each one
    is compared; `words` of each; those `undone`, in words; `added`, the effects (name, kind, within, joint) that are
    also added and combined in pairs. inputs: ``variant<k>/<n>``, as of `variant_runs.members`, and those of
    `Integrated`.
    """
    from flexclear.post.answers import effect_answer, effect_sizes

    chosen = [Quantity.read(data) for data in params["quantities"]]
    progress(None, "comparing")

    def pair(name: str, members: int) -> effect_sizes.Pair:
        gone = frozenset(params["removed"][name])
        full, without = (_point(params, inputs, names, chosen, members) for names in (frozenset[str](), gone))
        return effect_sizes.Pair(full, without, members)

    results = effect_sizes.assemble(
        {name: pair(name, members) for name, members in params["members"].items()},
        params["words"],
        chosen,
        params["units"],
        params["undone"],
        _times(params["outputs"], inputs),
        _error_of(params, inputs),
    )
    if added := [Effect(*text) for text in params["added"]]:
        every = [frozenset(names) for names in params["variants"]]
        points = {gone: _point(params, inputs, gone, chosen) for gone in every}
        results = effect_sizes.with_pairs(results, added, chosen, points, max(params["members"].values()))
    results.attrs["staying"] = effect_sizes.staying_contacts_sentence(params["staying"])
    listed = results.isel(effect=[k for k, words in enumerate(results["words"].values) if words])
    shown = listed.assign_coords(effect=listed["words"].values)
    drawn = effect_sizes.chart("effects", shown, f"Effect sizes: {params['title']}")
    return {"nc": results} | files("effects", effect_answer.table(results)) | drawn


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
        return float(params["looser"]) * quantities.error(own, tight, quantity, until)

    return error
