"""Start of a run with clearance like its ideal mechanism: same pose and velocities, pins at rest in their sockets.

The ideal scene has ideal joints instead of pins and balls with clearance. The force of such a joint at the
start presses the pin onto one side of its socket, to the penetration at which the contact carries that force. Flexible
bodies start deformed by the loads at the start, so that they do not spring into their shape. A ball on a plane
has no ideal counterpart: it, and the bodies that touch it, stay where the poses put them.
"""

from __future__ import annotations

from collections.abc import Container, Iterator, Mapping
from typing import Any

import numpy as np

from flexclear.artifacts.labelled import Labelled
from flexclear.dynamics import memory as m
from flexclear.dynamics.model.driving import label
from flexclear.dynamics.model.merge import Placement
from flexclear.dynamics.model.start_table import Given, given_coordinates
from flexclear.dynamics.record.motion import Motions
from flexclear.dynamics.record.wrenches import joint_wrenches
from flexclear.dynamics.run.coordinates import joint_coordinates
from flexclear.dynamics.run.evaluation import closure_rows
from flexclear.dynamics.run.evaluation.engine import Engine
from flexclear.dynamics.run.evaluation.observation import observe, rows_of
from flexclear.dynamics.run.evaluation.start import consistent_start, per_speed, project
from flexclear.dynamics.run.run import maker
from flexclear.dynamics.starts.snapshot import with_held_drives, with_poses_and_velocities, with_resting_contacts
from flexclear.scene.laws import Polynomial
from flexclear.scene.pairs import Crown, Rim, Seat, Station
from flexclear.scene.parts import IdealJoint
from flexclear.scene.schema import Scene
from flexclear.scene.start import Start
from flexclear.scene.variants import replaceable_contacts
from flexclear.system.errors import InputError, SolverError
from flexclear.system.progress import Progress

#: a pin has reached its position within this fraction of the clearance; largest number of passes for that
REACHED, PIN_PASSES = 1e-9, 20
#: singular values below this fraction of the largest are rounding
SINGULAR_ROUNDING = 1e-9
#: moments and forces of joints, by name
Forces = Mapping[str, tuple[np.ndarray, np.ndarray]]


def begin(scene: Scene, bundles: Mapping[str, Labelled], progress: Progress) -> tuple[Scene, str]:
    """Return the scene with the start of its ideal mechanism, and how that was assembled.

    Pins whose joints share a force in a way that nothing determines begin in the middle, where they cannot be pressed.
    Raises InputError for an ideal scene that cannot be built, SolverError when other pins cannot be pressed.
    """
    ideal_scene, t = with_placing_joints(scene), scene.time.start
    engine, y = _start_ideal(ideal_scene, bundles, progress)
    y = _deform_statically(engine, y)
    forces = _forces(scene, engine, y)
    concentric, choice = with_poses_and_velocities(scene, engine, y, t), engine.model.mechanism.choice
    if not replaceable_contacts(scene):
        return concentric, choice
    exact = concentric.model_copy(update={"drive": _exact_drives(ideal_scene, replaceable_contacts(scene), engine, y)})
    try:
        engine, y = _start_with_pressed_pins(exact, bundles, progress, forces)
    except (InputError, SolverError):
        if exact == concentric:
            if engine.mobility.redundant_joints.isdisjoint(replaceable_contacts(scene)):
                raise
            why = "the pins begin in the middle of their sockets: rigid bodies leave open how they share their force"
            return concentric, f"{choice}\n{why}".strip()
        choice = f"{choice}\nthe pins are not pressed into their sockets without moving given joint positions".strip()
        engine, y = _start_with_pressed_pins(concentric, bundles, progress, forces)
    return with_resting_contacts(
        with_poses_and_velocities(concentric, engine, y, t), replaceable_contacts(scene), stops=False
    ), choice


