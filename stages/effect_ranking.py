"""Stage 8: the scene and the scene without each effect, over members -> which effects matter."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from flexclear.pipeline.core.workflow.task import Task

if TYPE_CHECKING:
    import xarray as xr

    from flexclear.pipeline.core.scene.quantity import Quantity
    from flexclear.pipeline.core.scene.schema import Scene
    from flexclear.pipeline.core.system.progress import Progress


def task(
    scene: Scene,
    chosen: Sequence[Quantity],
    words: Mapping[str, str],
    variants: Mapping[str, Scene],
    tasks: Mapping[tuple[str, int], Task],
    pairs: Mapping[str, int],
    undone: Sequence[str],
) -> Task:
    """The task of the answer.

    words: of the effects.  variants: the scene without each effect, by its name (the full one by the empty name).
    tasks: of these by name and number of members (`stages.watched_quantities`).  pairs: members with which each effect
    is compared.
    """
    used = {("", members) for members in pairs.values()} | set(pairs.items())
    return Task(
        stage="matters",
        scene=scene.name,
        run="flexclear.stages.effect_ranking:run",
        params={
            "title": scene.title,
            "quantities": [q.written() for q in chosen],
            "units": [q.unit for q in chosen],
            "words": dict(words),
            "pairs": dict(pairs),
            "owners": {name: {k: list(v) for k, v in made.owners().items()} for name, made in variants.items()},
            "undone": ", ".join(undone),
        },
        inputs={f"{name}:{members}": tasks[name, members] for name, members in sorted(used)},
        folder=f"effects/{scene.name.replace('/', '_')}",
        names={"nc": "matters.nc"},
    )


def run(params: Mapping[str, Any], inputs: Mapping[str, xr.Dataset], progress: Progress) -> dict[str, Any]:
    """``matters.nc``, its table and its chart.  params: see `task`.  inputs: ``<effect>:<members>``."""
    from flexclear.pipeline.core.artifacts import effect_size
    from flexclear.pipeline.core.artifacts.points import unpacked
    from flexclear.pipeline.core.scene.quantity import Quantity
    from flexclear.pipeline.post.answers import effect_sizes, matters
    from flexclear.pipeline.post.plotting.table import files

    chosen = [Quantity.read(data) for data in params["quantities"]]

    def point(name: str, members: int) -> Any:
        recorded = effect_size.recorded(params["owners"][name], chosen)
        return unpacked(inputs[f"{name}:{members}"], recorded)["point"]

    pairs = {name: matters.Pair(point("", n), point(name, n), n) for name, n in params["pairs"].items()}
    results = matters.assemble(pairs, params["words"], chosen, params["units"], params["undone"])
    result: dict[str, Any] = {"nc": results} | files("matters", matters.table(results))
    listed = results.isel(effect=[k for k, words in enumerate(results["words"].values) if words])
    shown = listed.assign_coords(effect=listed["words"].values)
    return result | effect_sizes.chart("matters", shown, f"What each effect does: {params['title']}")
