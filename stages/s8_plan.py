"""Beside stage 4: a scene with `[accuracy]` -> which of its effects that calls for."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from flexclear.pipeline.core.scene import variants
from flexclear.pipeline.core.scene.load import edited
from flexclear.pipeline.core.workflow.task import Task
from flexclear.stages import s3_rigid, s4_simulate
from flexclear.stages.graph import Graph

if TYPE_CHECKING:
    import xarray as xr

    from flexclear.pipeline.core.progress import Progress
    from flexclear.pipeline.core.scene.schema import Scene

#: inputs that are bundles of fewer modes
FEWER = "fewer/"
#: reference conditions with static modes between interfaces, six for each but one
WITH_STATIC = "craig-bampton"


def task(scene: Scene) -> Task:
    """The plan of a scene; shown as ``plan.nc``."""
    rigid = edited(
        variants.without(scene, [effect for effect in variants.effects(scene) if effect.name.startswith("body.")]),
        {"accuracy": None},
    )
    whole = Graph(edited(scene, {"accuracy": None}), shown=False)
    inputs = whole.bodies() | Graph(rigid, shown=False).bodies()
    counts = static_counts(scene)
    if counts:
        less = Graph(edited(variants.with_modes(scene, counts), {"accuracy": None}), shown=False)
        inputs |= {f"{FEWER}{body}": less.bundle[body] for body in counts}
    simulate = s4_simulate.params(scene)
    return Task(
        stage="plan",
        scene=scene.name,
        run="flexclear.stages.s8_plan:run",
        params={"simulate": simulate, "title": scene.title},
        context={"name": scene.name, "limits": scene.limits.written()},
        inputs=inputs,
        modules=s4_simulate.modules(scene),
        folder=f"plan/{scene.name.replace('/', '_')}",
        names={"nc": "plan.nc"},
    )


def static_counts(scene: Scene) -> dict[str, int]:
    """Bodies that have more than static modes: how many they would keep with these alone."""
    found = {}
    for name, body in scene.flexible().items():
        modes = body.modes
        if modes.reference != WITH_STATIC or modes.interfaces is None or not isinstance(modes.count, int):
            continue
        static = 6 * (len(modes.interfaces) - 1)
        # a ratio of damping for each mode fits one number of modes only
        if 0 < static < modes.count and (body.damping is None or isinstance(body.damping, float)):
            found[name] = static
    return found


def run(params: Mapping[str, Any], inputs: Mapping[str, xr.Dataset], progress: Progress) -> dict[str, Any]:
    """``plan.nc`` with all decisions, the table of them and the chart; inputs are bundles, as of `task`."""
    from flexclear.pipeline.post import plan as shown
    from flexclear.pipeline.post.influences import chart
    from flexclear.pipeline.post.plotting.table import files

    found = shown.dataset(decided(params, inputs, progress), params["title"])
    progress(None, "chart")
    wanted = dict(zip(found["quantity"].values.tolist(), found["wanted"].values.tolist(), strict=True))
    result: dict[str, Any] = {"nc": found} | files("plan", shown.table(found))
    return result | chart("plan", shown.drawn(found), f"What the accuracy calls for: {params['title']}", wanted)


def decided(params: Mapping[str, Any], inputs: Mapping[str, xr.Dataset], progress: Progress) -> Any:
    """The plan (`core.decisions.Plan`)."""
    from flexclear.pipeline.dynamics.plan.search import plan

    rigid = {name: data for name, data in inputs.items() if name.startswith(s3_rigid.PREFIX)}
    fewer = {name.removeprefix(FEWER): data for name, data in inputs.items() if name.startswith(FEWER)}

    def filled(scene: Scene) -> Scene:
        """With the rigid bodies that recipes describe."""
        mine = {name: data for name, data in rigid.items() if name.removeprefix(s3_rigid.PREFIX) in scene.meshed()}
        return s4_simulate.rebuild(s4_simulate.params(scene), mine)

    own = {name: data for name, data in rigid.items() if _meshed(params["simulate"], name)}
    scene = s4_simulate.rebuild(params["simulate"] | {"name": params.get("name", "scene")}, own)
    return plan(scene, s4_simulate.bundles(inputs), fewer, filled, progress)


def _meshed(simulate: Mapping[str, Any], name: str) -> bool:
    """Whether a body that a recipe describes is rigid in the scene itself."""
    return bool(simulate["scene"]["body"][name.removeprefix(s3_rigid.PREFIX)]["type"] == "rigid")


def from_dataset(found: xr.Dataset) -> dict[str, Any]:
    """What of a plan makes its scene: names of effects that go, modes, integrator and tolerance."""
    told: dict[str, Any] = json.loads(found.attrs["planned"])
    return told
