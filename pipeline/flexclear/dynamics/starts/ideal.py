"""Start of a run with clearance like its ideal mechanism: same pose and velocities, pins at rest in their sockets.

The ideal scene has ideal joints instead of pins and balls with clearance. The force of such a joint at the
start presses the pin onto one side of its socket, to the penetration at which the contact carries that force. Flexible
bodies start deformed by the loads at the start, so that they do not spring into their shape. Slots and planes
have no ideal counterpart: they, and the bodies that touch them, stay where the poses put them.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from flexclear.artifacts.labelled import Labelled
from flexclear.dynamics import memory as m
from flexclear.dynamics.record.motion import Motions
from flexclear.dynamics.record.wrenches import joint_wrenches
from flexclear.dynamics.run.evaluation import closure_rows
from flexclear.dynamics.run.evaluation.engine import Engine
from flexclear.dynamics.run.evaluation.observation import observe, rows_of
from flexclear.dynamics.run.evaluation.start import consistent_start, per_speed, project
from flexclear.dynamics.run.horizon.horizon import offset_jacobian
from flexclear.dynamics.run.run import maker
from flexclear.dynamics.starts.snapshot import moving, resting
from flexclear.scene.parts import IdealJoint
from flexclear.scene.schema import Scene
from flexclear.scene.start import Start
from flexclear.scene.variants import WITHOUT_CLEARANCE, loose
from flexclear.system.errors import InputError, SolverError
from flexclear.system.progress import Progress

#: a pin has reached its position within this fraction of the clearance; largest number of passes for that
REACHED, PIN_PASSES = 1e-9, 20
#: forces below this fraction of the weight press nothing: the pin stays in the middle
NO_FORCE = 1e-9
#: modal coordinates have converged when a pass changes them by less than this fraction; largest number of passes
SETTLED, LOADINGS = 1e-9, 10
#: step of a modal coordinate for differences, as a fraction of the mechanism's size times the root of its mass
MODAL_STEP = 1e-7
#: singular values below this fraction of the largest are rounding
SINGULAR_ROUNDING = 1e-9


def begin(scene: Scene, bundles: Mapping[str, Labelled], progress: Progress) -> tuple[Scene, str]:
    """Return the scene with the start of its ideal mechanism (without clearance: its own), and how that was assembled.

    Raises InputError for an ideal scene that cannot be built, SolverError when the pins cannot be moved to
    their pressed positions.
    """
    ideal_scene, t = placed(scene), scene.time.start
    engine, y = _started(ideal_scene, bundles, progress)
    y = _deform_statically(engine, y)
    forces = _forces(scene, engine, y)
    concentric, choice = moving(scene, engine, y, t), engine.model.mechanism.choice
    if not scene.contacts():
        return concentric, choice
    engine, y = _started(concentric, bundles, progress)
    y = _press_pins(engine, y, forces)
    return resting(moving(concentric, engine, y, t), loose(scene)), choice


def placed(scene: Scene) -> Scene:
    """Return the scene with ideal joints in place of those clearance joints that have an ideal counterpart.

    Raises InputError when the scene has contacts but none of them has a counterpart.
    """
    if scene.contacts() and not loose(scene):
        raise InputError(
            "[start.at]",
            f"is 'ideal', but none of {', '.join(scene.contacts())} has an ideal counterpart, as pins and balls have",
            "remove it, and give poses or [start.joint]",
        )
    joints = scene.joint | {
        name: IdealJoint.model_validate({"type": WITHOUT_CLEARANCE[joint.type], "between": joint.between})
        for name, joint in loose(scene).items()
    }
    start = (scene.start or Start()).model_copy(update={"at": None})
    return scene.model_copy(update={"joint": joints, "start": start})


def _started(scene: Scene, bundles: Mapping[str, Labelled], progress: Progress) -> tuple[Engine, np.ndarray]:
    engine = maker(scene, bundles, progress)()
    return engine, consistent_start(engine)


def _deform_statically(engine: Engine, y: np.ndarray) -> np.ndarray:
    """Return the state with flexible bodies deformed statically by the loads of the start, inertia included.

    Modal coordinates then do not accelerate, as far as loops leave them free.  Where rods buckle or the pose is
    singular no such state exists, and y is returned.
    """
    speeds = _modal_speeds(engine)
    if not speeds or engine.mobility.singular_start:
        return y
    try:
        state, step = y, MODAL_STEP * engine.model.length * np.sqrt(sum(link.mass for link in engine.model.links))
        for _ in range(LOADINGS):
            rates = _accelerations(engine, state, speeds)
            slopes = np.array(
                [_accelerations(engine, _changed(engine, state, step * unit), speeds) for unit in np.eye(len(speeds))]
            )
            slopes = (slopes - rates).T / step
            stiffness = np.maximum(np.abs(np.diag(slopes)), np.finfo(float).tiny)
            change = np.linalg.lstsq(slopes / stiffness[:, None], -rates / stiffness, rcond=SINGULAR_ROUNDING)[0]
            state = _changed(engine, state, change)
            if np.max(np.abs(change)) <= SETTLED * np.max(np.abs(state[_modes(engine)])):
                return state
    except SolverError:
        pass
    return y


def _changed(engine: Engine, y: np.ndarray, change: np.ndarray) -> np.ndarray:
    """Return the state with changed modal coordinates and closed loops."""
    changed = y.copy()
    changed[_modes(engine)] += change
    engine.select_pieces_after(engine.start)
    return project(engine, changed)


def _accelerations(engine: Engine, y: np.ndarray, speeds: list[int]) -> np.ndarray:
    """Return the accelerations of the modal coordinates, shape (n,)."""
    return closure_rows.evaluate(engine, y, engine.start)[speeds].copy()


def _modal_speeds(engine: Engine) -> list[int]:
    """Return the indices of the speeds of modal coordinates in the state."""
    model = engine.model
    return [model.nq + k for own in model.numbering.modal_coordinates.values() for k in own]


def _forces(scene: Scene, engine: Engine, y: np.ndarray) -> dict[str, np.ndarray]:
    """Return the force of every joint on its second body at the start [N], world axes, by name."""
    seen = observe(engine, rows_of(engine, y[None], engine.start), after=True)
    return {name: wrench[1][0] for name, wrench in joint_wrenches(Motions(engine.model, seen)).items()}


def _press_pins(engine: Engine, y: np.ndarray, forces: Mapping[str, np.ndarray]) -> np.ndarray:
    """Return the nearest state in which every pin is where the force on it presses it."""
    model, contacts = engine.model, engine.model.arrays.table(m.CONTACTS)
    weight = sum(link.mass for link in model.links) * max(float(np.linalg.norm(model.gravity)), 1.0)
    pins = [contact.name in loose(model.scene) for contact in model.contacts]
    modal = y[_modes(engine)]
    for _ in range(PIN_PASSES):
        closure_rows.evaluate(engine, y, engine.start)
        sites, missing = engine.table(m.SITE_FRAMES), []
        for row, contact, law, pin in zip(contacts, model.contacts, model.laws, pins, strict=True):
            if not pin:
                continue  # the end of a stop may move, too: held fixed, it would hold the pins back
            outer, inner = sites[row["outer"]], sites[row["inner"]]
            force, offset = forces[contact.name], inner["origin"] - outer["origin"]
            if contact.joint.type == "clearance-revolute":
                axis = outer["axes"][:, 2]
                force, offset = force - axis * (axis @ force), offset - axis * (axis @ offset)
            size = float(np.linalg.norm(force))
            depth = (size / law.numbers.stiffness) ** (1.0 / law.numbers.exponent)
            target = -force / size * (contact.joint.clearance + depth) if size > NO_FORCE * weight else 0.0 * force
            missing.append(target - offset)
        least = min(joint.clearance for joint in loose(model.scene).values())
        if np.max(np.abs(missing)) <= REACHED * least:
            return y
        y = _move_pins(engine, y, pins, np.concatenate(missing), modal)
    raise SolverError(
        f"at t = {engine.start:.6g} s: the pins cannot reach their pressed positions; give "
        "poses and velocities instead of [start] at = 'ideal'"
    )


def _move_pins(engine: Engine, y: np.ndarray, pins: list[bool], offsets: np.ndarray, modal: np.ndarray) -> np.ndarray:
    """Return the state with pins moved by `offsets` (3 each) [m] and modal coordinates as close to `modal` as possible.

    The least motion alone would bend rods by part of the clearance, and the run would begin with the impact of their
    springing back: a stiff rod would carry kilonewtons.
    """
    engine.select_pieces_after(engine.start)
    nq, modes = engine.model.nq, _modes(engine)
    ways = per_speed(engine, y, lambda rates: rates[:nq])
    jacobian = offset_jacobian(engine, y)[np.repeat(pins, 3)]
    speeds, _, rank, _ = np.linalg.lstsq(jacobian, offsets, rcond=SINGULAR_ROUNDING)
    if modes:
        free = np.linalg.svd(jacobian)[2][rank:].T  # speeds that do not move the pins
        bending = modal - y[modes] - ways[modes] @ speeds
        speeds += free @ np.linalg.lstsq(ways[modes] @ free, bending, rcond=SINGULAR_ROUNDING)[0]
    moved = y.copy()
    moved[:nq] += ways @ speeds
    return project(engine, moved)


def _modes(engine: Engine) -> list[int]:
    """Return the indices of the flexible bodies' modal coordinates in the state."""
    return [k for own in engine.model.numbering.modal_positions.values() for k in own]
