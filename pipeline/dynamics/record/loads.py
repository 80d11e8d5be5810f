"""What loads do, for the run dataset and for the balance of each body."""

from __future__ import annotations

from typing import Any

import numpy as np

from pipeline.dynamics import memory as m
from pipeline.dynamics.model.loads import describe, order
from pipeline.dynamics.model.model import Model

Seen = dict[str, np.ndarray]


def load_series(model: Model, seen: Seen) -> dict[str, tuple[tuple[str, ...], np.ndarray]]:
    """Forces and moments on the (second) frame, lengths and powers, loads in the order of the scene."""
    table = _table(seen)
    force, moment = table["force"], table["moment"]
    sites = seen["site_frame"].reshape(len(table), -1, m.FRAME.size)
    wiring = model.arrays.table(m.LOADS)
    power = np.zeros(table.shape[:2])
    for which, sign in (("a", -1.0), ("b", 1.0)):
        held = wiring[which] >= 0
        site = sites[:, wiring[which][held]]
        omega, v, p = (
            site[..., m.FRAME.omega : m.FRAME.omega + 3],
            site[..., m.FRAME.velocity : m.FRAME.velocity + 3],
            site[..., m.FRAME.origin : m.FRAME.origin + 3],
        )
        at_origin = v - np.cross(omega, p)
        power[:, held] += sign * np.sum(omega * moment[:, held] + at_origin * force[:, held], axis=-1)
    origin = sites[:, wiring["b"], m.FRAME.origin : m.FRAME.origin + 3]
    names = order(model.scene)
    shown = [names.index(name) for name in model.scene.forces()]
    series = {
        "load_force": (("time", "load", "axis"), force),
        "load_moment": (("time", "load", "axis"), moment - np.cross(origin, force)),
        "load_length": (("time", "load"), table["value"]),
        "load_power": (("time", "load"), power),
    }
    return {name: (dims, values[:, shown]) for name, (dims, values) in series.items()}


def along_coordinates(model: Model, seen: Seen, names: list[str]) -> np.ndarray:
    """Force [N] or torque [N m] of loads along their joint coordinates, shape (time, names)."""
    table, found = _table(seen), []
    sites = seen["site_frame"].reshape(len(table), -1, m.FRAME.size)
    for name in names:
        k = order(model.scene).index(name)
        row = model.arrays.table(m.LOADS)[k]
        axes = sites[:, row["b"] if row["side"] else row["a"], m.FRAME.axes : m.FRAME.axes + 9].reshape(-1, 3, 3)
        part = "moment" if row["turning"] else "force"
        found.append(np.einsum("ti,ti->t", axes[:, :, row["axis"]], table[part][:, k]))
    return np.stack(found, axis=1)


def on_body(model: Model, seen: Seen, body: str) -> tuple[np.ndarray, np.ndarray]:
    """Sum of the loads on a body: moment about the kernels' origin, force; (time, 3) each."""
    rows = len(_table(seen))
    moment, force = np.zeros((rows, 3)), np.zeros((rows, 3))
    for _, n, f in on_frames(model, seen, body):
        moment, force = moment + n, force + f
    return moment, force


def on_frames(model: Model, seen: Seen, body: str) -> list[tuple[str, np.ndarray, np.ndarray]]:
    """Each load on a body: its frame, moment about the kernels' origin, force; (time, 3) each."""
    scene, frames, table = model.scene, model.mechanism.frames, _table(seen)
    return [
        (frame, sign * table["moment"][:, k], sign * table["force"][:, k])
        for k, name in enumerate(order(scene))
        for frame, sign in _ends(scene, name)
        if frames[frame].body == body
    ]


def _ends(scene: Any, name: str) -> list[tuple[str, float]]:
    row, _ = describe(scene, name)
    frames = scene.joint[row.joint].between if row.joint is not None else row.frames
    return [(frames[-1], 1.0)] + ([(frames[0], -1.0)] if len(frames) == 2 else [])


def _table(seen: Seen) -> np.ndarray:
    return m.named(m.LOAD, seen["load"])