def _exact_drives(scene: Scene, pins: Container[str], engine: Engine, y: np.ndarray) -> dict[str, Any]:
    """Return the drives of an ideal scene, and drives that hold given positions of joints that are not loose.

    engine, y: of this scene at its start, whose rates the drives have.
    """
    rates = joint_coordinates(engine.model, observe(engine, rows_of(engine, y[None], engine.start)))

    def law(start: Given, value: float) -> Polynomial:
        name = label(start.joint, scene.joint[start.joint].type, start.number)
        return Polynomial(type="polynomial", coefficients=(value, float(rates[name][1][0])), origin=engine.start)

    return with_held_drives(scene, [start for start in given_coordinates(scene) if start.joint not in pins], law)


def _start_with_pressed_pins(
    scene: Scene, bundles: Mapping[str, Labelled], progress: Progress, forces: Forces
) -> tuple[Engine, np.ndarray]:
    engine, y = _start_ideal(scene, bundles, progress)
    return engine, _press_pins(engine, y, forces)


def with_placing_joints(scene: Scene) -> Scene:
    """Return the scene with ideal joints in place of those clearance joints that have an ideal counterpart."""
    joints = scene.joint | {
        name: IdealJoint.model_validate({"type": joint.ideal, "between": joint.between})
        for name, joint in replaceable_contacts(scene).items()
    }
    start = (scene.start or Start()).model_copy(update={"at": None})
    return scene.model_copy(update={"joint": joints, "start": start})


def _start_ideal(scene: Scene, bundles: Mapping[str, Labelled], progress: Progress) -> tuple[Engine, np.ndarray]:
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
        # step of a modal coordinate for differences, as a fraction of the mechanism's size times the root of its mass
        state, step = y, 1e-7 * engine.model.length * np.sqrt(sum(link.mass for link in engine.model.links))
        # modal coordinates have converged when a pass changes them by less than this fraction; largest number of passes
        for _ in range(10):
            rates = _accelerations(engine, state, speeds)
            slopes = np.array(
                [
                    _accelerations(engine, _with_modal_change(engine, state, step * unit), speeds)
                    for unit in np.eye(len(speeds))
                ]
            )
            slopes = (slopes - rates).T / step
            stiffness = np.maximum(np.abs(np.diag(slopes)), np.finfo(float).tiny)
            change = np.linalg.lstsq(slopes / stiffness[:, None], -rates / stiffness, rcond=SINGULAR_ROUNDING)[0]
            state = _with_modal_change(engine, state, change)
            if np.max(np.abs(change)) <= 1e-9 * np.max(np.abs(state[_modes(engine)])):
                return state
    except SolverError:
        pass
    return y


def _with_modal_change(engine: Engine, y: np.ndarray, change: np.ndarray) -> np.ndarray:
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


def _forces(scene: Scene, engine: Engine, y: np.ndarray) -> Forces:
    """Return moment [N m] and force [N] of every joint on its second body at the start, world axes, by name."""
    seen = observe(engine, rows_of(engine, y[None], engine.start), after=True)
    return {name: (n[0], f[0]) for name, (n, f) in joint_wrenches(Motions(engine.model, seen)).items()}


def _loads(engine: Engine, forces: Forces) -> Iterator[tuple[int, np.ndarray | float]]:
    """Yield each contact of a joint without clearance in the ideal mechanism, by number, with the load on it [N].

    It is the force on the inner part of a pin, whole or at one of its ends, and the size of that on a collar or corner.
    Of a slider in a plane the corners at both ends that force and moment of the joint press are yielded; a slider that
    is loose across its width begins in the middle.
    """
    frames, table = engine.table(m.SITE_FRAMES), engine.model.arrays.table(m.CONTACTS)
    loose = replaceable_contacts(engine.model.scene)
    for c, (name, pair) in enumerate(engine.model.scene.pairs().items()):
        owner = name.partition(".")[0]
        if owner not in loose:
            continue
        moment, force = forces[owner]
        sides = ("inner", "outer") if pair.swapped else ("outer", "inner")
        first, second = (_joint_frame(frames[table[c][side]], getattr(pair, side)) for side in sides)
        x, y, z = first.R.T
        along = float(z @ (second.p - first.p))
        if name in loose:
            yield c, force
        elif isinstance(pair.contact, Rim):
            end = pair.inner.origin[2]
            tilting = np.cross(moment, z) + (along + end) * force
            yield c, -(tilting - z * (z @ tilting)) / (2.0 * end)
        elif isinstance(pair.contact, Crown | Station):
            pressing = pair.contact.share * float(z @ force) * float(np.sign(pair.inner.origin[2]))
            if pressing > 0.0:
                yield c, pressing
        elif loose[owner].held is not None and not (pair.contact.end and pair.swapped):
            arm, push = pair.inner.origin[2], float(x @ force)
            slid = along if pair.swapped else 0.0
            load = 0.5 * (push + (float(y @ moment) + slid * push) / arm)
            if load * pair.inner.origin[0] < 0.0:
                yield c, abs(load)


