"""What acts on bodies besides joints and paths: loads, stops and gears, at the frames where they do."""

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
    if model.parts.stops:
        from flexclear.pipeline.dynamics.record.stops import on_stopped_frames

        on_each += on_stopped_frames(model, seen)
    if model.parts.couplings:
        from flexclear.pipeline.dynamics.record.gears import on_geared_frames

        on_each += on_geared_frames(model, seen)
    return [acting for acting in on_each if model.mechanism.frames[acting[0]].body == body]
