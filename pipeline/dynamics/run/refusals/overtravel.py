"""Whether drives press a contact through its socket, however the rest of a mechanism with clearance gives way.

A drive that leads a loop with ideal joints out of reach ends the run there. With clearance the contact gives way
instead, in ever shorter steps, millions of which friction's slope at rest may ask for. What it must come to is a matter
of geometry: the least depth at the drives' positions, over all that they leave free. It is followed from the pose that
the run has come to along the drives' laws.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from flexclear.pipeline.core.system.errors import SolverError
from flexclear.pipeline.dynamics import memory as m
from flexclear.pipeline.dynamics.contact.validity import SHALLOW
from flexclear.pipeline.dynamics.run.displacement import per_speed
from flexclear.pipeline.dynamics.run.evaluation.engine import Engine
from flexclear.pipeline.dynamics.run.evaluation.start import project

#: times ahead at which the least depth is searched for
TIMES_AHEAD = 60
#: a search proceeds in so many boxes of this half width, in fractions of the mechanism's size or in rad: coordinates
#: of a box are those of the loops' tangents in its middle
BOXES, HALF_WIDTH = 60, 0.1
#: a depth is the least when another box takes off less than this fraction of it
LEAST_GAIN = 1e-3
#: of the search in a box, in which depths are fractions of that in its middle, so that no size of a mechanism matters
OPTIONS: Any = {"eps": 1e-6}


def forced_depth(engine: Engine, contact: int) -> tuple[float, float]:
    """When contact number `contact` must be deeper [m] than its inner radius, and how deep then; else (inf, 0).

    From the stepper's state on, if the contact is deep already; rigid bodies only, since others bend instead.
    Searches are local, as the motion is.  The memory is not preserved.
    """
    model, t = engine.model, float(engine.control[m.TIME])
    radius, y = model.contacts[contact].joint.radius, engine.view(m.Y).copy()
    deep = SHALLOW * radius
    try:
        for time in np.linspace(t, engine.end, TIMES_AHEAD + 1)[:-1]:
            y, depth = _shallowest(replace(engine, start=float(time)), y, contact, deep)
            if depth > radius:
                return float(time), depth
    except SolverError:
        pass  # other loops do not reach so far either: the run will show it
    return np.inf, 0.0


def _shallowest(engine: Engine, y: np.ndarray, contact: int, enough: float) -> tuple[np.ndarray, float]:
    """A state nearby in which the contact is least deep, or no deeper than `enough`; and how deep [m].

    Drives are where they are at the engine's start.
    """
    from scipy.optimize import minimize  # slow to import, and few runs come here

    y, nq, scales = project(engine, y), engine.model.nq, engine.model.speed_scales[: engine.model.nv]
    depth, box = _depth(engine, y, contact), [(-HALF_WIDTH, HALF_WIDTH)] * len(scales)
    for _ in range(BOXES):
        if depth <= enough:
            break
        middle, ways = y, per_speed(engine, y, lambda rates: rates[:nq]) * scales

        def there(x: np.ndarray, middle: np.ndarray = middle, ways: np.ndarray = ways) -> np.ndarray:
            moved = middle.copy()
            moved[:nq] += ways @ x
            return project(engine, moved)

        def fraction(x: np.ndarray, now: float = depth) -> float:
            return _depth(engine, there(x), contact) / now

        least = minimize(fraction, np.zeros(len(scales)), method="L-BFGS-B", bounds=box, options=OPTIONS)
        if not least.fun < 1.0 - LEAST_GAIN:
            break
        y, depth = there(least.x), float(least.fun) * depth
    return y, depth


def _depth(engine: Engine, y: np.ndarray, contact: int) -> float:
    """How deep the contact is [m]."""
    engine.attempt(y, engine.start)
    return -float(engine.table(m.TOUCH)["gap"][contact])
