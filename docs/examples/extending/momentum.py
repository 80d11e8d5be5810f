"""Linear momentum of rigid bodies."""

from __future__ import annotations

import numpy as np

from pipeline.dynamics.model.model import Model
from pipeline.dynamics.record.motion import body_motions, link_motions


def record(
    model: Model, seen: dict[str, np.ndarray], asked: tuple[str, ...], variables: dict, coordinates: dict
) -> None:
    """Add `momentum` [kg m/s], world axes, of the bodies `asked`, shape (time, momentum_body, 3)."""
    motions = body_motions(model, seen, link_motions(model, seen["link_frame"]))
    coordinates["momentum_body"] = list(asked)
    momenta = [model.scene.body[name].mass * motions[name].v for name in asked]
    variables["momentum"] = (("time", "momentum_body", "axis"), np.stack(momenta, axis=1))
