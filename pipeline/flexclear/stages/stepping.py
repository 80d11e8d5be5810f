"""A motion in steps of its caller's, with the bodies of its scene brought up to date."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from flexclear.scene.load import with_numbers
from flexclear.scene.schema import Scene
from flexclear.stages import scenes, simulation
from flexclear.stages.graph import Graph
from flexclear.stages.workplace import Workplace

if TYPE_CHECKING:
    from flexclear.artifacts.labelled import Labelled
    from flexclear.dynamics.stepwise import Simulation


def begin(scene: Scene, workplace: Workplace) -> Simulation:
    """Return the simulation of a scene at its start.  Raises FlexclearError."""
    return of_parts(*parts(scene, workplace))


def parts(scene: Scene, workplace: Workplace) -> tuple[dict[str, Any], dict[str, Labelled]]:
    """Return a scene as `simulation.rebuild` takes it, and its bodies brought up to date.  Raises FlexclearError."""
    scenes.examine(scene)
    tasks = Graph(scene, shown=False).bodies()
    made = workplace.datasets(*tasks.values(), jobs=1) if tasks else []
    inputs: dict[str, Labelled] = dict(zip(tasks, made, strict=True))
    params = {**simulation.params(scene), "name": scene.name}
    simulation.check_parts(params)
    return params, inputs


def of_parts(
    params: Mapping[str, Any], inputs: Mapping[str, Labelled], changes: Mapping[str, object] | None = None
) -> Simulation:
    """Return the simulation of a scene's `parts`, with numbers at these paths changed."""
    from flexclear.dynamics.stepwise import Simulation

    scene = simulation.rebuild(params, inputs)
    return Simulation(with_numbers(scene, changes) if changes else scene, simulation.bundles(inputs))
