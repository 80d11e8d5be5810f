"""A consistent start: joint coordinates from the bodies' poses, loops closed, speeds projected."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from pipeline.core.errors import InputError
from pipeline.core.scene.parts import Ground
from pipeline.dynamics.assembly.constraints import outboard_place
from pipeline.dynamics.assembly.numbers import Tables
from pipeline.dynamics.assembly.tree import joint_class
from pipeline.dynamics.tables import AXES, CONTACT_LOSS, OMEGA, VELOCITY

Frames = Callable[[np.ndarray], np.ndarray]  #: state -> frames of all links, (links, FRAME_SIZE)


def start_state(built: Tables) -> np.ndarray:
    """State at the start as the scene gives it, before the loops are closed; shape (n,)."""
    layout, system = built.layout, built.system
    q, v = np.zeros(layout.nq), np.zeros(layout.nv)
    for i, link in enumerate(system.links[1:], start=1):
        declared = joint_class(link.kind)
        if layout.driven(i) >= 0 or not declared.POSITIONS:
            continue
        assert link.inboard is not None
        F = system.links[link.inboard.link].start.of(link.inboard.place)
        relative = F.inverse().of(link.start.of(outboard_place(system, link)))
        coordinates = declared.coordinates(relative.R, relative.p)
        q[layout.q0[i] : layout.q0[i] + len(coordinates)] = coordinates
    return np.concatenate([q, v, np.zeros(CONTACT_LOSS + 2 * len(system.contacts))])


def given_velocities(built: Tables, frames: Frames, y: np.ndarray) -> np.ndarray:
    """Speeds that come nearest, in the metric of the mass, to the velocities that the scene gives."""
    scene, layout = built.system.scene, built.layout
    wanted = {
        n: b
        for n, b in scene.body.items()
        if not isinstance(b, Ground) and (b.velocity is not None or b.angular_velocity is not None)
    }
    if not wanted:
        return y
    y = y.copy()
    nq, nv = layout.nq, layout.nv
    rows, target = [], []
    base = _twists(built, frames, y, wanted)
    columns = []
    for k in range(nv):
        moved = y.copy()
        moved[nq + k] = 1.0
        columns.append(_twists(built, frames, moved, wanted) - base)
    for place, body in enumerate(wanted.values()):
        given = (body.angular_velocity, body.velocity)
        for part, value in enumerate(given):
            if value is None:
                continue
            span = slice(6 * place + 3 * part, 6 * place + 3 * part + 3)
            rows.append(np.array([c[span] for c in columns]).T)
            target.append(np.array(value) - base[span])
    A, b = np.concatenate(rows), np.concatenate(target)
    speeds, *_ = np.linalg.lstsq(A, b, rcond=1e-12)
    miss = float(np.max(np.abs(A @ speeds - b)))
    if miss > 1e-6 * (1.0 + float(np.max(np.abs(b)))):
        names = ", ".join(wanted)
        raise InputError(
            f"[body.{next(iter(wanted))}.velocity]",
            f"the joints do not allow the velocities given for {names} (they miss by {miss:.3g})",
            "give velocities that agree with each other, or fewer of them",
        )
    y[nq : nq + nv] = speeds
    return y


def _twists(built: Tables, frames: Frames, y: np.ndarray, bodies: dict) -> np.ndarray:
    """Angular velocity and velocity of the centre of mass of each body, flattened."""
    link_frames = frames(y)
    found = []
    for name in bodies:
        link = built.system.link_of[name]
        frame = link_frames[link]
        R, omega, v = frame[AXES : AXES + 9].reshape(3, 3), frame[OMEGA : OMEGA + 3], frame[VELOCITY : VELOCITY + 3]
        place = built.system.links[link].places[name]
        arm = R @ (place.p + place.R @ np.array(getattr(bodies[name], "com", (0.0, 0.0, 0.0))))
        found += [omega, v + np.cross(omega, arm)]
    return np.concatenate(found).copy()
