"""Transfer from one phase to the next: internal states of parts, and contacts that are closed."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from flexclear.dynamics import memory as m
from flexclear.dynamics.model.internal_states import TURNS, internal_states
from flexclear.dynamics.model.model import Model
from flexclear.dynamics.model.stops import End
from flexclear.dynamics.run.evaluation.engine import Engine
from flexclear.dynamics.run.evaluation.start import NO_IMPACT
from flexclear.scene.schema import Scene


def carry_internal_states(
    old: Model, before: np.ndarray, new: Model, y: np.ndarray, known: Mapping[str, float]
) -> np.ndarray:
    """Return state y of a new model with the internal states of its common parts from an old model's state `before`.

    These are angles with their turns, integral parts of controllers, rotation vectors and deflections of bristles.
    known: joint coordinates, by name in records, for turns that no part of the old model counts.
    """
    there, y = dict(internal_states(old)), y.copy()
    for key, slots in internal_states(new):
        if key in there and len(there[key]) == len(slots):
            y[slots] = before[there[key]]
        elif key[0] == TURNS and key[1] in known:
            y[slots] = known[key[1]]
    return y


def with_closed_contacts(scene: Scene, engine: Engine) -> Scene:
    """Return the scene with initial approach speeds for the contacts that are closed in an engine's work space, and the
    middles of the backlash of gears."""
    parts: dict[str, dict[str, Any]] = {key: dict(getattr(scene, key)) for key in ("joint", "stop", "gear")}
    closed = dict[str, dict[str, float]]()
    for c, contact in enumerate(engine.model.contacts):
        if contact.family == "gear" and contact.owner in scene.gear:
            centre = float(engine.model.arrays.table(m.CONTACT_NUMBERS)["shape"][c][0]) - contact.joint.limit
            gear = parts["gear"][contact.owner]
            parts["gear"][contact.owner] = gear.model_copy(update={"centre": centre})
        if engine.modes[c]:
            speed = float(engine.latched[c])
            speed = 0.0 if speed >= NO_IMPACT else speed
            if isinstance(contact.joint, End):
                stops = parts[contact.family]
                stops[contact.owner] = stops[contact.owner].model_copy(update={"initial_approach_speed": speed})
            else:
                closed.setdefault(contact.owner, {})[contact.name.partition(".")[2]] = speed
    parts["joint"] |= {name: parts["joint"][name].with_approach_speeds(speeds) for name, speeds in closed.items()}
    return scene.model_copy(update=parts)
