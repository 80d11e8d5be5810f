"""Scenes of plans, and what is known of their bodies before a plan decides."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import xarray as xr

from flexclear.commands.new import write
from flexclear.dynamics.linear.clearance_response import bound_effects
from flexclear.dynamics.linear.response import Response, response
from flexclear.dynamics.run.run import Run, integrate
from flexclear.scene import variants
from flexclear.scene.load import edited, load_scene
from flexclear.scene.quantity import Quantity
from flexclear.scene.schema import Scene
from flexclear.stages import effect_plan, simulation, variant_runs
from flexclear.stages.graph import Graph
from flexclear.stages.workplace import open_workplace
from flexclear.system.progress import silent

#: of the leg's rod [m, Pa, kg/m^3], and the mass of its platform [kg]
LENGTH, RADIUS, MODULUS, DENSITY, PLATFORM = 0.24, 0.01, 71.7e9, 2740.0, 3.0
GRAVITY = 9.81
#: acceleration with which a base starts under a rod [m/s^2]
START = 981.0


class Pilot(NamedTuple):
    """A scene with the run of its ideal twin, and what is known of its bodies."""

    scene: Scene
    ideal: Run
    inputs: dict[str, xr.Dataset]

    def bounds(self, *chosen: Quantity) -> Mapping[str, Mapping[str, float]]:
        return bound_effects(self.scene, self.ideal, chosen)

    def response(self, *chosen: Quantity) -> Response:
        """Of the flexible bodies."""
        return response(self.ideal, simulation.bundles(self.inputs), chosen)


def pilot(scene: Scene) -> Pilot:
    place, task = open_workplace(), effect_plan.task(edited(scene, {"accuracy": {"quantities": {}}}))
    outcome = place.bring(list(task.inputs.values()), 1)
    inputs = {name: place.store.load(outcome.records[below]) for name, below in task.inputs.items()}
    dropped = [e for e in variants.effects(scene) if not e.name.startswith("load.")]
    bare = variant_runs.plain(variants.without_effects(scene, dropped))
    rigid = {name: inputs[name] for name in Graph(bare, shown=False).bodies()}
    return Pilot(scene, integrate(simulation.rebuild(simulation.params(bare), rigid), {}, silent), inputs)


def standing_leg(tmp_path: Path) -> Scene:
    """The leg upright and at rest under its own weight."""
    scene = load_scene(write("leg", tmp_path)[0])
    law = {"type": "constant", "value": 0.0}
    return edited(scene, {"drive.stroke": {"joint": "slide", "law": law}, "time.end": 1e-3, "output.interval": 1e-4})
