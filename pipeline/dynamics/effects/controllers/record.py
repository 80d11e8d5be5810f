"""Forces and integral parts of controllers, for the run dataset."""

from __future__ import annotations

from flexclear.pipeline.core.artifacts.coordinates import motion
from flexclear.pipeline.core.scene.loads import Pid, SampledPid
from flexclear.pipeline.dynamics import memory as m
from flexclear.pipeline.dynamics.effects.controllers.sampled_pid import INTEGRAL
from flexclear.pipeline.dynamics.equations.observation import Observed, Series
from flexclear.pipeline.dynamics.model.model import Model
from flexclear.pipeline.dynamics.record.loads import along_coordinates, turning_loads


def controllers(model: Model, seen: Observed) -> Series:
    """Force along the coordinate that a controller pushes, and its integral part [N or N m]."""
    kinds = {name: load for name, load in model.scene.forces().items() if isinstance(load, (Pid, SampledPid))}
    rows = {name: model.arrays.table(m.LOADS)[k] for k, (name, _) in enumerate(model.loads)}
    first = model.ny - model.arrays.size(m.N_INTERNAL)
    places = [
        first + int(rows[name]["internal0"]) + (INTEGRAL if isinstance(load, SampledPid) else 0)
        for name, load in kinds.items()
    ]
    dims = ("time", "controller")
    forces = along_coordinates(model, seen, list(kinds))
    return {"controller_force": (dims, forces), "controller_integral": (dims, seen.state[:, places])}, {
        "controller": list(kinds),
        "controller_motion": ("controller", [motion(turns) for turns in turning_loads(model, list(kinds))]),
    }
