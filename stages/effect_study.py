"""Stage 8: variants of a scene -> what each effect does to each quantity."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from flexclear.pipeline.core.scene.variants import Effect
from flexclear.pipeline.core.workflow.task import Task

if TYPE_CHECKING:
    import xarray as xr

    from flexclear.pipeline.core.scene.quantity import Quantity
    from flexclear.pipeline.core.scene.schema import Scene
    from flexclear.pipeline.core.system.progress import Progress

Names = frozenset[str]


def task(
    scene: Scene,
    effects: Sequence[Effect],
    chosen: Sequence[Quantity],
    variants: Mapping[Names, Scene],
    watched: Mapping[Names, Task],
    members: int,
) -> Task:
    """The task of all differences.  variants, watched: the scenes by the effects that they lack, and their tasks."""
    return Task(
        stage="effects",
        scene=scene.name,
        run="flexclear.stages.effect_study:run",
        params={
            "scene": scene.name,
            "title": scene.title,
            "effects": [[effect.name, effect.kind, effect.within] for effect in effects],
            "quantities": [q.written() for q in chosen],
            "units": [q.unit for q in chosen],
            "variants": [sorted(gone) for gone in watched],
            "owners": [{k: list(v) for k, v in variant.owners().items()} for variant in variants.values()],
            "members": members,
        },
        inputs={f"variant{k}": made for k, made in enumerate(watched.values())},
        folder=f"effects/{scene.name.replace('/', '_')}",
        names={"nc": "effects.nc"},
    )


def run(params: Mapping[str, Any], inputs: Mapping[str, xr.Dataset], progress: Progress) -> dict[str, Any]:
    """``effects.nc``, its table and its chart.  params: see `task`.  inputs: ``variant<k>``, as of
    `watched_quantities`."""
    from flexclear.pipeline.core.artifacts import effect_size
    from flexclear.pipeline.core.artifacts.points import unpacked
    from flexclear.pipeline.core.scene.quantity import Quantity
    from flexclear.pipeline.post.answers import effect_sizes
    from flexclear.pipeline.post.plotting.table import files

    effects = [Effect(*three) for three in params["effects"]]
    chosen = [Quantity.read(data) for data in params["quantities"]]
    points = {}
    for k, gone in enumerate(params["variants"]):
        recorded = effect_size.recorded(params["owners"][k], chosen)
        points[frozenset(gone)] = unpacked(inputs[f"variant{k}"], recorded)["point"]
    progress(None, "comparing")
    dataset = effect_sizes.assemble(effects, chosen, points, params["members"], params["units"])
    title = f"What each effect does: {params['title']}"
    result: dict[str, Any] = {"nc": dataset} | files("effects", effect_sizes.table(dataset))
    return result | effect_sizes.chart("effects", dataset, title)


def page(scene: Scene, words: str, picture: bytes) -> bytes:
    """The page of the table and the chart."""
    from flexclear.pipeline.post.pages import Part, media
    from flexclear.pipeline.post.pages import page as written
    from flexclear.pipeline.post.plotting.table import as_html, from_markdown

    parts = [
        Part("chart", "Chart", media("effects.png", picture, "Each effect alone")),
        Part("table", "Table", as_html(from_markdown(words))),
    ]
    lead = "Every effect of the scene taken away and put in, alone and in pairs."
    return written(f"Effects: {scene.title}", lead, parts)
