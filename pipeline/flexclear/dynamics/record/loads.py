"""Forces, moments and powers of loads, for the run dataset and for the balance of each body."""

from __future__ import annotations

import numpy as np

from flexclear.dynamics import memory as m
from flexclear.dynamics.equations.observation import Observed, Variables
from flexclear.dynamics.model.model import Model


def load_series(model: Model, seen: Observed) -> Variables:
    """Return forces and moments on the (second) frame, lengths and powers, with loads in the order of the scene."""
    values = record_loads(model, seen, list(model.scene.forces()))
    dims = {"force": ("time", "load", "axis"), "moment": ("time", "load", "axis")}
    return {f"load_{name}": (dims.get(name, ("time", "load")), one) for name, one in values.items()}


def record_loads(model: Model, seen: Observed, names: list[str]) -> dict[str, np.ndarray]:
    """Return force, moment, length and power of loads and films, (time, names) or (time, names, 3) each."""
    force, moment = seen.loads["force"], seen.loads["moment"]
    topology = model.arrays.table(m.LOADS)
    power = np.zeros(seen.loads.shape)
    for end, sign in (("a", -1.0), ("b", 1.0)):
        held = topology[end] >= 0
        site = seen.sites[:, topology[end][held]]
        at_origin = site["velocity"] - np.cross(site["omega"], site["origin"])
        power[:, held] += sign * np.sum(site["omega"] * moment[:, held] + at_origin * force[:, held], axis=-1)
    about = moment - np.cross(seen.sites[:, topology["b"]]["origin"], force)
    every = [name for name, _ in model.loads]
    shown = [every.index(name) for name in names]
    whole = {"force": force, "moment": about, "length": seen.loads["value"], "power": power}
    return {name: values[:, shown] for name, values in whole.items()}


def along_coordinates(model: Model, seen: Observed, names: list[str]) -> np.ndarray:
    """Return force [N] or torque [N m] of loads along their joint coordinates, shape (time, names)."""
    forces, numbers = [], {name: k for k, (name, _) in enumerate(model.loads)}
    for k in (numbers[name] for name in names):
        row = model.arrays.table(m.GAUGES)[model.arrays.table(m.LOADS)[k]["gauge"]]
        axes = seen.sites["axes"][:, row["b"] if row["side"] else row["a"]]
        acting = seen.loads["moment" if row["turning"] else "force"]
        forces.append(np.einsum("ti,ti->t", axes[:, :, row["axis"]], acting[:, k]))
    return np.stack(forces, axis=1)


def turning_loads(model: Model, names: list[str], *, measured: bool = False) -> list[bool]:
    """Return True for each load that acts along an angle; measured: for each whose measured coordinate is an angle."""
    topology, gauges = model.arrays.table(m.LOADS), model.arrays.table(m.GAUGES)
    looks = np.where((topology["measured"] >= 0) & measured, topology["measured"], topology["gauge"])
    rows = dict(zip((name for name, _ in model.loads), looks.tolist(), strict=True))
    return [rows[name] >= 0 and bool(gauges[int(rows[name])]["turning"]) for name in names]


def on_loaded_frames(model: Model, seen: Observed) -> list[tuple[str, np.ndarray, np.ndarray]]:
    """Return each load on each of its frames: frame, moment about the mechanism's origin, force; (time, 3) each."""
    ends = [
        (k, frame, sign)
        for k, (_, frames) in enumerate(model.loads)
        for frame, sign in zip(reversed(frames), (1.0, -1.0), strict=False)  # the load acts on the last frame
    ]
    return [(frame, sign * seen.loads["moment"][:, k], sign * seen.loads["force"][:, k]) for k, frame, sign in ends]
