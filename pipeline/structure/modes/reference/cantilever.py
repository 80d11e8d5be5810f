"""Body frame clamped at the first interface; normal modes with nothing else held.

Source: Shabana, *Dynamics of Multibody Systems*, ch. 5 (reference conditions of a clamped body frame).
"""

from __future__ import annotations

from flexclear.pipeline.structure.fe.model import Model
from flexclear.pipeline.structure.modes.condition import Condition, Given, holding, joined


def condition(model: Model, given: Given) -> Condition:
    """Normal modes with the first interface clamped; InputError without one."""
    first = joined(given, 1, "a cantilever is clamped at an interface")[0]
    return holding(first.motion, f"the body frame rides on '{first.name}', where all shapes vanish")
