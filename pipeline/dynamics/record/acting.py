"""What acts on bodies besides joints and paths: loads and effects, at the frames where they do."""

from __future__ import annotations

import numpy as np

from flexclear.pipeline.dynamics.equations.observation import Observed
from flexclear.pipeline.dynamics.model.model import Model

Acting = list[tuple[str, np.ndarray, np.ndarray]]


def on_frames(model: Model, seen: Observed, body: str) -> Acting:
    """Everything that acts on a body: its frame, moment about the kernels' origin, force; (time, 3) each."""
    on_each: Acting = []
    if model.loads:
        from flexclear.pipeline.dynamics.record.loads import on_loaded_frames

        on_each += on_loaded_frames(model, seen)
    for on_its_frames in model.parts.functions("acts"):
        on_each += on_its_frames(model, seen)
    return [acting for acting in on_each if model.mechanism.frames[acting[0]].body == body]
