"""Next to stage 4: a scene with `[accuracy]` -> the effects that the requested accuracy requires."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from flexclear.post.plotting.table import files
from flexclear.scene import variants
from flexclear.scene.load import edited
from flexclear.scene.parts import FlexibleBody, RatioPerMode
from flexclear.scene.toml_files import read_toml
from flexclear.stages import simulation
from flexclear.stages.graph import Graph
from flexclear.workflow.task import Task

if TYPE_CHECKING:
    import xarray as xr

    from flexclear.scene.schema import Scene
    from flexclear.system.progress import Progress

#: inputs ``fewer/<level>/<body>`` are bundles of fewer modes
FEWER = "fewer/"
#: reference condition with static modes, six for each interface but one; reference conditions without static modes
WITH_STATIC, DIRECTIONS = "craig-bampton", 6
NORMAL = ("free-free", "fixed-fixed", "cantilever")
#: modes of rods come in pairs; halving the number of modes is tried only from this number on
PAIR, LEAST_HALVED = 2, 4


def task(scene: Scene, *, watched: bool = False) -> Task:
    """Return the task that plans a scene; its artifact is shown as ``plan.nc``. watched: as of `plan`."""
    rigid = edited(
        variants.without_effects(
            scene, [effect for effect in variants.effects(scene) if effect.name.startswith("body.")]
        ),
        {"accuracy": None},
    )
    whole = Graph(edited(scene, {"accuracy": None}), shown=False)
    inputs = whole.bodies() | Graph(rigid, shown=False).bodies()
    for k, counts in enumerate(levels(scene)):
        with_fewer = Graph(edited(variants.with_modes(scene, counts), {"accuracy": None}), shown=False)
        inputs |= {f"{FEWER}{k}/{body}": with_fewer.bundle[body] for body in counts}
    simulate = simulation.params(scene)
    return Task(
        stage="plan",
        scene=scene.name,
        run="flexclear.stages.effect_plan:run",
        params={
            "simulate": simulate,
            "title": scene.title,
            "units": {q.name: q.unit for q in scene.requested_quantities()},
            "watched": watched,
        },
        context={"name": scene.name, "limits": scene.limits.as_table()},
        inputs=inputs,
        code=(*simulation.CODE, "flexclear.post"),
        folder=f"plan/{scene.name.replace('/', '_')}",
        names={"nc": "plan.nc"},
    )


def levels(scene: Scene) -> tuple[dict[str, int], ...]:
    """Return reduced numbers of modes to try, by body, the fewest first; bodies without fewer modes are absent.

    A basis with static modes is tried with these alone, and with half of the others, in pairs, as rods bend in two
    planes; a basis of normal modes alone with half of them.
    """
    fewest, half = dict[str, int](), dict[str, int]()
    for name, body in scene.flexible().items():
        count, static = body.modes.count, _static(body)
        if isinstance(body.damping, RatioPerMode):
            continue  # one damping ratio per mode fits one number of modes only
        if static and not (isinstance(count, int) and count <= static):
            fewest[name] = static
        if isinstance(count, int) and static is not None and count - static >= LEAST_HALVED:
            half[name] = static + PAIR * round((count - static) / (2 * PAIR))
    return tuple(level for level in ((fewest, fewest | half) if half else (fewest,)) if level)


def _static(body: FlexibleBody) -> int | None:
    """Return the number of static modes in a body's basis; None where it is not known beforehand."""
    if body.modes.reference in NORMAL:
        return 0
    if body.modes.reference != WITH_STATIC:
        return None
    ends = body.modes.interfaces or read_toml(Path(body.mesh)).get("interfaces", ())
    return DIRECTIONS * (len(ends) - 1) if len(ends) > 1 else None


def run(params: Mapping[str, Any], inputs: Mapping[str, xr.Dataset], progress: Progress) -> dict[str, Any]:
    """Return ``plan.nc`` with all decisions, its table and its chart; inputs are bundles, as in `task`."""
    from flexclear.post.answers import plan as shown
    from flexclear.post.answers.effect_sizes import chart, staying_contacts_sentence

    dataset = shown.dataset(decide_plan(params, inputs, progress), params["title"], params["units"])
    types = {name: joint["type"] for name, joint in params["simulate"]["scene"]["joint"].items()}
    dataset.attrs["staying"] = staying_contacts_sentence(variants.contacts_that_stay(types))
    progress(None, "chart")
    requested = dict(zip(dataset["quantity"].values.tolist(), dataset["requested"].values.tolist(), strict=True))
    result: dict[str, Any] = {"nc": dataset} | files("plan", shown.table(dataset))
    return result | chart("plan", shown.upper_bounds(dataset), f"Effects that matter: {params['title']}", requested)


def decide_plan(params: Mapping[str, Any], inputs: Mapping[str, xr.Dataset], progress: Progress) -> Any:
    """Search the plan of the scene (`core.scene.plan_decisions.Plan`)."""
    from flexclear.dynamics.plan.search import plan

    rigid = {name: data for name, data in inputs.items() if name.startswith(simulation.RIGID)}
    fewer = fewer_modes(inputs)

    def with_rigid_numbers(scene: Scene) -> Scene:
        """Return the scene with the numbers of the rigid bodies that recipes describe."""
        of_scene = {
            name: data for name, data in rigid.items() if name.removeprefix(simulation.RIGID) in scene.meshed_bodies()
        }
        return simulation.rebuild(simulation.params(scene), of_scene)

    bodies = params["simulate"]["scene"]["body"]  # types as in the scene itself, before any body is made rigid
    own = {name: data for name, data in rigid.items() if bodies[name.removeprefix(simulation.RIGID)]["type"] == "rigid"}
    scene = simulation.rebuild(params["simulate"] | {"name": params.get("name", "scene")}, own)
    watched = params.get("watched", False)
    return plan(scene, simulation.bundles(inputs), fewer, with_rigid_numbers, progress, watched)


def fewer_modes(inputs: Mapping[str, xr.Dataset]) -> list[dict[str, xr.Dataset]]:
    """Return the bundles of fewer modes by level, the fewest first, and body; bodies without fewer modes are absent."""
    fewer: dict[int, dict[str, xr.Dataset]] = {}
    for name, data in inputs.items():
        if name.startswith(FEWER):
            level, _, body = name.removeprefix(FEWER).partition("/")
            if data.sizes["mode"] < inputs[f"bundle/{body}"].sizes["mode"]:
                fewer.setdefault(int(level), {})[body] = data
    return [fewer[level] for level in sorted(fewer)]