def _joint_frame(site: np.void, seat: Seat) -> Placement:
    """Return the frame of a joint in which a site has its seat."""
    axes = site["axes"] @ np.array(seat.axes).T
    return Placement(site["origin"] - axes @ np.array(seat.origin), axes)


def _press_pins(engine: Engine, y: np.ndarray, forces: Forces) -> np.ndarray:
    """Return the nearest state in which every pin is where the force on it presses it."""
    model, table = engine.model, engine.model.arrays.table(m.CONTACTS)
    weight = sum(link.mass for link in model.links) * max(float(np.linalg.norm(model.gravity)), 1.0)
    closure_rows.evaluate(engine, y, engine.start)
    # the end of a stop may move, too: held fixed, it would hold the pins back
    pins = [(table[c], model.contacts[c], model.laws[c], load) for c, load in _loads(engine, forces)]
    if not pins:
        return y
    modal, least = y[_modes(engine)], min(contact.joint.clearance for _, contact, *_ in pins)

    def along(row: np.void, joint: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the axes that hold a pin, its offset [m], and the rate of that [m/s] along the axes."""
        outer, inner = (engine.table(m.SITE_FRAMES)[row[side]] for side in ("outer", "inner"))
        across, away = outer["axes"][:, joint.across].T, inner["origin"] - outer["origin"]
        return across, across @ away, across @ (inner["velocity"] - outer["velocity"] - np.cross(outer["omega"], away))

    for _ in range(PIN_PASSES):
        closure_rows.evaluate(engine, y, engine.start)
        missing = []
        for row, contact, law, load in pins:
            across, offset, _ = along(row, contact.joint)
            if isinstance(load, float):
                missing.append(contact.joint.radius - law.depth(load) - offset)
                continue
            force = across @ load
            size = float(np.linalg.norm(force))
            pressed = contact.joint.clearance + law.depth(size)
            # forces below this fraction of the weight press nothing: the pin stays in the middle
            target = -force / size * pressed if size > 1e-9 * weight else 0.0 * force
            missing.append(target - offset)
        offsets = np.concatenate(missing)
        if np.max(np.abs(offsets)) <= REACHED * least:
            return y
        engine.select_pieces_after(engine.start)
        rates = per_speed(engine, y, lambda _: np.concatenate([along(row, one.joint)[2] for row, one, *_ in pins]))
        y = _move_pins(engine, y, rates, offsets, modal)
    raise SolverError(
        f"at t = {engine.start:.6g} s: the pins cannot reach their pressed positions; give "
        "poses and velocities instead of [start] at = 'ideal'"
    )


def _move_pins(
    engine: Engine, y: np.ndarray, jacobian: np.ndarray, offsets: np.ndarray, modal: np.ndarray
) -> np.ndarray:
    """Return the state with pins moved by `offsets` [m] and modal coordinates as close to `modal` as possible.

    jacobian: rates of the offsets per speed.

    The least motion alone would bend rods by part of the clearance, and the run would begin with the impact of their
    springing back: a stiff rod would carry kilonewtons.
    """
    engine.select_pieces_after(engine.start)
    nq, modes = engine.model.nq, _modes(engine)
    ways = per_speed(engine, y, lambda rates: rates[:nq])
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
