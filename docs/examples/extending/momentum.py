"""Linear momentum of rigid bodies."""

from __future__ import annotations

import numpy as np

from flexclear.dynamics.record.motion import Motions


def record(motions: Motions, asked: tuple[str, ...]) -> tuple[dict, dict]:
    """`momentum` [kg m/s], world axes, of the bodies `asked`, shape (time, momentum_body, 3), and its coordinate."""
    bodies = motions.model.scene.rigid()
    momenta = [bodies[name].mass * motions.body(name).v for name in asked]
    variables = {"momentum": (("time", "momentum_body", "axis"), np.stack(momenta, axis=1))}
    return variables, {"momentum_body": list(asked)}
