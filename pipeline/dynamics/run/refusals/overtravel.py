"""Whether drives press a contact through its socket, however the rest of a mechanism with clearance gives way.

A drive that leads a loop with ideal joints out of reach ends the run there. With clearance the contact gives way
instead, in ever shorter steps, millions of which friction's slope at rest may ask for. What it must come to is a matter
of geometry: the least depth at the drives' positions, over all that they leave free. It is followed from the pose that
the run has come to along the drives' laws.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from flexclear.pipeline.core.system.errors import SolverError
from flexclear.pipeline.dynamics import memory as m
from flexclear.pipeline.dynamics.contact.validity import SHALLOW
from flexclear.pipeline.dynamics.run.evaluation.engine import Engine
from flexclear.pipeline.dynamics.run.evaluation.start import project, rates_at_speeds

#: times ahead at which the least depth is searched for
TIMES_AHEAD = 60
#: steps of a search; longest one, as fraction of the mechanism's size or in rad; how often one is halved
DESCENT_STEPS, LONGEST_STEP, STEP_HALVINGS = 60, 0.1, 12
#: a depth is the least when a step would take off less than this fraction of it; fraction of what its slope promises
#: that a step must take off (Armijo)
LEAST_GAIN, SUFFICIENT_DECREASE = 1e-3, 1e-4


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

    Quasi-Newton steps (BFGS) in the free speeds, by natural units; drives are where they are at the engine's start.
    Source: Nocedal & Wright, *Numerical Optimization*, 2nd ed. (2006), ch. 6.
    """
    scales = engine.model.speed_scales[: engine.model.nv]
    y = project(engine, y)
    depth, slope = _depth(engine, y, contact), _slope(engine, y, contact) * scales
    inverse = np.eye(len(slope)) / max(float(np.linalg.norm(slope)), 1e-300)
    for _ in range(DESCENT_STEPS):
        step = -inverse @ slope
        if depth <= enough or -(slope @ step) < LEAST_GAIN * depth:
            break
        step *= min(1.0, LONGEST_STEP / float(np.abs(step).max()))
        for _ in range(STEP_HALVINGS):
            there = _moved(engine, y, step * scales)
            less = _depth(engine, there, contact)
            if less <= depth + SUFFICIENT_DECREASE * float(slope @ step):
                break
            step *= 0.5
        else:
            break
        other = _slope(engine, there, contact) * scales
        inverse = _updated(inverse, step, other - slope)
        y, depth, slope = there, less, other
    return y, depth


def _updated(inverse: np.ndarray, step: np.ndarray, change: np.ndarray) -> np.ndarray:
    """The inverse Hessian after a step that changed the slope; where the slope is not convex, as it was."""
    along = float(step @ change)
    if not along > 1e-12 * float(np.linalg.norm(step) * np.linalg.norm(change)):
        return inverse
    V = np.eye(len(step)) - np.outer(step, change) / along
    return np.asarray(V @ inverse @ V.T + np.outer(step, step) / along)


def _depth(engine: Engine, y: np.ndarray, contact: int) -> float:
    """How deep the contact is [m]."""
    engine.attempt(y, engine.start)
    return -float(engine.table(m.TOUCH)["gap"][contact])


def _slope(engine: Engine, y: np.ndarray, contact: int) -> np.ndarray:
    """Change of the depth per unit of each free speed, drives at rest and closures satisfied, shape (nv,)."""

    def rate(speeds: np.ndarray) -> float:
        rates_at_speeds(engine, y, speeds)
        return float(engine.table(m.TOUCH)["rate"][contact])

    driven = rate(np.zeros(engine.model.nv))
    return np.array([rate(unit) - driven for unit in np.eye(engine.model.nv)])


def _moved(engine: Engine, y: np.ndarray, displacement: np.ndarray) -> np.ndarray:
    """The state after a displacement by free coordinates, loops closed."""
    there, nq = y.copy(), engine.model.nq
    there[:nq] += rates_at_speeds(engine, y, displacement)[:nq] - rates_at_speeds(engine, y, 0.0 * displacement)[:nq]
    return project(engine, there)
