"""End of a run at the full turn of a bushing."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from flexclear.dynamics import memory as m
from flexclear.scene.loads import Bushing

if TYPE_CHECKING:
    from flexclear.dynamics.run.evaluation.engine import Engine

#: rotation [rad] at which a bushing ends a run: at a full turn its rotation vector has no direction
LARGEST_ANGLE = 6.2


def explanation(engine: Engine) -> str | None:
    """Return an explanation when a bushing is near a full turn in the engine's state, else None."""
    model, y = engine.model, engine.view(m.Y)
    first = model.ny - model.arrays.size(m.N_INTERNAL)
    for name, row in model.rows_of(Bushing).items():
        at = first + int(row["internal0"])
        angle = float(np.linalg.norm(y[at : at + 3])) if row["internal0"] >= 0 else 0.0
        if angle > 0.99 * LARGEST_ANGLE:
            return (
                f"bushing {name} has turned by {np.degrees(angle):.0f} deg: the rotation vector of an elastic mount "
                "has no direction at a full turn; use a joint for this rotation, with a joint-spring for its "
                "torque, or give the bushing neither stiffness nor damping against rotation"
            )
    return None
