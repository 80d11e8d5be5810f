"""Bushings at a full turn end a run, in words."""

from __future__ import annotations

import numpy as np

from flexclear.pipeline.core.scene.loads import Bushing
from flexclear.pipeline.dynamics import memory as m
from flexclear.pipeline.dynamics.run.engine import Engine

#: rotation [rad] at which a bushing ends a run: at a full turn its rotation vector has no direction
LARGEST = 6.2


def explanation(engine: Engine) -> str | None:
    """What to say where a bushing has come to a full turn in the engine's state, else None."""
    model, y = engine.model, engine.view(m.Y)
    first = model.ny - model.arrays.size(m.N_INTERNAL)
    for (name, _), row in zip(model.loads, model.arrays.table(m.LOADS), strict=True):
        at = first + int(row["internal0"])
        if isinstance(model.scene.load[name], Bushing) and row["internal0"] >= 0:
            angle = float(np.linalg.norm(y[at : at + 3]))
            if angle > 0.99 * LARGEST:
                return (
                    f"bushing {name} has turned by {np.degrees(angle):.0f} deg: it is an elastic mount, whose rotation "
                    "vector loses its direction at a full turn; let a joint carry the turning, with a joint-spring "
                    "for its torque, or give the bushing no stiffness and no damping against rotation"
                )
    return None
