"""How far bushings give, for the run dataset."""

from __future__ import annotations

import numpy as np

from flexclear.pipeline.core.scene.loads import Bushing
from flexclear.pipeline.dynamics import memory as m
from flexclear.pipeline.dynamics.effects.bushings.model import nearest
from flexclear.pipeline.dynamics.equations.observation import Observed
from flexclear.pipeline.dynamics.model.model import Model


def give(model: Model, seen: Observed) -> tuple[dict[str, tuple[tuple[str, ...], np.ndarray]], dict[str, object]]:
    """Displacement [m] and rotation vector [rad] of each second frame in the first one's axes, and their coordinate."""
    names = [name for name, load in model.scene.forces().items() if isinstance(load, Bushing)]
    wiring, places = model.arrays.table(m.LOADS), {name: k for k, (name, _) in enumerate(model.loads)}
    displacement, rotation = (np.zeros((len(seen.state), len(names), 3)) for _ in range(2))
    for k, name in enumerate(names):
        a, b = (seen.sites[:, wiring[places[name]][end]] for end in ("a", "b"))
        to_first = np.swapaxes(a["axes"], 1, 2)
        displacement[:, k] = np.einsum("tij,tj->ti", to_first, b["origin"] - a["origin"])
        first = int(wiring[places[name]]["internal0"])
        at = model.ny - model.arrays.size(m.N_INTERNAL) + first
        # without resistance to rotation nothing follows it
        before = seen.state[:, at : at + 3] if first >= 0 else np.zeros((len(seen.state), 3))
        rotation[:, k] = [nearest(R, v) for R, v in zip(to_first @ b["axes"], before, strict=True)]
    dims = ("time", "bushing", "axis")
    return {"bushing_displacement": (dims, displacement), "bushing_rotation": (dims, rotation)}, {"bushing": names}
