"""What loads do, for the run dataset and for the balance of each body."""

from __future__ import annotations

from typing import Any

import numpy as np

from pipeline.dynamics.assembly.loading import describe, order
from pipeline.dynamics.assembly.numbers import Tables
from pipeline.dynamics.loads.fields import AXIS, FORCE, MOMENT, SIDE, TURNING, VALUE, A, B
from pipeline.dynamics.tables import AXES, FRAME_SIZE, LOAD_SIZE, OMEGA, ORIGIN, VELOCITY

Seen = dict[str, np.ndarray]


def load_series(built: Tables, seen: Seen) -> dict[str, tuple[tuple[str, ...], np.ndarray]]:
    """Forces and moments on the (second) frame, lengths and powers, loads in the order of the scene."""
    table = _table(seen)
    force, moment = table[..., FORCE : FORCE + 3], table[..., MOMENT : MOMENT + 3]
    sites = seen["site_frame"].reshape(len(table), -1, FRAME_SIZE)
    wiring = built.packed.table("LOADS")
    power = np.zeros(table.shape[:2])
    for which, sign in ((A, -1.0), (B, 1.0)):
        held = wiring[:, which] >= 0
        site = sites[:, wiring[held, which]]
        omega, v, p = site[..., OMEGA : OMEGA + 3], site[..., VELOCITY : VELOCITY + 3], site[..., ORIGIN : ORIGIN + 3]
        at_origin = v - np.cross(omega, p)
        power[:, held] += sign * np.sum(omega * moment[:, held] + at_origin * force[:, held], axis=-1)
    origin = sites[:, wiring[:, B], ORIGIN : ORIGIN + 3]
    names = order(built.system.scene)
    shown = [names.index(name) for name in built.system.scene.forces()]
    series = {
        "load_force": (("time", "load", "axis"), force),
        "load_moment": (("time", "load", "axis"), moment - np.cross(origin, force)),
        "load_length": (("time", "load"), table[..., VALUE]),
        "load_power": (("time", "load"), power),
    }
    return {name: (dims, values[:, shown]) for name, (dims, values) in series.items()}


def along_coordinates(built: Tables, seen: Seen, names: list[str]) -> np.ndarray:
    """Force [N] or torque [N m] of loads along their joint coordinates, shape (time, names)."""
    table, found = _table(seen), []
    sites = seen["site_frame"].reshape(len(table), -1, FRAME_SIZE)
    for name in names:
        k = order(built.system.scene).index(name)
        row = built.packed.table("LOADS")[k]
        axes = sites[:, row[B] if row[SIDE] else row[A], AXES : AXES + 9].reshape(-1, 3, 3)
        part = MOMENT if row[TURNING] else FORCE
        found.append(np.einsum("ti,ti->t", axes[:, :, row[AXIS]], table[:, k, part : part + 3]))
    return np.stack(found, axis=1)


def on_body(built: Tables, seen: Seen, body: str) -> tuple[np.ndarray, np.ndarray]:
    """Sum of the loads on a body: moment about the kernels' origin, force; (time, 3) each."""
    rows = len(_table(seen))
    moment, force = np.zeros((rows, 3)), np.zeros((rows, 3))
    for _, n, f in on_frames(built, seen, body):
        moment, force = moment + n, force + f
    return moment, force


def on_frames(built: Tables, seen: Seen, body: str) -> list[tuple[str, np.ndarray, np.ndarray]]:
    """Each load on a body: its frame, moment about the kernels' origin, force; (time, 3) each."""
    scene, frames, table = built.system.scene, built.system.frames, _table(seen)
    return [
        (frame, sign * table[:, k, MOMENT : MOMENT + 3], sign * table[:, k, FORCE : FORCE + 3])
        for k, name in enumerate(order(scene))
        for frame, sign in _ends(scene, name)
        if frames[frame].body == body
    ]


def _ends(scene: Any, name: str) -> list[tuple[str, float]]:
    row, _ = describe(scene, name)
    frames = scene.joint[row.joint].between if row.joint is not None else row.frames
    return [(frames[-1], 1.0)] + ([(frames[0], -1.0)] if len(frames) == 2 else [])


def _table(seen: Seen) -> np.ndarray:
    return seen["load"].reshape(len(seen["load"]), -1, LOAD_SIZE)
