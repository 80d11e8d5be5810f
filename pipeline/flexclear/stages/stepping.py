"""A motion in steps of its caller's, with the bodies of its scene brought up to date."""

from __future__ import annotations

from typing import TYPE_CHECKING

from flexclear.scene.schema import Scene
from flexclear.stages import scenes, simulation
from flexclear.stages.graph import Graph
from flexclear.stages.workplace import Workplace

if TYPE_CHECKING:
    from flexclear.dynamics.stepwise import Simulation


def begin(scene: Scene, workplace: Workplace) -> Simulation:
    """Return the simulation of a scene at its start.  Raises FlexclearError."""
    from flexclear.dynamics.stepwise import Simulation

    scenes.examine(scene)
    tasks = Graph(scene, shown=False).bodies()
    inputs = dict(zip(tasks, workplace.datasets(*tasks.values(), jobs=1), strict=True)) if tasks else {}
    params = {**simulation.params(scene), "name": scene.name}
    simulation.check_parts(params)
    return Simulation(simulation.rebuild(params, inputs), simulation.bundles(inputs))
