"""A run with clearance that begins as its ideal twin does: its pose and velocities, pins at rest in their sockets.

The twin has ideal joints in the place of those with clearance. The force that such a joint carries at the start presses
the pin onto one side of its socket, and so deep into it that the contact carries that force.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import xarray as xr

from flexclear.pipeline.core.errors import SolverError
from flexclear.pipeline.core.progress import Progress
from flexclear.pipeline.core.scene.clearance import Clearance
from flexclear.pipeline.core.scene.parts import IdealJoint
from flexclear.pipeline.core.scene.schema import Scene
from flexclear.pipeline.core.scene.start import Start
from flexclear.pipeline.dynamics import memory as m
from flexclear.pipeline.dynamics.model.mechanism import build
from flexclear.pipeline.dynamics.model.model import tabulate
from flexclear.pipeline.dynamics.record.motion import Motions
from flexclear.pipeline.dynamics.record.wrenches import joint_wrenches
from flexclear.pipeline.dynamics.run.engine import Engine, prepare
from flexclear.pipeline.dynamics.run.observation import observe
from flexclear.pipeline.dynamics.run.run import driven
from flexclear.pipeline.dynamics.run.sensitivity import offset_jacobian, perturbed
from flexclear.pipeline.dynamics.run.start import consistent_start
from flexclear.pipeline.dynamics.starts.snapshot import moving, resting

#: a pin is in its place when it is this share of the clearance from it; passes in which that is reached, at most
THERE, PASSES = 1e-9, 20
#: forces below this share of the weight press nothing: the pin stays in the middle
NOTHING = 1e-9


def begin(scene: Scene, bundles: Mapping[str, xr.Dataset], progress: Progress) -> Scene:
    """The scene as its ideal twin starts; one without clearance is its own twin.

    Raises InputError for a twin that cannot be built, SolverError when the pins cannot be put where they are pressed.
    """
    twin, t = _ideal(scene), scene.time.start
    engine, y = _started(twin, bundles, progress)
    forces = _forces(scene, engine, y)
    concentric = moving(scene, engine, y, t)
    if not scene.contacts():
        return concentric
    loose, y = _started(concentric, bundles, progress)
    y = _pressed(loose, y, forces)
    return resting(moving(concentric, loose, y, t))


def _ideal(scene: Scene) -> Scene:
    """The scene with ideal joints only."""
    kinds = {name: joint.type.removeprefix("clearance-") for name, joint in scene.contacts().items()}
    joints = scene.joint | {
        name: IdealJoint.model_validate({"type": kind, "between": scene.joint[name].between})
        for name, kind in kinds.items()
    }
    start = (scene.start or Start()).model_copy(update={"at": None})
    return scene.model_copy(update={"joint": joints, "start": start})


def _started(scene: Scene, bundles: Mapping[str, xr.Dataset], progress: Progress) -> tuple[Engine, np.ndarray]:
    moved, given = driven(scene, bundles, progress)
    engine = prepare(tabulate(build(moved, bundles), given), progress)
    return engine, consistent_start(engine)


def _forces(scene: Scene, engine: Engine, y: np.ndarray) -> dict[str, np.ndarray]:
    """Force of every joint on its second body at the start [N], world axes, by name."""
    contacts = len(engine.model.contacts)  # with stops
    rows = m.empty_record(1, contacts, len(y))
    start = m.record(rows, contacts)
    start.time[:], start.state[:] = engine.start, y
    seen = observe(engine, rows, after=True)
    return {name: wrench[1][0] for name, wrench in joint_wrenches(Motions(engine.model, seen)).items()}


def _pressed(engine: Engine, y: np.ndarray, forces: Mapping[str, np.ndarray]) -> np.ndarray:
    """The state nearby in which every pin is where the force on it presses it."""
    model, contacts = engine.model, engine.model.arrays.table(m.CONTACTS)
    weight = sum(link.mass for link in model.links) * max(float(np.linalg.norm(model.gravity)), 1.0)
    for _ in range(PASSES):
        engine.evaluate(y, engine.start)
        sites, missing = engine.table(m.SITE_FRAMES), []
        for row, contact, law in zip(contacts, model.contacts, model.laws, strict=True):
            if not isinstance(contact.joint, Clearance):
                missing.append(np.zeros(3))  # the end of a stop
                continue
            outer, inner = sites[row["outer"]], sites[row["inner"]]
            force, offset = forces[contact.name], inner["origin"] - outer["origin"]
            if contact.joint.type == "clearance-revolute":
                axis = outer["axes"][:, 2]
                force, offset = force - axis * (axis @ force), offset - axis * (axis @ offset)
            size = float(np.linalg.norm(force))
            depth = (size / law.numbers[0]) ** (1.0 / law.exponent)
            there = -force / size * (contact.joint.clearance + depth) if size > NOTHING * weight else 0.0 * force
            missing.append(there - offset)
        least = min(c.joint.clearance for c in model.contacts if isinstance(c.joint, Clearance))
        if np.max(np.abs(missing)) <= THERE * least:
            return y
        y = perturbed(engine, y, offset_jacobian(engine, y), np.concatenate(missing))
    raise SolverError(
        f"at t = {engine.start:.6g} s: the pins cannot be put where their joints' forces press them; "
        "give poses and velocities instead of [start] at = 'ideal'"
    )
